"""Launches of substeps: on the CPU one kernel a frame, elsewhere two small ones a substep."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from tisoft import runtime
from tisoft.dynamics.advance import advance_kernel
from tisoft.dynamics.flags import Flags
from tisoft.dynamics.nodes import VELOCITY_VERLET
from tisoft.dynamics.system import System
from tisoft.models.consistent_mass import ITERATIONS

LAUNCH_WORK = 400_000
"""Tet-substeps per launch at the most, some 5 ms: Ctrl-C and a busy machine are felt soon."""
SHORTEST = 8
"""Substeps per launch that are worth it for any scene."""
TETS_PER_THREAD = 150
TRIAL, TRIAL_WORK = 4, 40_000
"""Substeps, or tet-substeps, of the launch that tries several threads again: so many that calling
them does not count, so few that waiting for a busy core does not hurt."""
LONGEST_WAIT = 4096
"""Launches with one thread at the most before several are tried again."""
SPRINGS_PER_TET = 3
"""Springs that cost about as much as one tet."""


class Pace:
    """How many threads the next launch takes.  The count changes speed only, never a bit.

    Threads meet at barriers, so on a busy machine one that must wait for a core makes all wait.
    Where several threads turn out slower than one, one takes over for a while, twice as long each
    time.
    """

    def __init__(self, most: int) -> None:
        self.most = most
        self.alone = np.inf  # seconds per substep with one thread
        self.penalty = 1
        self.trial = True
        self.wait = 0 if most == 1 else 1  # the first launch runs alone: what others must beat

    def threads(self) -> int:
        """Threads for the next launch."""
        return 1 if self.wait > 0 else self.most

    def is_trial(self) -> bool:
        """Whether the next launch tries several threads again; it should be a short one."""
        return self.wait == 0 and self.trial

    def took(self, threads: int, seconds: float) -> None:
        """Note the seconds per substep of a launch."""
        if threads == 1:
            self.alone = min(seconds, 1.02 * self.alone)
            self.wait -= 1
        elif seconds > 1.2 * self.alone:
            self.wait, self.penalty = self.penalty, min(4 * self.penalty, LONGEST_WAIT)
            self.trial = True
        else:
            self.penalty, self.trial = 1, False


class Stepper:
    """Advances a System by substeps; see `advance` for the order of things in one."""

    def __init__(
        self,
        system: System,
        flags: Flags,
        *,
        threads: int | None,
        obstacles: tuple[Any, Any],
    ) -> None:
        self.system = system
        self.flags = flags
        self.params = runtime.array(np.zeros(4, system.real))
        work = system.tets + system.springs // SPRINGS_PER_TET
        pool = runtime.threads() if runtime.on_cpu() else 1
        most = max(1, min(pool, work // TETS_PER_THREAD))
        self.pace = Pace(most if threads is None else max(1, min(threads, pool)))
        self.fixed = threads
        self.longest = max(SHORTEST, LAUNCH_WORK // max(1, work))
        self.trial = max(TRIAL, TRIAL_WORK // max(1, work))
        self._arrived = runtime.array(np.zeros(1, np.int32))
        self._bind(*obstacles)

    def _bind(self, kind: Any, shape: Any) -> None:
        s, flags = self.system, self.flags
        if not runtime.on_cpu():
            from tisoft.dynamics.gpu import bind_gpu

            self._launch = bind_gpu(s, self.params, flags, kind, shape)
            return
        kernel = advance_kernel(s.taichi_real)
        arguments = [
            0, 0, 0, 1, self.pace.most == 1, s.laws, flags.viscous, s.springs > 0, s.tensors,
            ITERATIONS[s.precision] if s.consistent else 0, flags.loads, flags.pressure,
            flags.contact, flags.integrator, flags.ledger,
            self.params, s.u, s.v, s.half, s.rest, s.inverse_mass, s.body,
            s.material, s.held, s.drive, s.load, s.force,
            s.pressure_starts, s.pressure_ends, s.pressure_data, s.pressed,
            s.law_starts, s.nodes, s.shapes, s.owner, s.slots, s.flat_slots,
            s.still_slots, s.still_flat, s.still, s.work,
            s.starts, s.corners,
            s.spring_starts, s.spring_ends, s.spring_data,
            s.tensor_starts, s.tensor_ends, s.stiffness, s.viscosity,
            s.mass_starts, s.mass_ends, s.mass_entries, s.diagonal,
            s.acceleration, s.residual, s.direction,
            kind, shape, self._arrived,
        ]  # fmt: skip
        self._launch = runtime.bind(kernel, *arguments)

    def _tries(self) -> bool:
        return self.fixed is None and self.pace.is_trial()

    def advance(self, substeps: int, step: float, gravity: Any) -> None:
        """`substeps` substeps of `step` [s] under `gravity` [m/s²]."""
        if self.flags.ledger:
            self.system.clear_work()
        runtime.write(self.params, np.array([step, *gravity], dtype=self.system.real))
        # A frame cut into launches gives the bits of one launch: velocity Verlet's last pass only
        # closes the last substep.
        passes = substeps + (self.flags.integrator == VELOCITY_VERLET and substeps > 0)
        done = 0
        while done < passes:
            now = min(passes - done, self.trial if self._tries() else self.longest)
            threads = self.pace.threads() if self.fixed is None else self.pace.most
            begun = time.perf_counter()
            if runtime.on_cpu():
                self._arrived[0] = 0
            self._launch(done, done + now, substeps, threads)
            if self.fixed is None:
                self.pace.took(threads, (time.perf_counter() - begun) / now)
            done += now
