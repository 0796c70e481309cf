"""Nodes that lie in one place become one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError
from tisoft.geometry.groups import NodeSet
from tisoft.geometry.joints import coincident_nodes, merged_into
from tisoft.geometry.mesh import Mesh, SolidMesh, TetMesh, spring_net, tet_mesh
from tisoft.geometry.solid import FIELDS, solid_mesh

Ints = NDArray[np.int64]


def merged(mesh: Mesh, distance: float | None = None) -> Mesh:
    """The mesh with nodes in one place, or within `distance` [m], merged into the first of them.

    Raises MeshError where that would flatten a tet or turn it over: the distance is too large.
    """
    cells = mesh.tets if isinstance(mesh, TetMesh) else mesh.edges
    first = merged_into(_pairs(mesh, cells, distance), len(mesh.points))
    gone = np.flatnonzero(first != np.arange(len(first)))
    if not len(gone):
        return replace(mesh, notes=(*mesh.notes, "merge found no nodes in the same place"))
    rows = first[cells]
    made: Mesh
    if isinstance(mesh, SolidMesh):
        made = _solid(mesh, first, distance)
    elif isinstance(mesh, TetMesh):
        made = _checked(mesh, rows, distance)
    else:
        made = spring_net(mesh.points, rows[rows[:, 0] != rows[:, 1]])
    row_of = np.full(len(first), -1)
    row_of[made.kept_nodes] = np.arange(len(made.kept_nodes))
    joined = np.stack([mesh.kept_nodes[gone], row_of[first[gone]]], axis=1)
    made = replace(
        made,
        kept_nodes=mesh.kept_nodes[made.kept_nodes],
        dropped_nodes=mesh.dropped_nodes,
        sets=tuple(_moved(group, row_of[first]) for group in mesh.sets),
        warnings=mesh.warnings,
        notes=(*mesh.notes, f"{len(gone)} nodes merged into others in the same place"),
        questions=mesh.questions,
        joined=joined,
    )
    if isinstance(mesh, SolidMesh) and isinstance(made, SolidMesh):
        return replace(made, regions=mesh.regions, flipped=mesh.flipped, checked=True)
    if isinstance(mesh, TetMesh) and isinstance(made, TetMesh):
        return replace(made, regions=mesh.regions, turned=mesh.turned, checked=True)
    return made


def _solid(mesh: SolidMesh, first: Ints, distance: float | None) -> SolidMesh:
    told = "" if distance is None else f" within {distance:g} m"
    rows = {name: first[getattr(mesh, name)] for name in FIELDS}
    for name, own in rows.items():
        ordered = np.sort(own, axis=1)
        flat = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
        if flat.any():
            raise MeshError(
                f"merging nodes{told} joins nodes of one of the {name} (number "
                f"{int(np.flatnonzero(flat)[0])} of them, counted from 0); give a distance below "
                "its shortest edge"
            )
    return solid_mesh(mesh.points, **rows)


def _pairs(mesh: Mesh, cells: NDArray[np.int32], distance: float | None) -> Ints:
    if distance is None:
        return coincident_nodes(mesh.points, cells)
    from scipy.spatial import cKDTree

    pairs = cKDTree(mesh.points).query_pairs(distance, output_type="ndarray")
    return np.asarray(pairs, dtype=np.int64).reshape(-1, 2)


def _checked(mesh: TetMesh, rows: Ints, distance: float | None) -> TetMesh:
    ordered = np.sort(rows, axis=1)
    flat = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
    told = "" if distance is None else f" within {distance:g} m"
    if flat.any():
        raise MeshError(
            f"merging nodes{told} joins corners of tet {int(np.flatnonzero(flat)[0])} (counted "
            "from 0); give a distance below its shortest edge"
        )
    made = tet_mesh(mesh.points, rows)
    if len(made.turned):
        raise MeshError(
            f"merging nodes{told} turns tet {made.turned[0]} (counted from 0) over; "
            "give a smaller distance"
        )
    return made


def _moved(group: NodeSet, row_of: Ints) -> NodeSet:
    nodes = np.unique(row_of[group.nodes]).astype(np.int32)
    return NodeSet(group.name, group.tag, nodes, row_of[group.faces].astype(np.int32))
