"""One body's share of a scene's arrays: its numbering, masses and elements, inside order.

World positions are rest point + origin shift of the body + u.  Inside, nodes and tets follow Morton
curves; `order` leads back to the mesh's own order.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tisoft.body import Body
from tisoft.checks import FieldError
from tisoft.geometry.topology import morton_order
from tisoft.models import laws
from tisoft.models.mass_spring import Network, network
from tisoft.models.materials import Linear, MassSpring, MassTensor, NeoHookean, SolidModel
from tisoft.models.tets import gradients, lumped_masses

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


def law_of(model: SolidModel) -> int:
    """The stress law of a model with tets."""
    if isinstance(model, NeoHookean):
        return laws.NEO_HOOKEAN
    if isinstance(model, MassTensor):
        return laws.TENSOR
    return laws.LINEAR if isinstance(model, Linear) else laws.ST_VENANT


@dataclass
class Part:
    """One body's share of the arrays."""

    body: Body
    index: int
    start: int
    """First node; `order` says which row of `mesh.points` each node is."""
    order: NDArray[np.int64]
    center: Floats
    """Middle of the rest points [m], shape (3,): rest positions inside are relative to it."""
    mass: Floats
    """Lumped masses [kg] by inside order, shape (nodes,)."""
    tet_order: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    tets: Ints = field(default_factory=lambda: np.empty((0, 4), np.int32))
    """Inside nodes of each tet, in Morton order, shape (tets, 4)."""
    gradient: Floats = field(default_factory=lambda: np.empty((0, 3, 3)))
    volume: Floats = field(default_factory=lambda: np.empty(0))
    place: Ints = field(default_factory=lambda: np.empty(0, np.int32))
    """Batch · lanes + lane of each tet of `tets`."""
    springs: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 2), np.int64))
    """Inside nodes of each spring, in the order of `Body.springs`."""
    spring_numbers: Floats = field(default_factory=lambda: np.empty((0, 3)))
    """k [N/m], L₀ [m], c [N·s/m] of each spring."""
    shift: Floats = field(default_factory=lambda: np.zeros(3))
    kind: tuple[int, str] | None = None
    """Law and mass that the arrays were built for; None for springs."""

    @cached_property
    def size(self) -> float:
        """Largest extent of the rest shape [m]; 1 for a single node."""
        return float(np.ptp(self.body.mesh.points, axis=0).max()) or 1.0

    @property
    def nodes(self) -> slice:
        """Its rows of the nodal arrays."""
        return slice(self.start, self.start + len(self.order))

    @cached_property
    def rank(self) -> NDArray[np.int64]:
        """Inside row (from `start`) of each row of `mesh.points`."""
        rank = np.empty(len(self.order), np.int64)
        rank[self.order] = np.arange(len(self.order))
        return rank

    @property
    def is_springs(self) -> bool:
        """Whether its forces are springs'."""
        return isinstance(self.body.model, MassSpring)

    @property
    def is_consistent(self) -> bool:
        """Whether its mass is the consistent matrix."""
        model = self.body.model
        return isinstance(model, SolidModel) and model.mass == "consistent"

    @property
    def is_tensor(self) -> bool:
        """Whether its forces are mass-tensor rows."""
        return isinstance(self.body.model, MassTensor)


def parts_of(bodies: list[Body]) -> list[Part]:
    """Number the bodies' nodes, tets and springs."""
    parts = []
    start = 0
    for index, body in enumerate(bodies):
        points = body.mesh.points
        order = morton_order(points)
        center = 0.5 * (points.min(axis=0) + points.max(axis=0))
        part = Part(body, index, start, order, center, np.empty(0))
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
    part.tets = part.rank[mesh.tets[part.tet_order]].astype(np.int32)
    part.gradient, part.volume = gradients(mesh.points - part.center, mesh.tets[part.tet_order])
    assert isinstance(model, SolidModel)
    part.kind = (law_of(model), model.mass)
    weigh_tets(part)


def weigh_tets(part: Part) -> None:
    model = part.body.model
    assert isinstance(model, SolidModel)
    part.mass = lumped_masses(part.tets, part.volume, model.density, len(part.order))


def check_kind(part: Part) -> None:
    """A running simulation takes over numbers of a model, not another law, mass or network."""
    model = part.body.model
    if part.kind is None:
        same = part.is_springs and np.array_equal(part.rank[part.body.springs()], part.springs)
    else:
        same = isinstance(model, SolidModel) and part.kind == (law_of(model), model.mass)
    if not same:
        problem = (
            "cannot become another kind of model, mass or network while it runs; "
            "make a new Simulation and set_state"
        )
        raise FieldError(f"body[{part.index}].model", problem, type(model).__name__)


def _check_mass(part: Part) -> None:
    empty = np.flatnonzero(part.mass <= 0.0)
    if len(empty):
        node = int(part.body.mesh.kept_nodes[part.order[empty[0]]])
        raise FieldError(
            f"body[{part.index}].density",
            f"gives node {node} of {part.body.name!r} no mass (no tet or triangle uses it); "
            "give node_mass in kg",
        )
