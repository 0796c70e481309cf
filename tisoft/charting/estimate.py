"""The ruler, and errors against it with their bars.

With T10 the answer of quadratic tets on a mesh and T4 that of linear ones on the same tets, the
truth is T10 + β (T10 − T4), 0 ≤ β ≤ 0.12; with quadratic tets on two meshes, the coarser C and the
finer F, it is F + γ (F − C), 0 ≤ γ ≤ 1.3.  Both ranges were measured on shapes whose continuum
values are known: beams, Poisson's ratio .49 among them, a bracket, a taper, an arc.  The middle of
the range is the ruler, and its half is the ruler's bar, everything relative to the ruler.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SAME_MESH = (0.06, 0.06)
"""β: middle and half of its range."""
TWO_MESHES = (0.65, 0.65)
"""γ: middle and half of its range."""
OWN_MODEL = (0.33, 0.67)
"""The same for springs, which have nothing better than themselves on a finer mesh: order 2 or 1."""
ROUNDING = {"f32": 1e-4, "f64": 1e-9}
"""Relative error that the precision alone may leave."""


@dataclass(frozen=True)
class Error:
    """A relative error and its own uncertainty."""

    value: float
    bar: float

    @property
    def below(self) -> bool:
        """Whether the bar hides it: all that is known is that it is smaller than `most`."""
        return self.value <= self.bar

    @property
    def most(self) -> float:
        """The error with its bar."""
        return self.value + self.bar


@dataclass(frozen=True)
class Ruler:
    """What a quantity would be without an error of the mesh."""

    value: Floats
    """The quantity, of any shape."""
    bar: float
    """Relative uncertainty."""

    def error(self, value: Any) -> Error:
        """The relative error of another answer."""
        off = np.asarray(value, np.float64) - self.value
        return Error(_norm(off) / max(_norm(self.value), 1e-300), self.bar)


def _norm(values: Floats) -> float:
    return float(np.sqrt((np.asarray(values) ** 2).sum()))


def ruler(coarse: Any, fine: Any, range_: tuple[float, float]) -> Ruler:
    """The ruler from a worse and a better answer, by one of the ranges above."""
    worse, better = (np.asarray(v, np.float64) for v in (coarse, fine))
    middle, half = range_
    value = better + middle * (better - worse)
    return Ruler(value, half * _norm(better - worse) / max(_norm(value), 1e-300))


def frequency_error(own: list[float], truth: Ruler) -> Error:
    """Root mean square of the modes' relative errors."""
    off = np.asarray(own) / truth.value - 1.0
    return Error(float(np.sqrt((off**2).mean())), truth.bar)


def path_error(sag: Error | None, frequency: Error, first: float, duration: float) -> Error:
    """Predicted: A (1 − cos ωt) of a sudden load, against A (1 + e_s), ω (1 + e_f); root mean
    square over the duration relative to its amplitude.
    """
    amplitude = 0.0 if sag is None else sag.value

    def rms(e_s: float, e_f: float) -> float:
        periods = max(first * duration, 1e-9)
        t = np.linspace(0.0, 2.0 * math.pi * periods, min(20000, 64 + int(64 * periods)))
        off = (1.0 + e_s) * (1.0 - np.cos((1.0 + e_f) * t)) - (1.0 - np.cos(t))
        return float(np.sqrt((off**2).mean()))

    value = rms(-amplitude, frequency.value)
    high = rms(-(amplitude + (0.0 if sag is None else sag.bar)), frequency.most)
    return Error(value, max(abs(high - value), 0.3 * value))
