"""Linear and angular momentum of a running scene, from its masses.

p = Σ m v,   L = Σ m (x − c) × v;   consistent mass: L = Σ_tets ρV/20 [Σx × Σv + Σ x × v]
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tisoft.model.part import Part

Floats = NDArray[np.float64]


def linear_momentum(parts: Sequence[Part], v: Floats) -> Floats:
    """p [kg·m/s] of some bodies at velocities v [m/s], shape (3,); consistent mass gives the same
    as lumped.
    """
    total = np.zeros(3)
    for part in parts:
        total += part.mass @ v[part.nodes]
    return total


def angular_momentum(parts: Sequence[Part], x: Floats, v: Floats) -> Floats:
    """L of some bodies [kg·m²/s] about the point from which places x [m] are seen, at velocities v
    [m/s], shape (3,).
    """
    total = np.zeros(3)
    for part in parts:
        total += _spin(part, x[part.nodes], v[part.nodes])
    return total


def _spin(part: Part, x: Floats, v: Floats) -> Floats:
    if not part.is_consistent:
        return np.asarray(part.mass @ np.cross(x, v))
    total = np.zeros(3)
    for cells in part.solids:
        xs, vs = x[cells.nodes], v[cells.nodes]
        sums = np.cross(xs.sum(axis=1), vs.sum(axis=1)) + np.cross(xs, vs).sum(axis=1)
        total += cells.solid.density / 20.0 * (cells.volume @ sums)
    return total
