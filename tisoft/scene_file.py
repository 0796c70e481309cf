"""Scene files: TOML to a Scene, strictly, with one sentence for whatever is wrong.

`load_scene` is the door; the keys are those of the dataclasses it fills (`Scene`, `Body`, `Pin`,
the models, …), see `scene_keys`.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tisoft import checks, scene_mesh, where
from tisoft.checks import FieldError, inside, joined, suggestion
from tisoft.errors import SceneError
from tisoft.geometry.mesh import Mesh, SpringNet
from tisoft.loads import Load, Torque
from tisoft.models.materials import MODELS, Model, young_and_poisson
from tisoft.models.presets import preset
from tisoft.pins import Pin, Turn
from tisoft.region_material import RegionMaterial
from tisoft.scene import Scene
from tisoft.scene_keys import (
    Table,
    check_keys,
    field_names,
    look_up,
    make,
    override,
    parse_toml,
    tables,
)
from tisoft.scene_obstacle import obstacle_of
from tisoft.scene_parts import Camera, NoContact, Probe, Render
from tisoft.where import Selection

LARGEST_FILE = 16 * 2**20
"""Bytes of a scene file; large meshes belong into files of their own."""

_TABLES = ("body", "obstacle", "probe", "no_contact", "camera", "render")
_SETTINGS = [
    key
    for key in field_names(Scene)
    if key not in ("bodies", "obstacles", "probes", "no_contact", *_TABLES)
]
_CONTACT = ("contact", "self_contact", "thickness", "friction")
_BODY = (
    *("name", "model", "tolerance", "mesh", "skin", "region", "pin", "load", "velocity", "spin"),
    *_CONTACT,
)
_INSTEAD_OF_YOUNG = ("material", "lame_lambda", "lame_mu")


def load_scene(path: str | Path, overrides: Sequence[str] = ()) -> Scene:
    """The Scene that a TOML file describes.

    Args:
        path: of the file; mesh files are found from its folder.
        overrides: KEY=VALUE settings that replace what the file says, as "body.0.young=2e5".

    Raises:
        SceneError: one sentence with the file, the key and its path, the value, and what to do.
    """
    source = checks.path("path", path, "a scene file")
    document = document_of(source, overrides)
    settings = [_short(assignment) for assignment in overrides]
    try:
        with np.errstate(all="ignore"):  # what leaves the range of floats is refused by name
            return _scene(document, source.parent)
    except FieldError as error:
        label = "".join([str(source), *(f", --set {setting}" for setting in settings)])
        raise SceneError(f"{label}: {_as_written(document, error)}") from None


def document_of(path: str | Path, overrides: Sequence[str] = ()) -> Table:
    """The tables of a scene file with settings; raises SceneError as `load_scene` does."""
    document = _read(Path(path))
    for assignment in overrides:
        try:
            override(document, assignment)
        except FieldError as error:
            raise SceneError(f"{path}, --set {_short(assignment)}: {error}") from None
    return document


def _short(assignment: str) -> str:
    return " ".join(assignment.split())[:100]


def _as_written(document: Table, error: FieldError) -> FieldError:
    """The error with the value that the file holds, which may have been turned into another."""
    value = look_up(document, error.field)
    if value is None or (isinstance(value, dict | list) and not error.has_value):
        return error
    return FieldError(error.field, error.problem, value)


def _read(path: Path) -> Table:
    """The file's tables; every failure is a SceneError."""
    try:
        if path.is_dir():
            raise SceneError(f"{path} is a folder; name a scene file (.toml)")
        with path.open("rb") as file:
            data = file.read(LARGEST_FILE + 1)
    except FileNotFoundError:
        raise SceneError(f"{path} is not found; check the name of the scene file") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL byte in the name
        reason = getattr(error, "strerror", None) or error
        raise SceneError(f"{checks.shown(str(path))} cannot be read: {reason}") from None
    if len(data) > LARGEST_FILE:
        most = LARGEST_FILE // 2**20
        raise SceneError(f"{path} is larger than {most} MB; put meshes into files of their own")
    return _parse(path, data)


def _parse(path: Path, data: bytes) -> Table:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        problem = f"is not text in UTF-8 (byte {data[error.start]:#04x} in line {line})"
        raise SceneError(f"{path} {problem}; save it as UTF-8") from None
    try:
        return parse_toml(text)
    except RecursionError:
        raise SceneError(f"{path} nests lists or tables too deeply; 4 levels are enough") from None
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"{path} is not valid TOML: {error}{_hint(text, str(error))}") from None
    except (ValueError, OverflowError):
        problem = "is not valid TOML: a whole number has thousands of digits; write it as 1e9"
        raise SceneError(f"{path} {problem}") from None


