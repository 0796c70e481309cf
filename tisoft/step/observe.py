"""What can be read off the present state: energies, and the forces that elements exert.

    kinetic   T = Σ m |v|²/2        (consistent mass: T = vᵀM v/2)
    elastic   W = Σ_tets V Ψ(H) + Σ_springs k (L − L₀)²/2
    gravity   G = −Σ m g·(x − X),  zero where every node is at its rest point X

Elements compute in the scene's precision; sums are in f64 (where the device has it), in an order
that no number of threads changes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.model import state as columns
from tisoft.model.system import System
from tisoft.step.record import make_forces, make_measure
from tisoft.step.substep import Structure
from tisoft.step.symplectic_euler import SymplecticEuler

Floats = NDArray[np.float64]


class Observer:
    """Reads energies and forces of a System's present state."""

    def __init__(self, system: System) -> None:
        self.system = system

    def _kernel(self, name: str, make: Any) -> Any:
        s = self.system
        s.check_alive()
        mass = s.mass_lease.fields if s.mass_lease is not None else None
        blocks = tuple(share.block for share in s.shares)
        key = (name, *blocks, mass, s.is_small)
        ledger = name == "measure"
        structure = Structure(s.state, blocks, SymplecticEuler, False, ledger, mass)
        return s.lease.arena.kernel(key, lambda: make(structure, s.is_small))

    def forces(self, *, viscous: bool = True) -> Floats:
        """Elastic, viscous and spring forces [N] on each node, internal order, (nodes, 3)."""
        s = self.system
        out = np.empty((s.count, 3), s.real)
        self._kernel("forces", make_forces)(s.scene, s.first, int(viscous), out)
        return out.astype(np.float64)

    def energies(self, gravity: Any) -> dict[str, float]:
        """Kinetic, elastic and gravity energy [J] of the present state."""
        return self.table(self._record(gravity), gravity)

    def energies_and_power(self, gravity: Any) -> tuple[dict[str, float], float]:
        """The same, and the power v·f [W] of the elements' forces and gravity."""
        record = self._record(gravity)
        return self.table(record, gravity), float(record[columns.POWER])

    def _record(self, gravity: Any) -> Floats:
        s = self.system
        kernel = self._kernel("measure", make_measure)
        for d in range(3):
            s.order("settings", columns.GRAVITY + d, float(gravity[d]))
        kernel(s.scene)
        wide = np.float64 if runtime.has_f64() else np.float32
        out = np.zeros((1, columns.RECORD), wide)
        s.state.read_record(s.lease.starts["records"], out)
        return out[0].astype(np.float64)

    def table(self, record: Floats, gravity: Any) -> dict[str, float]:
        """The same from a record of sums (`record`)."""
        g = np.asarray(gravity, np.float64)
        moved = record[1:4] @ g + sum(p.mass.sum() * (p.shift @ g) for p in self.system.parts)
        return {
            "kinetic": float(record[0]),
            "elastic": float(record[4]),
            "gravity": 0.0 - float(moved),
        }
