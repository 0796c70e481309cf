"""Checkpoints: a whole simulation in one file, from which it goes on bit by bit.

A checkpoint is an .npz archive: the scene as JSON (only the dataclasses of a scene, named; no
code), its arrays, and the state; after it come the 32 bytes of its SHA-256, so that no flipped bit
goes unseen.  It appears whole under its name, or not at all.
"""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
import os
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import loads, pins, scene, scene_parts, where
from tisoft.body import Body
from tisoft.errors import SceneError
from tisoft.geometry import groups
from tisoft.geometry.cage.build import Cage
from tisoft.geometry.cage.lattice import Lattice
from tisoft.geometry.mesh import SolidMesh, SpringNet, TetMesh
from tisoft.geometry.skin import Skin
from tisoft.models import materials
from tisoft.obstacles import OBSTACLES
from tisoft.region_material import RegionMaterial
from tisoft.whole_files import written

VERSION = 7
DIGEST = hashlib.sha256().digest_size

_CLASSES: dict[str, Any] = {
    cls.__name__ if module == "" else f"{module}.{cls.__name__}": cls
    for module, classes in {
        "": (
            scene.Scene, Body, RegionMaterial, TetMesh, SolidMesh, SpringNet, groups.Region,
            groups.NodeSet, Skin, Cage, Lattice, pins.Pin, pins.Turn, loads.Load, loads.Torque,
            *OBSTACLES.values(), scene_parts.Probe,
            scene_parts.NoContact, scene_parts.Camera, scene_parts.Render,
            *materials.MODELS.values(),
        ),
        "where": (
            where.Box, where.HalfSpace, where.Nodes, where.Nearest, where.Everything,
            where.InRegion, where.InSet,
        ),
    }.items()
    for cls in classes
}  # fmt: skip
_DAMAGE = (
    ArithmeticError, AttributeError, EOFError, LookupError, MemoryError, OSError, RuntimeError,
    SyntaxError, TypeError, ValueError, struct.error, tokenize.TokenError, zipfile.BadZipFile,
    zlib.error,
)  # fmt: skip
_NAMES = {cls: name for name, cls in _CLASSES.items()}


def write(path: str | os.PathLike[str], content: Any, arrays: dict[str, NDArray[Any]]) -> None:
    """Write `content` (scene dataclasses, numbers, words, lists, dicts) and named arrays.

    Raises:
        SceneError: when the file cannot be written.
    """
    store = dict(arrays)
    text = json.dumps({"version": VERSION, "content": plain(content, store)})
    store["json"] = np.frombuffer(text.encode(), np.uint8)
    archive = io.BytesIO()
    np.savez(archive, allow_pickle=False, **store)
    data = archive.getbuffer()
    with written(Path(path), durable=True) as file:
        file.write(data)
        file.write(hashlib.sha256(data).digest())


def read(path: str | os.PathLike[str]) -> tuple[Any, dict[str, NDArray[Any]]]:
    """What `write` wrote.

    Raises:
        SceneError: a file that is missing, damaged, or no checkpoint of this version.
    """
    try:
        data = Path(path).read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        reason = getattr(error, "strerror", None) or error
        raise SceneError(f"cannot read the checkpoint {path}: {reason}") from None
    archive, digest = data[:-DIGEST], data[-DIGEST:]
    whole = hashlib.sha256(archive).digest() == digest
    with damage_told(path):
        with np.load(io.BytesIO(archive if whole else data), allow_pickle=False) as file:
            version = json.loads(file["json"].tobytes())["version"]
            if version != VERSION:
                raise SceneError(
                    f"{path} is a checkpoint of version {version!r}, and this tisoft reads "
                    f"{VERSION}; run the scene anew, or go on with the tisoft that wrote it"
                )
            if not whole:
                raise ValueError("the checksum differs")
            store = {name: file[name] for name in file.files}
        return _made(json.loads(store.pop("json").tobytes())["content"], store), store


@contextmanager
def damage_told(path: str | os.PathLike[str]) -> Iterator[None]:
    """Tell in a sentence what goes wrong when content that is no checkpoint's is used."""
    try:
        yield
    except SceneError:
        raise
    except _DAMAGE as error:
        raise SceneError(f"{path} is damaged or no checkpoint; run the scene anew") from error


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
