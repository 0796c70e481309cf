"""The guard: no frame is shown that the step could not carry.

It asks three things, the cheap ones first.  After each frame: is the state finite?  As often as the
limit is looked at: is the step still below that of the state it led to?  And after each frame
whose kinetic energy T is twice the highest so far: is it explained?  For that it compares

    H̃ = T + V + (h/2) v·f,   f = −∂V/∂x,   V elastic and gravity energy,

before and after the frame: what symplectic Euler conserves, where T + V alone swings.  Bodies that
began at rest, unstrained, and are no faster than gravity can have made them explain themselves
without it (elastic energy is never below that of the rest shape).  Above the limit H̃ is conserved
too, while T and the elastic energy grow without end; so their sum may never be more than SWING
times what the start and gravity gave (below 0.9 of the limit it swings by
(1 + hω/2)/(1 − hω/2) ≤ 19).  Loads and moved pins give what is not known here: while they act, the
first two questions must do.

On a breach the frame is taken back and repeated with half the step; the next frame has its full
step again.  Nothing is clamped, and no state is repaired.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from typing import Protocol

from tisoft.errors import Diverged
from tisoft.stable.limit import StepLimit
from tisoft.stable.limiting import culprit
from tisoft.step.stepper import Stepper

MOST_TRIES = 10
"""Halvings of one frame's step before the simulation gives up."""
GROWTH = 2.0
"""Growth of the kinetic energy beyond its highest that asks for an explanation."""
UNEXPLAINED = 0.5
"""Share of the kinetic energy by which H̃ may grow."""
SWING = 20.0
"""Factor by which T + V may grow beyond what gravity gives."""
ROUNDING = 1e-6
"""Share of the elastic and gravity energy below which growth is the rounding of a body at rest."""


@dataclass(frozen=True)
class _Energies:
    """Of one state [J]."""

    shadow: float
    """H̃"""
    motion: float
    """Kinetic and elastic."""
    gravity: float

    @property
    def scale(self) -> float:
        """The size of energies, of which their rounding is a share."""
        return self.motion + abs(self.gravity)


@dataclass(frozen=True)
class Recovery:
    """One frame taken back and repeated."""

    time: float
    """Start of the frame [s]."""
    cause: str
    element: str
    step_before: float
    step_after: float
    """[s]"""


class Guarded(Protocol):
    """What the guard asks of a running scene."""

    time: float
    frame: int
    recoveries: list[Recovery]
    limit: StepLimit
    stepper: Stepper

    def present(self) -> tuple[dict[str, float], float]:
        """Energies [J] of the present state, and the power v·f [W] of all conservative forces."""
        ...

    def is_driven(self) -> bool:
        """Whether loads or moved pins do work on the bodies."""
        ...

    def remedies(self) -> str:
        """What may help a scene that no step carries."""
        ...

    def fallen(self, number: int) -> float:
        """Energy [J] that gravity has given from the rest positions to the end of a stretch."""
        ...

    def stretches(self, count: int, substeps: int, step: float, most_kinetic: float) -> int:
        """Make stretches that end early above `most_kinetic` [J]; returns how many were made."""
        ...

    def is_look_due(self, substeps: int) -> bool:
        """Whether the limit is to be looked at after so many substeps more."""
        ...


