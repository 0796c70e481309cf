"""One body's forces, energy, K(u) w and C(u) w in f64: what statics, modes and the sharp step use.

Unlike the fields of a running scene, these are always f64 and hold a single body: bodies do not
touch in a static problem, so each is solved on its own.
"""

from __future__ import annotations

from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tisoft import runtime
from tisoft.body import Body
from tisoft.equilibrium import assembly, kernels
from tisoft.equilibrium.at_rest import AtRest
from tisoft.equilibrium.pointwise import Pointwise, is_pointwise
from tisoft.model.cells import Cells, cells_of
from tisoft.model.part import Part, parts_of
from tisoft.model.system import System
from tisoft.models.materials import Linear, MassTensor

Floats = NDArray[np.float64]


class Elastic:
    """Operators of one body; displacements u and directions w [m], shape (nodes, 3), internal
    order.  A mass-tensor body is computed as the linear cells whose stiffness it stores.

    Args:
        part: the body's share of a scene.
    """

    def __init__(self, part: Part) -> None:
        if not runtime.generation:
            runtime.start()
        self.nodes = len(part.order)
        self.rest = part.rest
        self.system = System([plain_body(part.body)], "f64")
        self.part = self.system.parts[0]
        self.mass = part.mass
        self._pattern: assembly.Pattern | None = None
        self._solids: list[Cells] | None = None
        self._out = np.zeros((self.nodes, 3))

    @property
    def is_finite(self) -> bool:
        """Whether the law holds for large rotations; True for springs."""
        law = self.part.solid_law
        return law is None or bool(law.is_finite)

    def _kernel(self, name: Any, make: Any) -> Any:
        blocks = tuple(share.block for share in self.system.shares)
        state, alone = self.system.state, self.system.is_small
        key = (name, *blocks, alone)
        return self.system.lease.arena.kernel(key, lambda: make(state, blocks, alone))

    def _operate(self, what: int, given: Floats) -> Floats:
        self.system.check_alive()
        launch = self._kernel(
            ("operate", what),
            lambda state, blocks, alone: kernels.make_operator(state, blocks, what, alone),
        )
        rows = np.ascontiguousarray(given.reshape(-1, 3), np.float64)
        launch(self.system.scene, self.system.first, rows, self._out)
        return self._out.copy()

    def look(self, u: Floats) -> None:
        """Choose the state u of the products that follow."""
        self.system.set_motion(u, np.zeros((self.nodes, 3)))

    def force(self, u: Floats) -> Floats:
        """Elastic forces f(u) = −∂V/∂u [N], shape (nodes, 3)."""
        return self._operate(kernels.FORCE, u)

    def stiffness_times(self, w: Floats, u: Floats | None = None) -> Floats:
        """K(u) w [N], shape (nodes, 3); without u, at the state of the last call."""
        if u is not None:
            self.look(u)
        return self._operate(kernels.PRODUCT, w)

    def viscosity_times(self, w: Floats, u: Floats | None = None) -> Floats:
        """C(u) w [N] of φ, η and dampers (point damping left out), shape (nodes, 3)."""
        if u is not None:
            self.look(u)
        return -self._operate(kernels.RATE, w)

    def energy(self, u: Floats) -> float:
        """Elastic energy V(u) [J]."""
        launch = self._kernel("energy", kernels.make_energy)
        rows = np.ascontiguousarray(u.reshape(-1, 3), np.float64)
        return float(launch(self.system.scene, self.system.first, rows))

    def least_volume_change(self, u: Floats) -> float:
        """Smallest det F over the points of the mesh's cells, springs' too; inf without cells."""
        if self._solids is None:
            part = self.part
            self._solids = part.solids or cells_of(
                part.body.mesh, part.center, part.rank, part.body.materials()
            )
        least = [np.linalg.det(cells.deformation(u)).min() for cells in self._solids]
        return float(min(least, default=np.inf))

    @property
    def pattern(self) -> assembly.Pattern:
        """Places of the element matrices in the sparse matrices."""
        if self._pattern is None:
            members = [cells for share in self.system.shares for _, cells in share.members]
            self._pattern = assembly.Pattern(self.nodes, [cells.nodes for cells in members])
        return self._pattern

    def stiffness(self, u: Floats) -> sparse.csc_matrix:
        """K(u) [N/m] as a sparse matrix, unknown 3 node + axis."""
        return self._assemble(u, viscous=False)

    def viscosity(self, u: Floats) -> sparse.csc_matrix:
        """C(u) [N·s/m] as a sparse matrix (point damping left out)."""
        return self._assemble(u, viscous=True)

    def _assemble(self, u: Floats, *, viscous: bool) -> sparse.csc_matrix:
        self.look(u)
        matrices = []
        for share in self.system.shares:
            launch = self.system.lease.arena.kernel(
                ("matrices", viscous, share.block),
                partial(kernels.make_matrices, share.block, self.system.state, viscous),
            )
            batches, size = share.batches, 3 * share.block.corners
            out = np.empty((len(batches.owner), batches.lanes, size, size))
            launch(share.row("batches"), out)
            own = [cells.place for _, cells in share.members]
            matrices += [out.reshape(-1, size, size)[place] for place in own]
        return self.pattern.matrix(matrices)

    def stiffness_blocks(self, u: Floats) -> Floats:
        """The 3×3 blocks on the diagonal of K(u) [N/m], shape (nodes, 3, 3)."""
        return assembly.diagonal_blocks(self.stiffness(u))

    def consistent_mass(self) -> sparse.csc_matrix:
        """Consistent mass [kg] between nodes; that of springs is diagonal."""
        return assembly.consistent_mass(self.part)


Operators = Elastic | Pointwise | AtRest
"""What computes K w and C w of one body."""


def operators_of(part: Part) -> Elastic | Pointwise:
    """What computes one body, deformed: kernels of its elements, or of its law alone."""
    plain = part
    if part.is_tensor:
        plain = parts_of([plain_body(part.body)])[0]
    return Pointwise(plain) if is_pointwise(plain) else Elastic(part)


def operators_at_rest(part: Part) -> Elastic | AtRest:
    """What the modes about rest are computed with: no kernel but for springs."""
    return AtRest(part) if part.solids else Elastic(part)


def plain_body(body: Body) -> Body:
    """The body, mass-tensors as linear elasticity."""
    if not isinstance(body.model, MassTensor):
        return body
    numbers = {f.name: getattr(body.model, f.name) for f in fields(body.model)}
    return replace(body, model=Linear(**numbers))
