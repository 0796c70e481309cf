"""The ledger: where the energy of a scene went, and how far the account is from closing.

    error = (T + W + G + dissipated − external work) now − (T + W + G) at the start

Entries come from the substeps themselves (`step.ledger`), in f64 per node, and are added up at each
frame's end (`step.record`).  With symplectic Euler the error is the swing of that integrator's own
energy, −(h/2) Σ v·f with f the conservative and external forces: it is as large as v·f is and does
not grow.  With velocity Verlet it is of second order in the step.  In f32 rounding adds its share.

With consistent mass the work of moved pins and of contact is reckoned with the lumped one.
"""

from __future__ import annotations

from typing import Any

KEPT = ("start", "dissipated", "external_work")
"""What a checkpoint keeps."""


class Account:
    """Adds up what the substeps note down.

    Args:
        stored: T + W + G at the start [J].
    """

    def __init__(self, stored: float) -> None:
        self.start = stored
        """T + W + G at the start [J]."""
        self.dissipated = 0.0
        """Energy taken by viscosity, damping, friction and impacts [J]."""
        self.external_work = 0.0
        """Work of loads, of moved pins, and of changes to materials and gravity [J]."""

    def collect(self, dissipated: float, given: float) -> None:
        """Add up a stretch: energy dissipated and external work [J]."""
        self.dissipated += float(dissipated)
        self.external_work += float(given)

    def state(self) -> dict[str, float]:
        """What a checkpoint keeps."""
        return {key: getattr(self, key) for key in KEPT}

    def set_state(self, state: dict[str, float]) -> None:
        """Go on from what `state` told."""
        for key in KEPT:
            setattr(self, key, float(state[key]))

    def entries_at(
        self, table: dict[str, float], dissipated: float, external_work: float
    ) -> dict[str, Any]:
        """The account [J] of a moment with the energies `table`."""
        error = sum(table.values()) + dissipated - external_work - self.start
        return {
            **table,
            "dissipated": float(dissipated),
            "external_work": float(external_work),
            "error": error,
        }
