"""Checks of a user's values: one sentence that names the field, the value and the remedy.

A field is named relative to the object that holds it ("poisson"); whoever holds that object puts
its own name in front (`FieldError.inside`), so that a scene file can say `body[0].poisson`.
"""

from __future__ import annotations

import difflib
import itertools
import json
import math
import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import SceneError

Vector = tuple[float, float, float]
Timeline = tuple[tuple[float, ...], ...]

LARGEST = 1e100
"""Numbers beyond this are refused: their cubes, as a volume's, would leave the range of floats."""

_ABSENT: Any = object()


class FieldError(SceneError):
    """A value that cannot be used: `field` is its name, `problem` the rest of the sentence."""

    def __init__(self, field: str, problem: str, value: Any = _ABSENT) -> None:
        self.field = field
        self.problem = problem
        self.value = value
        given = "" if value is _ABSENT else f" = {shown(value)}"
        super().__init__(f"{field}{given} {problem}".lstrip())

    @property
    def has_value(self) -> bool:
        """Whether the sentence shows a value."""
        return self.value is not _ABSENT

    def inside(self, holder: str) -> FieldError:
        """The same error, seen from `holder`: field "poisson" in "body[0]" is "body[0].poisson"."""
        return FieldError(joined(holder, self.field), self.problem, self.value)


@contextmanager
def inside(holder: str) -> Iterator[None]:
    """Put `holder` in front of the field of every FieldError raised here."""
    try:
        yield
    except FieldError as error:
        raise error.inside(holder) from None


def joined(holder: str, field: str) -> str:
    """The path of a field of `holder`; either may be empty, and indices need no dot."""
    dot = "." if holder and field and not field.startswith("[") else ""
    return f"{holder}{dot}{field}"


def shown(value: Any, depth: int = 3) -> str:
    """A value as a user would write it in TOML: one line, short, whatever it is."""
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value if len(value) <= 60 else value[:57] + "…", ensure_ascii=False)
    if isinstance(value, (dict, list, tuple)):
        if depth == 0:
            return "…"
        parts = list(itertools.islice(value, 6))
        if isinstance(value, dict):
            texts = [f"{shown_key(str(key))} = {shown(value[key], depth - 1)}" for key in parts]
        else:
            texts = [shown(part, depth - 1) for part in parts]
        text = ", ".join(texts + ["…"] * (len(value) > len(parts)))
        return f"{{ {text} }}" if isinstance(value, dict) else f"[{text}]"
    if isinstance(value, type):
        return f"the class {value.__name__}"
    try:
        text = str(value)
    except ValueError:  # an integer of more digits than Python cares to print
        return "a number of thousands of digits"
    if re.search(" at 0x|<", text):  # what Python shows by its kind and address
        return f"a {type(value).__name__}"
    return " ".join((text if len(text) <= 100 else text[:97] + "…").split())


def shown_key(key: str) -> str:
    """A key as TOML writes it: bare where it can be, else quoted."""
    return key if re.fullmatch(r"[A-Za-z0-9_-]{1,60}", key) else shown(key)


def suggestion(wrong: str, right: Iterable[str]) -> str:
    """What was meant, perhaps: the nearest of `right`, else all of them."""
    known = list(right)
    near = difflib.get_close_matches(wrong.lower()[:60], known, n=1, cutoff=0.6)
    return f"did you mean {near[0]}?" if near else f"use one of {', '.join(known)}"


def _limits(least: float, above: float, most: float, below: float) -> str:
    parts = []
    if least > -math.inf:
        parts.append(f"at least {least:g}")
    if above > -math.inf:
        parts.append(f"above {above:g}")
    if most < math.inf:
        parts.append(f"at most {most:g}")
    if below < math.inf:
        parts.append(f"below {below:g}")
    return " and ".join(parts)


