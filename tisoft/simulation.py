"""A running scene: frames, state in and out, energies, the stable step."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from tisoft import checkpoint, checks, entering, resume, runtime
from tisoft.body import Body
from tisoft.energies import Energies
from tisoft.equilibrium.modes import Mass, Modes, natural_modes
from tisoft.equilibrium.reactions import reactions
from tisoft.equilibrium.statics import Equilibrium, equilibrium
from tisoft.live import frozen
from tisoft.measures.measures import Measures
from tisoft.model.mass import ITERATIONS
from tisoft.motion import Motion
from tisoft.probed import places_of
from tisoft.running import run
from tisoft.scene import Scene
from tisoft.step.consistent_mass import residual_share
from tisoft.step.loading import external_forces
from tisoft.told import Told, entries_of
from tisoft.touch.crossing import crossed

Floats = NDArray[np.float64]


@frozen
@dataclass(frozen=True)
class Frame:
    """What an observer sees: the `simulation` at the end of its frame number `index`, from 0."""

    simulation: Simulation
    index: int
    time: float
    """[s]"""
    told: Told | None = None
    """Of a frame made together with others: how it was."""

    @property
    def is_present(self) -> bool:
        """Whether the state is this frame's: of frames made together, the last one's."""
        return self.index == self.simulation.frame

    def positions(self, body: Body | None = None) -> Floats:
        """World positions [m], shape (nodes, 3), in the mesh's node order."""
        return self.simulation.positions(body)

    def velocities(self, body: Body | None = None) -> Floats:
        """Velocities [m/s], shape (nodes, 3), in the mesh's node order."""
        return self.simulation.velocities(body)

    def probes(self) -> Floats:
        """World positions of the scene's probes [m], shape (probes, 3)."""
        return self.simulation.probe_positions() if self.told is None else self.told.places

    def energy(self) -> Energies:
        """Energies [J], as `Simulation.energy`."""
        return self.simulation.energy() if self.told is None else cast(Energies, self.told.energies)


