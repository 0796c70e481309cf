"""A progress bar on a terminal; nothing in a pipe."""

from __future__ import annotations

import sys
from typing import Any

from tisoft.simulation import Frame, Simulation


class Progress:
    """Counts frames on standard error where that is a terminal."""

    def __init__(self, label: str, *, quiet: bool = False) -> None:
        self.label = label
        self.quiet = quiet
        self._bar: Any = None

    def on_start(self, sim: Simulation) -> None:
        from tqdm import tqdm

        frames = round(sim.scene.duration * sim.scene.frame_rate)
        self._bar = tqdm(
            total=frames,
            desc=self.label,
            unit="frame",
            file=sys.stderr,
            disable=True if self.quiet else None,  # None: only on a terminal
            leave=False,
        )

    def on_frame(self, frame: Frame) -> None:
        if frame.index:
            self._bar.update()

    def on_end(self, sim: Simulation) -> None:
        self._bar.close()
