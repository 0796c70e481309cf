"""Films: a picture of every frame, into a file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tisoft.folders import Owner
from tisoft.observers.scenery import Scenery, Survey
from tisoft.render.video import Sink, open_sink
from tisoft.scene import Scene
from tisoft.simulation import Frame


class Look:
    """A first look at a run, which a film of it needs for its view and its colours' range."""

    def __init__(self, color: str) -> None:
        self.color = color
        self.survey = Survey()

    def on_frame(self, frame: Frame) -> None:
        self.survey.see(frame.simulation, self.color)


class Film:
    """Draws every frame into an open sink.

    Without a survey, from an earlier Look at the same run, it frames what may happen by the start
    alone, and the colours' range grows with the values.
    """

    def __init__(self, sink: Sink, survey: Survey | None = None) -> None:
        self.sink = sink
        self.survey = survey
        self.kept_index: int | None = None
        """Frame whose picture is kept in `kept`."""
        self.kept: NDArray[np.uint8] | None = None
        self._scenery: Scenery | None = None

    def on_frame(self, frame: Frame) -> None:
        sim = frame.simulation
        if self._scenery is None or self._scenery.sim is not sim:
            self._grows = self.survey is None
            survey = self.survey or Survey.of_start(sim)
            self._scenery = Scenery(sim, survey)
        if self._grows:
            survey = self._scenery.survey
            survey.see(sim, sim.scene.render.color)
            survey.tops = [max(survey.tops)] if survey.tops else []
        picture = self._scenery.draw()
        self.sink.write(picture)
        if frame.index == self.kept_index:
            self.kept = picture


@contextmanager
def film_to(path: str | Path, scene: Scene, owner: Owner | None = None) -> Iterator[Film]:
    """A Film of a scene that ends in the file `path`, whole or not at all.

    Where `path` is a folder, `owner` says whose result it is to hold.
    """
    with open_sink(path, scene.render.size, scene.frame_rate, owner) as sink:
        yield Film(sink)