def number(
    field: str,
    value: Any,
    *,
    least: float = -math.inf,
    above: float = -math.inf,
    most: float = math.inf,
    below: float = math.inf,
    unit: str = "",
    remedy: str = "",
) -> float:
    """The value as a float: finite, least <= or above < it, <= most or < below.

    Raises:
        FieldError: with the range, the unit and the remedy.
    """
    what = f"a number in {unit}" if unit else "a number"
    if isinstance(value, bool) or not isinstance(value, Real):
        quotes = "; drop the quotes" if _reads_as_number(value) else ""
        raise FieldError(field, f"must be {what}, not {_kind(value)}{quotes}", value)
    try:
        result = float(value)
    except OverflowError:
        result = math.inf
    if not abs(result) <= LARGEST:
        problem = f"must be {what} that is finite and at most {LARGEST:g} in size"
        raise FieldError(field, problem, value)
    if not (least <= result <= most and above < result < below):
        limits = f"must be {_limits(least, above, most, below)}{f' {unit}' if unit else ''}"
        raise FieldError(field, f"{limits}{f'; {remedy}' if remedy else ''}", value)
    return result


def _reads_as_number(value: Any) -> bool:
    try:
        return isinstance(value, str) and math.isfinite(float(value))
    except ValueError:
        return False


def _kind(value: Any) -> str:
    """The sort of thing that a value is, in a user's words."""
    if isinstance(value, bool):
        return "true or false"
    if isinstance(value, str):
        return "text"
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim):
        return "a list"
    if value is None:
        return "nothing"
    return "a number" if isinstance(value, Real) else f"a {type(value).__name__}"


def integer(field: str, value: Any, *, least: int = 0, most: int = 2**31 - 1) -> int:
    """The value as a whole number with least <= it <= most."""
    if isinstance(value, bool) or not isinstance(value, Integral):
        kind = "one with a point" if isinstance(value, float) else _kind(value)
        raise FieldError(field, f"must be a whole number, not {kind}", value)
    if not least <= int(value) <= most:
        raise FieldError(field, f"must be at least {least} and at most {most}", value)
    return int(value)


def flag(field: str, value: Any) -> bool:
    """The value as true or false."""
    if not isinstance(value, (bool, np.bool_)):
        raise FieldError(field, f"must be true or false, not {_kind(value)}", value)
    return bool(value)


def choice(field: str, value: Any, options: Sequence[str]) -> str:
    """The value as one of the words in `options`."""
    if not isinstance(value, str):
        raise FieldError(field, f"must be one of {', '.join(options)}, not {_kind(value)}", value)
    if value not in options:
        raise FieldError(field, f"is not known; {suggestion(value, options)}", value)
    return value


def name(field: str, value: Any) -> str:
    """The value as a name that is safe in a table's header and in a file's name."""
    if not isinstance(value, str):
        raise FieldError(field, f"must be text, not {_kind(value)}", value)
    if not 0 < len(value) <= 100 or not value.isprintable() or set(value) & set("/\\"):
        remedy = "must be 1 to 100 printable characters, none of them / or \\"
        raise FieldError(field, remedy, value)
    return value


def sequence(field: str, value: Any, what: str) -> Sequence[Any]:
    """The value as a sequence; `what` says of what, for the message."""
    is_array = isinstance(value, np.ndarray) and value.ndim > 0
    is_words = isinstance(value, (str, bytes, bytearray, memoryview))
    if is_words or not (is_array or isinstance(value, Sequence)):
        raise FieldError(field, f"must be a list of {what}, not {_kind(value)}", value)
    return value if isinstance(value, Sequence) else value.tolist()


def numbers(field: str, value: Any, count: int, what: str, **limits: Any) -> tuple[float, ...]:
    """The value as `count` numbers, each within the limits of `number`."""
    items = sequence(field, value, what)
    if len(items) != count:
        raise FieldError(field, f"must be {count} {what}, not {len(items)}", value)
    return tuple(number(f"{field}[{i}]", item, **limits) for i, item in enumerate(items))


def vector(field: str, value: Any, **limits: Any) -> Vector:
    """The value as three numbers (x, y, z)."""
    x, y, z = numbers(field, value, 3, "numbers (x, y, z)", **limits)
    return x, y, z


def corner(field: str, value: Any) -> Vector:
    """The value as three numbers (x, y, z), which may be infinite."""
    items = sequence(field, value, "numbers (x, y, z)")
    open_sides = [isinstance(item, float) and math.isinf(item) for item in items]
    finite = [0.0 if is_open else item for item, is_open in zip(items, open_sides, strict=True)]
    known = vector(field, finite)
    x, y, z = (float(a) if b else k for a, b, k in zip(items, open_sides, known, strict=True))
    return x, y, z


