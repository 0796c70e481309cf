"""Where a mesh's topology is not what its geometry shows.

Nodes in one place that nothing joins, faces that lie on each other without sharing their nodes,
nodes that hang on another tet's face or edge, tets that hold together by an edge or a node alone,
tets folded over their neighbours, and space that is filled twice.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry import topology
from tisoft.geometry.nearby import points_in_boxes

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SAME_PLACE = 1e-6
"""Nodes closer than this fraction of the mesh's size are in one place, if no edge is as short."""
OF_AN_EDGE = 1e-3
"""And closer than this fraction of the shortest edge at either."""
ON_A_FACE = 1e-5
"""A node lies on a face if it is closer to it than this fraction of the face's longest edge."""
SAMPLES = 4_000
"""Centres and nodes of a large mesh, of each so many, that are looked for in other tets."""


@dataclass(frozen=True, eq=False)
class Joints:
    """What was found; node numbers are rows of `points`, tets rows of `tets`."""

    coincident: Ints
    """Pairs of nodes in one place, shape (pairs, 2)."""
    hanging: Ints
    """Nodes that lie on a face or an edge that is not theirs."""
    lying: int
    """Faces on the surface that lie on others, of other triangulation."""
    hinges: Ints
    """Nodes where parts of a piece hold together by an edge or a node alone."""
    pinched: Ints
    """Nodes where a part that holds together by faces touches itself by an edge or a node."""
    folded: Ints
    """Tets that lie on the same side of a face as their neighbour there."""
    doubled: Ints
    """Tets that have another tet's centre or node inside, or a face with two others: the same space
    is filled twice."""


def joints_of(points: Floats, tets: NDArray[np.int32], turned: NDArray[np.int32]) -> Joints:
    """Looks at a mesh of tets with positive volumes, `turned` the other way in its file."""
    coincident = coincident_nodes(points, tets)
    first = merged_into(coincident, len(points))
    merged = first[tets]
    boundary, pairs, crowded = topology.match_faces(merged)
    hanging, lying = _on_faces(points, merged, boundary)
    folded = _folded(merged, pairs, turned)
    loose = np.setdiff1d(_loose_nodes(merged, boundary, pairs), coincident)
    hinges = _between_parts(merged, pairs, loose)
    return Joints(
        coincident=coincident,
        hanging=hanging,
        lying=lying,
        hinges=hinges,
        pinched=np.setdiff1d(loose, hinges),
        folded=folded,
        doubled=np.union1d(_doubled(points, tets, folded), _stacked(merged, pairs, crowded)),
    )


def coincident_nodes(points: Floats, cells: NDArray[np.int32]) -> Ints:
    """Pairs of nodes in one place, each node with the first one there, shape (pairs, 2).

    `cells` are tets or springs: nodes of one cell are never in one place.

    Nodes are sorted along a line askew to all axes; those in one place are neighbours there.
    """
    nothing = np.empty((0, 2), np.int64)
    if len(points) < 2:
        return nothing
    size = float(np.ptp(points, axis=0).max())
    reach = SAME_PLACE * size
    along = (points - points.min(axis=0)) @ np.array([0.537, 0.6180339887, 0.5742])
    order = np.argsort(along, kind="stable")
    lined = along[order]
    found = []
    for ahead in range(1, min(len(points), 1000)):
        near = np.flatnonzero(lined[ahead:] - lined[:-ahead] <= 1.1 * reach)
        if not len(near):
            break
        a, b = order[near], order[near + ahead]
        close = (np.abs(points[a] - points[b]) <= reach).all(axis=1)
        found.append(np.stack([a[close], b[close]], axis=1))
    pairs = np.concatenate(found) if found else nothing
    if not len(pairs):
        return nothing
    apart = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    shortest = np.full(len(points), size)
    meant = np.zeros(len(points), dtype=bool)
    meant[pairs] = True
    cells = cells[meant[cells].any(axis=1)]
    for i in range(cells.shape[1]):
        for j in range(i):
            lengths = np.linalg.norm(points[cells[:, i]] - points[cells[:, j]], axis=1)
            np.minimum.at(shortest, cells[:, i], lengths)
            np.minimum.at(shortest, cells[:, j], lengths)
    pairs = pairs[apart <= OF_AN_EDGE * shortest[pairs].min(axis=1)]
    first = merged_into(pairs, len(points))
    later = np.flatnonzero(first != np.arange(len(points)))
    return np.stack([first[later], later], axis=1)