class Guard:
    """Watches a running scene stretch by stretch (a frame, or a piece of a long one)."""

    def __init__(self, scene: Guarded) -> None:
        self.scene = scene
        self._start: _Energies | None = None
        """Of the state from which on nothing but gravity has done work."""
        self._highest = 0.0
        """Kinetic energy [J] that has been explained so far."""
        self._from_rest = True
        """Whether gravity has done all work since all bodies were in their rest shapes; that they
        moved at first counts for nothing."""

    def state(self) -> list[float]:
        """What a checkpoint keeps."""
        return [
            self._highest,
            float(self._from_rest),
            *([] if self._start is None else astuple(self._start)),
        ]

    def set_state(self, state: list[float]) -> None:
        """Go on from what `state` told."""
        self._highest, from_rest, *start = state
        self._from_rest = bool(from_rest)
        self._start = _Energies(*start) if start else None

    def carry_many(self, count: int, substeps: int, step: float) -> int:
        """Make up to `count` stretches of `substeps` substeps of `step` [s]; returns how many were
        made and are sound.  What comes after them is for `carry`, which finds what it would have
        found of stretches made one by one.
        """
        scene = self.scene
        known = scene.limit.state()
        made = scene.stretches(count, substeps, step, self._unsuspected())
        if self.breach(step, made - 1, look=scene.is_look_due(made * substeps)) is None:
            return made
        scene.stepper.restore()
        scene.limit.set_state(known)
        return made - 1

    def carry(self, substeps: int, step: float) -> tuple[int, float]:
        """Make one stretch of `substeps` substeps of `step` [s], again with half the step while
        there is a breach; returns number and size of the substeps that carried.

        Raises:
            Diverged: when no step carries; the state is then the last good one.
        """
        scene = self.scene
        first, last = step, None
        for _ in range(MOST_TRIES):
            scene.stretches(1, substeps, step, self._unsuspected())
            look = last is not None or scene.is_look_due(substeps)
            cause = self.breach(step, 0, look=look)
            if cause is None:
                if last is not None:
                    scene.recoveries.append(last)
                return substeps, step
            element = culprit(scene.limit)
            scene.stepper.restore()
            scene.limit.moved()
            substeps, step = 2 * substeps, step / 2
            last = Recovery(scene.time, cause, element, first, step)
        assert last is not None
        remedies = scene.remedies()
        raise Diverged(
            f"the simulation failed in frame {scene.frame + 1} (t = {last.time:.6g} s) at "
            f"{last.element}: {last.cause}; even the step {last.step_after:.3g} s, "
            f"{2**MOST_TRIES} times smaller than {last.step_before:.3g} s, did not help. "
            f"{remedies[0].upper()}{remedies[1:]}"
        )

    def watch(self, substeps: int, step: float) -> None:
        """Make a stretch whatever comes of it; what is not finite is not kept.

        Raises:
            Diverged: when positions stop being finite; the state is then the last good one.
        """
        scene = self.scene
        scene.stretches(1, substeps, step, math.inf)
        if not scene.stepper.tripped:
            return
        element = culprit(scene.limit)
        scene.stepper.restore()
        scene.limit.moved()
        raise Diverged(
            f"positions stopped being finite in frame {scene.frame + 1} "
            f"(t = {scene.time:.6g} s, step {step:.3g} s) at {element}; "
            "give a smaller step, or another integrator"
        )

    def _unsuspected(self) -> float:
        """Kinetic energy [J] up to which nothing has to be explained."""
        return math.inf if self.scene.is_driven() else GROWTH * self._highest

    def breach(self, step: float, number: int, *, look: bool) -> str | None:
        """Why the stretch just made with `step` [s] cannot be shown; None where it can.

        Args:
            step: [s]
            number: of the stretch in its launch.
            look: whether the limit of the state is looked at.
        """
        scene = self.scene
        if scene.stepper.tripped and not scene.stepper.is_finite(number):
            return "positions are not finite"
        if look:
            scene.limit.moved()
            highest = scene.limit.accepted(step)
            if step > highest:
                return f"the step is above {highest:.3g} s, the limit of the deformed state"
        kinetic = scene.stepper.kinetic(number)
        if scene.is_driven():
            self.forget()
            self._highest = max(self._highest, kinetic)
            return None
        if not scene.stepper.tripped:
            return None
        if self._from_rest and kinetic <= scene.fallen(number):
            self._highest = max(self._highest, kinetic)
            return None
        return self._energy_breach(step, kinetic)

    def forget(self) -> None:
        """Say that energy has come from elsewhere: the present state explains itself.  What moved
        as fast before is no more suspicious than it was.
        """
        self._start, self._from_rest = None, False

    def _energy_breach(self, step: float, kinetic: float) -> str | None:
        system = self.scene.stepper.system
        new = self._energies(step)
        here = system.motion()
        self.scene.stepper.restore()
        old = self._energies(step)
        system.set_motion(*here)
        start = self._start = self._start or old
        rounding = ROUNDING * (old.scale + abs(new.gravity) + start.scale)
        explained = start.motion + max(0.0, start.gravity - new.gravity)
        grown = new.shadow - old.shadow > max(UNEXPLAINED * kinetic, rounding)
        if not grown and new.motion <= SWING * explained + rounding:
            self._highest = max(self._highest, kinetic)
            return None
        return f"the energy grew by {new.motion - explained:.3g} J that no work explains"

    def _energies(self, step: float) -> _Energies:
        table, power = self.scene.present()
        motion = table["kinetic"] + table["elastic"]
        return _Energies(motion + table["gravity"] + 0.5 * step * power, motion, table["gravity"])
