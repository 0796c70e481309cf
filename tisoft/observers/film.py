"""Films: a picture of every frame, into a file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tisoft.observers.scenery import Scenery, Survey
from tisoft.render.video import Sink, open_sink
from tisoft.simulation import Frame, Simulation


class Look:
    """A first look at a run, which a film of it needs for its view and its colours' range."""

    def __init__(self, color: str) -> None:
        self.color = color
        self.survey = Survey()

    def on_frame(self, frame: Frame) -> None:
        self.survey.see(frame.simulation, self.color)


class Film:
    """Draws every frame into an open sink."""

    def __init__(self, sink: Sink, survey: Survey) -> None:
        self.sink = sink
        self.survey = survey
        self._scenery: Scenery | None = None

    def on_frame(self, frame: Frame) -> None:
        if self._scenery is None:
            self._scenery = Scenery(frame.simulation, self.survey)
        self.last = self._scenery.draw()
        self.sink.write(self.last)


@contextmanager
def film_to(path: str | Path, sim: Simulation, survey: Survey) -> Iterator[Film]:
    """A Film of `sim` that ends in the file `path`, whole or not at all."""
    with open_sink(path, sim.scene.render.size, sim.scene.frame_rate) as sink:
        yield Film(sink, survey)


def surveyed(sim: Simulation, observers: Iterable[Any] = ()) -> Survey:
    """Run the scene without drawing, to learn where it goes."""
    look = Look(sim.scene.render.color)
    sim.run(observers=[look, *observers])
    return look.survey
