"""How a parsed TOML document becomes objects: known keys only, and each error with its path.

Keys are the fields of the dataclass that a table describes, so the dataclasses' own checks serve
scene files too; here is only what a file has beyond them.
"""

from __future__ import annotations

import dataclasses
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self, TypeVar

from tisoft.checks import FieldError, inside, joined, sequence, shown_key, suggestion

Table = dict[str, Any]
Made = TypeVar("Made")


class Written(float):
    """A number that remembers how it was written, for messages."""

    def __new__(cls, text: str) -> Self:
        number = super().__new__(cls, text)
        number.text = text
        return number

    text: str

    def __repr__(self) -> str:
        return self.text


def parse_toml(text: str) -> Table:
    """The document; raises ValueError or RecursionError."""
    return tomllib.loads(text, parse_float=Written)


def check_keys(
    table: Any, field: str, known: Iterable[str], inner: Mapping[str, Iterable[str]] | None = None
) -> Table:
    """The table, whose keys must all be known; `inner` tells keys of the tables in it."""
    if not isinstance(table, dict):
        raise FieldError(field, "must be a table of keys, as { key = value }", table)
    known = list(known)
    for key, value in table.items():
        if key not in known:
            place = next((name for name, keys in (inner or {}).items() if key in keys), None)
            meant = f"it belongs in {place}, as {place} = {{ …, {key} = … }}" if place else ""
            problem = f"is not a key that tisoft knows; {meant or suggestion(key, known)}"
            raise FieldError(joined(field, shown_key(key)), problem, value)
    return table


def field_names(cls: type[Any]) -> list[str]:
    """The keys that a dataclass takes."""
    return [field.name for field in dataclasses.fields(cls) if field.init]


def make(cls: type[Made], table: Any, field: str, **given: Any) -> Made:
    """An object of a dataclass from a table of its fields; `given` are not read from the table."""
    fields = [f for f in dataclasses.fields(cls) if f.name not in given]  # type: ignore[arg-type]
    check_keys(table, field, [f.name for f in fields])
    for f in fields:
        required = f.default is f.default_factory is dataclasses.MISSING
        if required and f.name not in table:
            raise FieldError(joined(field, f.name), "is missing")
    with inside(field):
        return cls(**given, **table)


def tables(document: Table, key: str, holder: str = "") -> list[tuple[str, Any]]:
    """The (path, table) of every table of an array like [[body]]; none where the key is absent."""
    field = joined(holder, key)
    value = document.get(key, [])
    if isinstance(value, dict):
        plain = re.sub(r"\[\d+\]", "", field)
        raise FieldError(field, f"must be a list of tables; write [[{plain}]] above its keys")
    return [(f"{field}[{i}]", item) for i, item in enumerate(sequence(field, value, "tables"))]


def look_up(document: Table, field: str) -> Any:
    """The value at a path like body[0].mesh.file; None where there is none."""
    value: Any = document
    for key, index in re.findall(r"([^.\[\]]+)|\[(\d+)\]", field):
        try:
            value = value[int(index)] if index else value[key]
        except (KeyError, IndexError, TypeError):
            return None
    return value


def override(document: Table, assignment: str) -> None:
    """Put a KEY=VALUE of the command line into the document, as body.0.young=2e5.

    KEY may also be written body[0].young; VALUE is a TOML value, else a string.

    Raises:
        FieldError: for a malformed KEY, an index out of range, or a key below a plain value.
    """
    path, equals, text = assignment.partition("=")
    if not equals or not re.fullmatch(r"\s*[^\s.\[\]]+(\.[^\s.\[\]]+|\[\d+\])*\s*", path):
        raise FieldError("", "it must be KEY=VALUE, as body.0.young=2e5")
    steps: list[str] = re.findall(r"[^\s.\[\]]+", path)
    place: Any = document
    for i, step in enumerate(steps):
        last = i + 1 == len(steps)
        if isinstance(place, list):
            index = _index(place, steps[:i], step)
            if last:
                place[index] = toml_value(text)
            else:
                place = place[index]
        elif isinstance(place, dict):
            if last:
                place[step] = toml_value(text)
            else:
                counted = steps[i + 1].isdecimal()
                place = place.setdefault(step, [] if counted else {})
        else:
            raise FieldError(_path(steps[:i]), f"is a single value and has no key {step}", place)


def _index(items: Sequence[Any], before: list[str], step: str) -> int:
    field = _path(before)
    if not step.isdecimal() or len(step) > 9:
        raise FieldError(field, f"is a list: write {field}[0], not {field}.{step}")
    if int(step) >= len(items):
        there = f"the last is {field}[{len(items) - 1}]" if items else "the scene has none"
        raise FieldError(f"{field}[{int(step)}]", f"is out of range: {there}")
    return int(step)


def _path(steps: list[str]) -> str:
    path = ""
    for step in steps:
        path = f"{path}[{step}]" if step.isdecimal() else joined(path, step)
    return path


def toml_value(text: str) -> Any:
    """The text as a TOML value; as itself where it is none."""
    try:
        parsed = parse_toml(f"value = {text}")
    except (ValueError, RecursionError):
        return text.strip()
    return parsed["value"] if list(parsed) == ["value"] else text.strip()
