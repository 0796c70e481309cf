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
BY_NUMBERS = (
    "pins or loads select several nodes by number: on finer meshes they act on those nodes alone, "
    "so the errors of meshes are not to be trusted; select by box or plane"
)


def doubts(survey: Survey) -> list[str]:
    """What makes the answers of a survey uncertain."""
    found = []
    if survey.touching:
        found.append(CONTACT)
    if by_numbers(survey.scene):
        found.append(BY_NUMBERS)
    if survey.catalogue.springs and not survey.catalogue.has_solid_twin:
        found.append(OWN_SPRINGS)
    for told in survey.warnings:
        if told.startswith(("sag is left out", "frequency is left out")) and pushed(survey.scene):
            found.append(told)
    now = survey.judging.judge(survey.catalogue.current)
    if now is not None and now.worst.value > RANGE:
        found.append(
            f"the scene as it is errs by {100 * now.worst.value:.0f} %, and the estimate was "
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
    if scene.obstacles:
        return True
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
