"""tisoft bench: how fast this machine is."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Any

from tisoft import runtime
from tisoft.bench import MODELS, SIZES, as_text, compile_seconds, measure
from tisoft.commands import common
from tisoft.errors import SceneError
from tisoft.whole_files import as_json

HELP = "how fast this machine is"
EXAMPLES = """examples:
  tisoft bench
  tisoft bench --render
  tisoft bench --view
  tisoft bench --accuracy
  tisoft bench --contact
  tisoft bench --advise
  tisoft bench --sizes S XL --models viscoelastic --seconds 2 --json"""


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    parser.add_argument(
        "--sizes", nargs="+", choices=list(SIZES), default=list(SIZES),
        help="XS: 240 tets, S: 1,920, M: 15,360, L: 51,840, XL: 240,000 (all)",
    )  # fmt: skip
    parser.add_argument(
        "--models", nargs="+", choices=list(MODELS), default=list(MODELS), help="(all)"
    )
    parser.add_argument(
        "--seconds", type=float, default=1.0, help="of stepping per measurement (1)"
    )
    parser.add_argument(
        "--render", action="store_true", help="pictures instead: ms a frame, stage by stage"
    )
    parser.add_argument(
        "--view", action="store_true", help="what an open page costs the simulation instead"
    )
    parser.add_argument(
        "--accuracy", action="store_true",
        help="errors against cost instead: beams of each element, and what 2 %% of error costs",
    )  # fmt: skip
    parser.add_argument(
        "--contact", action="store_true",
        help="contact instead: microseconds a contact, from 5 to 80 bodies, a plane's share, and a "
        "pile in a bowl",
    )  # fmt: skip
    parser.add_argument(
        "--advise", action="store_true",
        help="charts and advice instead: predicted against true errors and costs of seven scenes",
    )  # fmt: skip
    parser.add_argument("--no-compile", action="store_true", help="do not time compiling")
    common.add_machine(parser)
    common.add_output(parser)


def execute(options: argparse.Namespace) -> int:
    """Measure and report."""
    if not 0.0 < options.seconds < 1e4:
        raise SceneError(f"--seconds is {options.seconds:g}; give a time above 0, as 1")
    if options.render:
        return _render(options)
    if options.accuracy:
        return _accuracy(options)
    if options.advise:
        return _advise(options)
    if options.view:
        return _view(options)
    if options.contact:
        return _contact(options)
    precision = options.precision or "f32"
    rows = []
    for model in options.models:
        machine = {"arch": options.arch, "precision": precision}
        compiled = {} if options.no_compile else compile_seconds(model, **machine)
        for size in options.sizes:
            if not options.quiet and sys.stderr.isatty():
                print(f"{model}, size {size} …", file=sys.stderr)
            row = measure(size, model, seconds=options.seconds, **machine)
            rows.append(row | {"compile_seconds": compiled})
    return _tell(options, rows, as_text, cores=runtime.threads())


def _view(options: argparse.Namespace) -> int:
    """Time frames with a page open and without one, and report."""
    from tisoft import bench_view

    rows = [
        bench_view.measure(size, seconds=options.seconds, arch=options.arch)
        for size in bench_view.SIZES
    ]
    return _tell(options, rows, bench_view.as_text, cores=runtime.threads())


def _contact(options: argparse.Namespace) -> int:
    """Time blocks that stand on each other, one on a plane, and a pile in a bowl, and report."""
    from tisoft import bench_contact
    from tisoft.commands.demo import demos
    from tisoft.obstacles import Shell
    from tisoft.scene_file import load_scene

    rows = []
    for count in bench_contact.BODIES:
        if not options.quiet and sys.stderr.isatty():
            print(f"{count} bodies …", file=sys.stderr)
        rows.append(bench_contact.measure(count, seconds=options.seconds))
    rows.append(bench_contact.measure_plane(seconds=options.seconds))
    bowl = load_scene(demos()["bowl"]).obstacles[0]
    assert isinstance(bowl, Shell)
    rows.append(bench_contact.measure_pour(bowl))
    return _tell(options, rows, bench_contact.as_text)


def _advise(options: argparse.Namespace) -> int:
    """Hold charts and advice against what is true, and report."""
    from tisoft import bench_advise

    rows = []
    for name in bench_advise.CASES:
        if not options.quiet and sys.stderr.isatty():
            print(f"{name} …", file=sys.stderr)
        rows.append(bench_advise.measure(name))
    return _tell(options, rows, bench_advise.as_text, summary=bench_advise.summary(rows))


def _accuracy(options: argparse.Namespace) -> int:
    """Solve and time beams of each element and report."""
    from tisoft import bench_accuracy

    rows = []
    for element, meshes in bench_accuracy.CELLS.items():
        for cells in meshes:
            if not options.quiet and sys.stderr.isatty():
                print(f"{element}, {'x'.join(str(n) for n in cells)} cells …", file=sys.stderr)
            rows.append(bench_accuracy.measure(element, cells, arch=options.arch))
    found = bench_accuracy.summary(rows)
    return _tell(options, rows, bench_accuracy.as_text, cost_of_2_percent=found)


def _render(options: argparse.Namespace) -> int:
    """Time pictures and report."""
    from tisoft import bench_render

    rows = [
        bench_render.measure(size, count, arch=options.arch)
        for size in bench_render.SIZES
        for count in bench_render.CELLS
    ]
    return _tell(options, rows, bench_render.as_text, cores=runtime.threads())


def _tell(
    options: argparse.Namespace, rows: list[Any], as_text: Callable[[Any], str], **more: Any
) -> int:
    """Report, for programs or for people; returns the exit code."""
    if options.json:
        print(as_json({"status": "done", **more, "results": rows}))
    elif not options.quiet:
        print(as_text(rows))
    return 0
