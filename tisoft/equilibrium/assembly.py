"""Sparse stiffness, viscosity and mass of one body, from element matrices.

    M_ab = ρ V/20 (1 + δ_ab)                                             (consistent mass)

Sparse matrices serve factorisations (preconditioners, modes).  Unknowns are numbered 3 node + axis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Floats = NDArray[np.float64]
Ints = NDArray[np.integer]


def deformation(gradient: Floats, tets: Ints, u: Floats) -> Floats:
    """F of each tet, shape (tets, 3, 3)."""
    steps = u[tets[:, 1:]] - u[tets[:, :1]]
    return np.eye(3) + np.einsum("eci,eck->eik", steps, gradient)


class Pattern:
    """Where element matrices fall in a body's sparse matrix (made once per body).

    Args:
        nodes: of the body.
        cells: nodes of each element, shape (elements, corners).
    """

    def __init__(self, nodes: int, cells: Ints) -> None:
        self.size = 3 * nodes
        dofs = (3 * cells.astype(np.int64)[:, :, None] + np.arange(3)).reshape(len(cells), -1)
        width = dofs.shape[1]
        # Every diagonal entry is present, so that nodes without elements can be shifted too.
        each = np.arange(self.size)
        rows = np.concatenate([np.repeat(dofs, width, axis=1).ravel(), each])
        columns = np.concatenate([np.tile(dofs, (1, width)).ravel(), each])
        known, self._place = np.unique(columns * self.size + rows, return_inverse=True)
        self._rows = known % self.size
        self._starts = np.searchsorted(known // self.size, np.arange(self.size + 1))

    def matrix(self, elements: Floats) -> sparse.csc_matrix:
        """Sum of element matrices, shape (elements, 3 corners, 3 corners)."""
        values = np.concatenate([elements.ravel(), np.zeros(self.size)])
        data = np.bincount(self._place, values, minlength=len(self._rows))
        shape = (self.size, self.size)
        return sparse.csc_matrix((data, self._rows, self._starts), shape=shape)


def consistent_mass(nodes: int, tets: Ints, volume: Floats, density: float) -> sparse.csc_matrix:
    """Consistent mass [kg] between nodes, shape (nodes, nodes); the same for each axis."""
    local = (np.ones((4, 4)) + np.eye(4)) * (density / 20.0)
    values = volume[:, None, None] * local
    rows = np.repeat(tets, 4, axis=1).ravel()
    columns = np.tile(tets, (1, 4)).ravel()
    return sparse.coo_matrix((values.ravel(), (rows, columns)), shape=(nodes, nodes)).tocsc()
