"""Patches: runs of points, triangles and edges that lie beside each other, a body each.

What hangs together and hardly bends does not touch itself (Volino and Magnenat-Thalmann 1994): two
patches of a body that share or join points are kin, and not looked at while all their normals
differ by less than a right angle (`flat.FLAT`).  Not where both reach the border: there a slit may
close.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tisoft.touch.surface import Surface

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SIZE = 16
"""Points, triangles or edges of a patch at the most."""


def sorted_surface(surface: Surface, x: Floats, owner: Ints) -> tuple[Surface, Ints]:
    """The surface with points, triangles and edges by body and, in each, by patches, and the old
    numbers of its points.

    Args:
        surface, x: a surface and the places of its points [m].
        owner: number of each point's body; a triangle's is that of its first corner.
    """
    points = _along(x, owner)
    faces = _along(x[surface.triangles].mean(axis=1), owner[surface.triangles[:, 0]])
    edges = _along(x[surface.edges].mean(axis=1), owner[surface.edges[:, 0]])
    new = np.append(np.argsort(points), -1).astype(np.int32)  # −1 stays
    counts = np.diff(surface.fan_start)[points]
    starts = np.append(0, np.cumsum(counts))
    fans = np.repeat(surface.fan_start[points] - starts[:-1], counts) + np.arange(starts[-1])
    return replace(
        surface,
        points=surface.points[points],
        triangles=new[surface.triangles[faces]],
        owned=surface.owned[faces],
        across=new[surface.across[faces]],
        fan_start=starts.astype(np.int32),
        fan=new[surface.fan[fans]],
        edges=new[surface.edges[edges]],
        sides=new[surface.sides[edges]],
    ), points


def _along(middles: Floats, owner: Ints) -> Ints:
    """The order of what has these middles and bodies: runs of SIZE, from a body's first on, lie
    together.
    """
    found = []
    rows = np.argsort(owner, kind="stable")
    for body in np.split(rows, np.flatnonzero(np.diff(owner[rows])) + 1):
        waiting = [body]
        while waiting:
            part = waiting.pop()
            if len(part) <= SIZE:
                found.append(part)
                continue
            axis = int(np.ptp(middles[part], axis=0).argmax())
            part = part[np.argsort(middles[part, axis], kind="stable")]
            half = SIZE * ((len(part) // SIZE + 1) // 2)
            waiting += [part[half:], part[:half]]
    return np.concatenate(found) if found else rows


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


def kin_of(patches: list[Ints], triangles: Ints, edges: Ints, points: int) -> tuple[Ints, Ints]:
    """The kin of each patch: patches of points for one of triangles, of edges for one of edges.

    Args:
        patches: of points, triangles and edges.
        triangles, edges: of the bodies that touch themselves; others as −1.
        points: how many there are.

    Returns: where each patch's kin begin, shape (patches + 1,), and these, by number among all.
    """
    of_points = _members(patches[0], np.arange(points)[:, None], points)
    of_faces = _members(patches[1], triangles, points)
    of_edges = _members(patches[2], edges, points)
    known = triangles[triangles[:, 0] >= 0]
    sides = np.sort(known[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    ends, count = np.unique(sides, axis=0, return_counts=True)
    border = np.zeros(points, bool)
    border[ends[count == 1]] = True
    one = np.ones(len(ends))
    joined = sparse.coo_array((one, ends.T), shape=(points, points)).tocsr()
    near = joined + joined.T + sparse.eye_array(points, format="csr")
    first, second = (sum(len(each) for each in patches[:k]) for k in (1, 2))
    pairs = []
    for own, other, start, offset in (
        (of_faces, of_points, first, 0), (of_edges, of_edges, second, second),
    ):  # fmt: skip
        a, b = (own @ near @ other.T).tocoo().coords
        open_ = (own @ border > 0)[a] & (other @ border > 0)[b]
        pairs.append(np.stack([a + start, b + offset], axis=1)[~open_])
    found = np.concatenate(pairs)
    found = found[np.lexsort(found.T[::-1])]
    starts = np.searchsorted(found[:, 0], np.arange(sum(map(len, patches)) + 1))
    return starts, found[:, 1]


def _members(patches: Ints, corners: Ints, points: int) -> sparse.csr_array:
    """Which points belong to which patch of what has these corners, shape (patches, points)."""
    owner = np.repeat(np.arange(len(patches)), patches[:, 1] - patches[:, 0])
    rows, columns = np.repeat(owner, corners.shape[1]), corners.ravel()
    kept = columns >= 0
    one = np.ones(int(kept.sum()))
    shape = (len(patches), points)
    return sparse.coo_array((one, (rows[kept], columns[kept])), shape=shape).tocsr()
