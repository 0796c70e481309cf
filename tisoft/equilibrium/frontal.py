"""A symmetric sparse matrix factorised by dense blocks: the multifrontal method.

    F = [A_SS  A_SB] + Σ U of the parts below,   A_SS = L Lᵀ,   X = L⁻¹ A_SB,   U = A_BB − Xᵀ X
        [A_BS    0 ]

(Duff and Reid 1983).  S are the nodes that part two halves of a piece of the body, B those of
larger pieces that touch them (nested dissection, George 1973).  Pieces are halved across their
longest way, so nodes need to have a place, and no more.  Where A_SS is not positive definite,
U = A_BB − A_BS A_SS⁻¹ A_SB by pivoting inside of S, and the negative eigenvalues add up (Haynsworth
1968).  In space that is three to four times as fast as SuperLU from some thousand unknowns on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import blas, lapack
from scipy.sparse.linalg import splu

from tisoft.equilibrium.held import Held

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LEAF = 64
"""Nodes of a piece that is not halved any more."""
WORTHWHILE = 3000
"""Unknowns from which on this is faster than SuperLU."""


def factorised(matrix: sparse.csc_matrix, held: Held) -> tuple[Any, int]:
    """What solves with a symmetric matrix on the unknowns of a body, and how many of its
    eigenvalues are negative (Sylvester's law of inertia); raises RuntimeError where it is singular.
    """
    if matrix.shape[0] >= WORTHWHILE and held.part.solids:
        if held.dissection is None:
            held.dissection = Dissection(matrix, held.unknowns // 3, held.part.rest)
        found = Frontal(held.dissection, matrix)
        return found, found.negative
    factor = splu(
        matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )  # fmt: skip
    # Pivots stay on the diagonal, so that their signs are those of the eigenvalues.
    return factor, int(np.sum(factor.U.diagonal() < 0.0))


@dataclass(frozen=True)
class Front:
    """Unknowns of S, from `begin` to `end` in their new order, and of B; numbers of those below."""

    begin: int
    end: int
    border: Ints
    below: list[int]


class Dissection:
    """The order in which unknowns are eliminated, and the fronts.

    Args:
        matrix: of any values, symmetric.
        nodes: the node of each unknown, shape (unknowns,).
        points: places of all nodes [m], shape (nodes, 3).
        leaf: nodes of a piece that is not halved any more.
    """

    def __init__(
        self, matrix: sparse.csc_matrix, nodes: Ints, points: Floats, leaf: int = LEAF
    ) -> None:
        self._leaf = leaf
        used, own = np.unique(nodes, return_inverse=True)
        entries = matrix.tocoo()
        count = len(used)
        pairs = np.unique(own[entries.row].astype(np.int64) * count + own[entries.col])
        self._near = np.split(pairs % count, np.searchsorted(pairs // count, np.arange(1, count)))
        self._points = points[used]
        self._side = np.zeros(count, np.int8)
        self._groups: list[Ints] = []
        self._below: list[list[int]] = []
        self._halve(np.arange(count))
        order = np.concatenate(self._groups)
        rank = np.empty(count, np.int64)
        rank[order] = np.arange(count)
        self.order: Ints = np.argsort(rank[own], kind="stable")
        """Unknowns in the order of their elimination."""
        starts = np.searchsorted(rank[own][self.order], np.arange(count + 1))
        self.fronts = self._fronts(rank, starts)

    def _halve(self, piece: Ints) -> int:
        """Dissect a piece; returns the number of its last front."""
        below = []
        x = self._points[piece]
        along = x[:, np.ptp(x, axis=0).argmax()]
        low = along < np.median(along)
        if len(piece) > self._leaf and low.any():
            halves, parting = self._parted(piece[low], piece[~low])
            below = [self._halve(half) for half in halves if len(half)]
            piece = parting
        self._groups.append(piece)
        self._below.append(below)
        return len(self._groups) - 1

    def _parted(self, low: Ints, high: Ints) -> tuple[list[Ints], Ints]:
        """Both halves without the nodes of one of them that touch the other, and those."""
        side = self._side
        side[low], side[high] = 1, 2
        touching = []
        for own, other in ((low, 2), (high, 1)):
            near = [self._near[k] for k in own]
            met = np.unique(np.concatenate(near))
            touching.append(met[side[met] == other])
        side[low] = side[high] = 0
        if len(touching[0]) < len(touching[1]):
            return [low, np.setdiff1d(high, touching[0])], touching[0]
        return [np.setdiff1d(low, touching[1]), high], touching[1]

    def _fronts(self, rank: Ints, starts: Ints) -> list[Front]:
        borders: list[Ints] = []
        fronts = []
        begin = 0
        for piece, below in zip(self._groups, self._below, strict=True):
            end = begin + len(piece)
            met = [rank[self._near[k]] for k in piece] + [borders[b] for b in below]
            border = np.unique(np.concatenate([np.empty(0, np.int64), *met]))
            border = border[border >= end]
            borders.append(border)
            own = [np.arange(starts[k], starts[k + 1]) for k in border]
            whole = np.concatenate([np.empty(0, np.int64), *own])
            fronts.append(Front(int(starts[begin]), int(starts[end]), whole, below))
            begin = end
        return fronts


class Frontal:
    """A factorisation; raises RuntimeError where a front is singular.

    Args:
        dissection: of the matrix's pattern.
        matrix: symmetric, as sparse as that pattern or sparser.
    """

    def __init__(self, dissection: Dissection, matrix: sparse.csc_matrix) -> None:
        if not np.isfinite(matrix.data).all():
            raise RuntimeError("the matrix is not finite")
        self._order, self._fronts = dissection.order, dissection.fronts
        self.negative = 0
        """Negative eigenvalues of the matrix."""
        self._factors: list[tuple[Any, Any, Floats, Floats]] = []
        """Of each front its pivots' factor (with its row exchanges), X, and A_SB where pivoted."""
        rows = sparse.csr_matrix(matrix[self._order][:, self._order])
        local = np.empty(len(self._order), np.int64)
        left: dict[int, Floats] = {}
        for number, front in enumerate(self._fronts):
            own = front.end - front.begin
            local[front.begin : front.end] = np.arange(own)
            local[front.border] = own + np.arange(len(front.border))
            F = _entries(rows, front, local)
            for k in front.below:
                at = local[self._fronts[k].border]
                F.T[np.ix_(at, at)] += left.pop(k)
            left[number] = self._eliminate(F, own)

    def _eliminate(self, F: Floats, own: int) -> Floats:
        """Eliminate the first unknowns of a front; returns U."""
        block, side = F[:own, :own], np.asfortranarray(F[:own, own:])
        L, failed = lapack.dpotrf(block, lower=1)
        if not failed:
            X = blas.dtrsm(1.0, L, side, lower=1)
            self._factors.append((L, None, X, X))
            return np.asarray(F[own:, own:] - X.T @ X)
        self.negative += int((np.linalg.eigvalsh(block) < 0.0).sum())
        lu, rows, failed = lapack.dgetrf(block)
        if failed:
            raise RuntimeError("the matrix is singular")
        X = lapack.dgetrs(lu, rows, side)[0]
        self._factors.append((lu, rows, X, side))
        return np.asarray(F[own:, own:] - side.T @ X)

    def solve(self, right: Floats) -> Floats:
        """x of A x = right, shape (unknowns,)."""
        b = right[self._order]
        for front, (factor, rows, _, side) in zip(self._fronts, self._factors, strict=True):
            own = slice(front.begin, front.end)
            if rows is None:
                b[own] = blas.dtrsv(factor, b[own], lower=1)
            else:
                b[own] = lapack.dgetrs(factor, rows, b[own])[0]
            b[front.border] -= side.T @ b[own]
        for front, (factor, rows, X, _) in zip(
            reversed(self._fronts), reversed(self._factors), strict=True
        ):
            own = slice(front.begin, front.end)
            b[own] -= X @ b[front.border]
            if rows is None:
                b[own] = blas.dtrsv(factor, b[own], lower=1, trans=1)
        x = np.empty_like(b)
        x[self._order] = b
        return x


def _entries(rows: sparse.csr_matrix, front: Front, local: Ints) -> Floats:
    """The front's own entries of the matrix: A_SS and A_SB."""
    size = front.end - front.begin + len(front.border)
    F = np.zeros((size, size), order="F")
    ends = rows.indptr[front.begin : front.end + 1]
    columns, values = rows.indices[ends[0] : ends[-1]], rows.data[ends[0] : ends[-1]]
    row = np.repeat(np.arange(front.end - front.begin), np.diff(ends))
    mine = columns >= front.begin
    F[row[mine], local[columns[mine]]] = values[mine]
    return F
