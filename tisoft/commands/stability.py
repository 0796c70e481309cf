"""tisoft stability: where the scene's methods fail."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from tisoft import runtime
from tisoft.commands import common
from tisoft.folders import ResultFolder
from tisoft.whole_files import as_json

HELP = "show where a scene's methods fail, measured against theory"
EXAMPLES = """examples:
  tisoft stability beam.toml -o map                 pictures, tables and map/stability.md
  tisoft stability beam.toml -o map --only step-damping,poisson"""


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    common.add_scene(parser)
    common.add_place(
        parser,
        "DIR",
        "a folder for pictures, tables and the page of text; made where it is missing",
        required=True,
    )
    parser.add_argument(
        "--only", metavar="AXES",
        help="some of step-damping,compression,rotation,poisson,diagonals",
    )  # fmt: skip


def execute(options: argparse.Namespace) -> int:
    """Measure the map and report."""
    scene = common.scene_of(options)
    runtime.import_taichi()
    runtime.start("cpu")

    from tisoft.study.stability import Study, chosen, files_of, write_study

    names = chosen(options.only)
    study = Study(scene, names)
    bar = _bar(study.work(), quiet=options.quiet)
    try:
        with ResultFolder(options.output, common.owner_of(options, "stability")) as folder:
            folder.foresee(files_of(names))
            folder.begin(files_of(names))
            result = write_study(
                study,
                folder.path,
                title=Path(options.scene).name,
                tick=bar.update,
                on_axis=bar.set_description,
            )
    finally:
        bar.close()
    if options.json:
        print(as_json(result))
    elif not options.quiet:
        for axis in result["axes"].values():
            print(axis["sentence"])
        print(f"the map is in {Path(options.output) / 'stability.md'}")
    return 0


def _bar(total: int, *, quiet: bool) -> Any:
    from tqdm import tqdm

    return tqdm(
        total=total,
        unit="run",
        file=sys.stderr,
        disable=True if quiet else None,  # None: only on a terminal
        leave=False,
    )
