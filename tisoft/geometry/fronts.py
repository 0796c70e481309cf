"""Rank of a spring network's rigidity matrix R, piece by piece.

The rank comes from a multifrontal QR factorisation of R itself (Duff & Reid 1983; Davis 2011) along
a nested dissection: every front drops the rank of its own columns and hands the rest on. Only
orthogonal transformations touch R, so slender nets keep their digits, which RᵀR would square away,
and a nullity of thousands costs nothing, which drowns an eigensolver.  See `rigidity` for R.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg, sparse
from scipy.sparse.csgraph import connected_components

from tisoft.errors import MeshError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Kind = Literal["solid", "flat", "line", "point"]

STRAIGHT = 1e-6
"""Nodes this near to a plane (line), as a share of the piece's size, lie in it: the digits that
meshes in single precision or in text keep."""
DEPENDENT = 1e-6
"""A spring adds to the rank when it sees more than this of a motion that no other spring resists;
a rope of 5,000 cells still has 3e-6."""
ZERO_LENGTH = 1e-9
"""Springs shorter than this share of the piece's size have no direction, so no row in R."""
LEAF = 24
"""Nodes in the smallest fronts of the factorisation: fewer cost calls, more cost flops."""

_KINDS: tuple[Kind, ...] = ("point", "line", "flat", "solid")


@dataclass(frozen=True, eq=False)
class Piece:
    """A connected piece in the coordinates that it fills, nodes and springs numbered within it."""

    nodes: Ints
    kind: Kind
    frame: Floats
    """Orthonormal rows that span the piece, shape (dim, 3)."""
    points: Floats
    """Rest positions along the rows of `frame`, over the piece's size, shape (nodes, dim)."""
    springs: Ints
    directions: Floats

    @property
    def dim(self) -> int:
        return len(self.frame)


def checked_net(points: ArrayLike, springs: ArrayLike) -> tuple[Floats, Ints]:
    """Positions (nodes, 3) and springs, each once, the lower node first, no spring to itself."""
    x = np.asarray(points, np.float64).reshape(-1, 3)
    pairs = np.asarray(springs, np.int64).reshape(-1, 2)
    if not np.isfinite(x).all():
        node = int(np.argmin(np.isfinite(x).all(axis=1)))
        raise MeshError(f"node {node} has coordinates {x[node].tolist()}; they must be finite")
    wrong = (pairs < 0) | (pairs >= len(x))
    if wrong.any():
        spring = int(np.argmax(wrong.any(axis=1)))
        ends = " and ".join(map(str, pairs[spring]))
        raise MeshError(f"spring {spring} joins nodes {ends}; nodes are 0 to {len(x) - 1}")
    return x, unique_pairs(pairs, len(x))


