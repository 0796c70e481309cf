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
from tisoft.folders import ResultFolder
from tisoft.manifest import CHECKPOINT
from tisoft.scene import Scene
from tisoft.whole_files import Unwritable, as_json, write_text

if TYPE_CHECKING:
    from tisoft.observers.checkpoints import Checkpoints
    from tisoft.simulation import Simulation

HELP = "simulate a scene"
EXAMPLES = """examples:
  tisoft run beam.toml -o out                       summary.json, probes.csv, energy.csv
  tisoft run beam.toml --json --set body.0.young=2e6
  tisoft run beam.toml -o out --save-every 10       frames.pvd for ParaView
  tisoft run beam.toml -o out --resume              go on after Ctrl-C, or for longer"""


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    common.add_scene(parser)
    common.add_place(
        parser,
        "DIR",
        "a folder for summary.json, probes.csv and energy.csv; made where it is missing",
    )
    parser.add_argument(
        "--save-every", metavar="N", type=int, default=0,
        help="save every N-th frame too, as frames/*.vtu and frames.pvd (needs -o)",
    )  # fmt: skip
    parser.add_argument(
        "--resume", action="store_true",
        help="go on from the last checkpoint in DIR: after Ctrl-C, after a crash, or for longer",
    )  # fmt: skip


def execute(options: argparse.Namespace) -> int:
    """Run the scene and report."""
    if options.save_every < 0:
        raise SceneError(f"--save-every is {options.save_every}; give a number of frames, as 10")
    if options.save_every and not options.output:
        raise SceneError("--save-every needs a folder to save into; add -o DIR")
    if options.resume and not options.output:
        raise SceneError("--resume needs the folder of the run to go on with; add -o DIR")
    if options.resume and options.overwrite:
        raise SceneError("--resume goes on and --overwrite begins anew; give one of them")
    scene = common.scene_of(options)
    if not options.output:
        return _run(options, scene, None)
    runtime.import_taichi()

    from tisoft.observers.checkpoints import find

    if options.resume:
        find(Path(options.output))
    owner = common.owner_of(options, "run", resume=options.resume)
    with ResultFolder(options.output, owner) as folder:
        return _run(options, scene, folder)


def _run(options: argparse.Namespace, scene: Scene, folder: ResultFolder | None) -> int:
    """Run the scene into a folder that nobody else writes into now."""
    # The account is kept where energy.csv is written; it costs time.
    sim = common.simulation_of(scene, options, ledger=folder is not None)
    run = common.Run(sim)

    from tisoft.observers.progress import Progress

    progress = Progress("simulating", quiet=options.quiet)
    with ExitStack() as files:
        kept = _keep(run, folder, options, files) if folder is not None else None
        seconds = _remaining(scene, run.sim.frame)
        with run.ended():
            run.step(seconds, observers=[*kept.tables, kept, progress] if kept else [progress])
        if kept is not None:
            _save_end(run, kept)
    advised = getattr(options, "advised", None)
    result = run.result(**({"advised": advised} if advised else {}))
    if folder is not None:
        _tell_end(run, folder, result)
    return run.report(options, result, *([f"results are in {folder.path}/"] if folder else []))


def _keep(
    run: common.Run, folder: ResultFolder, options: argparse.Namespace, files: ExitStack
) -> Checkpoints:
    """What writes into the folder; with --resume the run is set to the checkpoint there."""
    from tisoft.observers.checkpoints import Checkpoints, find, go_on
    from tisoft.observers.tables import EnergyTable, ProbeTable, States

    every, frame = options.save_every, 0
    if options.resume:
        notes = go_on(run.sim, find(folder.path))
        run.seconds_before = notes["seconds"]
        if every not in (0, notes["save_every"]):
            problem = f"the run so far had --save-every {notes['save_every']}, not {every}"
            raise SceneError(f"{problem}; leave it out, or run the scene anew")
        every, frame = notes["save_every"], run.sim.frame
        _remaining(run.sim.scene, frame)
    else:
        run.sim.substeps_of(1.0 / run.sim.scene.frame_rate)  # refuses a wrong step
    _take(folder, run.sim, every, frame)
    kinds = (ProbeTable, EnergyTable)
    tables: list[Any] = [kind(folder.path, goes_on=options.resume) for kind in kinds]
    if every:
        tables.append(States(folder, every, goes_on=options.resume))
    for table in tables:
        files.enter_context(table)
    return Checkpoints(
        folder,
        run.sim,
        tables,
        notes=lambda: {"seconds": run.elapsed(), "save_every": every},
    )


def _take(folder: ResultFolder, sim: Simulation, every: int, frame: int) -> None:
    """Take over the folder; states before `frame` lie there already."""
    from tisoft.observers.tables import STATE, STATE_LIST

    frames = round(sim.scene.duration * sim.scene.frame_rate)
    names = ["summary.json", "probes.csv", "energy.csv", CHECKPOINT]
    if every:
        folder.foresee(names, {STATE: (every, frames)})
        names.append(STATE_LIST)
    saved = {STATE: (every, (frame - 1) // every * every)} if every and frame else {}
    folder.begin(names, saved)


def _save_end(run: common.Run, kept: Checkpoints) -> None:
    """Keep the state that the run ended in, to go on from."""
    try:
        if run.is_whole and run.status in ("done", "interrupted"):
            kept.save(run.sim)
    except Unwritable as error:
        if run.code == 0:  # else what happened first is told
            run.code, run.status, run.error = error.exit_code, "failed", str(error)
    if run.status != "done" and kept.exist:
        run.error = f"{run.error}; go on with --resume"


def _tell_end(run: common.Run, folder: ResultFolder, result: dict[str, Any]) -> None:
    """Write the summary and how the run ended."""
    folder.state = {"done": "done", "diverged": "failed"}.get(run.status, "interrupted")
    try:
        write_text(folder.path / "summary.json", as_json(result) + "\n")
    except Unwritable:
        if run.code == 0:  # else what happened first is told
            raise


def _remaining(scene: Scene, frame: int) -> float:
    """Seconds to simulate from a frame on."""
    frames = round(scene.duration * scene.frame_rate)
    if frame > frames:
        problem = f"ends before frame {frame}, where the checkpoint is; give a longer one"
        raise FieldError("duration", problem, scene.duration)
    return (frames - frame) / scene.frame_rate
