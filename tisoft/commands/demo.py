"""tisoft demo: run a shipped demo and write its film and its picture."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from tisoft.commands import common
from tisoft.commands.render import draw
from tisoft.errors import SceneError
from tisoft.whole_files import as_json, make_folder

HELP = "run a shipped demo; writes a film and a picture"
EXAMPLES = """examples:
  tisoft demo                                       demo.mp4 and demo.png, here
  tisoft demo cloth -o films
  tisoft demo --list"""

FIRST = "creature"
GALLERY = {
    "creature": (0.162, 12),
    "softness": (0.12, 15),
    "four-ways": (0.2, 12),
    "twist": (0.45, 15),
    "nets": (0.25, 14),
    "bowl": (0.9, 30),
    "cloth": (0.75, 18),
}
"""Of each demo: the share of the film at which its picture is taken, and about how many seconds it
takes on two cores, with kernels from the cache."""


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    parser.add_argument("name", nargs="?", metavar="NAME", help=f"of the demo ({FIRST})")
    parser.add_argument("--list", action="store_true", help="name the demos")
    parser.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        type=common.place,
        default=".",
        help="where the files go (this folder)",
    )
    common.add_settings(parser)
    common.add_machine(parser)
    common.add_output(parser)
    common.add_picture(parser)


def shipped(folder: str) -> Path:
    """ "demos" or "assets": inside an installed package, else in the repository around it."""
    package = Path(__file__).parents[1]
    inside = package / "_data" / folder
    return inside if inside.is_dir() else package.parent / folder


def demos() -> dict[str, Path]:
    """The scenes of the shipped demos by name."""
    return {name: shipped("demos") / f"{name}.toml" for name in GALLERY}


def about(file: Path) -> str:
    """The first sentence of a demo's own words."""
    text = file.read_text(encoding="utf-8")
    words = " ".join(line.lstrip("# ") for line in re.match(r"(#.*\n)*", text)[0].splitlines())  # type: ignore[index]
    return words.split(". ")[0].rstrip(".") + "."


def execute(options: argparse.Namespace) -> int:
    """List the demos, or run one."""
    known = demos()
    if options.list:
        _list(options, known)
        return 0
    name = options.name or FIRST
    file = known.get(name.replace("_", "-"))
    if file is None:
        raise SceneError(f'there is no demo "{name}"; choose one of {", ".join(known)}')
    folder = make_folder(options.output)
    options.scene = str(file)
    scene = common.scene_of(options)
    stem = name if options.name else "demo"
    film_file, picture_file = folder / f"{stem}.mp4", folder / f"{stem}.png"
    run, film = draw(scene, options, film_file, kept=GALLERY[name.replace("_", "-")][0])
    lines = []
    if film is not None and film.kept is not None:
        from tisoft.render.video import open_sink

        with open_sink(
            picture_file, scene.render.size, scene.frame_rate, alpha=scene.render.alpha
        ) as sink:
            sink.write(film.kept)
        lines = [f"wrote {film_file} and {picture_file}"]
    result = run.result(demo=name, output=str(film_file), picture=str(picture_file))
    return run.report(options, result, *lines, warn=False)


def _list(options: argparse.Namespace, known: dict[str, Path]) -> None:
    rows = [
        {"name": name, "about": about(file), "seconds": GALLERY[name][1], "file": str(file)}
        for name, file in known.items()
    ]
    if options.json:
        print(as_json(rows))
        return
    width = max(map(len, known))
    for row in rows:
        print(f"{row['name']:{width}}  {row['seconds']:2} s  {row['about']}")
