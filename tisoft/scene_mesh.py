"""The table [body.mesh]: a file, a shape made by rule or a bare net, and where it is put."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from tisoft import checks, scene_cage
from tisoft.checks import FieldError, inside, joined
from tisoft.errors import MeshError
from tisoft.geometry import shapes
from tisoft.geometry.merging import merged
from tisoft.geometry.mesh import Mesh, SpringNet, TetMesh
from tisoft.geometry.refinement import refined
from tisoft.geometry.skin import Skin, read_skin
from tisoft.geometry.solid import quadratic
from tisoft.models.materials import MassSpring, Model
from tisoft.scene_keys import Table, check_keys

MOST_ELEMENTS = 10_000_000
"""Tets or springs that the shapes of a scene may have: 5 GB while a mesh of tets is built."""

TRANSFORM = ("scale", "units", "rotate", "translate")
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
"""Metres in a unit of length that a mesh may be written in."""
LARGE, SMALL = 100.0, 1e-4
"""Sizes [m] beyond which a file is asked whether it is in metres."""


@dataclass(frozen=True)
class Shape:
    """A mesh made by rule.

    `make` builds it from its keys, `check` maps each key to what its value must be, `count`
    estimates its elements before it is built, and `largest` names the key that makes them many.
    """

    make: Callable[..., Mesh]
    check: dict[str, Callable[[str, Any], Any]]
    count: Callable[[Table], float]
    largest: Callable[[Table], str]
    optional: tuple[str, ...] = ()


def _lengths(count: int) -> Callable[[str, Any], Any]:
    return lambda field, value: checks.numbers(field, value, count, "lengths", above=0.0, unit="m")


def _length(field: str, value: Any) -> float:
    return checks.number(field, value, above=0.0, unit="m")


def _cells(count: int) -> Callable[[str, Any], Any]:
    def check(field: str, value: Any) -> list[int]:
        items = checks.sequence(field, value, "whole numbers")
        if len(items) != count:
            raise FieldError(field, f"must be {count} whole numbers, not {len(items)}", value)
        return [_count(f"{field}[{i}]", item) for i, item in enumerate(items)]

    return check


def _count(field: str, value: Any) -> int:
    return checks.integer(field, value, least=1)


def _split(field: str, value: Any) -> str:
    return checks.choice(field, value, ("five", "six", "hex"))


def _tets_or_hex(field: str, value: Any) -> str:
    return checks.choice(field, value, ("tets", "hex"))


def _layers_or_rings(keys: Table) -> str:
    return "resolution" if 18.0 * keys["resolution"] ** 2 > MOST_ELEMENTS else "height"


def _layered(keys: Table) -> float:
    """Tets of a cylinder: 18 resolution² a layer, in layers about as high as tets are wide."""
    layers = max(1.0, keys["height"] / keys["radius"] * keys["resolution"])
    return 18.0 * keys["resolution"] ** 2 * layers


SHAPES: dict[str, Shape] = {
    "box": Shape(
        shapes.box,
        {"size": _lengths(3), "cells": _cells(3), "split": _split},
        lambda keys: (
            {"six": 6.0, "hex": 1.0}.get(keys.get("split", ""), 5.0) * math.prod(keys["cells"])
        ),
        lambda keys: "cells",
        ("split",),
    ),
    "ball": Shape(
        shapes.ball,
        {"radius": _length, "resolution": _count, "split": _tets_or_hex},
        lambda keys: (5.0 if keys.get("split") == "hex" else 20.0) * keys["resolution"] ** 3,
        lambda keys: "resolution",
        ("split",),
    ),
    "cylinder": Shape(
        shapes.cylinder,
        {"radius": _length, "height": _length, "resolution": _count, "split": _tets_or_hex},
        _layered,
        _layers_or_rings,
        ("split",),
    ),
    "cloth": Shape(
        shapes.cloth,
        {"size": _lengths(2), "cells": _cells(2), "diagonals": checks.flag},
        lambda keys: 4.0 * math.prod(keys["cells"]),
        lambda keys: "cells",
        ("diagonals",),
    ),
    "grid": Shape(
        shapes.grid,
        {"size": _lengths(3), "cells": _cells(3), "diagonals": checks.flag},
        lambda keys: 9.0 * math.prod(keys["cells"]),
        lambda keys: "cells",
        ("diagonals",),
    ),
}

SOURCES = ("file", *SHAPES, "points")
KEYS = (*SOURCES, *TRANSFORM, "merge", "refine", "cage", "element")
"""Of a mesh."""


def build_mesh(table: Any, field: str, folder: Path, model: Model) -> Mesh:
    """The mesh that a table describes.

    Args:
        table: the value of `mesh`.
        field: its path, as body[0].mesh.
        folder: the scene file's, from where `file` is found.
        model: of the body; a bare net of `points` takes its springs.

    Raises:
        FieldError: the key with its path, its value, and what to do.
    """
    check_keys(table, field, KEYS)
    source = checks.exactly_one(field, {key: table.get(key) for key in SOURCES})
    with inside(field):
        transform = placing(table)
        merge = _merge(table, source)
    cells = None
    if "cage" in table:
        cells = scene_cage.cage_keys(table["cage"], joined(field, "cage"))
    path = joined(field, source)
    try:
        if cells and source == "file" and scene_cage.is_surface(table["file"]):
            mesh = read_beside(
                path, table["file"], folder, lambda f: scene_cage.cage_of_file(f, cells, transform)
            )
            return mesh if {"scale", "units"} & table.keys() else _questioned(mesh)
        if source == "file":
            mesh = read_beside(path, table["file"], folder, _read_mesh)
        elif source == "points":
            mesh = _net(path, table["points"], model)
        else:
            mesh = _shape(path, table[source], SHAPES[source])
        if any(key in table for key in TRANSFORM):
            path = field
            mesh = mesh.transformed(**transform)
        if source == "file" and not {"scale", "units"} & table.keys():
            mesh = _questioned(mesh)
        if merge is not False:
            path = field
            mesh = merged(mesh, None if merge is True else merge)
        if "refine" in table:
            path = joined(field, "refine")
            mesh = _refined(path, table["refine"], mesh)
        if cells:
            path = joined(field, "cage")
            mesh = scene_cage.cage_of_mesh(mesh, cells)
        if "element" in table:
            path = joined(field, "element")
            mesh = _of_element(path, table["element"], mesh)
        return mesh
    except MeshError as error:
        told = str(error).removeprefix(f"{folder / str(table[source])}: ")
        if source == "file" and not cells and scene_cage.is_surface(table["file"]):
            told += "; or give cage = { cells_across = 6 } beside it, which puts hexes around it"
        problem = f"makes no cage: {told}" if cells else f"is no usable mesh: {told}"
        raise FieldError(path, problem, table["cage" if cells else source]) from None


ELEMENTS = ("tet4", "tet10", "hex8")


def _of_element(field: str, value: Any, mesh: Mesh) -> Mesh:
    """The mesh, its linear tets made quadratic where that is wanted."""
    wanted = checks.choice(field, value, ELEMENTS)
    if isinstance(mesh, TetMesh) and wanted == "tet10":
        return quadratic(mesh)
    if wanted in mesh.cells:
        return mesh
    has = ", ".join(mesh.cells) or "springs alone"
    remedy = 'split = "hex" makes hexes of a shape' if wanted == "hex8" else "leave the key out"
    raise FieldError(field, f"cannot be had: the mesh has {has}; {remedy}", value)


def _refined(field: str, value: Any, mesh: Mesh) -> Mesh:
    """The mesh with its tets cut into eight, `value` times over."""
    times = checks.integer(field, value)
    if mesh.elements * 8.0**times > MOST_ELEMENTS:
        raise FieldError(field, f"makes more than {MOST_ELEMENTS:,} tets; take less", value)
    if times and not isinstance(mesh, TetMesh):
        raise FieldError(field, "cuts linear tets, and this mesh has none; leave it out", value)
    return refined(mesh, times)


def _scale(table: Table) -> float:
    """Metres in the mesh's own unit of length."""
    if "units" in table:
        if "scale" in table:
            raise FieldError(
                "units", "and scale exclude each other: both turn the file into metres"
            )
        return UNITS[checks.choice("units", table["units"], list(UNITS))]
    return checks.number("scale", table.get("scale", 1.0), above=0.0)


