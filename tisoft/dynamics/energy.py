"""Energies of a running scene, and the forces that elements exert, outside of any step.

    kinetic   T = Σ m |v|²/2        (consistent mass: T = Σ_tets ρV/40 (Σ_a |v_a|² + |Σ_a v_a|²))
    elastic   W = Σ_tets V Ψ(H) + Σ_springs k (L − L₀)²/2
    gravity   G = −Σ m g·(x − X),  zero where every node is at its rest point X

All is computed in f64 from the state (in f32 on devices without f64) and summed on the host in
a fixed order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.dynamics import plain
from tisoft.dynamics.energy_kernels import spring_energies, tet_energies
from tisoft.dynamics.part import Part, law_of
from tisoft.dynamics.system import System
from tisoft.models import laws
from tisoft.models.materials import SolidModel

Floats = NDArray[np.float64]


@dataclass
class _Element:
    """One body's elements in f64, and the launch that computes their energies."""

    part: Part
    numbers: Any
    """The law's λ', μ' [Pa], or nothing for springs (they have their own rows)."""
    out: Any
    launch: Callable[..., None]


class Energies:
    """Measures the energies of a System's present state."""

    def __init__(self, system: System, velocities: Callable[[], Floats]) -> None:
        """`velocities` tells all nodes' velocities [m/s], inside order: with the half-step start
        they are not those of the system.
        """
        self.system = system
        self.velocities = velocities
        self._wide = np.float64 if runtime.has_f64() else np.float32
        self._elements = [
            self._springs(part) if part.is_springs else self._tets(part) for part in system.parts
        ]
        self.reread()

    def reread(self) -> None:
        """Take over the materials of all bodies."""
        for element in self._elements:
            part = element.part
            model = part.body.model
            if isinstance(model, SolidModel):
                constants = laws.law_constants(law_of(model), model.lame_lambda, model.lame_mu)
                runtime.write(element.numbers, np.array(constants))
            elif len(part.springs):
                runtime.write(element.numbers, part.spring_numbers[:, :2])

    def _array(self, values: Any, kind: Any = None) -> Any:
        return runtime.array(np.array(values, dtype=kind or self._wide, order="C"))

    def _tets(self, part: Part) -> _Element:
        s = self.system
        assert isinstance(part.body.model, SolidModel)
        law = law_of(part.body.model)
        numbers, out = self._array(np.zeros(2)), self._array(np.zeros(len(part.tets)))
        launch = runtime.bind(
            tet_energies, law, self._array(part.tets + part.start, np.int32),
            self._array(part.gradient), self._array(part.volume), numbers, s.u, out,
        )  # fmt: skip
        return _Element(part, numbers, out, launch)

    def _springs(self, part: Part) -> _Element:
        ends = part.springs + part.start
        vectors = self.system.rest_host[ends[:, 1]] - self.system.rest_host[ends[:, 0]]
        numbers = self._array(np.zeros((max(1, len(ends)), 2)))
        out = self._array(np.zeros(len(ends)))
        if not len(ends):
            return _Element(part, numbers, out, lambda: None)
        launch = runtime.bind(
            spring_energies, self._array(ends, np.int32), self._array(vectors), numbers,
            self.system.u, out,
        )  # fmt: skip
        return _Element(part, numbers, out, launch)

    def elements(self, part: Part) -> Floats:
        """Elastic energy of each tet or spring of one body [J], in the mesh's own order."""
        element = self._elements[part.index]
        element.launch()
        inside = runtime.read(element.out).astype(np.float64)
        if part.is_springs:
            return inside
        out = np.empty_like(inside)
        out[part.tet_order] = inside
        return out

    def table(self, gravity: Any) -> dict[str, float]:
        """All of them under a gravity [m/s²]."""
        return {
            "kinetic": self.kinetic(),
            "elastic": self.elastic(),
            "gravity": self.gravity(gravity),
        }

    def elastic(self) -> float:
        """[J]"""
        return float(sum(self.elements(part).sum() for part in self.system.parts))

    def kinetic(self) -> float:
        """[J]"""
        v = self.velocities()
        total = 0.0
        for part in self.system.parts:
            own = v[part.nodes]
            model = part.body.model
            if part.is_consistent:
                assert isinstance(model, SolidModel)
                corners = own[part.tets]
                squares = np.einsum("eai,eai->e", corners, corners)
                sums = corners.sum(axis=1)
                squares += np.einsum("ei,ei->e", sums, sums)
                total += float(model.density / 40.0 * (part.volume @ squares))
            else:
                total += float(0.5 * (part.mass @ np.einsum("ni,ni->n", own, own)))
        return total

    def gravity(self, gravity: Any) -> float:
        """[J], zero with all nodes at rest."""
        u = runtime.read(self.system.u).astype(np.float64)
        g = np.asarray(gravity, np.float64)
        parts = self.system.parts
        return 0.0 - float(
            sum(p.mass @ (u[p.nodes] @ g) + p.mass.sum() * (p.shift @ g) for p in parts)
        )


class Forces:
    """Computes what elements do to the nodes in the present state."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.total = runtime.array(np.zeros((system.count, 3), system.real))
        self._launches: dict[bool, list[Callable[..., None]]] = {}

    def _bind(self, viscous: bool) -> list[Callable[..., None]]:
        s = self.system
        rows = s.springs > 0 or s.tensors
        launches = []
        if s.laws:
            tets = tet_arguments(s, viscous, s.flat_slots)
            launches.append(runtime.bind(plain.tet_forces, *tets))
        if rows:
            launches.append(runtime.bind(plain.row_forces, *row_arguments(s, viscous, s.force)))
        launches.append(
            runtime.bind(
                plain.sum_forces, bool(s.laws), rows, s.lanes,
                s.starts, s.corners, s.flat_slots, s.force, self.total,
            )
        )  # fmt: skip
        return launches

    def internal(self, *, viscous: bool | None = None) -> Floats:
        """Elastic, viscous and spring forces [N] on each node, inside order, shape (nodes, 3)."""
        damped = self.system.viscous() if viscous is None else viscous
        if damped not in self._launches:
            self._launches[damped] = self._bind(damped)
        for launch in self._launches[damped]:
            launch()
        return np.array(runtime.read(self.total), np.float64)


def tet_arguments(s: System, viscous: bool, slots: Any) -> list[Any]:
    """Arguments of `plain.tet_forces`."""
    return [
        s.laws, viscous, s.lanes,
        s.law_starts, s.nodes, s.shapes, s.owner, s.material, s.u, s.v, slots,
    ]  # fmt: skip


def row_arguments(s: System, viscous: bool, force: Any) -> list[Any]:
    """Arguments of `plain.row_forces`."""
    return [
        viscous, s.springs > 0, s.tensors, s.u, s.v, force,
        s.spring_starts, s.spring_ends, s.spring_data,
        s.tensor_starts, s.tensor_ends, s.stiffness, s.viscosity,
    ]  # fmt: skip
