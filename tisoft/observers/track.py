"""What a run looked like, kept frame by frame: a film needs all of it before its first picture."""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import SceneError
from tisoft.observers.quantities import QUANTITIES, node_values
from tisoft.simulation import Frame, Simulation

Floats = NDArray[np.float64]

IN_MEMORY = 512 * 2**20
"""Bytes of frames beyond which they are kept in a temporary file."""


@dataclass(frozen=True)
class Snapshot:
    """A scene at one moment."""

    time: float
    """[s]"""
    positions: Floats
    """World positions of all nodes [m], shape (nodes, 3), in the scene's order."""
    values: Floats | None = None
    """What colours show, one value per node; None for plain colours."""


def snapshot_of(sim: Simulation, color: str) -> Snapshot:
    """The simulation's present state, with the quantity that a colour of `render` names."""
    values = node_values(sim, color) if color in QUANTITIES else None
    return Snapshot(sim.time, sim.positions(), values)


class Track:
    """Keeps a Snapshot of every frame, in f32 about the first one's middle.

    `color` is that of `render`.  Reading it again and again gives the same snapshots.
    """

    def __init__(self, color: str) -> None:
        self.color = color
        self._times: list[float] = []
        self._frames: list[NDArray[np.float32]] = []
        self._file: IO[bytes] | None = None
        self._origin = np.zeros(3)
        self._columns = 4 if color in QUANTITIES else 3

    def __len__(self) -> int:
        return len(self._times)

    def on_frame(self, frame: Frame) -> None:
        self.keep(snapshot_of(frame.simulation, self.color))

    def keep(self, snapshot: Snapshot) -> None:
        """Append a snapshot.  Raises SceneError where no room is left for it."""
        if not self._times:
            self._origin = snapshot.positions.mean(axis=0)
        rows = np.empty((len(snapshot.positions), self._columns), np.float32)
        rows[:, :3] = snapshot.positions - self._origin
        if snapshot.values is not None:
            rows[:, 3] = snapshot.values
        self._times.append(snapshot.time)
        self._frames.append(rows)
        if len(self._frames) * rows.nbytes > IN_MEMORY:
            self._unload()

    def _unload(self) -> None:
        """Move the frames in memory to the end of the file."""
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile()
                weakref.finalize(self, self._file.close)
            self._file.seek(0, 2)
            for rows in self._frames:
                rows.tofile(self._file)
        except OSError as error:
            place = tempfile.gettempdir()
            problem = f"the frames of the film do not fit into {place}: {error.strerror or error}"
            raise SceneError(f"{problem}; make room there, or set TMPDIR") from None
        self._shape = self._frames[0].shape
        self._frames.clear()

    def __iter__(self) -> Iterator[Snapshot]:
        filed = len(self._times) - len(self._frames)
        for index, time in enumerate(self._times):
            rows = self._filed(index) if index < filed else self._frames[index - filed]
            values = rows[:, 3].astype(np.float64) if self._columns == 4 else None
            yield Snapshot(time, rows[:, :3] + self._origin, values)

    def _filed(self, index: int) -> NDArray[np.float32]:
        assert self._file is not None
        count = self._shape[0] * self._shape[1]
        self._file.seek(4 * count * index)
        return np.fromfile(self._file, np.float32, count).reshape(self._shape)
