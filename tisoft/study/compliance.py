"""Compliance of a body under its weight, f·u = fᵀK⁻¹f, with linear or 10-node tets.

K = ∫ λ div·div + 2μ e:e,   e = (∇u + ∇uᵀ)/2      small strain, one or four points a tet
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from tisoft.body import Body
from tisoft.elements.tet4 import corner_gradients, gradients
from tisoft.equilibrium.linear_solve import conjugate_gradients
from tisoft.geometry.mesh import TetMesh
from tisoft.geometry.topology import TET_EDGES
from tisoft.models.materials import Linear

Floats = NDArray[np.float64]

SOLVED, MOST_ITERATIONS = 1e-5, 40
"""Of conjugate gradients with an earlier factorisation."""
LINEAR_WEIGHTS = np.full(4, 0.25)
QUADRATIC_WEIGHTS = np.repeat([-0.05, 0.2], [4, 6])
"""Share of a tet's weight that each of its nodes takes."""


def free_axes(body: Body) -> NDArray[np.bool_]:
    """Whether each node may move along each axis, shape (nodes, 3)."""
    free = np.ones((len(body.mesh.points), 3), bool)
    for pin in body.pins:
        free[np.ix_(body.nodes(pin.where), pin.components)] = False
    return free


class Compliance:
    """fᵀK⁻¹f of a clamped body under its weight, for any λ and μ.

    Args:
        body: its mesh, density and pins.
        gravity: [m/s²].
        order: 1 for linear tets, 2 for the 10-node tets on the same mesh.
    """

    def __init__(self, body: Body, gravity: Floats, order: int) -> None:
        mesh = body.mesh
        assert isinstance(mesh, TetMesh) and isinstance(body.model, Linear)
        gradient, self._volume = gradients(mesh.points, mesh.tets)
        free, tets, share = free_axes(body), mesh.tets, LINEAR_WEIGHTS
        if order == 2:
            edges, number = np.unique(
                np.sort(tets[:, TET_EDGES], axis=2).reshape(-1, 2), axis=0, return_inverse=True
            )
            tets = np.hstack([tets, len(free) + number.reshape(-1, 6)])
            free = np.vstack([free, free[edges].any(axis=1)])
            share = QUADRATIC_WEIGHTS
        self._shapes = _shape_gradients(corner_gradients(gradient), order)
        self._columns = (3 * tets[:, :, None] + np.arange(3)).reshape(len(tets), -1)
        self._free = np.flatnonzero(free.ravel())
        self._count = free.size
        mass = np.bincount(tets.ravel(), (self._volume[:, None] * share).ravel(), len(free))
        weight = body.model.density * mass[:, None] * gravity
        self._load = weight.ravel()[self._free]
        self._solve: Callable[[Floats], Floats] | None = None
        self._parts = [self._matrix(lam, mu) for lam, mu in ((1.0, 0.0), (0.0, 1.0))]

    def _matrix(self, lam: float, mu: float) -> sparse.csc_matrix:
        g = self._shapes
        points = g.shape[1]
        blocks = mu * np.einsum("eqai,eqbj->eaibj", g, g).transpose(0, 1, 4, 3, 2)
        if lam:
            blocks = lam * np.einsum("eqai,eqbj->eaibj", g, g)
        else:
            blocks = blocks + mu * np.einsum("eqak,eqbk,ij->eaibj", g, g, np.eye(3), optimize=True)
        size = self._columns.shape[1]
        values = (self._volume[:, None, None] / points) * blocks.reshape(-1, size, size)
        rows, columns = np.repeat(self._columns, size, axis=1), np.tile(self._columns, (1, size))
        whole = sparse.csr_matrix(
            (values.ravel(), (rows.ravel(), columns.ravel())), shape=(self._count, self._count)
        )
        return whole[self._free][:, self._free].tocsc()

    def of(self, lam: float, mu: float) -> float:
        """fᵀK⁻¹f [J] for λ, μ [Pa]; an earlier factorisation serves while it makes CG quick."""
        matrix = lam * self._parts[0] + mu * self._parts[1]
        if self._solve is not None:
            u, *_, done = conjugate_gradients(
                matrix.dot, self._load, self._solve, tolerance=SOLVED, limit=MOST_ITERATIONS
            )
            if done:
                return float(2.0 * (self._load @ u) - u @ (matrix @ u))  # right to SOLVED²
        self._solve = splu(
            matrix,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        ).solve
        return float(self._load @ self._solve(self._load))


def _shape_gradients(corner: Floats, order: int) -> Floats:
    """Gradients of the shape functions at the points of quadrature, (tets, points, nodes, 3)."""
    if order == 1:
        return corner[:, None]
    L = np.full((4, 4), 0.1381966011250105) + np.diag(np.full(4, 0.4472135954999579))
    at_corners = np.einsum("qa,eai->eqai", 4.0 * L - 1.0, corner)
    i, j = TET_EDGES.T
    at_edges = 4.0 * (
        L[None, :, i, None] * corner[:, None, j] + L[None, :, j, None] * corner[:, None, i]
    )
    return np.concatenate([at_corners, at_edges], axis=2)
