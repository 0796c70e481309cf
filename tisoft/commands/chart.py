"""tisoft chart: error against cost of a scene's variants."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from tisoft.commands import common
from tisoft.errors import SceneError
from tisoft.folders import ResultFolder
from tisoft.whole_files import as_json, write_bytes, write_text

HELP = "chart predicted error against cost of a scene's variants"
EXAMPLES = """examples:
  tisoft chart beam.toml -o out                chart.png, .svg, .html, .csv, .json
  tisoft chart beam.toml -o out --budget 300   goes on from what is there"""

STORE = "variants.json"
FILES = ("chart.png", "chart.svg", "chart.html", "chart.csv", "chart.json", STORE)


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    common.add_scene(parser)
    common.add_place(parser, "DIR", "a folder for the chart; made where missing", required=True)
    parser.add_argument(
        "--budget", metavar="SECONDS", type=float, default=60.0, help="that it may take (60)"
    )


def execute(options: argparse.Namespace) -> int:
    """Survey the variants and draw them."""
    from tisoft.charting.chart import Chart
    from tisoft.charting.survey import Survey

    if not options.budget > 0.0:
        raise SceneError(f"--budget is {options.budget:g}; give seconds above 0")
    settings = list(options.settings)
    if options.precision:
        settings.append(f'precision="{options.precision}"')
    owner = common.owner_of(options, "chart", resume=not options.overwrite)
    with ResultFolder(options.output, owner) as folder:
        kept = _kept(folder.path / STORE)
        folder.begin(FILES)
        survey = Survey(options.scene, options.budget, settings, kept, _ticker(options))
        try:
            chart = Chart(survey.measure(), survey.warnings)
        finally:
            _tell_nothing(options)
            write_text(folder.path / STORE, as_json(kept) + "\n")
        _write(chart, folder.path, Path(options.scene).name)
    result = chart.result()
    if options.json:
        print(as_json(result))
    elif not options.quiet:
        print("\n".join(chart.sentences()))
        print(f"{len(chart.variants)} variants are charted in {options.output}/chart.html")
        for warning in chart.warnings:
            print(f"tisoft: warning: {warning}", file=sys.stderr)
    return 0


def _kept(path: Path) -> dict[str, dict[str, Any]]:
    """What an earlier call computed; nothing where that cannot be read."""
    try:
        found = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _ticker(options: argparse.Namespace) -> Any:
    """Names the variant at work on a terminal."""
    show = not options.quiet and sys.stderr.isatty()

    def tick(name: str) -> None:
        if show:
            print(f"\r\033[K{name} …", end="", file=sys.stderr, flush=True)

    return tick


def _tell_nothing(options: argparse.Namespace) -> None:
    if not options.quiet and sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr, flush=True)


def _write(chart: Any, folder: Path, title: str) -> None:
    from tisoft.charting.page import page
    from tisoft.charting.picture import files
    from tisoft.sweeping.table import write_csv

    png, svg = files(chart)
    write_bytes(folder / "chart.png", png)
    write_text(folder / "chart.svg", svg)
    write_text(folder / "chart.html", page(chart, svg, title))
    write_csv(folder / "chart.csv", chart.table())
    write_text(folder / "chart.json", as_json(chart.result()) + "\n")
