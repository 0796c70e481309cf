"""Options that commands share, and how a scene is loaded, run and reported from them."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import gc
import json
import os
import re
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tisoft import runtime, stops
from tisoft.checks import inside
from tisoft.errors import Diverged, SceneError
from tisoft.folders import Owner
from tisoft.runtime import ARCHS
from tisoft.scene import Render, Scene
from tisoft.scene_file import load_scene
from tisoft.whole_files import Unwritable, as_json

if TYPE_CHECKING:
    from tisoft.simulation import Simulation

COLORS = ("stress", "strain", "speed", "body", "region")


def place(text: str) -> str:
    """The name of a file or folder on the command line; ~ is the user's home."""
    if not text.strip():
        raise argparse.ArgumentTypeError("is empty; give the name of a file or folder")
    if "\0" in text:
        raise argparse.ArgumentTypeError("holds a null character, which no name may")
    return os.path.expanduser(text)


def add_place(
    parser: argparse.ArgumentParser, metavar: str, text: str, *, required: bool = False
) -> None:
    """-o, and --overwrite for folders."""
    parser.add_argument("-o", "--output", metavar=metavar, required=required, type=place, help=text)
    parser.add_argument(
        "--overwrite", action="store_true", help="replace another or unfinished result in a folder"
    )


def owner_of(
    options: argparse.Namespace, command: str, *, resume: bool = False, pictures: int = 0
) -> Owner:
    """Whose result a folder is to hold."""
    return Owner(command, os.path.realpath(options.scene), options.overwrite, resume, pictures)


def add_output(parser: argparse.ArgumentParser) -> None:
    """--json and --quiet."""
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")
    parser.add_argument("--quiet", action="store_true", help="no progress, no text")


def add_machine(parser: argparse.ArgumentParser) -> None:
    """--arch and --precision."""
    parser.add_argument("--arch", choices=ARCHS, default="cpu", help="where to compute (cpu)")
    parser.add_argument("--precision", choices=("f32", "f64"), help="instead of the scene's")


def add_settings(parser: argparse.ArgumentParser) -> None:
    """--set."""
    parser.add_argument(
        "--set", dest="settings", metavar="KEY=VALUE", action="append", default=[],
        help="replace a key of the scene, as body.0.young=2e5; may be repeated",
    )  # fmt: skip


def add_scene(parser: argparse.ArgumentParser) -> None:
    """SCENE, and all options that every command with a scene has."""
    parser.add_argument("scene", metavar="SCENE", type=place, help="a scene file (.toml)")
    add_settings(parser)
    add_machine(parser)
    add_output(parser)


def add_picture(parser: argparse.ArgumentParser) -> None:
    """--size, --color, --wireframe and --alpha."""
    parser.add_argument("--size", metavar="WxH", help="of the picture in pixels, as 1280x720")
    parser.add_argument("--color", choices=COLORS, help="what the surfaces' colours show")
    parser.add_argument("--wireframe", action="store_true", help="draw the edges of the surfaces")
    parser.add_argument("--alpha", action="store_true", help="leave the background transparent")


def scene_of(options: argparse.Namespace, *, tell: bool = True) -> Scene:
    """The scene that the command line asks for; what is odd of its meshes is told at once."""
    scene = load_scene(options.scene, _settled(options))
    if tell and not options.quiet:
        from tisoft.check.warnings import first_warnings  # late: it is slow to import

        for warning in first_warnings(scene):
            print(f"tisoft: warning: {warning}", file=sys.stderr)
    if options.precision:
        scene.precision = options.precision
    scene.render = render_of(options, scene.render)
    return scene


def _settled(options: argparse.Namespace) -> list[str]:
    """The settings, with what stands for model = "auto", which is told and kept in the options."""
    from tisoft.charting.auto import settled

    known = None
    if getattr(options, "resume", False) and options.output:
        with contextlib.suppress(OSError, ValueError, AttributeError):
            summary = json.loads((Path(options.output) / "summary.json").read_text("utf-8"))
            known = summary.get("advised")
    found = settled(options.scene, settings_of(options), known)
    options.advised = found.advice.result() if found.advice is not None else known
    if not options.quiet:
        for sentence in found.sentences():
            print(f"tisoft: {sentence}", file=sys.stderr)
    return found.settings


def settings_of(options: argparse.Namespace) -> list[str]:
    """--set and --precision as settings."""
    chosen = [f'precision="{options.precision}"'] if options.precision else []
    return [*options.settings, *chosen]


