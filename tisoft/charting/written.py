"""A scene file with settings as a file of its own."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tisoft.scene_file import document_of


def moved_document(source: str | Path, settings: Sequence[str], target: Path) -> dict[str, Any]:
    """The tables of a scene file with settings; files are named as seen from `target`."""
    document = document_of(source, settings)
    _rename(document, Path(source).resolve().parent, target.resolve().parent)
    return document


def _rename(value: Any, before: Path, after: Path) -> None:
    if isinstance(value, dict):
        name = value.get("file")
        if isinstance(name, str) and before != after:
            value["file"] = Path(os.path.relpath(before / name, after)).as_posix()
        for item in value.values():
            _rename(item, before, after)
    elif isinstance(value, list):
        for item in value:
            _rename(item, before, after)


def as_toml(document: dict[str, Any]) -> str:
    """The tables as TOML: [[…]] for lists of tables, [body.mesh] and the like as tables."""
    return "\n".join(_table(document, "")).strip("\n") + "\n"


def _table(table: dict[str, Any], name: str) -> list[str]:
    plain = {k: v for k, v in table.items() if not _is_block(v, name)}
    lines = [f"{_key(k)} = {_value(v)}" for k, v in plain.items()]
    for key, value in table.items():
        if key in plain:
            continue
        path = f"{name}.{_key(key)}" if name else _key(key)
        for own in value if isinstance(value, list) else [value]:
            head = f"[[{path}]]" if isinstance(value, list) else f"[{path}]"
            lines += ["", head, *_table(own, path)]
    return lines


def _is_block(value: Any, name: str) -> bool:
    """Whether it has a heading of its own: lists of tables, and tables down to [body.mesh]."""
    if isinstance(value, dict):
        return name.count(".") < 1
    return isinstance(value, list) and bool(value) and all(isinstance(v, dict) for v in value)


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else json.dumps(key)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0.0 else "-inf"
    return repr(value)
