"""The ruler: pairs of a worse and a better answer, from cheap to dear, and what they give.

Quadratic tets on the scene's own mesh judge linear ones; two meshes of quadratic tets judge those.
Where a scene has no tets (a cage, nets of springs), its own element on a finer mesh has to do.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tisoft.charting import estimate
from tisoft.charting.estimate import Ruler
from tisoft.charting.variants import Catalogue, Variant

OWN_SPRINGS = (
    "the ruler is the same springs on a finer mesh: what springs err by as a model of the "
    "material is not counted"
)
OWN_HEXES = (
    "the ruler is the same hexahedra, finer: what the shape of their cells errs by is counted "
    "only as far as it shrinks with them"
)
TWIN = (
    "the mesh is too large for quadratic tets within the time: the ruler is a coarser twin of the "
    "shape; a chart with a larger --budget has a sharper one"
)
LEAST_RATIO = 1.1
"""Of the cells of two meshes, along the side where it is the least, that tells anything."""

ALIKE = 1.15
"""The most by which ratios of the cells of two meshes differ from one axis to another, where both
are of one family."""
FURTHEST = 4.2
"""Ratio of cells to the finest of a family, beyond which a mesh tells nothing of it."""


@dataclass(frozen=True)
class Pair:
    """Two variants, and the range in which the truth lies beyond them."""

    worse: Variant
    better: Variant
    range_: estimate.Range
    told: str | None = None
    """A warning that goes with it."""
    ratio: float = 2.0
    """Of their cells."""
    coarser: Variant | None = None
    """A third one, worse than both, which tells whether they converge."""
    before: float = 2.0
    """The ratio of its cells to those of the worse one."""
    last: bool = False
    """Whether there is nothing cheaper."""


def pairs_of(catalogue: Catalogue, *, twin: bool) -> Iterator[Pair]:
    """Pairs from cheap to dear; `twin`: of coarser meshes than the scene's alone."""
    own = None
    if catalogue.springs and not catalogue.has_solid_twin:
        own = "spring", OWN_SPRINGS
    elif catalogue.tets(1.0 if not twin else 0.5) is None:
        own = catalogue.elements()[0], OWN_HEXES
    if own is not None:
        for coarse, fine in ((1.0, 1.5), (1.0, 2.0), (1.5, 3.0), (2.0, 4.0)):
            worse = catalogue.current if coarse == 1.0 else catalogue.mesh(own[0], coarse)
            finer = catalogue.mesh(own[0], fine)
            if worse is not None and finer is not None:
                ratio = catalogue.ratio(coarse, fine)
                yield Pair(worse, finer, estimate.OWN_MODEL, own[1], ratio)
        return
    told = TWIN if twin else None
    for fine in (0.75, 0.5) if twin else (1.0, 1.5, 2.0, 3.0, 4.0):
        found = catalogue.tets(fine)
        if found is None:
            continue
        coarser = catalogue.tets(0.5 * fine)
        # Linear and quadratic tets on one mesh do not see how it cuts the corners of a curve.
        if fine <= 1.0 and not (catalogue.is_curved and coarser):
            range_ = estimate.SAME_MESH[catalogue.poisson > estimate.COMPRESSIBLE]
            yield Pair(*found, range_, told, last=fine == 0.5)
        if coarser is not None:
            pair = _of_meshes(catalogue, fine, told, last=fine == 0.5)
            if pair.ratio > LEAST_RATIO:
                yield pair


def _of_meshes(catalogue: Catalogue, fine: float, told: str | None, *, last: bool) -> Pair:
    """Quadratic tets on cells of a factor, on those twice as large, and on still larger ones."""
    levels = [catalogue.tets(share * fine) for share in (1.0, 0.5, 0.25)]
    better, worse, coarsest = (None if level is None else level[1] for level in levels)
    assert better is not None and worse is not None
    ratios = [catalogue.ratio(0.5 * share * fine, share * fine) for share in (1.0, 0.5)]
    low, high = estimate.COMPARED
    if not all(low < ratio < high for ratio in ratios):
        coarsest = None
    range_ = estimate.TWO_MESHES[catalogue.poisson > estimate.COMPRESSIBLE]
    return Pair(worse, better, range_, told, ratios[0], coarsest, ratios[1], last)


def ruler_of(what: str, answers: Sequence[Any], pair: Pair) -> Ruler:
    """The ruler of "sag" or "frequency".

    Args:
        what: the quantity.
        answers: of the pair's variants from worse to better, two or three.
        pair: that they are of.
    """
    if what == "frequency":  # each mode by itself
        return _of_modes([_ruler([a[k] for a in answers], pair) for k in range(len(answers[0]))])
    return _ruler(answers, pair)


def ratios_of_family(catalogue: Catalogue, factors: Sequence[float]) -> dict[float, float]:
    """Ratios of cells to those of the finest factor, by factor from coarse to fine: of meshes whose
    cells are the finest ones' but for their size."""
    finest, found = max(factors), {}
    for factor in sorted(factors):
        least, most = catalogue.ratios(factor, finest)
        is_new = factor == finest or LEAST_RATIO < least <= FURTHEST
        if is_new and most <= ALIKE * least:
            found[factor] = math.sqrt(least * most)
    return found


def ruler_of_family(what: str, answers: Sequence[Any], ratios: Sequence[float]) -> Ruler | None:
    """The ruler of "sag" or "frequency" from quadratic tets on four meshes or more, from coarse to
    fine; None where they do not show that they converge."""
    if what != "frequency":
        return estimate.ruler_of_many(answers, ratios)
    modes = [estimate.ruler_of_many(mode, ratios) for mode in zip(*answers, strict=True)]
    known = [mode for mode in modes if mode is not None]
    return _of_modes(known) if len(known) == len(modes) else None


def _of_modes(modes: Sequence[Ruler]) -> Ruler:
    """One ruler of several modes, whose bar is that of the root mean square."""
    value = np.array([float(mode.value) for mode in modes])
    return Ruler(value, float(np.sqrt(np.mean([mode.bar**2 for mode in modes]))))


def _ruler(answers: Sequence[Any], pair: Pair) -> Ruler:
    if len(answers) == 3:
        return estimate.ruler_of_three(answers, pair.ratio, pair.before, pair.range_)
    return estimate.ruler(answers[0], answers[1], pair.range_, pair.ratio)


def agreed(old: Ruler, new: Ruler) -> Ruler:
    """The sharper of two rulers of one quantity; where they contradict each other, the new one,
    which rests on finer meshes, with their difference as its bar.
    """
    apart = new.error(old.value).value
    if apart > old.bar + new.bar:
        return Ruler(new.value, apart)
    return min(old, new, key=lambda ruler: ruler.bar)