def merged_into(pairs: Ints, nodes: int) -> Ints:
    """The first node of the place of each node, shape (nodes,)."""
    if not len(pairs):
        return np.arange(nodes)
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ends = pairs.astype(np.int32)
    graph = coo_array((np.ones(len(ends), np.int8), (ends[:, 0], ends[:, 1])), shape=(nodes, nodes))
    _, labels = connected_components(graph, directed=False)
    _, first = np.unique(labels, return_index=True)
    return first[labels]


def _on_faces(points: Floats, tets: Ints, boundary: Ints) -> tuple[Ints, int]:
    """Nodes of the surface on faces that are not theirs, and faces whose middle lies on another."""
    faces = topology.faces_at(tets, boundary)
    corners = points[faces]
    longest = np.zeros(len(faces))
    for i in range(3):
        edge = np.linalg.norm(corners[:, i] - corners[:, i - 1], axis=1)
        longest = np.maximum(longest, edge)
    slack = ON_A_FACE * longest[:, None]
    low, high = corners.min(axis=1) - slack, corners.max(axis=1) + slack
    nodes = np.unique(faces)
    hanging = []
    for face, point in points_in_boxes(points[nodes], low, high):
        node = nodes[point]
        other = (faces[face] != node[:, None]).all(axis=1)
        face, node = face[other], node[other]
        on = _lies_on(points[node], corners[face], longest[face])
        hanging.append(node[on])
    middles, lying = corners.mean(axis=1), []
    for face, middle in points_in_boxes(middles, low, high):
        other = face != middle
        face, middle = face[other], middle[other]
        on = _lies_on(middles[middle], corners[face], longest[face])
        lying += [middle[on], face[on]]
    on_others = np.unique(np.concatenate([np.empty(0, np.int64), *lying]))
    return np.unique(np.concatenate([np.empty(0, np.int64), *hanging])), len(on_others)


def _lies_on(points: Floats, corners: Floats, longest: Floats) -> NDArray[np.bool_]:
    """Whether each point lies on its triangle, its border included."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = points - corners[:, 0]
    normal = np.cross(a, b)
    square = np.einsum("ij,ij->i", normal, normal)
    height = np.abs(np.einsum("ij,ij->i", p, normal)) / np.sqrt(square)
    u = np.einsum("ij,ij->i", np.cross(p, b), normal) / square
    v = np.einsum("ij,ij->i", np.cross(a, p), normal) / square
    return (height <= ON_A_FACE * longest) & (
        np.minimum(np.minimum(u, v), 1.0 - u - v) >= -ON_A_FACE
    )


def _loose_nodes(tets: Ints, boundary: Ints, pairs: Ints) -> Ints:
    """Nodes of the surface whose tets are not all reached from each other through faces there.

    A graph of the corners of tets at such nodes: corners of two tets that share a face are joined.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    on_surface = np.zeros(int(tets.max()) + 1, dtype=bool)
    on_surface[topology.faces_at(tets, boundary)] = True
    slots = np.flatnonzero(on_surface[tets].ravel())
    place = np.full(tets.size, -1, dtype=np.int64)
    place[slots] = np.arange(len(slots))
    ends = []
    own, other = topology.faces_at(tets, pairs[:, 0]), pairs // 4
    for corner in range(3):
        node = own[:, corner]
        touched = np.flatnonzero(on_surface[node])
        both = [
            4 * tet + (tets[tet] == node[touched, None]).argmax(axis=1)
            for tet in (other[touched, 0], other[touched, 1])
        ]
        ends.append(np.stack([place[both[0]], place[both[1]]], axis=1))
    joined = np.concatenate(ends).astype(np.int32)
    graph = coo_array(
        (np.ones(len(joined), np.int8), (joined[:, 0], joined[:, 1])),
        shape=(len(slots), len(slots)),
    )
    _, labels = connected_components(graph, directed=False)
    node_of = tets.ravel()[slots]
    groups = np.unique(labels * np.int64(len(on_surface)) + node_of)
    return np.flatnonzero(np.bincount(groups % len(on_surface), minlength=len(on_surface)) > 1)


