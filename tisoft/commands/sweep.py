"""tisoft sweep: a scene with every combination of some keys."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from tisoft.commands import common
from tisoft.errors import Diverged, SceneError
from tisoft.folders import ResultFolder
from tisoft.whole_files import as_json

HELP = "run a scene with every combination of some of its keys, a row each"
EXAMPLES = """examples:
  tisoft sweep beam.toml --over young=1e4,1e5,1e6 -o out
  tisoft sweep beam.toml --over "body.0.mesh.box.cells=[10,2,2],[20,4,4]" --over poisson=0.3,0.45 -o out
  tisoft sweep beam.toml --over young=1e4..1e6 --random 100 -o out --workers 2
the same command once more goes on where it was stopped"""  # noqa: E501


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    common.add_scene(parser)
    common.add_place(parser, "DIR", "a folder for sweep.csv; made where missing", required=True)
    parser.add_argument(
        "--over", metavar="KEY=V1,V2", action="append", default=[], required=True,
        help="a key and its values, a range as 1e4..1e6 (with --random), or a TOML file of lists",
    )  # fmt: skip
    parser.add_argument("--random", metavar="N", type=int, help="N draws, not all combinations")
    parser.add_argument("--seed", metavar="S", type=int, default=0, help="of the draws (0)")
    add_workers(parser)


def add_workers(parser: argparse.ArgumentParser) -> None:
    """--workers and --scheduler."""
    parser.add_argument(
        "--workers", metavar="N", type=int,
        help="processes of this machine (needs tisoft[cluster])",
    )  # fmt: skip
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="of a Dask cluster, as tcp://10.0.0.1:8786"
    )


def check_workers(options: argparse.Namespace) -> None:
    """Refuse wrong numbers of workers; raises SceneError."""
    if options.workers is not None and options.workers < 1:
        raise SceneError(f"--workers is {options.workers}; give a number of processes, as 2")
    if options.workers is not None and options.scheduler is not None:
        raise SceneError("--workers and --scheduler exclude each other; give one of them")


def execute(options: argparse.Namespace) -> int:
    """Run the rows and report."""
    check_workers(options)
    from tisoft.sweeping.cluster import threads_for
    from tisoft.sweeping.plan import axes_of_file, axis_of, plan_of
    from tisoft.sweeping.sweep import jobs_of, run_jobs
    from tisoft.sweeping.table import CSV, JOURNAL, PARQUET

    axes = []
    for text in options.over:
        is_file = text.endswith(".toml") and "=" not in text
        axes += axes_of_file(text) if is_file else [axis_of(text)]
    plan = plan_of(axes, random=options.random, seed=options.seed)
    jobs = jobs_of(
        options.scene, plan, settings=options.settings, arch=options.arch,
        precision=options.precision, threads=threads_for(options.workers),
    )  # fmt: skip
    bar = _bar(len(jobs), quiet=options.quiet)
    files = [CSV, PARQUET, JOURNAL]
    owner = common.owner_of(options, "sweep", resume=not options.overwrite)
    try:
        with ResultFolder(options.output, owner) as folder:
            folder.begin(files)
            rows = run_jobs(
                plan, jobs, folder.path, workers=options.workers, scheduler=options.scheduler,
                tick=bar.update,
            )  # fmt: skip
    finally:
        bar.close()
    return _report(options, rows)


def _report(options: argparse.Namespace, rows: list[dict[str, Any]]) -> int:
    failed = [row for row in rows if row["status"] != "done"]
    none = len(failed) == len(rows)
    if options.json:
        print(as_json({"status": "failed" if none else "done", "rows": rows}))
    elif not options.quiet:
        print(f"{len(rows)} rows are in {options.output}/sweep.csv")
    told = f"row {failed[0]['row']}: {failed[0]['error']}" if failed else ""
    if none:
        diverged = any(row["status"] == "diverged" for row in rows)
        raise (Diverged if diverged else SceneError)(f"none of {len(rows)} rows is done; {told}")
    if failed and not options.json and not options.quiet:
        print(f"tisoft: warning: {len(failed)} of them failed; {told}", file=sys.stderr)
    return 0


def _bar(total: int, *, quiet: bool) -> Any:
    from tqdm import tqdm

    # None: only on a terminal
    disable = True if quiet else None
    return tqdm(total=total, unit="row", file=sys.stderr, disable=disable, leave=False)
