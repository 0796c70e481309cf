"""A body as contact sees it: its surface, how thick it is, whether it touches itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.model.part import Part
from tisoft.touch.keeping import kept_distance, touches_itself
from tisoft.touch.surface import Surface, surface_of

Floats = NDArray[np.float64]

THICKNESS = {True: 0.05, False: 0.1}
"""Of a body's median edge, by whether it is solid (else a sheet)."""
FOLDED = 0.5
"""Cosine of the angle to its mean normal up to which a sheet has not begun to fold."""


@dataclass(frozen=True, eq=False)
class Toucher:
    """A body as contact sees it."""

    part: Part
    surface: Surface
    thickness: float
    """[m]"""
    friction: float
    self_contact: bool
    meets_others: bool
    """Whether it touches other bodies; else obstacles alone."""

    @property
    def name(self) -> str:
        """The body's."""
        return self.part.body.name

    def may_fold(self, world: Floats) -> bool:
        """Whether it may touch itself soon.  A sheet that nobody has said to touch itself has not
        begun to fold while all its normals look to one side.

        Args:
            world: positions of all nodes [m], inside order.
        """
        if self.part.body.self_contact or not self.self_contact:
            return self.self_contact
        a, b, c = world[self.part.nodes][self.surface.points][self.surface.triangles.T]
        normal = np.cross(b - a, c - a)
        along = normal @ normal.sum(axis=0)
        size = np.linalg.norm(normal, axis=1) * np.linalg.norm(normal.sum(axis=0))
        return bool((along < FOLDED * size).any())


def any_touch(bodies: Sequence[Any]) -> bool:
    """Whether some of the bodies may touch each other, or one itself."""
    touching = [body for body in bodies if body.contact]
    return len(touching) > 1 or any(map(touches_itself, touching))


def toucher_of(part: Part) -> Toucher | None:
    """The body, or None where it has no surface."""
    body = part.body
    triangles = part.rank[np.asarray(body.mesh.surface)]
    if not len(triangles):
        return None
    surface = surface_of(triangles, part.rest, float(part.volume.sum()))
    own = body.contact and touches_itself(body)
    thickness = THICKNESS[surface.is_solid] * surface.edge
    if body.thickness is not None:
        thickness = kept_distance(body, surface.edge)
    return Toucher(part, surface, thickness, body.friction, own, body.contact)
