"""tisoft render: simulate a scene and draw it off-screen, or draw a run that was saved."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tisoft import runtime, stops
from tisoft.commands import common
from tisoft.errors import SceneError
from tisoft.folders import Owner
from tisoft.scene import Scene
from tisoft.scene_file import load_scene
from tisoft.whole_files import as_json

if TYPE_CHECKING:
    from tisoft.observers.film import Film

HELP = "simulate a scene and draw it, or draw a saved run, without a display"
EXAMPLES = """examples:
  tisoft render beam.toml -o beam.mp4 --color stress
  tisoft render beam.toml -o beam.png               a picture of the end
  tisoft render beam.toml -o pictures/              a folder of pictures
  tisoft render beam.toml -o beam.webp --alpha      without a background
  tisoft render out/frames.pvd -o beam.mp4          frames of run -o out --save-every 1
  tisoft render out/frames.pvd --scene beam.toml -o beam.mp4

A saved run knows its bodies alone; --scene brings its obstacles, its camera and its colours."""


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    common.add_scene(parser)
    parser.add_argument("--scene", dest="scenery", metavar="SCENE", help="of a saved run (.toml)")
    common.add_place(
        parser,
        "OUT",
        "a film (.mp4, .gif, .webp), a picture of the end (.png), or a folder of pictures",
        required=True,
    )
    common.add_picture(parser)


def execute(options: argparse.Namespace) -> int:
    """Draw the scene and report."""
    if Path(options.scene).suffix.lower() == ".pvd":
        return _draw_saved(options)
    if options.scenery:
        raise SceneError(f"--scene goes with a saved run (frames.pvd), not with {options.scene}")
    scene = common.scene_of(options)
    pictures = round(scene.duration * scene.frame_rate) + 1
    owner = common.owner_of(options, "render", pictures=pictures)
    run, film = draw(scene, options, options.output, owner=owner)
    count = film.sink.kept if film else 0
    result = run.result(output=options.output, pictures=count)
    return run.report(options, result, *_told(scene, options, count))


def _told(scene: Scene, options: argparse.Namespace, count: int) -> list[str]:
    width, height = scene.render.size
    many = "picture" if count == 1 else "pictures"
    return [f"{options.output}: {count} {many} of {width} x {height} pixels"] if count else []


def draw(
    scene: Scene,
    options: argparse.Namespace,
    output: str | Path,
    *,
    owner: Owner | None = None,
    kept: float | None = None,
) -> tuple[common.Run, Film | None]:
    """Simulate, and draw: while it runs, where all of the look is given; else when it has run, as
    the view and the range of the colours depend on the whole.

    The film keeps the picture at the share `kept` of the run in `film.kept`.  There is none where
    the run was stopped before.
    """
    sim = common.simulation_of(scene, options)

    from tisoft.observers.film import film_to, is_framed
    from tisoft.observers.progress import Progress
    from tisoft.observers.track import Track

    run = common.Run(sim)
    film: Film | None = None
    with run.ended(), film_to(output, scene, owner) as film_there:  # a wrong place is told at once
        film = film_there
        film.kept_index = round((kept or 1.0) * scene.duration * scene.frame_rate)
        track = Track(scene.render.color)
        watching = [film if is_framed(scene) else track]
        run.step(observers=[*watching, Progress("running", quiet=options.quiet)])
        if len(track):
            _show(film, scene, track, options)
    run.seconds = sim.wall_seconds
    return run, film


def _show(film: Film, scene: Scene, track: Any, options: argparse.Namespace) -> None:
    """Draw what a run has left, with a view of all of it."""
    from tisoft.observers.framing import Survey
    from tisoft.observers.progress import Progress
    from tisoft.observers.scenery import Scenery, actors_of, followed_by

    actors = getattr(track, "actors", None) or actors_of(scene)
    survey = Survey.of(track, followed_by(scene, actors))
    film.scenery = Scenery(scene, actors, survey)
    progress = Progress("drawing", quiet=options.quiet)
    progress.begin(len(track) - 1)
    try:
        with stops.between_frames():
            for index, snapshot in enumerate(track):
                film.show(snapshot)
                progress.on_frame(Picture(index))
                stops.raise_if_asked()
        stops.raise_if_asked()
    finally:
        progress.on_end()


@dataclass(frozen=True)
class Picture:
    """A picture of a film."""

    index: int


def _draw_saved(options: argparse.Namespace) -> int:
    """Draw frames that a run has saved."""
    if options.settings and not options.scenery:
        raise SceneError("--set changes a scene; name it with --scene")
    scene = load_scene(options.scenery, options.settings) if options.scenery else Scene()
    scene.render = common.render_of(options, scene.render)
    runtime.import_taichi()

    from tisoft.observers.film import film_to
    from tisoft.observers.saved import SavedRun

    saved = SavedRun(Path(options.scene), scene.render.color)
    for actor, body in zip(saved.actors, scene.bodies, strict=False):
        actor.name = body.name
    scene.frame_rate = saved.rate()
    runtime.start(options.arch)
    owner = common.owner_of(options, "render", pictures=len(saved))
    with film_to(options.output, scene, owner) as film:
        _show(film, scene, saved, options)
    count = film.sink.kept
    if options.json:
        print(as_json({"status": "done", "output": options.output, "pictures": count}))
    elif not options.quiet:
        print("\n".join(_told(scene, options, count)))
    return 0
