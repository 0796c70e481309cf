"""tisoft check: look before it runs."""

from __future__ import annotations

import argparse
from pathlib import Path

from tisoft.commands import common
from tisoft.whole_files import as_json, sweep

HELP = "look at a scene before it runs: meshes, springs, stable step, cost"
EXAMPLES = """examples:
  tisoft check beam.toml
  tisoft check net.toml --picture net.png           the worst mechanism, or what sets the step"""


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    common.add_scene(parser)
    parser.add_argument(
        "--picture", metavar="FILE", type=common.place,
        help="draw the worst mechanism of the springs, else the stable step of every element",
    )  # fmt: skip


def execute(options: argparse.Namespace) -> int:
    """Check the scene and report."""
    scene = common.scene_of(options, tell=False)
    swept = sum(sweep(folder) for folder in {Path(options.scene).resolve().parent, Path.cwd()})
    sim = common.simulation_of(scene, options)

    from tisoft.check.report import as_text, check

    report = check(sim)
    if options.picture:
        from tisoft.check.picture import draw_check

        draw_check(options.picture, sim, report)
        report.result["picture"] = options.picture
    if options.json:
        print(as_json(report.result))
    elif not options.quiet:
        print(as_text(report.result))
        if swept:
            print(f"removed {swept} hidden files that killed programs had left half written")
        if options.picture:
            print(f"picture is in {options.picture}")
    return 0
