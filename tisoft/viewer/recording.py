"""Recordings: every simulated frame, at the simulation's own rate, however slow the pages are.

A film keeps the frames (`observers.track`) and draws them when the recording ends, as only then is
known what there is to see; a page (`viewer.replay`) is written then.  Either file is whole when its
recording ends, and when the program is stopped.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tisoft.errors import SceneError
from tisoft.folders import check_free
from tisoft.moving import pose
from tisoft.observers.film import film_to
from tisoft.observers.framing import Survey
from tisoft.observers.scenery import Scenery, actors_of, followed_by
from tisoft.observers.track import Track, snapshot_of
from tisoft.scene import Scene
from tisoft.simulation import Simulation
from tisoft.viewer.orders import RECORDS
from tisoft.viewer.picture import Snapshot
from tisoft.viewer.replay import Replay
from tisoft.whole_files import make_folder

SUFFIXES = tuple(f".{kind}" for kind in RECORDS)


def checked_place(path: str | Path) -> Path:
    """Where a recording may be written; raises SceneError."""
    place = Path(path)
    if place.suffix.lower() not in SUFFIXES:
        raise SceneError(
            f"{path} cannot be recorded to; give a film (.mp4, .gif, .webp) or a page that plays "
            "in a browser (.html)"
        )
    if place.is_dir():
        raise SceneError(f"{path} is a folder; give the name of a file in it")
    make_folder(place.parent)
    try:
        check_free(place)
    except OSError as error:
        raise SceneError(f"{path} cannot be written: {error.strerror or error}") from None
    return place


def free_name(kind: str) -> Path:
    """A name in the present folder that no file has."""
    number = 1
    while (place := Path(f"recording-{number}.{kind}")).exists():
        number += 1
    return place


class Recording:
    """What is recorded into the file `path`; `finish` writes it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.done = 0
        """Frames that are written."""

    def __len__(self) -> int:
        raise NotImplementedError

    @property
    def needs_shot(self) -> bool:
        """Whether `keep` wants the data of a picture."""
        return False

    def keep(self, sim: Simulation, shot: Snapshot | None) -> None:
        """Keep the present frame.  Raises SceneError where there is no room for it."""
        raise NotImplementedError

    def finish(self) -> Iterator[None]:
        """Write the file, a piece each time; closed before its end, what there is is made whole."""
        raise NotImplementedError


class FilmRecording(Recording):
    """Into a film, by tisoft's own renderer."""

    def __init__(self, path: Path, scene: Scene, color: str) -> None:
        super().__init__(path)
        self.scene = dataclasses.replace(scene, obstacles=list(scene.obstacles))
        self.scene.render = dataclasses.replace(scene.render, color=color, alpha=False)
        self._track = Track(color)
        self._ways: list[list[tuple[float, ...]]] = [[] for _ in scene.obstacles]
        self._open = contextlib.ExitStack()
        self._film = self._open.enter_context(film_to(path, self.scene))

    def __len__(self) -> int:
        return len(self._track)

    def keep(self, sim: Simulation, shot: Snapshot | None) -> None:
        now = snapshot_of(sim, self.scene.render.color)
        # One clock for the whole film, also where the scene was begun anew on the way.
        time = len(self._track) / self.scene.frame_rate
        self._track.keep(dataclasses.replace(now, time=time))
        for way, obstacle in zip(self._ways, sim.scene.obstacles, strict=True):
            way.append((time, *pose(obstacle, sim.time)[1][0].tolist()))

    def finish(self) -> Iterator[None]:
        try:
            self._set()
            for snapshot in self._track:
                self._film.show(snapshot)
                self.done += 1
                yield
        except GeneratorExit:
            pass
        except BaseException as error:
            if not self._open.__exit__(type(error), error, error.__traceback__):
                raise
        self._open.close()

    def _set(self) -> None:
        """Set the stage by what all of the film shows."""
        for number, (way, obstacle) in enumerate(
            zip(self._ways, self.scene.obstacles, strict=True)
        ):
            moved = np.ptp(np.array(way)[:, 1:], axis=0).any() or any(way[0][1:])
            if obstacle.turn is None and moved and len(way) > 1:
                path: Any = tuple(way)
                self.scene.obstacles[number] = dataclasses.replace(
                    obstacle, velocity=None, path=path
                )
        actors = actors_of(self.scene)
        survey = Survey.of(self._track, followed_by(self.scene, actors))
        self._film.scenery = Scenery(self.scene, actors, survey)


class PageRecording(Recording):
    """Into one HTML file that plays without Python and without a network."""

    def __init__(self, path: Path, hello: dict[str, Any], rate: float) -> None:
        super().__init__(path)
        self._replay = Replay(hello, rate)

    def __len__(self) -> int:
        return len(self._replay)

    @property
    def needs_shot(self) -> bool:
        return True

    def keep(self, sim: Simulation, shot: Snapshot | None) -> None:
        assert shot is not None
        self._replay.keep(shot)

    def finish(self) -> Iterator[None]:
        self._replay.write(self.path)
        self.done = len(self._replay)
        yield


def recording_to(path: Path, scene: Scene, color: str, hello: dict[str, Any]) -> Recording:
    """What records to a file; its suffix says what.  Raises SceneError for a bad place."""
    if path.suffix.lower() == ".html":
        return PageRecording(checked_place(path), hello, scene.frame_rate)
    return FilmRecording(checked_place(path), scene, color)
