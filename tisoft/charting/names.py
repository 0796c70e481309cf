"""Names beside the points of a chart: each where it covers nothing, or not at all."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from tisoft.charting.chart import Chart
    from tisoft.charting.judged import Judged

MOST = 24
PLACES = (
    (9, 5, "left"), (9, -11, "left"), (-9, 5, "right"), (-9, -11, "right"),
    (12, -3, "left"), (-12, -3, "right"), (0, 12, "center"), (0, -18, "center"),
)  # fmt: skip
"""Offsets [pt] from a point, and the side of the text that lies there."""
ELSEWHERE = 1000
"""What it counts to be nearer to another point, in places of the line that are crossed."""
ALIKE = 2.0
"""Pixels within which two points are one."""
MARKER, CIRCLE = 6.0, 12.0
"""Half the width of what is drawn at a point [pixels]: of a variant, and of the scene itself."""


def write_names(ax: Any, chart: Chart, line: list[Judged]) -> None:
    """Names, the best variants' first; a name that would cover a point or a name is left out."""
    ax.figure.canvas.draw()
    at = {v.name: ax.transData.transform((v.cost, v.shown)) for v in chart.variants}
    points = np.array([at[v.name] for v in chart.variants])
    sizes = np.array([CIRCLE if v.current else MARKER for v in chart.variants])
    dots = _dots([at[v.name] for v in line])
    taken: list[Any] = []
    for v in sorted(chart.variants, key=lambda v: (not v.current, not v.pareto, v.cost))[:MOST]:
        best: tuple[int, Any, Any] | None = None
        for dx, dy, side in PLACES:
            text = ax.annotate(
                "your scene" if v.current else v.name, (v.cost, v.shown), (dx, dy),
                textcoords="offset points", ha=side, fontsize=8, zorder=6,
                weight="bold" if v.current else "normal",
            )  # fmt: skip
            box = text.get_window_extent()
            covers = sum(box.overlaps(other) for other in taken)
            covers += int(_inside(box, points, sizes).sum()) + (not _within(box, ax))
            crosses = int(_inside(box, dots, np.zeros(len(dots))).sum())
            crosses += ELSEWHERE * _is_nearer_another(box, points, at[v.name])
            text.set_visible(False)
            if covers == 0 and (best is None or crosses < best[0]):
                best = crosses, text, box
        if best is not None:
            best[1].set_visible(True)
            taken.append(best[2])


def _dots(corners: list[Any]) -> Any:
    """Points along a line, a few pixels apart, shape (n, 2)."""
    if len(corners) < 2:
        return np.empty((0, 2))
    parts = [np.linspace(a, b, 2 + int(np.linalg.norm(b - a) / 4.0)) for a, b in pairwise(corners)]
    return np.concatenate(parts)


def _inside(box: Any, points: Any, sizes: Any) -> Any:
    """Which points' squares overlap a box."""
    x, y = points.T
    return (x + sizes > box.x0) & (x - sizes < box.x1) & (y + sizes > box.y0) & (y - sizes < box.y1)


def _is_nearer_another(box: Any, points: Any, own: Any) -> bool:
    """Whether a name would be read as another point's, which lies nearer or about as near."""
    ends = np.array([[box.x0, box.y0], [box.x1, box.y1]])
    off = np.linalg.norm(np.maximum(np.maximum(ends[0] - points, points - ends[1]), 0.0), axis=1)
    apart = np.linalg.norm(points - own, axis=1) > ALIKE
    mine = off[~apart].min()
    return bool((off[apart] < mine + MARKER).any())


def _within(box: Any, ax: Any) -> bool:
    whole = ax.get_window_extent()
    return bool(box.x0 >= whole.x0 and box.x1 <= whole.x1 + 4.0 and box.y0 >= whole.y0)