def _merge(table: Table, source: str) -> bool | float:
    """Whether nodes in one place are merged, or the distance [m] within which they are."""
    value = table.get("merge", False)
    if isinstance(value, bool):
        merge: bool | float = value
    else:
        merge = checks.number("merge", value, above=0.0, unit="m", remedy="or true or false")
    if merge is not False and source != "file":
        raise FieldError("merge", "joins nodes of mesh files; shapes are joined already", value)
    return merge


def _questioned(mesh: Mesh) -> Mesh:
    """The mesh, with a question where its size is none that bodies usually have in metres."""
    size = float(np.ptp(mesh.points, axis=0).max())
    if SMALL <= size <= LARGE:
        return mesh
    told = (
        f"is {size:.3g} m large: is the file in metres? If not, say so in [body.mesh], as "
        'units = "mm" (or scale), else units = "m"'
    )
    return replace(mesh, questions=(told,))


def placing(table: Table) -> dict[str, Any]:
    """How a mesh is put into its place."""
    nothing = (0.0, 0.0, 0.0)
    return {
        "scale": _scale(table),
        "rotate": checks.vector("rotate", table.get("rotate", nothing), unit="degrees"),
        "translate": checks.vector("translate", table.get("translate", nothing), unit="m"),
    }


def build_skin(body: Table, field: str, folder: Path, mesh: Mesh) -> Skin:
    """The skin of a body's table, which is put into its place as the body's mesh is.

    Raises:
        FieldError: the key with its path, its value, and what to do.
    """
    table, field = body["skin"], joined(field, "skin")
    check_keys(table, field, ("file",))
    if "file" not in table:
        raise FieldError(
            joined(field, "file"), "is missing; name a surface file (.obj, .ply, .stl)"
        )
    if isinstance(mesh, SpringNet):
        raise FieldError(field, "is carried by tets, and this body has springs alone; remove it")
    path, name = joined(field, "file"), table["file"]
    try:
        return read_beside(
            path, name, folder, lambda file: read_skin(file, mesh, **placing(body["mesh"]))
        )
    except MeshError as error:
        told = str(error).removeprefix(f"{folder / str(name)}: ")
        raise FieldError(path, f"is no usable skin: {told}", name) from None


