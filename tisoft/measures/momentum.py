"""Linear and angular momentum of a running scene, from its masses.

p = Σ m v,   L = Σ m (x − c) × v;   consistent mass: L = Σ_tets ρV/20 [Σx × Σv + Σ x × v]
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.model.part import Part
from tisoft.model.system import System

Floats = NDArray[np.float64]


def linear_momentum(system: System, parts: Sequence[Part]) -> Floats:
    """p [kg·m/s] of some bodies, shape (3,); consistent mass gives the same as lumped."""
    v = system.v.astype(np.float64)
    total = np.zeros(3)
    for part in parts:
        total += part.mass @ v[part.nodes]
    return total


def angular_momentum(system: System, parts: Sequence[Part], about: Any) -> Floats:
    """L about a point [m] of some bodies [kg·m²/s], shape (3,)."""
    x = system.world() - np.asarray(about, np.float64)
    v = system.v.astype(np.float64)
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
