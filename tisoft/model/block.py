# mypy: ignore-errors
"""Cells of one element and one law, as Taichi fields: what they join, their rest numbers, material.

Cells stand in batches of `lanes`: LLVM vectorises loops over lanes.  Batches are cut into parts,
fixed pieces of the mesh; a part adds its cells' forces to its own copies of its nodes, one after
the other, and each node adds up its copies in part order.  So there are no atomics, and the bits do
not depend on the number of threads.  On a GPU a lane is a batch, and every batch a part.
"""

from typing import Any, ClassVar

import taichi as ti

from tisoft import runtime
from tisoft.model.placing import placer

A = ti.types.ndarray()


def flux_of(element: Any) -> int:
    """How many numbers say what viscosity does in an element: its stress, or forces on corners."""
    return int(element.stresses or 3 * element.corners)


@ti.data_oriented
class Block:
    """Fields of cells; a scene has a range of the rows of each kind.

    Args:
        structure: element class, law class (None for springs and tensors), "f32" or "f64", lanes.
        rows: of each kind, see LEAST.
    """

    LEAST: ClassVar = {"batches": 1024, "parts": 256, "materials": 64}

    def __init__(self, structure: Any, rows: dict[str, int]) -> None:
        self.element, self.law, precision, self.lanes = structure
        self.serial = runtime.on_cpu()
        self.real = runtime.real_type(precision)[1]
        self.columns = 2 + self.element.constants
        if self.law is not None:
            self.columns += len(self.law.constants(1.0, 1.0))
        self.points, self.known = self.element.points, self.element.known
        corners, numbers, lanes = self.element.corners, self.element.numbers, self.lanes
        self.corners = corners
        self.flux = flux_of(self.element)
        self.behind = 2 * self.element.stresses or self.element.rows
        """Rows of local forces behind those: the viscous share, or stresses and rates."""
        self.wide = ti.f64 if runtime.has_f64() else ti.f32
        builder, field = placer(rows)

        self.cells = field(ti.i32, "batches", corners, lanes)
        """Nodes of the corners."""
        self.places = field(ti.i32, "batches", corners, lanes)
        """Rows of `State.force` that the corners' forces are added to."""
        self.rest = field(self.real, "batches", numbers, lanes)
        """Rest numbers of the element; 0 in lanes that hold no cell."""
        self.modes = field(self.real, "batches", self.known, lanes)
        """ω² [1/s²], damping rate [1/s], what growth adds to ω² [1/(kg/m)] at rest, and weight (see
        `bound`); then what the element's `stiffened` asks for."""
        self.stiffest = field(self.real, "batches", lanes)
        """ω² [1/s²] of each cell as deformed, when the bound was last looked at."""
        self.owner = field(ti.i32, "batches")
        """Row of its material."""
        self.material = field(self.real, "materials", self.columns)
        """The law's constants [Pa], the element's, then φ and η [Pa·s]."""
        self.is_viscous = field(ti.i32, "materials")
        """Whether φ, η or dampers are not 0."""
        self.origin = field(ti.i32, "materials")
        """First node of its body."""
        self.part_start = field(ti.i32, "parts")
        """First batch of each part (and one row more a scene, where the last ends)."""
        self.energy = field(self.wide, "parts")
        """Elastic energy of each part [J]."""
        # Where a ledger is kept:
        self.braked = field(ti.types.vector(lanes, self.real), "batches", self.flux)
        """What viscosity did in the last pass: its stresses or forces, for the seconds that they
        acted [N·m·s or N·s]."""
        self.heat = field(self.wide, "batches")
        """What it has taken since the stretch began, but for half of the last pass [J]."""
        self.lost = field(self.wide, "parts")
        """All that it took in the stretch [J]."""
        self.tree = builder.finalize()

    @staticmethod
    def bytes_of(structure: Any, rows: dict[str, int]) -> int:
        """Memory that the fields take [bytes]."""
        element, _, precision, lanes = structure
        real = 8 if precision == "f64" else 4
        numbers = element.numbers + element.known + flux_of(element) + 1
        cell = element.corners * 8 + numbers * real
        return rows["batches"] * lanes * cell

    def destroy(self) -> None:
        """Free the memory; the fields are dead."""
        self.tree.destroy()

    @ti.kernel
    def write_cells(self, first: int, cells: A, places: A, rest: A, modes: A, owner: A):
        """Fill new rows of batches."""
        ti.loop_config(serialize=self.serial)
        for k in range(owner.shape[0]):
            b = first + k
            self.owner[b] = owner[k]
            for lane in range(self.lanes):
                for c in range(self.corners):
                    self.cells[b, c, lane] = cells[k, c, lane]
                    self.places[b, c, lane] = places[k, c, lane]
                for c in range(self.element.numbers):
                    self.rest[b, c, lane] = rest[k, c, lane]
                for c in range(self.known):
                    self.modes[b, c, lane] = modes[k, c, lane]

    @ti.kernel
    def write_rest(self, first: int, rest: A):
        """Write rest numbers (springs and tensors hold their stiffness there)."""
        ti.loop_config(serialize=self.serial)
        for k in range(rest.shape[0]):
            for c in range(self.element.numbers):
                for lane in range(self.lanes):
                    self.rest[first + k, c, lane] = rest[k, c, lane]

    @ti.kernel
    def write_modes(self, first: int, modes: A):
        """Write what bounds the cells' frequencies at rest."""
        ti.loop_config(serialize=self.serial)
        for k in range(modes.shape[0]):
            for c in range(self.known):
                for lane in range(self.lanes):
                    self.modes[first + k, c, lane] = modes[k, c, lane]

    @ti.kernel
    def write_materials(self, first: int, rows: A, viscous: A, origins: A):
        """Write the materials' rows."""
        ti.loop_config(serialize=self.serial)
        for k in range(viscous.shape[0]):
            self.is_viscous[first + k] = viscous[k]
            self.origin[first + k] = origins[k]
            for c in range(self.columns):
                self.material[first + k, c] = rows[k, c]

    @ti.kernel
    def write_parts(self, first: int, starts: A):
        """Write where the parts begin."""
        ti.loop_config(serialize=self.serial)
        for k in range(starts.shape[0]):
            self.part_start[first + k] = starts[k]

    @ti.kernel
    def read_stiffest(self, first: int, out: A):
        """Read `stiffest` of some batches."""
        ti.loop_config(serialize=self.serial)
        for k in range(out.shape[0]):
            for lane in range(self.lanes):
                out[k, lane] = self.stiffest[first + k, lane]
