"""tisoft run: simulate a scene."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from tisoft.commands import common
from tisoft.errors import SceneError
from tisoft.whole_files import as_json, make_folder, write_text

HELP = "simulate a scene"
EXAMPLES = """examples:
  tisoft run beam.toml -o out                       summary.json, probes.csv, energy.csv
  tisoft run beam.toml --json --set body.0.young=2e6
  tisoft run beam.toml -o out --save-every 10       frames.pvd for ParaView"""


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    common.add_scene(parser)
    parser.add_argument(
        "-o", "--output", metavar="DIR",
        help="a folder for summary.json, probes.csv and energy.csv; made where it is missing",
    )  # fmt: skip
    parser.add_argument(
        "--save-every", metavar="N", type=int, default=0,
        help="save every N-th frame too, as frames/*.vtu and frames.pvd (needs -o)",
    )  # fmt: skip


def execute(options: argparse.Namespace) -> int:
    """Run the scene and report."""
    if options.save_every < 0:
        raise SceneError(f"--save-every is {options.save_every}; give a number of frames, as 10")
    if options.save_every and not options.output:
        raise SceneError("--save-every needs a folder to save into; add -o DIR")
    scene = common.scene_of(options)
    folder = make_folder(options.output) if options.output else None
    sim = common.simulation_of(scene, options)

    from tisoft.observers.progress import Interruption, Progress
    from tisoft.observers.tables import EnergyTable, ProbeTable, States

    run = common.Run(sim)
    with run.ended(), ExitStack() as files:
        observers: list[Any] = []
        if folder is not None:
            observers += [files.enter_context(table(folder)) for table in (ProbeTable, EnergyTable)]
            if options.save_every:
                observers.append(files.enter_context(States(folder, options.save_every)))
        progress = Progress("simulating", quiet=options.quiet)
        sim.run(observers=[*observers, progress, Interruption()])
    result = run.result()
    if folder is not None:
        write_text(Path(folder) / "summary.json", as_json(result) + "\n")
    return run.report(options, result, *([f"results are in {folder}/"] if folder else []))