def render_of(options: argparse.Namespace, render: Render) -> Render:
    """The scene's picture settings with those of the command line instead."""
    changes: dict[str, Any] = {}
    if getattr(options, "size", None):
        size = re.fullmatch(r"(\d{1,5})[xX×](\d{1,5})", options.size)
        if not size:
            raise SceneError(f'--size is "{options.size}"; write WIDTHxHEIGHT, as 1280x720')
        changes["size"] = (int(size[1]), int(size[2]))
    if getattr(options, "color", None):
        changes["color"] = options.color
    for key in ("wireframe", "alpha"):
        if getattr(options, key, False):
            changes[key] = True
    with inside("render"):
        return dataclasses.replace(render, **changes)


def simulation_of(scene: Scene, options: argparse.Namespace, *, ledger: bool = False) -> Simulation:
    """The running scene.  Everything that needs Taichi is imported here or later."""
    runtime.import_taichi()
    from tisoft.simulation import Simulation

    return Simulation(scene, arch=options.arch, ledger=ledger)


class Run:
    """One run of a scene, however it ends, and its result."""

    def __init__(self, sim: Simulation) -> None:
        from tisoft.check.limiting import limiting_element
        from tisoft.check.warnings import warnings_of

        self.sim = sim
        self.code = 0
        self.status = "done"
        self.error: str | None = None
        self.seconds = 0.0
        self.seconds_before = 0.0
        """[s] that the part of the run before a checkpoint took."""
        self.is_whole = False
        """Whether it ended between two frames."""
        self._warnings = warnings_of(sim.scene)
        self._stable_step = sim.limit.sharp()
        self._limiting = limiting_element(sim)
        sim.energy()  # compiles, which is no part of the run

    @contextmanager
    def ended(self) -> Iterator[None]:
        """Time what is inside, and note how it ends instead of raising."""
        self._begun = time.perf_counter()
        try:
            yield
        except BaseException as error:
            if not self._noted(stops.asked() or error):
                raise
        finally:
            stops.settled()
            self.seconds = self.elapsed()

    def _noted(self, error: BaseException) -> bool:
        """Whether the run ended by this error, and what it has made is worth keeping."""
        self.error = str(error)
        if isinstance(error, KeyboardInterrupt):
            self.code, self.status = getattr(error, "exit_code", 130), "interrupted"
            self.error = f"{str(error) or 'interrupted'}; what was written is whole"
        elif isinstance(error, Diverged):
            self.code, self.status = error.exit_code, "diverged"
        elif isinstance(error, Unwritable) and self.sim.frame:
            self.code, self.status = error.exit_code, "failed"
        else:
            return False
        return True

    def step(self, seconds: float | None = None, *, observers: Sequence[Any]) -> None:
        """Simulate, so that a signal ends it between two frames."""
        from tisoft.observers.progress import WholeFrames

        frames = WholeFrames(observers)
        gc.freeze()  # what loading Taichi left: a look through all of it stops a run for 80 ms
        try:
            frames.run(self.sim, seconds)
        finally:
            gc.unfreeze()
            self.is_whole = frames.is_whole

    def elapsed(self) -> float:
        """Stepping so far [s], with what watched it."""
        return self.seconds_before + time.perf_counter() - self._begun

    def result(self, **more: Any) -> dict[str, Any]:
        """The object of --json."""
        from tisoft.observers.summary import summary

        made = summary(
            self.sim,
            status=self.status,
            stable_step=self._stable_step,
            limiting=self._limiting,
            wall_seconds=self.seconds,
            warnings=self._warnings,
        )
        if self.error is not None:
            made["error"] = self.error
        return made | more

    def report(
        self, options: argparse.Namespace, result: dict[str, Any], *lines: str, warn: bool = True
    ) -> int:
        """Print the result, the warnings and the error; returns the exit code."""
        from tisoft.observers.summary import as_text

        try:
            if options.json:
                print(as_json(result), flush=True)
            elif not options.quiet:
                print("\n".join([as_text(result), *lines]), flush=True)
                from tisoft.check.warnings import first_warnings

                told = first_warnings(self.sim.scene)  # by scene_of
                for warning in result["warnings"] if warn else []:
                    if warning in told:
                        continue
                    print(f"tisoft: warning: {warning}", file=sys.stderr)
            if self.error is not None:
                print(f"tisoft: error: {self.error}", file=sys.stderr)
        except OSError:  # nobody reads any more: a terminal that was closed
            if self.code == 0:
                raise
        return self.code
