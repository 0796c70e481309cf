"""The ruler, and errors against it with their bars.

From a worse answer C and a better one F the truth is F + γ (F − C), γ within a range:

    quadratic tets against linear ones on the same tets   −.04 … .22
        nearly incompressible: ν above .35                0 … .6
    quadratic tets on cells of half the size              0 … 1.3
        nearly incompressible                             −.3 … 1.3
    the same where a third mesh, coarser still, shows them converge: r = D'·D/|D|² of the two
    differences D (from it to C), D' (from C to F)        .05 … 1.2 r/(1 − r), from .65 to 1.3
    springs, cages on cells of half the size              −.33 … 1 (order 2 or 1)
    quadratic tets on four meshes or more                 what each two with the finest foretell,
                                                          and .1 more to both sides
    balls, cylinders                                      see `curves`

measured on shapes whose continuum values are known or were computed on finer meshes: beams, a
twisted bar, blocks and plates clamped at a side, Poisson's ratio .49 among them, a bracket, a
taper, an arc.  Cells of another ratio ρ than a half scale γ by (2^1.8 − 1)/(ρ^1.8 − 1).  The
middle of the range is the ruler, and its half is the ruler's bar, everything relative to the ruler.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

Range = tuple[float, float]
"""Middle and half of a range of γ."""
SAME_MESH: tuple[Range, Range] = (0.09, 0.13), (0.3, 0.3)
TWO_MESHES: tuple[Range, Range] = (0.65, 0.65), (0.5, 0.8)
"""Of compressible and of nearly incompressible materials."""
COMPRESSIBLE = 0.35
"""The largest Poisson's ratio of the former."""
OWN_MODEL: Range = (0.33, 0.67)
"""For springs and cages, which have nothing better than themselves on a finer mesh."""
ORDERS, MORE = (0.7, 4.0), 0.1
"""Orders of errors that meshes show where they converge, and what is added to the bar of four
meshes or more: a share of what the last halving changes."""
SWINGING: Range = (0.0, 0.5)
"""Where the differences of three meshes point to opposite sides; those of nearly incompressible
bodies tell then what the finer two do."""
ORDER = 1.8
LEAST, MOST_CERTAIN, MOST = 0.05, 0.65, 1.3
"""Ends of the range of three meshes."""
CONVERGING = 0.6
"""The largest r that tells anything."""
ASIDE = 0.5
"""Share of what the second difference points aside of the first by, that adds to the bar."""
COMPARED = (1.3, 2.6)
"""Ratios of cells for which three meshes are compared."""
FORETOLD = 0.7, 1.5
"""The least order of errors of frequencies of quadratic tets with lumped masses, measured on beams,
plates and blocks of any Poisson's ratio, on cells of ratios from 1.3 on; and a usual one."""
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
        """The relative error of another answer: |u − t|/|t|, which is off by |u|/|t| of what t is
        off by, wherever that points.
        """
        own = np.asarray(value, np.float64)
        size = max(_norm(self.value), 1e-300)
        return Error(_norm(own - self.value) / size, self.bar * _norm(own) / size)


def _norm(values: Floats) -> float:
    return float(np.sqrt((np.asarray(values) ** 2).sum()))


def ruler(coarse: Any, fine: Any, range_: Range, ratio: float = 2.0) -> Ruler:
    """The ruler from a worse and a better answer, by one of the ranges above.

    Args:
        coarse: the worse answer.
        fine: the better one.
        range_: of γ where cells are halved.
        ratio: of their cells.
    """
    worse, better = (np.asarray(v, np.float64) for v in (coarse, fine))
    middle, half = scaled(range_, ratio)
    value = better + middle * (better - worse)
    return Ruler(value, half * _norm(better - worse) / max(_norm(value), 1e-300))


def scaled(range_: Range, ratio: float) -> Range:
    """A range of γ for cells of another ratio than a half."""
    share = (2.0**ORDER - 1.0) / max(ratio**ORDER - 1.0, 0.05)
    return range_[0] * share, range_[1] * share


