# mypy: ignore-errors
"""Explicit Euler, there to show how it fails:

    Δv = h a(x, v),   Δx = h v

First order; without damping no step is stable, since every swing grows by 1 + h²ω² in energy.
"""

import taichi as ti

from tisoft.step.contact import collide
from tisoft.step.fixed import free, held


class ExplicitEuler:
    """v += h a and x += h v, both from the old state."""

    order = 1
    damping_factor = 1
    closing_passes = 0

    @staticmethod
    @ti.func
    def ahead(state: ti.template(), i, a, now):
        """The velocity that moves node i [m/s].  Reads velocity."""
        return state.velocity[i] + 0.0 * a

    @staticmethod
    @ti.func
    def kick(now):
        """Seconds for which the forces of a pass act."""
        return now.h

    @staticmethod
    @ti.func
    def move(state: ti.template(), contact: ti.template(), i, a, now, met):
        """Move node i with acceleration a [m/s²] through a substep; returns a `State.Moved`.

        Reads and writes velocity and displacement.  Surfaces do not touch: `met` is 0.
        """
        before = state.velocity[i]
        after = held(state, i, before + now.h * a)
        ahead, push = before, 0.0 * a
        if ti.static(contact):
            if state.fixed[i] != 7:
                ahead, push = collide(state, i, now.h, ahead)
        ahead = held(state, i, ahead)
        push = free(state, i, push)
        way = now.h * ahead + push
        state.velocity[i] = after
        state.displacement[i] = state.displacement[i] + way
        return state.Moved(before=before, after=after, jump=0.0 * a, way=way, push=push)
