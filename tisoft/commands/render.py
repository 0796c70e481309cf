"""tisoft render: simulate a scene and draw it off-screen."""

from __future__ import annotations

import argparse
import time

from tisoft.commands import common


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    common.add_scene(parser)
    parser.add_argument(
        "-o", "--output", metavar="OUT", required=True,
        help="a film (.mp4, .gif, .webp), a picture of the end (.png), or a folder of pictures",
    )  # fmt: skip
    common.add_picture(parser)


def execute(options: argparse.Namespace) -> int:
    """Simulate twice: a first look fixes the view and the colours, the second run is drawn."""
    begun = time.perf_counter()
    scene = common.scene_of(options)
    from tisoft import runtime

    runtime.import_taichi()
    from tisoft.observers.film import film_to, surveyed
    from tisoft.observers.progress import Progress
    from tisoft.simulation import Simulation

    sim = Simulation(scene, arch=options.arch)
    survey = surveyed(sim, [Progress("looking ahead", quiet=options.quiet)])
    sim = Simulation(scene, arch=options.arch)
    with film_to(options.output, sim, survey) as film:
        sim.run(observers=[film, Progress("drawing", quiet=options.quiet)])
    print(f"{options.output}: {film.sink.count} pictures in {time.perf_counter() - begun:.1f} s")
    return 0