def ruler_of_three(
    answers: Sequence[Any],
    ratio: float = 2.0,
    before: float = 2.0,
    two: Range = TWO_MESHES[0],
) -> Ruler:
    """The ruler from answers on three meshes, from coarse to fine, as far as they converge.

    Args:
        answers: a quantity on each, of any shape.
        ratio: of the cells of the last two.
        before: of the cells of the first two.
        two: the range of γ by the finer two alone.
    """
    coarse, middle, fine = (np.asarray(v, np.float64) for v in answers)
    first, second = middle - coarse, fine - middle
    r = float((first * second).sum()) / max(_norm(first) ** 2, 1e-300)
    if r < -LEAST and two == TWO_MESHES[1]:
        return ruler(middle, fine, two, ratio)
    about, half = scaled(converging(halved(r, before, ratio)), ratio)
    value = fine + about * second
    aside = ASIDE * _norm(second - r * first)
    bar = half * _norm(second) + (aside if r < CONVERGING else 0.0)
    return Ruler(value, bar / max(_norm(value), 1e-300))


def halved(r: float, before: float, ratio: float) -> float:
    """The ratio of two differences as it would be with cells halved twice: 2⁻ᵖ, where p is the
    order of errors by which

        r = (ρ₂ᵖ − 1)/(ρ₂ᵖ (ρ₁ᵖ − 1)),   ρ₁ before and ρ₂ ratio
    """
    return r if r <= 0.0 else 2.0 ** -_order(r, before, ratio)


def _order(r: float, before: float, ratio: float) -> float:
    """The order p of errors that a ratio of two differences shows."""
    low, high = 0.05, 8.0
    for _ in range(30):
        p = 0.5 * (low + high)
        is_lower = (1.0 - ratio**-p) / (before**p - 1.0) > r
        low, high = (p, high) if is_lower else (low, p)
    return low


def ruler_of_many(answers: Sequence[Any], ratios: Sequence[float]) -> Ruler | None:
    """The ruler from answers on four meshes or more: the middle between what each two foretell with
    the finest.  None where the order that some show is not one of convergence.

    Args:
        answers: a quantity on each, of any shape, from coarse to fine.
        ratios: of the cells of each to those of the finest.
    """
    *coarse, fine = (np.asarray(v, np.float64) for v in answers)
    beyond = []
    for (a, before), (b, ratio) in combinations(zip(coarse, ratios, strict=False), 2):
        first, second = b - a, fine - b
        r = float((first * second).sum()) / max(_norm(first) ** 2, 1e-300)
        p = _order(r, before / ratio, ratio)
        if not ORDERS[0] < p < ORDERS[1]:
            return None
        beyond.append(fine + second / (ratio**p - 1.0))
    value = 0.5 * (np.max(beyond, axis=0) + np.min(beyond, axis=0))
    last, ratio = min(zip(coarse, ratios, strict=False), key=lambda of: abs(of[1] - 2.0))
    apart = max(_norm(one - value) for one in beyond)
    bar = apart + scaled((0.0, MORE), ratio)[1] * _norm(fine - last)
    return Ruler(value, bar / max(_norm(value), 1e-300))


def converging(r: float) -> Range:
    """The range of γ by the ratio of two differences."""
    if r > CONVERGING:
        return TWO_MESHES[0]
    if r < -LEAST:
        return SWINGING
    high = min(max(1.2 * r / (1.0 - r), MOST_CERTAIN), MOST)
    return 0.5 * (LEAST + high), 0.5 * (high - LEAST)


def frequency_error(own: list[float], truth: Ruler) -> Error:
    """Root mean square of the modes' relative errors."""
    ratios = np.asarray(own) / truth.value
    return Error(float(np.sqrt(((ratios - 1.0) ** 2).mean())), truth.bar * float(ratios.max()))


def foretold(error: Error, ratio: float) -> Error:
    """What the frequencies of quadratic tets err by on finer cells, which were not solved.

    Args:
        error: on the coarser ones.
        ratio: of the cells.
    """
    value = error.value * ratio ** -FORETOLD[1]
    return Error(value, error.most * ratio ** -FORETOLD[0] - value)


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
