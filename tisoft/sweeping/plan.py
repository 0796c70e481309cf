"""What a sweep varies: keys with their values, and the settings of each row.

All combinations of the listed values, in the order of an odometer; or N draws, uniform between the
ends of a range, and uniform in the logarithm where both are positive and a factor of 10 apart.
"""

from __future__ import annotations

import itertools
import json
import math
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tisoft.checks import FieldError, shown
from tisoft.errors import SceneError
from tisoft.models.materials import MODELS
from tisoft.scene_keys import field_names, toml_value

MOST_ROWS = 1_000_000
MOST, MOST_WHOLE = 1e100, 2.0**53
"""Size of the ends of a range, and of those between which whole numbers are drawn."""
_NUMBER = r"[-+]?(?:\d[\d_]*(?:\.\d+)?(?:[eE][-+]?\d+)?)"
_RANGE = re.compile(rf"({_NUMBER})\.\.({_NUMBER})")
_OF_BODIES = {"model", "velocity", "spin", "material", "lame_lambda", "lame_mu"}.union(
    *(field_names(cls) for cls in MODELS.values())
)
"""Keys that may be given without body.N: they are every body's."""


@dataclass(frozen=True)
class Axis:
    """A key and the values it takes, as TOML texts; or a range that is drawn from."""

    key: str
    values: tuple[str, ...]
    range: tuple[float, float] | None = None
    whole: bool = False
    """Whether the ends of the range are whole numbers, and so the draws are."""


@dataclass(frozen=True)
class Plan:
    """All rows of a sweep."""

    axes: tuple[Axis, ...]
    rows: tuple[tuple[str, ...], ...]
    """Values of each row, a TOML text for each axis."""

    def settings(self, row: Sequence[str], bodies: int) -> list[str]:
        """A row as --set takes it; a key of bodies without their number is every body's."""
        made = []
        for axis, value in zip(self.axes, row, strict=True):
            head = re.split(r"[.\[]", axis.key)[0]
            own = head in _OF_BODIES or head in ("mesh", "pin", "load")
            keys = [f"body.{i}.{axis.key}" for i in range(bodies)] if own else [axis.key]
            made += [f"{key}={value}" for key in keys]
        return made


def axis_of(text: str) -> Axis:
    """An axis from KEY=V1,V2,… or KEY=LOW..HIGH; raises SceneError."""
    key, equals, values = text.partition("=")
    texts = split(values)
    if not equals or not key.strip() or not any(texts):
        raise SceneError(f"--over {shown(text)}: write KEY=V1,V2,… as young=1e4,1e5")
    if "" in texts:
        raise SceneError(
            f"--over {shown(text)}: value {texts.index('') + 1} of {len(texts)} is empty; "
            "write it, or take out a comma"
        )
    return _axis(key.strip(), texts)


def axes_of_file(path: str) -> list[Axis]:
    """The axes of a TOML file: each key a list of values, or a range as "1e4..1e6"."""
    try:
        document = tomllib.loads(Path(path).read_text("utf-8"))
    except OSError as error:
        raise SceneError(f"--over {path} cannot be read: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SceneError(f"--over {path} is not valid TOML: {error}") from None
    return axes_of(dict(_flat(document)))


def axes_of(over: Mapping[str, Any]) -> list[Axis]:
    """Axes from Python: each key with a list of values, or a range as "1e4..1e6"."""
    made = []
    for key, values in over.items():
        if not isinstance(key, str):
            raise FieldError("over", f"has a key that is no text: {shown(key)}; give a scene's key")
        if isinstance(values, str | int | float | bool):
            values = [values]
        if not isinstance(values, Iterable) or not list(values):
            raise FieldError(f"over[{shown(key)}]", "must be a list of values, one or more", values)
        items = [np.asarray(v).tolist() if isinstance(v, np.ndarray) else v for v in values]
        texts = [
            v if isinstance(v, str) and _RANGE.fullmatch(v.strip()) else as_toml(v) for v in items
        ]
        made.append(_axis(key, texts))
    return made


def plan_of(axes: Sequence[Axis], *, random: int | None = None, seed: int = 0) -> Plan:
    """The rows of a sweep; raises SceneError."""
    if not axes:
        raise SceneError("nothing to sweep over; give --over KEY=V1,V2,… as young=1e4,1e5")
    keys = [axis.key for axis in axes]
    for key in keys:
        if keys.count(key) > 1:
            raise SceneError(f"--over {key} is given twice; put its values into one list")
    if random is not None:
        if random < 1:
            raise SceneError(f"--random is {random}; give the number of rows, as 100")
        if random > MOST_ROWS:
            raise SceneError(f"--random is {random:,}, more than {MOST_ROWS:,} rows; give fewer")
        if seed < 0:
            raise SceneError(f"--seed is {seed}; give a whole number, 0 or above")
        rng = np.random.default_rng(seed)
        rows = [tuple(_draw(axis, rng) for axis in axes) for _ in range(random)]
        return Plan(tuple(axes), tuple(rows))
    for axis in axes:
        if axis.range is not None:
            low, high = axis.range
            problem = f"--over {axis.key}={low:g}..{high:g} is a range, which is drawn from"
            raise SceneError(f"{problem}; add --random N")
    count = math.prod(len(axis.values) for axis in axes)
    if count > MOST_ROWS:
        problem = f"--over makes {count:,} rows, more than {MOST_ROWS:,}"
        raise SceneError(f"{problem}; give fewer values, or --random N")
    return Plan(tuple(axes), tuple(itertools.product(*(axis.values for axis in axes))))


def split(text: str) -> list[str]:
    """A text at its commas outside of brackets and quotes; empty where nothing is between them."""
    parts, depth, quote = [""], 0, ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        elif letter in "[{":
            depth += 1
        elif letter in "]}":
            depth -= 1
        if letter == "," and not depth and not quote:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts]


def as_toml(value: Any) -> str:
    """A plain value as TOML text."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {as_toml(v)}" for key, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(as_toml(v) for v in value) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)


def _axis(key: str, texts: list[str]) -> Axis:
    ranges = [_RANGE.fullmatch(text.strip()) for text in texts]
    if len(ranges) == 1 and ranges[0] is not None:
        low, high = (float(end) for end in ranges[0].groups())
        if not low < high:
            raise SceneError(f"--over {key}={texts[0]}: the range must ascend, as 1e4..1e6")
        if not max(-low, high) <= MOST:
            raise SceneError(f"--over {key}={texts[0]}: the ends may be {MOST:g} in size at most")
        whole = all(isinstance(toml_value(end), int) for end in ranges[0].groups())
        whole = whole and max(-low, high) < MOST_WHOLE
        return Axis(key, (), (low, high), whole)
    if any(ranges):
        raise SceneError(f"--over {key}: give either one range, or values; not both")
    return Axis(key, tuple(texts))


def _draw(axis: Axis, rng: np.random.Generator) -> str:
    if axis.range is None:
        return axis.values[int(rng.integers(len(axis.values)))]
    low, high = axis.range
    if axis.whole:
        return str(int(rng.integers(int(low), int(high) + 1)))
    if low > 0.0 and high >= 10.0 * low:
        return repr(float(np.exp(rng.uniform(np.log(low), np.log(high)))))
    return repr(float(rng.uniform(low, high)))


def _flat(table: Mapping[str, Any], holder: str = "") -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    for key, value in table.items():
        path = f"{holder}.{key}" if holder else key
        found += _flat(value, path) if isinstance(value, dict) else [(path, value)]
    return found
