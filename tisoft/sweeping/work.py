"""One row of a sweep: a scene with settings, run, and its summary flattened into columns."""

from __future__ import annotations

import hashlib
import os
import pickle
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tisoft import runtime
from tisoft.changes import scene_with
from tisoft.errors import Diverged, TisoftError
from tisoft.scene import Scene
from tisoft.version import version

TIMES = (
    "wall_seconds", "compile_seconds", "start_seconds", "setup_seconds",
    "element_substeps_per_second", "real_time_factor",
)  # fmt: skip
"""Columns that the clock decides: they differ from run to run, all others do not."""


@dataclass(frozen=True)
class Job:
    """A row to compute, in this process or another."""

    source: str | Scene
    """The scene file, or a Scene."""
    settings: tuple[str, ...]
    arch: str = "cpu"
    precision: str | None = None
    threads: int | None = None

    def key(self) -> str:
        """What the row depends on, in 16 letters: the same content has the same key."""
        if isinstance(self.source, Scene):
            content = pickle.dumps(self.source)
        else:
            content = os.path.realpath(self.source).encode() + Path(self.source).read_bytes()
        told = repr((self.settings, self.arch, self.precision, version())).encode()
        return hashlib.sha256(content + told).hexdigest()[:16]


def compute(job: Job) -> dict[str, Any]:
    """The columns of a row; a failure is a row with its sentence."""
    try:
        made = _summary(job)
        return flat(made | {"recoveries": len(made["recoveries"])})
    except Diverged as error:
        return {"status": "diverged", "error": str(error)}
    except TisoftError as error:
        return {"status": "failed", "error": str(error)}
    except MemoryError:
        return {"status": "failed", "error": "the memory does not suffice; take a coarser mesh"}


def _summary(job: Job) -> dict[str, Any]:
    runtime.import_taichi()
    runtime.start(job.arch, threads=job.threads)

    from tisoft.check.limiting import limiting_element
    from tisoft.check.warnings import warnings_of
    from tisoft.observers.summary import summary
    from tisoft.simulation import Simulation

    scene = scene_with(job.source, job.settings)
    if job.precision:
        scene.precision = job.precision
    sim = Simulation(scene, arch=job.arch)
    limit, limiting, told = sim.limit.sharp(), limiting_element(sim), warnings_of(scene)
    sim.run()
    return summary(
        sim,
        status="done",
        stable_step=limit,
        limiting=limiting,
        wall_seconds=sim.wall_seconds,
        warnings=told,
    )


def flat(value: Any, name: str = "") -> dict[str, Any]:
    """Nested numbers as columns, as probes.tip.displacement.1; lists of texts are joined."""
    if isinstance(value, dict):
        parts: list[tuple[Any, Any]] = list(value.items())
    elif isinstance(value, Sequence) and not isinstance(value, str):
        if not value or any(isinstance(item, str) for item in value):
            return {name: " | ".join(map(str, value))}
        parts = list(enumerate(value))
    else:
        return {name: value}
    found: dict[str, Any] = {}
    for key, item in parts:
        found |= flat(item, f"{name}.{key}" if name else str(key))
    return found
