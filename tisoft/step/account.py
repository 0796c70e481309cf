"""The ledger: where the energy of a scene went, and how far the account is from closing.

    error = (T + W + G + dissipated − external work) now − (T + W + G) at the start

Entries come from the substeps themselves (`step.ledger`), in f64 per node, and are added up at each
frame's end (`step.record`).  With symplectic Euler the error is the swing of that integrator's own
energy, −(h/2) Σ v·f with f the conservative and external forces: it is as large as v·f is and does
not grow, but that a load which jumps by F leaves (h/2) Σ v·F.  With velocity Verlet it is of second
order in the step, and of first after a pin's velocity has jumped.  In f32 rounding adds its share.

With consistent mass the work of moved pins and of contact is reckoned with the lumped one.
"""

from __future__ import annotations

from typing import Any

KEPT = ("start", "dissipated", "external_work", "contact", "friction")
"""What a checkpoint keeps."""


class Account:
    """Adds up what the substeps note down.

    Args:
        stored: T + W + G at the start [J].
        touches: whether surfaces may touch, so that contact and friction are told apart.
    """

    def __init__(self, stored: float, *, touches: bool = False) -> None:
        self.touches = touches
        self.start = stored
        """T + W + G at the start [J]."""
        self.dissipated = 0.0
        """Energy taken by viscosity, damping, friction and impacts [J]."""
        self.external_work = 0.0
        """Work of loads, of moved pins, and of changes to materials and gravity [J]."""

        self.contact = 0.0
        """Of the dissipated energy, what impulses along normals between surfaces took [J]; what
        pushing out gave is its negative part."""
        self.friction = 0.0
        """The same of friction between surfaces [J]."""

    def collect(
        self, dissipated: float, given: float, contact: float = 0.0, friction: float = 0.0
    ) -> None:
        """Add up a stretch: energy dissipated and external work [J]; contact's and friction's share
        of the former.
        """
        self.dissipated += float(dissipated)
        self.external_work += float(given)
        self.contact += float(contact)
        self.friction += float(friction)

    def sums(self) -> list[float]:
        """What has been added up [J]: dissipated energy, external work, contact, friction."""
        return [self.dissipated, self.external_work, self.contact, self.friction]

    def state(self) -> dict[str, float]:
        """What a checkpoint keeps."""
        return {key: getattr(self, key) for key in KEPT}

    def set_state(self, state: dict[str, float]) -> None:
        """Go on from what `state` told."""
        for key in KEPT:
            setattr(self, key, float(state.get(key, 0.0)))  # older ones know no contact

    def entries(self, table: dict[str, float]) -> dict[str, Any]:
        """The account [J], with the energies `table` of the present state."""
        dissipated, external_work, contact, friction = self.sums()
        touched = {"contact": contact, "friction": friction} if self.touches else {}
        error = sum(table.values()) + dissipated - external_work - self.start
        return {
            **table,
            "dissipated": dissipated,
            "external_work": external_work,
            "error": error,
            **touched,
        }
