"""Two meshes of balls and cylinders: their corners cut the surface, whatever their elements.

What that errs by falls with the square of the cells, so that the truth F + γ (F − C) beyond
quadratic tets C and F is better known than for other shapes.  Measured, with cells of a ratio ρ
between 4/3 and 2, γ (ρ² − 1) is

    .93 … .99   free balls, Poisson's ratio 0 to .45             .75 … 1.15 is taken
    .34 … 1.01  cylinders held at an end, .3                     .3  … 1.3

Nearly incompressible ones converge otherwise, and so do meshes of which pins hold other places.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tisoft.body import Body
from tisoft.charting.estimate import Range
from tisoft.charting.variants import poisson_of
from tisoft.scene import Scene

Floats = NDArray[np.float64]

FREE: Range = (0.95 / 3.0, 0.2 / 3.0)
HELD: Range = (0.8 / 3.0, 0.5 / 3.0)
"""Of γ where cells are halved."""
COMPRESSIBLE = 0.45
"""The largest Poisson's ratio."""
ALIKE = 0.05
"""Share of a body's size within which the ends of what is held are the same."""


def range_of(coarse: Scene, fine: Scene, bodies: Sequence[int]) -> Range | None:
    """γ of two meshes of bodies that are curved, or None where it is no better known.

    Args:
        coarse: the scene with the larger cells.
        fine: with the smaller ones.
        bodies: numbers of those that vary.
    """
    pairs = [(coarse.bodies[i], fine.bodies[i]) for i in bodies]
    if any(poisson_of(body) > COMPRESSIBLE for body, _ in pairs):
        return None
    ends = [(_ends(one), _ends(other)) for one, other in pairs]
    if not any(len(own) for own, _ in ends):
        return FREE
    for (own, its), (body, _) in zip(ends, pairs, strict=True):
        size = float(np.ptp(body.mesh.points, axis=0).max())
        if np.abs(own - its).max(initial=0.0) > ALIKE * size:
            return None
    return HELD


def _ends(body: Body) -> Floats:
    """Corners of the boxes around the nodes that pins hold and loads push [m]."""
    chosen = [pin.where for pin in body.pins] + [load.where for load in body.loads]
    rows = [body.mesh.points[body.nodes(where)] for where in chosen]
    boxes = [[x.min(axis=0), x.max(axis=0)] for x in rows]
    return np.array(boxes).reshape(-1, 2, 3)
