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

from tisoft.body import Body
from tisoft.errors import SceneError
from tisoft.measures.elements import SpringMeasures
from tisoft.model.network import node_volumes, triangle_areas
from tisoft.model.part import Part
from tisoft.models.materials import MassSpring
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
    u = sim.system.u.astype(np.float64)
    values = np.zeros(sim.system.count)
    for part, body in zip(sim.parts, sim.scene.bodies, strict=True):
        values[part.nodes] = _of_body(sim, part, body, name == "stress", u[part.nodes])
    return values


def _of_body(sim: Simulation, part: Part, body: Body, stress: bool, u: Floats) -> Floats:
    """Stress [Pa] or strain [%] at one body's nodes, in the mesh's order."""
    if part.is_springs and stress:
        values = np.empty(len(part.order))
        values[part.order] = mises(virial_stress(part, u))
        return values
    if part.is_springs:
        told = sim.measures.elements(body)
        assert isinstance(told, SpringMeasures)
        each = 100.0 * np.abs(told.strain)
    elif stress:
        each = sim.measures.of_cells(body, "von_mises")
    else:
        each = 100.0 * mises(sim.measures.of_cells(body, "strain")) * 2.0 / 3.0
    return sim.measures.nodal(body, each)


def mises(tensors: Floats) -> Floats:
    """Equivalents √(3/2 s:s) of the deviators s, shape (n,)."""
    mean = np.trace(tensors, axis1=1, axis2=2)[:, None, None] / 3.0
    deviator = tensors - mean * np.eye(3)
    equivalent: Floats = np.sqrt(1.5 * np.einsum("eij,eij->e", deviator, deviator))
    return equivalent


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
    if mesh.elements:
        return node_volumes(mesh)[part.order]
    if body.model.thickness is None or not len(mesh.surface):
        raise SceneError(
            f'the springs of "{body.name}" have no volume, so no stress; '
            "colour by strain, speed or body"
        )
    thirds = body.model.thickness * triangle_areas(mesh.points, mesh.surface) / 3.0
    volumes = np.bincount(mesh.surface.ravel(), np.repeat(thirds, 3), minlength=count)
    return np.asarray(volumes[part.order], np.float64)
