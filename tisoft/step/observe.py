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


def energy_table(system: System, record: NDArray[np.float64], gravity: Any) -> dict[str, float]:
    """Kinetic, elastic and gravity energy [J] from a record of sums (`record`)."""
    g = np.asarray(gravity, np.float64)
    moved = record[1:4] @ g + sum(p.mass.sum() * (p.shift @ g) for p in system.parts)
    return {
        "kinetic": float(record[0]),
        "elastic": float(record[4]),
        "gravity": 0.0 - float(moved),
    }
