"""Progress on a terminal, and a clean end when it is interrupted."""

from __future__ import annotations

import signal
import sys
import threading
from types import FrameType
from typing import Any

from tisoft.simulation import Frame, Simulation


class Progress:
    """Counts frames on standard error where that is a terminal."""

    looks_every = 0

    def __init__(self, label: str, *, quiet: bool = False) -> None:
        self.label = label
        self.quiet = quiet
        self._bar: Any = None

    def on_start(self, sim: Simulation) -> None:
        from tqdm import tqdm

        self._first = sim.frame
        frames = round(sim.scene.duration * sim.scene.frame_rate)
        self._bar = tqdm(
            total=frames,
            initial=sim.frame,
            desc=self.label,
            unit="frame",
            file=sys.stderr,
            disable=True if self.quiet else None,  # None: only on a terminal
            leave=False,
        )

    def on_frame(self, frame: Frame) -> None:
        if frame.index > self._first:
            self._bar.update()

    def on_end(self, sim: Simulation) -> None:
        if self._bar is not None:
            self._bar.close()


class Interruption:
    """Turns Ctrl-C into an end between two frames, so that every observer has seen the same ones.

    It must be the last of the observers.  A second Ctrl-C ends the run at once.
    """

    looks_every = 0

    def __init__(self) -> None:
        self._asked = False
        self.is_between_frames = False
        """Whether the run ended by it, in a state that is whole."""
        self._before: Any = None

    def on_start(self, sim: Simulation) -> None:
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._note)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._asked:
            raise KeyboardInterrupt
        self._asked = True

    def on_frame(self, frame: Frame) -> None:
        if self._asked and frame.index == frame.simulation.frame:  # the last of those made together
            self.is_between_frames = True
            raise KeyboardInterrupt

    def on_end(self, sim: Simulation) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)
