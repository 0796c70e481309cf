"""Checkpoints: a whole simulation in one file, from which it goes on bit by bit.

A checkpoint is an .npz archive: the scene as JSON (only the dataclasses of a scene, named; no
code), its arrays, and the state.  It appears whole under its name, or not at all.
"""

from __future__ import annotations

import dataclasses
import json
import os
import struct
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import loads, pins, scene, scene_parts, where
from tisoft.body import Body
from tisoft.errors import SceneError
from tisoft.geometry.mesh import SpringNet, TetMesh
from tisoft.geometry.skin import Skin
from tisoft.models import materials

VERSION = 1

_CLASSES: dict[str, Any] = {
    cls.__name__ if module == "" else f"{module}.{cls.__name__}": cls
    for module, classes in {
        "": (
            scene.Scene, Body, TetMesh, SpringNet, Skin,
            pins.Pin, pins.Turn, loads.Load, loads.Torque,
            scene_parts.Plane, scene_parts.Sphere, scene_parts.Box, scene_parts.Probe,
            scene_parts.Camera, scene_parts.Render, *materials.MODELS.values(),
        ),
        "where": (
            where.Box, where.HalfSpace, where.Nodes, where.Nearest, where.Everything,
        ),
    }.items()
    for cls in classes
}  # fmt: skip
_DAMAGE = (
    ArithmeticError, AttributeError, EOFError, LookupError, MemoryError, RuntimeError, TypeError,
    ValueError, struct.error, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
_NAMES = {cls: name for name, cls in _CLASSES.items()}


def write(path: str | os.PathLike[str], content: Any, arrays: dict[str, NDArray[Any]]) -> None:
    """Write `content` (scene dataclasses, numbers, words, lists, dicts) and named arrays.

    Raises:
        SceneError: when the file cannot be written.
    """
    path = Path(path)
    store = dict(arrays)
    text = json.dumps({"version": VERSION, "content": plain(content, store)})
    store["json"] = np.frombuffer(text.encode(), np.uint8)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with open(temporary, "wb") as file:
            np.savez(file, allow_pickle=False, **store)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        raise SceneError(f"cannot write the checkpoint {path}: {error.strerror}") from None
    finally:
        temporary.unlink(missing_ok=True)


def read(path: str | os.PathLike[str]) -> tuple[Any, dict[str, NDArray[Any]]]:
    """What `write` wrote.

    Raises:
        SceneError: a file that is missing, damaged, or no checkpoint of this version.
    """
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as archive:
            store = {name: archive[name] for name in archive.files}
        data = json.loads(store.pop("json").tobytes())
        if data["version"] != VERSION:
            raise SceneError(f"{path} is a checkpoint of version {data['version']}, not {VERSION}")
        return _made(data["content"], store), store
    except OSError as error:
        reason = error.strerror or "it is no checkpoint"
        raise SceneError(f"cannot read the checkpoint {path}: {reason}") from None
    except _DAMAGE:
        raise SceneError(f"{path} is damaged or no checkpoint; run the scene anew") from None


def plain(value: Any, store: dict[str, NDArray[Any]]) -> Any:
    """A value as JSON: scene dataclasses by name and fields; arrays go to the store."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        name = f"array{len(store)}"
        store[name] = value
        return {"array": name}
    if isinstance(value, tuple):
        return {"tuple": [plain(item, store) for item in value]}
    if isinstance(value, list):
        return [plain(item, store) for item in value]
    if isinstance(value, dict):
        return {"dict": {key: plain(item, store) for key, item in value.items()}}
    fields = {
        field.name: plain(getattr(value, field.name), store)
        for field in dataclasses.fields(value)
        if field.init
    }
    return {"type": _NAMES[type(value)], "fields": fields}


def _made(value: Any, store: dict[str, NDArray[Any]]) -> Any:
    if isinstance(value, list):
        return [_made(item, store) for item in value]
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return store.pop(value["array"])
    if "tuple" in value:
        return tuple(_made(item, store) for item in value["tuple"])
    if "dict" in value:
        return {key: _made(item, store) for key, item in value["dict"].items()}
    fields = {key: _made(item, store) for key, item in value["fields"].items()}
    return _CLASSES[value["type"]](**fields)
