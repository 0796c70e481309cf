"""A scene as the engine sees it: bodies numbered, their numbers in Taichi fields.

Positions are kept as world = rest point + shift of the body's origin + u: rest points and shifts in
f64 on the host, displacements u in the scene's precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.model import state as columns
from tisoft.model.arena import Lease
from tisoft.model.lent import Lent
from tisoft.model.part import Part
from tisoft.obstacles.base import VELOCITY

Floats = NDArray[np.float64]


class System(Lent):
    """The bodies of a scene in fields, read and written; the arguments are those of `Lent`."""

    # -- hands ---------------------------------------------------------------------------------

    def write_hand(self, hand: int, nodes: Any, weights: Any, numbers: Any) -> None:
        """Write row `hand`: nodes (inside rows) and weights, y − Σ w X (3) [m], k, c and F."""
        rows = (np.asarray(nodes) + self.first).astype(np.int32)
        self.state.write_hand(hand, rows, self._reals(weights), self._reals(numbers))

    def hold(self, count: int) -> None:
        """Say how many hands pull."""
        self.order("orders", columns.HELD, count)

    def let_go(self) -> None:
        """Take all hands' forces off the nodes."""
        self.hold(0)
        self.state.let_go(self.first, self.last)

    # -- changes -------------------------------------------------------------------------------

    def reread_models(self) -> None:
        """Take stiffness, rest length, damping, density and viscosity anew from the bodies' models.

        Raises:
            FieldError: a model that needs other arrays than those the simulation was built with.
        """
        for part in self.parts:
            part.reread()
        self.mass[:] = np.concatenate([p.mass for p in self.parts])
        self.state.write_masses(self.first, self._reals(1.0 / self.mass))
        for share in self.shares:
            if share.block.law is None:  # springs and tensors hold their stiffness in rest numbers
                rest = share.batches.filled([part.blocks()[0].rest for part in share.parts])
                share.block.write_rest(share.row("batches"), self._reals(rest))
            else:
                share.block.write_modes(share.row("batches"), self._reals(self._modes(share)))
            self._write_materials(share)
        if self.mass_lease is not None:
            self._write_mass_rows(self.mass_lease, *self.mass_entries())
        self.write_bodies()

    def order(self, field: str, column: int, value: float) -> None:
        """Write one of the scene's `orders` or `settings`, where it is another than before."""
        if self._ordered.get((field, column)) != value:
            self._ordered[field, column] = value
            getattr(self.state, field)[self.scene, column] = value

    def _meeting(self) -> list[Part]:
        """The bodies in the order of their obstacles' rows."""
        return sorted(self.parts, key=lambda part: part.touches)

    def obstacle_row(self, part: Part, number: int) -> int:
        """Row of an obstacle as seen from a body."""
        assert self.obstacle_lease is not None
        place = self._meeting().index(part) * self._obstacles + number
        return int(self.obstacle_lease.starts["obstacles"]) + place

    def set_obstacles(
        self, obstacles: Sequence[Any], kinds: Sequence[int], time: float, pushes: Any
    ) -> None:
        """Place obstacles at `time` [s], seen from the bodies' present origins; `pushes`: speed at
        which each body is pushed out of each [m/s], shape (bodies, obstacles).
        """
        count = len(obstacles)
        if self.obstacle_lease is None or self._obstacles != count:
            if self.obstacle_lease is not None:
                self.obstacle_lease.end()
            self._obstacles = count
            needs = {"obstacles": count * len(self.parts)}
            self.obstacle_lease = self._keep(Lease(self.lease.arena, needs))
            self.write_bodies()
        moves = np.zeros(columns.OBSTACLE_NUMBERS - VELOCITY)  # what kernels write themselves
        rows = [
            [*o.numbers(part.origin, time)[0], o.friction, pushes[part.index, k], *moves]
            for part in self._meeting()
            for k, o in enumerate(obstacles)
        ]
        if self.touch_lease is not None:
            nth = np.cumsum([part.touches for part in self.parts]) - 1
            first = self._obstacle_starts()[-1] + count * nth[self._touching]
            row = self.touch_lease.starts["points"]
            self.touch_lease.fields.write_obstacles(
                row, first.astype(np.int32), (first + count).astype(np.int32)
            )
        if rows:
            self.state.write_obstacles(
                self.obstacle_lease.starts["obstacles"],
                np.array(list(kinds) * len(self.parts), np.int32),
                self._reals(rows),
            )

    def set_pressures(self, starts: Any, ends: Any, numbers: Any) -> int:
        """Rows of `external.press`: where each node's begin, shape (nodes + 1,), and the rows;
        returns the first of them.
        """
        room = self.lease.counts["pressures"]
        row = self.lease.starts["pressures"]
        if len(ends) > room:
            row = self._keep(Lease(self.lease.arena, {"pressures": len(ends)})).starts["pressures"]
        self.state.write_pressures(
            self.first,
            np.asarray(starts, np.int32) + np.int32(row),
            row,
            np.asarray(ends, np.int32).reshape(-1, 2) + np.int32(self.first),
            self._reals(numbers).reshape(-1, columns.PRESSURE_NUMBERS),
        )
        return int(row)

    # -- state in and out ----------------------------------------------------------------------

    def check_alive(self) -> None:
        """Raise RuntimeError where Taichi was started anew since this system was made."""
        if self.generation != runtime.generation:
            raise RuntimeError(
                "this simulation belongs to an earlier start of Taichi; make it anew"
            )

    def motion(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """u [m] and v [m/s] of all nodes in the scene's precision, shape (nodes, 3) each."""
        self.check_alive()
        u, v = (np.empty((self.count, 3), self.real) for _ in range(2))
        self.state.read_motion(self.first, u, v)
        return u, v

    def set_motion(self, u: Any, v: Any) -> None:
        """Write u [m] and v [m/s]."""
        self.check_alive()
        self.written += 1
        self.state.write_motion(self.first, self._reals(u), self._reals(v))

    @property
    def u(self) -> NDArray[Any]:
        """Displacements [m], internal order, shape (nodes, 3)."""
        return self.motion()[0]

    @property
    def v(self) -> NDArray[Any]:
        """Velocities [m/s], internal order, shape (nodes, 3)."""
        return self.motion()[1]

    def probe_motion(self) -> tuple[Floats, Floats]:
        """u [m] and v [m/s] of the probes, shape (probes, 3) each."""
        u, v = self.motion()
        return u[self._probes].astype(np.float64), v[self._probes].astype(np.float64)

    def probe_origins(self) -> Floats:
        """World positions of the probes' rest points, moved with their bodies' origins [m]."""
        origins = [self.parts[self.body[i]].origin for i in self._probes]
        return self.rest_host[self._probes] + np.array(origins).reshape(-1, 3)

    def world(self, u: NDArray[Any] | None = None) -> Floats:
        """World positions [m] of all nodes, internal order, f64, shape (nodes, 3)."""
        here = np.array(self.u if u is None else u, dtype=np.float64)
        here += self.rest_host
        for part in self.parts:
            here[part.nodes] += part.origin
        return here

    def set_fixed(self, fixed: Any, drive: Any) -> None:
        """Write what pins hold (bits of axes) and the velocities [m/s] they prescribe."""
        self.state.write_fixed(self.first, np.asarray(fixed, np.int32), self._reals(drive))

    def set_places(self, nodes: Any, axes: Any, places: Any) -> None:
        """Write components of u [m]: rows of nodes, bits of axes, shape (rows, 3)."""
        self.state.write_places(
            self.first, np.asarray(nodes, np.int32), np.asarray(axes, np.int32),
            self._reals(places),
        )  # fmt: skip

    def set_loads(self, load: Any) -> None:
        """Write forces of loads that keep their direction [N], internal order."""
        self.state.write_loads(self.first, self._reals(load))

    def set_pressed(self, pressed: Any) -> None:
        """Write forces of pressures [N] as the last substep saw them."""
        self.state.write_pressed(self.first, self._reals(pressed))

    def loads(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Forces of loads and of pressures [N] as last used, internal order."""
        load, pressed = (np.empty((self.count, 3), self.real) for _ in range(2))
        self.state.read_loads(self.first, load, pressed)
        return load, pressed

    def mass_residual(self) -> Floats:
        """f − M a of the last solve with the consistent mass [N], shape (nodes, 3)."""
        assert self.mass_lease is not None
        out = np.zeros((self.count, 3), self.real)
        self.mass_lease.fields.read_residual(self.mass_lease.starts["nodes"], out)
        return out.astype(np.float64)

    def viscous(self) -> bool:
        """Whether any body damps the rate of its strain or of its springs."""
        return any(part.is_viscous() for part in self.parts)
