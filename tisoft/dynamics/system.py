"""All bodies of a scene as one set of arrays: bodies are ranges of nodes and batches.

Positions are kept as world = rest point + origin shift of the body + u: rest points and shifts in
f64 on the host, displacements u in the scene's precision.  A body at 10 km from the world's origin
computes with the same digits as one at 0.  Inside, nodes and tets follow Morton curves; `order`
leads back to the mesh's own order.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.body import Body
from tisoft.dynamics.advance import LANES
from tisoft.dynamics.part import (
    Part,
    check_kind,
    law_of,
    parts_of,
    spring_numbers,
    weigh_tets,
)
from tisoft.models import laws
from tisoft.models.consistent_mass import mass_rows, row_starts
from tisoft.models.mass_spring import half_springs, network
from tisoft.models.mass_tensor import tensor_blocks, tensor_rows
from tisoft.models.materials import MassSpring, SolidModel
from tisoft.models.rows import SPRING_COLUMNS
from tisoft.models.tets import batches, corner_lists, spread, stiffest

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

GPU_LANES = 32


class System:
    """The arrays that kernels work on; see `advance` for their roles."""

    def __init__(self, bodies: list[Body], precision: str) -> None:
        self.parts = parts_of(bodies)
        self.precision = precision
        self.real, self.taichi_real = runtime.real_type(precision)
        self.lanes = LANES if runtime.on_cpu() else GPU_LANES
        self.count = sum(len(p.order) for p in self.parts)
        self.springs = sum(len(p.springs) for p in self.parts)
        self.tets = sum(len(p.tets) for p in self.parts)
        self._make_nodes()
        self._make_tets()
        self._make_springs()
        self._make_tensors()
        self.set_pressures(np.zeros(self.count + 1), np.zeros((1, 2)), np.zeros((1, 7)))
        self.make_ledger(False)
        self._make_mass()
        self.material = self._array(self.material_table())

    def _array(self, values: Any, kind: Any = None) -> Any:
        return runtime.array(np.array(values, dtype=kind or self.real, order="C"))

    def _make_nodes(self) -> None:
        n = self.count
        self.rest_host = np.concatenate(
            [(p.body.mesh.points - p.center)[p.order] for p in self.parts]
        )
        self.mass = np.concatenate([p.mass for p in self.parts])
        self.rest = self._array(self.rest_host)
        self.u = self._array(np.zeros((n, 3)))
        self.v = self._array(np.zeros((n, 3)))
        self.half = self._array(np.zeros((n, 3)))
        self.force = self._array(np.zeros((n, 3)))
        self.load = self._array(np.zeros((n, 3)))
        self.drive = self._array(np.zeros((n, 3)))
        self.held = self._array(np.zeros(n), np.int32)
        self.inverse_mass = self._array(1.0 / self.mass)
        body = np.repeat(np.arange(len(self.parts)), [len(p.order) for p in self.parts])
        self.body = self._array(body, np.int32)

    def _make_tets(self) -> None:
        """Batches by law, then by body; tensors have their rows instead."""
        solid = [p for p in self.parts if len(p.tets)]
        nodes, shapes, owner, starts = [], [], [], [0]
        begun = 0
        for law in range(laws.LAWS):
            for part in solid:
                if law_of(part.body.model) != law:  # type: ignore[arg-type]
                    continue
                made = batches(part.tets, part.gradient, part.volume, self.lanes)
                part.place = made.place + begun * self.lanes
                nodes.append(made.nodes + part.start)
                shapes.append(made.shapes)
                owner.append(np.full(len(made.nodes), part.index))
                begun += len(made.nodes)
            starts.append(begun)
        self.batches = begun
        lanes = self.lanes
        self.nodes = self._array(_join(nodes, (1, 4, lanes)), np.int32)
        self.shapes = self._array(_join(shapes, (1, 10, lanes)))
        self.owner = self._array(_join(owner, (1,)), np.int32)
        self.law_starts = self._array(starts, np.int32)
        self.all_laws = tuple(k for k in range(laws.LAWS) if starts[k + 1] > starts[k])
        self.laws = tuple(k for k in self.all_laws if k != laws.TENSOR)
        self.flat_slots = self._array(np.zeros(max(1, begun) * 12 * lanes))
        on_cpu = runtime.on_cpu()
        self.slots = self.flat_slots.reshape(-1, 12, lanes) if on_cpu else self.flat_slots
        looped = [p for p in solid if not p.is_tensor]
        tets = _join([p.tets + p.start for p in looped], (0, 4)).astype(np.int32)
        place = _join([p.place for p in looped], (0,)).astype(np.int32)
        corner_starts, corners = corner_lists(tets, place, self.count, lanes)
        self.starts = self._array(corner_starts, np.int32)
        self.corners = self._array(corners if len(corners) else [0], np.int32)

    def _make_springs(self) -> None:
        ends = _join([p.springs + p.start for p in self.parts], (0, 2)).astype(np.int64)
        starts, others, number = half_springs(ends, self.count)
        self.half_spring = number
        self.spring_starts = self._array(starts, np.int32)
        self.spring_ends = self._array(others if len(others) else [0], np.int32)
        nodes = np.repeat(np.arange(self.count), np.diff(starts))
        self._vectors = self.rest_host[others] - self.rest_host[nodes]
        self.spring_data = self._array(np.zeros((max(1, len(others)), SPRING_COLUMNS)))
        self.write_springs()

    def reread_models(self) -> None:
        """Take stiffness, rest length, damping and masses anew from the bodies' models.

        Raises:
            FieldError: a model that needs other arrays than those the simulation was built with.
        """
        for part in self.parts:
            check_kind(part)
            if part.is_springs:
                net = network(part.body)
                part.spring_numbers = spring_numbers(net)
                part.mass = net.masses[part.order]
            else:
                weigh_tets(part)
        self.write_springs()
        self._write_mass()

    def _write_mass(self) -> None:
        """Fill the arrays of masses from the parts' (after a density changed)."""
        self.mass[:] = np.concatenate([p.mass for p in self.parts])
        runtime.write(self.inverse_mass, (1.0 / self.mass).astype(self.real))
        diagonal = self.mass
        if self.consistent:
            rows, columns, values = self._mass_rows()
            runtime.write(self.mass_entries, values.astype(self.real))
            diagonal = values[rows == columns]
        runtime.write(self.diagonal, diagonal.astype(self.real))

    def write_springs(self) -> None:
        """Fill the springs' rows from the parts' numbers (after a material changed)."""
        if not self.springs:
            return
        k, rest, c = np.concatenate([p.spring_numbers for p in self.parts])[self.half_spring].T
        length = np.linalg.norm(self._vectors, axis=1)
        columns = np.column_stack([self._vectors, length, length - rest, k, c])
        runtime.write(self.spring_data, columns.astype(self.real))

    def _make_tensors(self) -> None:
        bodies = [p for p in self.parts if p.is_tensor]
        self.tensors = bool(bodies)
        entries = [self._tensor_rows(part, viscous=False) for part in bodies]
        rows = _join([e[0] for e in entries], (0,)).astype(np.int64)
        columns = _join([e[1] for e in entries], (1,))
        self.tensor_starts = self._array(row_starts(rows, self.count), np.int32)
        self.tensor_ends = self._array(columns, np.int32)
        self.stiffness = self._array(_join([e[2] for e in entries], (1, 9)))
        self.viscosity = self._array(np.zeros((max(1, len(rows)), 9)))
        self.write_tensors()

    def _tensor_rows(self, part: Part, *, viscous: bool) -> tuple[Any, Any, Floats]:
        model = part.body.model
        assert isinstance(model, SolidModel)
        pair = (model.phi, model.eta) if viscous else (model.lame_lambda, model.lame_mu)
        blocks = tensor_blocks(part.gradient, part.volume, *pair)
        rows, columns, values = tensor_rows(part.tets, blocks)
        return rows + part.start, columns + part.start, values

    def write_tensors(self) -> None:
        """Fill the mass-tensor rows from the materials (also after one changed)."""
        bodies = [p for p in self.parts if p.is_tensor]
        for viscous, target in ((False, self.stiffness), (True, self.viscosity)):
            if bodies:
                blocks = [self._tensor_rows(part, viscous=viscous)[2] for part in bodies]
                runtime.write(target, np.concatenate(blocks).astype(self.real))

    def _make_mass(self) -> None:
        """Rows of the consistent mass matrix; one entry for nodes of lumped bodies."""
        self.consistent = any(part.is_consistent for part in self.parts)
        rows, columns, values = self._mass_rows()
        self.mass_starts = self._array(row_starts(rows, self.count), np.int32)
        self.mass_ends = self._array(columns, np.int32)
        self.mass_entries = self._array(values)
        self.diagonal = self._array(values[rows == columns] if self.consistent else self.mass)
        shape = (self.count if self.consistent else 1, 3)
        self.acceleration = self._array(np.zeros(shape))
        self.residual = self._array(np.zeros(shape))
        self.direction = self._array(np.zeros((2, *shape)))

    def set_pressures(self, starts: Any, ends: Any, data: Any) -> None:
        """Rows of `pressure.pressure_force`, which a stepper must be bound to anew."""
        self.pressure_starts = self._array(starts, np.int32)
        self.pressure_ends = self._array(ends, np.int32)
        self.pressure_data = self._array(data)
        self.pressed = self._array(np.zeros((self.count, 3)))

    def make_ledger(self, on: bool) -> None:
        """Arrays of the ledger: elements' forces without viscosity [N], and `work`, the dissipated
        energy and the external work of a frame [J] per node, shape (nodes, 2).
        """
        wide = np.float64 if runtime.has_f64() else np.float32
        self.work = self._array(np.zeros((self.count if on else 1, 2)), wide)
        self.still = self._array(np.zeros((self.count if on else 1, 3)))
        size = runtime.read(self.flat_slots).size if on else 12 * self.lanes
        self.still_flat = self._array(np.zeros(size))
        shape = (-1, 12, self.lanes)
        self.still_slots = self.still_flat.reshape(shape) if runtime.on_cpu() else self.still_flat

    def clear_work(self) -> None:
        """Begin a frame's ledger."""
        runtime.write(self.work, np.zeros((self.count, 2)))

    def _mass_rows(self) -> tuple[NDArray[np.int64], NDArray[Any], Floats]:
        """Rows, columns and entries [kg] of the consistent mass matrix; nothing where all lump."""
        entries = [_mass_entries(part) for part in self.parts] if self.consistent else []
        rows = _join([e[0] for e in entries], (0,)).astype(np.int64)
        return rows, _join([e[1] for e in entries], (1,)), _join([e[2] for e in entries], (1,))

    def material_table(self) -> Floats:
        """λ', μ' of the law, φ, η [Pa, Pa·s] and point damping [1/s], shape (bodies, 5)."""
        rows = np.zeros((len(self.parts), 5))
        for row, part in zip(rows, self.parts, strict=True):
            model = part.body.model
            row[4] = model.point_damping
            if isinstance(model, SolidModel):
                row[:2] = laws.law_constants(law_of(model), model.lame_lambda, model.lame_mu)
                row[2:4] = model.phi, model.eta
        return rows

    def viscous(self) -> bool:
        """Whether any body damps the rate of its strain or of its springs."""
        return any(
            bool(p.spring_numbers[:, 2].any())
            if isinstance(p.body.model, MassSpring)
            else bool(p.body.model.phi or p.body.model.eta)
            for p in self.parts
        )

    def element_frequencies(self) -> tuple[Floats, Floats, Floats]:
        """Per place (batch · lanes + lane): ω² [1/s²] and damping rate 2ζω [1/s] of the tet's
        stiffest mode at rest, with its own lumped mass, and 4γ/ρ [1/(kg/m)] (see `stable_step`).
        """
        out = np.zeros((3, max(1, self.batches) * self.lanes))
        for part in self.parts:
            model = part.body.model
            if not isinstance(model, SolidModel):
                continue
            # A tet's consistent mass is a fifth of its lumped one for all but its translation.
            scale = (20.0 if part.is_consistent else 4.0) / model.density
            lam, mu = model.lame_lambda, model.lame_mu
            out[0, part.place] = scale * stiffest(part.gradient, lam, mu)
            if model.phi or model.eta:
                out[1, part.place] = scale * stiffest(part.gradient, model.phi, model.eta)
            out[2, part.place] = scale * spread(part.gradient)
        return out[0], out[1], out[2]

    def world(self, u: NDArray[Any] | None = None) -> Floats:
        """World positions [m] of all nodes, inside order, f64, shape (nodes, 3)."""
        here = np.array(runtime.read(self.u) if u is None else u, dtype=np.float64)
        here += self.rest_host
        for part in self.parts:
            here[part.nodes] += part.center + part.shift
        return here


def _mass_entries(part: Part) -> tuple[Any, Any, Floats]:
    model = part.body.model
    if not part.is_consistent:
        nodes = np.arange(len(part.order)) + part.start
        return nodes, nodes, part.mass
    assert isinstance(model, SolidModel)
    rows, columns, values = mass_rows(part.tets, model.density * part.volume)
    return rows + part.start, columns + part.start, values


def _join(blocks: list[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    return np.concatenate(blocks) if blocks else np.zeros(shape)
