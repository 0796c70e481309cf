# mypy: ignore-errors
"""Points of carried surfaces that meet obstacles, as Taichi fields."""

from typing import Any, ClassVar

import taichi as ti

from tisoft import runtime

A = ti.types.ndarray()


@ti.data_oriented
class Touch:
    """Fields of points; a scene has a range of the rows.

    Args:
        structure: "f32" or "f64", and the most nodes that carry a point.
        rows: of each kind, see LEAST.
    """

    LEAST: ClassVar = {"points": 1024}

    def __init__(self, structure: Any, rows: dict[str, int]) -> None:
        precision, self.corners = structure
        real = runtime.real_type(precision)[1]
        self.serial = runtime.on_cpu()
        self.corner = ti.field(ti.i32)
        """Nodes that carry the point."""
        self.share = ti.field(real)
        """Their shares N_a."""
        self.first = ti.field(ti.i32)
        """First row of its body's obstacles."""
        self.last = ti.field(ti.i32)
        """One past the last of them."""
        builder = ti.FieldsBuilder()
        builder.dense(ti.ij, (rows["points"], self.corners)).place(self.corner, self.share)
        builder.dense(ti.i, rows["points"]).place(self.first, self.last)
        self.tree = builder.finalize()

    @staticmethod
    def bytes_of(structure: Any, rows: dict[str, int]) -> int:
        """Memory that the fields take [bytes]."""
        real = 8 if structure[0] == "f64" else 4
        return rows["points"] * (structure[1] * (4 + real) + 8)

    def destroy(self) -> None:
        """Free the memory; the fields are dead."""
        self.tree.destroy()

    @ti.kernel
    def write(self, row: int, corner: A, share: A):
        """Write the points from a row on."""
        ti.loop_config(serialize=self.serial)
        for k in range(corner.shape[0]):
            for a in range(self.corners):
                self.corner[row + k, a] = corner[k, a]
                self.share[row + k, a] = share[k, a]

    @ti.kernel
    def write_obstacles(self, row: int, first: A, last: A):
        """Write where the points' obstacles begin and end."""
        ti.loop_config(serialize=self.serial)
        for k in range(first.shape[0]):
            self.first[row + k] = first[k]
            self.last[row + k] = last[k]