def _between_parts(tets: Ints, pairs: Ints, nodes: Ints) -> Ints:
    """Those of the nodes whose tets belong to several parts that hold together by faces."""
    if not len(nodes):
        return nodes
    part = topology.piece_of(pairs // 4, len(tets))
    first, last = np.full(int(tets.max()) + 1, len(tets)), np.full(int(tets.max()) + 1, -1)
    for corner in range(4):
        np.minimum.at(first, tets[:, corner], part)
        np.maximum.at(last, tets[:, corner], part)
    return nodes[first[nodes] < last[nodes]]


def _folded(tets: Ints, pairs: Ints, turned: NDArray[np.int32]) -> Ints:
    """Tets on the same side of a face as their neighbour: of both, the one that its file orients
    otherwise than most.
    """
    same = topology.is_even(tets, pairs[:, 0]) == topology.is_even(tets, pairs[:, 1])
    wrong = pairs[same] // 4
    wrong = wrong[~_same_nodes(tets, wrong)]
    odd = np.zeros(len(tets), dtype=bool)
    odd[turned] = True
    if 2 * len(turned) > len(tets):
        odd = ~odd
    told = odd[wrong]
    blamed = told | ~told.any(axis=1, keepdims=True)
    return np.unique(wrong[blamed])


def _stacked(tets: Ints, pairs: Ints, crowded: Ints) -> Ints:
    """Tets with a face that two others have, or with all the nodes of another."""
    both = pairs // 4
    return np.union1d(crowded // 4, both[_same_nodes(tets, both)])


def _same_nodes(tets: Ints, pairs: Ints) -> NDArray[np.bool_]:
    same = np.sort(tets[pairs[:, 0]], axis=1) == np.sort(tets[pairs[:, 1]], axis=1)
    return np.asarray(same.all(axis=1))


def enclosed_volume(points: Floats, tets: NDArray[np.int32], folded: Ints) -> float:
    """Volume inside the surface [m³]: Σ x0·(x1 × x2)/6 of its faces, reversed at `folded`."""
    slots = topology.match_faces(tets)[0]
    corners = points[topology.faces_at(tets, slots)] - points.mean(axis=0)
    volumes = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    return float(np.where(np.isin(slots // 4, folded), -volumes, volumes).sum())


def _doubled(points: Floats, tets: NDArray[np.int32], folded: Ints) -> Ints:
    """Tets with the centre of another, or a node, inside; a large mesh is sampled."""
    random = np.random.default_rng(0)
    chosen = np.arange(len(tets))
    nodes = np.arange(len(points))
    if len(tets) > SAMPLES:
        chosen = random.choice(len(tets), SAMPLES, replace=False)
    if len(nodes) > SAMPLES:
        nodes = random.choice(len(nodes), SAMPLES, replace=False)
    chosen = np.setdiff1d(chosen, folded)
    samples = np.concatenate([points[tets[chosen]].mean(axis=1), points[nodes]])
    owner = np.concatenate([chosen, np.full(len(nodes), -1)])
    corners = points[tets]
    found = [np.empty(0, np.int64)]
    for tet, sample in points_in_boxes(samples, corners.min(axis=1), corners.max(axis=1)):
        other = owner[sample] != tet
        tet, sample = tet[other], sample[other]
        found.append(tet[_is_inside(samples[sample], corners[tet])])
    return np.setdiff1d(np.concatenate(found), _neighbours(tets, folded))


def _neighbours(tets: NDArray[np.int32], chosen: Ints) -> Ints:
    """Tets that share a node with the chosen ones."""
    if not len(chosen):
        return chosen
    near = np.zeros(int(tets.max()) + 1, dtype=bool)
    near[tets[chosen]] = True
    return np.flatnonzero(near[tets].any(axis=1))


def _is_inside(points: Floats, corners: Floats) -> NDArray[np.bool_]:
    """Whether each point lies inside its tet, clear of its faces."""
    shape = corners[:, 1:] - corners[:, :1]
    volume = np.einsum("ij,ij->i", shape[:, 0], np.cross(shape[:, 1], shape[:, 2]))
    p = points - corners[:, 0]
    shares = [
        np.einsum("ij,ij->i", p, np.cross(shape[:, 1], shape[:, 2])),
        np.einsum("ij,ij->i", p, np.cross(shape[:, 2], shape[:, 0])),
        np.einsum("ij,ij->i", p, np.cross(shape[:, 0], shape[:, 1])),
    ]
    weights = np.stack(shares, axis=1) / volume[:, None]
    return np.minimum(weights.min(axis=1), 1.0 - weights.sum(axis=1)) > 1e-3
