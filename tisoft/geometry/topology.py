"""How nodes, edges, faces and tets hang together: pure index work, no lengths."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int32]

# Faces of a tet with det(x1 - x0, x2 - x0, x3 - x0) > 0, each seen counter-clockwise from outside;
# face a lies opposite corner a.
TET_FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
TET_EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])


def unique_edges(pairs: NDArray[np.integer]) -> Ints:
    """Every edge once, shape (edges, 2): smaller node first, rows ascending."""
    ends = np.sort(np.asarray(pairs, dtype=np.int64).reshape(-1, 2), axis=1)
    span = int(ends.max(initial=0)) + 1
    keys = np.unique(ends[:, 0] * span + ends[:, 1])
    return np.stack([keys // span, keys % span], axis=1).astype(np.int32)


def edges_of(tets: NDArray[np.integer]) -> Ints:
    """Edges of tets, shape (edges, 2): each once, smaller node first, rows ascending."""
    return unique_edges(np.asarray(tets)[:, TET_EDGES])


def boundary_faces(tets: NDArray[np.integer]) -> Ints:
    """Triangles of one tet only, shape (triangles, 3), normals outward, in tet order."""
    return faces_at(np.asarray(tets), match_faces(tets)[0]).astype(np.int32)


def faces_at(tets: NDArray[np.integer], slots: NDArray[np.integer]) -> NDArray[np.integer]:
    """Nodes of faces, shape (slots, 3), normals outward; slot = 4 tet + the corner opposite."""
    return tets[slots[:, None] // 4, TET_FACES[slots % 4]]


def is_even(tets: NDArray[np.integer], slots: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Whether each face is an even permutation of its sorted nodes.

    Two tets on either side of a face see it in opposite senses: one even, one odd.
    """
    a, b, c = faces_at(tets, slots).T
    return (a < b).astype(np.int8) + (b < c) + (c < a) == 2


def match_faces(
    tets: NDArray[np.integer],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Faces by how many tets have them, as slots (4 tet + the corner opposite).

    Returns those of one tet, ascending; those of two, shape (faces, 2); and those of three or more.
    """
    faces = np.asarray(tets)[:, TET_FACES].reshape(-1, 3)
    low, middle, high = np.sort(faces.astype(np.int64), axis=1).T
    span = int(high.max(initial=0)) + 1
    keys = low * span + middle
    if span < 2**21:  # all three in one number
        keys = keys * span + high
        order = np.argsort(keys, kind="stable")
        new = np.ones(len(order), dtype=bool)
        new[1:] = keys[order[1:]] != keys[order[:-1]]
    else:
        order = np.lexsort((high, keys))
        keys, high = keys[order], high[order]
        new = np.ones(len(order), dtype=bool)
        new[1:] = (keys[1:] != keys[:-1]) | (high[1:] != high[:-1])
    starts = np.flatnonzero(new)
    counts = np.diff(np.append(starts, len(order)))
    twos = starts[counts == 2]
    many = np.repeat(counts > 2, counts)
    return (
        np.sort(order[starts[counts == 1]]),
        np.stack([order[twos], order[twos + 1]], axis=1),
        np.sort(order[many]),
    )


def pieces(edges: NDArray[np.integer], nodes: int) -> int:
    """Number of connected pieces of `nodes` nodes joined by `edges`; a lone node is a piece."""
    return int(piece_of(edges, nodes).max(initial=-1)) + 1


def piece_of(edges: NDArray[np.integer], nodes: int) -> Ints:
    """The piece, counted from 0, that each node belongs to, shape (nodes,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ends = np.asarray(edges, dtype=np.int32).reshape(-1, 2)
    ones = np.ones(len(ends), dtype=np.int8)
    graph = coo_array((ones, (ends[:, 0], ends[:, 1])), shape=(nodes, nodes))
    labels: Ints = connected_components(graph, directed=False)[1]
    return labels


def incidence(cells: NDArray[np.integer], nodes: int) -> tuple[Ints, Ints]:
    """Which corners of which cells meet in a node, as a compressed list (starts, slots).

    `cells` has shape (cells, corners).  The slots of node n are slots[starts[n]:starts[n + 1]],
    ascending; slot = cell * corners + corner.  starts has nodes + 1 entries.
    """
    corners = np.asarray(cells).ravel()
    starts = np.zeros(nodes + 1, dtype=np.int32)
    np.cumsum(np.bincount(corners, minlength=nodes), out=starts[1:])
    return starts, np.argsort(corners, kind="stable").astype(np.int32)


def morton_order(points: NDArray[np.floating]) -> NDArray[np.int64]:
    """Permutation along a Morton (Z) curve: in points[order] neighbours in space lie close.

    Uses 21 bits per axis of the points' own extent, so any scale and offset give the same order;
    points of one cell keep their order.  Source: Morton (1966).
    """
    points = np.asarray(points, dtype=np.float64)
    if len(points) == 0:
        return np.empty(0, dtype=np.int64)
    low = points.min(axis=0)
    extent = float(np.max(points.max(axis=0) - low)) or 1.0
    lattice = ((points - low) * ((2**21 - 1) / extent)).astype(np.uint64)
    x, y, z = (_spread_bits(lattice[:, axis]) for axis in range(3))
    return np.argsort(x | (y << np.uint64(1)) | (z << np.uint64(2)), kind="stable")


def _spread_bits(values: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Two zero bits after each of the 21 lowest bits."""
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        values = (values | (values << np.uint64(shift))) & np.uint64(mask)
    return values
