"""Inputs in time of a running scene: which things act on which nodes, and their signals by pass.

A signal is told for each substep from a to b [s] by itself, however frames and launches are cut:

    load            ∫ f dt / (b − a)             exactly, so that no corner or pulse is lost
    gravity         the same, less what it is at the end of the stretch, for which energies are told
    path            (s(b) − s(a)) / (b − a)      where the pin is at b, whatever was between
    turn            the same of sin θ and of 1 − cos θ

Forces of symplectic Euler act from a to b; with `start = "half-step"`, and with velocity Verlet,
from half a step before the positions' time to half a step after it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.gravity import Gravity
from tisoft.loads import Load
from tisoft.model import inputs as kinds
from tisoft.model import state as columns
from tisoft.model.arena import Lease
from tisoft.model.inputs import Inputs
from tisoft.model.part import Part
from tisoft.model.system import System
from tisoft.moving import speeds
from tisoft.pins import Pin
from tisoft.step.symplectic_euler import SymplecticEuler

Floats = NDArray[np.float64]
Signal = Callable[["Windows"], Floats]
"""Rows of numbers, one for each pass, shape (signals, passes)."""

ROOM, MOST, LEAST = 65536, 4096, 64
"""Values that a scene has room for, and the most and the least passes a launch may take of it."""


@dataclass(frozen=True)
class Windows:
    """When the forces and the motions of some passes act [s], shape (passes,) each."""

    begin: Floats
    end: Floats
    before: Floats
    after: Floats
    here: Floats
    """When the passes begin [s]."""
    first_share: float
    """Share of the first kick that the first window stands for; what is beyond acts as at its
    start."""


def windows(
    start: float,
    step: float,
    passes: NDArray[np.int64],
    substeps: int,
    *,
    centred: bool,
    ends: bool,
) -> Windows:
    """Of passes of a stretch from `start` [s]; `centred`: forces act about the positions' time;
    `ends`: no further than the stretch goes.
    """
    low: Floats = np.asarray(passes - (0.5 if centred else 0.0), np.float64)
    high: Floats = low + 1.0
    if ends:
        low, high = np.clip(low, 0.0, substeps), np.clip(high, 0.0, substeps)
    number = np.minimum(passes, substeps - 1)
    here: Floats = np.asarray(start + step * passes, np.float64)
    return Windows(
        start + step * low, start + step * high,
        start + step * number, start + step * (number + 1), here, 1.0,
    )  # fmt: skip


def mean(antiderivative: Callable[[Floats], Floats], w: Windows) -> Floats:
    """Of a function over the windows, shape (…, passes)."""
    long = w.end - w.begin
    return (antiderivative(w.end) - antiderivative(w.begin)) / long


def integral(times: Floats, values: Floats, t: Floats) -> Floats:
    """∫ from times[0] to t of what is linear between rows and constant beyond them."""
    inside = np.clip(t, times[0], times[-1])
    k = np.clip(np.searchsorted(times, inside, side="right") - 1, 0, max(len(times) - 2, 0))
    pieces = 0.5 * (values[1:] + values[:-1]) * np.diff(times)
    whole = np.concatenate([[0.0], np.cumsum(pieces)])
    here = np.interp(inside, times, values)
    total = whole[k] + 0.5 * (values[k] + here) * (inside - times[k])
    out: Floats = total + values[0] * np.minimum(t - times[0], 0.0)
    return out + values[-1] * np.maximum(t - times[-1], 0.0)


def factor_integral(load: Load, t: Floats) -> Floats:
    """∫ of the load's factor up to t [s]."""
    if load.table is not None:
        rows = np.array(load.table)
        return integral(rows[:, 0], rows[:, 1], t)
    end = math.inf if load.end is None else load.end
    on = np.clip(t, load.start, end) - load.start
    if load.start == 0.0 and load.ramp is None:
        on = on + np.minimum(t, 0.0)  # it has always acted
    if load.ramp is None:
        return on
    rising = np.minimum(on, load.ramp)
    return rising * rising / (2.0 * load.ramp) + (on - rising)


def factor_signal(load: Load) -> Signal:
    """The load's factor."""
    if load.is_constant:
        return lambda w: np.ones((1, len(w.begin)))

    def signal(w: Windows) -> Floats:
        values = mean(lambda t: factor_integral(load, t), w)[None]
        if w.first_share != 1.0:
            values[:, 0] *= w.first_share
            values[:, 0] += (1.0 - w.first_share) * load.factor(float(w.begin[0]))
        return values

    return signal


