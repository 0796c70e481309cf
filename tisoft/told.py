"""What a run tells of frames: read off their records at once, before anything is moved.

A record holds sums and displacements from the bodies' origins as they were in its launch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.model import state as columns
from tisoft.probed import Probed, places_of
from tisoft.step.account import Account
from tisoft.step.observe import energy_tables

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Told:
    """A frame as it was at its end."""

    places: Floats
    """World positions of the probes [m], shape (probes, 3)."""
    energies: dict[str, Any]
    """[J], see `Energies`."""


def entries_of(account: Account | None, table: dict[str, float]) -> dict[str, Any]:
    """Energies [J] with the account, where one is kept."""
    if account is not None:
        return account.entries(table)
    return {**table, "dissipated": None, "external_work": None, "error": None}


def told_of(
    system: Any, records: Floats, *, probed: Sequence[Probed], account: Account | None, gravity: Any
) -> list[Told]:
    """The frames with these records, shape (frames, 1 + probes' rows, RECORD), one after the other;
    the account is carried on through them.
    """
    places = places_of(probed, system.probe_origins() + records[:, 1:, :3])
    told = []
    tables = energy_tables(system, records[:, 0], gravity)
    for place, table, noted in zip(
        places, tables, records[:, 0, columns.NOTED].tolist(), strict=True
    ):
        if account is not None:
            account.collect(*noted)
        told.append(Told(place, entries_of(account, table)))
    return told
