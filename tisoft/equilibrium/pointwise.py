"""Operators of cells whose law is looked at point by point: f(u), K(u), C(u), V(u), in f64.

    H = D u,   f = −Dᵀ (V P(H)),   K = Dᵀ (V ∂P/∂F) D,   C = Dᵀ (V ∂P_v/∂Ḣ) D,   V(u) = Σ V Ψ(H)

D, which holds ∇N of all points, is a sparse matrix; only the law is a kernel, so that an element of
ten nodes compiles no longer than one of four.  Hexahedra add their `hourglass` modes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tisoft import runtime
from tisoft.elements.hexahedron import Hexahedron
from tisoft.elements.pull_back import turns
from tisoft.elements.quadratic import Quadratic
from tisoft.elements.tet4 import Tet4
from tisoft.equilibrium import assembly
from tisoft.equilibrium.at_points import law_kernel
from tisoft.equilibrium.hourglass import Hourglass
from tisoft.model.part import Part

Floats = NDArray[np.float64]

MOST_POINTS = 60_000
"""Above, kernels of the whole element are worth their compiling."""


HEXAHEDRON = 4
"""Points that a hexahedron counts as."""


def is_pointwise(part: Part) -> bool:
    """Whether that is worth it: few enough cells, and hexahedra of a law that does not turn what it
    pulls back.
    """
    points = 0
    for cells in part.solids:
        if issubclass(cells.element, Hexahedron):
            points += HEXAHEDRON * len(cells.nodes)
            if part.solid_law.is_finite and turns(part.solid_law):
                return False
        elif issubclass(cells.element, Tet4 | Quadratic):
            points += cells.element.points * len(cells.nodes)
        else:
            return False
    return 0 < points <= MOST_POINTS


class Pointwise:
    """Operators of one body with solid cells; see `operators.Elastic`."""

    def __init__(self, part: Part) -> None:
        self.part = part
        self.nodes = len(part.order)
        self.rest = part.rest
        self.mass = part.mass
        self.law = part.solid_law
        shares = [_Share(cells, self.law) for cells in part.solids]
        self._shares = shares
        self._modes = [
            Hourglass(cells, self.nodes, finite=self.is_finite)
            for cells, share in zip(part.solids, shares, strict=True)
            if share.is_hexahedra
        ]
        self._rows = sparse.vstack([share.slopes(self.nodes) for share in shares], format="csr")
        self._columns = self._rows.T.tocsr()
        self._volumes = np.concatenate([share.volumes.ravel() for share in shares])
        self._material = np.concatenate([share.material for share in shares])
        self._viscous = np.concatenate([share.viscous for share in shares])
        self._pattern = assembly.Pattern(self.nodes, [cells.nodes for cells in part.solids])
        self._u = np.zeros((self.nodes, 3))
        self._slopes: dict[str, Floats] = {}
        """∂P/∂F ("tangent") and ∂P_v/∂Ḣ ("rate") of the points at u, shape (points, 9, 9)."""
        self._bricks: dict[str, list[Floats]] = {}
        """The same of hourglass modes: element matrices."""

    @property
    def is_finite(self) -> bool:
        """Whether the law holds for large rotations."""
        return bool(self.law.is_finite)

    def _gradient(self, u: Floats) -> Floats:
        """H at all points, shape (points, 3, 3): row i of it is the gradient of u_i."""
        return np.asarray((self._rows @ u).reshape(-1, 3, 3).transpose(0, 2, 1))

    def _at_points(self, what: str, H: Floats, width: int) -> Floats:
        out = np.empty((len(H), width))
        rows = np.ascontiguousarray(H.reshape(-1, 9))
        material = self._viscous if what == "rate" else self._material
        _kernel(self.law, what, material.shape[1])(rows, material, out)
        return out

    def _spread(self, stresses: Floats) -> Floats:
        """Dᵀ (V P), shape (nodes, 3)."""
        weighted = stresses.reshape(-1, 3, 3) * self._volumes[:, None, None]
        return np.asarray(self._columns @ weighted.transpose(0, 2, 1).reshape(-1, 3))

    def look(self, u: Floats) -> None:
        """Choose the state u of the products that follow."""
        if not self._slopes or not np.array_equal(u, self._u):
            self._u, self._slopes, self._bricks = u.copy(), {}, {}

    def _slope(self, what: str) -> Floats:
        if what not in self._slopes:
            H = self._gradient(self._u)
            self._slopes[what] = self._at_points(what, H, 81).reshape(-1, 9, 9)
        return self._slopes[what]

    def _hourglass(self, what: str) -> list[Floats]:
        if what not in self._bricks:
            self._bricks[what] = [g.matrices(what, self._u) for g in self._modes]
        return self._bricks[what]

    def _times(self, what: str, w: Floats) -> Floats:
        total = self._spread(np.matmul(self._slope(what), self._gradient(w).reshape(-1, 9, 1)))
        for modes, matrices in zip(self._modes, self._hourglass(what), strict=True):
            total += modes.times(matrices, w)
        return total

    def force(self, u: Floats) -> Floats:
        """Elastic forces f(u) = −∂V/∂u [N], shape (nodes, 3)."""
        total = -self._spread(self._at_points("stress", self._gradient(u), 9))
        for modes in self._modes:
            total += modes.force(u)
        return total

    def stiffness_times(self, w: Floats, u: Floats | None = None) -> Floats:
        """K(u) w [N], shape (nodes, 3); without u, at the state looked at."""
        if u is not None:
            self.look(u)
        return self._times("tangent", w)

    def viscosity_times(self, w: Floats, u: Floats | None = None) -> Floats:
        """C(u) w [N] of φ and η (point damping left out), shape (nodes, 3)."""
        if u is not None:
            self.look(u)
        return self._times("rate", w)

    def energy(self, u: Floats) -> float:
        """Elastic energy V(u) [J]."""
        densities = self._at_points("energy", self._gradient(u), 1)[:, 0]
        return float(self._volumes @ densities) + sum(modes.energy(u) for modes in self._modes)

    def least_volume_change(self, u: Floats) -> float:
        """Smallest det F over all points."""
        return float(np.linalg.det(np.eye(3) + self._gradient(u)).min())

    def stiffness(self, u: Floats) -> sparse.csc_matrix:
        """K(u) [N/m] as a sparse matrix, unknown 3 node + axis."""
        return self._assembled("tangent", u)

    def viscosity(self, u: Floats) -> sparse.csc_matrix:
        """C(u) [N·s/m] as a sparse matrix (point damping left out)."""
        return self._assembled("rate", u)

    def _assembled(self, what: str, u: Floats) -> sparse.csc_matrix:
        self.look(u)
        slopes, begun, matrices = self._slope(what), 0, []
        bricks = iter(self._hourglass(what))
        for share in self._shares:
            count = share.volumes.size
            own = share.matrices(slopes[begun : begun + count])
            matrices.append(own + next(bricks) if share.is_hexahedra else own)
            begun += count
        return self._pattern.matrix(matrices)

    def stiffness_blocks(self, u: Floats) -> Floats:
        """The 3×3 blocks on the diagonal of K(u) [N/m], shape (nodes, 3, 3)."""
        return assembly.diagonal_blocks(self.stiffness(u))

    def consistent_mass(self) -> sparse.csc_matrix:
        """Consistent mass [kg] between nodes."""
        return assembly.consistent_mass(self.part)


class _Share:
    """Cells of one element and material."""

    def __init__(self, cells: Any, law: Any) -> None:
        self.nodes = cells.nodes
        self.gradients = cells.gradients
        self.is_hexahedra = issubclass(cells.element, Hexahedron)
        quadratic = issubclass(cells.element, Quadratic)
        whole = cells.element.at_points(cells.rest)[1] if quadratic else cells.volume[:, None]
        self.volumes = np.asarray(whole, np.float64)
        numbers = np.array(law.constants(*cells.elastic), np.float64)
        self.material = np.tile(numbers, (self.volumes.size, 1))
        self.viscous = np.tile(np.array(cells.viscous, np.float64), (self.volumes.size, 1))

    def slopes(self, nodes: int) -> sparse.csr_matrix:
        """D of these cells, shape (3 points, nodes): row 3 q + j has ∂N/∂x_j."""
        cells, points, corners, _ = self.gradients.shape
        values = self.gradients.transpose(0, 1, 3, 2).ravel()
        columns = np.repeat(self.nodes, 3 * points, axis=0).ravel()
        starts = np.arange(0, len(values) + 1, corners)
        return sparse.csr_matrix((values, columns, starts), shape=(3 * cells * points, nodes))

    def matrices(self, tangents: Floats) -> Floats:
        """K_e [N/m], shape (cells, 3 corners, 3 corners):
        K_aibj = Σ_q V_q ∂_k N_a A_ikjl ∂_l N_b.
        """
        cells, points, corners, _ = self.gradients.shape
        g = self.gradients
        weighted = (g * self.volumes[:, :, None, None]).transpose(0, 1, 3, 2)
        A = tangents.reshape(cells, points, 27, 3)
        right = np.matmul(A, np.ascontiguousarray(g.transpose(0, 1, 3, 2)))  # ikj b
        right = right.reshape(cells, points, 3, 3, 3, corners).transpose(0, 1, 3, 2, 4, 5)
        right = right.reshape(cells, 3 * points, 9 * corners)
        left = weighted.reshape(cells, 3 * points, corners).transpose(0, 2, 1)
        size = 3 * corners
        whole = np.matmul(left, right).reshape(cells, corners, 3, 3, corners)
        return np.asarray(whole.transpose(0, 1, 2, 4, 3).reshape(cells, size, size))


def _kernel(law: Any, what: str, columns: int) -> Any:
    if not runtime.generation:
        runtime.start()
    kernels = runtime.kernels_of_laws()
    key = (law, what, columns)
    if key not in kernels:
        kernels[key] = runtime.timed(law_kernel(*key))
    return kernels[key]