def direction(field: str, value: Any) -> Vector:
    """The value as a unit vector; one that is such already keeps its bits."""
    given = vector(field, value)
    if abs(math.hypot(*given) - 1.0) <= 1e-15:
        return given
    largest = max(abs(c) for c in given)
    if largest == 0.0:
        raise FieldError(field, "has no direction; give one, as (0, 1, 0) for up", value)
    scaled = [c / largest for c in given]  # no overflow, no underflow in the squares
    length = math.hypot(*scaled)
    return scaled[0] / length, scaled[1] / length, scaled[2] / length


def timeline(field: str, value: Any, width: int, what: str) -> Timeline:
    """The value as rows of `width` numbers whose first, the time [s], grows from row to row."""
    rows = sequence(field, value, f"rows {what}")
    if not rows:
        raise FieldError(field, f"has no rows; give {what}", value)
    result = [numbers(f"{field}[{i}]", row, width, f"numbers {what}") for i, row in enumerate(rows)]
    if result[0][0] < 0.0:
        raise FieldError(f"{field}[0][0]", "must be a time of at least 0 s", result[0][0])
    for i in range(1, len(result)):
        before, now = result[i - 1][0], result[i][0]
        if now <= before:
            problem = f"goes back in time, or stands still: the row before is at {before:g} s"
            raise FieldError(f"{field}[{i}][0]", problem, now)
    return tuple(result)


def exactly_one(field: str, given: dict[str, Any]) -> str:
    """The one key of `given` whose value is not None."""
    present = [key for key, value in given.items() if value is not None]
    if len(present) == 1:
        return present[0]
    options = ", ".join(given)
    if present:
        raise FieldError(joined(field, present[1]), f"and {present[0]} exclude each other")
    raise FieldError(field, f"needs one of {options}")


def array(field: str, value: Any, check: Callable[[str, Any], float]) -> NDArray[np.float64]:
    """The value as an array (n,) of numbers, each of which passes `check`."""
    items = sequence(field, value, "numbers")
    return np.array([check(f"{field}[{i}]", item) for i, item in enumerate(items)], dtype=float)


def floats(field: str, value: Any, shape: tuple[Any, ...], what: str) -> NDArray[np.float64]:
    """The value as an array of finite real numbers of a shape: −1 in it stands for any length, … at
    its end for any further ones; `what` says of what, for the message.
    """
    try:
        found = np.asarray(value)
    except (ValueError, TypeError):  # rows of different lengths
        found = np.empty(0, object)
    wanted = "(" + ", ".join({-1: "n", ...: "…"}.get(a, str(a)) for a in shape) + ")"
    if found.dtype.kind not in "iuf" and found.size:
        kind = f"numbers of type {found.dtype}" if found.dtype.kind in "cb" else "rows of any kind"
        raise FieldError(field, f"must be {what}, an array of shape {wanted}, not {kind}")
    leading = shape[:-1] if ... in shape else shape
    fits = found.ndim == len(shape) if leading is shape else found.ndim >= len(leading)
    fits = fits and all(b in (a, -1) for a, b in zip(found.shape, leading, strict=False))
    if not fits:
        problem = f"must be {what}, an array of shape {wanted}, not of shape {found.shape}"
        raise FieldError(field, problem)
    numbers = found.astype(np.float64)
    wrong = np.argwhere(~(np.abs(numbers) <= LARGEST))
    if len(wrong):
        place = "".join(f"[{k}]" for k in wrong[0])
        problem = f"must be a number that is finite and at most {LARGEST:g} in size"
        raise FieldError(field + place, problem, float(numbers[tuple(wrong[0])]))
    return numbers


def path(field: str, value: Any, what: str = "a file") -> Path:
    """The value as the path of a file or a folder."""
    if not isinstance(value, (str, os.PathLike)) or not isinstance(os.fspath(value), str):
        raise FieldError(field, f"must be the name of {what}, not {_kind(value)}", value)
    if "\0" in os.fspath(value) or not os.fspath(value):
        raise FieldError(field, f"must be the name of {what}", os.fspath(value))
    return Path(value)


def put(part: Any, field: str, value: Any) -> None:
    """Keep a checked value in a frozen dataclass, while it is being made."""
    object.__setattr__(part, field, value)


def keep_number(part: Any, field: str, **limits: Any) -> None:
    """Check a number of a frozen dataclass, as `number` does, and keep it as a float."""
    put(part, field, number(field, getattr(part, field), **limits))
