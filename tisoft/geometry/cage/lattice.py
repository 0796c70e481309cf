"""The lattice of a cage: its axes, its cells, fitted to the box of the surface.

The axes are those along which most of the surface lies, by the score

    Σ A (n₁⁴ + n₂⁴ + n₃⁴)/Σ A     1: all faces along the axes; .6: none preferred

of the world's axes, the principal axes, and the two largest groups of normals.  The world's are
left only for a gain.  A box that the lattice fits is meshed exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError
from tisoft.geometry.surface import solid_moments

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

GAIN = 0.03
"""Score that other axes must gain on the world's."""
MOST_CELLS = 50_000_000
"""Cells of a lattice, the empty ones counted."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """Cells in a box: point = origin + axes (k · size), k counted along the axes."""

    axes: Floats
    """Its axes in the columns, shape (3, 3)."""
    origin: Floats
    """Its lowest corner [m], shape (3,)."""
    size: Floats
    """Edges of a cell [m], shape (3,)."""
    cells: Rows
    """How many along each axis, shape (3,)."""

    def local(self, points: Floats) -> Floats:
        """Points in cells from the origin along the axes."""
        return np.asarray((points - self.origin) @ self.axes / self.size)

    def world(self, local: Floats) -> Floats:
        """Points [m] of places counted in cells."""
        return np.asarray(self.origin + (local * self.size) @ self.axes.T)

    @property
    def is_turned(self) -> bool:
        """Whether its axes are not the world's."""
        return not np.array_equal(self.axes, np.eye(3))


def fitted(
    points: Floats, triangles: Rows, *, size: float | None = None, across: int | None = None
) -> Lattice:
    """The lattice of about cubic cells with edges of about `size` [m], or with `across` cells along
    the shortest side of its box.

    Raises:
        MeshError: too many cells, or cells larger than the surface.
    """
    axes = best_axes(points, triangles)
    local = points @ axes
    low, extent = local.min(axis=0), np.ptp(local, axis=0)
    edge = float(extent.min()) / across if across else float(size or 0.0)
    if extent.max() < edge * (1.0 - 1e-9):
        box = " x ".join(f"{x:.4g}" for x in extent)
        raise MeshError(f"its surface ({box} m) is smaller than one cell of {edge:.4g} m")
    # In logarithms: a tiny size must not overflow.
    if float(np.log(np.maximum(extent / edge, 1.0)).sum()) > np.log(MOST_CELLS):
        raise MeshError(
            f"cells of {edge:.4g} m make a lattice of more than {MOST_CELLS:,} cells; take larger"
        )
    cells = np.maximum(1, np.round(extent / edge)).astype(np.int64)
    return Lattice(axes, axes @ low, extent / cells, cells)


def best_axes(points: Floats, triangles: Rows) -> Floats:
    """The axes, in the columns, of a right-handed frame."""
    x = points[triangles]
    normals = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    keep = areas > 0.0
    normals, areas = normals[keep] / areas[keep, None], areas[keep]
    found = np.eye(3)
    best = alignment(normals, areas, found) + GAIN
    for axes in (_principal(points, triangles), _along_normals(normals, areas)):
        score = alignment(normals, areas, axes)
        if score > best:
            best, found = score, axes
    return found


def alignment(normals: Floats, areas: Floats, axes: Floats) -> float:
    """The score of a frame."""
    return float(areas @ ((normals @ axes) ** 4).sum(axis=1) / areas.sum())


def _principal(points: Floats, triangles: Rows) -> Floats:
    volume, first, second = solid_moments(points, triangles)
    center = first / volume
    return _framed(np.linalg.eigh(second / volume - np.outer(center, center))[1])


def _along_normals(normals: Floats, areas: Floats) -> Floats:
    first = _heaviest(normals, areas)
    second = _heaviest(normals, areas * (np.abs(normals @ first) < 0.1))
    second = second - (second @ first) * first
    if np.linalg.norm(second) < 0.5:
        second = np.linalg.svd(first[None])[2][1]
    second = second / np.linalg.norm(second)
    return _framed(np.stack([first, second, np.cross(first, second)], axis=1))


def _heaviest(normals: Floats, areas: Floats) -> Floats:
    """Mean normal of the group, up to sign, with the largest area."""
    sign = np.sign(normals[np.arange(len(normals)), np.abs(normals).argmax(axis=1)])
    one_way = normals * sign[:, None]
    spot = np.round(20.0 * one_way).astype(np.int64)
    _, group = np.unique(spot @ [1, 100, 10000], return_inverse=True)
    group = group.reshape(-1)
    chosen = group == np.bincount(group, areas).argmax()
    mean = areas[chosen] @ one_way[chosen]
    size = np.linalg.norm(mean)
    return np.asarray(mean / size if size > 0.0 else mean)


def _framed(axes: Floats) -> Floats:
    """The frame with each axis as near to the world's axis of its number as may be."""
    order, left = [], [0, 1, 2]
    for k in range(3):
        order.append(max(left, key=lambda c: abs(axes[k, c])))
        left.remove(order[-1])
    axes = axes[:, order]
    axes = axes * np.where(np.diag(axes) < 0.0, -1.0, 1.0)
    if np.linalg.det(axes) < 0.0:
        axes = axes * [1.0, 1.0, -1.0]
    return axes
