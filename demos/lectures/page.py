"""What the pages of the lectures share: theory beside what was computed, and a picture."""

from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure


def check(what: str, theory: Any, computed: Any, *, within: float) -> None:
    """Print theory beside what was computed, and fail where they are too far apart.

    `within` is relative to theory; where theory is 0, it is the largest size allowed.
    """
    off = abs(computed - theory) / (abs(theory) or 1.0)
    print(f"{what:52} {theory:12.6g} {computed:12.6g}   off by {off:.1e}, allowed {within:.0e}")
    assert off <= within, f"{what}: theory says {theory:.6g}, computed was {computed:.6g}"


def begin(text: str | None) -> None:
    """Print the first line of a page's own words, and the table's head."""
    print((text or "").splitlines()[0], "\n")
    print(f"{'':52} {'theory':>12} {'computed':>12}")


def axes(count: int = 1, **labels: Any) -> list[Axes]:
    """`count` diagrams side by side, with labels for the first, as xlabel="time [s]"."""
    figure = Figure(figsize=(4.0 * count if count > 1 else 6.0, 3.6), layout="constrained")
    row = figure.subplots(1, count, squeeze=False)[0]
    row[0].set(**labels)
    return list(row)


def save(file: str, axis: Axes) -> None:
    """Write the picture of a page into the current folder, under the page's name."""
    path = Path(file).with_suffix(".png").name
    figure = axis.figure
    assert isinstance(figure, Figure)
    figure.savefig(path, dpi=90)
    print(f"\nwrote {path}")
