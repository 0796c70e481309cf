"""The scene itself: its step, its damping, how far it compresses and turns when it runs."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tisoft.checks import FieldError
from tisoft.equilibrium.operators import Elastic
from tisoft.errors import Diverged
from tisoft.model.part import Part
from tisoft.scene import Scene
from tisoft.simulation import Simulation
from tisoft.study.axis import Tick
from tisoft.study.subject import Subject

Floats = NDArray[np.float64]

LOOKS = 40
"""Frames of the run that are looked at, at the most."""
PATIENCE = 15.0
"""Seconds of computing after which the look at the scene ends."""


@dataclass
class Own:
    """Where the scene is on the maps."""

    limit: float
    """The stable step at rest, of the scene's integrator (explicit Euler: symplectic's) [s]."""
    step: float
    """The substep that it runs with [s]."""
    part: Part
    least_stretch: float = 1.0
    """Smallest principal stretch of any tet or spring in the run."""
    most_turn: float = 0.0
    """Largest rotation of any tet [rad]."""
    seconds: float = 0.0
    """Simulated time that was looked at."""
    ended: str = ""
    """Why the run ended before its time; empty where it did not."""
    viscosity: tuple[float, float] = field(default=(0.0, 0.0))

    def damping(self, mode: Floats, omega: float) -> float:
        """Damping ratio of a mode with unit modal mass: cᵀ(C + gM)c / 2ω."""
        c = float(np.vdot(mode, Elastic(self.part).viscosity_times(mode, np.zeros_like(mode))))
        return (c + self.part.body.model.point_damping) / (2.0 * omega)


def work() -> int:
    """Number of ticks that `look` makes."""
    return LOOKS


def look(subject: Subject, tick: Tick, *, run: bool = True) -> Own:
    """Find the scene's step, and run it where `run` asks for its deformation."""
    scene = subject.scene
    sim = Simulation(scene, certify=not subject.is_explicit)
    part = sim.part(subject.body)
    try:
        step = sim.substeps_of(1.0 / scene.frame_rate)[1]
        stopped = ""
    except FieldError:
        step = float(scene.step)
        stopped = "its step is above the stable limit"
    own = Own(subject.limit, step, part, ended=stopped)
    if subject.is_explicit:
        own.ended = "explicit Euler does not last"
    if run and not own.ended:
        _run(sim, scene, own, tick)
    return own


def _run(sim: Simulation, scene: Scene, own: Own, tick: Tick) -> None:
    frames = max(1, round(scene.duration * scene.frame_rate))
    wanted = set(np.unique(np.linspace(1, frames, min(frames, LOOKS)).round().astype(int)))
    begun = time.perf_counter()
    for frame in range(1, frames + 1):
        try:
            sim.step()
        except Diverged as error:
            own.ended = f"the simulation failed: {error}"
            return
        own.seconds = sim.time
        if frame in wanted:
            _note(sim, own)
            tick()
        if time.perf_counter() - begun > PATIENCE:
            own.ended = f"it was watched for the first {sim.time:.3g} s only"
            return


def _note(sim: Simulation, own: Own) -> None:
    u = sim.system.u.astype(np.float64)
    for part in sim.parts:
        here = u[part.nodes]
        if len(part.springs):
            ends = part.body.mesh.points[part.order] + here
            lengths = np.linalg.norm(ends[part.springs[:, 1]] - ends[part.springs[:, 0]], axis=1)
            own.least_stretch = min(
                own.least_stretch, float((lengths / part.spring_numbers[:, 1]).min())
            )
        for cells in part.solids:
            stretch, turn = extremes(cells.deformation(here).reshape(-1, 3, 3))
            own.least_stretch = min(own.least_stretch, stretch)
            own.most_turn = max(own.most_turn, turn)


def extremes(F: Floats) -> tuple[float, float]:
    """Smallest principal stretch, negative where a tet is inverted, and largest rotation [rad]."""
    left, stretches, right = np.linalg.svd(F)
    flip = np.sign(np.linalg.det(left) * np.linalg.det(right))
    stretches[:, 2] *= flip
    left[:, :, 2] *= flip[:, None]
    trace = np.einsum("eij,eji->e", left, right)
    turns = np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0))
    return float(stretches[:, 2].min()), float(turns.max())
