"""A scene with some keys changed: of a scene file as --set does it, of a Scene field by field.

Settings are texts KEY=VALUE with the keys of scene files, as body.0.young=2e5.
"""

from __future__ import annotations

import copy
import dataclasses
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tisoft.body import Body
from tisoft.checks import FieldError, inside, suggestion
from tisoft.errors import SceneError
from tisoft.geometry.mesh import Mesh
from tisoft.geometry.refinement import refined
from tisoft.geometry.solid import quadratic
from tisoft.models.materials import MODELS
from tisoft.scene import Scene
from tisoft.scene_file import load_scene
from tisoft.scene_keys import field_names, toml_value

MODEL_WORDS = {cls: word for word, cls in MODELS.items()}
SCENE_KEYS = [k for k in field_names(Scene) if k not in ("bodies", "obstacles", "probes")]


def scene_with(source: str | Path | Scene, settings: Sequence[str]) -> Scene:
    """The scene of a file, or a copy of a Scene, with settings.

    Raises:
        SceneError: one sentence with the key, its value, and what to do.
    """
    if not isinstance(source, Scene):
        return load_scene(source, settings)
    scene = copy.copy(source)
    scene.bodies = [copy.copy(body) for body in source.bodies]
    with np.errstate(all="ignore"):
        for setting in settings:
            key, _, text = setting.partition("=")
            try:
                _put(scene, key.strip(), toml_value(text))
            except FieldError as error:
                raise SceneError(f"{setting}: {error}") from None
        scene.validate()
    return scene


def _put(scene: Scene, key: str, value: Any) -> None:
    steps = re.findall(r"[^\s.\[\]]+", key)
    if len(steps) == 1 and steps[0] in SCENE_KEYS:
        setattr(scene, steps[0], value)
        return
    if len(steps) >= 3 and steps[0] == "body" and steps[1].isdecimal():
        number = int(steps[1])
        if number >= len(scene.bodies):
            raise FieldError(f"body[{number}]", f"is out of range: there are {len(scene.bodies)}")
        with inside(f"body[{number}]"):
            scene.bodies[number] = _with(scene.bodies[number], steps[2:], value)
        return
    raise FieldError(key, f"is not a key that tisoft knows; {suggestion(key, SCENE_KEYS)}", value)


def _with(body: Body, steps: list[str], value: Any) -> Body:
    """The body with one of its keys changed."""
    key = ".".join(steps)
    if key == "model":
        return dataclasses.replace(body, model=_as_model(body.model, value))
    if key in ("velocity", "spin"):
        return dataclasses.replace(body, **{key: value})
    if key == "mesh.refine":
        return dataclasses.replace(body, mesh=refined(body.mesh, value))
    if key == "mesh.element":
        return dataclasses.replace(body, mesh=_of_element(body.mesh, value))
    known = field_names(type(body.model))
    if key not in known:
        problem = f"is not a key that a Scene in Python can change; {suggestion(key, known)}"
        raise FieldError(key, problem, value)
    return dataclasses.replace(body, model=dataclasses.replace(body.model, **{key: value}))


def _as_model(model: Any, word: Any) -> Any:
    if word not in MODELS:
        raise FieldError("model", f"is not known; {suggestion(word, list(MODELS))}", word)
    kind = MODELS[word]
    names = field_names(kind)
    given = {f: getattr(model, f) for f in field_names(type(model)) if f in names}
    return kind(**given)


def _of_element(mesh: Mesh, word: Any) -> Mesh:
    if word == "tet10" and list(mesh.cells) == ["tet4"]:
        return quadratic(mesh)  # type: ignore[arg-type]
    if word in mesh.cells:
        return mesh
    raise FieldError("mesh.element", "cannot be had of this mesh", word)
