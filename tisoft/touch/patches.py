"""Patches: runs of points, triangles and edges that lie beside each other, a body each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.topology import morton_order
from tisoft.touch.surface import Surface

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SIZE = 16
"""Points, triangles or edges of a patch at the most."""


def sorted_surface(surface: Surface, x: Floats, owner: Ints) -> Surface:
    """The surface with triangles and edges by body, and along a Morton curve in each.

    Args:
        surface, x: a surface and the places of its points [m].
        owner: number of each point's body; a triangle's is that of its first corner.
    """
    faces = _along(x[surface.triangles].mean(axis=1), owner[surface.triangles[:, 0]])
    edges = _along(x[surface.edges].mean(axis=1), owner[surface.edges[:, 0]])
    return replace(
        surface,
        triangles=surface.triangles[faces],
        owned=surface.owned[faces],
        across=surface.across[faces],
        edges=surface.edges[edges],
        sides=surface.sides[edges],
    )


def _along(middles: Floats, owner: Ints) -> Ints:
    """The order of what has these middles and bodies."""
    rank = np.empty(len(middles), np.int64)
    rank[morton_order(middles)] = np.arange(len(middles))
    return np.lexsort([rank, owner])


def patches_of(owner: Ints) -> Ints:
    """First row, end and body of each patch of what has these bodies (ascending), (patches, 3)."""
    if not len(owner):
        return np.empty((0, 3), np.int64)
    change = np.flatnonzero(np.diff(owner)) + 1
    found = []
    for begin, end in zip([0, *change], [*change, len(owner)], strict=True):
        starts = np.arange(begin, end, SIZE)
        ends = np.minimum(starts + SIZE, end)
        found.append(np.stack([starts, ends, owner[starts]], axis=1))
    return np.concatenate(found).astype(np.int64)


def ranges_of(patches: Ints, bodies: int) -> Ints:
    """Where each body's patches begin and end, shape (bodies, 2)."""
    numbers = np.arange(bodies)
    low = np.searchsorted(patches[:, 2], numbers)
    return np.stack([low, np.searchsorted(patches[:, 2], numbers, side="right")], axis=1)
