"""The chart as a picture: error against cost, both logarithmic, with names beside the points."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from tisoft.charting.names import write_names
from tisoft.study import pictures

if TYPE_CHECKING:
    from tisoft.charting.chart import Chart
    from tisoft.charting.judged import Judged
    from tisoft.charting.steps import StepSide

LOOK = {
    "tet4": ("o", pictures.BLUE), "tet10": ("s", pictures.RED), "hex8": ("D", pictures.GREEN),
    "spring": ("^", pictures.ORANGE),
}  # fmt: skip
"""Marker and colour of each element: the shape tells as much as the colour."""
COLORS = (pictures.BLUE, pictures.RED, pictures.GREEN)


def draw(ax: Any, chart: Chart) -> None:
    """Draw a chart into Axes."""
    for v in chart.variants:
        marker, color = LOOK.get(v.element, ("v", pictures.GREY))
        y, low = v.shown, _low(v)
        if not v.worst.below:
            ax.plot([v.cost, v.cost], [low, v.worst.most], color=color, lw=1.0, alpha=0.6)
        else:
            ax.annotate(
                "", (v.cost, 0.6 * y), (v.cost, y),
                arrowprops={"arrowstyle": "->", "color": color, "lw": 1.0},
            )  # fmt: skip
        ax.plot(
            v.cost, y, marker, color=color if not v.worst.below else "white", mec=color, ms=7,
            gid=f"variant-{chart.variants.index(v)}", zorder=4,
        )  # fmt: skip
        if v.current:
            ax.plot(v.cost, y, "o", ms=16, mfc="none", mec=pictures.BLACK, mew=1.6, zorder=5)
    line = joined(chart)
    ax.plot([v.cost for v in line], [v.shown for v in line], color=pictures.GREY, zorder=1)
    ax.set_xscale("log")
    ax.set_yscale("log")
    _scale(ax.xaxis, ax.set_xlim, [v.cost for v in chart.variants], 1.0)
    ends = [end for v in chart.variants for end in (_low(v), v.worst.most)]
    _scale(ax.yaxis, ax.set_ylim, ends, 100.0)
    ax.set_xlabel("seconds of computing a simulated second, on this machine")
    ax.set_ylabel("predicted error in per cent (the larger of those that count)")
    ax.set_title("\n".join(chart.sentences()), fontsize=9)
    write_names(ax, chart, line)  # last: they need all else in its place


def joined(chart: Chart) -> list[Judged]:
    """The variants that the line joins: the front, less those that are drawn at the end of a bar
    above a cheaper one."""
    line: list[Judged] = []
    for v in chart.pareto:
        if not line or v.shown < line[-1].shown:
            line.append(v)
    return line


def _low(v: Judged) -> float:
    """The lower end of a bar, as far as it is drawn."""
    return max(v.worst.value - v.worst.bar, 0.3 * v.shown)


def _scale(axis: Any, limit: Callable[..., Any], values: list[float], unit: float) -> None:
    """A logarithmic axis with room around the values and plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = min(values), max(values)
    room = max(1.3, (high / low) ** 0.12)
    low, high = low / room, high * room
    limit(low, high)
    narrow = high / low < 300.0
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if narrow else (1.0,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{unit * value:.12g}"))
    axis.set_minor_formatter(NullFormatter())


def files(chart: Chart) -> tuple[bytes, str]:
    """The picture as PNG and as SVG."""
    return _written((8.6, 5.6), lambda figure: draw(figure.subplots(), chart))


def step_picture(chart: Chart) -> str:
    """The step side as SVG; empty where the chart has none."""
    side = chart.steps
    if side is None:
        return ""
    return _written((8.6, 4.6), lambda figure: draw_steps(figure, side), is_svg_alone=True)[1]


def draw_steps(figure: Any, side: StepSide) -> None:
    """Error above and cost below, against the step as a share of the limit."""
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    styles = ("-", "--", ":")
    for curve, style, color in zip(side.curves, styles, COLORS, strict=False):
        stable = np.isfinite(curve.errors)
        x, y = curve.steps[stable] / side.limit, curve.errors[stable]
        above.plot(x, y, style, color=color, marker="o", ms=3)
        above.annotate(
            curve.integrator, (x[3], y[3]), (4, 6 if style == "-" else -12),
            textcoords="offset points", fontsize=8, color=color,
        )  # fmt: skip
    cost = side.curves[0]
    below.plot(cost.steps / side.limit, cost.costs, color=pictures.GREY)
    above.axhline(side.mesh, color=pictures.GREY, lw=1.0)
    above.annotate(
        "what mesh and model err by", (0.05, side.mesh), (2, 3), textcoords="offset points",
        fontsize=8, color=pictures.GREY,
    )  # fmt: skip
    for axes in (above, below):
        axes.axvspan(1.0, 2.0, color="0.88", zorder=0)
        axes.axvline(side.step / side.limit, color=pictures.BLACK, lw=1.2)
        axes.set_xscale("log")
        axes.set_yscale("log")
    above.annotate(
        f"now: {100 * side.step / side.limit:.0f} % of the limit", (side.step / side.limit, 1.0),
        (-4, -10), xycoords=("data", "axes fraction"), textcoords="offset points", ha="right",
        fontsize=8,
    )  # fmt: skip
    above.annotate(
        "past the limit:\nit blows up", (1.06, 0.5), xycoords=("data", "axes fraction"), fontsize=8
    )
    above.set_ylabel("error of the step alone")
    below.set_ylabel("s a simulated s")
    below.set_xlabel(f"step, as a share of the stable limit ({side.limit:.3g} s)")
    below.set_xlim(0.05, 2.0)
    below.set_xticks(
        [0.05, 0.1, 0.2, 0.5, 1.0, 2.0], ["5 %", "10 %", "20 %", "50 %", "100 %", "200 %"]
    )
    below.minorticks_off()


def _written(
    size: tuple[float, float], fill: Callable[[Any], None], *, is_svg_alone: bool = False
) -> tuple[bytes, str]:
    with pictures.matplotlib_style() as figure_class:
        figure = figure_class(figsize=size)
        fill(figure)
        figure.canvas.draw()
        figure.set_layout_engine("none")  # the same for both files
        png, svg = io.BytesIO(), io.StringIO()
        if not is_svg_alone:
            figure.savefig(png, format="png", dpi=110, metadata={"Software": None})
        figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
    return png.getvalue(), svg.getvalue()
