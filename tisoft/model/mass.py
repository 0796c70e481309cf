# mypy: ignore-errors
"""The consistent mass matrix of scenes' nodes, and the vectors of its solve, as Taichi fields.

M_ab = Σ ρ V/20 (1 + δ_ab)   over the tets that hold nodes a and b; rows sum to lumped masses
"""

from typing import ClassVar

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from tisoft import runtime

ITERATIONS = {"f32": 18, "f64": 36}
"""0.382^k reaches the rounding of the precision (`step.consistent_mass`)."""

A = ti.types.ndarray()


def mass_rows(
    tets: NDArray[np.integer], mass: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Entries (row, column, M_ab [kg]) of tets of the given masses [kg], each pair once, by row."""
    rows = np.repeat(tets, 4, axis=1).ravel().astype(np.int64)
    columns = np.tile(tets, (1, 4)).ravel().astype(np.int64)
    weight = np.full((4, 4), 1.0 / 20.0) + np.eye(4) / 20.0
    values = (mass[:, None] * weight.ravel()).ravel()
    span = int(columns.max(initial=0)) + 1
    keys, index = np.unique(rows * span + columns, return_inverse=True)
    return keys // span, keys % span, np.bincount(index, values, minlength=len(keys))


@ti.data_oriented
class ConsistentMass:
    """Rows of the mass matrix of scenes' nodes, and the vectors of the solve.

    Args:
        structure: "f32" or "f64".
        rows: of each kind, see LEAST.
    """

    LEAST: ClassVar = {"nodes": 4096, "entries": 65536}

    def __init__(self, structure: str, rows: dict[str, int]) -> None:
        real = runtime.real_type(structure)[1]
        self.serial = runtime.on_cpu()
        self.iterations = ITERATIONS[structure]
        vec3 = ti.types.vector(3, real)
        self.start = ti.field(ti.i32)
        """Where the node's entries begin."""
        self.diagonal = ti.field(real)
        """M_ii [kg]."""
        self.force = vec3.field()
        """Force of the elements [N]."""
        self.solution = vec3.field()
        """a [m/s²]."""
        self.residual = vec3.field()
        """D⁻¹(f − M a) [m/s²]."""
        self.direction = (vec3.field(), vec3.field())
        """d of this and of the next iteration [m/s²]."""
        self.column = ti.field(ti.i32)
        """Node of the entry, counted like the rows here."""
        self.entry = ti.field(real)
        """M_ij [kg]."""
        builder = ti.FieldsBuilder()
        nodes = (self.start, self.diagonal, self.force, self.solution, self.residual)
        for made in (*nodes, *self.direction):
            builder.dense(ti.i, rows["nodes"]).place(made)
        for made in (self.column, self.entry):
            builder.dense(ti.i, rows["entries"]).place(made)
        self.tree = builder.finalize()

    @staticmethod
    def bytes_of(structure: str, rows: dict[str, int]) -> int:
        """Memory that the fields take [bytes]."""
        real = 8 if structure == "f64" else 4
        return rows["nodes"] * (16 * real + 4) + rows["entries"] * (4 + real)

    def destroy(self) -> None:
        """Free the memory; the fields are dead."""
        self.tree.destroy()

    @ti.kernel
    def write(self, first: int, starts: A, diagonal: A, entry: int, columns: A, entries: A):
        """Write a scene's matrix: nodes from row `first`, entries from row `entry` on."""
        ti.loop_config(serialize=self.serial)
        for k in range(starts.shape[0]):
            self.start[first + k] = starts[k]
        ti.loop_config(serialize=self.serial)
        for k in range(diagonal.shape[0]):
            self.diagonal[first + k] = diagonal[k]
        ti.loop_config(serialize=self.serial)
        for k in range(columns.shape[0]):
            self.column[entry + k] = columns[k]
            self.entry[entry + k] = entries[k]

    @ti.kernel
    def read_residual(self, first: int, out: A):
        """Read f − M a of the last solve [N]."""
        ti.loop_config(serialize=self.serial)
        for k in range(out.shape[0]):
            for d in ti.static(range(3)):
                out[k, d] = self.residual[first + k][d] * self.diagonal[first + k]
