"""What every viewer shares, without a window: the hand, pacing, orders, pictures' data.

The simulation lives in the thread that calls `Controller.tick` for ever.  Viewers post orders (from
any thread) and read `snapshot`, the data of the latest picture; neither waits for the other.
A snapshot is made only when somebody `wants` one, so a frame that no page shows costs nothing, and
no more than PICTURES of the time goes into them where the simulation has none to spare.
"""

from __future__ import annotations

import collections
import dataclasses
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tisoft.errors import SceneError, TisoftError
from tisoft.observers.quantities import node_values
from tisoft.scene import Scene
from tisoft.simulation import Simulation
from tisoft.stable.limiting import limiting
from tisoft.viewer.changing import Changes
from tisoft.viewer.hands import Hands
from tisoft.viewer.orders import COLORS
from tisoft.viewer.picture import Painter, Snapshot
from tisoft.viewer.recorder import Recorder
from tisoft.viewer.recording import free_name

LEAST_RATE = 60.0
"""Frames per simulated second at which hands and eyes find a scene smooth [1/s]."""
LATE = 0.1
"""Seconds behind the clock from which the debt is dropped: slow motion, never a spiral."""
NAP = 1.0 / 30.0
"""Seconds of sleep at the most."""
TOLD_EVERY = 0.25
"""Seconds between two looks at what costs more than a glance: the limit and the warnings."""
FEW_ELEMENTS = 4_000
"""Up to here one thread keeps real time, and a busy page on the same cores cannot stall it."""
PICTURES = 0.05
"""Share of the time that goes into pictures of a scene too heavy for real time, where that makes
ten a second; others have time left for them."""
SLOWEST = 0.1
"""Seconds between two pictures that somebody wants, at the most."""
SUPERSEDED = ("material", "gravity", "speed", "range", "drag", "reset")
"""Orders of which the last counts where several wait: what sliders and mice send."""


