"""How long it takes to push out a body that begins inside an obstacle or another body.

    T = min(32 h̄ n, 1 s), n nodes through the body, h̄ its stable step;   T ≥ √(depth/2g)

Waves cross it some times meanwhile, and it comes out no faster than it would have fallen so deep.
The speed is depth/T, whatever step is taken.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.depth import depth_inside
from tisoft.model.part import Part

Floats = NDArray[np.float64]

STEPS = 32
"""Stable steps for each node through a body."""
LONGEST = 1.0
"""[s]"""
EARTH = 9.81
"""Gravity [m/s²] that stands for none."""


def push_time(part: Part, depth: float, bound: float, gravity: float) -> float:
    """T [s].

    Args:
        part: the body.
        depth: how deep it is inside [m].
        bound: the stable step at rest [s].
        gravity: the strongest there is [m/s²].
    """
    waves = min(STEPS * bound * max(2.0, len(part.order) ** (1.0 / 3.0)), LONGEST)
    return float(max(waves, np.sqrt(0.5 * depth / (gravity or EARTH))))


def depths_of(part: Part, obstacle: Any, world: Floats, time: float) -> Floats:
    """How deep what meets obstacles of a body is inside of one [m]: its nodes, or the points of the
    surface that it carries.

    Args:
        world: the body's nodes [m], inside order.
    """
    if part.body.carried is not None:
        world = part.body.carried.skin.carried(world[part.rank])
    return depth_inside(obstacle, world, time)
