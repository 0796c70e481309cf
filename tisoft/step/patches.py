"""Patches that pins hold by means of cells (`step.means`), of a running scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tisoft.model import means as kinds
from tisoft.model import state as columns
from tisoft.model.arena import Lease
from tisoft.model.means import Means
from tisoft.model.part import Part
from tisoft.model.system import System
from tisoft.pins import Pin

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

SINGULAR = 1e-10
"""Share of the largest eigenvalue below which impulses would do nothing: means held twice."""


@dataclass(frozen=True, eq=False)
class Patch:
    """What a pin holds of a body by means of its cells."""

    part: Part
    pin: Pin
    nodes: Rows
    """Of the part, inside order, shape (cells, 8)."""
    shares: Floats

    @property
    def places(self) -> Floats:
        """Means of the rest positions [m], shape (cells, 3)."""
        rest = self.part.body.mesh.points[self.part.order]
        return np.einsum("ka,kad->kd", self.shares, rest[self.nodes])

    def targets(self, time: float, factor: float = 1.0) -> Floats:
        """Mean displacements U [m] at `time` [s], or at a share of them, shape (cells, 3)."""
        return self.pin.share_of_way(self.places, time, factor)

    def means(self, u: Floats) -> Floats:
        """C u of values at the part's nodes, shape (cells, 3)."""
        return np.einsum("ka,kad->kd", self.shares, u[self.nodes])


def patch_of(part: Part, pin: Pin) -> tuple[Rows, Patch | None]:
    """Rows of `mesh.points` that a pin holds, and what it holds by means."""
    rows, means = part.body.grip(pin.where)
    if means is None:
        return rows, None
    return rows, Patch(part, pin, part.rank[means.nodes].astype(np.int64), means.shares)


def inverses(patches: Sequence[Patch], lightness: Floats) -> Floats:
    """(C M⁻¹ Cᵀ)⁻¹ of patches of one body for each axis [kg], shape (rows, rows, 3), 0 on axes that
    are free; `lightness`: M⁻¹ of its nodes, 0 where they are held [1/kg], shape (nodes, 3).
    """
    nodes = np.concatenate([patch.nodes for patch in patches])
    shares = np.concatenate([patch.shares for patch in patches])
    out = np.zeros((len(nodes), len(nodes), 3))
    for axis in range(3):
        held = np.concatenate([np.full(len(p.nodes), axis in p.pin.components) for p in patches])
        if not held.any():
            continue
        C = np.zeros((int(held.sum()), len(lightness)))
        np.add.at(C, (np.arange(len(C))[:, None], nodes[held]), shares[held])
        A = (C * lightness[:, axis]) @ C.T
        rows = np.flatnonzero(held)
        out[rows[:, None], rows, axis] = np.linalg.pinv(A, SINGULAR, hermitian=True)
    return out


