"""From a file's content to a mesh: solids become elements, groups become regions and sets."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError
from tisoft.geometry.cells import QUADRATIC_EDGES
from tisoft.geometry.files import kinds
from tisoft.geometry.files.content import Content, Ints, joined
from tisoft.geometry.files.kinds import Kind
from tisoft.geometry.groups import NodeSet, Region
from tisoft.geometry.mesh import Mesh, SolidMesh, SpringNet, TetMesh, spring_net, tet_mesh
from tisoft.geometry.solid import solid_mesh

REMEDY = "tetrahedralise it first, with fTetWild, TetGen or Gmsh for instance"


def mesh_of(content: Content) -> Mesh:
    """The mesh, or the net of springs where there are lines alone.

    Hexahedra and 10-node tets are read as they are; other solids are cut in tets, by their corners.
    Raises MeshError, a sentence about what is there instead, where there is neither.
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


def _rows_of(content: Content, mesh: Mesh) -> Ints:
    """Row of `mesh.points` of each node of the file, -1 where it was dropped."""
    rows = np.full(len(content.points), -1, dtype=np.int64)
    rows[mesh.kept_nodes] = np.arange(len(mesh.kept_nodes))
    return rows


def _solid(content: Content) -> TetMesh | SolidMesh:
    shapes = _Shapes(content)
    told = tuple(f"the file: {told}" for told in content.warnings) + tuple(shapes.told())
    if not shapes.hexes and not shapes.quadratic:
        mesh: TetMesh | SolidMesh = tet_mesh(content.points, np.concatenate(shapes.tets))
    else:
        rows = {
            "tets": np.concatenate([np.empty((0, 4), np.int64), *shapes.tets]),
            "quadratic_tets": np.concatenate([np.empty((0, 10), np.int64), *shapes.quadratic]),
            "hexes": np.concatenate([np.empty((0, 8), np.int64), *shapes.hexes]),
        }
        mesh = solid_mesh(content.points, **rows)
        if shapes.tets and shapes.hexes:
            told += tuple(_apart(mesh))
    return replace(
        mesh,
        regions=tuple(_regions(content, shapes.owners())),
        sets=tuple(_sets(content, _rows_of(content, mesh))),
        warnings=told,
        notes=(*content.notes, *_beside(content)),
        checked=True,
    )


class _Shapes:
    """A file's solids as cells that are simulated, each with the cell of the file it comes from.

    Hexahedra stay what they are, and so do 10-node tets where there is nothing else; wedges,
    pyramids and hexahedra with corners in one place are cut in tets, by their corners.
    """

    def __init__(self, content: Content) -> None:
        solids = [(kind, len(rows)) for kind, rows in content.blocks if kind.dim == 3 and len(rows)]
        self.content = content
        self.kinds = solids
        alone = all((kind.corners, kind.nodes) == (4, 10) for kind, _ in solids)
        self.tets: list[Ints] = []
        self.quadratic: list[Ints] = []
        self.hexes: list[Ints] = []
        self.cut: list[tuple[Kind, int]] = []
        """Kinds that are cut, and how many of each."""
        self._owners: dict[str, list[Ints]] = {"tets": [], "quadratic": [], "hexes": []}
        place = 0
        for kind, rows in content.blocks:
            if kind.dim == 3 and len(rows):
                self._add(kind, rows, place, alone)
            place += len(rows)

    def _add(self, kind: Kind, rows: Ints, place: int, alone: bool) -> None:
        number = np.arange(len(rows)) + place
        if alone:
            self.quadratic.append(rows[:, _edge_order(self.content.points, rows)])
            self._owners["quadratic"].append(number)
            return
        corners = rows[:, : kind.corners]
        whole = np.zeros(len(rows), bool)
        if kind.corners == 8:
            ordered = np.sort(corners, axis=1)
            whole = (ordered[:, 1:] != ordered[:, :-1]).all(axis=1)
            if whole.any():
                self.hexes.append(corners[whole])
                self._owners["hexes"].append(number[whole])
        if not whole.all():
            cut, parents = kinds.cut_in_tets(corners[~whole])
            self.tets.append(cut)
            self._owners["tets"].append(number[~whole][parents])
            if kind.corners != 4:
                self.cut.append((kind, int((~whole).sum())))

    def owners(self) -> list[Ints]:
        """Cell of the file that each element comes from, ascending, kind by kind of element."""
        return [np.concatenate(own) for own in self._owners.values() if own]

    def told(self) -> list[str]:
        """What the cut of cells, and the corners of curved ones, change."""
        found = []
        bent = Counter[Kind]()
        for kind, count in self.kinds:
            if kind.nodes != kind.corners and not self.quadratic:
                bent[kind] += count
        if bent:
            counted = ", ".join(plural(count, kind.name) for kind, count in bent.items())
            found.append(
                f"{counted} are read by their corners: edges become straight and the nodes between "
                "corners are dropped; such cells bend more stiffly"
            )
        cut = Counter[Kind]()
        for kind, count in self.cut:
            cut[kind] += count
        if cut:
            counted = ", ".join(plural(count, kind.name) for kind, count in cut.items())
            found.append(
                f"{counted} are cut in tets (6, 3 or 2 each): such tets bend more stiffly than the "
                "cells they come from"
            )
        return found


