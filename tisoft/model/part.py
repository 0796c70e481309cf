"""One body's share of a scene: its numbering, masses and cells, in internal order.

Internally nodes and cells follow Morton curves; `order` and `tet_order` lead back to the mesh's own
order, `rank` from it.  World position = rest point + shift of the body's origin + u.
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
from tisoft.elements import spring, tensor, tet4
from tisoft.geometry.topology import morton_order
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
    tet_order: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    tets: Ints = field(default_factory=lambda: np.empty((0, 4), np.int32))
    """Nodes of each tet (counted from `start`), shape (tets, 4)."""
    tet_rest: Floats = field(default_factory=lambda: np.empty((0, 10)))
    """Rest numbers of each tet (`elements.tet4`)."""
    springs: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 2), np.int64))
    """Nodes of each spring, in the order of `Body.springs`."""
    spring_numbers: Floats = field(default_factory=lambda: np.empty((0, 3)))
    """k [N/m], L₀ [m], c [N·s/m] of each spring."""
    place: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    """Batch · lanes + lane of each of its cells in its block."""
    shift: Floats = field(default_factory=lambda: np.zeros(3))
    _known_frequencies: dict[tuple[float, float], Floats] = field(default_factory=dict)
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

    @property
    def gradient(self) -> Floats:
        """∇N_1..3 of each tet [1/m], shape (tets, 3, 3)."""
        return self.tet_rest[:, :9].reshape(-1, 3, 3)

    @property
    def volume(self) -> Floats:
        """Of each tet [m³], shape (tets,)."""
        return self.tet_rest[:, 9]

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
    def element(self) -> Any:
        """Class of its elements."""
        if self.is_springs:
            return spring.Spring
        return tensor.Tensor if self.is_tensor else tet4.Tet4

    @property
    def law(self) -> Any:
        """Class of its law; None for elements that need none."""
        return None if self.is_springs or self.is_tensor else self.solid_law

    @property
    def solid_law(self) -> Any:
        """Class of the law that its tets obey, mass-tensors' too; None for springs."""
        return None if self.kind is None else laws.law(self.kind[0])

    def material(self) -> list[float]:
        """The row m of its block: constants of the law [Pa], φ and η [Pa·s]."""
        model = self.body.model
        if not isinstance(model, SolidModel) or self.is_tensor:
            return [0.0, 0.0]
        constants = self.law.constants(model.lame_lambda, model.lame_mu)
        return [*constants, model.phi, model.eta]

    def is_viscous(self) -> bool:
        """Whether it damps the rate of its strain or of its springs."""
        model = self.body.model
        if isinstance(model, SolidModel):
            return bool(model.phi or model.eta)
        return bool(self.spring_numbers[:, 2].any())

    def cells(self) -> tuple[NDArray[np.integer], Floats]:
        """Nodes of its elements (from `start`) and their rest numbers, in internal order."""
        model = self.body.model
        if self.is_springs:
            return self.springs, spring.Spring.rest(self.rest, self.springs, self.spring_numbers)
        if not self.is_tensor:
            return self.tets, self.tet_rest
        assert isinstance(model, SolidModel)
        pairs = ((model.lame_lambda, model.lame_mu), (model.phi, model.eta))
        sums = [tensor.edge_sums(self.tets, tensor.tensor_blocks(self.tet_rest, *p)) for p in pairs]
        return sums[0][0], np.concatenate([sums[0][1], sums[1][1]], axis=1)

    def frequencies(self) -> tuple[Floats, Floats, Floats]:
        """ω² [1/s²] and damping rate 2ζω [1/s] of each tet's stiffest mode at rest, with its own
        lumped mass (consistent: a fifth of that but for its translation), and 4γ/ρ [1/(kg/m)].
        """
        model, rest = self.body.model, self.tet_rest
        assert isinstance(model, SolidModel)
        scale = (20.0 if self.is_consistent else 4.0) / model.density
        omega2 = scale * self._stiffest(model.lame_lambda, model.lame_mu)
        rate = np.zeros(len(rest))
        if self.is_viscous():
            rate = scale * self._stiffest(model.phi, model.eta)
        return omega2, rate, scale * self._spread

    def _stiffest(self, lam: float, mu: float) -> Floats:
        """`Tet4.frequency`, which is proportional to its constants: found once for each ratio."""
        unit = (lam / mu, 1.0) if mu > 0.0 else (1.0, 0.0)
        key = round(unit[0], 12), unit[1]
        if key not in self._known_frequencies:
            self._known_frequencies[key] = tet4.Tet4.frequency(self.tet_rest, *unit)
        return (mu if mu > 0.0 else lam) * self._known_frequencies[key]

    @cached_property
    def _spread(self) -> Floats:
        return tet4.Tet4.spread_square(self.tet_rest)

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
            self.weigh()

    @cached_property
    def kind_of_body(self) -> type:
        """Class of the model that the arrays were built for."""
        return type(self.body.model)

    def weigh(self) -> None:
        """Lumped masses of its tets."""
        model = self.body.model
        assert isinstance(model, SolidModel)
        corners = tet4.Tet4.masses(self.tet_rest, model.density)
        mass = np.bincount(self.tets.ravel(), corners.ravel(), minlength=len(self.order))
        self.mass = mass.astype(np.float64)


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
            _number_tets(part)
        _check_mass(part)
        parts.append(part)
        start += len(order)
    return parts


def spring_numbers(net: Network) -> Floats:
    """k [N/m], L₀ [m], c [N·s/m] of each spring, shape (springs, 3)."""
    damping = np.full(len(net.ends), net.damping)
    return np.stack([net.stiffness, net.lengths, damping], axis=1)


def _number_tets(part: Part) -> None:
    mesh, model = part.body.mesh, part.body.model
    centroids = mesh.points[mesh.tets].mean(axis=1)
    part.tet_order = morton_order(centroids)
    tets = mesh.tets[part.tet_order]
    part.tets = part.rank[tets].astype(np.int32)
    part.tet_rest = tet4.Tet4.rest(mesh.points - part.center, tets)
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
