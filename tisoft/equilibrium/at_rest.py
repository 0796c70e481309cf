"""K w and C w of a solid at rest, as sparse matrices: every law is Hooke's there, so no kernel has
to be compiled for the first stable step.

K_e is that of `Cells.matrices`, C_e alike of φ and η.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tisoft.equilibrium import assembly
from tisoft.model.part import Part

Floats = NDArray[np.float64]


class AtRest:
    """Operators of one body with cells, at rest; see `operators.Elastic`."""

    def __init__(self, part: Part) -> None:
        self.part = part
        self.nodes = len(part.order)
        self.mass = part.mass
        self._matrix = _matrix(part, "elastic")
        self._viscosity = _matrix(part, "viscous") if part.is_viscous() else None

    def stiffness_times(self, w: Floats, u: Floats | None = None) -> Floats:
        """K w [N], shape (nodes, 3)."""
        product: Floats = (self._matrix @ w.ravel()).reshape(-1, 3)
        return product

    def stiffness(self, u: Floats | None = None) -> sparse.csc_matrix:
        """K at rest [N/m], unknown 3 node + axis."""
        return self._matrix.tocsc()

    def viscosity_times(self, w: Floats, u: Floats | None = None) -> Floats:
        """C w [N] of φ and η, shape (nodes, 3)."""
        if self._viscosity is None:
            return np.zeros((self.nodes, 3))
        product: Floats = (self._viscosity @ w.ravel()).reshape(-1, 3)
        return product

    def consistent_mass(self) -> sparse.csc_matrix:
        """Consistent mass [kg] between nodes."""
        return assembly.consistent_mass(self.part)


def _matrix(part: Part, pair: str) -> sparse.csr_matrix:
    size = 3 * len(part.order)
    total = sparse.csr_matrix((size, size))
    for cells in part.solids:
        dofs = (3 * cells.nodes[:, :, None] + np.arange(3)).reshape(len(cells.nodes), -1)
        width = dofs.shape[1]
        pairs = np.repeat(dofs, width, axis=1).ravel(), np.tile(dofs, width).ravel()
        values = cells.matrices(*getattr(cells, pair)).ravel()
        total = total + sparse.coo_matrix((values, pairs), shape=(size, size)).tocsr()
    return total