class Patches:
    """Keeps the fields right; idle where no pin holds means."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.held: list[Patch] = []
        self._lease: Lease | None = None
        self._inverses: dict[int, Floats] = {}
        self._lightness: dict[int, Floats] = {}

    @property
    def fields(self) -> Means | None:
        """The fields, or None where there never were patches."""
        return None if self._lease is None else self._lease.fields

    def of(self, part: Part) -> list[Patch]:
        """Those of a body."""
        return [patch for patch in self.held if patch.part is part]

    def hold(self, held: list[Patch], bits: NDArray[np.int32]) -> None:
        """Hold these from now on; `bits`: axes of nodes that pins hold."""
        parts = self.system.parts
        self.held = sorted(held, key=lambda patch: patch.part.index)
        self._inverses = {}
        for part in parts:
            own = self.of(part)
            if own:
                free = (bits[part.nodes][:, None] >> np.arange(3)) & 1 == 0
                self._lightness[part.index] = free / part.mass[:, None]
                self._inverses[part.index] = inverses(own, self._lightness[part.index])
        needs = {
            "means": sum(len(patch.nodes) for patch in self.held),
            "entries": sum(A.shape[0] * A.shape[1] for A in self._inverses.values()),
        }
        lease = self._lease
        if self.held and (lease is None or any(needs[k] > lease.counts[k] for k in needs)):
            if lease is not None:
                lease.end()
            self._lease = self.system.lend(Means, needs)
        self.write({})

    def write(self, signals: dict[int, int]) -> None:
        """Write all into the fields; `signals`: the first of each moved pin's, by its id."""
        if self._lease is None:
            return
        row, entry = self._lease.starts["means"], self._lease.starts["entries"]
        words, shares, vectors = [], [], []
        low, place = row, entry
        for part in self.system.parts:
            own = self.of(part)
            count = sum(len(patch.nodes) for patch in own)
            begun = place
            for patch in own:
                rows = np.zeros((len(patch.nodes), 13), np.int32)
                rows[:, :8] = patch.nodes + part.start + self.system.first
                rows[:, 8:10] = low, low + count
                rows[:, 10] = begun + count * np.arange(len(rows))
                begun += count * len(rows)
                rows[:, 11:] = _motion(patch.pin), signals.get(id(patch.pin), 0)
                words.append(rows)
                shares.append(patch.shares)
                vectors.append(_turned(patch))
            if own:
                numbers = self._inverses[part.index].reshape(-1, 3)
                self._lease.fields.write_inverse(place, np.ascontiguousarray(numbers))
                place += len(numbers)
                low += count
        if words:
            fields, real = self._lease.fields, self.system.real
            fields.write(
                row, np.concatenate(words), np.concatenate(shares).astype(real),
                np.concatenate(vectors).astype(real),
            )  # fmt: skip
        ranges, scene = self.system.state.ranges, self.system.scene
        ranges[scene, columns.HELD_MEANS] = row
        ranges[scene, columns.HELD_MEANS + 1] = low
        self.place()

    def place(self) -> None:
        """Tell where still patches are, seen from the bodies' present origins."""
        if self.held and self._lease is not None:
            targets = [patch.targets(0.0) - patch.part.shift for patch in self.held]
            rows = np.concatenate(targets).astype(self.system.real)
            self._lease.fields.write_targets(self._lease.starts["means"], rows)

    def finish(self, end: float) -> None:
        """Put moved patches exactly where they belong at `end` [s]: rounding must not add up."""
        moved = [patch for patch in self.held if patch.pin.moves]
        if not moved:
            return
        u, v = self.system.motion()
        away = u.astype(np.float64)
        for part in {id(patch.part): patch.part for patch in moved}.values():
            own = self.of(part)
            now = u[part.nodes].astype(np.float64)
            excess = [p.means(now) - (p.targets(end) - part.shift) for p in own]
            for patch, far in zip(own, excess, strict=True):
                far *= patch.pin.moves
            away[part.nodes] -= self._change(part, np.concatenate(excess))
        self.system.set_motion(away, v)

    def project(self, a: Floats) -> Floats:
        """Accelerations of all nodes [m/s²] without what the means' impulses take away."""
        out = a.copy()
        for part in self.system.parts:
            own = self.of(part)
            if own:
                excess = np.concatenate([patch.means(a[part.nodes]) for patch in own])
                out[part.nodes] -= self._change(part, excess)
        return out

    def _change(self, part: Part, excess: Floats) -> Floats:
        """M⁻¹ Cᵀ (C M⁻¹ Cᵀ)⁻¹ of what means have too much, shape (nodes, 3), 0 on held axes."""
        own = self.of(part)
        nodes = np.concatenate([patch.nodes for patch in own])
        shares = np.concatenate([patch.shares for patch in own])
        push = np.einsum("jkd,kd->jd", self._inverses[part.index], excess)
        change = np.zeros((len(part.order), 3))
        np.add.at(change, nodes, shares[:, :, None] * push[:, None])
        return change * self._lightness[part.index]


def _motion(pin: Pin) -> int:
    if not pin.moves:
        return kinds.STILL
    return kinds.PATH if pin.turn is None else kinds.TURN


def _turned(patch: Patch) -> Floats:
    """Along and across of a turn, shape (cells, 6)."""
    if patch.pin.turn is None:
        return np.zeros((len(patch.nodes), 6))
    arm = patch.places - np.array(patch.pin.turn.point)
    along = np.cross(patch.pin.turn.axis, arm)
    return np.hstack([along, np.cross(patch.pin.turn.axis, along)])
