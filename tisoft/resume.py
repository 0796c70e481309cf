"""A running simulation into a checkpoint, and out of it again, bit by bit."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import checkpoint
from tisoft.errors import SceneError
from tisoft.gravity import gravity_at
from tisoft.motion import Motion
from tisoft.stable.guard import Recovery

COUNTERS = (
    "time", "frame", "substeps", "since_look", "next_look", "center_due", "wall_seconds",
    "half_step_lag", "meets", "origin",
)  # fmt: skip
ARRAYS = ("u", "v", "held", "drive", "load", "pressed")
"""The nodes' state; the last four, of the frame just made, tell reactions and velocities."""


def save(
    simulation: Motion, path: str | os.PathLike[str], *, notes: dict[str, Any] | None = None
) -> None:
    """Write the scene and the whole state of `simulation`, with a caller's notes (plain values)."""
    content = {
        "scene": simulation.scene,
        "precision": simulation.precision,
        "certify": simulation.certify,
        "numbers": {name: getattr(simulation, name) for name in COUNTERS},
        "pushing": simulation.pushing.state(),
        "recoveries": [vars(recovery) for recovery in simulation.recoveries],
        "limit": simulation.limit.state() if simulation.guard else None,
        "guard": simulation.guard.state() if simulation.guard else None,
        "ledger": simulation.account.state() if simulation.account else None,
        "watch": simulation.watch.state(),
        "notes": notes,
    }
    holder = simulation.holder
    state = (*simulation.system.motion(), holder.held, holder.drive, *simulation.system.loads())
    arrays: dict[str, NDArray[Any]] = {
        **dict(zip(ARRAYS, state, strict=True)),
        "shifts": np.array([part.shift for part in simulation.parts]),
        "steps": np.array(simulation.steps),
    }
    checkpoint.write(path, content, arrays)


def read(path: str | os.PathLike[str]) -> tuple[Any, dict[str, NDArray[Any]]]:
    """What `save` wrote.

    Raises:
        SceneError: a file that is missing or damaged.
    """
    return checkpoint.read(path)


def put(simulation: Motion, content: Any, arrays: dict[str, NDArray[Any]]) -> None:
    """Set a freshly made simulation of the same scene to a checkpoint's state."""
    system = simulation.system
    for name in ARRAYS:
        wanted = (system.count,) if name == "held" else (system.count, 3)
        if arrays[name].shape != wanted:
            raise SceneError(
                f"the checkpoint holds {len(arrays[name])} nodes and the scene {system.count}; "
                "run the scene anew"
            )
    for part, shift in zip(simulation.parts, arrays["shifts"], strict=True):
        part.shift = shift
    system.set_motion(arrays["u"], arrays["v"])
    simulation.holder.held, simulation.holder.drive = arrays["held"], arrays["drive"]
    simulation.holder.write()
    system.set_loads(arrays["load"])
    system.set_pressed(arrays["pressed"])
    for name in COUNTERS:
        setattr(simulation, name, content["numbers"][name])
    simulation.gravity_now = gravity_at(simulation.scene.gravity, simulation.time)
    simulation.steps = arrays["steps"].tolist()
    simulation.recoveries = [Recovery(**recovery) for recovery in content["recoveries"]]
    if content["limit"] is not None:
        simulation.limit.set_state(content["limit"])
    if simulation.guard is not None and content["guard"] is not None:
        simulation.guard.set_state(content["guard"])
    simulation.watch.set_state(content["watch"])
    if content["ledger"] is not None:
        simulation.open_account()
        assert simulation.account is not None
        simulation.account.set_state(content["ledger"])
    simulation.pushing.set_state(content["pushing"])