def _hint(text: str, message: str) -> str:
    """The line that tomllib stumbled over, and the slip that is made most often."""
    place = re.search(r"at line (\d+)", message)
    if not place:
        return ""
    line = text.splitlines()[int(place[1]) - 1 : int(place[1])]
    written = f": {checks.shown(line[0].strip())}" if line else ""
    bare = re.search(r"[\s=\[,][-+]?(\.\d+)", line[0]) if line else None
    return written + (f"; numbers need a digit before the point, as 0{bare[1]}" if bare else "")


def _scene(document: Table, folder: Path) -> Scene:
    check_keys(document, "", (*_SETTINGS, *_TABLES))
    settings = {key: document[key] for key in _SETTINGS if key in document}
    scene = Scene(
        **settings,
        camera=make(Camera, document.get("camera", {}), "camera"),
        render=make(Render, document.get("render", {}), "render"),
        obstacles=[
            obstacle_of(table, field, folder) for field, table in tables(document, "obstacle")
        ],
    )
    for field, table in tables(document, "body"):
        _add_body(scene, table, field, folder)
    scene.no_contact += [make(NoContact, t, field) for field, t in tables(document, "no_contact")]
    for field, table in tables(document, "probe"):
        probe = make(Probe, table, field)
        with inside(field):
            scene.add_probe(probe.name, probe.body, point=probe.point, node=probe.node)
    scene.validate()
    return scene


def _add_body(scene: Scene, table: Any, field: str, folder: Path) -> None:
    kind, parameters = _model_parameters(table, field)
    with inside(field):
        model: Model = MODELS[kind](**parameters)
    if "mesh" not in table:
        raise FieldError(joined(field, "mesh"), "is missing; give file, box, ball or another shape")
    try:
        mesh = scene_mesh.build_mesh(table["mesh"], joined(field, "mesh"), folder, model)
    except FieldError as error:
        raise (error.inside(field) if error.field.startswith("springs") else error) from None
    _check_size(scene, mesh, joined(field, "mesh"))
    start = {key: table[key] for key in ("velocity", "spin") if key in table}
    with inside(field):
        body = scene.add_body(mesh, model, table.get("name"), **start)
        for key in _CONTACT:
            if key in table:
                setattr(body, key, table[key])
        body.validate()
    for path, region in tables(table, "region", field):
        body.regions.append(make(RegionMaterial, region, path))
    if "skin" in table:
        body.skin = scene_mesh.build_skin(table, field, folder, mesh)
    for path, pin in tables(table, "pin", field):
        body.pins.append(_pin(pin, path))
    for path, load in tables(table, "load", field):
        body.loads.append(_load(load, path))


def _check_size(scene: Scene, mesh: Mesh, field: str) -> None:
    """Many bodies must not have together what one body may not have."""
    meshes = [mesh, *(body.mesh for body in scene.bodies)]
    count = sum(len(m.edges) if isinstance(m, SpringNet) else m.elements for m in meshes)
    if count > scene_mesh.MOST_ELEMENTS:
        most = f"{scene_mesh.MOST_ELEMENTS:,}"
        problem = f"brings the scene to {count:,} elements, more than {most}; take coarser meshes"
        raise FieldError(field, problem)


def _model_parameters(table: Any, field: str) -> tuple[str, Table]:
    """The model's name and its parameters, with presets and Lamé constants worked out."""
    every_key = dict.fromkeys(key for model in MODELS.values() for key in field_names(model))
    known = (*_BODY, *every_key, *_INSTEAD_OF_YOUNG)
    check_keys(table, field, known, {"mesh": scene_mesh.KEYS})
    with inside(field):
        _check_auto(table)
        kind = checks.choice("model", table.get("model", "viscoelastic"), list(MODELS))
        given = {key: value for key, value in table.items() if key in every_key}
        own = field_names(MODELS[kind])
        _check_model_keys(kind, given)
        parameters = _without_young(table, given)
        if kind != "mass-spring":
            for key in ("young", "poisson", "density"):
                if key not in parameters:
                    raise FieldError(key, f"is missing: {_HOW_TO_GIVE[key]}")
    return kind, {key: value for key, value in parameters.items() if key in own}


