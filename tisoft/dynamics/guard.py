"""The guard: no frame is shown that the step could not carry.

After each frame it asks three things, the cheap ones first.  Is the state finite?  Is the step
still below the stable limit of the state it led to (the limit is followed anyway)?  And where the
kinetic energy T is twice its highest so far: is it explained?  For that it compares

    H̃ = T + V + (h/2) v·f,   f = −∂V/∂x,   V elastic and gravity energy,

before and after the frame: what symplectic Euler conserves, where T + V alone swings.  Above the
limit H̃ is conserved too, while T and the elastic energy grow without end; so their sum may never
be more than SWING times what the start and gravity gave (below 0.9 of the limit it swings by
(1 + hω/2)/(1 − hω/2) ≤ 19).  Loads and moved pins give what is not known here: while they act, the
first two questions must do.

On a breach the frame is taken back and repeated with half the step; the next frame has its full
step again.  Nothing is clamped, and no state is repaired.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.errors import Diverged

if TYPE_CHECKING:
    from tisoft.simulation import Simulation

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


class Guard:
    """Watches a simulation frame by frame."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self._saved: tuple[NDArray[Any], NDArray[Any]] | None = None
        self._start: _Energies | None = None
        """Of the state from which on nothing but gravity has done work."""
        self._highest = 0.0
        """Kinetic energy [J] that has been explained since then."""
        self._mass = simulation.system.mass.astype(simulation.system.real)

    def save(self) -> None:
        """Keep the present state, the last good one."""
        system = self.simulation.system
        u, v = runtime.read(system.u), runtime.read(system.v)
        if self._saved is None:
            self._saved = (u.copy(), v.copy())
        else:
            np.copyto(self._saved[0], u)
            np.copyto(self._saved[1], v)

    def restore(self) -> None:
        """Go back to the state of the last `save`."""
        assert self._saved is not None
        runtime.write(self.simulation.system.u, self._saved[0])
        runtime.write(self.simulation.system.v, self._saved[1])

    def state(self) -> list[float]:
        """What a checkpoint keeps."""
        return [self._highest, *([] if self._start is None else astuple(self._start))]

    def set_state(self, state: list[float]) -> None:
        """Go on from what `state` told."""
        self._highest, *start = state
        self._start = _Energies(*start) if start else None

    def carry(self, count: int, step: float) -> tuple[int, float]:
        """Make `count` substeps of `step` [s], again with half the step while there is a breach;
        returns what carried.

        Raises:
            Diverged: when no step carries; the state is then the last good one.
        """
        simulation = self.simulation
        first, last = step, None
        self.save()
        for _ in range(MOST_TRIES):
            simulation.substep(count, step)
            cause = self.breach(step)
            if cause is None:
                if last is not None:
                    simulation.recoveries.append(last)
                return count, step
            element = simulation.limit.culprit()
            self.restore()
            simulation.limit.moved()
            count, step = 2 * count, step / 2
            simulation.change_step(first, step)
            last = Recovery(simulation.time, cause, element, first, step)
        assert last is not None
        raise Diverged(
            f"the simulation failed in frame {simulation.frame + 1} (t = {last.time:.6g} s) at "
            f"{last.element}: {last.cause}; even the step {last.step_after:.3g} s, "
            f"{2**MOST_TRIES} times smaller than {last.step_before:.3g} s, did not help. "
            "Move pins more slowly, make loads smaller or the material stiffer, or mend the element"
        )

    def watch(self, count: int, step: float) -> None:
        """Make the substeps whatever comes of them; what is not finite is not kept.

        Raises:
            Diverged: when positions stop being finite; the state is then the last good one.
        """
        simulation = self.simulation
        self.save()
        simulation.substep(count, step)
        if self._is_finite():
            return
        element = simulation.limit.culprit()
        self.restore()
        simulation.limit.moved()
        raise Diverged(
            f"positions stopped being finite in frame {simulation.frame + 1} "
            f"(t = {simulation.time:.6g} s, step {step:.3g} s) at {element}; "
            "give a smaller step, or another integrator"
        )

    def _is_finite(self) -> bool:
        """Whether all positions and velocities are numbers."""
        system = self.simulation.system
        with np.errstate(all="ignore"):
            return all(math.isfinite(float(runtime.read(a).sum())) for a in (system.u, system.v))

    def breach(self, step: float) -> str | None:
        """Why the frame just made with `step` [s] cannot be shown; None where it can."""
        system, limit = self.simulation.system, self.simulation.limit
        u, v = runtime.read(system.u), runtime.read(system.v)
        with np.errstate(all="ignore"):
            kinetic = self._kinetic(v)
            if not math.isfinite(kinetic) or not math.isfinite(float(u.sum())):
                return "positions are not finite"
            highest = limit.accepted()
            if step > highest:
                return f"the step is above {highest:.3g} s, the limit of the deformed state"
            if self.simulation.is_driven():
                self.forget()
                return None
            cause = self._energy_breach(step, kinetic) if kinetic > GROWTH * self._highest else None
        return cause

    def forget(self) -> None:
        """Say that energy has come from elsewhere: the present state explains itself."""
        self._start, self._highest = None, 0.0

    def _energy_breach(self, step: float, kinetic: float) -> str | None:
        system = self.simulation.system
        new = self._energies(step)
        u, v = runtime.read(system.u).copy(), runtime.read(system.v).copy()
        self.restore()
        old = self._energies(step)
        runtime.write(system.u, u)
        runtime.write(system.v, v)
        start = self._start = self._start or old
        rounding = ROUNDING * (old.scale + abs(new.gravity) + start.scale)
        explained = start.motion + max(0.0, start.gravity - new.gravity)
        grown = new.shadow - old.shadow > max(UNEXPLAINED * kinetic, rounding)
        if not grown and new.motion <= SWING * explained + rounding:
            self._highest = max(self._highest, kinetic)
            return None
        return f"the energy grew by {new.motion - explained:.3g} J that no work explains"

    def _kinetic(self, v: NDArray[Any]) -> float:
        return 0.5 * float((v * v).sum(axis=1) @ self._mass)

    def _energies(self, step: float) -> _Energies:
        simulation = self.simulation
        energy = simulation.energy()
        kinetic, elastic, gravity = (energy[k] or 0.0 for k in ("kinetic", "elastic", "gravity"))
        f = simulation.forces()
        f += simulation.masses()[:, None] * np.asarray(simulation.scene.gravity)
        power = float(np.einsum("ij,ij->", simulation.velocities(), f))
        motion = kinetic + elastic
        return _Energies(motion + gravity + 0.5 * step * power, motion, gravity)
