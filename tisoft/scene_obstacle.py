"""The tables [[obstacle]] of a scene file."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

from tisoft import checks, scene_mesh
from tisoft.checks import FieldError, inside, joined
from tisoft.errors import MeshError
from tisoft.moving import MOTIONS, check_motion
from tisoft.obstacles import OBSTACLES, Obstacle, Shell
from tisoft.obstacles.shell import read_shell
from tisoft.pins import Turn
from tisoft.scene_keys import Table, check_keys, make

WORDS = {"from": "start", "to": "end"}
"""Keys that cannot be names in Python."""


def obstacle_of(table: Any, field: str, folder: Path) -> Obstacle:
    """The obstacle of a table; its mesh file counts from `folder`.

    Raises:
        FieldError: the key with its path, its value, and what to do.
    """
    placed = scene_mesh.TRANSFORM if isinstance(table, dict) and "file" in table else ()
    check_keys(table, field, (*OBSTACLES, "friction", *MOTIONS, *placed))
    kind = checks.exactly_one(field, {key: table.get(key) for key in OBSTACLES})
    with inside(field):
        friction = checks.number("friction", table.get("friction", 0.0), least=0.0)
    motion = {key: table.get(key) for key in MOTIONS}
    if motion["turn"] is not None:
        motion["turn"] = make(Turn, table["turn"], joined(field, "turn"))
    with inside(field):
        check_motion(SimpleNamespace(**motion))
    more = {"friction": friction, **motion}
    if kind == "file":
        return _shell(table, field, folder, more)
    own = table[kind]
    try:
        if isinstance(own, dict) and {"from", "to"} & set(own):
            own = {WORDS.get(key, key): value for key, value in own.items()}
        return make(OBSTACLES[kind], own, joined(field, kind), **more)
    except FieldError as error:
        raise _as_written(error) from None


def _as_written(error: FieldError) -> FieldError:
    """The error with the key that the file has."""
    head, _, key = error.field.rpartition(".")
    for word, name in WORDS.items():
        if key == name:
            if error.has_value:
                return FieldError(joined(head, word), error.problem, error.value)
            return FieldError(joined(head, word), error.problem)
    return error


def _shell(table: Table, field: str, folder: Path, more: Table) -> Shell:
    path, name = joined(field, "file"), table["file"]
    with inside(field):
        transform = scene_mesh.placing(table)
    try:
        shell: Shell = scene_mesh.read_beside(
            path, name, folder, lambda file: read_shell(file, **transform, **more)
        )
        return shell
    except MeshError as error:
        told = str(error).removeprefix(f"{folder / str(name)}: ")
        raise FieldError(path, f"is no usable surface: {told}", name) from None
    except FieldError as error:
        if error.field.endswith("triangles"):
            raise FieldError(path, error.problem.replace("are no", "is no"), name) from None
        raise
