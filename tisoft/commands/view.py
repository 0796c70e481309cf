"""tisoft view: take the body of a running scene in your hand, in a browser."""

from __future__ import annotations

import argparse
import os
import socket
import sys
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING

from tisoft import runtime, stops
from tisoft.commands import common
from tisoft.commands.demo import FIRST, demos
from tisoft.errors import SceneError

if TYPE_CHECKING:
    from tisoft.viewer.controller import Controller
    from tisoft.viewer.window import Window

HELP = "take a running body in your hand, in the browser"
EXAMPLES = """examples:
  tisoft view                                       the creature
  tisoft view twist                                 another demo
  tisoft view beam.toml --color strain --speed 0.5
  tisoft view beam.toml --record pull.mp4           every frame, from the start; or pull.html
  tisoft view beam.toml --no-browser --port 9000    over ssh: open the printed address

left drag on the body pulls it, elsewhere it turns the view; with Shift it carries pins and
obstacles; Space pauses, → makes one frame, Backspace resets, U undoes, V records, F frames the
view; Ctrl-C here ends it"""


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    parser.add_argument(
        "scene", metavar="SCENE", nargs="?", type=common.place, default=FIRST,
        help=f"a scene file (.toml), or the name of a demo ({FIRST})",
    )  # fmt: skip
    common.add_settings(parser)
    common.add_machine(parser)
    parser.add_argument("--quiet", action="store_true", help="print the address alone")
    parser.add_argument("--port", type=int, default=8400, help="of the page (8400); 0: any free")
    parser.add_argument(
        "--host", default="127.0.0.1", help="where to listen (127.0.0.1: this machine alone)"
    )
    parser.add_argument("--no-browser", action="store_true", help="print the address, open nothing")
    parser.add_argument(
        "--window", action="store_true", help="open a window too, where display and Vulkan are"
    )
    parser.add_argument("--color", choices=common.COLORS, help="what the colours show")
    parser.add_argument(
        "--record", metavar="FILE", type=common.place,
        help="record every frame, into a film (.mp4, .gif, .webp) or a page (.html)",
    )  # fmt: skip
    parser.add_argument("--size", metavar="WxH", help="of a film in pixels, as 1280x720")
    parser.add_argument("--speed", type=float, default=1.0, help="simulated seconds a second (1)")


def execute(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C."""
    if not 0.01 <= options.speed <= 10.0:
        raise SceneError(f"--speed is {options.speed:g}; give a number from 0.01 to 10")
    if not 0 <= options.port <= 65_535:
        raise SceneError(f"--port is {options.port}; give a number from 0 to 65535")
    known = demos()
    name = options.scene.replace("_", "-")
    if name in known and not Path(options.scene).exists():
        options.scene = str(known[name])
    elif not options.scene.endswith(".toml") and not Path(options.scene).exists():
        raise SceneError(
            f'there is no scene file or demo "{options.scene}"; the demos are {", ".join(known)}'
        )
    scene = common.scene_of(options)
    runtime.import_taichi()
    from tisoft.viewer.controller import Controller
    from tisoft.viewer.recording import checked_place
    from tisoft.viewer.server import Server, check_port

    place = checked_place(options.record) if options.record else None  # told before it compiles
    check_port(options.host, options.port)
    control = Controller(scene, arch=options.arch, color=scene.render.color, speed=options.speed)
    server = Server(control, host=options.host, port=options.port)
    try:
        if place is not None:
            control.record_to(place)
        window = _window(control) if options.window else None
        _tell(options, server.url, server.port)
        _step(control, options, window)
    finally:
        server.close()
    return 0


def _window(control: Controller) -> Window | None:
    """The window, or None with a sentence that says why there is none."""
    from tisoft.viewer.window import Window, unusable

    why = unusable()
    if why:
        print(f"tisoft: warning: no window: {why}; take the page", file=sys.stderr, flush=True)
        return None
    return Window(control)


def _step(control: Controller, options: argparse.Namespace, window: Window | None) -> None:
    """Step until a signal ends it, between two frames, or the window is closed; then complete what
    is recorded.
    """
    try:
        with stops.between_frames():
            while window is None or window.is_open:
                control.tick()
                if window is not None:
                    window.show()
                stops.raise_if_asked()
    finally:
        if window is not None:
            window.close()
        _complete(control, options)


def _complete(control: Controller, options: argparse.Namespace) -> None:
    """Write the rest of a recording; a second signal ends it there, whole."""
    recording = control.recorder.recording
    if recording is None:
        return
    from tisoft.commands.render import Picture
    from tisoft.observers.progress import Progress

    first = stops.last_asked()
    progress = Progress(f"writing {recording.path.name}", quiet=options.quiet)
    progress.begin(len(recording))
    pieces = control.recorder.rest()
    with stops.held():
        try:
            for done in pieces:
                progress.on_frame(Picture(done))
                if stops.last_asked() > first:
                    break
        finally:
            pieces.close()  # type: ignore[attr-defined]
            progress.on_end()
    if not options.quiet:
        print(f"{recording.path}: {recording.done} of {len(recording)} frames", flush=True)


def _tell(options: argparse.Namespace, url: str, port: int) -> None:
    print(url, flush=True)
    if options.host not in ("127.0.0.1", "localhost", "::1"):
        print(
            f"tisoft: warning: {options.host} lets other machines in: whoever has the address "
            "steers the scene, and nothing is encrypted",
            file=sys.stderr,
        )
    if not options.quiet and "SSH_CONNECTION" in os.environ:
        print(f"from your own machine: ssh -L {port}:127.0.0.1:{port} {socket.gethostname()}")
    shows = sys.platform in ("darwin", "win32") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    if (
        not (options.no_browser or options.window)
        and shows
        and not webbrowser.open(url)
        and not options.quiet
    ):
        print("no browser opened; open the address yourself")
    if not options.quiet:
        print("Ctrl-C ends it", flush=True)