def gravity_signal(gravity: Gravity, told: Callable[[], Floats]) -> Signal:
    """Gravity beyond what is `told` for the stretch [m/s²], three components."""
    rows = np.array(gravity)

    def signal(w: Windows) -> Floats:
        out = np.empty((3, len(w.begin)))
        for k in range(3):
            out[k] = mean(partial(integral, rows[:, 0], rows[:, 1 + k]), w)
            if w.first_share != 1.0:
                now = np.interp(w.begin[0], rows[:, 0], rows[:, 1 + k])
                out[k, 0] += (1.0 - w.first_share) * (now - out[k, 0])
        return out - told()[:, None]

    return signal


def path_signal(pin: Pin) -> Signal:
    """The pin's velocity, three components."""

    def signal(w: Windows) -> Floats:
        if pin.velocity is not None:
            return np.repeat(np.array(pin.velocity)[:, None], len(w.before), axis=1)
        rows = np.array(pin.path)
        ways = [np.interp(w.after, *rows[:, [0, k]].T) - np.interp(w.before, *rows[:, [0, k]].T)
                for k in (1, 2, 3)]  # fmt: skip
        return np.array(ways) / (w.after - w.before)

    return signal


def turn_signal(rate: float) -> Signal:
    """Rates of sin θ and of 1 − cos θ [1/s]."""

    def signal(w: Windows) -> Floats:
        a, b = rate * w.before, rate * w.after
        half, middle = 0.5 * (b - a), 0.5 * (a + b)
        ways = 2.0 * np.sin(half) * np.array([np.cos(middle), np.sin(middle)])
        out: Floats = ways / (w.after - w.before)
        return out

    return signal


def obstacle_signal(obstacle: Any, part: Part) -> Signal:
    """The numbers of a moved obstacle, and its surface's velocity, seen from a body's origin."""

    def signal(w: Windows) -> Floats:
        numbers = obstacle.numbers(part.origin, w.here)
        return np.hstack([numbers, speeds(obstacle, w.before, w.after, part.origin)]).T

    return signal


@dataclass
class Rows:
    """Rows of nodes, as `Inputs.write_rows` takes them."""

    nodes: list[NDArray[np.int64]] = field(default_factory=list)
    words: list[NDArray[np.int32]] = field(default_factory=list)
    vectors: list[Floats] = field(default_factory=list)

    def add(
        self, nodes: Any, kind: int, target: Any, signal: int, along: Any, across: Any = 0.0
    ) -> None:
        """Rows of some nodes."""
        count = len(nodes)
        words = np.zeros((count, 3), np.int32)
        words[:, 0], words[:, 1], words[:, 2] = kind, target, signal
        vectors = np.zeros((count, 6))
        vectors[:, :3], vectors[:, 3:] = along, across
        self.nodes.append(np.asarray(nodes, np.int64))
        self.words.append(words)
        self.vectors.append(vectors)

    def sorted(self, count: int) -> tuple[NDArray[np.int32], NDArray[np.int32], Floats]:
        """Where the rows of each of `count` nodes begin, and the rows."""
        nodes = np.concatenate([np.empty(0, np.int64), *self.nodes])
        order = np.argsort(nodes, kind="stable")
        starts = np.searchsorted(nodes[order], np.arange(count + 1)).astype(np.int32)
        words = np.concatenate([np.empty((0, 3), np.int32), *self.words])[order]
        return starts, words, np.concatenate([np.empty((0, 6)), *self.vectors])[order]


@dataclass
class Acting:
    """What acts in time on a system, as rows and signals."""

    rows: Rows = field(default_factory=Rows)
    signals: list[Signal] = field(default_factory=list)
    count: int = 0
    """Signals so far."""
    moved: list[tuple[int, int]] = field(default_factory=list)
    """Row in `State.obstacle` and first signal of each moved obstacle, one for each body."""
    torques: list[tuple[int, Floats, NDArray[np.int64], Floats]] = field(default_factory=list)
    """Signal, moment [N·m], nodes and shares of each."""
    pins: dict[int, int] = field(default_factory=dict)
    """First signal of each moved pin, by its id."""

    def signal(self, signal: Signal, width: int) -> int:
        """Number of the first of `width` new signals."""
        self.signals.append(signal)
        self.count += width
        return self.count - width

    def add_gravity(self, system: System, gravity: Gravity, told: Callable[[], Floats]) -> None:
        """Gravity that changes: what is `told` for a stretch acts by itself."""
        along = np.zeros((system.count, 3))
        along[:, 0] = system.mass
        number = self.signal(gravity_signal(gravity, told), 3)
        self.rows.add(np.arange(system.count), kinds.GRAVITY, 0, number, along)

    def add_pin(self, part: Part, pin: Pin, picked: NDArray[np.int64]) -> None:
        """A pin that moves, with the rows of `mesh.points` that it holds."""
        nodes = part.start + part.rank[picked]
        if pin.turn is None:
            number = self.pins[id(pin)] = self.signal(path_signal(pin), 3)
            self.rows.add(nodes, kinds.PATH, pin.bits, number, 0.0)
            return
        arm = part.body.mesh.points[picked] - np.array(pin.turn.point)
        along = np.cross(pin.turn.axis, arm)
        across = np.cross(pin.turn.axis, along)
        number = self.pins[id(pin)] = self.signal(turn_signal(pin.turn.rate), 2)
        self.rows.add(nodes, kinds.TURN, pin.bits, number, along, across)


