"""Kinds of cells: what a user calls them, how many nodes they have, and how solids are cut in tets.

Of every kind, however high its order, the corners come first.  A solid that is no tet is cut from
its corner of the smallest number: a tet for every triangle of the faces without it, quadrangles
halved from their own smallest number.  Neighbours so agree on every face, whatever their kinds.
Source: Dompierre, Labbé, Vallet & Camarero (1999).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Kind:
    """One kind of cell."""

    name: str
    dim: int
    corners: int
    nodes: int = 0
    """0: any number from `corners` on."""


def _kind(name: str, dim: int, corners: int, nodes: int = 0) -> Kind:
    return Kind(name, dim, corners, nodes or corners)


VERTEX, LINE = _kind("vertex", 0, 1), _kind("line", 1, 2)
TRIANGLE, QUAD = _kind("triangle", 2, 3), _kind("quadrangle", 2, 4)
TET, HEX = _kind("tet", 3, 4), _kind("hexahedron", 3, 8)
WEDGE, PYRAMID = _kind("wedge", 3, 6), _kind("pyramid", 3, 5)
VOXEL, PIXEL = _kind("voxel", 3, 8), _kind("pixel", 2, 4)
POLYHEDRON = Kind("polyhedron", 3, 0)
NO_CELL = Kind("empty cell", 0, 0)

OF_HIGHER_ORDER = {
    (base.name, nodes): Kind(f"{nodes}-node {base.name}", base.dim, base.corners, nodes)
    for base, counts in (
        (LINE, (3, 4, 5, 6)),
        (TRIANGLE, (6, 7, 9, 10, 12, 15, 21)),
        (QUAD, (6, 8, 9, 12, 16, 20, 25, 36)),
        (TET, (10, 11, 14, 15, 20, 22, 28, 35, 56)),
        (HEX, (20, 21, 24, 26, 27, 64, 125)),
        (WEDGE, (12, 15, 16, 18, 21, 40, 75)),
        (PYRAMID, (13, 14, 19, 30, 55)),
    )
    for nodes in counts
}


def of_order(base: Kind, nodes: int) -> Kind:
    """The kind of so many nodes that has the corners of `base`."""
    if nodes == base.nodes:
        return base
    known = OF_HIGHER_ORDER.get((base.name, nodes))
    return known or Kind(f"{nodes}-node {base.name}", base.dim, base.corners, nodes)


# Faces seen counter-clockwise from outside, quadrangles and triangles.
_FACES: dict[int, list[tuple[int, ...]]] = {
    8: [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)],
    6: [(0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)],
    5: [(0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)],
}


def cut_in_tets(cells: Ints) -> tuple[Ints, Ints]:
    """Tets of solids given by their corners, shape (cells, 8 | 6 | 5 | 4), and each tet's cell.

    Corners that coincide (a wedge written as a hexahedron) leave their flat tets out.
    """
    if cells.shape[1] == 4:
        return cells, np.arange(len(cells))
    apex = cells.min(axis=1)
    tets, parents = [], []
    for face in _FACES[cells.shape[1]]:
        corners = cells[:, face]
        away = np.flatnonzero((corners != apex[:, None]).all(axis=1))
        for triangle in halved(corners[away]):
            tets.append(np.column_stack([apex[away], triangle]))
            parents.append(away)
    rows, owner = np.concatenate(tets), np.concatenate(parents)
    ordered = np.sort(rows, axis=1)
    whole = (ordered[:, 1:] != ordered[:, :-1]).all(axis=1)
    order = np.argsort(owner[whole], kind="stable")
    return rows[whole][order], owner[whole][order]


def halved(faces: Ints) -> list[Ints]:
    """Triangles of faces, shape (faces, 3 | 4): themselves, or both halves of quadrangles."""
    if faces.shape[1] == 3:
        return [faces]
    turned = (faces.argmin(axis=1)[:, None] + np.arange(4)) % 4
    rolled = np.take_along_axis(faces, turned, axis=1)
    return [rolled[:, :3], rolled[:, [0, 2, 3]]]
