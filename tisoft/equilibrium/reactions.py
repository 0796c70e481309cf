"""Reactions: the forces with which pins hold, or move, their nodes.

    R = M a − f   on held axes, −Cᵀ λ of means of cells, 0 elsewhere
    f = elements + loads + M g − (point damping) m v

Pins move at constant velocity within a frame, so a = 0 on held axes.  With lumped masses R = −f;
with consistent mass the accelerations of free neighbours, M_ff a_f = f_f, pull at pins too.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.model.system import System
from tisoft.step.pins import Holder

Floats = NDArray[np.float64]


def reactions(
    system: System, holder: Holder, internal: Floats, external: Floats, gravity: Any
) -> Floats:
    """R [N] in the present state, inside order, shape (nodes, 3).

    Args:
        system: the nodes.
        holder: what pins hold.
        internal: forces of elements [N].
        external: forces of loads [N].
        gravity: [m/s²]
    """
    force = internal + external + system.mass[:, None] * np.asarray(gravity, np.float64)
    v = system.v.astype(np.float64)
    for part in system.parts:
        damping = part.body.model.point_damping
        force[part.nodes] -= damping * part.mass[:, None] * v[part.nodes]
    is_held = ((holder.held[:, None] >> np.arange(3)) & 1).astype(bool)
    needed = -force
    if system.consistent:
        needed += _inertia(system, force, is_held)
    found = np.where(is_held, needed, 0.0)
    a = np.where(is_held, 0.0, force / system.mass[:, None])
    return found + system.mass[:, None] * (holder.patches.project(a) - a)


def _inertia(system: System, force: Floats, held: NDArray[np.bool_]) -> Floats:
    """M a [N] with the accelerations that the forces give to free axes."""
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import spsolve

    rows, columns, entries = system.mass_entries()
    mass = coo_array((entries, (rows, columns))).tocsr()
    out = np.zeros_like(force)
    for axis in range(3):
        free = np.flatnonzero(~held[:, axis])
        a = np.zeros(len(force))
        a[free] = spsolve(mass[free][:, free].tocsc(), force[free, axis])
        out[:, axis] = mass @ a
    return out
