"""Loads: forces on nodes and faces that are known beforehand, with their times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tisoft import checks
from tisoft.checks import FieldError, Vector, keep_number, put
from tisoft.live import frozen
from tisoft.where import Selection, check_selection


@frozen
@dataclass(frozen=True)
class Torque:
    """A `moment` [N·m] about the axis through `point` [m] along `axis`.  Raises SceneError for an
    axis of no length, or a value that is no number.
    """

    point: Vector
    axis: Vector
    moment: float

    def __post_init__(self) -> None:
        put(self, "point", checks.vector("point", self.point))
        put(self, "axis", checks.direction("axis", self.axis))
        keep_number(self, "moment", unit="N·m")


@frozen
@dataclass(frozen=True)
class Load:
    """A load on the nodes, or on the faces all of whose nodes are selected.

    Args:
        where: the nodes.
        force: total [N], by area on faces, equally per node without faces.
        traction: force per area at rest [Pa]; keeps its direction.
        pressure: [Pa], positive pushes inward; follows the surface.
        torque: moment on the faces.
        start, end: when the load acts [s]; end left out: for ever.
        ramp: time in which it grows linearly from 0, from `start` on [s].
        table: instead of these, rows (t, factor), linear between rows; the first row holds before
            it, the last after it.

    Exactly one of force, traction, pressure and torque.

    Raises:
        SceneError: naming the field and its value.
    """

    where: Selection
    force: Vector | None = None
    traction: Vector | None = None
    pressure: float | None = None
    torque: Torque | None = None
    start: float = 0.0
    end: float | None = None
    ramp: float | None = None
    table: checks.Timeline | None = None

    def __post_init__(self) -> None:
        check_selection(self.where)
        kinds = ("force", "traction", "pressure", "torque")
        kind = checks.exactly_one("", {key: getattr(self, key) for key in kinds})
        if kind in ("force", "traction"):
            put(self, kind, checks.vector(kind, getattr(self, kind)))
        elif kind == "pressure":
            keep_number(self, "pressure", unit="Pa")
        elif not isinstance(self.torque, Torque):
            raise FieldError("torque", "must be a Torque(point, axis, moment)", self.torque)
        self._check_times()

    def _check_times(self) -> None:
        keep_number(self, "start", least=0.0, unit="s")
        if self.end is not None:
            remedy = f"a load cannot end before its start at {self.start:g} s"
            keep_number(self, "end", above=self.start, unit="s", remedy=remedy)
        if self.ramp is not None:
            keep_number(self, "ramp", above=0.0, unit="s")
        if self.table is not None:
            put(self, "table", checks.timeline("table", self.table, 2, "(t, factor)"))
            if self.start or self.end is not None or self.ramp is not None:
                raise FieldError("table", "excludes start, end and ramp: its rows tell the times")

    @property
    def kind(self) -> str:
        """Which of "force", "traction", "pressure" and "torque" it is."""
        given = {"force": self.force, "traction": self.traction, "pressure": self.pressure}
        return next((key for key, value in given.items() if value is not None), "torque")

    @property
    def is_constant(self) -> bool:
        """Whether it acts unchanged all the time."""
        return not (self.start or self.ramp or self.table is not None or self.end is not None)

    def factor(self, time: float) -> float:
        """What the load is multiplied by at `time` [s]."""
        if self.table is not None:
            times, factors = zip(*self.table, strict=True)
            return float(np.interp(time, times, factors))
        if time < self.start or (self.end is not None and time >= self.end):
            return 0.0
        return 1.0 if self.ramp is None else min((time - self.start) / self.ramp, 1.0)
