"""What a spring network lacks: its worst mechanism, and the springs that would remove them all."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from tisoft.geometry.fronts import (
    Floats,
    Ints,
    Piece,
    checked_net,
    directions_of,
    dissect,
    eliminate,
    full_rank,
    most_useful,
    pieces_of,
    unique_pairs,
    with_springs,
    without,
)
from tisoft.geometry.rigidity import Rigidity

NEAR = 12
"""Neighbours of a node among which new springs are sought."""
ROUNDS, PROBES = 20, 100
"""Refactorisations, and mechanisms looked at in each, to place the last springs."""
SMALL = 64
"""Nodes of a piece in which every pair may become a new spring."""


def mechanism(points: ArrayLike, springs: ArrayLike, counted: Rigidity) -> Floats:
    """The worst mechanism: displacements, shape (nodes, 3), the largest of them of length 1.

    Of the piece with the most mechanisms (in plane for flat pieces), the motion of the node that is
    held most loosely: a push on that node, projected on all mechanisms, so free of rigid motion and
    as local as a mechanism can be. All zeros when `counted`, from `rigidity`, has no mechanisms.
    """
    checked, pairs = checked_net(points, springs)
    motion = np.zeros(checked.shape)
    worst = max(counted.pieces, key=lambda piece: piece.mechanisms, default=None)
    if worst is None or not worst.mechanisms:
        return motion
    piece = next(p for p in pieces_of(checked, pairs) if p.nodes[0] == worst.nodes[0])
    free = _loosest_motion(piece).reshape(-1, piece.dim) @ piece.frame
    motion[piece.nodes] = free / np.linalg.norm(free, axis=1).max()
    return motion


def moving_nodes(motion: Floats, *, share: float = 0.5) -> Ints:
    """Nodes that move at least `share` of the largest motion, the largest first.

    `motion` has shape (nodes, 3); none move in a motion of zeros.
    """
    length = np.linalg.norm(motion, axis=1)
    if not length.any():
        return np.empty(0, np.int64)
    # Rounding must not shuffle nodes that move alike.
    order = np.argsort(-np.round(length / length.max(), 6), kind="stable")
    return order[length[order] >= (share - 1e-6) * length.max()]


def missing_springs(points: ArrayLike, springs: ArrayLike) -> NDArray[np.int32]:
    """Springs that remove the mechanisms (in plane for flat pieces), shape (proposed, 2).

    First one diagonal for every cell of four springs that a mechanism shears; then, among pairs of
    nodes that are near or share a neighbour, as many springs as mechanisms are left. Count again
    with them to learn what remains: nothing in grids; something where too few pairs are near.
    """
    checked, pairs = checked_net(points, springs)
    found = [np.empty((0, 2), np.int64)]
    for piece in pieces_of(checked, pairs):
        if piece.dim < 2 or eliminate(piece)[0] == full_rank(piece):
            continue
        near = _candidates(piece)
        diagonals = _diagonals(piece, near)
        near = without(near, diagonals, len(piece.nodes))
        rest = _raise_rank(with_springs(piece, diagonals), near)
        found += [piece.nodes[diagonals], piece.nodes[rest]]
    return unique_pairs(np.concatenate(found), len(checked)).astype(np.int32)


def _raise_rank(piece: Piece, near: Ints) -> Ints:
    """Candidates that raise the rank, as many as mechanisms are left where `near` allows.

    One elimination finds most. It judges a candidate only where its first node is eliminated, so
    the rest come from projections on what mechanisms remain, a limited number at a time.
    """
    if (rank := eliminate(piece)[0]) == full_rank(piece):
        return near[:0]
    rank, first = eliminate(piece, near)
    picked = [first]
    for _ in range(ROUNDS):
        missing = min(full_rank(piece) - rank, PROBES)
        piece = with_springs(piece, picked[-1])
        near, directions = directions_of(
            piece.points,
            without(near, unique_pairs(picked[-1], len(piece.nodes)), len(piece.nodes)),
        )
        if missing == 0 or len(near) == 0:
            break
        noise = np.random.default_rng(0).normal(size=(piece.points.size, missing))
        free = np.linalg.qr(_free_part(piece)(noise))[0].reshape(len(piece.nodes), piece.dim, -1)
        seen = np.einsum("sd,sdm->sm", directions, free[near[:, 0]] - free[near[:, 1]])
        picked.append(near[most_useful(seen, piece.points, near)])
        rank += len(picked[-1])
        if len(picked[-1]) == 0:
            break
    return np.concatenate(picked)


def _candidates(piece: Piece) -> Ints:
    """Pairs of nodes without a spring that are near, or share a near neighbour."""
    size = len(piece.nodes)
    ends = np.concatenate((piece.springs, piece.springs[:, ::-1]))
    length = np.linalg.norm(piece.points[ends[:, 0]] - piece.points[ends[:, 1]], axis=1)
    ends = ends[np.lexsort((length, ends[:, 0]))]
    first = np.searchsorted(ends[:, 0], np.arange(size))
    ends = ends[np.arange(len(ends)) - first[ends[:, 0]] < NEAR]
    graph = sparse.csr_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), (size, size))
    shared = sparse.coo_array(graph.T @ graph)
    near = size if size <= SMALL else NEAR
    nearest = cKDTree(piece.points).query(piece.points, k=near)[1].reshape(size, near)
    pairs = np.concatenate(
        (
            np.stack((shared.row, shared.col), axis=1),
            np.stack((np.repeat(np.arange(size), near), nearest.ravel()), axis=1),
        )
    )
    return without(unique_pairs(pairs, size), unique_pairs(piece.springs, size), size)


def _diagonals(piece: Piece, near: Ints) -> Ints:
    """One diagonal, the shorter, for every cell of four springs that a mechanism shears."""
    near, directions = directions_of(piece.points, near)
    free = _free_part(piece)(np.random.default_rng(0).normal(size=(piece.points.size, 4)))
    free = free.reshape(len(piece.nodes), piece.dim, -1)
    sheared = np.einsum("sd,sdm->sm", directions, free[near[:, 0]] - free[near[:, 1]])
    near = near[np.abs(sheared).max(axis=1) > 1e-5]
    length = np.linalg.norm(piece.points[near[:, 0]] - piece.points[near[:, 1]], axis=1)
    # Lengths to 6 digits: rounding must not choose between equal diagonals.
    near = near[np.argsort(np.round(length / length.max(initial=1e-300), 6), kind="stable")]
    neighbours: list[set[int]] = [set() for _ in piece.nodes]
    for a, b in piece.springs.tolist():
        neighbours[a].add(b)
        neighbours[b].add(a)
    corners = [set(held) for held in neighbours]
    chosen = []
    for a, c in near.tolist():
        shared = corners[a] & corners[c]
        if any(shared - neighbours[b] - {b} for b in shared):
            chosen.append((a, c))
            neighbours[a].add(c)
            neighbours[c].add(a)
    return unique_pairs(np.array(chosen, np.int64).reshape(-1, 2), len(piece.nodes))


def _free_part(piece: Piece) -> Callable[[Floats], Floats]:
    """Projector on the mechanisms, (dim nodes, columns) → same, free of rigid motion.

    ε (RᵀR + ε)⁻¹ applied four times leaves (ε/λ)⁴ of a motion that springs of eigenvalue λ resist.
    """
    d, size, shift = piece.dim, len(piece.nodes), 1e-12
    order = np.concatenate(dissect(piece.points, piece.springs))
    columns = (order[:, None] * d + np.arange(d)).ravel()
    spring = np.repeat(np.arange(len(piece.springs)), d)
    parts = [
        (sign * piece.directions.ravel(), (spring, (end[:, None] * d + np.arange(d)).ravel()))
        for sign, end in ((1.0, piece.springs[:, 0]), (-1.0, piece.springs[:, 1]))
    ]
    shape = (len(piece.springs), d * size)
    r = sum((sparse.csc_array(part, shape) for part in parts), sparse.csc_array(shape))[:, columns]
    stiffness = sparse.csc_matrix(r.T @ r + shift * sparse.eye(d * size))
    factors = splu(
        stiffness, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    rigid = _rigid_motions(piece)

    def project(motion: Floats) -> Floats:
        for _ in range(4):
            solved = np.empty_like(motion)
            solved[columns] = shift * factors.solve(motion[columns])
            motion = solved - rigid @ (rigid.T @ solved)
        return motion

    return project


def _rigid_motions(piece: Piece) -> Floats:
    """Orthonormal columns: translations and infinitesimal rotations, shape (dim nodes, motions)."""
    d = piece.dim
    shifts = [np.broadcast_to(row, piece.points.shape) for row in np.eye(d)]
    turns = []
    for a in range(d):
        for b in range(a):
            turn = np.zeros(piece.points.shape)
            turn[:, a], turn[:, b] = piece.points[:, b], -piece.points[:, a]
            turns.append(turn)
    return np.linalg.qr(np.stack([m.ravel() for m in shifts + turns], axis=1))[0]


def _loosest_motion(piece: Piece) -> Floats:
    """P e for the node and direction e with the largest e · P e, shape (dim nodes,)."""
    d, size = piece.dim, len(piece.nodes)
    project = _free_part(piece)
    # The mean of (P g)² over random g is the diagonal of P: it tells which nodes to look at.
    noise = project(np.random.default_rng(0).normal(size=(d * size, 32)))
    loose = (noise**2).sum(axis=1).reshape(size, d).sum(axis=1)
    top = np.argsort(-loose, kind="stable")[:8]
    pushes = np.zeros((d * size, d * len(top)))
    pushes[(top[:, None] * d + np.arange(d)).ravel(), np.arange(d * len(top))] = 1.0
    answers = project(pushes).reshape(size, d, len(top), d)
    yields = np.stack([answers[node, :, i] for i, node in enumerate(top)])
    best = int(np.argmax(np.round(np.linalg.norm(yields, ord=2, axis=(1, 2)), 9)))
    own = yields[best]
    push = np.linalg.eigh((own + own.T) / 2)[1][:, -1]
    # Rows of a grid slide along springs: of equally loose directions, take the readable one.
    for along in piece.directions[(piece.springs == top[best]).any(axis=1)]:
        if along @ own @ along > 0.8 * (push @ own @ push):
            push = along
            break
    return (answers[:, :, best] @ push).ravel()
