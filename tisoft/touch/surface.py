"""The surface of a body as contact sees it: index tables and lengths, NumPy only.

A point nearest to an edge or a corner that several triangles share makes one contact, not one a
triangle: every edge and corner has one owner (Curtis, Tamstorf and Manocha 2008, representative
triangles).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

SHARP = 30.0
"""Angle [degrees] by which a solid's faces turn at an edge that meets other edges."""
THIN = 0.9
"""Times volume/area: depth up to which a point inside belongs to the face that it is behind (half
the thickness of a slab is volume/area)."""
DEPTH = 0.5
"""The same, in edges: deeper ones have no nearest face that neighbours agree on."""

MOST_PIECES = 400
"""Into which an obstacle's edge is cut."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles of a surface and what is around them; numbers count its own points."""

    points: NDArray[np.int64]
    """Node (internal, from the body's first) of each point."""
    triangles: Ints
    """Points of each triangle, seen counter-clockwise from outside, shape (triangles, 3)."""
    owned: Ints
    """Bits of each triangle: 1 << k, the edge opposite corner k is its own; 8 << k, corner k is."""
    across: Ints
    """Far corner of the triangle across the edge opposite corner k; −1 where the surface ends."""
    fan_start: Ints
    """Where each point's rows of `fan` begin, shape (points + 1,)."""
    fan: Ints
    """The other two corners of each triangle around a point, in the triangle's sense."""
    edges: Ints
    """Ends of the edges that meet other edges, shape (edges, 2)."""
    sides: Ints
    """Far corners (the side's own sense, −1 for none) of an edge's two triangles: the first has
    the edge in its order, the second against it; shape (edges, 2)."""
    edge: float
    """Median length of all edges [m]."""
    longest: float
    """The longest [m]."""
    depth: float
    """Depth [m] up to which a point inside is pushed out through the face that it is behind."""
    is_solid: bool


def surface_of(triangles: NDArray[np.integer], rest: Floats, volume: float) -> Surface:
    """The surface with these triangles between nodes at `rest` [m]; `volume` [m³] inside of it, 0
    for sheets.
    """
    points, rows = np.unique(triangles, return_inverse=True)
    rows = rows.reshape(-1, 3).astype(np.int64)
    x = rest[points]
    is_solid = volume > 0.0
    half = np.concatenate([rows[:, [1, 2]], rows[:, [2, 0]], rows[:, [0, 1]]])
    far, owner = rows.T.ravel(), np.tile(np.arange(len(rows)), 3)
    ends, first, inverse, count = np.unique(
        np.sort(half, axis=1), axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    inverse = inverse.reshape(-1)
    across = _across(inverse, count, far)
    owned = np.zeros(len(rows), np.int64)
    np.bitwise_or.at(owned, owner[first], 1 << (first // len(rows)))
    _, corner = np.unique(far, return_index=True)
    np.bitwise_or.at(owned, owner[corner], 8 << (corner // len(rows)))
    order = np.argsort(far, kind="stable")
    starts = np.searchsorted(far[order], np.arange(len(points) + 1))
    lengths = np.linalg.norm(x[ends[:, 0]] - x[ends[:, 1]], axis=1)
    edge = float(np.median(lengths))
    normals = np.cross(x[rows[:, 1]] - x[rows[:, 0]], x[rows[:, 2]] - x[rows[:, 0]])
    area = 0.5 * float(np.linalg.norm(normals, axis=1).sum())
    met = first[_meets(normals, inverse, owner, count)] if is_solid else first
    return Surface(
        points=points,
        triangles=rows.astype(np.int32),
        owned=owned.astype(np.int32),
        across=across.reshape(3, -1).T.astype(np.int32),
        fan_start=starts.astype(np.int32),
        fan=half[order].astype(np.int32),
        edges=half[met].astype(np.int32),
        sides=np.stack([far[met], across[met]], axis=1).astype(np.int32),
        edge=edge,
        longest=float(lengths.max()),
        depth=min(DEPTH * edge, THIN * volume / area) if is_solid else 0.0,
        is_solid=is_solid,
    )


def cut_edges(surface: Surface, x: Floats, most: float) -> tuple[Surface, Floats]:
    """An obstacle's surface with its sharp edges that stand out cut into pieces of `most` [m] and
    points between them; the others touch no face.

    Args:
        surface: as `surface_of` made it.
        x: places of its points [m].
        most: length of a piece [m].

    Returns: the surface, whose triangles stay, and where each of its points lies between two of the
    old ones: row, row, share of the second.
    """
    a, b = surface.edges.T
    far, back = surface.sides.T
    out = np.cross(x[b] - x[a], x[far] - x[a])
    stands = (back < 0) | (np.einsum("ei,ei->e", out, x[back] - x[a]) < 0.0)
    edges, sides = surface.edges[stands], surface.sides[stands]
    length = np.linalg.norm(x[edges[:, 1]] - x[edges[:, 0]], axis=1)
    pieces = np.clip(np.ceil(length / most).astype(int), 1, MOST_PIECES)
    rows = np.column_stack([np.arange(len(x)), np.arange(len(x)), np.zeros(len(x))])
    places, fans, cut, cut_sides = [rows], [], [], []
    count = len(x)
    for (i, j), (one, two), n in zip(edges, sides, pieces, strict=True):
        between = count + np.arange(n - 1)
        count += n - 1
        share = np.arange(1, n) / n
        places.append(np.column_stack([np.full(n - 1, i), np.full(n - 1, j), share]))
        chain = np.concatenate([[i], between, [j]])
        cut.append(np.stack([chain[:-1], chain[1:]], axis=1))
        cut_sides.append(np.tile([one, two], (n, 1)))
        fan = [[j, one]] if two < 0 else [[j, one], [two, j]]
        fans += [fan] * (n - 1)
    lengths = [len(fan) for fan in fans]
    starts = np.concatenate([surface.fan_start, surface.fan_start[-1] + np.cumsum(lengths)])
    return replace(
        surface,
        points=np.arange(count),
        fan_start=starts.astype(np.int32),
        fan=np.concatenate([surface.fan, *fans]).astype(np.int32),
        edges=np.concatenate([np.empty((0, 2), int), *cut]).astype(np.int32),
        sides=np.concatenate([np.empty((0, 2), int), *cut_sides]).astype(np.int32),
        longest=max([0.0, *(length / pieces)]),
    ), np.concatenate(places)


def _across(edge: NDArray[np.int64], count: NDArray[np.int64], far: NDArray[np.int64]) -> Ints:
    """Far corner on the other side of each half edge, −1 where there is not exactly one."""
    order = np.argsort(edge, kind="stable")
    start = np.concatenate([[0], np.cumsum(count)[:-1]])
    across = np.full(len(edge), -1)
    twice = start[count == 2]
    one, two = order[twice], order[twice + 1]
    across[one], across[two] = far[two], far[one]
    return across.astype(np.int32)


def _meets(
    normals: Floats, edge: NDArray[np.int64], owner: NDArray[np.int64], count: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Which edges are sharp, or have not two triangles."""
    unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    sums = np.zeros((len(count), 3))
    np.add.at(sums, edge, unit[owner])
    cosine = 0.5 * (sums**2).sum(axis=1) - 1.0  # |n1 + n2|² = 2 + 2 cos
    sharp: NDArray[np.bool_] = (count != 2) | (cosine < np.cos(np.radians(SHARP)))
    return sharp
