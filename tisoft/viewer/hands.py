"""What viewers hold: bodies by a point, pins and obstacles whole; each viewer one thing."""

from __future__ import annotations

from typing import Any

import numpy as np

from tisoft.errors import SceneError
from tisoft.scene import Scene
from tisoft.simulation import Simulation
from tisoft.viewer.carrying import Carried, CarriedObstacle, CarriedPin, pin_near
from tisoft.viewer.drawn import Drawn
from tisoft.viewer.picking import patch

NEAREST = 8
"""Nodes about the grabbed point of which a pin that is carried holds one."""


class Hands:
    """Viewers' hands in a running scene, whose surface the viewers see as `drawn`.

    Raises (whatever takes hold): SceneError for what no hand can hold.
    """

    def __init__(self, sim: Simulation, drawn: Drawn) -> None:
        self.sim, self.drawn = sim, drawn
        self.held: dict[Any, Any] = {}
        """By viewer: a `Grab` or `Carried`."""
        self.drag = 0
        """Number of the last drag that the state has felt."""

    @property
    def scene(self) -> Scene:
        """The scene that runs."""
        return self.sim.scene

    def grab(
        self, viewer: Any, rows: list[int], weights: list[float], point: list[float], number: int
    ) -> None:
        """Take Σ w x of drawn rows in a viewer's hand; its point is to be at `point` [m]."""
        self.drop(viewer)
        shown, nodes, shares = self._patch(rows, weights)
        self._keep(viewer, self.sim.grab(shown.body, nodes, shares, point), number)

    def _patch(self, rows: list[int], weights: list[float]) -> tuple[Any, Any, Any]:
        """What these drawn rows belong to, and the nodes about Σ w x with their weights."""
        held = np.array(rows)
        shown = self.drawn.owner(held)
        if shown is None:
            raise SceneError("a hand holds one body; these rows are of none, or of several")
        at_rest = shown.rest_point(held, np.array(weights))
        mass = self.sim.masses()[self.sim.part(shown.body).nodes]
        return shown, *patch(shown.body.mesh.points, mass, at_rest)

    def carry_pin(
        self, viewer: Any, rows: list[int], weights: list[float], point: list[float], number: int
    ) -> None:
        """Take the pin that holds the body there; where none does, the body itself."""
        shown, nodes, _ = self._patch(rows, weights)
        found = pin_near(shown.body, nodes[:NEAREST], self.sim.time)
        if found is None:
            self.grab(viewer, rows, weights, point, number)
            return
        self.drop(viewer)
        self._keep(viewer, CarriedPin(shown.body, found, point, self.sim.time), number)

    def carry_obstacle(self, viewer: Any, obstacle: int, point: list[float], number: int) -> None:
        """Take an obstacle in a viewer's hand."""
        self.drop(viewer)
        if obstacle >= len(self.scene.obstacles):
            raise SceneError(f"there is no obstacle {obstacle}")
        self._keep(viewer, CarriedObstacle(self.scene, obstacle, point, self.sim.time), number)

    def _keep(self, viewer: Any, hand: Any, number: int) -> None:
        self.held[viewer], self.drag = hand, number

    def move(self, viewer: Any, point: list[float], number: int) -> None:
        """Bring a viewer's hand to a point [m]."""
        if viewer in self.held:
            self.held[viewer].target = point
            self.drag = number

    def drop(self, viewer: Any) -> None:
        """Let go of what a viewer holds."""
        hand = self.held.pop(viewer, None)
        if hand is not None:
            hand.release()

    def drop_all(self) -> None:
        """Let go of everything."""
        for viewer in list(self.held):
            self.drop(viewer)

    def lead(self) -> None:
        """Lead what is carried through the coming frame."""
        for hand in self.held.values():
            if isinstance(hand, Carried):
                hand.advance(self.sim.time, 1.0 / self.scene.frame_rate)

    def told(self) -> dict[str, Any]:
        """Force of all hands [N] and names of what is carried, for JSON."""
        pull = [float(np.linalg.norm(hand.force)) for hand in self.held.values()]
        carried = [hand.name for hand in self.held.values() if isinstance(hand, Carried)]
        return {"pull": sum(pull) if pull else None, "carries": carried}