def _read_mesh(path: Path) -> Mesh:
    from tisoft.geometry.files import read_mesh  # meshio is slow to import

    return read_mesh(path)


def read_beside(field: str, name: Any, folder: Path, read: Callable[[Path], Any]) -> Any:
    """What `read` makes of a file that lies beside the scene's."""
    if not isinstance(name, str) or not name.isprintable() or not name:
        raise FieldError(field, 'must be the name of a mesh file, as "jelly.vtu"', name)
    try:
        path = folder / Path(name).expanduser()
    except RuntimeError:
        raise FieldError(field, "names a home that is not known; write it out", name) from None
    try:
        if path.is_dir():
            raise FieldError(field, "is a folder; name a mesh file in it", name)
        if not path.exists():
            problem = f"is not found; looked in {path.parent}, the path counts from the scene file"
            raise FieldError(field, problem, name)
        if not path.is_file():
            raise FieldError(field, "is a device or a pipe; name a mesh file", name)
        return read(path)
    except OSError as error:
        raise FieldError(field, f"cannot be read: {error.strerror or error}", name) from None


def _net(field: str, value: Any, model: Model) -> Mesh:
    rows = checks.sequence(field, value, "positions [x, y, z]")
    points = [checks.vector(f"{field}[{i}]", row) for i, row in enumerate(rows)]
    if not points:
        raise FieldError(field, "has no positions; give rows [x, y, z]", value)
    if not isinstance(model, MassSpring) or isinstance(model.springs, str):
        problem = 'needs model = "mass-spring" and rows of springs beside it, as springs = [[0, 1]]'
        raise FieldError(field, problem)
    _check_nodes(model.springs, len(points))
    return shapes.net(points, model.springs)


def _check_nodes(springs: Any, count: int) -> None:
    wrong = np.argwhere(springs >= count)
    if len(wrong):
        row, end = (int(k) for k in wrong[0])
        problem = f"is no point of the mesh: the highest is {count - 1}, counted from 0"
        raise FieldError(f"springs[{row}][{end}]", problem, int(springs[row, end]))


def _shape(field: str, table: Any, shape: Shape) -> Mesh:
    check_keys(table, field, shape.check)
    keys = {}
    for key, check in shape.check.items():
        if key in table:
            keys[key] = check(joined(field, key), table[key])
        elif key not in shape.optional:
            raise FieldError(joined(field, key), "is missing")
    count = shape.count(keys)
    if count > MOST_ELEMENTS:
        problem = f"makes {count:.3g} elements, more than {MOST_ELEMENTS:,}; take a coarser mesh"
        _refuse(field, keys, shape.largest(keys), problem)
    if shape.make is shapes.box:
        _check_flat(field, keys)
    return shape.make(**keys)


def _check_flat(field: str, keys: Table) -> None:
    """Refuse cells of a box that are too flat for tets, before there are millions of them."""
    size, cells = keys["size"], keys["cells"]
    axis = shapes.flat_axis(size, cells)
    if axis is None:
        return
    sides = " x ".join(f"{s / n:.3g}" for s, n in zip(size, cells, strict=True))
    problem = f"makes cells of {sides} m, too flat for tets"
    alone = [1 if i == axis else n for i, n in enumerate(cells)]
    if shapes.flat_axis(size, alone) is None:
        _refuse(field, keys, f"cells[{axis}]", f"{problem}; give fewer, or more along the others")
    _refuse(field, keys, f"size[{axis}]", f"{problem}; give a larger one, or more cells elsewhere")


def _refuse(field: str, keys: Table, key: str, problem: str) -> NoReturn:
    name, _, index = key.partition("[")
    value = keys[name][int(index[:-1])] if index else keys[name]
    raise FieldError(joined(field, key), problem, value)
