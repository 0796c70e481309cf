"""Selections of nodes by their rest positions: where a pin holds, where a load acts.

Boxes and half-spaces are closed. A node on the border stays in when only rounding moved it off
(a few units in the last place of the mesh's largest coordinate): no length in metres decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tisoft import checks
from tisoft.checks import FieldError, Vector, put
from tisoft.geometry.groups import listed, named
from tisoft.geometry.mesh import Mesh, present_numbers
from tisoft.live import frozen

Points = NDArray[np.float64]
NodeNumbers = NDArray[np.int64]

_ROUNDING = 64 * np.finfo(np.float64).eps


class Selection(Protocol):
    """A rule that picks nodes."""

    def select(self, points: Points, numbers: ArrayLike | None = None) -> NodeNumbers:
        """Rows of `points` that are selected, ascending and unique.

        Args:
            points: rest positions [m], shape (nodes, 3).
            numbers: each node's number in its file (`mesh.kept_nodes`), shape (nodes,), strictly
                ascending; left out, nodes are numbered 0, 1, 2, …
        """
        ...


def rows_in(where: Selection, mesh: Mesh) -> NodeNumbers:
    """Rows of `mesh.points` that a selection picks; raises FieldError as the selection does.

    A selection that needs more of a mesh than places and numbers has a method `rows_in(mesh)`.
    """
    own = getattr(where, "rows_in", None)
    if own is not None:
        rows: NodeNumbers = own(mesh)
        return rows
    return where.select(mesh.points, mesh.kept_nodes)


def check_selection(where: Any) -> None:
    """Raises FieldError where `where` is no selection."""
    if not callable(getattr(where, "select", None)):
        problem = "must be a selection, as tisoft.where.box(lo, hi) or tisoft.where.everything()"
        raise FieldError("where", problem, where)


def _slack(points: Points) -> float:
    """How far rounding may have moved a node [m]."""
    return _ROUNDING * float(np.abs(points).max(initial=0.0))


@frozen
@dataclass(frozen=True)
class Box:
    """Nodes with lo <= x <= hi in every component [m]; ±inf leaves a side open."""

    lo: Vector
    hi: Vector

    def __post_init__(self) -> None:
        put(self, "lo", checks.corner("box[0]", self.lo))
        put(self, "hi", checks.corner("box[1]", self.hi))
        for axis, lo, hi in zip("xyz", self.lo, self.hi, strict=True):
            if lo > hi:
                problem = f"is below box[0] in {axis} ({hi:g} < {lo:g}); swap the two numbers"
                raise FieldError("box[1]", problem, self.hi)

    def select(self, points: Points, numbers: ArrayLike | None = None) -> NodeNumbers:
        """Nodes inside the box or on its border."""
        slack = _slack(points)
        inside = (points >= np.array(self.lo) - slack) & (points <= np.array(self.hi) + slack)
        return np.flatnonzero(inside.all(axis=1))


@frozen
@dataclass(frozen=True)
class HalfSpace:
    """Nodes on a plane or on the side that its normal points away from."""

    point: Vector
    normal: Vector

    def __post_init__(self) -> None:
        put(self, "point", checks.vector("plane.point", self.point))
        put(self, "normal", checks.direction("plane.normal", self.normal))

    def select(self, points: Points, numbers: ArrayLike | None = None) -> NodeNumbers:
        """Nodes on or below the plane."""
        return np.flatnonzero((points - np.array(self.point)) @ self.normal <= _slack(points))


@frozen
@dataclass(frozen=True)
class Nodes:
    """Nodes by their numbers in the mesh file (0-based)."""

    ids: tuple[int, ...]

    def rows_in(self, mesh: Mesh) -> NodeNumbers:
        """The nodes of these numbers, or those that they were merged into."""
        numbers = present_numbers(mesh, np.array(self.ids, dtype=np.int64))
        return replace(self, ids=numbers.tolist()).select(mesh.points, mesh.kept_nodes)

    def __post_init__(self) -> None:
        items = checks.sequence("nodes", self.ids, "node numbers")
        ids = tuple(checks.integer(f"nodes[{i}]", item) for i, item in enumerate(items))
        put(self, "ids", ids)

    def select(self, points: Points, numbers: ArrayLike | None = None) -> NodeNumbers:
        """The nodes of these numbers.

        Raises:
            FieldError: a number that the mesh has not, or that no element uses.
        """
        known = np.arange(len(points)) if numbers is None else np.asarray(numbers)
        wanted = np.unique(np.array(self.ids, dtype=np.int64))
        places = np.searchsorted(known, wanted)
        found = places < len(known)
        found[found] = known[places[found]] == wanted[found]
        if not found.all():
            lost = int(wanted[~found][0])
            highest = int(known[-1]) if len(known) else -1
            why = "no element uses it" if lost < highest else f"the highest is {highest}"
            field = f"nodes[{self.ids.index(lost)}]"
            raise FieldError(field, f"is no node of the mesh: {why}", lost)
        return places


@frozen
@dataclass(frozen=True)
class Nearest:
    """The one node nearest to a point [m]; of equally near ones, the first."""

    point: Vector

    def __post_init__(self) -> None:
        put(self, "point", checks.vector("nearest", self.point))

    def select(self, points: Points, numbers: ArrayLike | None = None) -> NodeNumbers:
        """The nearest node, as an array of one."""
        if not len(points):
            return np.arange(0)
        away = points - np.array(self.point)
        reach = float(np.abs(away).max()) or 1.0  # keeps the squares from over- and underflow
        return np.array([np.square(away / reach).sum(axis=1).argmin()])


@frozen
@dataclass(frozen=True)
class Everything:
    """All nodes."""

    def select(self, points: Points, numbers: ArrayLike | None = None) -> NodeNumbers:
        """All rows."""
        return np.arange(len(points))


@frozen
@dataclass(frozen=True)
class InRegion:
    """Nodes of the cells that the mesh file calls by a name or a number."""

    name: str | int

    def __post_init__(self) -> None:
        _check_name("region", self.name)

    def select(self, points: Points, numbers: ArrayLike | None = None) -> NodeNumbers:
        """None: places and numbers alone tell no regions."""
        return np.arange(0)

    def rows_in(self, mesh: Mesh) -> NodeNumbers:
        """The region's nodes."""
        cells = np.concatenate([mesh.regions[k].tets for k in self.found(mesh)])
        found, begun = [np.empty(0, np.int64)], 0
        for rows in mesh.cells.values():
            mine = cells[(cells >= begun) & (cells < begun + len(rows))] - begun
            found.append(rows[mine].ravel().astype(np.int64))
            begun += len(rows)
        return np.unique(np.concatenate(found))

    def found(self, mesh: Mesh) -> list[int]:
        """Places of the regions that are meant; raises FieldError where there are none."""
        return _found("region", self.name, mesh.regions)


