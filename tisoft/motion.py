"""How a scene moves on: substeps in stretches, steps that follow the limit, under the guard's eyes.

A frame is one stretch, or several where it is long.  After AGAIN substeps the limit and what a run
tells are looked at again, at the end of the stretch.  Frames that nobody looks at one by one share
a launch (`make_frames`); they come out bit for bit as frames made one by one.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.body import Body
from tisoft.changing import Changing
from tisoft.checks import FieldError
from tisoft.gaps import faces_meet, radius_of
from tisoft.gravity import strongest
from tisoft.model import state as columns
from tisoft.model.part import Part
from tisoft.present import AGAIN
from tisoft.rows_in_time import coarse_rows
from tisoft.scene import Scene
from tisoft.stable.guard import Guard
from tisoft.step.grab import Grab
from tisoft.step.pins import SAME_TIME
from tisoft.told import Told, told_of

Floats = NDArray[np.float64]

CALM, SPENT, CALMEST = 0.01, 0.25, 16
"""Relative change of the bound that is expected until the next look, or the share of what the step
leaves free if that is more; and how many times AGAIN substeps may go by until then.  Bodies that
may hit something are looked at as often as ever: they are calm until they do.
"""
CENTERED = 128
"""Substeps after which a body that may be pushed or hit is centred at the latest: it may be faster.
"""
LOOK, LOOK_WORK = 64, 30_000
"""Substeps, or tet-substeps in small scenes, that a stretch within a long frame has at the least;
it ends where the next look is due."""
REST = 1.25
"""Times as many that it has where these are all that is left of the frame."""
MOST_SUBSTEPS = 1e9
"""Substeps that a frame may have: hours of stepping, before which no frame would be seen."""


class Motion(Changing):
    """The moving part of a Simulation, which has the arguments."""

    def __init__(self, scene: Scene, *, certify: bool, **options: Any) -> None:
        super().__init__(scene, certify=certify, **options)
        self.look = max(LOOK, LOOK_WORK // max(1, self.system.elements))
        self.guard = Guard(self) if certify else None
        self._allowed_step = scene.step
        self.center_due = 0.0
        """When bodies' origins are moved after them next [s]."""
        self._told: Told | None = None

    def refresh(self) -> None:
        """Take over what the caller changed since the last frame."""
        if not self.take_changes():
            return
        self.next_look = min(self.next_look, AGAIN)
        self.center_due = 0.0
        if self.guard is not None:
            self.guard.forget()  # energies are others than before

    def part(self, body: Body) -> Part:
        """A body's share of the arrays; raises SceneError for a body of another scene."""
        for part, own in zip(self.parts, self.scene.bodies, strict=False):
            if body is own or body is part.body:  # the latter has its damping ratio turned
                return part
        raise FieldError("body", "is not in this simulation's scene", getattr(body, "name", body))

    def grab(self, body: Body, nodes: Any, weights: Any, point: Any) -> Grab:
        """Take a point of a body in the hand: it is drawn to `target`, at first `point`.

        The hand pulls inside every substep, with the force that leaves the step as it is; it is at
        most three times the body's weight or what bends the body well, whichever is more.  It is
        external work in the ledger.  Checkpoints do not keep hands.

        Args:
            body: one of the scene's.
            nodes: 1 to 32 rows of its `mesh.points`.
            weights: share of each in the point, shape as nodes, sum 1.
            point: world [m], shape (3,).

        Raises:
            SceneError: a body of another scene, nodes or weights that do not fit, a fifth hand.
        """
        part = self.part(body)
        weight = part.mass.sum() * max(float(np.linalg.norm(self.gravity_now)), 1.0)
        return self.hands.take(part, nodes, weights, point, float(weight))

    # -- steps ---------------------------------------------------------------------------------

    def substeps_of(self, frame_time: float) -> tuple[int, float]:
        """Number and size [s] of the substeps of the next frame; raises SceneError for a step that
        is not stable, or too small to make a frame with.
        """
        step = self.scene.step
        if step == "auto":
            step = self.limit.chosen(self.substeps)
        elif self.certify and self.scene.integrator != "explicit-euler":
            self._refuse_long(float(step))
        if not frame_time <= MOST_SUBSTEPS * float(step):
            problem = (
                f"makes frames of {frame_time:.3g} s, which need more than {MOST_SUBSTEPS:.0e} "
                f"substeps of {float(step):.3g} s; give a higher one, or a softer or coarser body"
            )
            raise FieldError("frame_rate", problem, self.scene.frame_rate)
        count = max(1, math.ceil(frame_time / float(step) - 1e-9))
        return count, frame_time / count

    def _refuse_long(self, step: float) -> None:
        if self.frame and step == self._allowed_step:
            return
        limit = self.limit.sharp()
        if step > limit:
            problem = (
                f"s is above the stable limit {limit:.6g} s, so the bodies would explode; "
                'give a smaller step, or step = "auto"'
            )
            raise FieldError("step", problem, step)
        self._allowed_step = step

    def is_look_due(self, substeps: int) -> bool:
        """Whether the limit is to be looked at after so many substeps more: pins that move may
        stretch a body in one.
        """
        return self._is_changing() or self.since_look + substeps >= self.next_look

    def _is_changing(self) -> bool:
        """Whether what acts on the bodies is another thing from frame to frame, or a hand pulls."""
        moved = self.holder.is_moving or self.loading.changes or self.moves_obstacles or self.shakes
        return moved or self.pushing.goes_on or bool(self.hands.held)

    def _looked(self, substeps: int) -> None:
        """Note substeps, and look where that is due."""
        due = self.is_look_due(substeps)
        self.substeps += substeps
        self.since_look += substeps
        if due:
            since, self.since_look = self.since_look, 0
            if self.guard is None or self.scene.integrator == "explicit-euler":
                self.limit.moved()  # else the guard has just looked at this state
            self.watch.look(self.time)
            self._look_inside()
            self._recenter(since)
            self.pushing.stop()
            self.look_for_contact()

    def _look_inside(self) -> None:
        """See how deep surfaces are in obstacles, where those fit between nodes."""
        obstacles = self._obstacles
        if self.pushing.goes_on or not any(radius_of(obstacle) for obstacle in obstacles):
            return
        rule = self.scene.integrator
        parts = [p for p in self.parts if not (self.touching and faces_meet(p.body, rule))]
        if parts:
            self.watch.inside.look(parts, obstacles, self.time, self.system.world())

    def coarse_times(self) -> list[str]:
        """Sentences about rows in time that are finer than the substeps of the first frame."""
        return list(coarse_rows(self.scene, self.steps[0])) if self.steps else []

    def make_frame(self, *, tells: bool = False) -> Told | None:
        """Advance one frame; returns what is told of it where it `tells` and no velocities lag.

        Raises:
            Diverged: when no step carries the frame; the state is then the last good one.
        """
        self.refresh()
        self.stepper.tells = tells
        end = self.time_of(self.frame + 1)
        stops = self._releases_before(end)
        for stop in stops:
            self._go_to(stop, stop - self.time)
        self._go_to(end, end - self.time if stops else 1.0 / self.scene.frame_rate)
        self.frame += 1
        told, self._told = self._told, None
        return told

    def _releases_before(self, end: float) -> list[float]:
        """When pins let go before the end of the frame [s]."""
        late = SAME_TIME / self.scene.frame_rate
        pins = [pin for part in self.system.parts for pin in part.body.pins]
        times = {pin.release for pin in pins if pin.release is not None}
        return sorted(t for t in times if self.time + late < t < end - late)

    def _go_to(self, end: float, long: float) -> None:
        """Advance to `end` [s], within a frame: for so long [s], but for rounding."""
        tells, self.stepper.tells = self.stepper.tells, False
        count, h = self.substeps_of(long)
        while count > REST * (piece := self._piece()):
            self._stretch(self.time + piece * h, piece, h)
            count -= piece
            if self.scene.step == "auto" and self.limit.chosen(self.substeps) < h:
                count, h = self.substeps_of(end - self.time)
        self.stepper.tells = tells
        self._stretch(end, count, h)

    def _piece(self) -> int:
        """Substeps that a stretch may have: as many as nobody looks at the limit in."""
        calm = 0 if self._is_changing() else self.next_look - self.since_look
        return max(self.look, calm)

    def _stretch(self, end: float, count: int, step: float) -> None:
        """Advance to `end` [s] in `count` substeps of `step` [s]."""
        held = self.holder.held
        if self.holder.begin(self.time, end):
            self._set_inputs()
            self._let_go(held)
        if self.hands.held:
            self.hands.begin(step, self.limit.nearest(), self.stepper.integrator.damping_factor)
        if self.scene.start == "half-step" and not self.half_step_lag:
            u, v = self.system.motion()
            self.system.set_motion(u, v - 0.5 * step * self.acceleration())
            self.half_step_lag = step
        self.shake(end)
        begun = _stepping_clock()
        if self.guard is None:
            self.stretches(1, count, step, math.inf)
        elif self.scene.integrator == "explicit-euler":
            self.guard.watch(count, step)
        else:
            count, step = self.guard.carry(count, step)
        self.holder.finish(end)
        if self.stepper.tells and not self.half_step_lag:
            self._told = self._tell(self.stepper.records(1))[0]
        elif self.account is not None:
            self.account.collect(*self.stepper.work(0))
        self.steps.append(step)
        self.remade = False
        self.half_step_lag = step if self.half_step_lag else 0.0
        self.time = end
        self._note_explosion(step)
        self._looked(count)
        self.wall_seconds += _stepping_clock() - begun

    def _let_go(self, held: NDArray[np.int32]) -> None:
        """Give components that were `held` until now a velocity that lags as all others do, and let
        nodes that are inside obstacles come out slowly.
        """
        freed = (held & ~self.holder.held)[:, None] & np.array([1, 2, 4])
        if freed.any() and self._obstacles:  # which may have gone over them meanwhile
            self.pushing.begin(freed.any(axis=1))
            self.place_obstacles()
        if self.half_step_lag and freed.any():
            u, v = self.system.motion()
            lag = 0.5 * self.half_step_lag * self.acceleration()
            self.system.set_motion(u, v - np.where(freed, lag, 0.0))

    def make_frames(self, most: int) -> list[Told]:
        """Advance up to `most` frames in one launch, where nobody looks at the state between them;
        returns what is told of each.  None are made where `make_frame` has to.
        """
        self.refresh()
        frame_time = 1.0 / self.scene.frame_rate
        held = self.holder.held
        if self.holder.begin(self.time, self.time + frame_time):
            self._set_inputs()
            self._let_go(held)
        if most < 2 or not self._is_steady():
            return []
        count, h = self.substeps_of(frame_time)
        left = self.next_look - self.since_look
        due = math.ceil(left / count) if count <= self.look else left // count
        most = min(most, due, columns.FRAMES, self._frames_until_release())
        if most < 2 or not self.steps or self.steps[-1] != h:
            return []
        self.stepper.tells = True
        begun = _stepping_clock()
        made = self.guard.carry_many(most, count, h) if self.guard else (
            self.stretches(most, count, h, math.inf)
        )  # fmt: skip
        if not made:
            return []
        told = self._tell(self.stepper.records(made))
        self.steps += [h] * made
        self.frame += made
        self.time = self.time_of(self.frame)
        self._note_explosion(h)
        self._looked(made * count)
        self.wall_seconds += _stepping_clock() - begun
        return told

    def _tell(self, records: Floats) -> list[Told]:
        """Read the frames just made off, and add them to the account."""
        return told_of(
            self.system, records, probed=self.probed, account=self.account, gravity=self.gravity_now
        )

    def _note_explosion(self, step: float) -> None:
        """Tell of a state that is not finite where no guard has stopped the run."""
        if self.guard is None and self.stepper.tripped:
            self.watch.blew_up(self.time, step)

    def _is_steady(self) -> bool:
        """Whether pins and loads are the same from frame to frame."""
        explicit = self.guard is not None and self.scene.integrator == "explicit-euler"
        lags = bool(self.half_step_lag) or self.scene.start == "half-step"
        return not (explicit or lags or self._is_changing())

    def _frames_until_release(self) -> int:
        releases = [
            pin.release - self.time
            for part in self.system.parts
            for pin in part.body.pins
            if pin.release is not None and pin.release > self.time
        ]
        return int(min(releases, default=np.inf) * self.scene.frame_rate) if releases else 1 << 30

    def stretches(self, count: int, substeps: int, step: float, most_kinetic: float) -> int:
        """Make bare stretches; returns how many were made (see `Stepper.stretches`)."""
        before = self.steps[-1] if self.steps and not self.remade else step
        self.pushing.tell_left()
        self.schedule.begin(
            self.time,
            substeps,
            step,
            integrator=self.stepper.integrator,
            lagging=bool(self.half_step_lag),
            kick=0.5 * (before + step),
        )
        return self.stepper.stretches(
            count, substeps, step, self.gravity_now, most_kinetic=most_kinetic, before=before
        )

    def substep(self, count: int, step: float) -> None:
        """`count` bare substeps of `step` [s], which nothing watches."""
        self.stepper.advance(count, step, self.gravity_now)
        self.limit.moved()

    def _next_look(self, since: int) -> int:
        """Substeps until the next look, as the state's change in the last `since` asks."""
        if self._may_be_jolted():
            return AGAIN
        free = max(CALM, SPENT * (self.limit.accepted() / self.steps[-1] - 1.0))
        change = self.limit.change()
        calm = since * free / change if change > 0.0 else math.inf
        return int(min(max(AGAIN, min(calm, 2 * self.next_look)), CALMEST * AGAIN))

    def _may_be_jolted(self) -> bool:
        """Whether something may hit a body, or let go of it."""
        pins = [pin for part in self.system.parts for pin in part.body.pins]
        lets_go = any(pin.release is not None for pin in pins)
        return bool(self._obstacles) or self.touching is not None or lets_go

    def _recenter(self, since: int) -> None:
        """Move bodies' origins after them, and look again before one has travelled too far."""
        self.next_look = self._next_look(since)
        step = self.steps[-1]
        if self.center_due - self.time < AGAIN * step:
            falls = not (self._may_be_jolted() or self.is_driven())
            latest = CALMEST * AGAIN if falls else CENTERED
            self.center_due = self.time + min(self._center(), latest * step)
        ahead = int((self.center_due - self.time) / step)
        self.next_look = max(1, min(self.next_look, ahead))

    def _center(self) -> float:
        """Move a body's origin after it where it has travelled: u stays small, so exact in f32.

        Returns the time [s] in which none travels by half its size.  Bodies that still pins hold
        travel no more once they have been looked at.
        """
        held = (self.holder.held == 7) & (self.center_due > 0.0) & (not self.holder.is_moving)
        parts = [part for part in self.parts if not held[part.nodes].any()]
        if not parts:
            return math.inf
        moved, soonest = False, math.inf
        u, v = self.system.motion()
        gravity = strongest(self.scene.gravity)
        for part in parts:
            here = u[part.nodes]
            way = here.mean(axis=0, dtype=np.float64).astype(u.dtype)
            if np.abs(way).max() >= part.size:
                first = self.system.first + part.start
                self.system.state.shift(first, first + len(here), way)
                part.shift = part.shift + way.astype(np.float64)
                moved = True
            speed = float(np.linalg.norm(v[part.nodes].mean(axis=0, dtype=np.float64)))
            # The speed grows by g t at the most: speed t + g t² = size/2.
            time = part.size / (speed + math.sqrt(speed * speed + 2.0 * gravity * part.size) or 1.0)
            soonest = min(soonest, time)
        if moved:
            self.place_obstacles()
            self.holder.patches.place()
        return soonest


def _stepping_clock() -> float:
    """Seconds on a clock that stands while kernels are compiled."""
    return time.perf_counter() - runtime.compile_seconds
