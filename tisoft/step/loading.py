"""Loads at work: what pushes the nodes, and at a moment for statics.

    force     F w_i, w_i = node's share of the selected faces' area at rest (equal without faces)
    traction  t A_i, A_i = ∫ N_i dA over the selected faces at rest [m²]
    pressure  −p ∫ N_i n dA on the faces as they are: follows the surface, each substep anew
    torque    f_i = w_i ω × ρ_i,  ρ_i = x_i − Σ w x,  Σ w (|ρ|² − ρ ρᵀ) ω = M:  a pure couple

A couple has the same moment M about every axis of its direction, and no net force.  Its forces turn
with the face, M keeps its direction.  What changes in time is `schedule`'s.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tisoft.body import Body
from tisoft.loads import Load
from tisoft.model import inputs as kinds
from tisoft.model.part import Part
from tisoft.model.state import PRESSURE_NUMBERS
from tisoft.model.system import System
from tisoft.step.schedule import Acting, factor_signal

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]


def external_forces(parts: Sequence[Part], time: float, positions: Any = None) -> Floats:
    """Forces of all loads [N] at `time` [s], shape (nodes, 3), nodes numbered inside.

    Args:
        parts: the bodies.
        time: [s]
        positions: world positions [m], inside order, for what follows the surface; left out, rest.
    """
    count = sum(len(part.order) for part in parts)
    x = rest_positions(parts) if positions is None else np.asarray(positions, np.float64)
    total = np.zeros((count, 3))
    for part in parts:
        for load in part.body.loads:
            factor = load.factor(time)
            if factor:
                total[part.nodes] += factor * forces_of(part, load, x[part.nodes])
    return total


def rest_positions(parts: Sequence[Part]) -> Floats:
    """World positions at rest [m], inside order, shape (nodes, 3)."""
    return np.concatenate([part.body.mesh.points[part.order] for part in parts])


def forces_of(part: Part, load: Load, x: Floats) -> Floats:
    """Forces of one load at factor 1 [N] on its body's nodes at positions x [m]."""
    if load.pressure is not None:
        return pressure_forces(load.pressure, *pressed_rows(part, load), x)
    rows, shares, area = _shares(part, load)
    out = np.zeros_like(x)
    if load.force is not None:
        out[rows] = shares[:, None] * np.array(load.force)
    elif load.traction is not None:
        out[rows] = area * shares[:, None] * np.array(load.traction)
    else:
        assert load.torque is not None
        moment = load.torque.moment * np.array(load.torque.axis)
        out[rows] = couple(x[rows], shares, moment)
    return out


def couple(x: Floats, shares: Floats, moment: Floats) -> Floats:
    """Forces w_i ω × ρ_i [N] at points x [m] that add up to a moment [N·m] and to no force."""
    arm = x - shares @ x
    spread = np.einsum("n,ni,nj->ij", shares, arm, arm)
    inertia = np.trace(spread) * np.eye(3) - spread
    # A face squeezed to a line cannot be turned about it: pinv leaves that share out.
    spin = np.linalg.pinv(inertia, rcond=1e-12) @ moment
    return shares[:, None] * np.cross(spin, arm)


def pressure_tangent(part: Part, time: float, x: Floats) -> csr_array:
    """∂f/∂x [N/m] of all pressures on one body at `time` [s], a (3 nodes, 3 nodes) matrix.

    Symmetric where the loaded faces close, or end on held nodes.
    """
    from scipy.sparse import csr_array

    size = 3 * len(x)
    total = csr_array((size, size))
    for load in part.body.loads:
        if load.pressure is None or not load.factor(time):
            continue
        rows, numbers = pressed_rows(part, load)
        scale = (-load.factor(time) * load.pressure * numbers)[:, None, None]
        i, j, k = rows.T
        # d of (x_j − x_i) × (x_k − x_i) by a corner is the cross product with the opposite side.
        for corner, side in ((i, x[k] - x[j]), (j, x[i] - x[k]), (k, x[j] - x[i])):
            total = total + _scattered(scale * _cross_matrices(side), i, corner, size)
    return total


