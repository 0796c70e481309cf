"""Launches of substeps: which kernel, how many threads, how long."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.model import state as columns
from tisoft.model.system import System
from tisoft.step.explicit_euler import ExplicitEuler
from tisoft.step.launches import make_advance as make_launches
from tisoft.step.meeting import make_depths
from tisoft.step.pace import TRIAL, TRIAL_WORK, Pace, most_threads, work_of
from tisoft.step.passes import make_advance
from tisoft.step.schedule import Schedule
from tisoft.step.substep import Structure
from tisoft.step.symplectic_euler import SymplecticEuler
from tisoft.step.velocity_verlet import VelocityVerlet
from tisoft.touch.touching import Touching

INTEGRATORS: dict[str, Any] = {
    "symplectic-euler": SymplecticEuler,
    "velocity-verlet": VelocityVerlet,
    "explicit-euler": ExplicitEuler,
}
"""By their words in scene files."""

LAUNCH_WORK = {True: 400_000, False: 8_000_000}
"""Cell-substeps per launch at the most, some 5 ms, on the processor and on a GPU: Ctrl-C and a busy
machine are felt soon.  Each launch reads and writes some ten numbers, for which a GPU is waited.
"""
SHORTEST = 8
"""Substeps per launch that are worth it for any scene."""


@dataclass(frozen=True)
class Rules:
    """What a substep has to do besides forces."""

    integrator: str
    contact: bool
    ledger: bool
    touching: Touching | None = None
    """Surfaces that may touch."""

    means: Any = None
    """Fields of patches that pins hold by means of cells."""

    @property
    def surfaces(self) -> Any:
        """Fields of contact of surfaces, or None."""
        return None if self.touching is None else self.touching.fields


class Stepper:
    """Advances a System by stretches of substeps.

    Args:
        system: the bodies.
        rules: what kernels are compiled for.
        threads: CPU threads; None: chosen by the scene's size and the machine's load.
        schedule: what acts in time.
    """

    def __init__(
        self,
        system: System,
        rules: Rules,
        *,
        threads: int | None,
        schedule: Schedule | None = None,
    ) -> None:
        self.system = system
        self.rules = rules
        self.integrator = INTEGRATORS[rules.integrator]
        work = work_of(system.elements, system.springs)
        pool = runtime.threads() if runtime.on_cpu() else 1
        parts = sum(share.batches.parts for share in system.shares)
        most = most_threads(work, parts, pool, touches=rules.touching is not None)
        self.pace = Pace(most if threads is None else max(1, min(threads, pool)))
        self.fixed = threads
        self.longest = max(SHORTEST, LAUNCH_WORK[runtime.on_cpu()] // max(1, work))
        self.trial = max(TRIAL, TRIAL_WORK // max(1, work))
        self.loaded = False
        """Whether loads and pressures act."""
        self.tripped = False
        """Whether the last launch ended early."""
        self.tells = False
        """Whether stretches record the elastic energy, for who tells frames from records."""
        self.schedule = schedule
        self.structure = Structure(
            system.state,
            tuple(share.block for share in system.shares),
            self.integrator,
            rules.contact,
            rules.ledger,
            system.mass_lease.fields if system.mass_lease is not None else None,
            schedule.fields if schedule is not None else None,
            system.touch_lease.fields if rules.contact and system.touch_lease else None,
            rules.surfaces,
            rules.means,
        )
        self._came = (-1, 0.0)
        """`System.written` and the step [s] of the last stretches."""
        self._call = 0.0
        """Seconds that calling several threads takes, which a short trial must not count."""
        self._advance = self._kernel()

    def _kernel(self) -> Any:
        """advance(scene), compiled once for the fields that it touches and the rules."""
        structure, alone, on_cpu = self.structure, self.pace.most == 1, runtime.on_cpu()
        fields = (*structure.blocks, structure.mass, structure.inputs, structure.touch)
        rules = (self.rules.integrator, self.rules.contact, self.rules.ledger)
        key = ("advance", *fields, structure.surfaces, structure.means, rules, alone, on_cpu)
        kernel = self.system.lease.arena.kernel
        if structure.meets:
            self._depths = ("depths", *key[1:-2])
        return kernel(
            key, lambda: make_advance(structure, alone) if on_cpu else make_launches(structure)
        )

    def advance(self, substeps: int, step: float, gravity: Any) -> None:
        """One stretch: `substeps` substeps of `step` [s] under `gravity` [m/s²]."""
        self.stretches(1, substeps, step, gravity)

    def stretches(
        self,
        count: int,
        substeps: int,
        step: float,
        gravity: Any,
        *,
        most_kinetic: float = np.inf,
        before: float | None = None,
    ) -> int:
        """`count` stretches (FRAMES at the most) of `substeps` substeps; returns how many it made.

        `before` is the step [s] that led here, where it was another one.

        They end early after one whose state is not finite, or whose kinetic energy [J] is above
        `most_kinetic`; `tripped` then tells.  The state at the start of the last one made is saved.
        """
        self.system.check_alive()
        if self.rules.touching is not None:
            written, known = self._came
            if self.system.written != written or step > known:
                self.rules.touching.forget()  # points may go farther than was looked ahead
            self._came = (self.system.written, step)
        for name, value in zip(
            (columns.STEP, 1, 2, 3, columns.MOST_KINETIC, columns.KICK),
            (step, *gravity, min(most_kinetic, 1e300), 0.5 * ((before or step) + step)),
            strict=True,
        ):
            self.system.order("settings", name, float(value))
        self.system.order("orders", columns.LOADED, int(self.loaded))
        self.system.order("orders", columns.TELLS, int(self.tells))
        # A stretch cut into launches gives the bits of one launch: velocity Verlet's last pass only
        # closes the last substep.
        passes = substeps + (self.integrator.closing_passes if substeps else 0)
        if passes == 0:
            self.compile()
            return 0
        self.system.order("orders", columns.PASSES, passes)
        done, end = 0, count * passes
        while done < end:
            done = self._launch(done, end)
            self.tripped = bool(self.system.state.orders[self.system.scene, columns.TRIPPED])
            if self.tripped:
                return int(self.system.state.orders[self.system.scene, columns.DONE])
        return count

    def _launch(self, done: int, end: int) -> int:
        """Passes from `done` on, to `end` or as many as a launch takes; returns where it ended."""
        now = min(end - done, self.trial if self._tries() else self.longest)
        if self.schedule is not None and self.schedule.acting is not None:
            now = min(now, self.schedule.most_passes)
        threads = self.pace.threads() if self.fixed is None else self.pace.most
        self.system.order("orders", columns.FIRST, done)
        self.system.order("orders", columns.LAST, done + now)
        self.system.order("orders", columns.THREADS, threads)
        if self.schedule is not None:
            self.schedule.fill(done, now)
        begun = time.perf_counter()
        if runtime.on_cpu():
            runtime.cores.launch(threads, lambda: self._advance(self.system.scene))
        else:
            self._advance(self.system.scene)
            runtime.import_taichi().sync()
        if self.fixed is None:
            spent = time.perf_counter() - begun - (self._call if threads > 1 else 0.0)
            self.pace.took(threads, max(spent, 0.0) / now)
        return done + now

    def find_depths(self) -> None:
        """Let contact write how deep bodies are inside each other (`easing.measured`)."""
        arena, structure = self.system.lease.arena, self.structure
        arena.kernel(self._depths, lambda: make_depths(structure))(self.system.scene)

    def measure(self, gravity: Any) -> NDArray[np.float64]:
        """Sums of the present state, shape (RECORD,), with the power v·f [W] of the elements'
        forces and `gravity` [m/s²].
        """
        for d in range(3):
            self.system.order("settings", columns.GRAVITY + d, float(gravity[d]))
        self._observe(columns.SUM)
        return self._rows(columns.FRAMES, 1)[0, 0]

    def forces(self) -> NDArray[np.float64]:
        """Elastic, viscous and spring forces [N] on each node, internal order, (nodes, 3)."""
        self._observe(columns.PUSH)
        out = np.zeros((self.system.count, 3), self.system.real)
        self.system.state.take_forces(self.system.first, out)
        return out.astype(np.float64)

    def _observe(self, task: int) -> None:
        """One pass that moves nothing, on one thread: others would have to be called for it.  What
        it tells goes behind the records of frames.
        """
        self.system.check_alive()
        for column, value in (
            (columns.PASSES, 1),
            (columns.FIRST, columns.FRAMES),
            (columns.LAST, columns.FRAMES + 1),
            (columns.THREADS, 1),
            (columns.TASK, task),
        ):
            self.system.order("orders", column, value)
        self._advance(self.system.scene)
        self.system.order("orders", columns.TASK, columns.MOVE)

    def compile(self) -> None:
        """Compile the kernels by a launch of no substep."""
        self.system.order("orders", columns.FIRST, 0)
        self.system.order("orders", columns.LAST, 0)
        for _ in range(2 if self.pace.most > 1 else 1):
            self.system.order("orders", columns.THREADS, self.pace.most)
            begun = time.perf_counter()
            self._advance(self.system.scene)
            self._call = time.perf_counter() - begun

    def _tries(self) -> bool:
        return self.fixed is None and self.pace.is_trial()

    def kinetic(self, number: int) -> float:
        """Kinetic energy [J] at the end of a stretch of the last launch."""
        return self._record(number, 0)

    def work(self, number: int) -> list[float]:
        """Energy dissipated and external work [J] in a stretch of the last launch; contact's and
        friction's share of the former.
        """
        return [self._record(number, column) for column in columns.NOTED]

    def is_finite(self, number: int) -> bool:
        """Whether the state at the end of a stretch of the last launch is."""
        return math.isfinite(self._record(number, 7)) and math.isfinite(self._record(number, 0))

    def _record(self, number: int, column: int) -> float:
        row = self.system.lease.starts["records"] + number * self.system.record_rows
        return float(self.system.state.record[row, column])

    def records(self, count: int) -> NDArray[np.float64]:
        """Records of the first `count` stretches made last, shape (count, 1 + probes, RECORD)."""
        return self._rows(0, count)

    def _rows(self, first: int, count: int) -> NDArray[np.float64]:
        """So many records from number `first` on."""
        system = self.system
        rows = system.record_rows
        wide = np.float64 if runtime.has_f64() else np.float32
        out = np.zeros((count * rows, columns.RECORD), wide)
        system.state.read_record(system.lease.starts["records"] + first * rows, out)
        return out.astype(np.float64).reshape(count, rows, columns.RECORD)

    def save(self) -> None:
        """Keep the present state."""
        self.system.state.save(self.system.first, self.system.last)

    def restore(self) -> None:
        """Go back to the saved state."""
        self.system.written += 1
        self.system.state.restore(self.system.first, self.system.last)
