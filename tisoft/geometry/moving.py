"""Where a mesh is put: scaled, turned, moved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tisoft import checks
from tisoft.geometry.checks import as_of

Floats = NDArray[np.float64]


def moved(
    points: Floats, scale: float, rotate: Sequence[float], translate: Sequence[float]
) -> Floats:
    """Points scaled, then turned about x, y and z [degrees], then moved [m].  Raises MeshError."""
    with as_of(""):
        scale = checks.number("scale", scale, above=0.0)
        angles = np.array(checks.vector("rotate", rotate, unit="degrees"))
        shift = np.array(checks.vector("translate", translate, unit="m"))
    if angles.any():
        return (scale * points) @ rotation(angles).T + shift
    return scale * points + shift


def rotation(angles: Sequence[float] | Floats) -> Floats:
    """About x, then y, then z [degrees], shape (3, 3)."""
    turn = np.eye(3)
    for axis, angle in enumerate(np.deg2rad(angles)):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        about = np.eye(3)
        about[i, i] = about[j, j] = np.cos(angle)
        about[j, i], about[i, j] = np.sin(angle), -np.sin(angle)
        turn = about @ turn
    return turn
