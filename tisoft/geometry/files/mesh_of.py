"""From a file's content to a mesh: solids become tets, groups become regions and sets."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError
from tisoft.geometry.files import kinds
from tisoft.geometry.files.content import Content, Ints
from tisoft.geometry.files.kinds import Kind
from tisoft.geometry.groups import NodeSet, Region
from tisoft.geometry.mesh import SpringNet, TetMesh, spring_net, tet_mesh

REMEDY = "tetrahedralise it first, with fTetWild, TetGen or Gmsh for instance"


def mesh_of(content: Content) -> TetMesh | SpringNet:
    """The mesh, or the net of springs where there are lines alone.

    Solids of all kinds are cut in tets, by their corners.  Raises MeshError, a sentence about what
    is there instead, where there is neither.
    """
    blocks = [(kind, rows) for kind, rows in content.blocks if len(rows)]
    solids = [kind for kind, _ in blocks if kind.dim == 3]
    whole = [kind for kind in solids if kind.corners in (4, 5, 6, 8)]
    if len(whole) < len(solids):
        raise MeshError(f"it holds {_counted(blocks)}; tets, hexahedra, wedges and pyramids are "
                        "read: split the other cells in tets")  # fmt: skip
    if solids:
        return _solid(content)
    lines = [rows[:, :2] for kind, rows in blocks if kind.dim == 1 and kind.corners == 2]
    if lines and all(kind.dim < 2 for kind, _ in blocks):
        return _net(content, np.concatenate(lines))
    if blocks:
        raise MeshError(f"it holds {_counted(blocks)}, a surface and no tets; {REMEDY}")
    left = f" ({'; '.join(content.warnings)})" if content.warnings else ""
    raise MeshError(
        f"it holds {len(content.points)} nodes and no cells at all; a mesh of tets is needed{left}"
    )


def _counted(blocks: list[tuple[Kind, Ints]]) -> str:
    held = Counter[str]()
    for kind, rows in blocks:
        held[kind.name] += len(rows)
    return ", ".join(plural(count, name) for name, count in held.items())


def plural(count: int, name: str) -> str:
    """ "1 tet", "2 tets", "3 hexahedra"."""
    if count == 1:
        return f"1 {name}"
    ending = {"hexahedron": "hexahedra", "polyhedron": "polyhedra", "vertex": "vertices"}
    for one, many in ending.items():
        if one in name:
            return f"{count} {name.replace(one, many)}"
    return f"{count} {name}s"


def _net(content: Content, lines: Ints) -> SpringNet:
    net = spring_net(content.points, lines)
    sets = _sets(content, _rows_of(content, net))
    told = (*net.warnings, *(f"the file: {told}" for told in content.warnings))
    return replace(net, sets=tuple(sets), warnings=told, notes=tuple(content.notes))


def _rows_of(content: Content, mesh: TetMesh | SpringNet) -> Ints:
    """Row of `mesh.points` of each node of the file, -1 where it was dropped."""
    rows = np.full(len(content.points), -1, dtype=np.int64)
    rows[mesh.kept_nodes] = np.arange(len(mesh.kept_nodes))
    return rows


def _solid(content: Content) -> TetMesh:
    tets, owners, place = [], [], 0
    for kind, rows in content.blocks:
        if kind.dim == 3 and len(rows):
            cut, parents = kinds.cut_in_tets(rows[:, : kind.corners])
            tets.append(cut)
            owners.append(parents + place)
        place += len(rows)
    mesh = tet_mesh(content.points, np.concatenate(tets))
    return replace(
        mesh,
        regions=tuple(_regions(content, np.concatenate(owners))),
        sets=tuple(_sets(content, _rows_of(content, mesh))),
        warnings=tuple(f"the file: {told}" for told in content.warnings) + tuple(_told(content)),
        notes=(*content.notes, *_beside(content)),
        checked=True,
    )


def _told(content: Content) -> list[str]:
    """What the cut of cells, and the corners of curved ones, change."""
    found = []
    solids: dict[Kind, int] = defaultdict(int)
    for kind, rows in content.blocks:
        if kind.dim == 3:
            solids[kind] += len(rows)
    bent = [(kind, count) for kind, count in solids.items() if kind.nodes != kind.corners and count]
    if bent:
        counted = ", ".join(plural(count, kind.name) for kind, count in bent)
        found.append(
            f"{counted} are read by their corners: edges become straight and the nodes between "
            "corners are dropped; linear tets bend more stiffly"
        )
    cut = [(kind, count) for kind, count in solids.items() if kind.corners != 4 and count]
    if cut:
        counted = ", ".join(plural(count, kind.name) for kind, count in cut)
        found.append(
            f"{counted} are cut in tets (6, 3 or 2 each): such tets bend more stiffly than the "
            "cells they come from"
        )
    return found


def _beside(content: Content) -> list[str]:
    """A note of cells that are no solids."""
    flat = [(kind, rows) for kind, rows in content.blocks if kind.dim in (1, 2) and len(rows)]
    if not flat:
        return []
    return [f"{_counted(flat)} beside the solids are not simulated; they may name sets"]


def _regions(content: Content, owners: Ints) -> list[Region]:
    """Regions of tets, each of which comes from the cell `owners` says (ascending)."""
    regions = []
    for group in content.cell_groups:
        cells = np.unique(group.members)
        first, last = np.searchsorted(owners, cells), np.searchsorted(owners, cells, side="right")
        count = last - first
        within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        tets = np.repeat(first, count) + within
        if len(tets):
            regions.append(Region(group.name, group.tag, tets.astype(np.int32)))
    return regions


def _sets(content: Content, row_of: Ints) -> list[NodeSet]:
    """Sets of nodes, and of faces and edges; what no tet uses is left out."""
    found = []
    nothing = np.empty((0, 3), np.int32)
    for group in content.cell_groups:
        faces, nodes = _flat_cells(content, np.unique(group.members))
        triangles = row_of[np.concatenate(faces)] if faces else nothing
        triangles = triangles[(triangles >= 0).all(axis=1)].astype(np.int32)
        kept = _kept(np.concatenate(nodes), row_of)
        if len(kept):
            found.append(NodeSet(group.name, group.tag, kept, triangles))
    for group in content.node_groups:
        kept = _kept(group.members, row_of)
        if len(kept):
            found.append(NodeSet(group.name, group.tag, kept, nothing))
    return found


def _flat_cells(content: Content, cells: Ints) -> tuple[list[Ints], list[Ints]]:
    """Triangles and nodes of those of the cells (ascending) that are no solids."""
    faces: list[Ints] = []
    nodes: list[Ints] = [np.empty(0, np.int64)]
    place = 0
    for kind, rows in content.blocks:
        first, last = np.searchsorted(cells, [place, place + len(rows)])
        mine = rows[cells[first:last] - place, : kind.corners]
        place += len(rows)
        if kind.dim == 3 or not len(mine) or not kind.corners:
            continue
        nodes.append(mine.ravel())
        if kind.dim == 2:
            faces += kinds.halved(mine)
    return faces, nodes


def _kept(nodes: Ints, row_of: Ints) -> NDArray[np.int32]:
    rows = np.unique(row_of[nodes])
    return rows[rows >= 0].astype(np.int32)
