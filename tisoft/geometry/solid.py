"""Meshes of hexahedra, quadratic tets, and several kinds of cells, frozen and checked once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import InitVar, dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tisoft.errors import MeshError
from tisoft.geometry import topology
from tisoft.geometry.cells import (
    CELLS,
    HEX8,
    LATTICE,
    QUADRATIC_EDGES,
    SIGNS,
    hex_jacobians,
    point_volumes,
)
from tisoft.geometry.checks import (
    check_finite,
    check_range,
    index_numbers,
    index_rows,
    numbers,
    positions,
)
from tisoft.geometry.faces import Boundary, boundary_of
from tisoft.geometry.groups import NodeSet, Region
from tisoft.geometry.moving import moved
from tisoft.live import frozen

if TYPE_CHECKING:
    from tisoft.geometry.cage.build import Cage
    from tisoft.geometry.cage.carried import Carried
    from tisoft.geometry.mesh import TetMesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

FLAT = 1e-9
"""Share of a cell's size³ below which the volume at one of its points is none."""
TOP_FIRST = np.array([4, 5, 6, 7, 0, 1, 2, 3])
"""A hexahedron that is numbered inside out, turned round."""
SMALL_TETS = np.array(
    [
        *([0, 4, 6, 7], [1, 5, 4, 8], [2, 6, 5, 9], [3, 8, 7, 9]),
        *([4, 9, 7, 8], [4, 9, 8, 5], [4, 9, 5, 6], [4, 9, 6, 7]),
    ]
)
"""Tets that a quadratic tet falls into: four at its corners, four round the edge 4-9."""
ASTRAY = 0.6
"""Share of an edge's length by which its middle node may lie off the middle."""


def _none(width: int) -> Ints:
    return np.empty((0, width), np.int32)


