"""Pictures of the studies: one style, PNG and SVG, whole files only."""

from __future__ import annotations

import io
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tisoft.study.axis import Axis
from tisoft.whole_files import write_bytes, write_text

if TYPE_CHECKING:
    from collections.abc import Iterator

BLUE, RED, GREEN, ORANGE, GREY, BLACK = (
    "#0072B2", "#D55E00", "#009E73", "#E69F00", "#8a8a8a", "#222222",
)  # fmt: skip
"""Colours that stay apart for every eye (Okabe and Ito 2008)."""

COLORS = {"viscoelastic": BLUE, "neo-hookean": GREEN, "linear": RED, "mass-spring": ORANGE}
MARKERS = {"viscoelastic": "o", "neo-hookean": "s", "linear": "^", "mass-spring": "D"}

SIZES = {"viscoelastic": 8.0, "neo-hookean": 6.0, "linear": 5.5, "mass-spring": 3.5}
"""Of markers [pt]: models that agree stay visible."""

STYLE: dict[str, Any] = {
    "font.size": 9.5,
    "font.family": "DejaVu Sans",
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.titlepad": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.edgecolor": "#666666",
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.8,
    "legend.frameon": True,
    "legend.framealpha": 0.9,
    "legend.edgecolor": "#dddddd",
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.8,
    "lines.markersize": 5,
    "figure.facecolor": "white",
    "figure.constrained_layout.use": True,
    "svg.hashsalt": "tisoft",  # the same picture is the same file
    "svg.fonttype": "path",
}


def save(axis: Axis, folder: Path, *, dpi: int = 110) -> list[Path]:
    """Draw an axis into `folder` as NAME.png and NAME.svg; raises SceneError."""
    with matplotlib_style() as figure_class:
        figure = figure_class(figsize=axis.size)
        axis.draw(figure)
        png, svg = io.BytesIO(), io.StringIO()
        figure.savefig(png, format="png", dpi=dpi, metadata={"Software": None})
        figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
    paths = [folder / f"{axis.name}.png", folder / f"{axis.name}.svg"]
    write_bytes(paths[0], png.getvalue())
    write_text(paths[1], svg.getvalue())
    return paths


@contextmanager
def matplotlib_style() -> Iterator[Any]:
    """The Figure class in this style, drawn off-screen; leaves the caller's settings alone."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    def make(**options: Any) -> Any:
        figure = Figure(**options)
        FigureCanvasAgg(figure)
        return figure

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)  # type: ignore[arg-type]
        yield make
