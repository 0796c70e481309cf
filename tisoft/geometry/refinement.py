"""Tets cut into eight: every edge gets a node at its middle, and the octahedron that is left within
is cut along its shortest diagonal (Bey 1995 cuts a fixed one).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.checks import integer
from tisoft.errors import MeshError
from tisoft.geometry.groups import NodeSet, Region
from tisoft.geometry.mesh import Mesh, TetMesh
from tisoft.geometry.solid import TOLD, SolidMesh, quadratic

Rows = NDArray[np.int64]

CORNERS = np.array([[0, 4, 6, 7], [4, 1, 5, 8], [6, 5, 2, 9], [7, 8, 9, 3]])
"""The tets at the corners, by the nodes of the quadratic tet."""
DIAGONALS = np.array([[4, 9], [5, 7], [6, 8]])
"""Opposite corners of the octahedron."""
RINGS = np.array([[6, 5, 8, 7], [4, 8, 9, 6], [4, 5, 9, 7]])
"""Its other corners, in a ring about each diagonal."""


def refined(mesh: Mesh, times: Any = 1) -> Mesh:
    """The mesh with each tet cut into eight, `times` times over; nodes keep their numbers.

    Raises:
        MeshError: a mesh of anything but linear tets.
    """
    count = integer("refine", times)
    if count and not isinstance(mesh, TetMesh):
        raise MeshError("refine cuts linear tets, and this mesh has others, or springs alone")
    for _ in range(count):
        mesh = _once(mesh)  # type: ignore[arg-type]
    return mesh


def _once(mesh: TetMesh) -> TetMesh:
    whole = quadratic(mesh)
    cells = whole.quadratic_tets.astype(np.int64)
    points = whole.points
    ends = points[cells[:, DIAGONALS]]
    shortest = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).argmin(axis=1)
    ring = RINGS[shortest]
    pieces = [np.take_along_axis(cells, np.tile(row, (len(cells), 1)), 1) for row in CORNERS]
    axis = DIAGONALS[shortest]
    for k in range(4):
        chosen = np.stack([axis[:, 0], axis[:, 1], ring[:, k], ring[:, (k + 1) % 4]], axis=1)
        pieces.append(np.take_along_axis(cells, chosen, 1))
    tets = np.stack(pieces, axis=1).reshape(-1, 4)
    x = points[tets]
    volume = np.linalg.det(x[:, 1:] - x[:, :1])
    tets[volume < 0.0] = tets[volume < 0.0][:, [0, 1, 3, 2]]
    regions = tuple(_cut(region) for region in mesh.regions)
    sets = tuple(_with_middles(own, mesh, whole) for own in mesh.sets)
    told: dict[str, Any] = {
        n: getattr(mesh, n) for n in TOLD if n not in ("regions", "sets", "flipped")
    }
    nothing = np.empty(0, np.int32)
    return TetMesh(
        points, tets.astype(np.int32), whole.kept_nodes, nothing, regions=regions, sets=sets,
        checked=True, **told,
    )  # fmt: skip


def _cut(region: Region) -> Region:
    """A region's tets after each was cut into eight."""
    tets = (8 * np.asarray(region.tets)[:, None] + np.arange(8)).ravel()
    return replace(region, tets=tets)


def _with_middles(own: NodeSet, mesh: TetMesh, whole: SolidMesh) -> NodeSet:
    """A set with the middles of the edges whose ends are in it, its faces cut into four."""
    inside = np.zeros(len(whole.points), bool)
    inside[own.nodes] = True
    edges = mesh.edges.astype(np.int64)
    middle = _middles(edges, mesh, whole)
    inside[middle[inside[edges].all(axis=1)]] = True
    faces = np.asarray(own.faces, np.int64).reshape(-1, 3)
    if len(faces):
        a, b, c = faces.T
        ab, bc, ca = (
            _middles(np.stack(pair, axis=1), mesh, whole) for pair in ((a, b), (b, c), (c, a))
        )
        corners = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        faces = np.concatenate([np.stack(corner, axis=1) for corner in corners])
    nodes = np.flatnonzero(inside).astype(np.int32)
    return replace(own, nodes=nodes, faces=faces.astype(np.int32))


def _middles(edges: Rows, mesh: TetMesh, whole: SolidMesh) -> Rows:
    """The nodes between the ends of edges, shape (edges,); `quadratic` numbers them by the ends."""
    ends = np.sort(edges, axis=1)
    known = mesh.edges.astype(np.int64)
    keys = known[:, 0] * len(mesh.points) + known[:, 1]
    place = np.searchsorted(keys, ends[:, 0] * len(mesh.points) + ends[:, 1])
    return len(mesh.points) + place
