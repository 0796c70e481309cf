"""The ledger: where the energy of a scene went, and how far the account is from closing.

    error = (T + W + G + dissipated − external work) now − (T + W + G) at the start

Entries come from the substeps themselves (see `work`), in f64 per node, and are added up once a
frame.  With symplectic Euler the error is the swing of that integrator's own energy,
−(h/2) Σ v·f with f the conservative and external forces: it is as large as v·f is and does not
grow.  With velocity Verlet it is of second order in the step.  In f32 rounding adds its share.

With consistent mass the work of moved pins and of contact is reckoned with the lumped one.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tisoft import runtime
from tisoft.dynamics.energy import Energies
from tisoft.dynamics.system import System


class Ledger:
    """Adds up what the substeps note down."""

    def __init__(self, system: System, energies: Energies, gravity: Any) -> None:
        self.system = system
        self.energies = energies
        self.gravity = gravity
        self.models = [part.body.model for part in system.parts]
        self.start = self.stored()
        """T + W + G at the start [J]."""
        self.dissipated = 0.0
        """Energy taken by viscosity, damping, friction and impacts [J]."""
        self.external_work = 0.0
        """Work of loads, of moved pins, and of changes to materials and gravity [J]."""

    def stored(self) -> float:
        """T + W + G [J]."""
        return sum(self.energies.table(self.gravity).values())

    def collect(self) -> None:
        """Add up the frame just made."""
        dissipated, given = runtime.read(self.system.work).sum(axis=0, dtype=np.float64)
        self.dissipated += float(dissipated)
        self.external_work += float(given)

    def reread(self, gravity: Any) -> None:
        """Take over materials and gravity that were changed between frames, as external work."""
        models = [part.body.model for part in self.system.parts]
        same = all(a is b for a, b in zip(models, self.models, strict=True))
        if same and gravity == self.gravity:
            return
        before = self.stored()
        self.energies.reread()
        self.models = models
        self.gravity = gravity
        self.external_work += self.stored() - before

    def state(self) -> dict[str, float]:
        """What a checkpoint keeps."""
        return {key: getattr(self, key) for key in ("start", "dissipated", "external_work")}

    def set_state(self, state: dict[str, float]) -> None:
        """Go on from what `state` told."""
        for key, value in state.items():
            setattr(self, key, value)

    def entries(self) -> dict[str, float | None]:
        """The whole account [J]."""
        table = self.energies.table(self.gravity)
        error = sum(table.values()) + self.dissipated - self.external_work - self.start
        return {
            **table,
            "dissipated": self.dissipated,
            "external_work": self.external_work,
            "error": error,
        }
