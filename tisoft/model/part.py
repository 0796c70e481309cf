"""One body's share of a scene: its numbering, masses and cells, in internal order.

Internally nodes and cells follow Morton curves; `order` and `Cells.order` lead back to the mesh's
own order, `rank` from it.  World position = rest point + shift of the body's origin + u.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import laws
from tisoft.body import Body
from tisoft.checks import FieldError
from tisoft.elements import spring, tensor
from tisoft.geometry.topology import morton_order
from tisoft.model.cells import Cells, cells_of
from tisoft.model.network import Network, network
from tisoft.models.materials import MassSpring, MassTensor, SolidModel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass
class Part:
    """One body's share of the arrays."""

    body: Body
    index: int
    start: int
    """First of its nodes in the scene."""
    order: NDArray[np.int64]
    """Row of `mesh.points` of each node."""
    center: Floats
    """Middle of the rest points [m], shape (3,): rest positions inside are relative to it."""
    mass: Floats
    """Lumped masses [kg], shape (nodes,)."""
    solids: list[Cells] = field(default_factory=list)
    """Its cells, a list for each element and material; empty for springs."""
    springs: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 2), np.int64))
    """Nodes of each spring, in the order of `Body.springs`."""
    spring_numbers: Floats = field(default_factory=lambda: np.empty((0, 3)))
    """k [N/m], L₀ [m], c [N·s/m] of each spring."""
    shift: Floats = field(default_factory=lambda: np.zeros(3))
    kind: tuple[str, str] | None = None
    """Law and mass that the arrays were built for; None for springs."""

    @cached_property
    def size(self) -> float:
        """Largest extent of the rest shape [m]; 1 for a single node."""
        return float(np.ptp(self.body.mesh.points, axis=0).max()) or 1.0

    @property
    def nodes(self) -> slice:
        """Its rows of the nodal arrays."""
        return slice(self.start, self.start + len(self.order))

    @property
    def origin(self) -> Floats:
        """World position of its own origin [m], shape (3,)."""
        return self.center + self.shift

    @cached_property
    def rank(self) -> NDArray[np.int64]:
        """Node (from `start`) of each row of `mesh.points`."""
        rank = np.empty(len(self.order), np.int64)
        rank[self.order] = np.arange(len(self.order))
        return rank

    @cached_property
    def rest(self) -> Floats:
        """Rest points relative to `center` [m], shape (nodes, 3)."""
        return (self.body.mesh.points - self.center)[self.order]

    @cached_property
    def elements(self) -> int:
        """How many cells it has."""
        return sum(len(cells.nodes) for cells in self.solids)

    @cached_property
    def volume(self) -> Floats:
        """Of each cell [m³], shape (elements,), in the order of `solids`."""
        return np.concatenate([np.empty(0), *[cells.volume for cells in self.solids]])

    @cached_property
    def cell_order(self) -> NDArray[np.int64]:
        """Number in the mesh of each cell, in the order of `solids`."""
        return np.concatenate([np.empty(0, np.int64), *[cells.order for cells in self.solids]])

    @property
    def touches(self) -> bool:
        """Whether a surface that it carries meets obstacles, and its nodes do not."""
        return self.body.carried is not None

    def touching_points(self) -> NDArray[np.int64]:
        """The points of it that do."""
        carried = self.body.carried
        return np.empty(0, np.int64) if carried is None else carried.outermost()

    @property
    def pressed_rows(self) -> int:
        """Rows of `State.pressure_ends` that its pressures take at the most: those of all faces of
        a mesh, and of a carried surface, which needs many, those that are there from the start.
        """
        body = self.body
        if body.carried is None:
            return body.mesh.boundary.pressed_rows
        pressed = [load for load in body.loads if load.pressure is not None]
        return sum(len(body.carried.pressed(body.faces(load.where))[1]) for load in pressed)

    def kind_of_cell(self, number: int) -> str:
        """What a cell is called, by its place in the order of `solids`."""
        ends = np.cumsum([len(cells.nodes) for cells in self.solids])
        return str(self.solids[int(np.searchsorted(ends, number, side="right"))].element.word)

    @property
    def is_springs(self) -> bool:
        """Whether its forces are springs'."""
        return isinstance(self.body.model, MassSpring)

    @property
    def is_consistent(self) -> bool:
        """Whether its mass is the consistent matrix."""
        return self.kind is not None and self.kind[1] == "consistent"

    @property
    def is_tensor(self) -> bool:
        """Whether its forces are mass-tensors'."""
        return isinstance(self.body.model, MassTensor)

    @property
    def law(self) -> Any:
        """Class of its law; None for elements that need none."""
        return None if self.is_springs or self.is_tensor else self.solid_law

    @property
    def solid_law(self) -> Any:
        """Class of the law that its tets obey, mass-tensors' too; None for springs."""
        return None if self.kind is None else laws.law(self.kind[0])

    def material(self, cells: Cells) -> list[float]:
        """The row m of some of its cells: constants of the law [Pa], those of the element, elastic
        [Pa] and viscous [Pa·s], and φ and η [Pa·s].
        """
        if cells.model is None:
            return [0.0, 0.0]
        own = [cells.element.of_material(*pair) for pair in (cells.elastic, cells.viscous)]
        return [*self.law.constants(*cells.elastic), *own[0], *own[1], *cells.viscous]

    def is_viscous(self, cells: Cells | None = None) -> bool:
        """Whether it, or some of its cells, damp the rate of their strain or of their springs."""
        if cells is not None and cells.model is not None:
            return any(cells.viscous)
        if self.solids:
            return any(any(own.viscous) for own in self.solids)
        return bool(self.spring_numbers[:, 2].any())

    def blocks(self) -> list[Cells]:
        """What its blocks are filled with: its cells, its springs, or its mass-tensors' edges."""
        if self.is_springs:
            rest = spring.Spring.rest(self.rest, self.springs, self.spring_numbers)
            return [self._edges(spring.Spring, self.springs, rest)]
        if not self.is_tensor:
            return self.solids
        sums = [
            tensor.edge_sums(
                [(cells.nodes, cells.matrices(*getattr(cells, pair))) for cells in self.solids]
            )
            for pair in ("elastic", "viscous")
        ]
        rest = np.concatenate([sums[0][1], sums[1][1]], axis=1)
        return [self._edges(tensor.Tensor, sums[0][0], rest)]

    def _edges(self, element: Any, ends: NDArray[np.integer], rest: Floats) -> Cells:
        order = np.arange(len(ends))
        return Cells(element, ends.astype(np.int32), rest, order)

    def known(self) -> list[Floats]:
        """`Cells.known` of each of `solids`; consistent mass is up to five times lighter than the
        lumped but for translation.
        """
        heavier = 5.0 if self.is_consistent else 1.0
        return [cells.known(heavier=heavier) for cells in self.solids]

    def reread(self) -> None:
        """Take numbers anew from the body's model.

        Raises:
            FieldError: a model that needs other arrays than those the simulation was built with.
        """
        model = self.body.model
        if self.kind is None:
            same = self.is_springs and np.array_equal(self.rank[self.body.springs()], self.springs)
        else:
            same = isinstance(model, SolidModel) and self.kind == (model.law, model.mass)
        if not same or self.is_tensor != (self.kind_of_body is MassTensor):
            problem = (
                "cannot become another kind of model, mass or network while it runs; "
                "make a new Simulation and set_state"
            )
            raise FieldError(f"body[{self.index}].model", problem, type(model).__name__)
        if isinstance(model, MassSpring):
            net = network(self.body)
            self.spring_numbers, self.mass = spring_numbers(net), net.masses[self.order]
        else:
            self._make_of(*self.body.materials())
            self.weigh()

    def _make_of(self, models: list[Any], number: NDArray[np.int64]) -> None:
        """Give the cells their models; raises FieldError where cells of one had to part."""
        for cells in self.solids:
            if (number[cells.order] != cells.material).any():
                problem = "cannot take in other cells while it runs; make a new Simulation"
                raise FieldError(f"body[{self.index}].region", problem)
            cells.model = models[cells.material]

    @cached_property
    def kind_of_body(self) -> type:
        """Class of the model that the arrays were built for."""
        return type(self.body.model)

    def weigh(self) -> None:
        """Lumped masses of its cells."""
        self.mass = np.zeros(len(self.order))
        for cells in self.solids:
            each = cells.masses.ravel()
            self.mass += np.bincount(cells.nodes.ravel(), each, minlength=len(self.order))
        cage = getattr(self.body.mesh, "cage", None)
        if cage is not None:
            self.mass *= cage.factor[self.order]


