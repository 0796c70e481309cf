"""tisoft render: simulate a scene and draw it off-screen."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from tisoft.commands import common
from tisoft.folders import Owner
from tisoft.scene import Scene

if TYPE_CHECKING:
    from tisoft.observers.film import Film

HELP = "simulate a scene and draw it, without a display"
EXAMPLES = """examples:
  tisoft render beam.toml -o beam.mp4 --color stress
  tisoft render beam.toml -o beam.png               a picture of the end
  tisoft render beam.toml -o pictures/              a folder of pictures

The scene runs twice: a first look, undrawn, fixes the view and the range of the colours."""


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    common.add_scene(parser)
    common.add_place(
        parser,
        "OUT",
        "a film (.mp4, .gif, .webp), a picture of the end (.png), or a folder of pictures",
        required=True,
    )
    common.add_picture(parser)


def execute(options: argparse.Namespace) -> int:
    """Draw the scene and report."""
    scene = common.scene_of(options)
    pictures = round(scene.duration * scene.frame_rate) + 1
    owner = common.owner_of(options, "render", pictures=pictures)
    run, film = draw(scene, options, options.output, owner=owner)
    count = film.sink.kept if film else 0
    size = "{} x {}".format(*scene.render.size)
    many = "picture" if count == 1 else "pictures"
    told = [f"{options.output}: {count} {many} of {size} pixels"] if count else []
    return run.report(options, run.result(output=options.output, pictures=count), *told)


def draw(
    scene: Scene,
    options: argparse.Namespace,
    output: str | Path,
    *,
    owner: Owner | None = None,
    kept: float | None = None,
) -> tuple[common.Run, Film | None]:
    """Simulate twice: a first look fixes the view and the colours, the second run is drawn.

    The film keeps the picture at the share `kept` of the run in `film.kept`.  There is none where
    the run was stopped before.
    """
    sim = common.simulation_of(scene, options)

    from tisoft.observers.film import Look, film_to
    from tisoft.observers.progress import Progress

    run = common.Run(sim)
    film: Film | None = None
    with run.ended(), film_to(output, scene, owner) as film_there:  # a wrong place is told at once
        film, look = film_there, Look(scene.render.color)
        run.step(observers=[look, Progress("looking", quiet=options.quiet)])
        run.sim = common.simulation_of(scene, options)
        film.survey, film.kept_index = look.survey, round((kept or 1.0) * sim.frame)
        run.step(observers=[film, Progress("drawing", quiet=options.quiet)])
    run.seconds = run.sim.wall_seconds
    return run, film
