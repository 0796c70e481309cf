# mypy: ignore-errors
"""Pins: components of a node that are held move as they are told, whatever pushes them.

v_c = drive_c   on held components (0 where a pin is still)
"""

import taichi as ti


@ti.func
def held(state: ti.template(), i, v):
    """v with the held components of node i in place.  Reads state.fixed, state.drive."""
    bits = state.fixed[i]
    if bits:
        for c in ti.static(range(3)):
            if bits & (1 << c):
                v[c] = state.drive[i][c]
    return v


@ti.func
def free(state: ti.template(), i, v):
    """v with the held components of node i zero.  Reads state.fixed."""
    bits = state.fixed[i]
    if bits:
        for c in ti.static(range(3)):
            if bits & (1 << c):
                v[c] = 0.0
    return v
