"""A running simulation into a checkpoint, and out of it again, bit by bit."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tisoft import checkpoint, runtime
from tisoft.dynamics.guard import Recovery
from tisoft.errors import SceneError

if TYPE_CHECKING:
    from tisoft.simulation import Simulation

COUNTERS = ("time", "frame", "substeps", "wall_seconds", "compile_seconds", "start_seconds",
            "half_step_lag")  # fmt: skip

STATE = ("u", "v", "held", "load", "pressed")
"""The system's arrays; the last three, of the frame just made, tell reactions and velocities."""


def save(
    simulation: Simulation, path: str | os.PathLike[str], *, notes: dict[str, Any] | None = None
) -> None:
    """Write the scene and the whole state of `simulation`, with a caller's notes (plain values)."""
    system = simulation.system
    numbers = {name: getattr(simulation, name) for name in COUNTERS}
    recoveries = [vars(recovery) for recovery in simulation.recoveries]
    content = {
        "scene": simulation.scene,
        "precision": simulation.precision,
        "certify": simulation.certify,
        "numbers": numbers,
        "recoveries": recoveries,
        "limit": simulation.limit.state() if simulation.guard else None,
        "guard": simulation.guard.state() if simulation.guard else None,
        "ledger": simulation.account.state() if simulation.account else None,
        "watch": simulation.watch.state(),
        "notes": notes,
    }
    arrays = {
        **{name: runtime.read(getattr(system, name)) for name in STATE},
        "shifts": np.array([part.shift for part in simulation.parts]),
        "steps": np.array(simulation.steps),
    }
    checkpoint.write(path, content, arrays)


def load(path: str | os.PathLike[str], *, arch: str = "cpu", threads: int | None = None) -> Any:
    """The simulation that `save` wrote, ready to go on.

    Raises:
        SceneError: a file that is missing or damaged.
    """
    from tisoft.simulation import Simulation

    content, arrays = checkpoint.read(path)
    with checkpoint.damage_told(path):
        simulation = Simulation(
            content["scene"],
            arch=arch,
            precision=content["precision"],
            certify=content["certify"],
            threads=threads,
        )
        put(simulation, content, arrays)
    return simulation


def put(simulation: Simulation, content: Any, arrays: dict[str, NDArray[Any]]) -> None:
    """Set a freshly made simulation of the same scene to a checkpoint's state."""
    system = simulation.system
    wanted = (system.count, 3)
    if arrays["u"].shape != wanted or arrays["v"].shape != wanted:
        raise SceneError(
            f"the checkpoint holds {len(arrays['u'])} nodes and the scene {system.count}; "
            "run the scene anew"
        )
    for part, shift in zip(simulation.parts, arrays["shifts"], strict=True):
        part.shift = shift
    for name in STATE:
        runtime.write(getattr(system, name), arrays[name])
    for name in COUNTERS:
        setattr(simulation, name, content["numbers"][name])
    simulation.steps = arrays["steps"].tolist()
    simulation.recoveries = [Recovery(**recovery) for recovery in content["recoveries"]]
    if content["limit"] is not None:
        simulation.limit.set_state(content["limit"])
    if simulation.guard is not None and content["guard"] is not None:
        simulation.guard.set_state(content["guard"])
    simulation.watch.set_state(content["watch"])
    simulation.ledger = content["ledger"] is not None
    if simulation.account is not None:
        simulation.account.set_state(content["ledger"])
    simulation.limit.moved()
    simulation.place_obstacles()