def parts_of(bodies: list[Body]) -> list[Part]:
    """Number the bodies' nodes, tets and springs."""
    parts = []
    start = 0
    for index, body in enumerate(bodies):
        points = body.mesh.points
        order = morton_order(points)
        center = 0.5 * (points.min(axis=0) + points.max(axis=0))
        part = Part(body, index, start, order, center, np.empty(0))
        assert part.kind_of_body
        if isinstance(body.model, MassSpring):
            net = network(body)
            part.springs = part.rank[net.ends]
            part.spring_numbers = spring_numbers(net)
            part.mass = net.masses[order]
        else:
            _number_cells(part)
        _check_mass(part)
        parts.append(part)
        start += len(order)
    return parts


def spring_numbers(net: Network) -> Floats:
    """k [N/m], L₀ [m], c [N·s/m] of each spring, shape (springs, 3)."""
    damping = np.full(len(net.ends), net.damping)
    return np.stack([net.stiffness, net.lengths, damping], axis=1)


def _number_cells(part: Part) -> None:
    mesh, model = part.body.mesh, part.body.model
    part.solids = cells_of(mesh, part.center, part.rank, part.body.materials())
    assert isinstance(model, SolidModel)
    part.kind = (model.law, model.mass)
    part.weigh()


def _check_mass(part: Part) -> None:
    empty = np.flatnonzero(part.mass <= 0.0)
    if len(empty):
        node = int(part.body.mesh.kept_nodes[part.order[empty[0]]])
        raise FieldError(
            f"body[{part.index}].density",
            f"gives node {node} of {part.body.name!r} no mass (no tet or triangle uses it); "
            "give node_mass in kg",
        )
