"""A closed surface in a lattice of hexahedra that carries it.

Cells that the surface fills in part count by their exact moments: volume, mean gradient and mass
are those of the filled part (`elements.hex8`).  The surface moves with its cells: x = Σ N_a(ξ) x_a.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError
from tisoft.geometry.cage.carried import CORNER, shares
from tisoft.geometry.cage.cutting import cut
from tisoft.geometry.cage.lattice import Lattice, fitted
from tisoft.geometry.cage.masses import balanced
from tisoft.geometry.cage.moments import filled
from tisoft.geometry.cells import LATTICE
from tisoft.geometry.checks import check_range, index_rows, positions
from tisoft.geometry.skin import Skin
from tisoft.geometry.solid import SolidMesh
from tisoft.geometry.surface import closed, joined, solid_moments

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

LEAST_FILL = 0.01
"""Fill below which a cell is left out."""


@dataclass(frozen=True, eq=False)
class Cage:
    """What a lattice knows of the surface it carries; nothing of it changes when both are moved."""

    lattice: Lattice
    """As it was built."""
    cells: Rows
    """Place of each hexahedron in the lattice, shape (hexes, 3)."""
    moments: Floats
    """φ and means over the filled part of each hexahedron (`moments`), shape (hexes, 7)."""
    factor: Floats
    """What each node's mass is multiplied by, shape (nodes,)."""
    skin: Skin
    """The surface."""
    inertia_error: float
    """Largest relative error of the three moments of inertia."""


def cage(
    points: Floats,
    triangles: NDArray[np.integer],
    *,
    size: float | None = None,
    cells_across: int | None = None,
) -> SolidMesh:
    """The hexahedra around a closed surface; `SolidMesh.cage` tells what they carry.

    Args:
        points: of the surface [m], shape (points, 3).
        triangles: shape (triangles, 3).
        size: edge of a cell [m], or else
        cells_across: cells along the shortest side of the surface's box.

    Raises:
        MeshError: a surface that is not closed or crosses itself, with the place; cells that are
            too many, or larger than the surface.
    """
    rows = check_range(index_rows(triangles, 3, "triangle"), "triangle", len(points))
    places, faces = joined(positions(points), rows.astype(np.int64))
    if not len(faces):
        raise MeshError("a cage needs a surface of triangles, and this one has none")
    faces, turned = closed(places, faces)
    mesh = caged(places, faces, fitted(places, faces, size=size, across=cells_across))
    told = ("its triangles face inward, and were turned round",) if turned else ()
    return replace(mesh, notes=told, checked=True)


def caged(points: Floats, triangles: Rows, lattice: Lattice) -> SolidMesh:
    """The cells of a lattice that a closed surface (as of `closed`) fills.  Raises MeshError."""
    local = lattice.local(points)
    fill = filled(cut(local, triangles, lattice.cells), lattice)
    keep = fill.moments[:, 0] >= LEAST_FILL
    if not keep.any():
        raise MeshError("no cell is filled by 1 % or more: take smaller cells")
    cells, moments = fill.cells[keep], fill.moments[keep]
    nodes, corners = _numbered(cells, lattice)
    fills = np.repeat(moments[:, 0] / 8.0, 8)
    weights: Floats = np.bincount(corners.ravel(), fills, len(nodes)).astype(np.float64)
    weights *= lattice.size.prod()
    body = solid_moments(local * lattice.size, triangles)
    factor, left = balanced(nodes * lattice.size, weights, body)
    fine = split_long(points, triangles, float(lattice.size.max()))
    skin = Skin(fine[1].astype(np.int32), *_carried(lattice.local(fine[0]), cells, corners))
    return SolidMesh(
        lattice.world(nodes),
        np.arange(len(nodes)),
        hexes=corners[:, LATTICE].astype(np.int32),
        cage=Cage(lattice, cells, moments, factor, skin, left),
        checked=True,
    )


def _numbered(cells: Rows, lattice: Lattice) -> tuple[Floats, Rows]:
    """Nodes in cells from the origin, and those of each cell, in the order of a lattice."""
    nx, ny, _ = lattice.cells + 1
    at = cells[:, None] + CORNER
    keys, index = np.unique(at[..., 0] + nx * (at[..., 1] + ny * at[..., 2]), return_inverse=True)
    places = np.stack([keys % nx, keys // nx % ny, keys // nx // ny], axis=1)
    return places.astype(np.float64), index.reshape(-1, 8)


def _carried(local: Floats, cells: Rows, corners: Rows) -> tuple[NDArray[np.int32], Floats]:
    """Nodes that carry points given in cells, and their shares; points in no cell of the cage hang
    on the nearest.
    """
    from scipy.spatial import cKDTree  # SciPy is slow to import

    tree = cKDTree(cells + 0.5)
    own = tree.query(local, p=np.inf)[1]
    return corners[own].astype(np.int32), shares(local - cells[own])


def split_long(points: Floats, triangles: Rows, longest: float) -> tuple[Floats, Rows]:
    """The surface with all edges halved until none is longer than `longest`; the points that were
    there come first.
    """
    while True:
        sides = triangles[:, [[0, 1], [1, 2], [2, 0]]]
        ends = np.sort(sides.reshape(-1, 2), axis=1)
        keys, index = np.unique(ends[:, 0] * len(points) + ends[:, 1], return_inverse=True)
        a, b = keys // len(points), keys % len(points)
        long = np.linalg.norm(points[a] - points[b], axis=1) > longest * (1.0 + 1e-9)
        if not long.any():
            return points, triangles
        number = np.where(long, len(points) + np.cumsum(long) - 1, -1)
        triangles = _halved(triangles, number[index].reshape(-1, 3))
        points = np.concatenate([points, 0.5 * (points[a] + points[b])[long]])


def _halved(triangles: Rows, middles: Rows) -> Rows:
    """Triangles with some of their sides halved; `middles`: the new point of each side, or −1."""
    count = (middles >= 0).sum(axis=1)
    first = np.select(
        [count == 1, count == 2], [(middles >= 0).argmax(axis=1), (middles < 0).argmax(axis=1)], 0
    )
    order = (first[:, None] + np.arange(3)) % 3
    rows = np.arange(len(triangles))[:, None]
    (a, b, c), (ab, bc, ca) = triangles[rows, order].T, middles[rows, order].T

    def made(own: NDArray[np.bool_], *corners: tuple[Rows, Rows, Rows]) -> Rows:
        return np.concatenate([np.stack(three, axis=1)[own] for three in corners])

    return np.concatenate(
        [
            triangles[count == 0],
            made(count == 1, (a, ab, c), (ab, b, c)),
            made(count == 2, (c, ca, bc), (a, b, bc), (a, bc, ca)),
            made(count == 3, (a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)),
        ]
    )
