"""Soft bodies: a mesh, what it is made of, and what holds and pushes it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tisoft import checks, live
from tisoft.checks import FieldError, Vector, inside
from tisoft.geometry.cage.carried import Carried, Means
from tisoft.geometry.mesh import Mesh, SolidMesh, SpringNet, TetMesh, present_numbers
from tisoft.geometry.skin import Skin
from tisoft.live import Items, Live
from tisoft.loads import Load, Torque
from tisoft.models.materials import MassSpring, Model, SolidModel
from tisoft.pins import Pin, Turn
from tisoft.region_material import RegionMaterial, materials_of
from tisoft.where import (
    Everything,
    InSet,
    Nearest,
    NodeNumbers,
    Nodes,
    Selection,
    check_selection,
    rows_in,
)


class Push(TypedDict, total=False):
    """What a load pushes with: one of these, see Load."""

    force: Any
    traction: Any
    pressure: float
    torque: Torque


class Pins(Items[Pin]):
    """Of a body."""

    kinds, words, field = (Pin,), "a Pin", "pin"


class Loads(Items[Load]):
    """Of a body."""

    kinds, words, field = (Load,), "a Load", "load"


class Regions(Items[RegionMaterial]):
    """Of a body."""

    kinds, words, field = (RegionMaterial,), "a RegionMaterial", "region"


@dataclass(eq=False)
class Body(Live):
    """A soft body: a mesh, what it is made of, how it starts, and its pins and loads.

    Args:
        name: unique in the scene.
        mesh: with tets, or springs alone (then the model must be MassSpring).
        model: its material's parameters.
        velocity: at t = 0 [m/s].
        spin: at t = 0 about the centre of mass [rad/s].
        pins, loads: what holds and pushes it; `pin` and `load` add to them.
        skin: a finer surface that the mesh carries, of `tisoft.skin`: drawn and written instead of
            the mesh's own.

    Raises:
        SceneError: naming the field and its value.
    """

    name: str
    mesh: Mesh
    model: Model
    velocity: Vector = (0.0, 0.0, 0.0)
    spin: Vector = (0.0, 0.0, 0.0)
    pins: list[Pin] = field(default_factory=Pins)
    loads: list[Load] = field(default_factory=Loads)
    regions: list[RegionMaterial] = field(default_factory=Regions)
    """Materials of their own in regions of the mesh."""
    skin: Skin | None = None
    contact: bool = True
    """Whether its surface touches other bodies, and itself."""
    self_contact: bool | None = None
    """Whether it touches itself; None: sheets of springs do."""
    thickness: float | None = None
    """Distance [m] that surfaces keep; None: a small share of its edges."""
    friction: float = 0.3
    """Coulomb's coefficient; of two bodies the mean counts."""

    _checks: ClassVar = {
        "name": checks.name,
        "mesh": live.a(
            (TetMesh, SolidMesh, SpringNet), "a mesh, as of tisoft.box or tisoft.read_mesh"
        ),
        "model": live.a(
            (SolidModel, MassSpring),
            "a model with its parameters, as ViscoElastic(1e6, 0.3, 1000.0)",
        ),
        "velocity": live.vector(unit="m/s"),
        "spin": live.vector(unit="rad/s"),
        "pins": Pins.of,
        "loads": Loads.of,
        "regions": Regions.of,
        "skin": live.perhaps(live.a(Skin, "a skin, as of tisoft.skin or tisoft.read_skin")),
        "contact": checks.flag,
        "self_contact": live.perhaps(checks.flag),
        "thickness": live.perhaps(live.number(above=0.0, unit="m")),
        "friction": live.number(least=0.0),
    }

    def __post_init__(self) -> None:
        cage = getattr(self.mesh, "cage", None)
        if self.skin is None and cage is not None:
            self.skin = cage.skin
        self.validate()

    def pin(
        self,
        where: Selection,
        axes: str = "xyz",
        *,
        velocity: ArrayLike | None = None,
        path: ArrayLike | None = None,
        turn: Turn | None = None,
        release: float | None = None,
    ) -> Pin:
        """Hold or move nodes: see Pin.  Raises SceneError also where no node is selected."""
        motion: dict[str, Any] = {"velocity": velocity, "path": path}  # Pin makes tuples of them
        pin = Pin(where, axes, turn=turn, release=release, **motion)
        self._check_pins([*self.pins, pin])
        self.pins.append(pin)
        return pin

    def load(
        self,
        where: Selection,
        *,
        start: float = 0.0,
        end: float | None = None,
        ramp: float | None = None,
        table: Any = None,
        **push: Unpack[Push],
    ) -> Load:
        """Push nodes or faces by one of force, traction, pressure and torque: see Load.

        Raises SceneError also where nothing is selected.
        """
        load = Load(where, start=start, end=end, ramp=ramp, table=table, **push)
        with inside(f"load[{len(self.loads)}]"):
            self._check_load(load)
        self.loads.append(load)
        return load

    def region(self, name: str | None = None, **numbers: Any) -> RegionMaterial:
        """Give a region of the mesh's file numbers of its own: see RegionMaterial.

        Raises SceneError also where the mesh has no such region.
        """
        region = RegionMaterial(name, **numbers)
        materials_of(self.mesh, self.model, [*self.regions, region])
        self.regions.append(region)
        return region

    @property
    def made_of(self) -> tuple[Any, ...]:
        """Its model and regions: what its materials are told by."""
        return (self.model, *self.regions)

    def materials(self) -> tuple[list[Model], NDArray[np.int64]]:
        """The models of its cells, its own first, and each cell's number among them, (cells,) in
        shape.

        Raises:
            FieldError: a region that is not there, an impossible number, or a cell of two regions.
        """
        return materials_of(self.mesh, self.model, self.regions)

    def nodes(self, where: Selection) -> NodeNumbers:
        """Rows of `mesh.points` that a selection picks, ascending; at least one.

        Raises:
            FieldError: where it picks none, or names a node that the mesh has not.
        """
        check_selection(where)
        with inside("where"):
            picked = self._picked(where)
        if len(picked) == 0:
            lo, hi = (_point(f(self.mesh.points, axis=0)) for f in (np.min, np.max))
            problem = f'selects no node of "{self.name}", whose mesh spans {lo} to {hi}'
            raise FieldError("where", problem, where)
        return picked

    @property
    def carried(self) -> Carried | None:
        """The surface that a cage carries, which pins and loads see; None for other meshes."""
        return self.mesh.carried if isinstance(self.mesh, SolidMesh) else None

    def points(self, where: Selection) -> NodeNumbers:
        """Points of the surface that a cage carries that a selection picks."""
        assert self.skin is not None and self.carried is not None
        skin = self.carried.skin
        places = skin.carried(self.mesh.points)
        with inside("where"):
            return where.select(places, np.arange(len(places)))

    def _picked(self, where: Selection) -> NodeNumbers:
        """Nodes that a selection picks; of a cage those that hold the points of its surface: the
        nodes in the selection, where the points lie on a plane of the lattice, else with them all
        within half a cell of the patch.
        """
        if self.carried is None:
            return rows_in(where, self.mesh)
        points = self.points(where)
        by_place = not isinstance(where, (Nodes, Nearest))
        own = where.select(self.mesh.points) if by_place else np.empty(0, np.int64)
        if not len(points) or (len(own) and self.carried.is_on_plane(points)):
            return own
        return np.union1d(own, self.carried.holders(points))

    def grip(self, where: Selection) -> tuple[NodeNumbers, Means | None]:
        """What a pin holds: rows of `mesh.points`; and of a cage's surface that lies on no plane of
        the lattice the means of its cells (`Carried.means`), with what is selected beside these.
        """
        if self.carried is not None and not isinstance(where, (Nodes, Nearest, Everything)):
            points, own = self.points(where), where.select(self.mesh.points)
            if len(points) and not (len(own) and self.carried.is_on_plane(points)):
                means = self.carried.means(points)
                if means is not None:
                    return np.setdiff1d(own, means.around), means
        return self.nodes(where), None

    def faces(self, where: Selection) -> NDArray[np.int64]:
        """Rows of `mesh.surface` (of a cage: of its skin) all of whose nodes are selected, or a
        set's own faces.
        """
        check_selection(where)
        if isinstance(where, InSet):
            with inside("where"):
                own = where.faces_in(self.mesh)
            if own is not None:
                return own
        if self.carried is not None:
            chosen = np.zeros(len(self.carried.skin.corners), bool)
            chosen[self.points(where)] = True
            return self.carried.within(chosen)
        picked = np.zeros(len(self.mesh.points), dtype=bool)
        picked[self.nodes(where)] = True
        return self.mesh.boundary.within(picked)

    def springs(self) -> NDArray[np.int64]:
        """The two nodes of each spring of a MassSpring body, rows of `mesh.points`, shape (n, 2).

        Raises SceneError for a number that no node has.
        """
        springs = getattr(self.model, "springs", None)
        if not isinstance(springs, np.ndarray):
            return self.mesh.edges.astype(np.int64)
        springs = present_numbers(self.mesh, springs)
        nodes = np.searchsorted(self.mesh.kept_nodes, springs).clip(max=len(self.mesh.points) - 1)
        lost = np.argwhere(self.mesh.kept_nodes[nodes] != springs)
        if len(lost):
            row, end = lost[0]
            problem = f'is no node of "{self.name}" (numbers count from 0)'
            raise FieldError(f"springs[{row}][{end}]", problem, int(springs[row, end]))
        return nodes

    def validate(self) -> None:
        """Check everything about this body; raises FieldError, the field relative to the body."""
        if isinstance(self.model, MassSpring):
            self._check_springs(self.model)
        elif self.mesh.elements == 0:
            problem = (
                f"needs tets or hexes, and the mesh of {self.name!r} has none; use mass-spring, "
                "or mesh the body's volume"
            )
            raise FieldError("model", problem)
        elif self.model.mass == "consistent" and not isinstance(self.mesh, TetMesh):
            problem = (
                "is for linear tets: the short iteration that solves M a = f converges for them "
                'alone; take mass = "lumped" (modes --mass consistent works for all elements)'
            )
            raise FieldError("mass", problem, "consistent")
        self.materials()
        self._check_thickness()
        if self.skin is not None and self.skin.corners.max() >= len(self.mesh.points):
            raise FieldError("skin", f"is carried by another mesh than that of {self.name!r}")
        self.check_held_and_pushed()

    def _check_thickness(self) -> None:
        size = float(np.ptp(self.mesh.points, axis=0).max())
        if self.thickness is not None and len(self.mesh.surface) and self.thickness > size:
            problem = (
                f"is the distance in m that surfaces keep, and {self.name!r} is only {size:.3g} m "
                "long; give a small share of an edge, or leave it out"
            )
            raise FieldError("thickness", problem, self.thickness)

    def check_held_and_pushed(self) -> None:
        """Check that pins and loads find what they hold and push; raises FieldError."""
        self._check_pins(self.pins)
        for i, load in enumerate(self.loads):
            with inside(f"load[{i}]"):
                self._check_load(load)

    def _check_springs(self, model: MassSpring) -> None:
        springs = self.springs()
        ends = self.mesh.points[springs]
        without_length = (ends[:, 0] == ends[:, 1]).all(axis=1)
        if without_length.any():
            row = int(np.flatnonzero(without_length)[0])
            raise FieldError(f"springs[{row}]", "joins two nodes in one place; remove it")
        counts = {"stiffness": len(springs), "rest_lengths": len(springs)}
        counts["node_mass"] = len(self.mesh.points)
        for key, count in counts.items():
            given = getattr(model, key)
            if isinstance(given, np.ndarray) and len(given) != count:
                what = "nodes" if key == "node_mass" else "springs"
                problem = f"has {len(given)} numbers for {count} {what}; give one for each"
                raise FieldError(key, problem)
        sheet = model.thickness is not None and len(self.mesh.surface) > 0
        if self.mesh.elements or sheet:
            return
        if model.density is not None:
            problem = "needs a volume, and this mesh has no cells; give node_mass (kg)"
            cloth = ", or thickness (m) beside it" if len(self.mesh.surface) else ""
            raise FieldError("density", problem + cloth, model.density)
        if model.needs_young:
            problem = "is from-young, which needs a volume, and this mesh has no cells; give N/m"
            raise FieldError("stiffness", problem)

    def _check_pins(self, pins: list[Pin]) -> None:
        """Every pin holds a node, and no two move the same component differently."""
        owners = np.full((3, len(self.mesh.points)), -1)
        patches: dict[tuple[int, ...], int] = {}
        for i, pin in enumerate(pins):
            with inside(f"pin[{i}]"):
                nodes, means = self.grip(pin.where)
            if means is not None:
                self._check_means(pins, i, means, patches)
            for axis in pin.axes:
                held = owners["xyz".index(axis)]
                for other in np.unique(held[nodes][held[nodes] >= 0]):
                    if pins[other].motion_along(axis) != pin.motion_along(axis):
                        node = int(self.mesh.kept_nodes[nodes[held[nodes] == other][0]])
                        problem = f"moves node {node} along {axis} otherwise than pin[{other}] does"
                        raise FieldError(f"pin[{i}]", f"{problem}; keep their nodes apart")
                held[nodes] = i

    def _check_means(
        self, pins: list[Pin], i: int, means: Means, known: dict[tuple[int, ...], int]
    ) -> None:
        for cell in map(tuple, means.nodes.tolist()):
            other = pins[known.setdefault(cell, i)]
            for axis in pins[i].axes:
                if axis in other.axes and other.motion_along(axis) != pins[i].motion_along(axis):
                    problem = f"moves a cell along {axis} otherwise than pin[{known[cell]}] does"
                    raise FieldError(f"pin[{i}]", f"{problem}; keep their patches apart")

    def _check_load(self, load: Load) -> None:
        if load.kind == "force":
            self.nodes(load.where)
        elif len(self.faces(load.where)) == 0:
            problem = (
                f"selects no face of {self.name!r}, and {load.kind} acts on faces; "
                "select all nodes of a surface triangle, or give a force"
            )
            raise FieldError("where", problem, load.where)


def _point(values: NDArray[np.float64]) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"
