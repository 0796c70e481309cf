"""What a scene may surprise its user with, as sentences."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.body import Body
from tisoft.check.cages import cage_warnings, pin_warnings
from tisoft.check.contact import folding, keeping
from tisoft.check.meshes import mesh_warnings
from tisoft.gaps import gap_warnings
from tisoft.geometry.mesh import TetMesh
from tisoft.gravity import mainly, strongest
from tisoft.model.network import triangle_areas
from tisoft.models.materials import NeoHookean, SolidModel, ViscoElastic
from tisoft.scene import Obstacle, Plane, Scene, Shell

Floats = NDArray[np.float64]

LOCKING = 0.45
"""Poisson's ratio above which linear tets are much too stiff."""
SOFTENING = 0.3
"""Compression at which St. Venant-Kirchhoff has lost a third of its stiffness."""
BENDING = {1: "several times", 2: "33 to 49 %", 3: "15 to 25 %", 4: "about 11 %"}
"""How much too stiff linear tets bend, by elements through the thickness."""


def first_warnings(scene: Scene) -> list[str]:
    """What is told before anything is computed: meshes, and obstacles that fit between nodes."""
    return [*mesh_warnings(scene), *gap_warnings(scene)]


def warnings_of(scene: Scene) -> list[str]:
    """Sentences, none where nothing is to be said; of meshes first."""
    found = [*mesh_warnings(scene), *gap_warnings(scene), *_of_scene(scene)]
    for body in scene.bodies:
        found += _of_body(body, scene)
    return found


def _of_scene(scene: Scene) -> Iterator[str]:
    touching = [body for body in scene.bodies if body.contact]
    if len(touching) > 1 and scene.integrator == "explicit-euler":
        yield "with explicit-euler bodies pass through each other: take symplectic-euler"
    elif runtime.on_device():
        from tisoft.touch.toucher import any_touch  # needs Taichi, which not every command starts

        if any_touch(scene.bodies):
            yield "on a GPU bodies pass through each other and themselves: take --arch cpu"
    faceless = [body.name for body in scene.bodies if not len(body.mesh.surface)]
    for number, obstacle in enumerate(scene.obstacles):
        if isinstance(obstacle, Shell) and scene.integrator == "explicit-euler":
            yield f"with explicit-euler bodies pass through obstacle[{number}], a surface file"
        elif isinstance(obstacle, Shell) and faceless:
            yield f'body "{faceless[0]}" has no faces and passes through obstacle[{number}]'
    if scene.integrator == "explicit-euler":
        yield "explicit Euler gains energy at any step: it is there to show how it fails"


def _of_body(body: Body, scene: Scene) -> Iterator[str]:
    name, model = f'body "{body.name}"', body.model
    if model.point_damping:
        strength = strongest(scene.gravity)
        fall = f": it falls at {strength / model.point_damping:.3g} m/s at the most"
        yield f"{name} has point damping, which brakes rigid motion too{fall if strength else ''}"
    if told := keeping(body):
        yield f"{name} {told}"
    if not isinstance(model, SolidModel):
        return
    if model.poisson > LOCKING and len(body.mesh.tets):
        yield (
            f"{name} has poisson = {model.poisson:g}: above {LOCKING} linear tets lock, "
            'so it is much too stiff; use 0.45 or less, or element = "tet10"'
        )
    yield from (f"{name} {told}" for told in (*cage_warnings(body), *pin_warnings(body)))
    if isinstance(body.mesh, TetMesh) and (told := _bending(body.mesh)):
        yield f"{name} {told}"
    if told := folding(body, scene):
        yield f"{name} {told}"
    if isinstance(model, ViscoElastic) and not isinstance(model, NeoHookean):
        squash = compression(body, scene)
        if squash > SOFTENING:
            yield (
                f"{name} will be compressed by about {100 * min(squash, 1.0):.0f} %, where "
                'St. Venant-Kirchhoff softens and may turn inside out; model = "neo-hookean" '
                "stands it, and so does a larger young"
            )


def compression(body: Body, scene: Scene) -> float:
    """Rough compression (1: to nothing) by its own weight and by landing on what is below."""
    model, points = body.model, body.mesh.points
    assert isinstance(model, SolidModel)
    gravity = mainly(scene.gravity)
    strength = float(np.linalg.norm(gravity))
    speed2 = float(np.dot(body.velocity, body.velocity))
    if strength and not body.pins:
        drops = [_drop(points, obstacle, gravity / strength) for obstacle in scene.obstacles]
        fall = min((drop for drop in drops if drop is not None), default=None)
        if fall is None:
            return 0.0
        speed2 += 2.0 * strength * fall
    elif body.pins or not scene.obstacles:
        return 0.0
    height = float(np.ptp(points @ gravity)) / strength if strength else 0.0
    weight = model.density * strength * height / model.young
    return weight + float(np.sqrt(model.density * speed2 / model.young))


def _drop(points: Floats, obstacle: Obstacle, down: Floats) -> float | None:
    """How far the body falls until it meets a plane [m]; None where it never does."""
    if not isinstance(obstacle, Plane):
        return None
    normal = np.array(obstacle.normal)
    slope = -float(normal @ down)
    if slope <= 0.05:
        return None
    gap = float(((points - np.array(obstacle.point)) @ normal).min())
    return max(gap, 0.0) / slope


def _bending(mesh: TetMesh) -> str | None:
    """A slender body of few elements through the thickness bends too stiffly."""
    area = float(triangle_areas(mesh.points, mesh.surface).sum())
    thickness = 4.0 * float(mesh.volumes.sum()) / area
    length = float(np.ptp(mesh.points - mesh.points.mean(axis=0), axis=0).max())
    if length < 3.0 * thickness:
        return None
    through = elements_through(mesh)
    if through not in BENDING:
        return None
    number = f"{through} element{'s' * (through > 1)}"
    return (
        f"has about {number} through its thickness: linear tets bend {BENDING[through]} too "
        "stiffly then; 8 leave 3 %"
    )


def elements_through(mesh: TetMesh) -> int:
    """Elements through the thickest part: twice the edges from there to the surface, at least 1."""
    near = np.zeros(len(mesh.points), dtype=bool)
    near[mesh.surface] = True
    depth = 0
    while not near.all():
        a, b = mesh.edges.T
        before = near.copy()
        near[a[before[b]]] = near[b[before[a]]] = True
        if (near == before).all():
            break
        depth += 1
    return max(1, 2 * depth)
