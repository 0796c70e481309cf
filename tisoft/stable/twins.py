"""Bodies that are another one turned, moved or mirrored: their limits at rest are the same.

y = x R + t,   RᵀR = I, from the singular values of the centred points' XᵀY = U Σ Vᵀ: R = U Vᵀ
                                                                    (Kabsch 1976)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.model.part import Part

Floats = NDArray[np.float64]

ROUNDING = 1e-9
"""Relative difference that is none: of places, of masses and of volumes."""


def first_twins(parts: list[Part]) -> list[Part]:
    """For each body the first one that is its twin, which may be itself."""
    kinds: dict[Any, list[Part]] = {}
    found = []
    for part in parts:
        counts = tuple(len(cells.nodes) for cells in part.solids)
        known = kinds.setdefault((type(part.body.model), len(part.order), counts), [])
        twin = next((other for other in known if are_twins(other, part)), part)
        if twin is part:
            known.append(part)
        found.append(twin)
    return found


def are_twins(one: Part, other: Part) -> bool:
    """Whether two bodies without pins differ in place only."""
    if one.body.pins or other.body.pins or one.body.model != other.body.model:
        return False
    if [c.model for c in one.solids] != [c.model for c in other.solids]:
        return False
    same = all(np.array_equal(a, b) for a, b in zip(_joined(one), _joined(other), strict=True))
    close = same and all(
        _is_close(a, b) for a, b in zip(_numbers(one), _numbers(other), strict=True)
    )
    return close and _is_turned(one.rest[one.rank], other.rest[other.rank])


def _joined(part: Part) -> list[NDArray[np.int64]]:
    """Which points each cell, and each spring, joins, in the mesh's own order."""
    cells = [part.order[cells.nodes][np.argsort(cells.order)] for cells in part.solids]
    return [*cells, part.order[part.springs]]


def _numbers(part: Part) -> list[Floats]:
    """Masses, volumes and springs' numbers, in the mesh's own order."""
    volumes = [cells.volume[np.argsort(cells.order)] for cells in part.solids]
    return [part.mass[part.rank], *volumes, part.spring_numbers]


def _is_close(a: Floats, b: Floats) -> bool:
    return a.shape == b.shape and np.allclose(a, b, rtol=ROUNDING, atol=0.0)


def _is_turned(x: Floats, y: Floats) -> bool:
    x, y = x - x.mean(axis=0), y - y.mean(axis=0)
    left, _, right = np.linalg.svd(x.T @ y)
    return bool(np.abs(x @ (left @ right) - y).max() <= ROUNDING * np.abs(x).max())
