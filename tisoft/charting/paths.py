"""Paths of a scene's places, run with several variants: how far they part.

e = √⟨|u − u_ref|²⟩ / A,   A = half of what the reference's path extends over
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tisoft.charting.records import Bench
from tisoft.charting.variants import Variant

Floats = NDArray[np.float64]

PART = 0.5
"""Share of the amplitude by which paths are apart that have parted."""


class Paths:
    """The paths on a bench."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    def has(self, variant: Variant) -> bool:
        """Whether the variant was run."""
        return "path" in self._bench.record(variant).get("path", {})

    def of(self, variant: Variant) -> Floats:
        """Displacements [m], shape (frames, places, 3)."""
        return np.asarray(self._bench.record(variant)["path"]["path"], np.float64)

    def error(self, variant: Variant, reference: Variant) -> float | None:
        """Root mean square over time and places, relative to the amplitude; None without motion."""
        a, b = self.of(variant), self.of(reference)
        amplitude = _amplitude(b)
        if a.shape != b.shape or amplitude == 0.0:
            return None
        return float(np.sqrt(((a - b) ** 2).sum(axis=2).mean()) / amplitude)

    def parting(self, variant: Variant, reference: Variant, rate: float) -> float | None:
        """Time [s] at which two paths part; `rate`: frames a second."""
        a, b = self.of(variant), self.of(reference)
        if a.shape != b.shape:
            return None
        off = np.sqrt(((a - b) ** 2).sum(axis=2).mean(axis=1))
        apart = np.flatnonzero(off > PART * _amplitude(b))
        return float(apart[0] / rate) if len(apart) else None


def _amplitude(path: Floats) -> float:
    return float(0.5 * np.linalg.norm(np.ptp(path, axis=0), axis=1).max(initial=0.0))
