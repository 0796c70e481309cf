"""Films: a picture of every frame, into a file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tisoft.folders import Owner
from tisoft.observers.framing import Survey
from tisoft.observers.scenery import Scenery, actors_of, followed_by
from tisoft.observers.track import Snapshot, snapshot_of
from tisoft.render.video import Sink, open_sink
from tisoft.scene import Scene
from tisoft.simulation import Frame, Simulation


class Film:
    """Draws every frame into an open sink.

    Without a survey of all that will be shown it frames what may happen by the start alone, and the
    colours' range grows with the values.
    """

    def __init__(self, sink: Sink, survey: Survey | None = None) -> None:
        self.sink = sink
        self.survey = survey
        self.kept_index: int | None = None
        """Which picture, from 0, is kept in `kept`."""
        self.kept: NDArray[np.uint8] | None = None
        self._count = 0
        self._sim: Simulation | None = None

    def on_frame(self, frame: Frame) -> None:
        sim = frame.simulation
        if self._sim is not sim:
            self._sim = sim
            self._grows = self.survey is None
            actors = actors_of(sim.scene)
            survey = self.survey or Survey.of_start(sim, followed_by(sim.scene, actors))
            self.scenery = Scenery(sim.scene, actors, survey)
        snapshot = snapshot_of(sim, sim.scene.render.color)
        if self._grows:
            survey = self.scenery.survey
            survey.add(snapshot)
            survey.tops = [max(survey.tops)] if survey.tops else []
        self.show(snapshot)

    def show(self, snapshot: Snapshot) -> None:
        """Draw a snapshot by the scenery that is set."""
        picture = self.scenery.draw(snapshot)
        self.sink.write(picture)
        if self._count == self.kept_index:
            self.kept = picture
        self._count += 1


def is_framed(scene: Scene) -> bool:
    """Whether a film can be drawn while its scene runs: nothing of how it looks depends on what
    will happen."""
    camera = scene.camera
    return camera.eye is not None and camera.target is not None and scene.render.color == "body"


@contextmanager
def film_to(path: str | Path, scene: Scene, owner: Owner | None = None) -> Iterator[Film]:
    """A Film of a scene that ends in the file `path`, whole or not at all.

    Where `path` is a folder, `owner` says whose result it is to hold.
    """
    look = scene.render
    with open_sink(path, look.size, scene.frame_rate, owner, alpha=look.alpha) as sink:
        yield Film(sink)
