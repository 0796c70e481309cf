"""The key `cage` of [body.mesh]: hexahedra around a closed surface, or around a mesh of tets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tisoft import checks
from tisoft.checks import inside
from tisoft.errors import MeshError
from tisoft.geometry.mesh import Mesh, TetMesh
from tisoft.geometry.moving import moved
from tisoft.geometry.solid import SolidMesh
from tisoft.geometry.surface import SUFFIXES
from tisoft.scene_keys import Table, check_keys

KEYS = ("size", "cells_across")


def cage_keys(table: Any, field: str) -> Table:
    """The cells that a cage is to have, checked.

    Raises:
        FieldError: the key with its path, its value, and what to do.
    """
    check_keys(table, field, KEYS)
    with inside(field):
        key = checks.exactly_one("", {key: table.get(key) for key in KEYS})
        if key == "size":
            return {key: checks.number(key, table[key], above=0.0, unit="m")}
        return {key: checks.integer(key, table[key], least=1)}


def is_surface(name: Any) -> bool:
    """Whether a file of this name holds a surface."""
    return isinstance(name, str) and Path(name).suffix.lower() in SUFFIXES


def cage_of_file(path: Path, cells: Table, transform: Table) -> SolidMesh:
    """The cage of a surface file that is put into its place.  Raises MeshError."""
    from tisoft.geometry.cage.build import cage
    from tisoft.geometry.surface import read_surface

    points, triangles = read_surface(path)
    return cage(moved(points, **transform), triangles, **cells)


def cage_of_mesh(mesh: Mesh, cells: Table) -> SolidMesh:
    """The cage of a mesh's surface.  Raises MeshError."""
    from tisoft.geometry.cage.build import cage

    if not isinstance(mesh, TetMesh):
        raise MeshError("a cage needs a closed surface, or a mesh of tets that has one")
    return cage(mesh.points, mesh.surface, **cells)
