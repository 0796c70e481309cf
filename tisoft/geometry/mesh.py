"""Meshes, frozen and checked once: TetMesh, SpringNet for springs alone, else SolidMesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import InitVar, dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tisoft.errors import MeshError
from tisoft.geometry import topology
from tisoft.geometry.checks import (
    check_finite,
    check_range,
    check_repeats,
    check_tets,
    index_numbers,
    index_rows,
    numbers,
    only_used,
    positions,
    unit_sized,
)
from tisoft.geometry.faces import Boundary
from tisoft.geometry.groups import NodeSet, Region
from tisoft.geometry.joints import Joints, joints_of
from tisoft.geometry.moving import moved
from tisoft.geometry.quality import signed_volumes
from tisoft.geometry.solid import SolidMesh
from tisoft.live import frozen

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@frozen
@dataclass(frozen=True, eq=False)
class TetMesh:
    """Tetrahedra at rest.  Raises MeshError where a value is not finite, an index is out of range,
    or a tet is degenerate or wrongly oriented; `tet_mesh` cleans untidy input first.
    """

    points: Floats
    """Rest positions [m], shape (nodes, 3), in the file's order."""
    tets: Ints
    """Nodes of each tet, shape (tets, 4), in the file's order; det(x1-x0, x2-x0, x3-x0) > 0."""
    kept_nodes: NDArray[np.int64]
    """Number (from 0) that each node has in the file, shape (nodes,)."""
    turned: Ints = field(default_factory=lambda: np.empty(0, np.int32))
    """Tets that the file orients the other way, ascending."""
    dropped_nodes: int = 0
    """Nodes of the file that no tet uses."""
    regions: tuple[Region, ...] = ()
    """Tets that the file calls by names or numbers."""
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
    checked: InitVar[bool] = False
    """Points and tets come from a mesh, or have been checked as those of a mesh are."""

    def __post_init__(self, checked: bool) -> None:
        _freeze(self, "turned", index_numbers(self.turned, "turned").astype(np.int32))
        if checked:
            for name in ("points", "tets", "kept_nodes"):
                _freeze(self, name, getattr(self, name))
            return
        _freeze(self, "tets", _rows(self.tets, 4, "tet", self.points))
        _freeze_nodes(self)
        if len(self.tets) == 0:
            raise MeshError("a tetrahedral mesh needs at least one tet, and this one has none")
        turned = check_tets(self.points, self.tets)
        if turned.any():
            raise MeshError(
                f"{numbers('tet', turned)} oriented with negative volume; "
                "build the mesh with tet_mesh(points, tets), which turns such tets round"
            )

    @property
    def flipped(self) -> int:
        """How many tets the file orients the other way."""
        return len(self.turned)

    @property
    def cells(self) -> dict[str, Ints]:
        """Nodes of the cells by kind, each of shape (cells, corners)."""
        return {"tet4": self.tets}

    @property
    def elements(self) -> int:
        """How many cells there are."""
        return len(self.tets)

    @property
    def carriers(self) -> Ints:
        """Linear tets that fill the cells, for what the mesh carries, shape (tets, 4)."""
        return self.tets

    @cached_property
    def boundary(self) -> Boundary:
        """Faces of one cell only."""
        return Boundary((self.surface.astype(np.int64),))

    @cached_property
    def volumes(self) -> Floats:
        """Rest volume of each tet [m³], shape (tets,)."""
        return signed_volumes(self.points, self.tets)

    @cached_property
    def edges(self) -> Ints:
        """Edges of the tets, shape (edges, 2): each once, smaller node first, ascending."""
        return topology.edges_of(self.tets)

    @cached_property
    def surface(self) -> Ints:
        """Boundary triangles, shape (triangles, 3), normals outward."""
        return topology.boundary_faces(self.tets)

    @cached_property
    def pieces(self) -> int:
        """Number of parts that share no node."""
        return topology.pieces(self.edges, len(self.points))

    @cached_property
    def joints(self) -> Joints:
        """Where nodes, faces and tets are not joined as their places show."""
        return joints_of(self.points, self.tets, self.turned)

    def transformed(
        self,
        *,
        scale: float = 1.0,
        rotate: Sequence[float] = (0.0, 0.0, 0.0),
        translate: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> TetMesh:
        """The mesh scaled, then turned about x, y and z [degrees], then moved [m]."""
        return replace(self, points=moved(self.points, scale, rotate, translate))


@frozen
@dataclass(frozen=True, eq=False)
class SpringNet:
    """Nodes joined by springs, without tets: cloth, grids of springs, bare nets.  Raises MeshError
    where a value is not finite, an index is out of range or a spring has no length.
    """

    points: Floats
    """Rest positions [m], shape (nodes, 3)."""
    edges: Ints
    """The two nodes of each spring, shape (springs, 2), in the order given."""
    surface: Ints
    """Triangles to draw, shape (triangles, 3); may be empty."""
    kept_nodes: NDArray[np.int64]
    """Number (from 0) that each node has in the file, shape (nodes,)."""
    dropped_nodes: int = 0
    """Nodes of the file that no spring uses."""
    sets: tuple[NodeSet, ...] = ()
    """Nodes and faces that the file calls by names or numbers."""
    warnings: tuple[str, ...] = ()
    """As of a TetMesh."""
    notes: tuple[str, ...] = ()
    """As of a TetMesh."""
    questions: tuple[str, ...] = ()
    """As of a TetMesh."""
    joined: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 2), np.int64))
    """Nodes merged into others: number in the file, and row of `points`, shape (merged, 2)."""

    def __post_init__(self) -> None:
        _freeze(self, "edges", _rows(self.edges, 2, "spring", self.points))
        _freeze(self, "surface", _rows(self.surface, 3, "triangle", self.points))
        _freeze_nodes(self)
        if len(self.points) == 0:
            raise MeshError("a net of springs needs at least one node, and this one has none")
        ends = unit_sized(self.points)[self.edges]
        short = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) <= 1e-9
        if short.any():
            raise MeshError(f"{numbers('spring', short)} without length; take the springs out")

    @property
    def tets(self) -> Ints:
        """No tets: shape (0, 4)."""
        return np.empty((0, 4), dtype=np.int32)

    @property
    def cells(self) -> dict[str, Ints]:
        """None, of whatever kind and shape."""
        return {}

    @property
    def elements(self) -> int:
        """None."""
        return 0

    @cached_property
    def boundary(self) -> Boundary:
        """The triangles to draw."""
        return Boundary((self.surface.astype(np.int64),))

    @property
    def flipped(self) -> int:
        """None: there are no tets."""
        return 0

    @property
    def regions(self) -> tuple[Region, ...]:
        """None: there are no tets."""
        return ()

    @cached_property
    def pieces(self) -> int:
        """Number of parts that no spring joins."""
        return topology.pieces(self.edges, len(self.points))

    def transformed(
        self,
        *,
        scale: float = 1.0,
        rotate: Sequence[float] = (0.0, 0.0, 0.0),
        translate: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> SpringNet:
        """The net scaled, then turned about x, y and z [degrees], then moved [m]."""
        return replace(self, points=moved(self.points, scale, rotate, translate))


Mesh = TetMesh | SolidMesh | SpringNet


def present_numbers(mesh: Mesh, numbers: NDArray[np.int64]) -> NDArray[np.int64]:
    """Nodes' numbers in the file, those of merged nodes replaced by that of their node."""
    if not len(mesh.joined):
        return numbers
    gone, row = mesh.joined[np.argsort(mesh.joined[:, 0])].T
    place = np.minimum(np.searchsorted(gone, numbers), len(gone) - 1)
    return np.where(gone[place] == numbers, mesh.kept_nodes[row[place]], numbers)


def tet_mesh(points: ArrayLike, tets: ArrayLike) -> TetMesh:
    """A TetMesh of untidy input: unused nodes are dropped and wrongly oriented tets turned round,
    both counted.  Raises MeshError for degenerate or repeated tets, named by number (from 0).
    """
    nodes, corners, kept = only_used(points, index_rows(tets, 4, "tet"), "tet")
    if len(corners) == 0:
        raise MeshError("a tetrahedral mesh needs at least one tet, and this one has none")
    check_repeats(corners)
    turned = check_tets(nodes, corners)
    corners[turned] = corners[turned][:, [0, 1, 3, 2]]
    dropped = len(np.asarray(points)) - len(nodes)
    backward = np.flatnonzero(turned).astype(np.int32)
    return TetMesh(nodes, corners, kept, backward, dropped, checked=True)


def spring_net(points: ArrayLike, edges: ArrayLike) -> SpringNet:
    """A SpringNet of untidy input: repeated edges are merged, unused nodes dropped, both told."""
    rows = index_rows(edges, 2, "spring")
    check_range(rows, "spring", len(np.asarray(points)))
    unique = topology.unique_edges(rows)
    nodes, ends, kept = only_used(points, unique, "spring")
    dropped = len(np.asarray(points)) - len(nodes)
    twice = len(rows) - len(unique)
    told = (f"{twice} springs that join the same nodes as others count once",) if twice else ()
    nothing = np.empty((0, 3), np.int32)
    return SpringNet(nodes, ends, nothing, kept, dropped_nodes=dropped, warnings=told)


def bare_net(points: ArrayLike, springs: ArrayLike, surface: ArrayLike = ()) -> SpringNet:
    """A SpringNet in which nodes and springs keep their order and number."""
    nodes = positions(points)
    rows = _rows(springs, 2, "spring", nodes)
    triangles = _rows(surface, 3, "triangle", nodes)
    return SpringNet(nodes, rows, triangles, np.arange(len(nodes)))


def _rows(values: ArrayLike, width: int, what: str, points: Floats) -> Ints:
    return check_range(index_rows(values, width, what), what, len(points))


def _freeze_nodes(mesh: TetMesh | SpringNet) -> None:
    points = positions(mesh.points)
    kept = index_numbers(mesh.kept_nodes, "kept_nodes")
    if kept.shape != (len(points),):
        raise MeshError(f"kept_nodes has shape {kept.shape}, but there are {len(points)} nodes")
    check_finite(points, kept)
    _freeze(mesh, "points", points)
    _freeze(mesh, "kept_nodes", kept)


def _freeze(mesh: TetMesh | SpringNet, name: str, values: NDArray[np.generic]) -> None:
    values = np.array(values, order="C")
    values.flags.writeable = False
    object.__setattr__(mesh, name, values)