def _cross_matrices(vectors: Floats) -> Floats:
    """Matrices of e × ·, shape (n, 3, 3)."""
    x, y, z = vectors.T
    o = np.zeros_like(x)
    return np.stack([o, -z, y, z, o, -x, -y, x, o], axis=1).reshape(-1, 3, 3)


def _scattered(blocks: Floats, rows: Rows, columns: Rows, size: int) -> csr_array:
    from scipy.sparse import coo_array

    k = np.arange(3)
    i = (3 * rows[:, None, None] + k[:, None]) + 0 * k
    j = (3 * columns[:, None, None] + k) + 0 * k[:, None]
    return coo_array((blocks.ravel(), (i.ravel(), j.ravel())), shape=(size, size)).tocsr()


def pressed_rows(part: Part, load: Load) -> tuple[Rows, Floats]:
    """`Boundary.pressed` of a load's faces, in the body's inside rows."""
    body = part.body
    faces = body.faces(load.where)
    surface = body.mesh.boundary if body.carried is None else body.carried
    rows, numbers = surface.pressed(faces)
    return part.rank[rows], numbers


def _shares(part: Part, load: Load) -> tuple[Rows, Floats, float]:
    """Loaded inside rows of a body, their shares (which add up to 1), and the area [m²]."""
    body = part.body
    faces = body.faces(load.where)
    if body.carried is not None:
        weights = _carried_shares(body, load, faces)[part.order]
        rows = np.flatnonzero(weights)
        return rows, weights[rows] / weights.sum(), float(weights.sum()) if len(faces) else 0.0
    if not len(faces):
        rows = part.rank[body.nodes(load.where)]
        return rows, np.full(len(rows), 1.0 / len(rows)), 0.0
    weights = body.mesh.boundary.area_shares(body.mesh.points, faces)[part.order]
    area = float(weights.sum())
    # Corners of flat quadratic faces have none, but for rounding.
    rows = np.flatnonzero(np.abs(weights) > 1e-12 * area)
    return rows, weights[rows] / area, area


def _carried_shares(body: Body, load: Load, faces: Rows) -> Floats:
    """∫ N_a dA [m²] over faces of a surface that a cage carries, or Σ N_a of its points where there
    are none, shape (nodes,).
    """
    assert body.carried is not None
    if len(faces):
        return body.carried.area_shares(faces)
    skin, points = body.carried.skin, body.points(load.where)
    if not len(points):
        rows = body.nodes(load.where)
        return np.bincount(rows, minlength=len(body.mesh.points)).astype(np.float64)
    each = skin.weights[points].ravel()
    return np.bincount(skin.corners[points].ravel(), each, len(body.mesh.points)).astype(float)


def pressure_forces(pressure: float, rows: Rows, numbers: Floats, x: Floats) -> Floats:
    """Forces of a pressure [Pa] at points x [N], shape (nodes, 3); `rows`, `numbers` as of
    `Boundary.pressed`.
    """
    i, j, k = rows.T
    each = -pressure * numbers[:, None] * np.cross(x[j] - x[i], x[k] - x[i])
    columns = [np.bincount(i, each[:, d], minlength=len(x)) for d in range(3)]
    return np.stack(columns, axis=1)


