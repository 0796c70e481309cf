"""Whether the numbers of a scene fit into the floats it is computed in."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from tisoft.checks import FieldError
from tisoft.model.part import Part
from tisoft.model.system import System
from tisoft.scene import Plane, Scene

Numbers = NDArray[np.float64] | list[float]

ROOM = {"f32": 1e30, "f64": 1e150}
"""Sizes above this are refused, and its inverse is the least that masses and lengths may have:
products of two or three numbers must stay in range too."""


def check_range(system: System, scene: Scene) -> None:
    """Raise FieldError at the first quantity that leaves the range of the scene's floats."""
    check_parts(system)
    check_scene(scene, system.precision)


def check_parts(system: System) -> None:
    """The same of the bodies."""
    room = ROOM[system.precision]
    for part in system.parts:
        for what, unit, values, least in _of_part(part):
            _check(f"body[{part.index}]", what, unit, values, least / room, room)
        speeds = [*part.body.velocity, *part.body.spin]
        _check(f"body[{part.index}]", "initial speed", "m/s", speeds, 0.0, room)


def check_scene(scene: Scene, precision: str) -> None:
    """The same of gravity and obstacles."""
    room = ROOM[precision]
    for row in np.atleast_2d(np.asarray(scene.gravity)):
        _check("gravity", "component", "m/s²", row[-3:], 0.0, room)
    for i, obstacle in enumerate(scene.obstacles):
        box = (np.array(obstacle.point),) if isinstance(obstacle, Plane) else obstacle.bounds()
        _check(f"obstacle[{i}]", "position", "m", np.concatenate(box), 0.0, room)


def check_bound(bound: float, system: System) -> None:
    """Raise FieldError where the bound on the step at rest [s] has left the range of floats."""
    if not bound > 0.0:
        problem = (
            f"is too stiff for its mass: its stable step is below what {system.precision} can "
            'tell; use precision = "f64", a smaller young, or a larger density'
        )
        raise FieldError("body", problem)


def _of_part(part: Part) -> Iterator[tuple[str, str, Numbers, float]]:
    """Quantities with their units, and 1 where they must not vanish."""
    yield "position", "m", part.body.mesh.points.ravel(), 0.0
    yield "mass of a node", "kg", part.mass, 1.0
    model = part.body.model
    if part.solids:
        for cells in part.solids:
            slopes = np.linalg.norm(cells.gradients, axis=3).max(axis=2)
            yield f"size of a {cells.element.word}", "m", 1.0 / slopes.ravel(), 1.0
            yield f"volume of a {cells.element.word}", "m³", cells.volume, 1.0
            yield "Lamé constant", "Pa", list(cells.elastic), 0.0
            yield "viscosity", "Pa·s", list(cells.viscous), 0.0
    elif len(part.springs):
        yield "stiffness of a spring", "N/m", part.spring_numbers[:, 0], 0.0
        yield "length of a spring", "m", part.spring_numbers[:, 1], 1.0
        yield "damping of a spring", "N·s/m", part.spring_numbers[:, 2], 0.0
    yield "point damping", "1/s", [model.point_damping], 0.0


def _check(field: str, what: str, unit: str, values: Numbers, least: float, most: float) -> None:
    sizes = np.abs(np.asarray(values, dtype=np.float64))
    wrong = np.flatnonzero(~((sizes >= least) & (sizes <= most)))
    if len(wrong):
        precision = "f32" if most == ROOM["f32"] else "f64"
        remedy = 'precision = "f64" or ' if precision == "f32" else ""
        raise FieldError(
            field,
            f"has a {what} of {sizes[wrong[0]]:.3g} {unit}, beyond what {precision} computes with; "
            f"use {remedy}numbers nearer to 1",
        )
