"""What hexahedra add to the law at their one point (see `elements.hexahedron`), in NumPy and f64.

    W = ½ zᵀ A z,  z_h = Fᵀ q_h,  B = ∂z/∂u:
    f = −Bᵀ A z,   K = BᵀAB + ∂B/∂u : A z,   C = Bᵀ A_v B

Small strains take z = q.  Laws that stand strong compression are left to the kernels.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Floats = NDArray[np.float64]


class Hourglass:
    """The hourglass modes of a body's hexahedra of one material.

    Args:
        cells: the hexahedra.
        nodes: of the body.
        finite: whether the law holds for large rotations.
    """

    def __init__(self, cells: Any, nodes: int, *, finite: bool) -> None:
        self.nodes, self.finite = cells.nodes, finite
        self._slopes = cells.gradients[:, 0]
        self._shapes = np.asarray(cells.element.shapes(cells.rest))
        axes = np.asarray(cells.element.axes(cells.rest))
        self._elastic, self._viscous = (
            _in_world(cells.element.hourglass(cells.rest, *numbers), axes)
            for numbers in (cells.elastic, cells.viscous)
        )
        count = cells.nodes.size
        places = (cells.nodes.ravel(), np.arange(count))
        self._sum = sparse.csr_matrix((np.ones(count), places), shape=(nodes, count))

    def _amplitudes(self, u: Floats) -> tuple[Floats, Floats, Floats]:
        """q_h and z_h [m], shape (cells, 4, 3), and F."""
        U = u[self.nodes]
        F = np.broadcast_to(np.eye(3), (len(U), 3, 3))
        if self.finite:
            F = F + np.einsum("eai,eaj->eij", U, self._slopes)
        q = self._shapes @ U
        return q, q @ F, F

    def _rates(self, q: Floats, F: Floats) -> Floats:
        """B, shape (cells, 12, 24)."""
        B = np.einsum("eij,eha->ehjai", F, self._shapes)
        if self.finite:
            B += np.einsum("ehi,eaj->ehjai", q, self._slopes)
        return B.reshape(len(q), 12, 24)

    def _stresses(self, z: Floats) -> Floats:
        """A z [N], shape (cells, 12)."""
        return np.asarray((self._elastic @ z.reshape(len(z), 12, 1))[..., 0])

    def force(self, u: Floats) -> Floats:
        """Their forces [N], shape (nodes, 3)."""
        q, z, F = self._amplitudes(u)
        own = self._stresses(z)[:, None] @ self._rates(q, F)
        return -np.asarray(self._sum @ own.reshape(-1, 3))

    def energy(self, u: Floats) -> float:
        """Their energy [J]."""
        z = self._amplitudes(u)[1]
        return 0.5 * float((z.reshape(len(z), 12) * self._stresses(z)).sum())

    def matrices(self, what: str, u: Floats) -> Floats:
        """K_e ("tangent") or C_e ("rate") at u, shape (cells, 24, 24)."""
        q, z, F = self._amplitudes(u)
        B = self._rates(q, F)
        A = self._elastic if what == "tangent" else self._viscous
        found = np.swapaxes(B, 1, 2) @ A @ B
        if self.finite and what == "tangent":
            R = self._stresses(z).reshape(-1, 4, 3)
            S = np.einsum("eaj,ehj,ehb->eab", self._slopes, R, self._shapes, optimize=True)
            blocks = found.reshape(-1, 8, 3, 8, 3)
            for i in range(3):
                blocks[:, :, i, :, i] += S + np.swapaxes(S, 1, 2)
        return np.asarray(found)

    def times(self, matrices: Floats, w: Floats) -> Floats:
        """Element matrices times w [m], shape (nodes, 3)."""
        own = matrices @ w[self.nodes].reshape(len(matrices), 24, 1)
        return np.asarray(self._sum @ own.reshape(-1, 3))


def _in_world(A: Floats, axes: Floats) -> Floats:
    """∂²W/∂z² for amplitudes along the world's axes instead of the local ones."""
    local = A.reshape(-1, 4, 3, 4, 3)
    turned = np.einsum("eji,ehigk,elk->ehjgl", axes, local, axes, optimize=True)
    return np.ascontiguousarray(turned.reshape(-1, 12, 12))
