"""Runs with observers.

An observer has on_start(sim), on_frame(frame), on_end(sim), each optional; a plain callable is
on_frame.  One whose attribute `looks_every` is n asks a frame for positions, or the simulation for
anything, in every n-th frame only (0: never); in the others for `Frame.probes` and `Frame.energy`
at the most.  Frames between such looks share a launch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

HOOKS = ("on_start", "on_frame", "on_end")
ALONE = 10
"""First frames of a simulation, made one by one: what goes wrong at once is seen at once."""


def run(sim: Any, count: int, observers: list[Any]) -> None:
    """Make `count` frames of a simulation, the present one told first."""
    on_frame = [hook(observer, "on_frame") for observer in observers]
    for observer in observers:
        hook(observer, "on_start")(sim)
    try:
        for frame in _frames(sim, count, observers):
            for tell in on_frame:
                tell(frame)
    finally:
        for observer in observers:
            hook(observer, "on_end")(sim)


def _frames(sim: Any, count: int, observers: list[Any]) -> Iterator[Any]:
    every = [getattr(observer, "looks_every", 1) for observer in observers]
    tells = any(n != 1 for n in every)
    last = sim.frame + count
    yield sim.here()
    while sim.frame < last:
        first = sim.frame
        free = [n - first % n for n in every if n] + [last - first]
        made = sim.make_frames(min(free)) if first >= ALONE else []
        if not made:
            made = [sim.make_frame(tells=tells)]
        for k, told in enumerate(made, 1):
            yield sim.told(first + k, told)


def nothing(_: Any) -> None:
    """The hook of an observer that has none."""


def hook(observer: Any, name: str) -> Callable[[Any], Any]:
    """An observer's on_start, on_frame or on_end; a plain callable is on_frame."""
    default = observer if name == "on_frame" and callable(observer) else nothing
    found: Callable[[Any], Any] = getattr(observer, name, default)
    return found
