"""Progress on a terminal, and frames that an end from outside does not cut."""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Sequence
from typing import Any, Protocol

from tisoft import stops
from tisoft.simulation import Frame, Simulation


class Counted(Protocol):
    """A frame, or a picture of one."""

    @property
    def index(self) -> int:
        """Its number."""
        ...


class Progress:
    """Counts frames on standard error where that is a terminal."""

    looks_every = 0

    def __init__(self, label: str, *, quiet: bool = False) -> None:
        self.label = label
        self.quiet = quiet
        self._bar: Any = None

    def on_start(self, sim: Simulation) -> None:
        self.begin(round(sim.scene.duration * sim.scene.frame_rate), sim.frame)

    def begin(self, frames: int, first: int = 0) -> None:
        """Count from frame `first` to `frames`."""
        from tqdm import tqdm

        self._first = first
        self._bar = tqdm(
            total=frames,
            initial=first,
            desc=self.label,
            unit="frame",
            file=sys.stderr,
            disable=True if self.quiet else None,  # None: only on a terminal
            leave=False,
        )

    def on_frame(self, frame: Counted) -> None:
        if frame.index > self._first:
            with contextlib.suppress(OSError):  # the terminal was closed
                self._bar.update()

    def on_end(self, sim: Simulation | None = None) -> None:
        if self._bar is not None:
            with contextlib.suppress(OSError):
                self._bar.close()


class WholeFrames:
    """Observers that all see the same frames, however a run is stopped: see `stops`."""

    def __init__(self, observers: Sequence[Any]) -> None:
        self.observers = observers
        self.is_whole = False
        """Whether the state is that of the last frame that the observers saw."""

    @property
    def looks_every(self) -> int:
        """Frames after which some observer looks at the state: see `Simulation.run`."""
        return math.gcd(*(getattr(observer, "looks_every", 1) for observer in self.observers))

    def on_start(self, sim: Simulation) -> None:
        self._tell("on_start", sim)

    def on_frame(self, frame: Frame) -> None:
        self.is_whole = False
        self._tell("on_frame", frame)
        # Of frames made together the state is that of the last.
        if frame.is_present and (stop := stops.asked()) is not None:
            self.is_whole = True
            raise stop

    def on_end(self, sim: Simulation) -> None:
        self._tell("on_end", sim)

    def _tell(self, hook: str, subject: Frame | Simulation) -> None:
        with stops.held():
            for observer in self.observers:
                getattr(observer, hook, _nothing)(subject)

    def run(self, sim: Simulation, seconds: float | None = None) -> None:
        """Run a simulation under these eyes; raises `Stopped` between frames where that is soon."""
        with stops.between_frames():
            sim.run(seconds, observers=[self])
            self.is_whole = True
        stops.raise_if_asked()


def _nothing(_: Any) -> None:
    return None
