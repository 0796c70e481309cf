# mypy: ignore-errors
"""Symplectic Euler, the lectures' explicit integration:

    Δv = h a(x, v),   Δx = h (v + Δv)

First order; for a mode ω with damping rate d = 2ζω stable while h²ω² + 2hd ≤ 4.  It is the leapfrog
method whose velocity lives half a step before its position, and conserves T + V + (h/2) v·f.

Where the step changes from h to h', the velocity goes from t − h/2 to t + h'/2 in one kick of
(h + h')/2 seconds.  Without that each change would kick the energy by its difference of
(h/2) v·f, and a step that follows the swings of a body would pump it up.
"""

import taichi as ti

from tisoft.step.contact import collide
from tisoft.step.fixed import free, held


class SymplecticEuler:
    """v += h a, then x += h v."""

    order = 1
    damping_factor = 1
    """How much the damping rate counts in the stable step (see `bound`)."""
    closing_passes = 0
    """Passes that a stretch of n substeps takes beyond n."""

    @staticmethod
    @ti.func
    def ahead(state: ti.template(), i, a, now):
        """The velocity that would move node i [m/s] with acceleration a [m/s²]; reads velocity."""
        return state.velocity[i] + now.kick * a

    @staticmethod
    @ti.func
    def kick(now):
        """Seconds for which the forces of a pass act."""
        return now.kick

    @staticmethod
    @ti.func
    def move(state: ti.template(), contact: ti.template(), i, a, now, met):
        """Move node i with acceleration a [m/s²] through a substep; returns a `State.Moved`.

        Reads and writes velocity and displacement; `met` is what surfaces add to it [m/s].
        """
        before = state.velocity[i]
        after = before + now.kick * a + met
        jump, push = 0.0 * a, 0.0 * a
        if ti.static(contact):
            if state.fixed[i] != 7:
                slid, push = collide(state, i, now.h, after)
                jump = slid - after
                after = slid
        after = held(state, i, after)
        push = free(state, i, push)
        way = now.h * after + push
        state.velocity[i] = after
        state.displacement[i] = state.displacement[i] + way
        return state.Moved(before=before, after=after, jump=jump, way=way, push=push)
