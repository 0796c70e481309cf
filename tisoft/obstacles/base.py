"""What faces of bodies meet of an obstacle: its core, a point or a line with a radius, and its
corners, the points and edges of its surface.  Nodes meet its `distance` besides.

Points are kept in the obstacle's own coordinates, from which `corner` of its file makes places:
those are the same however it moves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

POINT, LINE, FLAT_LINE = 1, 2, 3
"""Kinds of cores: balls, capsules, and the side of a cylinder, which has no round ends."""


class Core(NamedTuple):
    """A point, or the two ends of a line."""

    kind: int
    local: Floats
    rest: Floats
    """Places at t = 0 [m]."""
    radius: float
    """[m]"""


class Corners(NamedTuple):
    """Points and triangles of a closed surface, counter-clockwise from outside."""

    local: Floats
    rest: Floats
    """Places at t = 0 [m]."""
    triangles: NDArray[np.int64]
