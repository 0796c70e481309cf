"""Arrays as kernels take them: NumPy's own memory on the CPU, the device's elsewhere."""

from __future__ import annotations

from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.render.batch import Batch

TYPES = {"float32": ti.f32, "int32": ti.i32, "int64": ti.i64, "uint8": ti.u8}


def device(values: NDArray[Any], *, vectors: bool = False) -> Any:
    """The array for a kernel; with `vectors` its last axis holds vectors."""
    if runtime.on_cpu():
        return values
    kind = TYPES[values.dtype.name]
    if vectors:
        out = ti.Vector.ndarray(values.shape[-1], kind, values.shape[:-1])
    else:
        out = ti.ndarray(kind, values.shape)
    out.from_numpy(np.ascontiguousarray(values))
    return out


def host(values: Any) -> NDArray[Any]:
    """A NumPy array of what `device` made; on the CPU the memory itself, not a copy."""
    if isinstance(values, np.ndarray):
        return values
    out: NDArray[Any] = values.to_numpy()
    return out


class Shown:
    """A batch's arrays on the device."""

    def __init__(self, batch: Batch) -> None:
        self._batch = batch
        self.primitives = device(batch.primitives, vectors=True)
        self.corner_starts = device(batch.corner_starts)
        self.corners = device(batch.corners)
        self.vertices = device(batch.vertices, vectors=True)
        self.stage: Any = None

    def update(self, stage: NDArray[np.float32]) -> None:
        """Bring the vertices and the stage's rows up to date."""
        self.stage = device(stage, vectors=True)
        if not runtime.on_cpu():
            self.vertices.from_numpy(self._batch.vertices)
