"""A closed surface in a lattice of hexahedra that carries it.

Cells that the surface fills in part count by their exact moments: volume, mean gradient and mass
are those of the filled part (`elements.hex8`).  Where parts that do not touch share a cell, each
has a hexahedron of its own there (`connected`).  The surface moves with its cells:
x = Σ N_a(ξ) x_a.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tisoft import checks
from tisoft.errors import MeshError
from tisoft.geometry.cage.carried import shares
from tisoft.geometry.cage.connected import Elements, elements
from tisoft.geometry.cage.cutting import Pieces, cut
from tisoft.geometry.cage.lattice import Lattice, fitted
from tisoft.geometry.cage.masses import balanced
from tisoft.geometry.cage.moments import filled
from tisoft.geometry.cells import LATTICE
from tisoft.geometry.checks import as_of, check_range, index_rows, positions
from tisoft.geometry.skin import Skin
from tisoft.geometry.solid import SolidMesh
from tisoft.geometry.surface import closed, joined, solid_moments

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

LEAST_FILL = 0.01
"""Fill below which a cell is left out."""
SAME = 1e-8
"""Distance, in cells, within which a corner of a piece is a point of the surface."""


@dataclass(frozen=True, eq=False)
class Cage:
    """What a lattice knows of the surface it carries; nothing of it changes when both are moved."""

    lattice: Lattice
    """As it was built."""
    cells: Rows
    """Place of each hexahedron in the lattice, shape (hexes, 3); those of several have one."""
    moments: Floats
    """φ and means over the filled part of each hexahedron (`moments`), shape (hexes, 7)."""
    factor: Floats
    """What each node's mass is multiplied by, shape (nodes,)."""
    skin: Skin
    """The surface."""
    inertia_error: float
    """Largest relative error of the three moments of inertia."""
    strays: Rows
    """Triangle, cell and hexahedron where a part of the surface does not belong to the one
    hexahedron of its cell: there are several or none; shape (strays, 5)."""


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
    with as_of("cage"):
        key = checks.exactly_one("", {"size": size, "cells_across": cells_across})
        if key == "size":
            size = checks.number(key, size, above=0.0, unit="m")
        else:
            cells_across = checks.integer(key, cells_across, least=1)
    points = positions(points)
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
    body = solid_moments(lattice.local(points) * lattice.size, triangles)
    points, triangles = split_long(points, triangles, float(lattice.size.max()))
    local = lattice.local(points)
    pieces = cut(local, triangles, lattice.cells)
    fill = filled(pieces, lattice)
    found = elements(pieces, fill, lattice)
    keep = found.moments[:, 0] >= LEAST_FILL
    if not keep.any():
        raise MeshError("no cell is filled by 1 % or more: take smaller cells")
    cells, moments = fill.cells[found.cell[keep]], found.moments[keep]
    used, index = np.unique(found.corners[keep], return_inverse=True)
    nodes, corners = found.places[used], index.reshape(-1, 8)
    weights: Floats = np.bincount(
        corners.ravel(), np.repeat(moments[:, 0] / 8.0, 8), len(nodes)
    ).astype(np.float64)
    weights *= lattice.size.prod()
    factor, left = balanced(nodes * lattice.size, weights, body)
    owner = _kept(found, fill.cells[found.cell], keep, pieces)
    own = _owners(local, triangles, pieces, owner, keep[found.owner])
    lost = own < 0  # corners of triangles without an area alone
    own[lost] = _nearest(local[lost], cells)
    skin = Skin(
        triangles.astype(np.int32), corners[own].astype(np.int32), shares(local - cells[own])
    )
    return SolidMesh(
        lattice.world(nodes),
        np.arange(len(nodes)),
        hexes=corners[:, LATTICE].astype(np.int32),
        cage=Cage(lattice, cells, moments, factor, skin, left, _strays(pieces, owner, cells)),
        checked=True,
    )


def _kept(found: Elements, cells: Rows, keep: NDArray[np.bool_], pieces: Pieces) -> Rows:
    """The hexahedron that carries each piece: its own, or where that is left out one that the body
    goes on to from it, of several the fullest, or else the nearest.
    """
    instead = np.where(keep, np.arange(len(keep)), -1)
    pairs = np.concatenate([found.links, found.links[:, ::-1]])
    pairs = pairs[np.argsort(found.moments[pairs[:, 1], 0], kind="stable")]
    while True:
        pairs = pairs[instead[pairs[:, 0]] < 0]
        known = pairs[instead[pairs[:, 1]] >= 0]
        if not len(known):
            break
        instead[known[:, 0]] = instead[known[:, 1]]
    number = np.cumsum(keep) - 1
    owner = np.where(found.owner >= 0, instead[found.owner], -1)
    lost = owner < 0
    owner = number[owner]
    owner[lost] = _nearest(pieces.points[lost].mean(axis=1), cells[keep])
    return np.asarray(owner)


def _owners(
    local: Floats, triangles: Rows, pieces: Pieces, owner: Rows, own: NDArray[np.bool_]
) -> Rows:
    """The hexahedron that carries each point: that of a piece it is a corner of, rather of one in a
    cell that is kept; −1 where there is none.
    """
    found = np.full(len(local), -1)
    corners = triangles[pieces.parents]
    order = np.argsort(own, kind="stable")
    for corner in range(3):
        ends = local[corners[:, corner]]
        for place in range(3):
            same = np.abs(pieces.points[:, place] - ends).max(axis=1) <= SAME
            mine = order[same[order]]
            found[corners[mine, corner]] = owner[mine]
    return found


def _nearest(local: Floats, cells: Rows) -> Rows:
    """The nearest cell of places."""
    from scipy.spatial import cKDTree  # SciPy is slow to import

    return np.asarray(cKDTree(cells + 0.5).query(local, p=np.inf)[1])


def _strays(pieces: Pieces, owner: Rows, cells: Rows) -> Rows:
    """`Cage.strays`."""
    size = cells.max(axis=0) + 2
    keys = [c[:, 0] + size[0] * (c[:, 1] + size[1] * c[:, 2]) for c in (cells, pieces.cells)]
    known, uses = np.unique(keys[0], return_counts=True)
    alone = known[uses == 1]
    stray = (keys[1] != keys[0][owner]) | ~np.isin(keys[1], alone)
    rows = np.column_stack([pieces.parents, pieces.cells, owner])[stray]
    return np.unique(rows, axis=0) if len(rows) else np.empty((0, 5), np.int64)


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