class Simulation(Motion):
    """A scene that runs.

    Args:
        scene: or the name of a scene file.  It is read again between frames: gravity, step,
            frame rate, materials, pins, loads and obstacles may change; all else is refused.
        arch: "cpu", "cuda", "metal", "vulkan" or "auto".
        precision: "f32" or "f64"; left out, the scene's.
        certify: False takes any step and checks nothing: to show how things fail.
        threads: CPU threads; left out, chosen by the scene's size and the machine's load.
        ledger: keep account of dissipated energy and external work.
        interactive: nothing that a viewer may ask for compiles, or certifies for long, on the way.

    Raises:
        SceneError: a scene that cannot run, with the field that says why.
    """

    def __init__(
        self,
        scene: Scene | str | os.PathLike[str],
        *,
        arch: str = "cpu",
        precision: str | None = None,
        certify: bool = True,
        threads: int | None = None,
        ledger: bool = False,
        interactive: bool = False,
    ) -> None:
        begun = time.perf_counter()
        flags = {"certify": certify, "ledger": ledger, "interactive": interactive}
        entering.check_options(arch, precision, threads, **flags)
        scene = entering.scene_of(scene)
        entering.check_half_step(scene)
        self.arch = runtime.start(arch)
        super().__init__(
            scene,
            precision=precision or scene.precision,
            certify=certify,
            threads=threads,
            ledger=ledger,
            interactive=interactive,
        )
        if interactive:
            self.rehearse()
        self.start_seconds = time.perf_counter() - begun - self.compile_seconds
        """Seconds of making it, without compiling; with Taichi's own start, where that was new."""

    def __setattr__(self, name: str, value: Any) -> None:
        entering.check_attribute(self, name, value)
        super().__setattr__(name, value)

    @property
    def warnings(self) -> list[str]:
        """What the run has told so far that a user should know, a sentence each."""
        self.watch.look(self.time)
        return self.watch.warnings() + self._crossed() + self.coarse_times()

    def _crossed(self) -> list[str]:
        """What is told of sheets that have crossed, in a run: a viewer asks all the time."""
        if self.touching is None or not self.meets or self.is_interactive:
            return []
        return crossed(self.touching, self.system.world())

    # -- state ---------------------------------------------------------------------------------

    def positions(self, body: Body | None = None) -> Floats:
        """World positions [m], shape (nodes, 3): one body's, or all in the scene's order."""
        return self._outside(self.system.world(), body)

    def velocities(self, body: Body | None = None) -> Floats:
        """Velocities [m/s], shape (nodes, 3): one body's, or all in the scene's order."""
        return self._outside(self.whole_velocities(), body)

    def set_state(self, positions: Any, velocities: Any) -> None:
        """Set all world positions [m] and velocities [m/s], shape (nodes, 3), scene's order; held
        components keep the velocity of their pin.

        Raises SceneError for another shape, what is not finite, and held nodes that are moved.
        """
        self.refresh()
        self.put_state(*entering.state_of(self, positions, velocities))
        self.put_anew()

    def put_state(self, x: Floats, v: Floats) -> None:
        """Set a state that has been checked, wherever pins hold."""
        u = self._inside(x) - self.system.world(np.zeros_like(x))
        self.system.set_motion(u, self._inside(v))
        self.half_step_lag, self.center_due = 0.0, 0.0  # the velocities are the present ones
        self.limit.moved()
        self.look_for_contact()
        if self.guard is not None:
            self.guard.forget()
        if self.ledger:  # a new state begins a new account
            self.open_account()

    def forces(self, body: Body | None = None) -> Floats:
        """Elastic, viscous and spring forces [N] in the present state, shape (nodes, 3)."""
        self.refresh()
        return self._outside(self.stepper.forces(), body)

    def reactions(self, body: Body | None = None) -> Floats:
        """Forces of pins on their nodes [N], 0 where nothing is held, shape (nodes, 3)."""
        self.refresh()
        external = external_forces(self.parts, self.time, self.system.world())
        internal, held = self.stepper.forces(), self.holder
        force = reactions(self.system, held, internal, external, self.gravity_now)
        return self._outside(force, body)

    def energy(self) -> Energies:
        """Energies [J] in the present state; None for what is not measured (see `ledger`)."""
        self.refresh()
        return cast(Energies, entries_of(self.account, self.energies()))

    def probe_positions(self) -> Floats:
        """World positions of the scene's probes [m], shape (probes, 3)."""
        u, _ = self.system.probe_motion()
        return places_of(self.probed, self.system.probe_origins() + u)

    @property
    def ledger(self) -> bool:
        """Whether dissipated energy and external work are kept account of, from when it is set."""
        return self.account is not None

    @ledger.setter
    def ledger(self, on: bool) -> None:
        if checks.flag("ledger", on) != self.ledger:
            self.account = None
            if on:
                self.open_account()

    def equilibrium(self, *, external: Any = None) -> Equilibrium:
        """The static equilibrium under gravity, loads and pins of t = duration: see `statics`."""
        return equilibrium(self, external=external)

    def modes(self, n: int = 6, *, about: Any = "rest", mass: Mass | None = None) -> Modes:
        """The n lowest natural frequencies and shapes: see `natural_modes`."""
        return natural_modes(self, n, about=about, mass=mass)

    def stable_step(self) -> float:
        """A step [s] that is certainly stable in the present state."""
        self.refresh()
        return self.limit.present()

    @cached_property
    def measures(self) -> Measures:
        """Strain, stress and momentum in the present state."""
        return Measures(self)

    def masses(self) -> Floats:
        """Lumped masses [kg], shape (nodes,), in the scene's order."""
        return self._outside(self.system.mass, None)

    def mass_solve(self) -> dict[str, float] | None:
        """Iterations of the last solve with the consistent mass, and its largest |f − M a| over the
        largest |f|; None where all masses are lumped.
        """
        if not self.system.consistent:
            return None
        force = self.stepper.forces()
        force += self.system.mass[:, None] * self.gravity_now
        residual = residual_share(self.system.mass_residual(), force)
        return {"iterations": ITERATIONS[self.precision], "residual": residual}

    def _outside(self, values: Floats, body: Body | None) -> Floats:
        """Internal order to the mesh's own."""
        out = np.empty_like(values)
        for part in self.parts:
            out[part.nodes][part.order] = values[part.nodes]
        return out if body is None else out[self.part(body).nodes]

    def _inside(self, values: Floats) -> Floats:
        out = np.empty_like(values)
        for part in self.parts:
            out[part.nodes] = values[part.nodes][part.order]
        return out

    # -- frames --------------------------------------------------------------------------------

    def step(self) -> Frame:
        """Advance one frame.

        Raises:
            Diverged: when no step carries the frame; the state is then the last good one.
        """
        self.make_frame()
        return self.here()

    def here(self) -> Frame:
        """The present state as a Frame."""
        return Frame(self, self.frame, self.time)

    def frames(self, seconds: float | None = None) -> Iterator[Frame]:
        """Frames from now on, the present one first: `seconds` [s] of them, or the scene's."""
        count = entering.frames_in(seconds, self.scene)
        return (self.step() if k else self.here() for k in range(count + 1))

    def run(self, seconds: float | None = None, *, observers: Iterable[Any] = ()) -> None:
        """Run with observers: objects with on_start(sim), on_frame(frame), on_end(sim), each
        optional; a plain callable is on_frame (see `running`).
        """
        run(self, entering.frames_in(seconds, self.scene), entering.observers_of(observers))

    def told(self, index: int, told: Told | None) -> Frame:
        """A frame of those just made, with what is told of it."""
        return Frame(self, index, self.time_of(index), told)

    # -- checkpoints ---------------------------------------------------------------------------

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a checkpoint, whole or not at all."""
        self.refresh()
        resume.save(self, checks.path("path", path))

    @staticmethod
    def load(path: str | os.PathLike[str], *, arch: str = "cpu") -> Simulation:
        """A simulation from a checkpoint; it goes on with the very bits of the saved one."""
        path = checks.path("path", path, "a checkpoint")
        content, arrays = resume.read(path)
        with checkpoint.damage_told(path):
            simulation = Simulation(
                content["scene"],
                arch=arch,
                precision=content["precision"],
                certify=content["certify"],
            )
            resume.put(simulation, content, arrays)
        return simulation