@frozen
@dataclass(frozen=True)
class InSet:
    """Nodes, or the nodes of faces, that the mesh file calls by a name or a number."""

    name: str | int

    def __post_init__(self) -> None:
        _check_name("set", self.name)

    def select(self, points: Points, numbers: ArrayLike | None = None) -> NodeNumbers:
        """None: places and numbers alone tell no sets."""
        return np.arange(0)

    def rows_in(self, mesh: Mesh) -> NodeNumbers:
        """The set's nodes."""
        sets = [mesh.sets[k].nodes for k in self.found(mesh)]
        return np.unique(np.concatenate(sets)).astype(np.int64)

    def faces_in(self, mesh: Mesh) -> NDArray[np.int64] | None:
        """Rows of `mesh.surface` that are the set's faces; None where it has nodes alone."""
        faces = np.concatenate([mesh.sets[k].faces for k in self.found(mesh)])
        if not len(faces):
            return None
        return mesh.boundary.matching(faces)

    def found(self, mesh: Mesh) -> list[int]:
        """Places of the sets that are meant; raises FieldError where there are none."""
        return _found("set", self.name, mesh.sets)


def _check_name(field: str, value: Any) -> None:
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise FieldError(
            field, f"must be the name or the number of a {field} of the mesh file", value
        )


def _found(field: str, name: str | int, groups: Sequence[Any]) -> list[int]:
    places = named(groups, name)
    if not places:
        there = f"it has {listed(groups)}" if groups else f"it has no {field}s"
        raise FieldError(field, f"is no {field} of the mesh: {there}", name)
    return places


def region(name: str | int) -> InRegion:
    """Nodes of the cells that the mesh file calls by this name or number."""
    return InRegion(name)


def named_set(name: str | int) -> InSet:
    """Nodes, or nodes of faces, that the mesh file calls by this name or number."""
    return InSet(name)


def box(lo: ArrayLike, hi: ArrayLike) -> Box:
    """Nodes in the closed box between the corners lo and hi [m]."""
    return Box(_any(lo), _any(hi))


def nodes(ids: ArrayLike) -> Nodes:
    """Nodes by their numbers in the mesh file."""
    return Nodes(_any(ids))


def plane(point: ArrayLike, normal: ArrayLike) -> HalfSpace:
    """Nodes on the plane through `point` [m], or on the side that `normal` points away from."""
    return HalfSpace(_any(point), _any(normal))


def nearest(point: ArrayLike) -> Nearest:
    """The node nearest to `point` [m]."""
    return Nearest(_any(point))


def everything() -> Everything:
    """All nodes."""
    return Everything()


def _any(value: Any) -> Any:
    """Any sequence; the dataclass checks it and keeps a tuple."""
    return value
