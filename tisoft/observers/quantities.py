"""Quantities that surfaces are coloured by, one value per node, in the scene's order.

    stress   von Mises equivalent of the Cauchy stress [Pa], q = √(3/2 s:s), s its deviator
    strain   von Mises equivalent of Green's strain, √(2/3 e:e), e its deviator; springs: |l − L|/L
    speed    |v| [m/s]

Tets hold one value each; a node shows the mean of its tets by volume.  The stress of a network of
springs is the virial one of each node, σ = Σ ½ f ⊗ d / V.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.dynamics.system import Part, law_of
from tisoft.errors import SceneError
from tisoft.models import laws
from tisoft.models.mass_spring import triangle_areas
from tisoft.models.materials import MassSpring, SolidModel
from tisoft.models.tets import lumped_masses
from tisoft.simulation import Simulation

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Quantity:
    """A quantity's label and unit, as the colour bar shows them."""

    label: str
    unit: str


QUANTITIES = {
    "stress": Quantity("stress", "Pa"),
    "strain": Quantity("strain", "%"),
    "speed": Quantity("speed", "m/s"),
}


def node_values(sim: Simulation, name: str) -> Floats:
    """The quantity of this name at all nodes, shape (nodes,); strain in per cent.

    Raises:
        SceneError: the stress of springs that have no volume.
    """
    if name == "speed":
        speeds: Floats = np.linalg.norm(sim.velocities(), axis=1)
        return speeds
    of_part = _stress if name == "stress" else _strain
    u = np.array(runtime.read(sim.system.u), np.float64)
    values = np.zeros(sim.system.count)
    for part in sim.parts:
        values[part.nodes][part.order] = of_part(part, u[part.nodes])
    return values


def _stress(part: Part, u: Floats) -> Floats:
    if part.is_springs:
        return _mises(virial_stress(part, u))
    model = part.body.model
    assert isinstance(model, SolidModel)
    H = _displacement_gradient(part, u)
    return _to_nodes(part, _mises(cauchy_stress(law_of(model), H, model)))


def _strain(part: Part, u: Floats) -> Floats:
    if part.is_springs:
        length, rest = _lengths(part, u)
        return _mean_at_ends(part, 100.0 * np.abs(length - rest) / rest)
    H = _displacement_gradient(part, u)
    strain = 0.5 * (H + H.swapaxes(1, 2) + H.swapaxes(1, 2) @ H)
    return _to_nodes(part, 100.0 * _mises(strain) * 2.0 / 3.0)


def _displacement_gradient(part: Part, u: Floats) -> Floats:
    corners = u[part.tets]
    gradient: Floats = np.einsum("ecd,ecj->edj", corners[:, 1:] - corners[:, :1], part.gradient)
    return gradient


def cauchy_stress(law: int, H: Floats, model: SolidModel) -> Floats:
    """Elastic Cauchy stress [Pa] of displacement gradients H, both of shape (tets, 3, 3)."""
    lam, mu = laws.law_constants(law, model.lame_lambda, model.lame_mu)
    identity = np.eye(3)
    if law == laws.LINEAR:
        return _hooke(0.5 * (H + H.swapaxes(1, 2)), lam, mu)
    F = H + identity
    J = np.linalg.det(F)
    if law == laws.ST_VENANT:
        P = F @ _hooke(0.5 * (H + H.swapaxes(1, 2) + H.swapaxes(1, 2) @ H), lam, mu)
    else:
        a, b, c = (F[:, k] for k in range(3))
        cofactor = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
        pressure = lam * (J - 1.0) - 0.75 * mu
        inner = 1.0 - 1.0 / (np.einsum("eij,eij->e", F, F) + 1.0)
        P = mu * inner[:, None, None] * F + pressure[:, None, None] * cofactor
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.nan_to_num(P @ F.swapaxes(1, 2) / np.abs(J)[:, None, None])


def _hooke(strain: Floats, lam: float, mu: float) -> Floats:
    trace = np.trace(strain, axis1=1, axis2=2)[:, None, None]
    stress: Floats = lam * trace * np.eye(3) + 2.0 * mu * strain
    return stress


def _mises(tensors: Floats) -> Floats:
    """√(3/2 s:s) of the deviators s, shape (n,)."""
    mean = np.trace(tensors, axis1=1, axis2=2)[:, None, None] / 3.0
    deviator = tensors - mean * np.eye(3)
    equivalent: Floats = np.sqrt(1.5 * np.einsum("eij,eij->e", deviator, deviator))
    return equivalent


def _to_nodes(part: Part, values: Floats) -> Floats:
    """Means by volume of the tets' values, inside order, shape (nodes,)."""
    count = len(part.order)
    weight = np.bincount(part.tets.ravel(), np.repeat(part.volume, 4), minlength=count)
    total = np.bincount(part.tets.ravel(), np.repeat(part.volume * values, 4), minlength=count)
    return total / weight


def _lengths(part: Part, u: Floats) -> tuple[Floats, Floats]:
    points = (part.body.mesh.points - part.center)[part.order] + u
    ends = points[part.springs]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), part.spring_numbers[:, 1]


def _mean_at_ends(part: Part, values: Floats) -> Floats:
    count = len(part.order)
    number = np.bincount(part.springs.ravel(), minlength=count)
    total = np.bincount(part.springs.ravel(), np.repeat(values, 2), minlength=count)
    return total / np.maximum(number, 1)


def virial_stress(part: Part, u: Floats) -> Floats:
    """Stress [Pa] of the springs at each node for displacements u, shape (nodes, 3, 3)."""
    points = (part.body.mesh.points - part.center)[part.order] + u
    d = points[part.springs[:, 1]] - points[part.springs[:, 0]]
    length = np.linalg.norm(d, axis=1)
    stiffness, rest = part.spring_numbers[:, 0], part.spring_numbers[:, 1]
    pull = 0.5 * stiffness * (length - rest) / np.maximum(length, 1e-300)
    each = pull[:, None, None] * d[:, :, None] * d[:, None, :]
    total = np.zeros((len(part.order), 3, 3))
    np.add.at(total, part.springs.ravel(), np.repeat(each, 2, axis=0))
    return total / _node_volumes(part)[:, None, None]


def _node_volumes(part: Part) -> Floats:
    """Volume that each node stands for [m³], inside order."""
    body, mesh = part.body, part.body.mesh
    assert isinstance(body.model, MassSpring)
    count = len(mesh.points)
    if len(mesh.tets):
        corners = mesh.points[mesh.tets]
        volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0
        return lumped_masses(mesh.tets, volumes, 1.0, count)[part.order]
    if body.model.thickness is None or not len(mesh.surface):
        raise SceneError(
            f'the springs of "{body.name}" have no volume, so no stress; '
            "colour by strain, speed or body"
        )
    thirds = body.model.thickness * triangle_areas(mesh.points, mesh.surface) / 3.0
    volumes = np.bincount(mesh.surface.ravel(), np.repeat(thirds, 3), minlength=count)
    return np.asarray(volumes[part.order], np.float64)
