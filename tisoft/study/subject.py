"""What is studied: the body of a scene that sets its stable step, alone and in f64."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.body import Body
from tisoft.equilibrium.damping import damped_body
from tisoft.errors import SceneError
from tisoft.geometry.mesh import Mesh, TetMesh
from tisoft.geometry.shapes import box
from tisoft.model.network import network, triangle_areas
from tisoft.model.part import Part, parts_of
from tisoft.model.system import System
from tisoft.models.materials import Linear, MassSpring, NeoHookean, SolidModel, ViscoElastic
from tisoft.scene import Scene
from tisoft.stable.sharp import sharp_step

Floats = NDArray[np.float64]

MODEST = 6_000
"""Tets up to which studies of a material's behaviour use the scene's own mesh."""
LEAST_RATIO = 1 / 30
"""Smallest edge over size below which runs over the body's own time would take too long."""
STAND_IN = 1500
"""Tets of the block that stands in otherwise, about."""

FLAT = 0.02
"""Share of the largest extent below which a body is flat."""

NAMES = {
    "viscoelastic": "St. Venant-Kirchhoff",
    "neo-hookean": "neo-Hookean",
    "linear": "linear FEM",
    "mass-spring": "springs",
}
"""The models that are compared, and how pictures call them."""


@dataclass(frozen=True)
class Material:
    """An isotropic solid, exactly the body's, or what its springs stand for."""

    young: float
    poisson: float
    density: float


class Subject:
    """The body of `scene` with the smallest stable step.

    Raises:
        SceneError: where there is no body, or nothing in it that oscillates.
    """

    def __init__(self, scene: Scene) -> None:
        if not scene.bodies:
            raise SceneError("the scene has no body, so there is nothing that could fail; add one")
        runtime.start()
        # Damping ratios become viscosity here, once, for all that the study computes.
        scene = dataclasses.replace(scene, bodies=[damped_body(body) for body in scene.bodies])
        self.scene = scene
        name = scene.integrator
        self.integrator_name = "symplectic-euler" if name == "explicit-euler" else name
        steps = [
            sharp_step(System([b], "f64"), integrator=self.integrator_name) for b in scene.bodies
        ]
        self.body: Body = scene.bodies[int(np.argmin(steps))]
        self.limit = min(steps)
        """The stable step of the scene [s], damping included."""
        if not np.isfinite(self.limit):
            raise SceneError(
                f"nothing in {self.body.name!r} resists motion, so it has no stable step; "
                "give it tets or springs"
            )

    @property
    def is_springs(self) -> bool:
        """Whether the body is a network of springs."""
        return isinstance(self.body.model, MassSpring)

    @property
    def is_explicit(self) -> bool:
        """Whether the scene asks for explicit Euler, which no step makes stable."""
        return self.integrator_name != self.scene.integrator

    @cached_property
    def size(self) -> Floats:
        """Extents of the body [m], shape (3,); those of a cube where it is flat or straight."""
        extent = np.ptp(self.body.mesh.points, axis=0)
        largest = float(extent.max())
        return extent if extent.min() > FLAT * largest else np.full(3, largest)

    @cached_property
    def material(self) -> Material:
        """The body's; for springs Young's modulus that their stiffnesses stand for, and ν = 1/4."""
        model = self.body.model
        if isinstance(model, SolidModel):
            return Material(model.young, model.poisson, model.density)
        net = network(self.body)
        volume = self.volume
        young = model.young or float((net.stiffness * net.lengths**2).sum() / (6.0 * volume))
        return Material(young, 0.25, model.density or float(net.masses.sum() / volume))

    @cached_property
    def volume(self) -> float:
        """Of the tets, else of the box around the body [m³]; sheets have a thickness."""
        mesh, model = self.body.mesh, self.body.model
        if isinstance(mesh, TetMesh):
            return float(mesh.volumes.sum())
        if isinstance(model, MassSpring) and model.thickness and len(mesh.surface):
            return model.thickness * float(triangle_areas(mesh.points, mesh.surface).sum())
        return float(self.size.prod())

    def model(self, name: str, **changes: Any) -> SolidModel | MassSpring:
        """One of NAMES with the body's material, undamped; further parameters by name."""
        m = self.material
        if name == "mass-spring":
            return MassSpring(m.young, m.density, **changes)
        kinds = {"viscoelastic": ViscoElastic, "neo-hookean": NeoHookean, "linear": Linear}
        values = dataclasses.asdict(m) | changes
        return kinds[name](**values)

    @cached_property
    def solid(self) -> TetMesh:
        """Tets to measure a material's behaviour on: the body's, or a block of its size."""
        mesh = self.body.mesh
        if isinstance(mesh, TetMesh) and self.has_modest_mesh:
            return mesh
        edge = (5.0 * float(self.size.prod()) / STAND_IN) ** (1.0 / 3.0)
        return box(tuple(self.size), tuple(max(2, round(s / edge)) for s in self.size))

    @cached_property
    def has_modest_mesh(self) -> bool:
        """Whether the body's own tets serve for runs of many substeps."""
        mesh = self.body.mesh
        if not isinstance(mesh, TetMesh) or len(mesh.tets) > MODEST:
            return False
        a, b = mesh.points[mesh.edges.T]
        shortest = float(np.linalg.norm(b - a, axis=1).min())
        return shortest > LEAST_RATIO * float(self.size.min())

    @property
    def solid_name(self) -> str:
        """What `solid` is, in words."""
        if self.solid is self.body.mesh:
            return f"the mesh of {self.body.name!r}"
        shape = "cube" if np.ptp(self.size) == 0.0 else "block"
        return f"a {shape} of {len(self.solid.tets)} tets as large as {self.body.name!r}"


def alone(body: Body) -> Scene:
    """A scene in f64 with only this body, at rest, without gravity, loads or moving pins."""
    scene = Scene(gravity=(0.0, 0.0, 0.0), precision="f64")
    copy = scene.add_body(body.mesh, body.model, body.name)
    copy.regions = list(body.regions)
    for pin in body.pins:
        if pin.release is None:
            copy.pin(pin.where, pin.axes)
    return scene


def with_model(mesh: Mesh, model: SolidModel | MassSpring, name: str = "body") -> Part:
    """A free body of a mesh and a model, numbered as the operators take it."""
    return parts_of([Body(name, mesh, model)])[0]
