"""Doubts: why the errors of a survey may not be what decides, a sentence each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tisoft.charting.rulers import OWN_SPRINGS
from tisoft.gravity import strongest
from tisoft.where import Nodes

if TYPE_CHECKING:
    from tisoft.charting.survey import Survey
    from tisoft.scene import Scene

RANGE = 0.6
"""The largest error of linear tets that the ruler was tried on."""
CONTACT = (
    "obstacles or other bodies may be met: sag and frequencies are those of bodies that meet "
    "nothing, and contact may decide more"
)
ITSELF = (
    "the springs stand for nothing but themselves (of N/m, of kg a node, or held by numbers of "
    "nodes), so no mesh is compared; what the step errs by along the path is"
)
PATHS_ALONE = (
    "nothing at rest tells of errors: paths alone are compared, with the finest that was run"
)
UNSETTLED = (
    " does not settle as the mesh gets finer (folds, or a border that moves with the cells), and "
    "its bar is as wide as it jumps"
)
NOT_RUN = (
    "no path was run for lack of time: what the step errs by is that of the first modes alone, "
    "and the springs may fall slack or swing far; chart the scene"
)
BY_NUMBERS = (
    "pins or loads select several nodes by number: on finer meshes they act on those nodes alone, "
    "so the errors of meshes are not to be trusted; select by box or plane"
)


def doubts(survey: Survey) -> list[str]:
    """What makes the answers of a survey uncertain."""
    found = []
    if survey.touching and survey.judging.rulers:
        found.append(CONTACT)
    if by_numbers(survey.scene):
        found.append(BY_NUMBERS)
    if survey.catalogue.springs and not survey.catalogue.has_solid_twin:
        if not survey.catalogue.is_itself:
            found.append(OWN_SPRINGS)
        if not survey.judging.rulers and survey.judging.travel.reference is None:
            found.append(NOT_RUN)
    for told in survey.warnings:
        words = ("sag is left out", "frequency is left out", PATHS_ALONE)
        if (told.startswith(words) and pushed(survey.scene)) or UNSETTLED in told:
            found.append(told)
    alike = survey.judging.on_one_mesh
    errors = survey.judging.errors_at_rest(survey.catalogue.current)
    worst = max((e.value for what, e in errors.items() if alike.get(what)), default=0.0)
    if worst > RANGE:
        found.append(
            f"the scene as it is errs by {100 * worst:.0f} %, and the estimate was "
            f"measured up to {100 * RANGE:.0f} %; ask again with a finer mesh"
        )
    parted = survey.judging.parted(survey.scene.frame_rate)
    if parted is not None:
        found.append(
            f"the two finest paths part after {parted:.3g} s: what comes later is chance, and no "
            "mesh errs by less"
        )
    return found


def pushed(scene: Scene) -> bool:
    """Whether there is any load: a body that nothing pushes has no sag to miss."""
    return any(body.loads for body in scene.bodies) or strongest(scene.gravity) > 0.0


def may_meet(scene: Scene, most: float | None) -> bool:
    """Whether there is an obstacle, or two bodies that touch each other come near, swinging about
    an equilibrium that lies so far from rest [m]; None where there is none.
    """
    return bool(scene.obstacles) or _bodies_meet(scene, most)


def surfaces_touch(scene: Scene, most: float | None) -> bool:
    """Whether contact of surfaces is compiled: of sheets with themselves, of faces with what is
    small, of bodies."""
    from tisoft.touch.keeping import touches_itself
    from tisoft.touch.meetings import stands

    folded = any(touches_itself(body) for body in scene.bodies)
    small = any(stands(obstacle) for obstacle in scene.obstacles)
    return folded or small or _bodies_meet(scene, most)


def _bodies_meet(scene: Scene, most: float | None) -> bool:
    room = np.inf if most is None else 2.0 * most
    boxes = [
        (b.mesh.points.min(axis=0) - room, b.mesh.points.max(axis=0) + room)
        for b in scene.bodies if b.contact
    ]  # fmt: skip
    return any(
        bool((low <= other_high).all() and (other_low <= high).all())
        for k, (low, high) in enumerate(boxes) for other_low, other_high in boxes[k + 1 :]
    )  # fmt: skip


def by_numbers(scene: Scene) -> bool:
    """Whether pins or loads of cells select several nodes by their numbers."""
    chosen: list[Any] = [
        where
        for body in scene.bodies
        if body.mesh.elements
        for where in ([pin.where for pin in body.pins] + [load.where for load in body.loads])
    ]
    return any(isinstance(where, Nodes) and len(where.ids) > 1 for where in chosen)