class Controller:
    """A running scene in the hands of viewers.

    Args:
        scene: its frame rate is raised to LEAST_RATE.
        sim: one that runs already, instead: its own scene and rate are taken.
        color: one of COLORS.
        speed: simulated seconds per second.
        clock, wait: the seconds that pass, and how to sleep for some of them; for tests.

    Raises:
        SceneError: a scene that cannot run.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        sim: Simulation | None = None,
        arch: str = "cpu",
        color: str = "stress",
        speed: float = 1.0,
        clock: Callable[[], float] = time.perf_counter,
        wait: Callable[[float], Any] | None = None,
    ) -> None:
        rate = max(scene.frame_rate, LEAST_RATE)
        self.scene = scene if sim else dataclasses.replace(scene, frame_rate=rate)
        self.arch, self.speed, self.clock = arch, speed, clock
        self._wake = threading.Event()
        self.wait = wait or self._sleep
        self.painter = Painter(self.scene, color)
        self.changes = Changes(self.scene, clock)
        self.orders: collections.deque[tuple[Any, dict[str, Any]]] = collections.deque()
        self.listeners: list[Callable[[], None]] = []
        self.wants = True
        """Whether somebody waits for a newer snapshot."""
        self.stale = False
        """Whether the state is newer than the snapshot."""
        self.paused, self.error, self.failed, self.said = False, "", False, ""
        self.singles = 0
        self.dropped = 0.0
        """Seconds of debt dropped so far."""
        self.recorder = Recorder()
        self._kept: Snapshot | None = None
        self._at_first = [list(body.pins) for body in scene.bodies], list(scene.obstacles)
        self._next_picture, self._cost = -np.inf, 0.0
        self.owns = sim is None
        """Whether the simulation is its own, to begin anew."""
        self.sim = self._begin() if sim is None else sim
        self.hands = Hands(self.sim, self.painter.drawn)
        self.adopt(self.sim)
        self._told, self._told_at = self._look(), self.clock()
        self.snapshot = self.painter.snapshot(self.sim, self.hands.drag)

    def _begin(self) -> Simulation:
        elements = sum(b.mesh.elements for b in self.scene.bodies)
        threads = 1 if elements <= FEW_ELEMENTS else None
        sim = Simulation(self.scene, arch=self.arch, threads=threads, interactive=True)
        sim.energy()  # compiles, while nobody looks yet
        sim.limit.sharp()
        return sim

    def adopt(self, sim: Simulation) -> None:
        """Show this simulation, of the bodies that are shown."""
        self.sim = self.hands.sim = sim
        self.scene = self.painter.scene = self.changes.scene = sim.scene
        self._due = self.clock()
        self._meter: collections.deque[tuple[float, float]] = collections.deque(maxlen=60)
        self._told_at = -np.inf
        self.stale = True

    @property
    def due(self) -> float:
        """When the next frame is to be made, on `clock` [s]."""
        return self._due

    @property
    def color(self) -> str:
        """What colours show."""
        return self.painter.color

    # -- any thread ----------------------------------------------------------------------------

    def post(self, order: dict[str, Any], viewer: Any = None) -> None:
        """Ask for a checked order (see `orders`), in the name of a viewer."""
        self.orders.append((viewer, order))
        self._wake.set()

    def want(self) -> None:
        """Ask for a newer snapshot."""
        self.wants = True
        self._wake.set()

    # -- the simulation's thread ---------------------------------------------------------------

    def _sleep(self, seconds: float) -> None:
        self._wake.wait(seconds)
        self._wake.clear()

    def tick(self) -> bool:
        """Obey, step where a frame is due, and sleep where none is; returns whether it stepped."""
        self._obey()
        if self.stale:  # changed, or stepped when no page had time for it
            self._publish()
        if self.recorder.writes:
            self._write_on()
            return False
        now = self.clock()
        if self.paused:
            self._due = now
            if self.singles:
                self.singles -= 1
                return self._step()
            if not (self.stale and self.wants):
                self.wait(NAP)
        elif now < self._due:
            self.wait(min(self._due - now, NAP))
        else:
            return self._step()
        return False

    def _step(self) -> bool:
        made = True
        try:
            self.hands.lead()
            self.sim.step()
        except TisoftError as error:
            made = False
            self._fail(error)
        self._owe()
        self.stepped()
        return made

    def stepped(self) -> None:
        """Take note of a frame that was made."""
        self._meter.append((self.clock(), self.sim.time))
        self.stale, self._kept = True, None
        if self.recorder.recording is not None and not self.failed:
            self._keep()
        self._publish()

    def _owe(self) -> None:
        """Say when the next frame is due; what is too late is dropped."""
        frame = 1.0 / (self.scene.frame_rate * self.speed)
        self._due += frame
        late = self.clock() - self._due
        if late > max(LATE, 2.0 * frame):
            self.dropped += late
            self._due += late

    def pace(self) -> None:
        """For who steps by himself: obey, wait until the next frame is due, and while paused."""
        self._owe()
        while True:
            self._obey()
            if self.stale:
                self._publish()
            if self.recorder.writes:
                self._write_on()
            elif self.paused and self.singles:
                self.singles -= 1
                break
            elif self.paused:
                self._due = self.clock()
                self.wait(NAP)
            elif self.clock() >= self._due:
                break
            else:
                self.wait(min(self._due - self.clock(), NAP))
        self.hands.lead()

    def _fail(self, error: TisoftError) -> None:
        self.hands.drop_all()
        self.paused, self.singles, self.failed = True, 0, True
        last = self.changes.last
        undo = f"; the last change was {last}: undo it (U)" if last else ""
        self.error = f"{str(error).rstrip('.')}{undo}, or reset (Backspace)."

    def _obey(self) -> None:
        waiting = []
        while self.orders:
            waiting.append(self.orders.popleft())
        last = {_subject(viewer, order): n for n, (viewer, order) in enumerate(waiting)}
        for n, (viewer, order) in enumerate(waiting):
            self.stale = True
            if order["do"] in SUPERSEDED and last[_subject(viewer, order)] != n:
                continue
            asked = {name: value for name, value in order.items() if name != "do"}
            try:
                _ORDERS[order["do"]](self)(viewer, **asked)
            except TisoftError as error:
                self.error = str(error)

    def _publish(self) -> None:
        begun = self.clock()
        is_idle = self._due - begun > self._cost
        if not self.wants or (begun < self._next_picture and not is_idle):
            return
        self.wants = self.stale = False
        if begun - self._told_at > TOLD_EVERY:
            self._told_at, self._told = begun, self._look()
        self.snapshot = self._kept or self.painter.snapshot(self.sim, self.hands.drag)
        self._kept = None
        if self.painter.error:
            self.error, self.painter.error = self.painter.error, ""
        for notify in self.listeners:
            notify()
        now = self.clock()
        self._cost = now - begun
        self._next_picture = now + (0.0 if self.paused else min(self._cost / PICTURES, SLOWEST))

    # -- recordings ----------------------------------------------------------------------------

    def record_to(self, path: Path) -> None:
        """Record every frame from the present one on.  Raises SceneError for a bad place."""
        self.recorder.begin(path, self.scene, self.color, self.hello())
        self._keep()

    def _keep(self) -> None:
        if self.recorder.needs_shot:
            self._kept = self.painter.snapshot(self.sim, self.hands.drag)
        try:
            self.recorder.keep(self.sim, self._kept)
        except TisoftError as error:
            self.error, self.said = str(error), ""

    def _write_on(self) -> None:
        """Write a piece of what was recorded; the simulation stands still meanwhile."""
        try:
            self.said = self.recorder.write_on() or self.said
        except TisoftError as error:
            self.error = str(error)
        if self.recorder.writes:
            self.want()
        else:
            self._due = self.clock()
        self.stale = True

    # -- orders --------------------------------------------------------------------------------

    def pause(self, viewer: Any, on: bool) -> None:
        """Stop, or go on from the present state."""
        self.paused, self.singles = on, 0
        if not on:
            self.error, self.failed = "", False
            self._meter.clear()

    def single(self, viewer: Any) -> None:
        """One frame, then pause."""
        self.paused, self.error, self.failed = True, "", False
        self.singles += 1

    def reset(self, viewer: Any) -> None:
        """Begin the scene anew: time, pins, loads, guard; the materials stay as they are set."""
        self.hands.drop_all()
        if not self.owns:
            raise SceneError("this run belongs to a script, which alone can begin it anew")
        self.error, self.failed = "", False
        self.put_back()
        self.adopt(self._begin())
        self.wants = True

    def put_back(self) -> None:
        """Put pins and obstacles where the scene has them."""
        pins, obstacles = self._at_first
        for body, own in zip(self.scene.bodies, pins, strict=True):
            body.pins[:] = own
        self.scene.obstacles[:] = obstacles

    def undo(self, viewer: Any) -> None:
        """Take the last change of a number back, and go on where it was what failed."""
        self.said = f"undone: {self.changes.undo()}"
        if self.failed:
            self.pause(viewer, False)
        self.error, self.failed = "", False

    def record(self, viewer: Any, on: bool, kind: str) -> None:
        """Begin a recording in the present folder, or end the one that runs."""
        if not on:
            self.recorder.stop()
        elif self.recorder.recording is None:
            self.record_to(free_name(kind))
            self.said = ""

    def set_speed(self, viewer: Any, value: float) -> None:
        """Simulated seconds per second."""
        self.speed = value

    def set_color(self, viewer: Any, name: str) -> None:
        """What colours show."""
        if name == "stress":
            node_values(self.sim, name)  # refuses springs without a volume
        self.painter.color, self.painter.top, self.wants = name, 0.0, True

    def set_hold(self, viewer: Any, on: bool) -> None:
        """Keep the colours' range."""
        self.painter.hold = on

    def set_range(self, viewer: Any, value: float) -> None:
        """Give the colours' range its upper end, and keep it."""
        self.painter.hold, self.painter.top = True, value

    def set_gravity(self, viewer: Any, value: float) -> None:
        """The component along the scene's gravity, or along −y where it has none [m/s²]."""
        self.changes.gravity(value)
        self.error = ""

    def set_material(self, viewer: Any, body: int, name: str, value: float) -> None:
        """A number of a body's model."""
        self.changes.material(body, name, value)
        self.error = ""

    # -- what is told --------------------------------------------------------------------------

    def real_time_factor(self) -> float:
        """Simulated seconds per second, over the last frames."""
        if len(self._meter) < 2 or self.paused:
            return 0.0
        (begun, first), (now, last) = self._meter[0], self._meter[-1]
        return (last - first) / max(now - begun, 1e-9)

    def status(self) -> dict[str, Any]:
        """What the panel tells, for JSON."""
        return {
            "time": self.sim.time,
            "real_time": self.real_time_factor(),
            "dropped": self.dropped,
            "speed": self.speed,
            "paused": self.paused,
            "error": self.error,
            "said": self.said,
            "undo": self.changes.last,
            "color": self.color,
            "hold": self.painter.hold,
            **self.hands.told(),
            "recoveries": len(self.sim.recoveries),
            "numbers": self.changes.numbers(),
            "recording": self.recorder.told(),
            **self._told,
        }

    def _look(self) -> dict[str, Any]:
        sim = self.sim
        step = sim.steps[-1] if sim.steps else None
        limit = sim.limit.nearest()
        known = step is not None and np.isfinite(limit) and limit > 0.0
        found = limiting(sim.limit)
        self.painter.blame(found)
        return {
            "step": step,
            "share": step / limit if step is not None and known else None,
            "limit": {
                "kind": found.kind,
                "element": int(found.element),
                "body": found.part.body.name if found.part is not None else "",
            },
            "warnings": sim.warnings,
        }

    def hello(self) -> dict[str, Any]:
        """What a page needs before the first picture, for JSON."""
        told = self.changes.numbers()
        bodies = [
            {"name": body.name, "kind": type(body.model).__name__, "model": model}
            for body, model in zip(self.scene.bodies, told["models"], strict=True)
        ]
        return {
            "bodies": bodies,
            "gravity": told["gravity"],
            "down": self.changes.down.tolist(),
            "colors": list(COLORS),
            "color": self.color,
            **self.painter.hello(self.sim),
        }


def _subject(viewer: Any, order: dict[str, Any]) -> tuple[Any, ...]:
    """What an order is about: a later one about the same supersedes it."""
    return id(viewer), order["do"], order.get("body"), order.get("name")


_ORDERS: dict[str, Callable[[Controller], Callable[..., None]]] = {
    "grab": lambda control: control.hands.grab,
    "pin": lambda control: control.hands.carry_pin,
    "obstacle": lambda control: control.hands.carry_obstacle,
    "drag": lambda control: control.hands.move,
    "drop": lambda control: control.hands.drop,
    "pause": lambda control: control.pause,
    "step": lambda control: control.single,
    "reset": lambda control: control.reset,
    "undo": lambda control: control.undo,
    "record": lambda control: control.record,
    "speed": lambda control: control.set_speed,
    "color": lambda control: control.set_color,
    "hold": lambda control: control.set_hold,
    "range": lambda control: control.set_range,
    "gravity": lambda control: control.set_gravity,
    "material": lambda control: control.set_material,
}
