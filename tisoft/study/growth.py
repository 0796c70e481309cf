"""Short runs that tell whether a step is stable: does the stiffest mode grow?"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.body import Body
from tisoft.models.materials import MassSpring, Model
from tisoft.simulation import Simulation
from tisoft.study.subject import alone

Floats = NDArray[np.float64]

CHUNK, CHUNKS = 7, 48
"""Substeps between two looks (odd, so as not to beat with a mode that alternates), and looks."""
AMPLITUDE = 1e-9
"""Of the body's size: far from every nonlinearity, even after growing ENOUGH times."""
ENOUGH = 1e5
"""Growth after which a run ends."""
STABLE = 2.0
"""Largest amplitude of the last third over that of the first third that counts as stable."""


@dataclass(frozen=True)
class Growth:
    """What one short run did."""

    stable: bool
    per_substep: float
    """Mean growth of the amplitude in a substep; at most about 1 where stable."""
    substeps: int


class GrowthBench:
    """One f64 simulation of a body, whose damping and step are set run by run.

    Args:
        body: is run alone, with its pins.
        damped: its model with some viscosity: viscous kernels serve without it too, not conversely.
        integrator: by its name.
    """

    def __init__(self, body: Body, damped: Model, *, integrator: str) -> None:
        self.scene = alone(body)
        self.scene.integrator = integrator
        self.body = self.scene.bodies[0]
        self.body.model = damped
        self.sim = Simulation(self.scene, certify=False, threads=1)

    def run(self, model: Model, mode: Floats, step: float) -> Growth:
        """Run from rest in the shape `mode` with substeps of `step` [s]."""
        system, size = self.sim.system, self.sim.parts[0].size
        self.body.model = model
        system.set_motion(AMPLITUDE * size / float(np.abs(mode).max()) * mode, 0.0 * mode)
        self.scene.step = step
        self.scene.frame_rate = 1.0 / (CHUNK * step)
        looks = [AMPLITUDE]
        with np.errstate(all="ignore"):
            while len(looks) <= CHUNKS:
                self.sim.step()
                here = float(np.abs(system.u).max()) / size
                looks.append(here if np.isfinite(here) else np.inf)
                if not looks[-1] < ENOUGH * AMPLITUDE:
                    break
        return _judge(looks)


def _judge(looks: list[float]) -> Growth:
    if len(looks) <= CHUNKS:
        last = looks[-1] if np.isfinite(looks[-1]) else looks[-2]
        count = len(looks) - (1 if np.isfinite(looks[-1]) else 2)
        rate = (last / looks[0]) ** (1.0 / (CHUNK * max(1, count)))
        return Growth(False, rate, CHUNK * (len(looks) - 1))
    third = CHUNKS // 3
    first, last = max(looks[: third + 1]), max(looks[-third:])
    ratio = last / first
    return Growth(ratio < STABLE, ratio ** (1.0 / (CHUNK * 2 * third)), CHUNK * (len(looks) - 1))


def without_damping(model: Any, **changes: Any) -> Any:
    """A model without any damping but what `changes` give."""
    none: dict[str, Any] = {"point_damping": 0.0, "damping_ratio": None, "damping_at": None}
    none |= {"spring_damping": 0.0} if isinstance(model, MassSpring) else {"phi": 0.0, "eta": 0.0}
    return dataclasses.replace(model, **(none | changes))
