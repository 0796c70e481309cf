# mypy: ignore-errors
"""Velocity Verlet: kicks by halves around each force (Swope, Andersen, Berens and Wilson 1982).

    v(t + h/2) = v + h/2 a,   x += h v(t + h/2),   v(t + h) = v(t + h/2) + h/2 a(x(t + h), v~)

Second order.  Viscous forces see the prediction v~ = v(t + h/2) + h/2 a.  A pass over the nodes
closes the substep before it and opens the next, so a stretch of n substeps takes n + 1 passes: the
first only opens and the last only closes.  Damping counts twice in its stable step.
"""

import taichi as ti

from tisoft.step.contact import collide
from tisoft.step.fixed import free, held


class VelocityVerlet:
    """Half a kick, a drift, half a kick."""

    order = 2
    damping_factor = 2
    closing_passes = 1

    @staticmethod
    @ti.func
    def ahead(state: ti.template(), i, a, now):
        """The velocity that would move node i [m/s], with acceleration a [m/s²], or that with which
        a frame would end; reads velocity and half.
        """
        v = state.velocity[i]
        if now.closes:
            v = state.half[i] + 0.5 * now.h * a
        if now.opens:
            v += 0.5 * now.h * a
        return v

    @staticmethod
    @ti.func
    def kick(now):
        """Seconds for which the forces of a pass act."""
        return 0.5 * now.h * (now.opens + now.closes)

    @staticmethod
    @ti.func
    def move(state: ti.template(), contact: ti.template(), i, a, now, met):
        """Move node i with acceleration a [m/s²] through a pass; returns a `State.Moved`.

        Reads and writes velocity, half and displacement: v(t + h/2) is kept in `half`, and
        `velocity` gets the prediction that the next viscous forces see; `met` is what surfaces add
        to what moves it [m/s].
        """
        h = now.h
        before = state.velocity[i]
        new = before
        way = 0.0 * a
        if now.closes:
            before = state.half[i]
            new = before + 0.5 * h * a
            way += 0.5 * h * before
        ahead = new + 0.5 * h * a + met  # the velocity that moves the node
        if not now.opens:
            new += met
        push, jump = 0.0 * a, 0.0 * a
        if ti.static(contact):
            if state.fixed[i] != 7:
                slid, found = collide(state, i, h, ahead)
                jump, push = slid - ahead, found
                ahead = slid
                if not now.opens:  # the velocity that a frame ends with does not lead inside either
                    slid, found = collide(state, i, h, new)
                    jump, push = slid - new, 0.0 * a
                    new = slid
        new = held(state, i, new)
        ahead = held(state, i, ahead)
        push = free(state, i, push)
        after = new
        if now.opens:
            after = ahead
            way += 0.5 * h * ahead + push
            state.half[i] = ahead
            state.displacement[i] = state.displacement[i] + (h * ahead + push)
            new = held(state, i, ahead + 0.5 * h * a)
        state.velocity[i] = new
        return state.Moved(before=before, after=after, jump=jump, way=way, push=push)
