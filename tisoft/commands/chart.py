"""tisoft chart: error against cost of a scene's variants."""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from pathlib import Path
from typing import Any

from tisoft import stops
from tisoft.commands import common
from tisoft.commands.sweep import add_workers, check_workers
from tisoft.errors import SceneError
from tisoft.folders import ResultFolder
from tisoft.whole_files import as_json, write_bytes, write_text

HELP = "chart predicted error against cost of a scene's variants"
EXAMPLES = """examples:
  tisoft chart beam.toml -o out                chart.png, .svg, .html, .csv, .json
  tisoft chart beam.toml -o out --budget 300   goes on from what is there"""

STORE = "variants.json"
FILES = ("chart.png", "chart.svg", "chart.html", "chart.csv", "chart.json", STORE)
DRAWING, CHART = 0.12, 3.0
"""Share of the budget that drawing takes, and seconds without the meshes' pictures."""
LEAST = 0.5
"""Share of the budget that is left to the survey at the least."""


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    common.add_scene(parser)
    common.add_place(parser, "DIR", "a folder for the chart; made where missing", required=True)
    parser.add_argument(
        "--budget", metavar="SECONDS", type=float, default=60.0, help="that it may take (60)"
    )
    add_workers(parser)


def execute(options: argparse.Namespace) -> int:
    """Survey the variants and draw them."""
    begun = time.perf_counter() - time.process_time()  # the program's start counts too
    if not 0.0 < options.budget < math.inf:
        raise SceneError(f"--budget is {options.budget:g}; give seconds above 0")
    check_workers(options)
    settings = common.settings_of(options)
    owner = common.owner_of(options, "chart", resume=not options.overwrite)
    stop: KeyboardInterrupt | None = None
    with ResultFolder(options.output, owner) as folder:
        kept = {} if options.overwrite else _kept(folder.path / STORE)
        bar = _Bar(options)
        survey = _survey(options, settings, kept, bar.tick, begun)
        folder.begin(FILES)
        try:
            with stops.as_stops():
                survey.measure(workers=_workers(options))
        except KeyboardInterrupt as asked:
            stop = asked
            stops.settled()
        finally:
            bar.close()
            write_text(folder.path / STORE, json.dumps(kept) + "\n")
        return _finish(options, survey, folder, stop, begun + options.budget)


def _survey(
    options: argparse.Namespace, settings: list[str], kept: Any, tick: Any, begun: float
) -> Any:
    """The survey, with what drawing leaves it of the time since `begun`."""
    from tisoft.charting.survey import Survey

    whole = options.budget
    left = whole - max(DRAWING * whole, CHART) - (time.perf_counter() - begun)
    return Survey(options.scene, max(left, LEAST * whole), settings, kept, tick)


def _finish(
    options: argparse.Namespace,
    survey: Any,
    folder: ResultFolder,
    stop: KeyboardInterrupt | None,
    ends: float,
) -> int:
    """Draw what there is and tell it; returns the exit code."""
    from tisoft.charting.chart import chart_of

    try:
        chart = chart_of(survey, survey.budget / options.budget)
    except SceneError:
        if stop is not None:
            return _tell_known(options, survey, folder, stop)
        raise
    _write(survey, chart, folder.path, Path(options.scene).name, ends)
    result = chart.result()
    if stop is not None:
        folder.state = "interrupted"
        result["status"] = "interrupted"
    if options.json:
        print(as_json(result))
    elif not options.quiet:
        print("\n".join(chart.sentences()))
        print(f"{len(chart.variants)} variants are charted in {options.output}/chart.html")
        for warning in chart.warnings:
            print(f"tisoft: warning: {warning}", file=sys.stderr)
    if stop is not None:
        print("tisoft: error: interrupted; what was done is charted", file=sys.stderr)
        return int(getattr(stop, "exit_code", 130))
    return 0


def _tell_known(
    options: argparse.Namespace, survey: Any, folder: ResultFolder, stop: KeyboardInterrupt
) -> int:
    """Interrupted before two variants could be compared: keep and tell what is known of each."""
    from tisoft.charting.known import rows_of, sentence
    from tisoft.sweeping.table import write_csv

    rows = rows_of(survey)
    if not rows:
        raise stop
    told = [found] if (found := sentence(survey)) else []
    result = {"status": "interrupted", "sentences": told, "known": rows}
    result["warnings"] = survey.warnings
    write_text(folder.path / "chart.json", as_json(result) + "\n")
    write_csv(folder.path / "chart.csv", rows)
    folder.state = "interrupted"
    if options.json:
        print(as_json(result))
    elif not options.quiet:
        print("\n".join(told))
    print(
        f"tisoft: error: interrupted before two variants could be compared; what is known of "
        f"{len(rows)} is in {options.output}/chart.csv, and the same command goes on from there",
        file=sys.stderr,
    )
    return int(getattr(stop, "exit_code", 130))


def _workers(options: argparse.Namespace) -> dict[str, Any] | None:
    if options.workers is None and options.scheduler is None:
        return None
    return {"workers": options.workers, "scheduler": options.scheduler}


def _kept(path: Path) -> dict[str, dict[str, Any]]:
    """What an earlier call computed; nothing where that cannot be read."""
    try:
        found = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


class _Bar:
    """Names the variant at work, and how much of the budget is gone, on a terminal."""

    def __init__(self, options: argparse.Namespace) -> None:
        from tqdm import tqdm

        disable = True if options.quiet else None  # None: only on a terminal
        self._clock, self._begun = time.perf_counter, time.perf_counter()
        self._bar = tqdm(
            total=round(options.budget), unit="s", file=sys.stderr, disable=disable, leave=False,
            bar_format="{desc}: {percentage:3.0f}%|{bar}| {n:.0f} of {total} s",
        )  # fmt: skip

    def tick(self, name: str) -> None:
        """A variant begins."""
        self._bar.set_description_str(name, refresh=False)
        self._bar.n = min(self._bar.total, self._clock() - self._begun)
        self._bar.refresh()

    def close(self) -> None:
        """Clear the line."""
        self._bar.close()


def _write(survey: Any, chart: Any, folder: Path, title: str, ends: float) -> None:
    """All files; pictures of meshes until the time `ends`."""
    from tisoft.charting.page import page
    from tisoft.charting.picture import files, step_picture
    from tisoft.charting.thumbnails import pictures_of
    from tisoft.sweeping.table import write_csv

    png, svg = files(chart)
    write_bytes(folder / "chart.png", png)
    write_text(folder / "chart.svg", svg)
    steps = step_picture(chart)
    shapes = pictures_of(survey, ends - time.perf_counter())
    write_text(folder / "chart.html", page(chart, svg, title, shapes, steps))
    write_csv(folder / "chart.csv", chart.table())
    write_text(folder / "chart.json", as_json(chart.result()) + "\n")
