"""The recording that runs, if one does: its frames, and its end, a piece at a time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tisoft.scene import Scene
from tisoft.simulation import Simulation
from tisoft.viewer.picture import Snapshot
from tisoft.viewer.recording import Recording, recording_to


class Recorder:
    """Keeps frames while something is recorded."""

    def __init__(self) -> None:
        self.recording: Recording | None = None
        """What is being recorded, or written."""
        self._pieces: Iterator[None] | None = None

    @property
    def writes(self) -> bool:
        """Whether a recording has ended, and its file is being written."""
        return self._pieces is not None

    @property
    def needs_shot(self) -> bool:
        """Whether `keep` wants the data of a picture."""
        return self.recording is not None and self.recording.needs_shot

    def begin(self, path: Path, scene: Scene, color: str, hello: dict[str, Any]) -> None:
        """Record from now on.  Raises SceneError for a bad place."""
        self.recording = recording_to(path, scene, color, hello)

    def keep(self, sim: Simulation, shot: Snapshot | None) -> None:
        """Keep the present frame.  Raises TisoftError where there is no room for it: then the
        recording ends.
        """
        assert self.recording is not None
        try:
            self.recording.keep(sim, shot)
        except BaseException:
            self.stop()
            raise

    def stop(self) -> None:
        """End the recording: from now on `write_on` writes it."""
        if self.recording is not None and self._pieces is None:
            self._pieces = self.recording.finish()

    def write_on(self) -> str:
        """Write the next piece; tells what the file holds once it is whole, else nothing.

        Raises:
            TisoftError: it cannot be written; then it is given up.
        """
        assert self.recording is not None and self._pieces is not None
        recording = self.recording
        try:
            next(self._pieces)
            return ""
        except StopIteration:
            self.recording, self._pieces = None, None
            return f"{recording.path} holds {recording.done} frames"
        except BaseException:
            self.recording, self._pieces = None, None
            raise

    def rest(self) -> Iterator[int]:
        """End the recording and write it, a piece each time, and tell how many frames are written;
        closed early, the file holds those.
        """
        self.stop()
        if self.recording is None or self._pieces is None:
            return
        recording, pieces = self.recording, self._pieces
        try:
            for _ in pieces:
                yield recording.done
        finally:
            pieces.close()  # type: ignore[attr-defined]
            self.recording, self._pieces = None, None

    def told(self) -> dict[str, Any] | None:
        """What a page tells of it, for JSON."""
        if self.recording is None:
            return None
        return {
            "file": self.recording.path.name,
            "frames": len(self.recording),
            "written": self.recording.done,
            "writing": self.writes,
        }
