"""Balls and cylinders of hexahedra: a rounded block in the middle, layers around it.

A place q of the block, −1 .. 1 along each axis, t = max |q_i|, lies at

    x = s ((1 − β t) q + β t² g q/|q|)

and the layers lead from there along straight lines to the circle or sphere, at r q'/|q'| with
q'_i = tan(π q_i/4), so that they are as wide everywhere.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.cells import LATTICE

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

SIZE = 0.45
"""s, in radii."""
ROUND = 0.65
"""β; both are where the stable step is longest, for 2 to 7 cells across."""
REACH = {2: 1.15, 3: 1.3}
"""g: how far the border of the block is from its middle, in s, on average, by axes."""
SAME = 1e-6
"""Distance of places that are one, in radii."""


def layers(resolution: int) -> int:
    """How many there are round a block of `resolution` cells across."""
    return max(1, round((1.0 - SIZE) / (2.0 * SIZE) * resolution))


def _block(q: Floats) -> Floats:
    """Where places of the block lie, in radii."""
    n = q.shape[-1]
    t = np.abs(q).max(axis=-1, keepdims=True)
    length = np.linalg.norm(q, axis=-1, keepdims=True)
    bulge = REACH[n] * t**2 * q / np.where(length > 0.0, length, 1.0)
    return np.asarray(SIZE * ((1.0 - ROUND * t) * q + ROUND * bulge))


def _layer(q: Floats, share: Floats) -> Floats:
    """Places on the way from the block's border to the circle or sphere, in radii."""
    even = np.tan(0.25 * np.pi * q)
    outside = even / np.linalg.norm(even, axis=-1, keepdims=True)
    inside = _block(q)
    return np.asarray(inside + share[..., None] * (outside - inside))


def cells_of_disc_or_ball(resolution: int, axes: int) -> tuple[Floats, Rows]:
    """Places [radii], shape (nodes, axes), and corners of cells in the order of a lattice."""
    steps = np.linspace(-1.0, 1.0, resolution + 1)
    ways = np.linspace(0.0, 1.0, layers(resolution) + 1)
    grids = [_block(np.stack(np.meshgrid(*[steps] * axes, indexing="ij"), axis=-1))]
    for axis, side in itertools.product(range(axes), (-1.0, 1.0)):
        *around, way = np.meshgrid(*[steps] * (axes - 1), ways, indexing="ij")
        q = np.empty((*way.shape, axes))
        q[..., axis] = side
        others = [(axis + 1 + k) % axes for k in range(axes - 1)]
        for place, d in zip(around, others, strict=True):
            q[..., d] = place
        grids.append(_layer(q, way))
    points = np.concatenate([g.reshape(-1, axes) for g in grids])
    corners, begun = [], 0
    for g in grids:
        corners.append(begun + _corners_of(g.shape[:-1]))
        begun += g[..., 0].size
    _, first, index = np.unique(
        np.round(points / SAME).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    return points[first], index.reshape(-1)[np.concatenate(corners)]


def _corners_of(shape: tuple[int, ...]) -> Rows:
    """Nodes of the cells of a grid, corner c at bits of c along its axes."""
    number = np.arange(int(np.prod(shape))).reshape(shape)
    rows = []
    for c in range(1 << len(shape)):
        part = tuple(slice(1, None) if c >> d & 1 else slice(None, -1) for d in range(len(shape)))
        rows.append(number[part].ravel())
    return np.stack(rows, axis=1)


def _right_way(points: Floats, corners: Rows) -> Rows:
    """Cells of a lattice's order, mirrored ones the right way round."""
    X = points[corners]
    turn = np.linalg.det(X[:, [1, 2, 4]] - X[:, :1])
    corners = corners.copy()
    corners[turn < 0.0] = corners[turn < 0.0][:, [1, 0, 3, 2, 5, 4, 7, 6]]
    return corners


def hex_ball(radius: float, resolution: int) -> tuple[Floats, Rows]:
    """Points [m] and hexahedra, corners in VTK's order, of a ball round the origin."""
    points, corners = cells_of_disc_or_ball(resolution, 3)
    return radius * points, _right_way(points, corners)[:, LATTICE]


def hex_cylinder(radius: float, height: float, resolution: int) -> tuple[Floats, Rows]:
    """Points [m] and hexahedra of a cylinder about the y axis, standing on y = 0, in layers about
    as high as its cells are wide.
    """
    disc, quads = cells_of_disc_or_ball(resolution, 2)
    count = max(1, round(height / (radius / resolution)))
    points = np.empty((count + 1, len(disc), 3))
    points[..., 0], points[..., 2] = radius * disc.T
    points[..., 1] = np.linspace(0.0, height, count + 1)[:, None]
    each = [np.hstack([quads + k * len(disc), quads + (k + 1) * len(disc)]) for k in range(count)]
    flat = points.reshape(-1, 3)
    return flat, _right_way(flat, np.concatenate(each))[:, LATTICE]
