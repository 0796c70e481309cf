"""tisoft advise: the least variant of a scene that is good enough."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from pathlib import Path
from typing import Any

from tisoft import stops
from tisoft.commands import common
from tisoft.errors import SceneError
from tisoft.folders import check_free
from tisoft.whole_files import as_json, write_text

HELP = "the least model, element and mesh that meet a tolerance, and why"
EXAMPLES = """examples:
  tisoft advise beam.toml
  tisoft advise beam.toml --tolerance 0.01 --json
  tisoft advise beam.toml -o good.toml          the scene so changed"""


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    common.add_scene(parser)
    parser.add_argument(
        "--tolerance", metavar="T", type=float, default=0.02, help="relative error allowed (0.02)"
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE.toml", type=common.place, help="write the scene so changed"
    )


def execute(options: argparse.Namespace) -> int:
    """Judge the variants and tell the choice."""
    from tisoft.charting.advice import advice_of, measure, survey_for

    settings = common.settings_of(options)
    if options.output:
        check_free(Path(options.output))
        if os.path.realpath(options.output) == os.path.realpath(options.scene):
            raise SceneError(f"-o {options.output} is the scene itself; name another file")
    survey = survey_for(options.scene, options.tolerance, settings=settings)
    try:
        with stops.as_stops():
            measure(survey, options.tolerance)
    except KeyboardInterrupt as stop:
        stops.settled()
        return _interrupted(options, survey, stop)
    found = advice_of(survey, options.tolerance)
    if options.output:
        _write(options, (*settings, *found.choice.settings))
    if options.json:
        print(as_json(found.result()))
    elif not options.quiet:
        _tell(options, found)
        if options.output:
            print(f"the scene so changed is {options.output}")
    return 0


def _write(options: argparse.Namespace, settings: tuple[str, ...]) -> None:
    from tisoft.charting.written import as_toml, moved_document

    target = Path(options.output)
    write_text(target, as_toml(moved_document(options.scene, settings, target)))


def _interrupted(options: argparse.Namespace, survey: Any, stop: KeyboardInterrupt) -> int:
    """Tell what is known so far; no scene is written."""
    from tisoft.charting.advice import advice_of
    from tisoft.charting.known import rows_of, sentence

    if survey.judged():
        found = advice_of(survey, options.tolerance, whole=False)
        if options.json:
            print(as_json(found.result() | {"status": "interrupted"}))
        elif not options.quiet:
            _tell(options, found)
    elif options.json:
        known = {"status": "interrupted", "known": rows_of(survey), "warnings": survey.warnings}
        print(as_json(known))
    elif not options.quiet and (told := sentence(survey)):
        print(told)
    missing = f"; {options.output} is not written" if options.output else ""
    print(f"tisoft: error: interrupted{missing}", file=sys.stderr)
    return int(getattr(stop, "exit_code", 130))


def _tell(options: argparse.Namespace, found: Any) -> None:
    for reason in found.reasons:
        print(reason)
    if found.choice.settings:
        line = " ".join(f"--set {shlex.quote(setting)}" for setting in found.choice.settings)
        print(f"tisoft run {shlex.quote(options.scene)} {line}")
    elif found.choice.worst.most <= found.tolerance:
        print("The scene is right as it is.")
    elif found.choice.errors:
        print("Nothing better than the scene as it is was found.")
    if not found.certain:
        print("This is not certain:", file=sys.stderr)
    for warning in found.warnings:
        print(f"tisoft: warning: {warning}", file=sys.stderr)
