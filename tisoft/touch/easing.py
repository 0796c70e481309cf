"""Bodies that begin inside each other or in obstacles: how deep, and how they come out gently.

    D(t) = D₀ max(1 − (t − t₀)/T, 0)

For the time T they count as thinner by D (see `rows`), so that they are pushed out at the speed
D₀/T, whatever the step; what pushes is work from outside.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.touch import fields as f

Floats = NDArray[np.float64]

LEAST = 1e-6
"""Of the least thickness: what is not so deep is not pushed."""


@dataclass(frozen=True)
class Easing:
    """Which bodies come out of which."""

    began: float
    seconds: float
    """When it began, and how long it takes [s]."""
    deep: list[tuple[int, int, float]]
    """Two bodies or obstacles (`Touching.ranges`), and their depth D₀ [m]."""

    def left(self, time: float) -> float:
        """Share of the depths that is left."""
        return max(1.0 - (time - self.began) / self.seconds, 0.0)


def measured(touching: Any, measure: Any) -> list[tuple[int, int, float]]:
    """How deep bodies are inside each other or obstacles by the pairs that can push them out.

    Args:
        touching: the scene's `Touching`.
        measure: lists pairs and writes depths (`meeting.make_depths`).
    """
    _write(touching, bounds(touching), 0.0, 0.0)
    measure()
    count = len(touching.ranges)
    depths = np.zeros(count * count, touching.system.real)
    touching.fields.read_sunk(touching.lease.starts["couples"], depths)
    least = LEAST * min(toucher.thickness for toucher in touching.touchers)
    b, c = np.nonzero(np.triu(depths.reshape(count, count)) > least)
    set_easing(touching, None, 0.0)
    return [(int(i), int(j), float(depths[i * count + j])) for i, j in zip(b, c, strict=True)]


def set_easing(touching: Any, easing: Easing | None, time: float) -> None:
    """Let the kernels know what is pushed out, as it is at `time` [s]."""
    count = len(touching.ranges)
    depths = np.zeros((count, count))
    for b, c, depth in easing.deep if easing is not None else []:
        depths[b, c] = depths[c, b] = depth
    rate = 0.0 if easing is None else 1.0 / easing.seconds
    _write(touching, depths, 0.0 if easing is None else easing.left(time), rate)


def set_left(touching: Any, easing: Easing, time: float) -> None:
    """Let the kernels know what is left at `time` [s]."""
    touching.fields.length[touching.scene, f.LEFT] = easing.left(time)


def _write(touching: Any, depths: Floats, left: float, rate: float) -> None:
    fields, scene = touching.fields, touching.scene
    values = np.ascontiguousarray(depths.ravel(), dtype=touching.system.real)
    fields.write_sunk(touching.lease.starts["couples"], values)
    for column, value in ((f.SUNK, depths.max()), (f.LEFT, left), (f.RATE, rate)):
        fields.length[scene, column] = float(value)
    touching.forget()


def bounds(touching: Any) -> Floats:
    """Depth [m] up to which two bodies can push each other out: by the faces of either, and no
    deeper than half an edge of the other.
    """
    own = [t.surface.depth or 0.5 * t.surface.edge for t in touching.touchers]
    half = [0.5 * t.surface.edge for t in touching.touchers]
    for standing in touching.owners:
        meets = standing.is_met_by_nodes and standing.surface is not None
        own.append(standing.surface.depth if meets else 0.0)
        half.append(np.inf)
    most = np.minimum(np.array(own)[:, None], np.array(half)[None])
    return np.maximum(most, most.T)
