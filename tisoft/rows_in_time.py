"""Rows in time (paths, tables, gravity) that are finer than a substep, as sentences."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from tisoft.gravity import changes
from tisoft.scene import Scene


def coarse_rows(scene: Scene, step: float) -> Iterator[str]:
    """Sentences about rows that are closer together than substeps of `step` [s]."""
    for name, rows in _rows_of(scene):
        times = np.array([row[0] for row in rows])
        apart = np.diff(times[times <= scene.duration])
        if len(apart) and apart.min() < step * (1.0 - 1e-9):
            row = int(np.argmin(apart))
            yield (
                f"{name} has rows {apart.min():.3g} s apart, as [{row}] and [{row + 1}], finer "
                f"than the substep of {step:.3g} s: its impulse, or where it leads to, is kept, "
                f"and what is between is not seen; give step = {apart.min():.2g} or less to see it"
            )


def _rows_of(scene: Scene) -> Iterator[tuple[str, Any]]:
    """All rows in time with their names."""
    if changes(scene.gravity):
        yield "gravity", scene.gravity
    for i, body in enumerate(scene.bodies):
        for k, pin in enumerate(body.pins):
            if pin.path is not None:
                yield f"body[{i}].pin[{k}].path", pin.path
        for k, load in enumerate(body.loads):
            if load.table is not None:
                yield f"body[{i}].load[{k}].table", load.table
    for i, obstacle in enumerate(scene.obstacles):
        if obstacle.path is not None:
            yield f"obstacle[{i}].path", obstacle.path
