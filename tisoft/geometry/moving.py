"""Where a mesh is put: scaled, turned, moved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError

Floats = NDArray[np.float64]


def moved(
    points: Floats, scale: float, rotate: Sequence[float], translate: Sequence[float]
) -> Floats:
    """Points scaled, then turned about x, y and z [degrees], then moved [m]."""
    if not (np.isfinite(scale) and scale > 0):
        raise MeshError(f"scale must be a positive number, not {scale!r}")
    angles, shift = np.asarray(rotate, dtype=float), np.asarray(translate, dtype=float)
    for name, vector in (("rotate", angles), ("translate", shift)):
        if vector.shape != (3,) or not np.isfinite(vector).all():
            raise MeshError(f"{name} must be three finite numbers, not {vector.tolist()!r}")
    turn = np.eye(3)
    for axis, angle in enumerate(np.deg2rad(angles)):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        about = np.eye(3)
        about[i, i] = about[j, j] = np.cos(angle)
        about[j, i], about[i, j] = np.sin(angle), -np.sin(angle)
        turn = about @ turn
    if angles.any():
        return (scale * points) @ turn.T + shift
    return scale * points + shift