def unique_pairs(pairs: Ints, nodes: int) -> Ints:
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    keys = np.unique((low * nodes + high)[low < high])
    return np.stack((keys // max(nodes, 1), keys % max(nodes, 1)), axis=1)


def without(pairs: Ints, others: Ints, nodes: int) -> Ints:
    """The sorted `pairs` that are not among the sorted `others`."""
    return pairs[~np.isin(pairs @ [nodes, 1], others @ [nodes, 1])]


def pieces_of(points: Floats, springs: Ints) -> list[Piece]:
    """Connected pieces in the order of their first nodes."""
    size = len(points)
    graph = sparse.coo_array((np.ones(len(springs)), (springs[:, 0], springs[:, 1])), (size, size))
    count, label = connected_components(graph, directed=False)
    nodes = np.split(
        np.argsort(label, kind="stable"), np.cumsum(np.bincount(label, minlength=count))[:-1]
    )
    of_spring = label[springs[:, 0]]
    per_piece = np.cumsum(np.bincount(of_spring, minlength=count))[:-1]
    by_piece = np.split(springs[np.argsort(of_spring, kind="stable")], per_piece)
    pieces = [_piece(points, n, s) for n, s in zip(nodes, by_piece, strict=True) if len(n)]
    return sorted(pieces, key=lambda piece: int(piece.nodes[0]))


def _piece(points: Floats, nodes: Ints, springs: Ints) -> Piece:
    x = points[nodes] - points[nodes[0]]
    x -= x.mean(axis=0) if x.any() else 0.0
    size = np.abs(x).max()
    axes = np.linalg.svd(x / size, full_matrices=False)[2] if size else np.empty((0, 3))
    along = x @ axes.T
    reach = np.abs(along).max(axis=0, initial=0.0)
    frame = axes[reach > STRAIGHT * size]
    filled = along[:, reach > STRAIGHT * size] / (size or 1.0)
    kind = _KINDS[len(frame)]
    local = np.searchsorted(nodes, springs)
    return with_springs(Piece(nodes, kind, frame, filled, local[:0], filled[:0]), local)


def with_springs(piece: Piece, more: Ints) -> Piece:
    """The piece with `more` springs, less those that have no length."""
    kept, directions = directions_of(piece.points, more)
    return Piece(
        piece.nodes,
        piece.kind,
        piece.frame,
        piece.points,
        np.concatenate((piece.springs, kept)),
        np.concatenate((piece.directions, directions)),
    )


def directions_of(points: Floats, springs: Ints) -> tuple[Ints, Floats]:
    """Springs that have a length, and their unit vectors, shape (springs, dim)."""
    across = points[springs[:, 0]] - points[springs[:, 1]]
    length = np.linalg.norm(across, axis=1)
    long = length > ZERO_LENGTH
    return springs[long], across[long] / length[long, None]


def full_rank(piece: Piece) -> int:
    return piece.dim * len(piece.nodes) - piece.dim * (piece.dim + 1) // 2


def dissect(points: Floats, springs: Ints) -> list[Ints]:
    """Nodes in groups, in the order of elimination: nested dissection by halving the longest side.

    Two groups with no separator of later groups between them share no spring.
    """
    groups: list[Ints] = []
    side = np.zeros(len(points), np.int8)

    def split(nodes: Ints, inner: Ints) -> None:
        if len(nodes) <= LEAF:
            groups.append(nodes)
            return
        x = points[nodes]
        order = np.argsort(x[:, np.argmax(np.ptp(x, axis=0))], kind="stable")
        left, right = nodes[order[: len(nodes) // 2]], nodes[order[len(nodes) // 2 :]]
        side[left], side[right] = 0, 1
        ends = side[inner]
        cut = inner[ends[:, 0] != ends[:, 1]].ravel()
        touched = [np.unique(cut[side[cut] == s]) for s in (0, 1)]
        separator = min(touched, key=len)
        side[separator] = 2
        ends = side[inner]
        halves = [
            (half[side[half] == s], inner[(ends == s).all(axis=1)])
            for s, half in ((0, left), (1, right))
        ]
        for half, within in halves:
            split(half, within)
        if len(separator):
            groups.append(separator)

    split(np.arange(len(points)), springs)
    return groups


def eliminate(piece: Piece, candidates: Ints | None = None) -> tuple[int, Ints]:
    """Rank of the piece's rigidity matrix, and the candidates that raise it to the most it can be.

    Fronts follow the nested dissection. A front holds all rows that are not zero in the columns of
    its own nodes; QR turns them into [T11 T12; 0 T22], where the rank r of T11 counts, and the rows
    that T11 leaves over join T22 for the front of the next node. Where T11 has a null space, no row
    elsewhere touches it, so candidates that do touch it raise the rank one by one.
    """
    d, size = piece.dim, len(piece.nodes)
    picked: list[Ints] = [np.empty((0, 2), np.int64)]
    if d == 0 or size == 1:
        return 0, picked[0]
    groups = dissect(piece.points, piece.springs)
    turn = np.empty(size, np.int64)
    for g, own in enumerate(groups):
        turn[own] = g
    rows_of = _by_turn(turn, len(groups), piece.springs, piece.directions)
    offered = np.empty((0, 2), np.int64) if candidates is None else candidates
    near_of = _by_turn(turn, len(groups), *directions_of(piece.points, offered))
    waiting: list[list[tuple[Ints, Floats]]] = [[] for _ in groups]
    place = np.empty(size, np.int64)
    rank = 0
    for g, own in enumerate(groups):
        pairs, directions = rows_of[g]
        extra, extra_directions = near_of[g]
        others = _others(g, turn, pairs, waiting[g])
        front = _assemble(place, own, others, pairs, directions, waiting[g])
        pivot_rank, rest, null = _reduce(front, d * len(own), with_null=len(extra) > 0)
        if null.size and len(extra):
            seen = _assemble(place, own, _others(g, turn, extra, []), extra, extra_directions, [])
            chosen = most_useful(seen[:, : d * len(own)] @ null, piece.points, extra)
            picked.append(extra[chosen])
            pairs = np.concatenate((pairs, extra[chosen]))
            directions = np.concatenate((directions, extra_directions[chosen]))
            others = _others(g, turn, pairs, waiting[g])
            front = _assemble(place, own, others, pairs, directions, waiting[g])
            pivot_rank, rest, _ = _reduce(front, d * len(own))
        waiting[g] = []
        rank += pivot_rank
        if len(rest):
            waiting[turn[others].min()].append((others, rest))
    return rank, np.concatenate(picked)


def _by_turn(
    turn: Ints, groups: int, springs: Ints, directions: Floats
) -> list[tuple[Ints, Floats]]:
    """Springs and directions that become due at each group: when its first node is eliminated."""
    due = turn[springs].min(axis=1, initial=groups)
    order = np.argsort(due, kind="stable")
    ends = np.cumsum(np.bincount(due, minlength=groups))[:-1]
    return list(zip(np.split(springs[order], ends), np.split(directions[order], ends), strict=True))


def _others(g: int, turn: Ints, pairs: Ints, waiting: list[tuple[Ints, Floats]]) -> Ints:
    """Nodes in the rows of front g that are eliminated after it."""
    nodes = np.concatenate([pairs.ravel(), *(columns for columns, _ in waiting)])
    return np.unique(nodes[turn[nodes] > g])


def _assemble(
    place: Ints,
    own: Ints,
    others: Ints,
    pairs: Ints,
    directions: Floats,
    waiting: list[tuple[Ints, Floats]],
) -> Floats:
    """Rows of springs and of earlier fronts, in the columns of `own` nodes, then of `others`."""
    d, nodes = directions.shape[1], len(own) + len(others)
    place[own], place[others] = np.arange(len(own)), np.arange(len(own), nodes)
    front = np.zeros((len(pairs) + sum(len(rows) for _, rows in waiting), nodes, d))
    spring = np.arange(len(pairs))
    front[spring, place[pairs[:, 0]]] = directions
    front[spring, place[pairs[:, 1]]] = -directions
    start = len(pairs)
    for columns, rows in waiting:
        front[start : start + len(rows), place[columns]] = rows.reshape(len(rows), -1, d)
        start += len(rows)
    return front.reshape(len(front), nodes * d)


def _reduce(front: Floats, own: int, *, with_null: bool = False) -> tuple[int, Floats, Floats]:
    """Eliminate the first `own` columns: their rank, the rows left over, their null space."""
    if len(front) == 0:
        return 0, front[:, own:], np.eye(own)
    # dgeqrt recurses within its panels: with threads it is several times faster than dgeqrf.
    block = min(32, *front.shape)
    upper = np.triu(linalg.lapack.dgeqrt(block, front)[0][: front.shape[1]])
    if _surely_independent(upper[:own, :own]):
        return own, _not_rounding(upper[own:, own:]), np.empty((own, 0))
    q, r, order = linalg.qr(upper[:own, :own], pivoting=True, check_finite=False)
    rank = int(np.count_nonzero(np.abs(np.diagonal(r)) > DEPENDENT))
    rest = np.vstack((q[:, rank:].T @ upper[:own, own:], upper[own:, own:]))
    null = np.zeros((own, own - rank if with_null else 0))
    if null.size:
        null[order[:rank]] = -linalg.solve_triangular(r[:rank, :rank], r[:rank, rank:])
        null[order[rank:]] = np.eye(own - rank)
        null = np.linalg.qr(null)[0]
    return rank, _not_rounding(rest), null


def _surely_independent(triangle: Floats) -> bool:
    """Whether the inverse shows, cheaper than pivoting, that every column counts in the rank."""
    rows, columns = triangle.shape
    if rows < columns or np.abs(np.diagonal(triangle)).min() <= DEPENDENT:
        return False
    inverse, _ = linalg.lapack.dtrtri(triangle)
    return bool(columns * np.abs(inverse).max() * DEPENDENT < 1.0)


def _not_rounding(rows: Floats) -> Floats:
    """Rows of mere rounding would only make the later fronts larger."""
    return rows[np.abs(rows).max(axis=1, initial=0.0) > 1e-12]


def most_useful(seen: Floats, points: Floats, pairs: Ints) -> Ints:
    """Candidates whose rows, as seen in a null space, are independent; short ones first."""
    length = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    weight = (length.min() / length) ** 2
    r, order = linalg.qr((seen * weight[:, None]).T, mode="r", pivoting=True, check_finite=False)
    return order[: int(np.count_nonzero(np.abs(np.diagonal(r)) > 1e-3 * weight.min()))]