@frozen
@dataclass(frozen=True, eq=False)
class SolidMesh:
    """Cells of several kinds at rest, joined at their nodes; corners in the order of VTK (see
    `geometry.cells`).  Raises MeshError where a value is not finite, an index is out of range, or a
    cell is folded; `solid_mesh` cleans untidy input first.
    """

    points: Floats
    """Rest positions [m], shape (nodes, 3)."""
    kept_nodes: NDArray[np.int64]
    """Number (from 0) that each node has in the file, shape (nodes,)."""
    tets: Ints = field(default_factory=lambda: _none(4))
    """Nodes of each linear tet, shape (tets, 4)."""
    quadratic_tets: Ints = field(default_factory=lambda: _none(10))
    """Nodes of each quadratic tet, shape (tets, 10)."""
    hexes: Ints = field(default_factory=lambda: _none(8))
    """Nodes of each hexahedron, shape (hexes, 8)."""
    flipped: int = 0
    """Cells that the file orients the other way."""
    dropped_nodes: int = 0
    """Nodes of the file that no cell uses."""
    regions: tuple[Region, ...] = ()
    """Cells that the file calls by names or numbers."""
    sets: tuple[NodeSet, ...] = ()
    """Nodes and faces that the file calls by names or numbers."""
    warnings: tuple[str, ...] = ()
    """What reading changed of the body, a sentence each."""
    notes: tuple[str, ...] = ()
    """What reading left out, and the body does not depend on."""
    questions: tuple[str, ...] = ()
    """What looks like a slip of its user, each the rest of a sentence about the body."""
    joined: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 2), np.int64))
    """Nodes merged into others: number in the file, and row of `points`, shape (merged, 2)."""
    cage: Cage | None = None
    """What the cells are filled with, where they are a lattice around a surface."""
    checked: InitVar[bool] = False
    """Points and cells come from a mesh, or have been checked as those of a mesh are."""

    def __post_init__(self, checked: bool) -> None:
        points = positions(self.points)
        kept = index_numbers(self.kept_nodes, "kept_nodes")
        if kept.shape != (len(points),):
            raise MeshError(f"kept_nodes has shape {kept.shape}, but there are {len(points)} nodes")
        check_finite(points, kept)
        self._freeze("points", points)
        self._freeze("kept_nodes", kept)
        for name, word in FIELDS.items():
            width = CELLS[word].corners
            rows = index_rows(getattr(self, name), width, NAMES[word])
            self._freeze(name, check_range(rows, NAMES[word], len(points)))
        if not self.cells:
            raise MeshError("a mesh of a solid needs at least one cell, and this one has none")
        if not checked:
            for word, rows in self.cells.items():
                check_cells(word, points, rows)

    def _freeze(self, name: str, values: NDArray[np.generic]) -> None:
        values = np.array(values, order="C")
        values.flags.writeable = False
        object.__setattr__(self, name, values)

    @cached_property
    def cells(self) -> dict[str, Ints]:
        """Nodes of the cells by kind, kinds without any left out; cells are numbered in this
        order.
        """
        rows = {word: getattr(self, name) for name, word in FIELDS.items()}
        return {word: own for word, own in rows.items() if len(own)}

    @property
    def elements(self) -> int:
        """How many cells there are."""
        return sum(len(rows) for rows in self.cells.values())

    @cached_property
    def volumes(self) -> Floats:
        """Rest volume of each cell [m³], shape (elements,)."""
        found = [point_volumes(word, self.points[rows]) for word, rows in self.cells.items()]
        whole = np.concatenate([own.sum(axis=1) for own in found])
        return whole if self.cage is None else whole * self.cage.moments[:, 0]

    @cached_property
    def edges(self) -> Ints:
        """Edges, shape (edges, 2): each once, smaller node first, ascending."""
        rows = [own[:, CELLS[word].edges].reshape(-1, 2) for word, own in self.cells.items()]
        return topology.unique_edges(np.concatenate(rows))

    @cached_property
    def boundary(self) -> Boundary:
        """Faces of one cell only."""
        return boundary_of(dict(self.cells))

    @cached_property
    def carried(self) -> Carried | None:
        """The surface that a cage carries, as loads and pins see it; None for other meshes."""
        from tisoft.geometry.cage.carried import Carried

        return None if self.cage is None else Carried(self)

    @property
    def surface(self) -> Ints:
        """Triangles that the boundary is drawn, picked and met with, shape (triangles, 3)."""
        return self.boundary.triangles.astype(np.int32)

    @cached_property
    def pieces(self) -> int:
        """Number of parts that share no node."""
        return topology.pieces(self.edges, len(self.points))

    @property
    def carriers(self) -> Ints:
        """Linear tets that fill the cells, for what the mesh carries, shape (tets, 4)."""
        return self.carriers_of[0]

    @cached_property
    def carriers_of(self) -> tuple[Ints, NDArray[np.int64]]:
        """The carriers, and the number of the cell that each is a piece of."""
        quadratic = self.quadratic_tets[:, SMALL_TETS].reshape(-1, 4)
        begun = np.cumsum([0, len(self.tets), len(self.quadratic_tets)])
        found = [self.tets, quadratic]
        cells = [np.arange(begun[1]), np.repeat(np.arange(begun[1], begun[2]), len(SMALL_TETS))]
        # Hexahedra are cut from their smallest corner, so that neighbours agree on their faces.
        first = self.hexes.argmin(axis=1) if len(self.hexes) else np.empty(0, np.int64)
        for corner in range(8):
            own = np.flatnonzero(first == corner)
            for face in HEX8.faces:
                if corner not in face and len(own):
                    quad = self.hexes[own][:, face]
                    turn = (quad.argmin(axis=1)[:, None] + np.arange(4)) % 4
                    quad = np.take_along_axis(quad, turn, axis=1)
                    apex = self.hexes[own][:, [corner]]
                    found += [np.hstack([apex, quad[:, third]]) for third in ([0, 1, 2], [0, 2, 3])]
                    cells += [begun[2] + own] * 2
        return np.concatenate(found).astype(np.int32), np.concatenate(cells)

    def transformed(
        self,
        *,
        scale: float = 1.0,
        rotate: Sequence[float] = (0.0, 0.0, 0.0),
        translate: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> SolidMesh:
        """The mesh scaled, then turned about x, y and z [degrees], then moved [m]."""
        return replace(self, points=moved(self.points, scale, rotate, translate), checked=True)


FIELDS = {"tets": "tet4", "quadratic_tets": "tet10", "hexes": "hex8"}
TOLD = (
    "flipped", "dropped_nodes", "regions", "sets", "warnings", "notes", "questions", "joined",
)  # fmt: skip
"""What a mesh tells of its file."""
NAMES = {"tet4": "tet", "tet10": "quadratic tet", "hex8": "hex"}
"""What cells are called in sentences."""


def check_cells(word: str, points: Floats, rows: Ints) -> None:
    """Refuses folded cells, and quadratic tets whose nodes are in another order."""
    X = points[rows]
    if word == "tet10":
        _check_middles(X)
    where = hex_corners(X) if word == "hex8" else point_volumes(word, X)
    size = np.ptp(X, axis=1).max(axis=1) ** 3
    bad = ~(where > FLAT * size[:, None])
    folded = bad.any(axis=1)
    if not folded.any():
        return
    first = int(np.flatnonzero(folded)[0])
    spot = X[first].mean(axis=0)
    place = "(" + ", ".join(f"{value:.6g}" for value in spot) + ")"
    what = f"{numbers(NAMES[word], folded)} folded or inside out: near {place} m"
    remedy = "repair the mesh with a mesh generator"
    if word == "hex8":
        what += f" the corners with nodes {rows[first][bad[first]].tolist()} are turned in"
        if (hex_corners(X[:, LATTICE]) > 0.0).all():
            remedy = "its corners are numbered row by row (VTK's voxels); number them round a face"
    else:
        what += f" the Jacobian is not positive at {int(bad[first].sum())} of 4 points"
    raise MeshError(f"{what}; {remedy}")


def hex_corners(X: Floats) -> Floats:
    """Jacobians at the corners of hexahedra [m³], shape (cells, 8), in the mesh's order."""
    at = SIGNS[[1, 2, 4]].T.astype(float)
    return np.linalg.det(hex_jacobians(X[:, LATTICE], at)[1])[:, LATTICE] * 8.0


def _check_middles(X: Floats) -> None:
    a, b = X[:, QUADRATIC_EDGES[:, 0]], X[:, QUADRATIC_EDGES[:, 1]]
    off = np.linalg.norm(X[:, 4:] - 0.5 * (a + b), axis=2)
    astray = (off > ASTRAY * np.linalg.norm(b - a, axis=2)).any(axis=1)
    if astray.any():
        raise MeshError(
            f"{numbers('quadratic tet', astray)} numbered otherwise: nodes of its edges lie far "
            "from their middles; they follow the corners in the order 01, 12, 02, 03, 13, 23"
        )


def solid_mesh(
    points: ArrayLike,
    *,
    tets: ArrayLike = (),
    quadratic_tets: ArrayLike = (),
    hexes: ArrayLike = (),
) -> SolidMesh:
    """A SolidMesh of untidy input: unused nodes are dropped and cells oriented the wrong way
    turned round, both counted.  Raises MeshError for folded cells, named by number (from 0).
    """
    nodes = positions(points)
    given = {"tet4": tets, "tet10": quadratic_tets, "hex8": hexes}
    cells: dict[str, Ints] = {}
    for word, values in given.items():
        rows = index_rows(values, CELLS[word].corners, NAMES[word])
        cells[word] = check_range(rows, NAMES[word], len(nodes))
    used = np.zeros(len(nodes), bool)
    for rows in cells.values():
        used[rows.ravel()] = True
    kept = np.flatnonzero(used)
    check_finite(nodes[kept], kept)
    renumber = np.cumsum(used) - 1
    flipped = 0
    for word, rows in cells.items():
        own = renumber[rows].astype(np.int32)
        own, turned = _turned_round(word, nodes[kept], own)
        cells[word], flipped = own, flipped + turned
    return SolidMesh(
        nodes[kept], kept, cells["tet4"], cells["tet10"], cells["hex8"],
        flipped=flipped, dropped_nodes=len(nodes) - len(kept),
    )  # fmt: skip


def _turned_round(word: str, points: Floats, rows: Ints) -> tuple[Ints, int]:
    """The cells, those that are inside out as a whole turned round, and how many those were."""
    if not len(rows):
        return rows, 0
    X = points[rows]
    wrong = (hex_corners(X) if word == "hex8" else point_volumes(word, X)).max(axis=1) < 0.0
    other = {
        "hex8": TOP_FIRST,
        "tet4": np.array([0, 2, 1, 3]),
        "tet10": np.array([0, 2, 1, 3, 6, 5, 4, 7, 9, 8]),
    }[word]
    rows = rows.copy()
    rows[wrong] = rows[wrong][:, other]
    return rows, int(wrong.sum())


def quadratic(mesh: TetMesh) -> SolidMesh:
    """The mesh with quadratic tets of straight edges; the nodes of their edges come last."""
    ends = np.sort(mesh.tets[:, QUADRATIC_EDGES].reshape(-1, 2).astype(np.int64), axis=1)
    known, index = np.unique(ends[:, 0] * len(mesh.points) + ends[:, 1], return_inverse=True)
    a, b = known // len(mesh.points), known % len(mesh.points)
    middles = 0.5 * (mesh.points[a] + mesh.points[b])
    numbers_of = mesh.kept_nodes.max() + 1 + np.arange(len(middles))
    told = {name: getattr(mesh, name) for name in TOLD}
    told["sets"] = tuple(_with_middles(group, mesh, a, b) for group in mesh.sets)
    return SolidMesh(
        np.concatenate([mesh.points, middles]),
        np.concatenate([mesh.kept_nodes, numbers_of]),
        quadratic_tets=np.hstack([mesh.tets, len(mesh.points) + index.reshape(-1, 6)]),
        **told,
        checked=True,
    )


def _with_middles(group: NodeSet, mesh: TetMesh, a: Ints, b: Ints) -> NodeSet:
    """A set with the middle nodes of those edges a-b on the surface that lie in it."""
    span = len(mesh.points)
    faces = group.faces if len(group.faces) else mesh.surface
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64), axis=1)
    known = np.isin(a * span + b, sides[:, 0] * span + sides[:, 1])
    own = np.zeros(span, bool)
    own[group.nodes] = True
    more = np.flatnonzero(known & own[a] & own[b]) + span
    nodes = np.concatenate([group.nodes, more]).astype(np.int32)
    return NodeSet(group.name, group.tag, nodes, group.faces)
