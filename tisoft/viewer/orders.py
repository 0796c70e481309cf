"""What a page may ask for: names, types, sizes and ranges.  Nothing else comes through."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

COLORS = ("stress", "strain", "speed", "body", "region")
RECORDS = ("mp4", "gif", "webp", "html")
"""Kinds of files that are recorded to."""
MATERIAL = ("young", "poisson", "phi", "eta", "point_damping", "spring_damping")
"""Numbers of a model that may be changed while it runs."""


class BadOrder(ValueError):
    """A message that no page of ours sends; its connection is ended with these words."""


def _number(lo: float, hi: float) -> Callable[[Any], float]:
    def check(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise BadOrder(f"{str(value)[:40]!r} is not a number")
        if not lo <= value <= hi:  # nor is what is not a number; an int may be beyond all floats
            raise BadOrder(f"{str(value)[:40]} is not between {lo:g} and {hi:g}")
        return float(value)

    return check


def _whole(most: int) -> Callable[[Any], int]:
    def check(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
            raise BadOrder(f"{str(value)[:40]!r} is not a whole number from 0 to {most}")
        return value

    return check


def _list(of: Callable[[Any], Any], least: int, most: int) -> Callable[[Any], list[Any]]:
    def check(value: Any) -> list[Any]:
        if not isinstance(value, list) or not least <= len(value) <= most:
            raise BadOrder(f"{str(value)[:40]!r} is not a list of {least} to {most}")
        return [of(item) for item in value]

    return check


def _word(*words: str) -> Callable[[Any], str]:
    def check(value: Any) -> str:
        if not isinstance(value, str) or value not in words:
            raise BadOrder(f"{str(value)[:40]!r} is not one of {', '.join(words)}")
        return value

    return check


def _yes(value: Any) -> bool:
    if not isinstance(value, bool):
        raise BadOrder(f"{str(value)[:40]!r} is not true or false")
    return value


_POINT = _list(_number(-1e6, 1e6), 3, 3)
_ROW = _whole(2**31)
_HELD: dict[str, Callable[[Any], Any]] = {
    "rows": _list(_ROW, 1, 3),
    "weights": _list(_number(-0.01, 1.01), 1, 3),
    "point": _POINT,
    "number": _ROW,
}
ORDERS: dict[str, dict[str, Callable[[Any], Any]]] = {
    "grab": _HELD,
    "pin": _HELD,
    "obstacle": {"obstacle": _whole(10_000), "point": _POINT, "number": _ROW},
    "drag": {"point": _POINT, "number": _ROW},
    "drop": {},
    "pause": {"on": _yes},
    "step": {},
    "reset": {},
    "undo": {},
    "record": {"on": _yes, "kind": _word(*RECORDS)},
    "speed": {"value": _number(0.01, 10.0)},
    "color": {"name": _word(*COLORS)},
    "hold": {"on": _yes},
    "range": {"value": _number(1e-30, 1e30)},
    "gravity": {"value": _number(-1e3, 1e3)},
    "material": {
        "body": _whole(10_000),
        "name": _word(*MATERIAL),
        "value": _number(0.0, 1e15),
    },
}


def checked(message: Any) -> dict[str, Any]:
    """The order in a message, each part of it checked; raises BadOrder."""
    do = message.get("do") if isinstance(message, dict) else None
    if not isinstance(do, str) or do not in ORDERS:
        raise BadOrder("there is no such order")
    parts = ORDERS[do]
    if set(message) != {"do", *parts}:
        raise BadOrder(f"{do} takes {', '.join(parts) or 'nothing'}")
    order: dict[str, Any] = {"do": do}
    for name, check in parts.items():
        order[name] = check(message[name])
    if "rows" in order:
        if len(order["rows"]) != len(order["weights"]):
            raise BadOrder("a hand takes as many weights as rows")
        if abs(sum(order["weights"]) - 1.0) > 1e-3:
            raise BadOrder("the weights of a hand sum to 1")
    return order