class Loading:
    """Keeps a system's loads and pressures right."""

    def __init__(self, system: System) -> None:
        self.system = system
        self._known: list[Load] = []
        self._total = np.zeros((system.count, 3))
        self._dead: list[tuple[Part, Load, Floats]] = []
        self._turning: list[tuple[Part, Load, Rows, Floats]] = []
        self._pressed: list[tuple[Load, NDArray[np.bool_]]] = []
        self._first = 0
        """Row of the first pressure."""
        self.refresh()

    @property
    def loads(self) -> bool:
        """Whether some load keeps its direction, or is a torque."""
        return bool(self._dead or self._turning)

    @property
    def changes(self) -> bool:
        """Whether some load is another one in the next frame."""
        return bool(self._turning) or any(not load.is_constant for load in self._known)

    @property
    def acts(self) -> bool:
        """Whether any load acts."""
        return self.loads or self.pressure

    @property
    def pressure(self) -> bool:
        """Whether some pressure acts."""
        return bool(self._pressed)

    def refresh(self) -> bool:
        """Look at the bodies' loads again; returns whether they are others than before."""
        given = [(part, load) for part in self.system.parts for load in part.body.loads]
        if len(given) == len(self._known) and all(
            load is known for (_, load), known in zip(given, self._known, strict=True)
        ):
            return False
        self._known = [load for _, load in given]
        self._dead, self._turning = [], []
        for part, load in given:
            x = part.body.mesh.points[part.order]
            if load.torque is not None:
                self._turning.append((part, load, *_shares(part, load)[:2]))
            elif load.pressure is None:
                self._dead.append((part, load, forces_of(part, load, x)))
        self.forget()
        self._make_pressures([(part, load) for part, load in given if load.pressure is not None])
        return True

    def forget(self) -> None:
        """Say that what was written is no longer there: the next frame writes it anew."""
        self._total = np.full((self.system.count, 3), np.nan)

    def _make_pressures(self, given: list[tuple[Part, Load]]) -> None:
        """Rows of `pressure_force`: each loaded face seen from each of its nodes."""
        s = self.system
        found = [pressed_rows(part, load) for part, load in given]
        shifted = [rows + part.start for (rows, _), (part, _) in zip(found, given, strict=True)]
        rows = np.concatenate([np.empty((0, 3), np.int64), *shifted])
        self._weights = np.concatenate([np.empty(0), *[numbers for _, numbers in found]])
        number = np.repeat(np.arange(len(given)), [len(own) for own in shifted])
        order = np.argsort(rows[:, 0], kind="stable")
        rows, number, self._weights = rows[order], number[order], self._weights[order]
        starts = np.zeros(s.count + 1, np.int32)
        np.cumsum(np.bincount(rows[:, 0], minlength=s.count), out=starts[1:])
        i, j, k = rows.T
        self._data = np.zeros((len(rows), PRESSURE_NUMBERS))
        self._data[:, :3] = s.rest_host[j] - s.rest_host[i]
        self._data[:, 3:6] = s.rest_host[k] - s.rest_host[i]
        self._pressed = [(load, number == n) for n, (_, load) in enumerate(given)]
        self._rows = starts, rows[:, 1:]
        self._seen_from = rows[:, 0]
        for load, mine in self._pressed:
            assert load.pressure is not None
            self._data[mine, 6] = load.factor(0.0) * load.pressure * self._weights[mine]
        if given:
            self._first = s.set_pressures(*self._rows, self._data)

    def write(self) -> None:
        """Write the loads where all of them stay as they are; what changes is for `schedule`."""
        s = self.system
        total = np.zeros((s.count, 3))
        if not self.changes:
            for part, _, forces in self._dead:
                total[part.nodes] += forces
        if not np.array_equal(total, self._total):
            self._total = total
            s.set_loads(total)

    def act(self, acting: Acting) -> None:
        """Tell what pushes the nodes in time."""
        for part, load, forces in self._dead:
            rows = np.flatnonzero(forces.any(axis=1))
            acting.rows.add(
                part.start + rows,
                kinds.LOAD,
                0,
                acting.signal(factor_signal(load), 1),
                forces[rows],
            )
        for part, load, rows, shares in self._turning:
            assert load.torque is not None
            signal, nodes = acting.signal(factor_signal(load), 1), part.start + rows
            moment = load.torque.moment * np.array(load.torque.axis)
            along = np.zeros((len(rows), 3))
            along[:, 0] = shares
            acting.rows.add(nodes, kinds.TORQUE, len(acting.torques), signal, along)
            acting.torques.append((signal, moment, nodes, shares))
        self._act_pressures(acting)

    def _act_pressures(self, acting: Acting) -> None:
        for load, mine in self._pressed:
            if load.is_constant:
                continue
            rows = np.flatnonzero(mine)
            along = np.zeros((len(rows), 3))
            assert load.pressure is not None
            along[:, 0] = load.pressure * self._weights[rows]
            signal = acting.signal(factor_signal(load), 1)
            acting.rows.add(
                self._seen_from[rows], kinds.PRESSURE, self._first + rows, signal, along
            )
