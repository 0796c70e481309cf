"""tisoft run: simulate a scene."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tisoft import runtime
from tisoft.checks import FieldError
from tisoft.commands import common
from tisoft.errors import SceneError
from tisoft.scene import Scene
from tisoft.whole_files import as_json, make_folder, write_text

if TYPE_CHECKING:
    from tisoft.observers.checkpoints import Checkpoints

HELP = "simulate a scene"
EXAMPLES = """examples:
  tisoft run beam.toml -o out                       summary.json, probes.csv, energy.csv
  tisoft run beam.toml --json --set body.0.young=2e6
  tisoft run beam.toml -o out --save-every 10       frames.pvd for ParaView
  tisoft run beam.toml -o out --resume              go on after Ctrl-C, or for longer"""


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
    parser.add_argument(
        "--resume", action="store_true",
        help="go on from the last checkpoint in DIR (of the scene's checkpoint_every, or Ctrl-C)",
    )  # fmt: skip


def execute(options: argparse.Namespace) -> int:
    """Run the scene and report."""
    if options.save_every < 0:
        raise SceneError(f"--save-every is {options.save_every}; give a number of frames, as 10")
    if options.save_every and not options.output:
        raise SceneError("--save-every needs a folder to save into; add -o DIR")
    if options.resume and not options.output:
        raise SceneError("--resume needs the folder of the run to go on with; add -o DIR")
    scene = common.scene_of(options)
    if not options.output:
        return _run(options, scene, None)
    runtime.import_taichi()

    from tisoft.observers.checkpoints import claimed, find

    if options.resume:
        find(Path(options.output))
    with claimed(folder := make_folder(options.output)):
        return _run(options, scene, folder)


def _run(options: argparse.Namespace, scene: Scene, folder: Path | None) -> int:
    """Run the scene into a folder that nobody else writes into now."""
    # The account is kept where energy.csv is written; it costs time.
    sim = common.simulation_of(scene, options, ledger=folder is not None)
    run = common.Run(sim)

    from tisoft.observers.progress import Interruption, Progress

    progress, interruption = Progress("simulating", quiet=options.quiet), Interruption()
    with ExitStack() as files:
        kept = _keep(run, folder, options, files) if folder is not None else None
        seconds = _remaining(scene, run.sim.frame)
        with run.ended():
            watching: list[Any] = [*kept.tables, kept] if kept else []
            run.sim.run(seconds, observers=[*watching, progress, interruption])
        if kept is not None and interruption.is_between_frames:
            run.error = f"{run.error}; go on with --resume"
            kept.save(run.sim)
        elif kept is not None and kept.every and run.code == 0:
            kept.save(run.sim)
    result = run.result()
    if folder is not None:
        write_text(folder / "summary.json", as_json(result) + "\n")
    return run.report(options, result, *([f"results are in {folder}/"] if folder else []))


def _keep(
    run: common.Run, folder: Path, options: argparse.Namespace, files: ExitStack
) -> Checkpoints:
    """What writes into the folder; with --resume the run is set to the checkpoint there."""
    from tisoft.observers.checkpoints import Checkpoints, find, go_on
    from tisoft.observers.tables import EnergyTable, ProbeTable, States

    every = options.save_every
    if options.resume:
        notes = go_on(run.sim, find(folder))
        run.seconds_before = notes["seconds"]
        if every not in (0, notes["save_every"]):
            problem = f"the run so far had --save-every {notes['save_every']}, not {every}"
            raise SceneError(f"{problem}; leave it out, or run the scene anew")
        every = notes["save_every"]
    tables: list[Any] = [kind(folder, goes_on=options.resume) for kind in (ProbeTable, EnergyTable)]
    if every:
        tables.append(States(folder, every, goes_on=options.resume))
    for table in tables:
        files.enter_context(table)
    kept = Checkpoints(
        folder,
        run.sim,
        tables,
        notes=lambda: {"seconds": run.elapsed(), "save_every": every},
    )
    if not options.resume:
        kept.path.unlink(missing_ok=True)  # it belongs to the run that is overwritten now
    return kept


def _remaining(scene: Scene, frame: int) -> float:
    """Seconds to simulate from a frame on."""
    frames = round(scene.duration * scene.frame_rate)
    if frame > frames:
        problem = f"ends before frame {frame}, where the checkpoint is; give a longer one"
        raise FieldError("duration", problem, scene.duration)
    return (frames - frame) / scene.frame_rate
