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
        pattern = assembly.Pattern(self.nodes, [cells.nodes for cells in part.solids])
        solids = part.solids
        self._matrix = pattern.matrix([cells.matrices(*cells.elastic) for cells in solids])
        self._viscosity: sparse.csc_matrix | None = None
        if part.is_viscous():
            self._viscosity = pattern.matrix([cells.matrices(*cells.viscous) for cells in solids])

    def stiffness_times(self, w: Floats, u: Floats | None = None) -> Floats:
        """K w [N], shape (nodes, 3)."""
        product: Floats = (self._matrix @ w.ravel()).reshape(-1, 3)
        return product

    def stiffness(self, u: Floats | None = None) -> sparse.csc_matrix:
        """K at rest [N/m], unknown 3 node + axis."""
        return self._matrix

    def viscosity_times(self, w: Floats, u: Floats | None = None) -> Floats:
        """C w [N] of φ and η, shape (nodes, 3)."""
        if self._viscosity is None:
            return np.zeros((self.nodes, 3))
        product: Floats = (self._viscosity @ w.ravel()).reshape(-1, 3)
        return product

    def consistent_mass(self) -> sparse.csc_matrix:
        """Consistent mass [kg] between nodes."""
        return assembly.consistent_mass(self.part)
