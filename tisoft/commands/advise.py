"""tisoft advise: the least variant of a scene that is good enough."""

from __future__ import annotations

import argparse
import shlex
import sys
from typing import Any

from tisoft.commands import common
from tisoft.whole_files import as_json

HELP = "the least model, element and mesh that meet a tolerance, and why"
EXAMPLES = """examples:
  tisoft advise beam.toml
  tisoft advise beam.toml --tolerance 0.01 --json"""


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    common.add_scene(parser)
    parser.add_argument(
        "--tolerance", metavar="T", type=float, default=0.02, help="relative error allowed (0.02)"
    )


def execute(options: argparse.Namespace) -> int:
    """Judge the variants and tell the choice."""
    from tisoft.charting.advice import advise

    settings = list(options.settings)
    if options.precision:
        settings.append(f'precision="{options.precision}"')
    found = advise(options.scene, options.tolerance, settings=settings)
    if options.json:
        print(as_json(found.result()))
    elif not options.quiet:
        _tell(options, found)
    return 0


def _tell(options: argparse.Namespace, found: Any) -> None:
    for reason in found.reasons:
        print(reason)
    if found.choice.settings:
        line = " ".join(f"--set {shlex.quote(setting)}" for setting in found.choice.settings)
        print(f"tisoft run {shlex.quote(options.scene)} {line}")
    else:
        print("the scene is right as it is")
    for warning in found.warnings:
        print(f"tisoft: warning: {warning}", file=sys.stderr)
