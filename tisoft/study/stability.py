"""The failure map of a scene: where its methods stop being usable, measured against theory."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType
from typing import Any

from tisoft import stops
from tisoft.errors import SceneError
from tisoft.scene import Scene
from tisoft.study import compression, diagonals, own, pictures, poisson, rotation, step_damping
from tisoft.study.axis import Axis, Tick
from tisoft.study.subject import Subject
from tisoft.whole_files import as_json, make_folder, write_text

AXES: dict[str, ModuleType] = {
    "step-damping": step_damping,
    "compression": compression,
    "rotation": rotation,
    "poisson": poisson,
    "diagonals": diagonals,
}
"""The axes of failure by their names."""

_NEED_THE_RUN = {"compression", "rotation"}


def chosen(only: str | None) -> list[str]:
    """The axes that --only names; raises SceneError."""
    if only is None:
        return list(AXES)
    names = [name.strip() for name in only.split(",") if name.strip()]
    unknown = [name for name in names if name not in AXES]
    if unknown or not names:
        problem = f"names no axis {unknown[0]!r}" if unknown else "names no axis"
        raise SceneError(f"--only {problem}; choose from {', '.join(AXES)}")
    return [name for name in AXES if name in names]


def files_of(names: Iterable[str]) -> list[str]:
    """What `write_study` writes for these axes, relative to its folder."""
    pictures_and_tables = [f"{name}.{kind}" for name in names for kind in ("png", "svg", "csv")]
    return [*pictures_and_tables, "stability.md", "summary.json"]


class Study:
    """The failure map of one scene, axis by axis.

    Args:
        scene: is run in its own precision; the maps are measured in f64.
        names: of the axes.

    Raises:
        SceneError: a scene without a body that resists motion.
    """

    def __init__(self, scene: Scene, names: Iterable[str] = AXES) -> None:
        self.names = list(names)
        self.subject = Subject(scene)
        self._watches = bool(_NEED_THE_RUN & set(self.names))

    def work(self) -> int:
        """Number of ticks that `axes` makes, about."""
        look = own.work() if self._watches else 0
        return look + sum(AXES[name].work(self.subject) for name in self.names)

    def axes(self, tick: Tick, on_axis: Callable[[str], None]) -> Iterable[Axis]:
        """Measure the axes one after another."""
        on_axis("the scene itself")
        place = own.look(self.subject, tick, run=self._watches)
        for name in self.names:
            on_axis(name)
            yield AXES[name].measure(self.subject, place, tick)


def write_study(
    study: Study,
    folder: str | Path,
    *,
    title: str,
    tick: Tick = lambda: None,
    on_axis: Callable[[str], None] = lambda name: None,
) -> dict[str, Any]:
    """Measure, and write each axis's pictures and table, the page and the summary into `folder`.

    Returns what summary.json holds.  Interrupted, the axes measured so far stay whole, and the
    page and the summary tell of them.

    Raises:
        SceneError: where the folder cannot be written.
    """
    place = make_folder(folder)
    begun = time.perf_counter()
    done: list[Axis] = []

    def tell(status: str) -> dict[str, Any]:
        seconds = time.perf_counter() - begun
        result = summary(study, done, status=status, seconds=seconds)
        write_text(place / "stability.md", page(study, done, title=title))
        write_text(place / "summary.json", as_json(result) + "\n")
        return result

    try:
        with stops.as_stops():
            for axis in study.axes(tick, on_axis):
                pictures.save(axis, place)
                write_text(place / f"{axis.name}.csv", axis.table())
                done.append(axis)
    except KeyboardInterrupt:
        tell("interrupted")
        raise
    return tell("done")


def summary(study: Study, axes: list[Axis], *, status: str, seconds: float) -> dict[str, Any]:
    """The object of --json."""
    return {
        "status": status,
        "body": study.subject.body.name,
        "stable_step": study.subject.limit,
        "wall_seconds": seconds,
        "axes": {axis.name: {"sentence": axis.sentence, **axis.numbers} for axis in axes},
    }


def page(study: Study, axes: list[Axis], *, title: str) -> str:
    """The text of stability.md."""
    body = study.subject.body
    cells = body.mesh.elements
    count = f"{cells} elements" if cells else f"{len(body.springs())} springs"
    lines = [
        f"# Where {title} fails",
        "",
        f"Measured on {body.name!r} ({len(body.mesh.points)} nodes, {count}), the body that sets "
        f"the scene's stable step of {study.subject.limit * 1e3:.4g} ms; in f64, by short runs.",
    ]
    for axis in axes:
        lines += ["", f"## {axis.title}", "", axis.sentence, ""]
        lines += [f"![{axis.title}]({axis.name}.png)", ""]
        for note in axis.notes:
            lines += [note, ""]
        lines.append(f"Numbers: [{axis.name}.csv]({axis.name}.csv)")
    return "\n".join(lines) + "\n"
