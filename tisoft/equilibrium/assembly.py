"""Sparse stiffness, viscosity and mass of one body, from element matrices.

    M_ab = ρ ∫ N_a N_b dV                                                (consistent mass)

Sparse matrices serve factorisations (preconditioners, modes).  Unknowns are numbered 3 node + axis.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tisoft.model.part import Part

Floats = NDArray[np.float64]
Ints = NDArray[np.integer]


class Pattern:
    """Where element matrices fall in a body's sparse matrix (made once per body).

    Args:
        nodes: of the body.
        cells: nodes of the cells, an array of shape (cells, corners) for each element.
    """

    def __init__(self, nodes: int, cells: Sequence[Ints]) -> None:
        self.size = 3 * nodes
        # Every diagonal block is present, so that nodes without elements can be shifted too.
        pairs = [np.arange(nodes) * (nodes + 1)]
        for own in cells:
            corners = own.astype(np.int64)
            pairs.append((corners[:, None, :] * nodes + corners[:, :, None]).ravel())
        known, block = np.unique(np.concatenate(pairs), return_inverse=True)
        columns, rows = np.divmod(known, nodes)
        starts = np.searchsorted(columns, np.arange(nodes + 1))
        # Entry (i, j) of a block is in the j-th of the node's three columns, which are as high.
        height = 3 * np.diff(starts)[columns]
        first = 9 * starts[columns] + 3 * (np.arange(len(known)) - starts[columns])
        i, j = np.arange(3)[:, None, None], np.arange(3)
        every = np.arange(len(known))[:, None, None, None]
        self._rows = np.empty(9 * len(known), np.int64)
        self._rows[first[every] + i + j * height[every]] = 3 * rows[every] + i
        self._starts = np.cumsum([0, *np.repeat(3 * np.diff(starts), 3)])
        place, at = [np.empty(0, np.int64)], nodes
        for own in cells:
            size = own.shape[1]
            mine = block[at : at + len(own) * size**2].reshape(len(own), size, 1, size, 1)
            place.append((first[mine] + i + j * height[mine]).ravel())
            at += mine.size
        self._place = np.concatenate(place)

    def matrix(self, elements: Sequence[Floats]) -> sparse.csc_matrix:
        """Sum of element matrices, shape (cells, 3 corners, 3 corners) for each element."""
        values = np.concatenate([np.empty(0), *[own.ravel() for own in elements]])
        data = np.bincount(self._place, values, minlength=len(self._rows))
        shape = (self.size, self.size)
        return sparse.csc_matrix((data, self._rows, self._starts), shape=shape)


def diagonal_blocks(matrix: sparse.csc_matrix) -> Floats:
    """The 3×3 blocks on a matrix's diagonal, shape (nodes, 3, 3)."""
    blocks = matrix.tobsr((3, 3))
    rows = np.repeat(np.arange(matrix.shape[0] // 3), np.diff(blocks.indptr))
    found: Floats = blocks.data[blocks.indices == rows].copy()
    return found


def consistent_mass(part: Part) -> sparse.csc_matrix:
    """Consistent mass [kg] between a body's nodes, shape (nodes, nodes); the same for each axis.

    Springs have point masses: theirs is diagonal.
    """
    nodes = len(part.order)
    if not part.solids:
        return sparse.diags(part.mass, format="csc")
    total = sparse.csc_matrix((nodes, nodes))
    for cells in part.solids:
        local = cells.solid.density * cells.element.products(cells.rest)
        width = local.shape[1]
        pairs = np.repeat(cells.nodes, width, axis=1).ravel(), np.tile(cells.nodes, width).ravel()
        total = total + sparse.coo_matrix((local.ravel(), pairs), shape=(nodes, nodes)).tocsc()
    return total