class Schedule:
    """Tells the kernels what acts in each pass."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.acting: Acting | None = None
        self._lease: Lease | None = None
        self._needs: dict[str, int] = {}
        self._from = (0.0, 1.0, 1, False, False, 1.0)

    @property
    def fields(self) -> Any:
        """The fields, or None where nothing changes in time."""
        return None if self.acting is None or self._lease is None else self._lease.fields

    @property
    def most_passes(self) -> int:
        """Passes that a launch may take."""
        assert self.acting is not None
        return int(np.clip(ROOM // max(1, self.acting.count), LEAST, MOST))

    def set(self, acting: Acting | None) -> None:
        """Take what acts from now on."""
        self.acting = acting
        if acting is None:
            return
        s = self.system
        starts, words, vectors = acting.rows.sorted(s.count)
        turned = sum(len(nodes) for *_, nodes, _ in acting.torques)
        needs = {
            "nodes": s.count + 1,
            "rows": len(words),
            "values": acting.count * self.most_passes,
            "turned": turned,
            "torques": len(acting.torques) + 1,
            "moved": len(acting.moved),
            "scenes": 1,
        }
        if self._lease is None or any(needs[k] > self._lease.counts[k] for k in needs):
            if self._lease is not None:
                self._lease.end()
            self._lease = s.lend(Inputs, needs)
        at, fields = self._lease.starts, self._lease.fields
        words[words[:, 0] == kinds.TORQUE, 1] += at["torques"]
        fields.write_rows(
            at["nodes"], starts + np.int32(at["rows"]), at["rows"], words, s.reals(vectors)
        )
        self._write_torques(acting)
        if acting.moved:
            fields.write_moved(at["moved"], *np.array(acting.moved, np.int32).T.copy())
        fields.write_scene(at["scenes"], np.array([
            at["nodes"] - s.first, at["values"], self.most_passes,
            at["torques"], at["torques"] + len(acting.torques),
            at["moved"], at["moved"] + len(acting.moved),
        ], np.int32))  # fmt: skip
        s.state.ranges[s.scene, columns.INPUTS] = at["scenes"]

    def _write_torques(self, acting: Acting) -> None:
        assert self._lease is not None
        at, fields = self._lease.starts, self._lease.fields
        nodes = [own for *_, own, _ in acting.torques]
        lengths = [len(own) for own in nodes]
        starts = at["turned"] + np.cumsum([0, *lengths])
        wide = np.float64 if runtime.has_f64() else np.float32
        fields.write_torques(
            at["torques"],
            starts.astype(np.int32),
            np.array([number for number, *_ in acting.torques], np.int32),
            np.array([moment for _, moment, *_ in acting.torques], wide).reshape(-1, 3),
            at["turned"],
            (self.system.first + np.concatenate([np.empty(0), *nodes])).astype(np.int32),
            np.concatenate([np.empty(0), *[shares for *_, shares in acting.torques]]).astype(wide),
        )  # fmt: skip

    def begin(
        self,
        start: float,
        substeps: int,
        step: float,
        *,
        integrator: Any,
        lagging: bool,
        kick: float,
    ) -> None:
        """Say when the passes to come are: a stretch from `start` [s]; `lagging`: velocities are
        half a step behind; `kick`: seconds of the first kick of symplectic Euler.
        """
        centred = lagging or integrator.closing_passes > 0
        kick = kick if integrator is SymplecticEuler else step
        self._from = (start, step, substeps, centred, integrator.closing_passes > 0, kick)

    def fill(self, done: int, now: int) -> None:
        """Write the signals of `now` passes, from number `done` of the stretch on."""
        if self.acting is None:
            return
        start, step, substeps, centred, ends, kick = self._from
        w = windows(start, step, np.arange(done, done + now), substeps, centred=centred, ends=ends)
        if done == 0 and kick != step:  # the first kick goes on from where the last one ended
            if centred:
                w.begin[0] -= kick - step
            else:
                w = replace(w, first_share=step / kick)
        assert self._lease is not None
        values = [np.empty((0, now)), *[signal(w) for signal in self.acting.signals]]
        wide = np.float64 if runtime.has_f64() else np.float32
        table = np.ascontiguousarray(np.concatenate(values), wide)
        self._lease.fields.write_values(self._lease.starts["values"], self.most_passes, table)
