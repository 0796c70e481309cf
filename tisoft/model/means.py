# mypy: ignore-errors
"""Patches of carried surfaces that pins hold by the mean displacement of each cell, as Taichi
fields (`step.means`).
"""

from typing import ClassVar

import taichi as ti

from tisoft import runtime

CORNERS = 8
STILL, PATH, TURN = range(3)
"""How a pin moves what it holds."""

A = ti.types.ndarray()


@ti.data_oriented
class Means:
    """Fields of cells of patches; a scene has a range of the rows.

    Args:
        structure: "f32" or "f64".
        rows: of each kind, see LEAST.
    """

    LEAST: ClassVar = {"means": 512, "entries": 16384}

    def __init__(self, structure: str, rows: dict[str, int]) -> None:
        real, wide = runtime.real_type(structure)[1], ti.f64 if runtime.has_f64() else ti.f32
        self.serial = runtime.on_cpu()
        self.real, self.wide = real, wide
        self.node = ti.field(ti.i32)
        """Nodes of the cell."""
        self.share = ti.field(real)
        """c_a, their shares of the mean."""
        self.group = ti.field(ti.i32)
        """First of the body's rows, one past the last, and where the row of the inverse begins."""
        self.motion = ti.field(ti.i32)
        """How it moves, and the first of its signals."""
        self.along = ti.Vector.field(3, real)
        self.across = ti.Vector.field(3, real)
        """Velocities of the signals of a turn."""
        self.target = ti.Vector.field(3, real)
        """The mean displacement that it has [m], where it is still."""
        self.excess = ti.Vector.field(3, wide)
        """Cv − V [m/s]."""
        self.push = ti.Vector.field(3, wide)
        """Impulses λ that take it away [N·s]."""
        self.inverse = ti.Vector.field(3, wide)
        """(C M⁻¹ Cᵀ)⁻¹ of each axis [kg]; 0 where the axis is free."""
        builder = ti.FieldsBuilder()
        builder.dense(ti.ij, (rows["means"], CORNERS)).place(self.node, self.share)
        builder.dense(ti.ij, (rows["means"], 3)).place(self.group)
        builder.dense(ti.ij, (rows["means"], 2)).place(self.motion)
        builder.dense(ti.i, rows["means"]).place(
            self.along, self.across, self.target, self.excess, self.push
        )
        builder.dense(ti.i, rows["entries"]).place(self.inverse)
        self.tree = builder.finalize()

    @staticmethod
    def bytes_of(structure: str, rows: dict[str, int]) -> int:
        """Memory that the fields take [bytes]."""
        real = 8 if structure == "f64" else 4
        return rows["means"] * (CORNERS * (4 + real) + 20 + 9 * real + 48) + rows["entries"] * 24

    def destroy(self) -> None:
        """Free the memory; the fields are dead."""
        self.tree.destroy()

    @ti.kernel
    def write(self, row: int, words: A, shares: A, vectors: A):
        """Write cells from a row on: nodes, group and motion; shares; along and across."""
        ti.loop_config(serialize=self.serial)
        for k in range(words.shape[0]):
            for a in range(CORNERS):
                self.node[row + k, a] = words[k, a]
                self.share[row + k, a] = shares[k, a]
            for c in range(3):
                self.group[row + k, c] = words[k, CORNERS + c]
            for c in range(2):
                self.motion[row + k, c] = words[k, CORNERS + 3 + c]
            for d in ti.static(range(3)):
                self.along[row + k][d] = vectors[k, d]
                self.across[row + k][d] = vectors[k, 3 + d]

    @ti.kernel
    def write_targets(self, row: int, targets: A):
        """Write where still cells are held."""
        ti.loop_config(serialize=self.serial)
        for k in range(targets.shape[0]):
            for d in ti.static(range(3)):
                self.target[row + k][d] = targets[k, d]

    @ti.kernel
    def write_inverse(self, entry: int, numbers: A):
        """Write rows of inverses, three axes each."""
        ti.loop_config(serialize=self.serial)
        for k in range(numbers.shape[0]):
            for d in ti.static(range(3)):
                self.inverse[entry + k][d] = numbers[k, d]
