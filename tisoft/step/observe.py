"""Energies, from the sums of a record.

    kinetic   T = Σ m |v|²/2        (consistent mass: T = vᵀM v/2)
    elastic   W = Σ_elements V Ψ(H) + Σ_springs k (L − L₀)²/2
    gravity   G = −Σ m g·(x − X),  zero where every node is at its rest point X

Elements compute in the scene's precision; sums are in f64 (where the device has it), in an order
that no number of threads changes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.model.system import System

STORED = ("kinetic", "elastic", "gravity")


def energy_tables(
    system: System, sums: NDArray[np.float64], gravity: Any
) -> list[dict[str, float]]:
    """Kinetic, elastic and gravity energy [J] of states with these sums, shape (n, RECORD): all
    reckoned from the bodies' present origins.
    """
    g = np.asarray(gravity, np.float64)
    shifted = sum(p.mass.sum() * (p.shift @ g) for p in system.parts if p.shift.any())
    moved = sums[:, 1] * g[0] + sums[:, 2] * g[1] + sums[:, 3] * g[2] + shifted
    rows = zip(sums[:, 0].tolist(), sums[:, 4].tolist(), (0.0 - moved).tolist(), strict=True)
    return [dict(zip(STORED, row, strict=True)) for row in rows]


def energy_table(system: System, record: NDArray[np.float64], gravity: Any) -> dict[str, float]:
    """The same of one state."""
    return energy_tables(system, record[None], gravity)[0]
