"""Checkpoints of a run in its folder, and how a run goes on from one."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tisoft import checkpoint, resume
from tisoft.checks import FieldError, joined, shown
from tisoft.errors import SceneError
from tisoft.folders import ResultFolder
from tisoft.manifest import CHECKPOINT
from tisoft.scene import Scene
from tisoft.simulation import Frame, Simulation

INTERVAL = 30.0
"""Seconds of wall time between checkpoints at the most."""
MOST_SHARE = 20.0
"""Times that the writing of a large one took, which then pass before the next."""

FREE = ("duration", "checkpoint_every", "camera", "render")
"""Keys of a scene that change nothing of what has been simulated so far."""

_KEYS = {
    "bodies": "body",
    "obstacles": "obstacle",
    "probes": "probe",
    "pins": "pin",
    "loads": "load",
}
_MESHES = ("TetMesh", "SolidMesh", "SpringNet")


class Published(Protocol):
    """A file that can be made whole while it is still written."""

    def publish(self) -> None:
        """Put what was written so far under the file's name."""


class Checkpoints:
    """Writes DIR/checkpoint.npz every n-th frame (`checkpoint_every` of the scene), and every
    30 s of wall time: an end without warning costs no more than that.

    Tables are published first: whatever happens, they are never behind the checkpoint.
    """

    def __init__(
        self,
        folder: ResultFolder,
        sim: Simulation,
        tables: Sequence[Published],
        *,
        notes: Callable[[], dict[str, Any]],
    ) -> None:
        self.path = folder.path / CHECKPOINT
        self.tables = tables
        self.every = self.looks_every = sim.scene.checkpoint_every
        self._folder = folder
        self._notes = notes
        self._same = {"scene": described(sim.scene), "arch": sim.arch}
        self._last = sim.frame if sim.frame else None
        self._pause, self._when = INTERVAL, time.monotonic()

    def on_frame(self, frame: Frame) -> None:
        due = self.every and frame.index % self.every == 0
        if due or time.monotonic() - self._when > self._pause:
            self.save(frame.simulation)

    def save(self, sim: Simulation) -> None:
        """Write a checkpoint of the present frame, unless that is what the last one holds."""
        if sim.frame == self._last:
            return
        begun = time.monotonic()
        for table in self.tables:
            table.publish()
        resume.save(sim, self.path, notes=self._same | self._notes())
        self._last = sim.frame
        frames = round(sim.scene.duration * sim.scene.frame_rate)
        self._folder.tell(min(1.0, sim.frame / max(frames, 1)))
        self._when = time.monotonic()
        self._pause = max(INTERVAL, MOST_SHARE * (self._when - begun))

    @property
    def exist(self) -> bool:
        """Whether there is one to go on from."""
        return self._last is not None


def find(folder: Path) -> Path:
    """The checkpoint in a folder; raises SceneError where there is none."""
    path = folder / CHECKPOINT
    if not path.is_file():
        raise SceneError(
            f"{folder} holds no {CHECKPOINT} to resume from: a run writes one every 30 s, and at "
            "its end; run it without --resume"
        )
    return path


def go_on(sim: Simulation, path: Path) -> dict[str, Any]:
    """Set a freshly made simulation to the checkpoint of an earlier run; returns its notes.

    Raises:
        SceneError: a damaged checkpoint, or one of another scene, with the first key that differs.
    """
    content, arrays = checkpoint.read(path)
    with checkpoint.damage_told(path):
        notes: dict[str, Any] | None = content.get("notes")
        if notes is None:
            raise SceneError(f"{path} is of another program than tisoft run; run the scene anew")
        _compare(notes["scene"], described(sim.scene), "")
        if notes["arch"] != sim.arch:
            raise SceneError(f"{path} was written with --arch {notes['arch']}; go on with that")
        resume.put(sim, content, arrays)
        return {key: notes[key] for key in ("seconds", "save_every")}


def described(scene: Scene) -> Any:
    """A scene as JSON, but for what may change between runs; arrays are hashes."""
    store: dict[str, NDArray[Any]] = {}
    tree = checkpoint.plain(scene, store)
    for key in FREE:
        del tree["fields"][key]
    return _hashed(tree, store)


def _hashed(tree: Any, store: dict[str, NDArray[Any]]) -> Any:
    if isinstance(tree, list):
        return [_hashed(item, store) for item in tree]
    if not isinstance(tree, dict):
        return tree
    if "array" in tree:
        values = np.ascontiguousarray(store[tree["array"]])
        text = f"{values.dtype.str} {values.shape}".encode()
        return {"array": hashlib.sha256(text + values.tobytes()).hexdigest()}
    return {key: _hashed(item, store) for key, item in tree.items()}


def _compare(old: Any, new: Any, path: str) -> None:
    """Raise FieldError, with the first key that differs; `path` is the key of both."""
    if old == new:
        return
    for key, before, now in _members(old, new):
        _compare(before, now, joined(path, key))
    plain = not isinstance(old, dict | list) and not isinstance(new, dict | list)
    was = f"was {shown(old)}" if plain and old is not None else "is not what it was"
    value = {"value": new} if plain and new is not None else {}
    raise FieldError(
        path or "the scene",
        f"{was} when the checkpoint was written; give that scene, or run it without --resume",
        **value,
    )


def _members(old: Any, new: Any) -> Iterator[tuple[str, Any, Any]]:
    """Keys with values of two trees of the same kind; nothing for different kinds, and meshes."""
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        yield from zip((f"[{i}]" for i in range(len(old))), old, new, strict=True)
    elif isinstance(old, dict) and isinstance(new, dict) and old.keys() == new.keys():
        if "fields" in old and old["type"] == new["type"] and old["type"] not in _MESHES:
            for key, before in old["fields"].items():
                now = new["fields"].get(key)
                flat = key == "model" and before["type"] == now["type"]
                yield "" if flat else _KEYS.get(key, key), before, now
        elif "tuple" in old:
            yield "", old["tuple"], new["tuple"]
