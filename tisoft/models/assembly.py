"""Sparse stiffness, viscosity and mass of one body, assembled in NumPy from element blocks.

    K_ab = V ∇N_a · A · ∇N_b,   A_ikjl = ∂P_ik/∂F_jl,   (K_ab)_ij = V Σ_kl ∇N_a,k A_ikjl ∇N_b,l
    M_ab = ρ V/20 (1 + δ_ab)                                             (consistent mass)

Sparse matrices serve factorisations (preconditioners, modes); products go by `tangent`.  Unknowns
are numbered 3 node + axis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tisoft.models.laws import LINEAR, NEO_HOOKEAN

Floats = NDArray[np.float64]
Ints = NDArray[np.integer]

_ONE = np.eye(3)
_LEVI = np.zeros((3, 3, 3))
for _i in range(3):
    _LEVI[_i, (_i + 1) % 3, (_i + 2) % 3] = 1.0
    _LEVI[_i, (_i + 2) % 3, (_i + 1) % 3] = -1.0


def corner_gradients(gradient: Floats) -> Floats:
    """∇N_0..3 [1/m], shape (tets, 4, 3), from ∇N_1..3."""
    return np.concatenate([-gradient.sum(axis=1, keepdims=True), gradient], axis=1)


def deformation(gradient: Floats, tets: Ints, u: Floats) -> Floats:
    """F of each tet, shape (tets, 3, 3)."""
    steps = u[tets[:, 1:]] - u[tets[:, :1]]
    return _ONE + np.einsum("eci,eck->eik", steps, gradient)


def tangent_blocks(law: int, F: Floats, lam: float, mu: float) -> Floats:
    """A_ikjl = ∂P_ik/∂F_jl [Pa], shape (tets, 3, 3, 3, 3); lam, mu are the law's constants."""
    if law == LINEAR:
        F = _ONE[None]
    squares = np.einsum("eik,ejk->eij", F, F)
    outer = np.einsum("eik,ejl->eikjl", F, F)
    if law == NEO_HOOKEAN:
        size = np.einsum("eii->e", squares)[:, None, None, None, None] + 1.0
        cof = 0.5 * np.einsum("ijm,kln,ejl,emn->eik", _LEVI, _LEVI, F, F)
        excess = np.linalg.det(F) - 1.0 - 0.75 * mu / lam
        spread = np.einsum("ijm,kln,emn,e->eikjl", _LEVI, _LEVI, F, excess)
        identity = np.einsum("ij,kl->ikjl", _ONE, _ONE)
        swelling = np.einsum("eik,ejl->eikjl", cof, cof)
        return (
            mu * (1.0 - 1.0 / size) * identity
            + (2.0 * mu / size**2) * outer
            + lam * (swelling + spread)
        )
    cross = np.swapaxes(outer, 2, 4)  # F_il F_jk
    material = lam * outer + mu * (cross + np.einsum("eij,kl->eikjl", squares, _ONE))
    if law == LINEAR:
        return material
    E = 0.5 * (np.einsum("eki,ekj->eij", F, F) - _ONE)
    S = lam * np.einsum("eii,kl->ekl", E, _ONE) + 2.0 * mu * E
    return material + np.einsum("ij,ekl->eikjl", _ONE, S)


def viscous_blocks(law: int, F: Floats, phi: float, eta: float) -> Floats:
    """∂P_ik/∂Ḟ_jl [Pa·s] of the viscous stress, shape (tets, 3, 3, 3, 3)."""
    if law == LINEAR:
        F = _ONE[None]
    squares = np.einsum("eik,ejk->eij", F, F)
    outer = np.einsum("eik,ejl->eikjl", F, F)
    shear = np.swapaxes(outer, 2, 4) + np.einsum("eij,kl->eikjl", squares, _ONE)
    blocks: Floats = phi * outer + eta * shear
    return blocks


def element_matrices(gradient: Floats, volume: Floats, blocks: Floats) -> Floats:
    """V ∇N_a · A · ∇N_b, shape (tets, 4, 3, 4, 3) over (corner, axis, corner, axis)."""
    g = corner_gradients(gradient)
    if len(blocks) == 1 < len(g):
        blocks = np.broadcast_to(blocks, (len(g), 3, 3, 3, 3))
    # ∇N_a,k A_ikjl, then · ∇N_b,l, as products of small matrices.
    left = np.matmul(g[:, None], blocks.transpose(0, 1, 2, 3, 4).reshape(-1, 3, 3, 9))
    left = left.reshape(-1, 3, 4, 3, 3)  # i, a, j, l
    both = np.matmul(left, np.swapaxes(g, 1, 2)[:, None, None])  # i, a, j, b
    out: Floats = both.transpose(0, 2, 1, 4, 3) * volume[:, None, None, None, None]
    return out


def spring_matrices(ends: Floats, pull: Floats, along: Floats) -> Floats:
    """pull (1 − n nᵀ) + along n nᵀ of each spring, shape (springs, 3, 3).

    Args:
        ends: vectors y from the first to the second end [m], shape (springs, 3).
        pull: T/L [N/m], shape (springs,).
        along: k [N/m], shape (springs,).
    """
    n = ends / np.linalg.norm(ends, axis=1, keepdims=True)
    nn = n[:, :, None] * n[:, None, :]
    out: Floats = pull[:, None, None] * (_ONE - nn) + along[:, None, None] * nn
    return out


class Pattern:
    """Where element and spring blocks fall in a body's sparse matrix (made once per body)."""

    def __init__(self, nodes: int, tets: Ints, springs: Ints) -> None:
        self.size = 3 * nodes
        dofs = 3 * tets[:, :, None] + np.arange(3)
        dofs = dofs.reshape(len(tets), 12)
        pairs = 3 * springs[:, :, None] + np.arange(3)
        pairs = pairs.reshape(len(springs), 6)
        rows = [np.repeat(d, d.shape[1], axis=1).ravel() for d in (dofs, pairs)]
        columns = [np.tile(d, (1, d.shape[1])).ravel() for d in (dofs, pairs)]
        # Every diagonal entry is present, so that nodes without elements can be shifted too.
        each = np.arange(self.size)
        keys = np.concatenate([*columns, each]).astype(np.int64) * self.size
        keys += np.concatenate([*rows, each])
        known, self._place = np.unique(keys, return_inverse=True)
        self._rows = known % self.size
        self._starts = np.searchsorted(known // self.size, np.arange(self.size + 1))

    def matrix(self, tets: Floats, springs: Floats) -> sparse.csc_matrix:
        """Sum of element matrices (tets, 4, 3, 4, 3) and spring matrices (springs, 3, 3)."""
        pairs = np.empty((len(springs), 2, 3, 2, 3))
        for a in range(2):
            for b in range(2):
                pairs[:, a, :, b] = springs if a == b else -springs
        values = np.concatenate([tets.ravel(), pairs.ravel(), np.zeros(self.size)])
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
