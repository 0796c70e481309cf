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
    def move(state: ti.template(), contact: ti.template(), i, a, now):
        """Move node i with acceleration a [m/s²] through a pass; returns a `State.Moved`.

        Reads and writes velocity, half and displacement: v(t + h/2) is kept in `half`, and
        `velocity` gets the prediction that the next viscous forces see.
        """
        h = now.h
        before = state.velocity[i]
        new = before
        kick, way = 0.0 * h, 0.0 * a
        if now.closes:
            before = state.half[i]
            new = before + 0.5 * h * a
            kick += 0.5 * h
            way += 0.5 * h * before
        if now.opens:
            kick += 0.5 * h
        ahead = new + 0.5 * h * a  # the velocity that moves the node
        push, jump = 0.0 * a, 0.0 * a
        if ti.static(contact):
            if state.fixed[i] != 7:
                met, found = collide(state, i, h, ahead)
                jump, push = met - ahead, found
                ahead = met
                if not now.opens:  # the velocity that a frame ends with does not lead inside either
                    met, found = collide(state, i, h, new)
                    jump, push = met - new, 0.0 * a
                    new = met
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
        return state.Moved(kick=kick, before=before, after=after, jump=jump, way=way, push=push)
