"""Triangles cut at the planes of a lattice, so that each piece lies in one cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

ON = 1e-9
"""Distance, in cells, up to which a point lies on a plane."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Triangles of a surface in pieces."""

    points: Floats
    """Corners in cells from the lattice's origin, shape (pieces, 3, 3)."""
    parents: Rows
    """Triangle that each is a piece of, shape (pieces,)."""
    cells: Rows
    """Cell that each lies in, shape (pieces, 3); of those on a plane, the one on its inner side."""


def cut(local: Floats, triangles: Rows, cells: Rows) -> Pieces:
    """The triangles between points `local`, given in cells, in pieces; `cells`: along each axis."""
    # Points that all but lie on a plane do: a piece must not be thinner than rounding.
    near = np.round(local)
    points = np.where(np.abs(local - near) < ON, near, local)[triangles]
    parents = np.arange(len(triangles))
    for axis in range(3):
        points, parents = _cut_along(points, parents, axis)
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    keep = np.abs(normals).max(axis=1) > 0.0
    points, parents, normals = points[keep], parents[keep], normals[keep]
    middle = points.mean(axis=1)
    owner = np.floor(middle).astype(np.int64)
    for axis in range(3):
        plane = np.round(middle[:, axis])
        on = np.abs(points[:, :, axis] - plane[:, None]).max(axis=1) < 10.0 * ON
        inner = np.where(normals[:, axis] > 0.0, plane - 1.0, plane)
        owner[on, axis] = inner[on].astype(np.int64)
    return Pieces(points, parents, np.clip(owner, 0, cells - 1))


def _cut_along(points: Floats, parents: Rows, axis: int) -> tuple[Floats, Rows]:
    """Pieces that cross no plane of one axis."""
    done, owners = [], []
    while len(points):
        x = points[:, :, axis]
        plane = np.floor(x.min(axis=1) + ON) + 1.0
        crossing = x.max(axis=1) > plane + ON
        done.append(points[~crossing])
        owners.append(parents[~crossing])
        points, parents = _halved(points[crossing], parents[crossing], plane[crossing], axis)
    return np.concatenate([np.empty((0, 3, 3)), *done]), np.concatenate(
        [np.empty(0, np.int64), *owners]
    )


def _halved(points: Floats, parents: Rows, plane: Floats, axis: int) -> tuple[Floats, Rows]:
    """Both sides of triangles that cross a plane."""
    height = points[:, :, axis] - plane[:, None]
    height[np.abs(height) < ON] = 0.0
    above, below = (height > 0.0).sum(axis=1), (height < 0.0).sum(axis=1)
    on = (above == 1) & (below == 1)
    lone = np.where(above == 1, (height > 0.0).argmax(axis=1), (height < 0.0).argmax(axis=1))
    lone = np.where(on, (height == 0.0).argmax(axis=1), lone)
    order = (lone[:, None] + np.arange(3)) % 3
    rows = np.arange(len(points))[:, None]
    p, z = points[rows, order], height[rows, order]
    parts, owners = [np.empty((0, 3, 3))], [np.empty(0, np.int64)]

    def between(own: NDArray[np.bool_], a: int, b: int) -> Floats:
        share = (z[own, a] / (z[own, a] - z[own, b]))[:, None]
        made = p[own, a] + share * (p[own, b] - p[own, a])
        made[:, axis] = plane[own]
        return np.asarray(made)

    def add(own: NDArray[np.bool_], *corners: Floats) -> None:
        parts.append(np.stack(corners, axis=1))
        owners.append(parents[own])

    if on.any():  # from the corner on the plane to the opposite side
        c = between(on, 1, 2)
        add(on, p[on, 0], p[on, 1], c)
        add(on, p[on, 0], c, p[on, 2])
    if (~on).any():  # one corner on its side, two on the other
        b, c = between(~on, 0, 1), between(~on, 0, 2)
        add(~on, p[~on, 0], b, c)
        add(~on, b, p[~on, 1], p[~on, 2])
        add(~on, b, p[~on, 2], c)
    return np.concatenate(parts), np.concatenate(owners)
