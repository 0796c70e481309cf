"""Rows of Taichi fields that a scene's bodies are lent, and what is written there once.

Nodes, cells by element and law, the consistent mass matrix and points of carried surfaces each have
rows of their own kind; a dead scene's are given back.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.body import Body
from tisoft.model import state as columns
from tisoft.model.arena import Lease, Pool
from tisoft.model.block import Block
from tisoft.model.cells import Cells
from tisoft.model.layout import Batches, copies_of, in_batches, lanes_of
from tisoft.model.mass import ConsistentMass, mass_rows
from tisoft.model.part import Part, parts_of
from tisoft.model.state import State
from tisoft.model.touch import Touch, groups

Floats = NDArray[np.float64]

SMALL = 2000
"""Cells up to which one thread looks at them sooner than two can be called."""


@dataclass
class Share:
    """A scene's cells of one element and one law."""

    members: list[tuple[Part, Cells]]
    batches: Batches
    lease: Lease

    @property
    def parts(self) -> list[Part]:
        """The body of each member."""
        return [part for part, _ in self.members]

    @property
    def block(self) -> Any:
        """The fields."""
        return self.lease.fields

    def row(self, kind: str) -> int:
        """First row of a kind."""
        return self.lease.starts[kind]


class Lent:
    """The bodies of a scene, numbered, and their rows of fields.

    Args:
        bodies: damping ratios already turned into viscosity.
        precision: "f32" or "f64".
        probes: nodes to record, as (body, row of `mesh.points`).
    """

    def __init__(
        self, bodies: Sequence[Body], precision: str, probes: Sequence[tuple[int, int]] = ()
    ) -> None:
        self.parts = parts_of(list(bodies))
        self.precision = precision
        self.real = runtime.real_type(precision)[0]
        self.count = sum(len(p.order) for p in self.parts)
        self.written = 0
        """How often the motion was written, not made by substeps."""
        self.springs = sum(len(p.springs) for p in self.parts)
        self.elements = sum(p.elements for p in self.parts)
        self.rest_host = np.concatenate([p.rest for p in self.parts])
        self.mass = np.concatenate([p.mass for p in self.parts])
        self.consistent = any(part.is_consistent for part in self.parts)
        self.generation = runtime.generation
        self._leases: list[Lease] = []
        self._ender = weakref.finalize(self, _end, self._leases)
        self._probes = [self.parts[b].start + int(self.parts[b].rank[row]) for b, row in probes]
        self._build()

    def _build(self) -> None:
        pool = runtime.pool(Pool)
        groups: dict[Any, list[tuple[Part, Cells]]] = {}
        for part in self.parts:
            for cells in part.blocks():
                groups.setdefault((cells.element, part.law), []).append((part, cells))
        made = []
        lanes = lanes_of(runtime.on_cpu())
        for key, members in groups.items():
            batches = in_batches([cells.nodes + part.start for part, cells in members], lanes)
            if not len(batches.owner):
                continue
            for (_, cells), place in zip(members, batches.place, strict=True):
                cells.place = place
            made.append((key, members, batches))
        places, copy_starts = copies_of([batches for _, _, batches in made], self.count)
        self._lend_nodes(pool, int(copy_starts[-1]))
        self._write_nodes(copy_starts)
        self.shares = []
        for (key, members, batches), copies in zip(made, places, strict=True):
            self.shares.append(self._lend_cells(pool, key, members, batches))
            self._write_cells(self.shares[-1], copies)
        self.mass_lease = self._lend_mass(pool) if self.consistent else None
        self.touch_lease = self._lend_touch(pool)
        self._write_scene()

    def _lend_nodes(self, pool: Pool, copies: int) -> None:
        pressures = sum(p.pressed_rows for p in self.parts)
        needs = {
            "nodes": self.count + 1,
            "copies": max(1, copies),
            "bodies": len(self.parts) + 1,
            "chunks": -(-self.count // columns.CHUNK),
            "pressures": pressures,
            "probes": len(self._probes),
            "hands": columns.HANDS,
            "records": (columns.FRAMES + 1) * (1 + len(self._probes)),
            "scenes": 1,
        }
        self.lease = self._keep(pool.lend(State, self.precision, needs))
        self.first = self.lease.starts["nodes"]
        self.scene = self.lease.starts["scenes"]
        self.obstacle_lease: Lease | None = None
        self._obstacles = 0
        self._ordered: dict[tuple[str, int], float] = {}

    def lend(self, kind: Any, needs: dict[str, int]) -> Lease:
        """Rows of other fields for this scene, until it ends."""
        return self._keep(runtime.pool(Pool).lend(kind, self.precision, needs))

    def _keep(self, lease: Lease) -> Lease:
        self._leases.append(lease)
        return lease

    @property
    def state(self) -> Any:
        """The fields of the nodes."""
        return self.lease.fields

    @property
    def last(self) -> int:
        """One past the last node's row."""
        return self.first + self.count

    def _lend_cells(
        self, pool: Pool, key: Any, members: list[tuple[Part, Cells]], batches: Batches
    ) -> Share:
        structure = (*key, self.precision, batches.lanes)
        needs = {
            "batches": len(batches.owner),
            "parts": batches.parts + 1,
            "materials": len(members),
        }
        return Share(members, batches, self._keep(pool.lend(Block, structure, needs)))

    def _write_nodes(self, copy_starts: NDArray[np.int32]) -> None:
        copies = self.lease.starts["copies"]
        body = np.repeat(np.arange(len(self.parts)), [len(p.order) for p in self.parts])
        self.body = body
        self.state.write_nodes(
            self.first,
            self._reals(self.rest_host),
            self._reals(1.0 / self.mass),
            (body + self.lease.starts["bodies"]).astype(np.int32),
            copy_starts + np.int32(copies),
        )
        self.state.clear_copies(copies, copies + int(copy_starts[-1]))
        self.write_bodies()

    def write_bodies(self) -> None:
        """Write the bodies' point damping and where their obstacles begin."""
        drag = np.array([p.body.model.point_damping for p in self.parts] + [0.0])
        starts = np.zeros(len(drag), np.int32)
        if self.obstacle_lease is not None:
            starts = self._obstacle_starts()
        self.state.write_bodies(self.lease.starts["bodies"], self._reals(drag), starts)

    def _obstacle_starts(self) -> NDArray[np.int32]:
        """First row of the obstacles of each body's nodes, and one past the last: none for bodies
        whose surface meets them instead; those have theirs after all others.
        """
        assert self.obstacle_lease is not None
        own = [0 if part.touches else self._obstacles for part in self.parts]
        starts = np.concatenate([[0], np.cumsum(own)]) + self.obstacle_lease.starts["obstacles"]
        return starts.astype(np.int32)

    def _write_cells(self, share: Share, copies: Any) -> None:
        batches, block = share.batches, share.block
        block.write_cells(
            share.row("batches"),
            batches.cells + np.int32(self.first),
            copies + np.int32(self.lease.starts["copies"]),
            self._reals(batches.filled([cells.rest for _, cells in share.members])),
            self._reals(self._modes(share)),
            batches.owner + np.int32(share.row("materials")),
        )
        block.write_parts(share.row("parts"), batches.part_start + np.int32(share.row("batches")))
        self._write_materials(share)

    def _modes(self, share: Share) -> Floats:
        """`Cells.known` of its cells, where the block has cells with a law."""
        if share.block.law is None:
            return np.zeros(
                (len(share.batches.owner), share.block.element.known, share.block.lanes)
            )
        known = {id(c): k for p in share.parts for c, k in zip(p.solids, p.known(), strict=True)}
        return share.batches.filled([known[id(cells)] for _, cells in share.members])

    def _write_materials(self, share: Share) -> None:
        rows = np.array([part.material(cells) for part, cells in share.members])
        viscous = np.array([part.is_viscous(cells) for part, cells in share.members], np.int32)
        origins = np.array([self.first + part.start for part in share.parts], np.int32)
        share.block.write_materials(share.row("materials"), self._reals(rows), viscous, origins)

    def _lend_mass(self, pool: Pool) -> Lease:
        rows, cols, values = self.mass_entries()
        needs = {"nodes": self.count + 1, "entries": len(values)}
        lease = self._keep(pool.lend(ConsistentMass, self.precision, needs))
        self._write_mass_rows(lease, rows, cols, values)
        return lease

    def _lend_touch(self, pool: Pool) -> Lease | None:
        """Room for the points of carried surfaces that meet obstacles, filled; None without any."""
        points = {id(p): p.touching_points() for p in self.parts if p.touches}
        self._touching = np.repeat(
            np.arange(len(self.parts)), [len(points.get(id(p), ())) for p in self.parts]
        )
        if not points:
            return None
        corners, shares = [], []
        for part in self.parts:
            if part.touches:
                skin, own = part.body.skin, points[id(part)]
                assert skin is not None
                corners.append(part.rank[skin.corners[own]] + part.start + self.first)
                shares.append(skin.weights[own])
        lease = self._keep(
            pool.lend(Touch, (self.precision, corners[0].shape[1]), {"points": len(self._touching)})
        )
        nodes, weights = np.concatenate(corners).astype(np.int32), np.concatenate(shares)
        group, spread = groups(nodes, weights)
        lease.fields.write(
            lease.starts["points"], nodes, self._reals(weights), group, self._reals(spread)
        )
        return lease

    def _write_mass_rows(self, lease: Lease, rows: Any, cols: Any, values: Floats) -> None:
        node, entry = lease.starts["nodes"], lease.starts["entries"]
        starts = np.searchsorted(rows, np.arange(self.count + 1)) + entry
        self.diagonal = values[rows == cols]
        lease.fields.write(
            node, starts.astype(np.int32), self._reals(self.diagonal),
            entry, (cols + node).astype(np.int32), self._reals(values),
        )  # fmt: skip

    def mass_entries(self) -> tuple[Any, Any, Floats]:
        """Rows, columns and entries [kg] of the mass matrix, lumped bodies' on its diagonal."""
        entries = []
        for part in self.parts:
            own = np.arange(len(part.order))
            found: tuple[Any, Any, Any] = (own, own, part.mass)
            if part.is_consistent:
                # Linear tets: `Body.validate` refuses others.
                tets = np.concatenate([cells.nodes for cells in part.solids])
                masses = [cells.solid.density * cells.volume for cells in part.solids]
                found = mass_rows(tets, np.concatenate(masses))
            entries.append((found[0] + part.start, found[1] + part.start, found[2]))
        rows, cols, values = (np.concatenate(column) for column in zip(*entries, strict=True))
        return rows, cols, values

    def _write_scene(self) -> None:
        ranges = np.zeros(columns.RANGES, np.int32)
        ranges[:2] = self.first, self.last
        for k, share in enumerate(self.shares):
            row = share.row("parts")
            ranges[2 + 2 * k : 4 + 2 * k] = row, row + share.batches.parts
        if self.touch_lease is not None:
            row = self.touch_lease.starts["points"]
            ranges[columns.TOUCH : columns.TOUCH + 2] = row, row + len(self._touching)
        ranges[15] = 0 if self.mass_lease is None else self.mass_lease.starts["nodes"]
        orders = np.zeros(len(columns.ORDERS), np.int32)
        orders[columns.PASSES] = orders[columns.THREADS] = 1
        orders[columns.PROBES] = len(self._probes)
        orders[columns.PROBE] = self.lease.starts["probes"]
        orders[columns.RECORDS] = self.lease.starts["records"]
        orders[columns.CHUNKS] = self.lease.starts["chunks"]
        orders[columns.HAND] = self.lease.starts["hands"]
        probes = (np.array(self._probes, np.int32) + self.first).astype(np.int32)
        self.state.write_scene(self.scene, ranges, orders, self.lease.starts["probes"], probes)

    def bytes_used(self) -> int:
        """Memory that the scene's rows of all fields take [bytes]."""
        held: list[tuple[Any, Any, Lease]] = [(State, self.precision, self.lease)]
        for share in self.shares:
            block = share.block
            structure = (block.element, block.law, self.precision, block.lanes)
            held.append((Block, structure, share.lease))
        return sum(
            kind.bytes_of(structure, {k: lease.counts.get(k, 0) for k in kind.LEAST})
            for kind, structure, lease in held
        )

    @property
    def is_small(self) -> bool:
        """Whether one thread is done before two could be called."""
        return runtime.on_cpu() and self.elements + self.springs < SMALL

    @property
    def record_rows(self) -> int:
        """Rows of a record: its sums, then the probes."""
        return 1 + len(self._probes)

    def reals(self, values: Any) -> NDArray[Any]:
        """The values in the scene's precision, as kernels take them."""
        return self._reals(values)

    def _reals(self, values: Any) -> NDArray[Any]:
        return np.ascontiguousarray(values, dtype=self.real)


def _end(leases: list[Lease]) -> None:
    for lease in leases:
        lease.end()
