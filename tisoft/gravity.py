"""Gravity [m/s²]: three numbers, or rows (t, gx, gy, gz), linear between rows; the first row holds
before it, the last after it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import checks
from tisoft.checks import Timeline, Vector

Floats = NDArray[np.float64]
Gravity = Vector | Timeline
ROW = (list, tuple, np.ndarray)
"""What a row in time may be."""


def check_gravity(field: str, value: Any) -> Gravity:
    """The value as gravity; raises FieldError."""
    items = checks.sequence(field, value, "numbers (x, y, z), or rows (t, gx, gy, gz)")
    if items and isinstance(items[0], ROW):
        return checks.timeline(field, items, 4, "(t, gx, gy, gz)")
    return checks.vector(field, items, unit="m/s²")


def changes(gravity: Any) -> bool:
    """Whether it is another one from time to time."""
    return len(gravity) > 1 and isinstance(gravity[0], ROW)


def gravity_at(gravity: Any, time: float) -> Floats:
    """At a time [s], shape (3,)."""
    g = np.asarray(gravity, np.float64)
    if g.ndim == 1:
        return g
    return np.array([np.interp(time, g[:, 0], g[:, k]) for k in (1, 2, 3)])


def strongest(gravity: Any) -> float:
    """Its greatest size at any time [m/s²]."""
    g = np.atleast_2d(np.asarray(gravity, np.float64))
    return float(np.linalg.norm(g[:, -3:], axis=1).max())


def mainly(gravity: Any) -> Floats:
    """The mean of its rows, shape (3,): what is down, where it is shaken."""
    g = np.atleast_2d(np.asarray(gravity, np.float64))
    return np.asarray(g[:, -3:].mean(axis=0))
