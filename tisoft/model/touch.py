# mypy: ignore-errors
"""Points of carried surfaces that meet obstacles, as Taichi fields."""

from typing import Any, ClassVar

import numpy as np
import taichi as ti
from numpy.typing import NDArray

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
        self.group = ti.field(ti.i32)
        """Of the first point that its nodes carry: how many they carry, it and those after it."""
        self.spread = ti.field(real)
        """Most of Σ |N_a| over these."""
        builder = ti.FieldsBuilder()
        builder.dense(ti.ij, (rows["points"], self.corners)).place(self.corner, self.share)
        builder.dense(ti.i, rows["points"]).place(self.first, self.last, self.group, self.spread)
        self.tree = builder.finalize()

    @staticmethod
    def bytes_of(structure: Any, rows: dict[str, int]) -> int:
        """Memory that the fields take [bytes]."""
        real = 8 if structure[0] == "f64" else 4
        return rows["points"] * (structure[1] * (4 + real) + 12 + real)

    def destroy(self) -> None:
        """Free the memory; the fields are dead."""
        self.tree.destroy()

    @ti.kernel
    def write(self, row: int, corner: A, share: A, group: A, spread: A):
        """Write the points from a row on."""
        ti.loop_config(serialize=self.serial)
        for k in range(corner.shape[0]):
            self.group[row + k] = group[k]
            self.spread[row + k] = spread[k]
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


def groups(
    corners: NDArray[np.int32], shares: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """`Touch.group` and `Touch.spread` of points, shapes (points,); those that the same nodes carry
    stand together.
    """
    starts = np.flatnonzero(np.append(True, (corners[1:] != corners[:-1]).any(axis=1)))
    group, spread = np.zeros(len(corners), np.int32), np.zeros(len(corners))
    group[starts] = np.diff(np.append(starts, len(corners)))
    spread[starts] = np.maximum.reduceat(np.abs(shares).sum(axis=1), starts)
    return group, spread