def _check_auto(table: Table) -> None:
    """Refuse model = "auto" where nobody has settled it, and a tolerance that is none."""
    if table.get("model") == "auto":
        problem = (
            "is settled by commands that run a scene; elsewhere ask `tisoft advise` first, or "
            f"give one of {', '.join(MODELS)}"
        )
        raise FieldError("model", problem, "auto")
    if "tolerance" in table:
        checks.number("tolerance", table["tolerance"], above=0.0, below=1.0)


_HOW_TO_GIVE = {
    "young": 'give it in Pa, or material = "rubber", or lame_lambda and lame_mu in Pa',
    "poisson": "give a number above -1 and below 0.5, as 0.3",
    "density": "give it in kg/m³",
}


def _check_model_keys(kind: str, given: Table) -> None:
    """Refuse what the model does not have; what changes nothing stays, so models can be swapped."""
    for key, value in given.items():
        if key in field_names(MODELS[kind]) or key in _CONTACT:
            continue
        if kind != "mass-spring":
            problem = f'is a key of model = "mass-spring", and this body is "{kind}"; remove it'
            raise FieldError(key, problem, value)
        if key == "mass":
            checks.choice("mass", value, ("lumped", "consistent"))
            if value == "consistent":
                raise FieldError(key, "needs tets; mass-spring has lumped masses only", value)
        elif key == "poisson":
            checks.number(key, value, above=-1.0, below=0.5)
        elif checks.number(key, value) != 0.0:
            problem = "is the viscosity of tets; damp springs by damping_ratio or spring_damping"
            raise FieldError(key, problem, value)


def _without_young(table: Table, given: Table) -> Table:
    """The parameters, with `material`, `lame_lambda` and `lame_mu` turned into young and so on."""
    parameters: Table = {}
    if "material" in table:
        parameters = preset(table["material"]).parameters()
        if any(given.get(key) for key in ("phi", "eta", "spring_damping")):
            del parameters["damping_ratio"]
        if "node_mass" in given:
            del parameters["density"]
    lame = [key for key in ("lame_lambda", "lame_mu") if key in table]
    if lame:
        twice = [key for key in ("young", "poisson") if key in given]
        if twice:
            raise FieldError(lame[0], f"and {twice[0]} exclude each other", table[lame[0]])
        if len(lame) == 1:
            other = "lame_mu" if lame == ["lame_lambda"] else "lame_lambda"
            raise FieldError(other, f"is missing: {lame[0]} needs it beside it")
        young, poisson = young_and_poisson(table["lame_lambda"], table["lame_mu"])
        parameters |= {"young": young, "poisson": poisson}
    return parameters | given


def _pin(table: Any, field: str) -> Pin:
    check_keys(table, field, field_names(Pin))
    rest = {key: value for key, value in table.items() if key not in ("where", "turn")}
    turn = make(Turn, table["turn"], joined(field, "turn")) if "turn" in table else None
    return make(Pin, rest, field, where=_where(table, field), turn=turn)


def _load(table: Any, field: str) -> Load:
    check_keys(table, field, field_names(Load))
    rest = {key: value for key, value in table.items() if key not in ("where", "torque")}
    torque = make(Torque, table["torque"], joined(field, "torque")) if "torque" in table else None
    return make(Load, rest, field, where=_where(table, field), torque=torque)


_SIMPLE: dict[str, Callable[[Any], Selection]] = {
    "nodes": where.nodes,
    "nearest": where.nearest,
    "region": where.region,
    "set": where.named_set,
}


def _where(holder: Table, holder_field: str) -> Selection:
    field = joined(holder_field, "where")
    if "where" not in holder:
        raise FieldError(field, 'is missing; give { box = [lo, hi] }, { nodes = [0] } or "all"')
    rule = holder["where"]
    kinds = ("box", "nodes", "plane", "nearest", "region", "set")
    if isinstance(rule, str):
        if rule != "all":
            problem = f"is not known; {suggestion(rule, ['all'])} or one of {', '.join(kinds)}"
            raise FieldError(field, problem, rule)
        return where.everything()
    check_keys(rule, field, kinds)
    kind = checks.exactly_one(field, {key: rule.get(key) for key in kinds})
    value = rule[kind]
    with inside(field):
        if kind in _SIMPLE:
            return _SIMPLE[kind](value)
        if kind == "plane":
            check_keys(value, "plane", ("point", "normal"))
            for key in ("point", "normal"):
                if key not in value:
                    raise FieldError(f"plane.{key}", "is missing")
            return where.plane(value["point"], value["normal"])
        corners = checks.sequence("box", value, "two corners [lo, hi]")
        if len(corners) != 2:
            raise FieldError("box", "must be two corners [[x, y, z], [x, y, z]]", value)
        return where.box(corners[0], corners[1])
