"""What a scene asks of a substep: kernels are compiled for these, and do nothing else."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Flags:
    """The parts of a substep that a scene needs."""

    integrator: int
    contact: bool
    loads: bool
    """Forces in `system.load`."""
    pressure: bool
    viscous: bool
    ledger: bool
    """Dissipated energy and external work in `system.work`."""
