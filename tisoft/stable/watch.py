"""What a run tells besides results: tets turned inside out, linear models that turn.

A tet is inside out where J = det F ≤ 0: St. Venant-Kirchhoff bodies then rest in tangles, which no
step, however small, undoes.  A linear model is right for small rotations only: its deflections are
too large by the shares of LINEAR_ERROR (a cantilever of slender beam theory, tip angle against the
elastica of Bisshopp and Drucker 1945), and a spinning body grows by 1/cos of its apparent angle.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.model.system import System
from tisoft.models.materials import Linear, MassSpring, MassTensor, NeoHookean
from tisoft.stable.inside import Inside
from tisoft.stable.limit import StepLimit

TURN = 20.0
"""Degrees from which a linear model's error is told."""
SAMPLE = 96
"""Cells of a body, of each element, whose rotation is looked at."""
LINEAR_ERROR = np.array(
    [[0.0, 0.0], [7.12, 0.7], [14.01, 2.8], [26.43, 10.0], [44.79, 35.0], [56.49, 66.0]]
)
"""Tip angle [degrees] and error of the linear deflection [%]."""


class Watch:
    """Looks as often as the limit is looked at, and remembers the worst."""

    def __init__(self, system: System, limit: StepLimit) -> None:
        self.system = system
        self.limit = limit
        self.inside = Inside(system.parts)
        self.inverted = 0
        """Cells inside out now."""
        self._most_inverted, self._first_inverted = 0, 0.0
        self._turns: dict[int, tuple[float, float]] = {}
        self._blown: tuple[float, float] | None = None
        self._pushed: dict[tuple[str, str, float], tuple[float, float, int]] = {}
        self._stuck: dict[tuple[str, str], tuple[float, float]] = {}
        self._linear = []
        for part in system.parts:
            if isinstance(part.body.model, Linear | MassTensor):
                for cells in part.solids:
                    every = max(1, len(cells.nodes) // SAMPLE)
                    mean = cells.gradients[::every].mean(axis=1)
                    self._linear.append((part, cells.nodes[::every], mean))

    def state(self) -> dict[str, Any]:
        """What a checkpoint keeps."""
        turns = [[index, *worst] for index, worst in self._turns.items()]
        inverted = [self.inverted, self._most_inverted, self._first_inverted]
        worst = [[*key, *value] for key, value in self.inside.worst.items()]
        pushed = [[*key, *value] for key, value in self._pushed.items()]
        stuck = [[*key, *value] for key, value in self._stuck.items()]
        told = {"pushed": pushed, "stuck": stuck}
        return {"inverted": inverted, "turns": turns, "inside": worst} | told

    def set_state(self, state: dict[str, Any]) -> None:
        """Go on from what `state` told."""
        self.inverted, self._most_inverted, self._first_inverted = state["inverted"]
        self._turns = {index: (angle, time) for index, angle, time in state["turns"]}
        self._pushed = {(a, b, t): (d, s, n) for a, b, t, d, s, n in state.get("pushed", [])}
        self._stuck = {(a, b): (d, t) for a, b, d, t in state.get("stuck", [])}
        worst = state.get("inside", [])
        self.inside.worst = {(body, o): (depth, t, at) for body, o, depth, t, at in worst}

    def note_push(
        self, name: str, other: str, nodes: int, push: tuple[float, float, float]
    ) -> None:
        """Note that a body with so many nodes inside of another thing is pushed out of it: depth
        [m], since when and for how long [s].
        """
        depth, time, seconds = push
        known = self._pushed.get((name, other, time), (0.0, 0.0, 0))
        self._pushed[name, other, time] = (
            max(depth, known[0]), max(seconds, known[1]), max(nodes, known[2])
        )  # fmt: skip

    def note_stuck(self, name: str, other: str, deep: tuple[float, float]) -> None:
        """Note that a body is so deep [m] in another thing at a time [s] that nothing pushes it
        out.
        """
        self._stuck[name, other] = deep

    def blew_up(self, time: float, step: float) -> None:
        """Note that the state at `time` [s] is not finite, after a `step` [s] nobody watched."""
        self._blown = self._blown or (time, step)

    def look(self, time: float) -> None:
        """Look at the state at `time` [s]."""
        self.inverted = self.limit.inverted()
        if self.inverted > self._most_inverted:
            self._first_inverted = self._first_inverted if self._most_inverted else time
            self._most_inverted = self.inverted
        u = self.system.u.astype(np.float64) if self._linear else None
        for part, nodes, gradient in self._linear:
            assert u is not None
            angle = self._turn(u[part.nodes][nodes], gradient)
            if angle > max(TURN, self._turns.get(part.index, (0.0, 0.0))[0]):
                self._turns[part.index] = (angle, time)

    def _turn(self, u: NDArray[np.float64], gradient: NDArray[np.float64]) -> float:
        """Largest rotation of the sampled cells [degrees]: tan θ = 2 |axis of F| / (tr F − 1)."""
        H = np.einsum("tcd,tce->tde", u, gradient)
        skew = H - H.transpose(0, 2, 1)
        axis = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
        trace = np.einsum("tdd->t", H)
        return float(np.degrees(np.arctan2(np.linalg.norm(axis, axis=1), trace + 2.0)).max())

    def warnings(self) -> list[str]:
        """What happened, a sentence each."""
        told = self.pushed()
        if self._blown:
            time, step = self._blown
            told.append(
                f"the state is not finite from t = {time:.4g} s on: a body exploded at a step of "
                f"{step:.4g} s, which certify=False does not watch"
            )
        if self._most_inverted:
            known = all(
                isinstance(p.body.model, NeoHookean | MassSpring) for p in self.system.parts
            )
            remedy = "" if known else '; model = "neo-hookean" finds its way back'
            told.append(
                f"{self._most_inverted} elements were inside out at the worst, the first at "
                f"t = {self._first_inverted:.4g} s, and {self.inverted} are at the end{remedy}"
            )
        for part in self.system.parts:
            if part.index in self._turns:
                angle, time = self._turns[part.index]
                error = float(np.interp(angle, LINEAR_ERROR[:, 0], LINEAR_ERROR[:, 1]))
                least = "more than " if angle > LINEAR_ERROR[-1, 0] else ""
                told.append(
                    f'body "{part.body.name}" turned by {angle:.0f} degrees (t = {time:.4g} s), '
                    f"and its linear model is for small turns: deflections are then {least}"
                    f'{error:.0f} % too large; use model = "viscoelastic"'
                )
        return told + self.inside.warnings()

    def pushed(self) -> list[str]:
        """What began inside of something, a sentence each."""
        told = []
        for (name, other), (depth, time) in self._stuck.items():
            told.append(
                f'body "{name}" is {depth:.3g} m inside {other} at t = {time:.4g} s, or goes '
                "through it, where contact cannot push it out; move one of them"
            )
        for (name, other, time), (depth, seconds, nodes) in self._pushed.items():
            what = f"{nodes} nodes" if nodes else "faces"
            when = f"is at t = {time:.4g} s" if time else "starts"
            told.append(
                f'body "{name}" {when} with {what} inside {other}, {depth:.3g} m deep, and is '
                f"pushed out within {seconds:.2g} s; move one of them"
            )
        return told
