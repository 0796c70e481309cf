"""How an obstacle moves: X at t = 0 is at R X + d at t.

velocity  d = v t        path  d linear between its rows        turn  R about a fixed axis
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import checks
from tisoft.checks import FieldError, put
from tisoft.turning import Turn

Floats = NDArray[np.float64]
MOTIONS = ("velocity", "path", "turn")
STILL = 1e30
"""A speed [m/s] that limits nothing."""


def check_motion(obstacle: Any) -> None:
    """Check and put in order the fields of its motion; raises FieldError."""
    motions = {key: getattr(obstacle, key) for key in MOTIONS}
    if sum(motion is not None for motion in motions.values()) > 1:
        checks.exactly_one("", motions)
    if obstacle.velocity is not None:
        put(obstacle, "velocity", checks.vector("velocity", obstacle.velocity, unit="m/s"))
    if obstacle.path is not None:
        put(obstacle, "path", checks.timeline("path", obstacle.path, 4, "(t, dx, dy, dz)"))
    if obstacle.turn is not None and not isinstance(obstacle.turn, Turn):
        raise FieldError("turn", "must be a Turn(point, axis, rate)", obstacle.turn)


def moves(obstacle: Any) -> bool:
    """Whether it moves."""
    return any(getattr(obstacle, key) is not None for key in MOTIONS)


def pose(obstacle: Any, times: Any) -> tuple[Floats, Floats]:
    """R, shape (times, 3, 3), and d [m], shape (times, 3), at times [s]."""
    t = np.atleast_1d(np.asarray(times, np.float64))
    turned, way = np.tile(np.eye(3), (len(t), 1, 1)), np.zeros((len(t), 3))
    if obstacle.velocity is not None:
        way = t[:, None] * np.array(obstacle.velocity)
    elif obstacle.path is not None:
        rows = np.array(obstacle.path)
        way = np.stack([np.interp(t, rows[:, 0], rows[:, k]) for k in (1, 2, 3)], axis=1)
    elif obstacle.turn is not None:
        K = np.cross(obstacle.turn.axis, np.eye(3)).T
        angle = (obstacle.turn.rate * t)[:, None, None]
        turned = np.eye(3) + np.sin(angle) * K + 2.0 * np.sin(0.5 * angle) ** 2 * (K @ K)
        point = np.array(obstacle.turn.point)
        way = point - turned @ point
    return turned, way


def speeds(obstacle: Any, before: Floats, after: Floats, origin: Floats) -> Floats:
    """w₀ [m/s] and ω [1/s] of the surface's velocity w₀ + ω × x over spans of time [s], x seen from
    a body's origin [m], shape (times, 6).
    """
    out = np.zeros((len(before), 6))
    if obstacle.turn is not None:
        spin = obstacle.turn.rate * np.array(obstacle.turn.axis)
        out[:, 3:] = spin
        out[:, :3] = np.cross(spin, origin - np.array(obstacle.turn.point))
    else:
        ways = pose(obstacle, after)[1] - pose(obstacle, before)[1]
        out[:, :3] = ways / (after - before)[:, None]
    return out
