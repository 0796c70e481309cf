"""Options that commands share, and how a scene is loaded and run from them."""

from __future__ import annotations

import argparse
import dataclasses
import re
from typing import Any

from tisoft.errors import SceneError
from tisoft.scene import Render, Scene
from tisoft.scene_file import load_scene

ARCHS = ("cpu", "cuda", "metal", "vulkan", "auto")
COLORS = ("stress", "strain", "speed", "body")


def add_output(parser: argparse.ArgumentParser) -> None:
    """--json and --quiet."""
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")
    parser.add_argument("--quiet", action="store_true", help="no progress, no summary")


def add_machine(parser: argparse.ArgumentParser) -> None:
    """--arch and --precision."""
    parser.add_argument("--arch", choices=ARCHS, default="cpu", help="where to compute (cpu)")
    parser.add_argument("--precision", choices=("f32", "f64"), help="the scene's, else f32")


def add_scene(parser: argparse.ArgumentParser) -> None:
    """SCENE and --set, and all options that every command with a scene has."""
    parser.add_argument("scene", metavar="SCENE", help="a scene file (.toml)")
    parser.add_argument(
        "--set",
        dest="settings",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        help="replace a key of the scene, as body.0.young=2e5; may be repeated",
    )
    add_machine(parser)
    add_output(parser)


def add_picture(parser: argparse.ArgumentParser) -> None:
    """--size, --color and --wireframe."""
    parser.add_argument("--size", metavar="WxH", help="of the picture in pixels, as 1280x720")
    parser.add_argument("--color", choices=COLORS, help="what the surfaces' colours show")
    parser.add_argument("--wireframe", action="store_true", help="draw the edges of the surfaces")


def scene_of(options: argparse.Namespace) -> Scene:
    """The scene that the command line asks for."""
    scene = load_scene(options.scene, options.settings)
    if options.precision:
        scene.precision = options.precision
    scene.render = render_of(options, scene.render)
    return scene


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
    if getattr(options, "wireframe", False):
        changes["wireframe"] = True
    return dataclasses.replace(render, **changes)
