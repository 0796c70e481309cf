"""K w and C w of a solid at rest, as sparse matrices: every law is Hooke's there, so no kernel has
to be compiled for the first stable step.

    K_ab = V [λ ∇N_a ∇N_bᵀ + μ ∇N_b ∇N_aᵀ + μ (∇N_a·∇N_b) I],   C_ab alike of φ and η
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tisoft.elements.tensor import tensor_blocks
from tisoft.equilibrium import assembly
from tisoft.model.part import Part
from tisoft.models.materials import SolidModel

Floats = NDArray[np.float64]


class AtRest:
    """Operators of one body with tets, at rest; see `operators.Elastic`."""

    def __init__(self, part: Part) -> None:
        model = part.body.model
        assert isinstance(model, SolidModel)
        self.part = part
        self.nodes = len(part.order)
        self._stiffness = _matrix(part, model.lame_lambda, model.lame_mu)
        self._viscosity = _matrix(part, model.phi, model.eta) if part.is_viscous() else None

    def stiffness_times(self, w: Floats, u: Floats | None = None) -> Floats:
        """K w [N], shape (nodes, 3)."""
        product: Floats = (self._stiffness @ w.ravel()).reshape(-1, 3)
        return product

    def viscosity_times(self, w: Floats, u: Floats | None = None) -> Floats:
        """C w [N] of φ and η, shape (nodes, 3)."""
        if self._viscosity is None:
            return np.zeros((self.nodes, 3))
        product: Floats = (self._viscosity @ w.ravel()).reshape(-1, 3)
        return product

    def consistent_mass(self) -> sparse.csc_matrix:
        """Consistent mass [kg] between nodes."""
        model, part = self.part.body.model, self.part
        assert isinstance(model, SolidModel)
        return assembly.consistent_mass(self.nodes, part.tets, part.volume, model.density)


def _matrix(part: Part, lam: float, mu: float) -> sparse.csr_matrix:
    blocks = tensor_blocks(part.tet_rest, lam, mu)
    i, j = np.broadcast_arrays(part.tets[:, :, None], part.tets[:, None, :])
    rows = 3 * i[..., None, None] + np.arange(3)[:, None]
    columns = 3 * j[..., None, None] + np.arange(3)
    rows, columns, _ = np.broadcast_arrays(rows, columns, blocks)
    size = 3 * len(part.order)
    pairs = (rows.ravel(), columns.ravel())
    return sparse.coo_matrix((blocks.ravel(), pairs), shape=(size, size)).tocsr()
