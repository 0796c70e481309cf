"""Rigidity of spring networks: motions that no spring resists, and the springs that would.

    R u = 0,   row of spring (a, b):  n · (u_a − u_b),   n = (x_a − x_b) / |x_a − x_b|

R is the rigidity matrix at rest (Maxwell 1864; Pellegrino & Calladine 1986, eq. 1). A connected
piece of N nodes has 3N − rank R − rank(rigid motions) zero-energy modes in space, and a flat one
2N − rank R − 3 in its plane.

The rank comes from a multifrontal QR factorisation of R itself (Duff & Reid 1983; Davis 2011) along
a nested dissection: every front drops the rank of its own columns and hands the rest on. Only
orthogonal transformations touch R, so slender nets keep their digits, which RᵀR would square away,
and a nullity of thousands costs nothing, which drowns an eigensolver.

| symbol | name         | meaning                                       | shape            |
|--------|--------------|-----------------------------------------------|------------------|
| x      | points       | rest positions [m]                            | (nodes, 3)       |
| n      | directions   | unit vectors of the springs                   | (springs, d)     |
| d      | dim          | dimensions that the piece fills: 3, 2, 1      |                  |
| P      | free_part    | projector on the mechanisms of a piece        | (d N, columns)   |
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg, sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

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
NEAR = 12
"""Neighbours of a node among which new springs are sought."""
ROUNDS, PROBES = 20, 100
"""Refactorisations, and mechanisms looked at in each, to place the last springs."""
SMALL = 64
"""Nodes of a piece in which every pair may become a new spring."""

_KINDS: tuple[Kind, ...] = ("point", "line", "flat", "solid")
_RIGID_MOTIONS: dict[Kind, int] = {"point": 3, "line": 5, "flat": 6, "solid": 6}


@dataclass(frozen=True, eq=False)
class PieceRigidity:
    """Zero-energy modes of one connected piece of a spring network."""

    nodes: Ints
    """Nodes of the piece, ascending, shape (nodes of the piece,)."""
    kind: Kind
    """What the rest positions fill: "solid" space, "flat" a plane, "line", or "point"."""
    modes: int
    """Zero-energy modes in space, beyond rigid motion."""
    in_plane: int | None
    """Zero-energy modes within the plane of a flat piece, beyond rigid motion; None otherwise."""

    @property
    def mechanisms(self) -> int:
        """Modes worth a warning: of a flat piece those in its plane, of a line or point none."""
        if self.kind == "solid":
            return self.modes
        return self.in_plane or 0


@dataclass(frozen=True, eq=False)
class Rigidity:
    """Zero-energy modes of a spring network, beyond the rigid motions of every piece."""

    zero_energy_modes: int
    """Modes in space, summed over the pieces."""
    in_plane: int | None
    """Modes in their plane, summed over the flat pieces; None when no piece is flat."""
    pieces: tuple[PieceRigidity, ...]
    """Connected pieces in the order of their first nodes."""

    @property
    def mechanisms(self) -> int:
        """Modes worth a warning: in plane for flat pieces, in space for solid ones."""
        return sum(piece.mechanisms for piece in self.pieces)

    def warning(
        self,
        body: str,
        *,
        moving: Ints | None = None,
        missing: NDArray[np.integer] | None = None,
        after: Rigidity | None = None,
    ) -> str | None:
        """One sentence on the mechanisms of `body`, or None when there is nothing to warn of.

        `moving` are the nodes of the worst mechanism (`moving_nodes`), `missing` the proposed
        springs (`missing_springs`) and `after` the rigidity counted with them.
        """
        if not self.mechanisms:
            return None
        flat = {piece.kind == "flat" for piece in self.pieces if piece.mechanisms}
        where = "in its plane" if flat == {True} else "" if flat == {False} else "in plane or space"
        count = f"{self.mechanisms} mechanism{'s' if self.mechanisms > 1 else ''}"
        text = f'body "{body}" has {count} {where}'.rstrip() + ": motions that no spring resists"
        if moving is not None and len(moving):
            some = ", ".join(map(str, moving[:8])) + (", …" if len(moving) > 8 else "")
            text += f"; the worst moves {len(moving)} node{'s' * (len(moving) > 1)} ({some})"
        if missing is not None and len(missing):
            left = 0 if after is None else after.mechanisms
            end = f"leave {left}" if left else "remove them"
            text += f"; {len(missing)} more spring{'s' * (len(missing) > 1)} would {end}"
        return text


@dataclass(frozen=True, eq=False)
class _Piece:
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


def rigidity(points: ArrayLike, springs: ArrayLike) -> Rigidity:
    """Count the zero-energy modes of a spring network at rest.

    `points` are rest positions [m], shape (nodes, 3); `springs` pairs of nodes, shape (springs, 2).
    Lengths and stiffnesses do not matter, nor do scale and attitude. Repeated springs count once;
    springs of zero length join pieces but resist nothing to first order. Raises `MeshError` for
    coordinates that are not finite and for springs between nodes that do not exist.
    """
    found = []
    for piece in _pieces(*_checked(points, springs)):
        rank = _eliminate(piece)[0]
        size = len(piece.nodes)
        in_plane = 2 * size - rank - 3 if piece.kind == "flat" else None
        modes = 3 * size - rank - _RIGID_MOTIONS[piece.kind]
        found.append(PieceRigidity(piece.nodes, piece.kind, modes, in_plane))
    flat = [piece.in_plane for piece in found if piece.in_plane is not None]
    return Rigidity(sum(p.modes for p in found), sum(flat) if flat else None, tuple(found))


def mechanism(points: ArrayLike, springs: ArrayLike, counted: Rigidity) -> Floats:
    """The worst mechanism: displacements, shape (nodes, 3), the largest of them of length 1.

    Of the piece with the most mechanisms (in plane for flat pieces), the motion of the node that is
    held most loosely: a push on that node, projected on all mechanisms, so free of rigid motion and
    as local as a mechanism can be. All zeros when `counted`, from `rigidity`, has no mechanisms.
    """
    checked, pairs = _checked(points, springs)
    motion = np.zeros(checked.shape)
    worst = max(counted.pieces, key=lambda piece: piece.mechanisms, default=None)
    if worst is None or not worst.mechanisms:
        return motion
    piece = next(p for p in _pieces(checked, pairs) if p.nodes[0] == worst.nodes[0])
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
    checked, pairs = _checked(points, springs)
    found = [np.empty((0, 2), np.int64)]
    for piece in _pieces(checked, pairs):
        if piece.dim < 2 or _eliminate(piece)[0] == _full_rank(piece):
            continue
        near = _candidates(piece)
        diagonals = _diagonals(piece, near)
        near = _without(near, diagonals, len(piece.nodes))
        rest = _raise_rank(_with_springs(piece, diagonals), near)
        found += [piece.nodes[diagonals], piece.nodes[rest]]
    return _unique_pairs(np.concatenate(found), len(checked)).astype(np.int32)


def _checked(points: ArrayLike, springs: ArrayLike) -> tuple[Floats, Ints]:
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
    return x, _unique_pairs(pairs, len(x))


def _unique_pairs(pairs: Ints, nodes: int) -> Ints:
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    keys = np.unique((low * nodes + high)[low < high])
    return np.stack((keys // max(nodes, 1), keys % max(nodes, 1)), axis=1)


def _without(pairs: Ints, others: Ints, nodes: int) -> Ints:
    """The sorted `pairs` that are not among the sorted `others`."""
    return pairs[~np.isin(pairs @ [nodes, 1], others @ [nodes, 1])]


def _pieces(points: Floats, springs: Ints) -> list[_Piece]:
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


def _piece(points: Floats, nodes: Ints, springs: Ints) -> _Piece:
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
    return _with_springs(_Piece(nodes, kind, frame, filled, local[:0], filled[:0]), local)


def _with_springs(piece: _Piece, more: Ints) -> _Piece:
    """The piece with `more` springs, less those that have no length."""
    kept, directions = _directions(piece.points, more)
    return _Piece(
        piece.nodes,
        piece.kind,
        piece.frame,
        piece.points,
        np.concatenate((piece.springs, kept)),
        np.concatenate((piece.directions, directions)),
    )


def _directions(points: Floats, springs: Ints) -> tuple[Ints, Floats]:
    """Springs that have a length, and their unit vectors, shape (springs, dim)."""
    across = points[springs[:, 0]] - points[springs[:, 1]]
    length = np.linalg.norm(across, axis=1)
    long = length > ZERO_LENGTH
    return springs[long], across[long] / length[long, None]


def _full_rank(piece: _Piece) -> int:
    return piece.dim * len(piece.nodes) - piece.dim * (piece.dim + 1) // 2


def _dissect(points: Floats, springs: Ints) -> list[Ints]:
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


def _eliminate(piece: _Piece, candidates: Ints | None = None) -> tuple[int, Ints]:
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
    groups = _dissect(piece.points, piece.springs)
    turn = np.empty(size, np.int64)
    for g, own in enumerate(groups):
        turn[own] = g
    rows_of = _by_turn(turn, len(groups), piece.springs, piece.directions)
    offered = np.empty((0, 2), np.int64) if candidates is None else candidates
    near_of = _by_turn(turn, len(groups), *_directions(piece.points, offered))
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
            chosen = _most_useful(seen[:, : d * len(own)] @ null, piece.points, extra)
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


def _raise_rank(piece: _Piece, near: Ints) -> Ints:
    """Candidates that raise the rank, as many as mechanisms are left where `near` allows.

    One elimination finds most. It judges a candidate only where its first node is eliminated, so
    the rest come from projections on what mechanisms remain, a limited number at a time.
    """
    if (rank := _eliminate(piece)[0]) == _full_rank(piece):
        return near[:0]
    rank, first = _eliminate(piece, near)
    picked = [first]
    for _ in range(ROUNDS):
        missing = min(_full_rank(piece) - rank, PROBES)
        piece = _with_springs(piece, picked[-1])
        near, directions = _directions(
            piece.points,
            _without(near, _unique_pairs(picked[-1], len(piece.nodes)), len(piece.nodes)),
        )
        if missing == 0 or len(near) == 0:
            break
        noise = np.random.default_rng(0).normal(size=(piece.points.size, missing))
        free = np.linalg.qr(_free_part(piece)(noise))[0].reshape(len(piece.nodes), piece.dim, -1)
        seen = np.einsum("sd,sdm->sm", directions, free[near[:, 0]] - free[near[:, 1]])
        picked.append(near[_most_useful(seen, piece.points, near)])
        rank += len(picked[-1])
        if len(picked[-1]) == 0:
            break
    return np.concatenate(picked)


def _most_useful(seen: Floats, points: Floats, pairs: Ints) -> Ints:
    """Candidates whose rows, as seen in a null space, are independent; short ones first."""
    length = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    weight = (length.min() / length) ** 2
    r, order = linalg.qr((seen * weight[:, None]).T, mode="r", pivoting=True, check_finite=False)
    return order[: int(np.count_nonzero(np.abs(np.diagonal(r)) > 1e-3 * weight.min()))]


def _candidates(piece: _Piece) -> Ints:
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
    return _without(_unique_pairs(pairs, size), _unique_pairs(piece.springs, size), size)


def _diagonals(piece: _Piece, near: Ints) -> Ints:
    """One diagonal, the shorter, for every cell of four springs that a mechanism shears."""
    near, directions = _directions(piece.points, near)
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
    return _unique_pairs(np.array(chosen, np.int64).reshape(-1, 2), len(piece.nodes))


def _free_part(piece: _Piece) -> Callable[[Floats], Floats]:
    """Projector on the mechanisms, (dim nodes, columns) → same, free of rigid motion.

    ε (RᵀR + ε)⁻¹ applied four times leaves (ε/λ)⁴ of a motion that springs of eigenvalue λ resist.
    """
    d, size, shift = piece.dim, len(piece.nodes), 1e-12
    order = np.concatenate(_dissect(piece.points, piece.springs))
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


def _rigid_motions(piece: _Piece) -> Floats:
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


def _loosest_motion(piece: _Piece) -> Floats:
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