def _edge_order(points: NDArray[np.float64], rows: Ints) -> Ints:
    """The order of a block's ten nodes that VTK has: programs number the nodes of edges each in
    their own way, and places tell which edge each column belongs to.
    """
    corners = points[rows[:, :4]]
    middles = 0.5 * (corners[:, QUADRATIC_EDGES[:, 0]] + corners[:, QUADRATIC_EDGES[:, 1]])
    size = np.linalg.norm(np.ptp(corners, axis=1), axis=1)[:, None]
    away = [
        (np.linalg.norm(points[rows[:, [4 + k]]] - middles, axis=2) / size).mean(axis=0)
        for k in range(6)
    ]
    edge = np.argmin(away, axis=1)
    if len(set(edge.tolist())) < 6:
        raise MeshError(
            "the nodes of its 10-node tets do not lie near the middles of their edges; write them "
            "again, four corners first, or save linear tets"
        )
    return np.concatenate([np.arange(4), 4 + np.argsort(edge)])


def _apart(mesh: SolidMesh) -> list[str]:
    """A sentence where tets and hexahedra do not meet face to face."""
    of_tets, of_hexes = (np.unique(mesh.cells[word]) for word in ("tet4", "hex8"))
    shared = np.zeros(len(mesh.points), bool)
    shared[np.intersect1d(of_tets, of_hexes)] = True
    if not shared.any():
        return ["its tets and its hexahedra share no node, and nothing joins them"]
    left = sum(int(shared[own].all(axis=1).sum()) for own in mesh.boundary.faces)
    if not left and mesh.boundary.halves:
        return []
    if not mesh.boundary.halves:
        return [
            "its tets and hexahedra share nodes but no faces: a side of a hexahedron must meet two "
            "tets with its four corners; the body turns there as on a hinge"
        ]
    return [
        f"{left} faces between its tets and hexahedra do not match: a side of a hexahedron must "
        "meet two tets with its four corners; the body comes apart there, so mesh both sides alike"
    ]


def _beside(content: Content) -> list[str]:
    """A note of cells that are no solids."""
    flat = [(kind, rows) for kind, rows in content.blocks if kind.dim in (1, 2) and len(rows)]
    if not flat:
        return []
    return [f"{_counted(flat)} beside the solids are not simulated; they may name sets"]


def _regions(content: Content, owners: list[Ints]) -> list[Region]:
    """Regions of elements, which come from the cells that `owners` say (ascending in each)."""
    regions = []
    for group in joined(content.cell_groups):
        cells = np.unique(group.members)
        rows, begun = [], 0
        for own in owners:
            first, last = np.searchsorted(own, cells), np.searchsorted(own, cells, side="right")
            count = last - first
            within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
            rows.append(np.repeat(first, count) + within + begun)
            begun += len(own)
        elements = np.concatenate(rows)
        if len(elements):
            regions.append(Region(group.name, group.tag, elements.astype(np.int32)))
    return regions


def _sets(content: Content, row_of: Ints) -> list[NodeSet]:
    """Sets of nodes, and of faces and edges; what no tet uses is left out."""
    found = []
    nothing = np.empty((0, 3), np.int32)
    for group in joined(content.cell_groups):
        faces, nodes = _flat_cells(content, np.unique(group.members))
        triangles = row_of[np.concatenate(faces)] if faces else nothing
        triangles = triangles[(triangles >= 0).all(axis=1)].astype(np.int32)
        kept = _kept(np.concatenate(nodes), row_of)
        if len(kept):
            found.append(NodeSet(group.name, group.tag, kept, triangles))
    for group in joined(content.node_groups):
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
        whole = rows[cells[first:last] - place]
        mine = whole[:, : kind.corners]
        place += len(rows)
        if kind.dim == 3 or not len(mine) or not kind.corners:
            continue
        nodes.append(whole.ravel())
        if kind.dim == 2:
            faces += kinds.halved(mine)
    return faces, nodes


def _kept(nodes: Ints, row_of: Ints) -> NDArray[np.int32]:
    rows = np.unique(row_of[nodes])
    return rows[rows >= 0].astype(np.int32)
