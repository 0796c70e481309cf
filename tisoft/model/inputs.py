# mypy: ignore-errors
"""Inputs in time, as Taichi fields: what acts on which node, and how much in each pass.

A signal is a number for each pass of a launch (the mean of a load's factor over the substep, a
component of a pin's velocity), written before the launch.  A node has a row for each thing that
acts on it, which says which signals it follows.
"""

from typing import ClassVar

import taichi as ti

from tisoft import runtime
from tisoft.model.placing import placer

LOAD, TORQUE, PRESSURE, PATH, TURN, GRAVITY = range(6)
"""Kinds of rows: force `along` times a signal; share `along[0]` of torque `target`; pressure row
`target` of `State` with `along[0]`; components `target` (bits) with three signals of velocity;
velocity `along` and `across` times two signals; mass `along[0]` times three signals."""
NODES, VALUES, STRIDE, FIRST_TORQUE, LAST_TORQUE, FIRST_MOVED, LAST_MOVED = range(7)
"""Columns of `Inputs.scene`: from a node to its row of `start`, first value, values a signal, the
scene's torques, and its moved obstacles."""

A = ti.types.ndarray()


@ti.data_oriented
class Inputs:
    """Rows of inputs of scenes.

    Args:
        structure: "f32" or "f64".
        rows: of each kind, see LEAST.
    """

    LEAST: ClassVar = {
        "nodes": 4096,
        "rows": 8192,
        "values": 65536,
        "turned": 1024,
        "torques": 16,
        "moved": 16,
        "scenes": 16,
    }

    def __init__(self, structure: str, rows: dict[str, int]) -> None:
        real, wide = runtime.real_type(structure)[1], ti.f64 if runtime.has_f64() else ti.f32
        self.serial = runtime.on_cpu()
        self.real, self.wide = real, wide
        near, far = ti.types.vector(3, real), ti.types.vector(3, wide)
        builder, field = placer(rows)

        self.start = field(ti.i32, "nodes")
        """Where a node's rows begin."""
        self.kind = field(ti.i32, "rows")
        self.target = field(ti.i32, "rows")
        self.signal = field(ti.i32, "rows")
        """The first of its signals, counted from the scene's first."""
        self.along = field(near, "rows")
        self.across = field(near, "rows")
        self.value = field(wide, "values")
        """Signals, each a number a pass of the launch."""
        self.torque_start = field(ti.i32, "torques")
        """Where the nodes that a torque turns begin."""
        self.torque_signal = field(ti.i32, "torques")
        self.moment = field(far, "torques")
        """Its moment at factor 1 [N·m]."""
        self.middle = field(far, "torques")
        """Middle of the displaced points, seen from the body's origin [m]."""
        self.spin = field(far, "torques")
        """ω of the forces w ω × ρ (`step.loading`) [N/m]."""
        self.turned_node = field(ti.i32, "turned")
        self.turned_share = field(wide, "turned")
        self.moved_row = field(ti.i32, "moved")
        """Row of a moved obstacle, one for each body, in `State.obstacle`."""
        self.moved_signal = field(ti.i32, "moved")
        """The first of its signals: its numbers but friction and push."""
        self.scene = field(ti.i32, "scenes", 7)
        self.tree = builder.finalize()

    @staticmethod
    def bytes_of(structure: str, rows: dict[str, int]) -> int:
        """Memory that the fields take [bytes]."""
        real = 8 if structure == "f64" else 4
        return rows["nodes"] * 4 + rows["rows"] * (12 + 6 * real) + rows["values"] * 8

    def destroy(self) -> None:
        """Free the memory; the fields are dead."""
        self.tree.destroy()

    @ti.kernel
    def write_rows(self, node: int, starts: A, row: int, words: A, vectors: A):
        """Write where nodes' rows begin, and rows: kind, target, signal; along and across."""
        ti.loop_config(serialize=self.serial)
        for k in range(starts.shape[0]):
            self.start[node + k] = starts[k]
        ti.loop_config(serialize=self.serial)
        for k in range(words.shape[0]):
            self.kind[row + k] = words[k, 0]
            self.target[row + k] = words[k, 1]
            self.signal[row + k] = words[k, 2]
            for d in ti.static(range(3)):
                self.along[row + k][d] = vectors[k, d]
                self.across[row + k][d] = vectors[k, 3 + d]

    @ti.kernel
    def write_torques(
        self, torque: int, starts: A, signals: A, moments: A, row: int, nodes: A, shares: A
    ):
        """Write torques, and the nodes that they turn with their shares."""
        ti.loop_config(serialize=self.serial)
        for k in range(starts.shape[0]):
            self.torque_start[torque + k] = starts[k]
        ti.loop_config(serialize=self.serial)
        for k in range(signals.shape[0]):
            self.torque_signal[torque + k] = signals[k]
            for d in ti.static(range(3)):
                self.moment[torque + k][d] = moments[k, d]
        ti.loop_config(serialize=self.serial)
        for k in range(nodes.shape[0]):
            self.turned_node[row + k] = nodes[k]
            self.turned_share[row + k] = shares[k]

    @ti.kernel
    def write_moved(self, first: int, rows: A, signals: A):
        """Write the moved obstacles' rows and signals."""
        ti.loop_config(serialize=self.serial)
        for k in range(rows.shape[0]):
            self.moved_row[first + k] = rows[k]
            self.moved_signal[first + k] = signals[k]

    @ti.kernel
    def write_scene(self, scene: int, numbers: A):
        """Write a scene's row."""
        ti.loop_config(serialize=self.serial)
        for k in range(numbers.shape[0]):
            self.scene[scene, k] = numbers[k]

    @ti.kernel
    def write_values(self, first: int, stride: int, values: A):
        """Write signals, shape (signals, passes)."""
        ti.loop_config(serialize=self.serial)
        for k in range(values.shape[0]):
            for column in range(values.shape[1]):
                self.value[first + k * stride + column] = values[k, column]
