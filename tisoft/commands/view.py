"""tisoft view: take the body of a running scene in your hand, in a browser."""

from __future__ import annotations

import argparse
import os
import socket
import sys
import webbrowser
from pathlib import Path

from tisoft import runtime
from tisoft.commands import common
from tisoft.commands.demo import FIRST, demos
from tisoft.errors import SceneError

HELP = "take a running body in your hand, in the browser"
EXAMPLES = """examples:
  tisoft view                                       the creature
  tisoft view twist                                 another demo
  tisoft view beam.toml --color strain --speed 0.5
  tisoft view beam.toml --no-browser --port 9000    over ssh: open the printed address

left drag on the body pulls it, elsewhere it turns the view; Space pauses, → makes one frame,
Backspace resets, F frames the view; Ctrl-C here ends it"""


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
        "--color", choices=("stress", "strain", "speed", "body"), help="what the colours show"
    )
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
    from tisoft.viewer.orders import COLORS
    from tisoft.viewer.server import Server

    color = scene.render.color if scene.render.color in COLORS else "stress"
    control = Controller(scene, arch=options.arch, color=color, speed=options.speed)
    server = Server(control, host=options.host, port=options.port)
    try:
        _tell(options, server.url, server.port)
        while True:
            control.tick()
    finally:
        server.close()


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
    if not options.no_browser and shows and not webbrowser.open(url) and not options.quiet:
        print("no browser opened; open the address yourself")
    if not options.quiet:
        print("Ctrl-C ends it", flush=True)
