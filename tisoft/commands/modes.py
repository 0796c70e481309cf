"""tisoft modes: natural frequencies and shapes."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tisoft import runtime
from tisoft.check.meshes import mesh_warnings
from tisoft.commands import common
from tisoft.errors import SceneError
from tisoft.folders import ResultFolder
from tisoft.scene import Scene
from tisoft.whole_files import as_json, write_text

if TYPE_CHECKING:
    from tisoft.equilibrium.modes import Modes

HELP = "the lowest natural frequencies of a scene, and films of the shapes"
EXAMPLES = """examples:
  tisoft modes beam.toml -n 10
  tisoft modes beam.toml --about equilibrium
  tisoft modes beam.toml -o bend.gif --shape 1     the first shape, swinging in a loop"""

FILES = ("summary.json",)

PERIOD = 2.0
"""Seconds of film for one swing, whatever the frequency."""
AMPLITUDE = 0.12
"""Largest displacement shown, as a share of the largest body's size."""


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    common.add_scene(parser)
    parser.add_argument(
        "-n", metavar="N", dest="count", type=int, default=6, help="how many modes (6)"
    )
    parser.add_argument(
        "--about", choices=("rest", "equilibrium"), default="rest",
        help="the state that the modes swing about (rest)",
    )  # fmt: skip
    common.add_place(
        parser, "OUT", "a film of one shape (.mp4, .gif, .webp), or a folder for summary.json"
    )
    parser.add_argument(
        "--shape", metavar="K", type=int, default=1, help="the mode to film, counted from 1"
    )
    common.add_picture(parser)


def execute(options: argparse.Namespace) -> int:
    """Compute the modes and report."""
    if options.count < 1:
        raise SceneError(f"-n is {options.count}; give the number of modes, at least 1")
    if not 1 <= options.shape <= options.count:
        raise SceneError(f"--shape is {options.shape}; it must be from 1 to {options.count} (-n)")
    scene = common.scene_of(options)
    runtime.import_taichi()
    runtime.start(options.arch)
    if not options.output or Path(options.output).suffix:
        found = _measured(scene, options)
        if options.output:
            _film(scene, found, options)
    else:
        with ResultFolder(options.output, common.owner_of(options, "modes")) as folder:
            folder.foresee(FILES)
            found = _measured(scene, options)
            folder.begin(FILES)
            write_text(folder.path / "summary.json", as_json(_result(scene, found)) + "\n")
    _tell(options, scene, found)
    return 0


def _measured(scene: Scene, options: argparse.Namespace) -> Modes:
    from tisoft.equilibrium.modes import natural_modes

    return natural_modes(scene, options.count, about=options.about)


def _result(scene: Scene, found: Modes) -> dict[str, Any]:
    return {
        "status": "done",
        "frequencies": [float(f) for f in found.frequencies],
        "warnings": mesh_warnings(scene),
    }


def _tell(options: argparse.Namespace, scene: Scene, found: Modes) -> None:
    if options.json:
        print(as_json(_result(scene, found)))
    elif not options.quiet:
        for k, frequency in enumerate(found.frequencies, 1):
            note = "   rigid or free of energy" if frequency == 0.0 else ""
            print(f"mode {k:3}   {frequency:12.6g} Hz{note}")
        if options.output:
            print(f"results are in {options.output}")


def _film(scene: Scene, found: Modes, options: argparse.Namespace) -> None:
    """One shape in a film that loops: x + a sin(2πt/T) shape."""
    if options.shape > len(found.frequencies):
        raise SceneError(f"--shape is {options.shape}; there are {len(found.frequencies)} modes")
    from tisoft.observers.film import film_to
    from tisoft.observers.framing import Survey
    from tisoft.simulation import Simulation

    scene.frame_rate = 30.0
    sim = Simulation(scene, arch=options.arch, precision="f64", certify=False)
    middle = found.positions
    shape = found.shape(options.shape - 1)
    size = max(part.size for part in sim.parts)
    shape = shape * (AMPLITUDE * size / np.linalg.norm(shape, axis=1).max())
    frames = round(PERIOD * scene.frame_rate)
    swings = [np.sin(2.0 * np.pi * k / frames) for k in range(frames)]
    survey = Survey()
    for swing in (-1.0, 1.0):
        sim.put_state(middle + swing * shape, 0.0 * shape)
        survey.see(sim, scene.render.color)
    with film_to(options.output, scene) as film:
        film.survey = survey
        for swing in swings:
            sim.put_state(middle + swing * shape, 0.0 * shape)
            film.on_frame(sim.here())
