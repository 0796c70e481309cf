"""What a study of one axis of failure brings: a table, numbers, pictures, sentences."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

Tick = Callable[[], None]
"""Called after every piece of work, for the progress bar."""


@dataclass(frozen=True)
class Axis:
    """One axis of the failure map, measured."""

    name: str
    """As --only takes it."""
    title: str
    sentence: str
    """Where the method stops being usable for this scene."""
    columns: Sequence[str]
    """Names of the table's columns with their units."""
    rows: Sequence[Sequence[Any]]
    draw: Callable[[Any], None]
    """Draws the axis on an empty matplotlib Figure."""
    numbers: dict[str, Any] = field(default_factory=dict)
    """What the summary tells."""
    notes: Sequence[str] = ()
    """Further sentences of the page."""
    size: tuple[float, float] = (11.0, 4.6)
    """Of the picture [inch]."""

    def table(self) -> str:
        """The table as CSV."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        for row in self.rows:
            writer.writerow([f"{v:.9g}" if isinstance(v, float) else v for v in row])
        return text.getvalue()
