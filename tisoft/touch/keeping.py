"""Which bodies touch themselves, and the distance that one keeps; `check` asks without Taichi."""

from __future__ import annotations

from typing import Any

import numpy as np

from tisoft.models.materials import MassSpring

THINNEST = 0.02
"""Least thickness, of the median edge: what the sweeps leave over would let surfaces through."""
THICKEST = 0.5
"""The most, of what touches itself: points that are no neighbours lie that far apart in it."""


def touches_itself(body: Any) -> bool:
    """Whether a body's surface does: as its key says, else sheets of springs, which have a rim."""
    if body.self_contact is not None:
        return bool(body.self_contact)
    surface = np.asarray(body.mesh.surface)
    if not isinstance(body.model, MassSpring) or not len(surface):
        return False
    sides = np.sort(surface[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return bool((np.unique(sides, axis=0, return_counts=True)[1] == 1).any())


def kept_distance(body: Any, edge: float) -> float:
    """Distance [m] that a body of this thickness keeps; `edge`: median of its surface's [m]."""
    assert body.thickness is not None
    kept = max(body.thickness, THINNEST * edge)
    return min(kept, THICKEST * edge) if touches_itself(body) else kept
