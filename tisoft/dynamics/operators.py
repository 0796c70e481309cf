"""One body's forces, energy, K(u) w and C(u) w in f64: what statics, modes and the sharp step use.

Unlike the arrays of a running scene, these are always f64 and belong to a single body: bodies do
not touch in a static problem, so each is solved on its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tisoft import runtime
from tisoft.dynamics.part import Part, law_of
from tisoft.geometry.topology import incidence
from tisoft.models import assembly, tangent
from tisoft.models.laws import LINEAR, TENSOR, law_constants
from tisoft.models.mass_spring import half_springs
from tisoft.models.materials import SolidModel
from tisoft.models.rows import SPRING_COLUMNS
from tisoft.models.tets import gradients

Floats = NDArray[np.float64]


class Elastic:
    """Operators of one body; displacements u and directions w [m], shape (nodes, 3), inside order.

    Args:
        part: the body's share, as `system.parts_of` numbers it.
    """

    def __init__(self, part: Part) -> None:
        if not runtime.generation:
            runtime.start()
        self.part = part
        self.nodes = len(part.order)
        self.mass = part.mass
        self.rest = (part.body.mesh.points - part.center)[part.order]
        model = part.body.model
        self.law = LINEAR
        self.constants = np.zeros(4)
        if isinstance(model, SolidModel):
            self.law = law_of(model)
            if self.law == TENSOR:  # mass-tensors store the stiffness of linear tets
                self.law = LINEAR
            self.constants[:2] = law_constants(self.law, model.lame_lambda, model.lame_mu)
            self.constants[2:] = model.phi, model.eta
        self._make_arrays()
        self._launches: dict[int, Any] = {}
        self._pattern: assembly.Pattern | None = None
        self._volumes: tuple[NDArray[np.int64], Floats, Floats] | None = None

    def _make_arrays(self) -> None:
        part = self.part
        tets = part.tets if len(part.tets) else np.zeros((1, 4), np.int32)
        starts, corners = incidence(part.tets, self.nodes)
        rows, others, number = half_springs(part.springs, self.nodes)
        near = np.repeat(np.arange(self.nodes), np.diff(rows))
        data = np.zeros((max(1, len(others)), SPRING_COLUMNS))
        if len(others):
            d = self.rest[others] - self.rest[near]
            k, rest, c = part.spring_numbers[number].T
            length = np.linalg.norm(d, axis=1)
            data[:] = np.column_stack([d, length, length - rest, k, c])
        count = max(1, len(part.tets))

        def make(values: Any, kind: Any = np.float64) -> Any:
            return runtime.array(np.array(values, dtype=kind, order="C"))

        self._tets = (
            make(tets, np.int32),
            make(part.gradient.reshape(-1, 9) if len(part.tets) else np.zeros((1, 9))),
            make(part.volume if len(part.tets) else np.zeros(1)),
            make(self.constants),
        )
        lists = (
            make(starts, np.int32),
            make(corners if len(corners) else [0], np.int32),
        )
        self._springs = (
            make(rows, np.int32),
            make(others if len(others) else [0], np.int32),
            make(data),
        )
        self._slots = make(np.zeros((4 * count, 3)))
        self._u, self._w, self._out = (make(np.zeros((self.nodes, 3))) for _ in range(3))
        self._energies = make(np.zeros(count)), make(np.zeros(self.nodes))
        self._gather = (self._slots, *lists)

    @property
    def flags(self) -> tuple[int, bool, bool]:
        """The law, and whether there are tets and springs."""
        return self.law, len(self.part.tets) > 0, len(self.part.springs) > 0

    def _run(self, what: int, u: Floats | None, w: Floats | None) -> Floats:
        if what not in self._launches:
            self._launches[what] = runtime.bind(
                tangent.nodal, what, *self.flags, *self._tets, *self._gather, *self._springs,
                self._u, self._w, self._out,
            )  # fmt: skip
        if u is not None:
            runtime.write(self._u, u)
        if w is not None:
            runtime.write(self._w, w.reshape(-1, 3))
        self._launches[what]()
        return np.array(runtime.read(self._out), np.float64)

    def force(self, u: Floats) -> Floats:
        """Elastic forces f(u) = −∂V/∂u [N], shape (nodes, 3)."""
        return self._run(tangent.FORCE, u, None)

    def stiffness_times(self, w: Floats, u: Floats | None = None) -> Floats:
        """K(u) w [N], shape (nodes, 3); without u, at the state of the last call."""
        return self._run(tangent.PRODUCT, u, w)

    def viscosity_times(self, w: Floats, u: Floats | None = None) -> Floats:
        """C(u) w [N] of φ, η and dampers (point damping left out), shape (nodes, 3)."""
        return self._run(tangent.RATE, u, w)

    def energy(self, u: Floats) -> float:
        """Elastic energy V(u) [J]."""
        if -1 not in self._launches:
            self._launches[-1] = runtime.bind(
                tangent.energies, *self.flags, *self._tets, *self._springs, self._u,
                *self._energies,
            )  # fmt: skip
        runtime.write(self._u, u)
        self._launches[-1]()
        return float(sum(runtime.read(a).sum() for a in self._energies))

    def deformation(self, u: Floats) -> Floats:
        """F of each tet, shape (tets, 3, 3)."""
        return assembly.deformation(self.part.gradient, self.part.tets, u)

    def least_volume_change(self, u: Floats) -> float:
        """Smallest det F over the tets of the mesh, springs' too; inf without tets."""
        mesh = self.part.body.mesh
        if not len(mesh.tets):
            return float("inf")
        if len(self.part.tets):
            return float(np.linalg.det(self.deformation(u)).min())
        if self._volumes is None:
            tets = self.part.rank[mesh.tets]
            self._volumes = tets, *gradients(self.rest, tets)
        F = assembly.deformation(self._volumes[1], self._volumes[0], u)
        return float(np.linalg.det(F).min())

    @property
    def pattern(self) -> assembly.Pattern:
        """Places of the blocks in the sparse matrices."""
        if self._pattern is None:
            self._pattern = assembly.Pattern(self.nodes, self.part.tets, self.part.springs)
        return self._pattern

    def stiffness(self, u: Floats) -> sparse.csc_matrix:
        """K(u) [N/m] as a sparse matrix, unknown 3 node + axis."""
        blocks = assembly.tangent_blocks(self.law, self._shape(u), *self.constants[:2])
        return self._assemble(u, blocks, 0)

    def stiffness_blocks(self, u: Floats) -> Floats:
        """The 3×3 blocks on the diagonal of K(u) [N/m], shape (nodes, 3, 3)."""
        matrix = self.stiffness(u).tobsr((3, 3))
        rows = np.repeat(np.arange(self.nodes), np.diff(matrix.indptr))
        blocks: Floats = matrix.data[matrix.indices == rows].copy()
        return blocks

    def viscosity(self, u: Floats) -> sparse.csc_matrix:
        """C(u) [N·s/m] as a sparse matrix (point damping left out)."""
        blocks = assembly.viscous_blocks(self.law, self._shape(u), *self.constants[2:])
        return self._assemble(u, blocks, 2)

    def _shape(self, u: Floats) -> Floats:
        if not len(self.part.tets):
            return np.empty((0, 3, 3))
        return self.deformation(u)

    def _assemble(self, u: Floats, blocks: Floats, column: int) -> sparse.csc_matrix:
        part = self.part
        tets = np.empty((0, 4, 3, 4, 3))
        if len(part.tets):
            tets = assembly.element_matrices(part.gradient, part.volume, blocks)
        springs = np.empty((0, 3, 3))
        if len(part.springs):
            a, b = part.springs.T
            along = part.spring_numbers[:, column]
            d = self.rest[b] - self.rest[a]
            y = d + (u[b] - u[a])
            pull = np.zeros(len(y))
            if column == 0:
                length = np.linalg.norm(y, axis=1)
                pull = along * (1.0 - part.spring_numbers[:, 1] / length)
            springs = assembly.spring_matrices(y, pull, along)
        return self.pattern.matrix(tets, springs)

    def consistent_mass(self) -> sparse.csc_matrix:
        """Consistent mass [kg] between nodes; springs have point masses, so theirs is diagonal."""
        model = self.part.body.model
        if not isinstance(model, SolidModel):
            return sparse.diags(self.mass, format="csc")
        return assembly.consistent_mass(self.nodes, self.part.tets, self.part.volume, model.density)
