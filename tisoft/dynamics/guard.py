"""The guard: no frame is shown that the step could not carry.

After each frame it asks three things, the cheap ones first.  Is the state finite?  Is the step
still below the stable limit of the state it led to (the limit is followed anyway)?  And where the
kinetic energy T more than doubled: can work explain it?  For that it compares

    H̃ = T + V + (h/2) v·f,   f = −∂V/∂x,   V elastic and gravity energy,

before and after: what symplectic Euler conserves, where T + V alone swings near the limit.  On a
breach the frame is taken back and repeated with half the step; the next frame has its full step
again.  Nothing is clamped, and no state is repaired.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime

if TYPE_CHECKING:
    from tisoft.simulation import Simulation

MOST_TRIES = 10
"""Halvings of one frame's step before the simulation gives up."""
GROWTH = 2.0
"""Growth of the kinetic energy within a frame that asks for an explanation."""
UNEXPLAINED = 0.5
"""Share of the kinetic energy that may come from nowhere: the ledger's own swing stays below."""


ROUNDING = 1e-6
"""Share of the elastic and gravity energy below which growth is the rounding of a body at rest."""


@dataclass(frozen=True)
class _Shadow:
    """H̃ and the size of the potential energies in it [J]."""

    total: float
    scale: float


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
        self._saved_kinetic = 0.0
        self._known: float | None = None
        """Kinetic energy of the present state, where the last look told it."""
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
        self._saved_kinetic = self._known if self._known is not None else self._kinetic(v)
        self._known = None

    def restore(self) -> None:
        """Go back to the state of the last `save`."""
        assert self._saved is not None
        runtime.write(self.simulation.system.u, self._saved[0])
        runtime.write(self.simulation.system.v, self._saved[1])

    def is_finite(self) -> bool:
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
            grown = kinetic > GROWTH * self._saved_kinetic and not self.simulation.is_driven()
            cause = self._energy_breach(step, kinetic) if grown else None
        self._known = kinetic if cause is None else None
        return cause

    def forget(self) -> None:
        """Say that the caller has set another state."""
        self._known = None

    def _energy_breach(self, step: float, kinetic: float) -> str | None:
        system = self.simulation.system
        new = self._shadow_energy(step)
        u, v = runtime.read(system.u).copy(), runtime.read(system.v).copy()
        self.restore()
        old = self._shadow_energy(step)
        runtime.write(system.u, u)
        runtime.write(system.v, v)
        if new.total - old.total <= max(UNEXPLAINED * kinetic, ROUNDING * new.scale):
            return None
        return f"the energy grew by {new.total - old.total:.3g} J that no work explains"

    def _kinetic(self, v: NDArray[Any]) -> float:
        return 0.5 * float((v * v).sum(axis=1) @ self._mass)

    def _shadow_energy(self, step: float) -> _Shadow:
        """H̃ of the present state."""
        simulation = self.simulation
        energy = simulation.energy()
        total = sum(energy[key] or 0.0 for key in ("kinetic", "elastic", "gravity"))
        v = simulation.velocities()
        f = simulation.forces()
        masses = simulation.masses()
        f += masses[:, None] * np.asarray(simulation.scene.gravity)
        scale = sum(abs(energy[key] or 0.0) for key in ("elastic", "gravity"))
        return _Shadow(float(total + 0.5 * step * np.einsum("ij,ij->", v, f)), scale)
