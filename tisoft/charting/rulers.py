"""The ruler: pairs of a worse and a better answer, from cheap to dear, and what they give.

Quadratic tets on the scene's own mesh judge linear ones; two meshes of quadratic tets judge those.
Where a scene has no tets (a cage, nets of springs), its own element on a finer mesh has to do.
"""

from __future__ import annotations

from collections.abc import Iterator
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
    "the mesh is too large for quadratic tets within the budget: the ruler is a coarser twin of "
    "the shape; a larger --budget gives a sharper one"
)


@dataclass(frozen=True)
class Pair:
    """Two variants, and the range in which the truth lies beyond them."""

    worse: Variant
    better: Variant
    range_: tuple[float, float]
    told: str | None = None
    """A warning that goes with it."""


def pairs_of(catalogue: Catalogue, *, twin: bool) -> Iterator[Pair]:
    """Pairs from cheap to dear; `twin`: of coarser meshes than the scene's alone."""
    own = None
    if catalogue.springs and not catalogue.has_solid_twin:
        own = "spring", OWN_SPRINGS
    elif catalogue.tets(1.0 if not twin else 0.5) is None:
        own = catalogue.elements()[0], OWN_HEXES
    if own is not None:
        for factor in (1.5, 2.0):
            finer = catalogue.mesh(own[0], factor)
            if finer is not None:
                yield Pair(catalogue.current, finer, estimate.OWN_MODEL, own[1])
        return
    for fine in (0.5,) if twin else (1.0, 2.0):
        found = catalogue.tets(fine)
        if found is None:
            continue
        linear, quadratic = found
        told = TWIN if twin else None
        if fine != 2.0:
            yield Pair(linear, quadratic, estimate.SAME_MESH, told)
        coarser = catalogue.tets(0.5 * fine)
        if coarser is not None:
            yield Pair(coarser[1], quadratic, estimate.TWO_MESHES, told)


def ruler_of(worse: Any, better: Any, what: str, range_: tuple[float, float]) -> Ruler:
    """The ruler of "sag" or "frequency" from a worse and a better answer."""
    made = estimate.ruler(worse, better, range_)
    if what == "frequency":  # the bar of the root mean square of relative errors
        off = (np.asarray(better) - np.asarray(worse)) / made.value
        return Ruler(made.value, range_[1] * float(np.sqrt((off**2).mean())))
    return made


def agreed(old: Ruler, new: Ruler) -> Ruler:
    """The sharper of two rulers of one quantity; where they contradict each other, the new one,
    which rests on finer meshes, with their difference as its bar.
    """
    apart = new.error(old.value).value
    if apart > old.bar + new.bar:
        return Ruler(new.value, apart)
    return min(old, new, key=lambda ruler: ruler.bar)
