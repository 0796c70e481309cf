"""What every viewer shares, without a window: the hand, pacing, orders, pictures' data.

The simulation lives in the thread that calls `Controller.tick` for ever.  Viewers post orders (from
any thread) and read `snapshot`, the data of the latest picture; neither waits for the other.
A snapshot is made only when somebody `wants` one, so a frame that no page shows costs nothing.
"""

from __future__ import annotations

import collections
import dataclasses
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import SceneError, TisoftError
from tisoft.observers.quantities import node_values
from tisoft.scene import Scene
from tisoft.simulation import Simulation
from tisoft.viewer.drawn import Drawn
from tisoft.viewer.orders import COLORS, MATERIAL
from tisoft.viewer.picking import patch

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


@dataclasses.dataclass(frozen=True)
class Snapshot:
    """Data of one picture."""

    number: int
    drag: int
    """Number of the last drag that this state has felt."""
    time: float
    positions: NDArray[np.float32]
    """Of the drawn rows [m], shape (rows, 3)."""
    values: NDArray[np.uint8]
    """0 to 255 from 0 to `top`, shape (rows,)."""
    top: float
    color: str


class Controller:
    """A running scene in the hands of viewers.

    Args:
        scene: its frame rate is raised to LEAST_RATE.
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
        arch: str = "cpu",
        color: str = "stress",
        speed: float = 1.0,
        clock: Callable[[], float] = time.perf_counter,
        wait: Callable[[float], Any] | None = None,
    ) -> None:
        self.scene = dataclasses.replace(scene, frame_rate=max(scene.frame_rate, LEAST_RATE))
        self.arch, self.color, self.speed = arch, color, speed
        self.clock = clock
        self._wake = threading.Event()
        self.wait = wait or self._sleep
        self.drawn = Drawn(self.scene)
        self.orders: collections.deque[tuple[Any, dict[str, Any]]] = collections.deque()
        self.listeners: list[Callable[[], None]] = []
        self.wants = True
        """Whether somebody waits for a newer snapshot."""
        self.stale = False
        """Whether the state is newer than the snapshot."""
        self.paused, self.error, self.last_change = False, "", ""
        self.singles = 0
        self.hold = False
        self.top = 0.0
        self.number = 0
        self.dropped = 0.0
        """Seconds of debt dropped so far."""
        self.hands: dict[Any, Any] = {}
        self.drag = 0
        self.sim = self._begin()
        self.snapshot = self._snapshot()

    def _begin(self) -> Simulation:
        elements = sum(len(b.mesh.tets) for b in self.scene.bodies)
        threads = 1 if elements <= FEW_ELEMENTS else None
        sim = Simulation(self.scene, arch=self.arch, threads=threads)
        sim.energy()  # compiles, while nobody looks yet
        self._due = self.clock()
        self._meter: collections.deque[tuple[float, float]] = collections.deque(maxlen=60)
        self._told_at = -np.inf
        self._told: dict[str, Any] = {}
        return sim

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

    def tick(self) -> None:
        """Obey, step where a frame is due, and sleep where none is."""
        self._obey()
        if self.stale:  # changed, or stepped when no page had time for it
            self._publish()
        now = self.clock()
        if self.paused:
            self._due = now
            if self.singles:
                self.singles -= 1
                self._step()
            elif not (self.stale and self.wants):
                self.wait(NAP)
        elif now < self._due:
            self.wait(min(self._due - now, NAP))
        else:
            self._step()
            frame = 1.0 / (self.scene.frame_rate * self.speed)
            self._due += frame
            late = self.clock() - self._due
            if late > max(LATE, 2.0 * frame):
                self.dropped += late
                self._due += late

    def _step(self) -> None:
        try:
            self.sim.step()
        except TisoftError as error:
            self._fail(error)
        self._meter.append((self.clock(), self.sim.time))
        self.stale = True
        self._publish()

    def _fail(self, error: TisoftError) -> None:
        self.drop_all()
        self.paused, self.singles = True, 0
        undo = f"; the last change was {self.last_change}: undo it" if self.last_change else ""
        self.error = f"{str(error).rstrip('.')}{undo}, or reset (Backspace)."

    def _obey(self) -> None:
        self.stale = self.stale or bool(self.orders)
        while self.orders:
            viewer, order = self.orders.popleft()
            asked = {name: value for name, value in order.items() if name != "do"}
            try:
                _ORDERS[order["do"]](self, viewer, **asked)
            except TisoftError as error:
                self.error = str(error)

    def _publish(self) -> None:
        if self.wants:
            self.wants = self.stale = False
            self.snapshot = self._snapshot()
            for notify in self.listeners:
                notify()

    # -- orders --------------------------------------------------------------------------------

    def grab(
        self, viewer: Any, rows: list[int], weights: list[float], point: list[float], number: int
    ) -> None:
        """Take Σ w x of drawn rows in a viewer's hand; its point is to be at `point` [m]."""
        self.drop(viewer)
        held, share = np.array(rows), np.array(weights)
        shown = self.drawn.owner(held)
        if shown is None:
            raise SceneError("a hand holds one body; these rows are of none, or of several")
        mass = self.sim.masses()[self.sim.part(shown.body).nodes]
        nodes, shares = patch(shown.body.mesh.points, mass, shown.rest_point(held, share))
        self.hands[viewer] = self.sim.grab(shown.body, nodes, shares, point)
        self.drag = number

    def move(self, viewer: Any, point: list[float], number: int) -> None:
        """Bring a viewer's hand to a point [m]."""
        if viewer in self.hands:
            self.hands[viewer].target = point
            self.drag = number

    def drop(self, viewer: Any) -> None:
        """Let go of what a viewer holds."""
        hand = self.hands.pop(viewer, None)
        if hand is not None:
            hand.release()

    def drop_all(self) -> None:
        """Let go of everything."""
        for viewer in list(self.hands):
            self.drop(viewer)

    def pause(self, viewer: Any, on: bool) -> None:
        """Stop, or go on from the present state."""
        self.paused, self.singles = on, 0
        if not on:
            self.error = ""

    def single(self, viewer: Any) -> None:
        """One frame, then pause."""
        self.paused, self.error = True, ""
        self.singles += 1

    def reset(self, viewer: Any) -> None:
        """Begin the scene anew: time, pins, loads, guard; the materials stay as they are set."""
        self.drop_all()
        self.error = ""
        self.sim = self._begin()
        self.wants = True

    def set_speed(self, viewer: Any, value: float) -> None:
        """Simulated seconds per second."""
        self.speed = value

    def set_color(self, viewer: Any, name: str) -> None:
        """What colours show."""
        if name == "stress":
            node_values(self.sim, name)  # refuses springs without a volume
        self.color, self.top, self.wants = name, 0.0, True

    def set_hold(self, viewer: Any, on: bool) -> None:
        """Keep the colours' range."""
        self.hold = on

    def set_gravity(self, viewer: Any, value: float) -> None:
        """The component along the scene's gravity, or along −y where it has none [m/s²]."""
        self._changing(f"gravity to {value:g} m/s²")
        self.scene.gravity = tuple(float(value) * c for c in self.down)

    @property
    def down(self) -> NDArray[np.float64]:
        """Unit vector along which gravity is changed."""
        if not hasattr(self, "_down"):
            g = np.asarray(self.scene.gravity, np.float64)
            size = float(np.linalg.norm(g))
            self._down = g / size if size > 0.0 else np.array([0.0, -1.0, 0.0])
        return self._down

    def set_material(self, viewer: Any, body: int, name: str, value: float) -> None:
        """A number of a body's model."""
        if body >= len(self.scene.bodies):
            raise SceneError(f"there is no body {body}")
        own = self.scene.bodies[body]
        if getattr(own.model, name, None) is None:
            raise SceneError(f'the model of "{own.name}" has no {name}')
        own.model = dataclasses.replace(own.model, **{name: value})  # type: ignore[arg-type]
        self._changing(f'{name} of "{own.name}" to {value:.3g}')

    def _changing(self, what: str) -> None:
        self.last_change, self.error = what, ""

    # -- what is shown -------------------------------------------------------------------------

    def _snapshot(self) -> Snapshot:
        self.number += 1
        positions = self.drawn.carried(self.sim.positions()).astype(np.float32)
        values = np.zeros(self.drawn.count, np.uint8)
        if self.color != "body":
            try:
                raw = self.drawn.carried(node_values(self.sim, self.color)[:, None])[:, 0]
                if not self.hold or self.top == 0.0:
                    high = float(np.percentile(raw, 98)) if len(raw) else 0.0
                    self.top = max(0.99 * self.top, high, 1e-30)
                values = np.clip(255.0 / self.top * raw, 0.0, 255.0).astype(np.uint8)
            except SceneError as error:
                self.color, self.error = "body", str(error)
        time, drag = self.sim.time, self.drag
        return Snapshot(self.number, drag, time, positions, values, self.top, self.color)

    def real_time_factor(self) -> float:
        """Simulated seconds per second, over the last frames."""
        if len(self._meter) < 2 or self.paused:
            return 0.0
        (begun, first), (now, last) = self._meter[0], self._meter[-1]
        return (last - first) / max(now - begun, 1e-9)

    def status(self) -> dict[str, Any]:
        """What the panel tells, for JSON."""
        sim = self.sim
        now = self.clock()
        if now - self._told_at > TOLD_EVERY:
            self._told_at, self._told = now, self._look()
        pull = [float(np.linalg.norm(hand.force)) for hand in self.hands.values()]
        return {
            "time": sim.time,
            "real_time": self.real_time_factor(),
            "dropped": self.dropped,
            "speed": self.speed,
            "paused": self.paused,
            "error": self.error,
            "color": self.color,
            "hold": self.hold,
            "pull": sum(pull) if pull else None,
            "recoveries": len(sim.recoveries),
            **self._told,
        }

    def _look(self) -> dict[str, Any]:
        sim = self.sim
        step = sim.steps[-1] if sim.steps else None
        limit = sim.limit.accepted()
        if not np.isfinite(limit):
            limit = sim.limit.sharp()
        share = step / limit if step is not None and np.isfinite(limit) and limit > 0.0 else None
        found = sim.limit.limit()
        return {
            "step": step,
            "share": share,
            "limit": {
                "kind": found.kind,
                "element": int(found.element),
                "body": found.part.body.name if found.part is not None else "",
            },
            "warnings": sim.warnings,
        }

    def hello(self) -> dict[str, Any]:
        """What a page needs before the first picture, for JSON."""
        bodies = []
        for body in self.scene.bodies:
            numbers = {name: getattr(body.model, name, None) for name in MATERIAL}
            known = {n: float(v) for n, v in numbers.items() if isinstance(v, int | float)}
            bodies.append({"name": body.name, "kind": type(body.model).__name__, "model": known})
        lo, hi = self.snapshot.positions.min(axis=0), self.snapshot.positions.max(axis=0)
        obstacles = [{"kind": type(o).__name__.lower(), **_plain(o)} for o in self.scene.obstacles]
        return {
            "bodies": bodies,
            "elements": sum(len(b.mesh.tets) for b in self.scene.bodies),
            "gravity": float(np.asarray(self.scene.gravity) @ self.down),
            "down": self.down.tolist(),
            "lo": lo.tolist(),
            "hi": hi.tolist(),
            "obstacles": obstacles,
            "colors": list(COLORS),
            **self.drawn.topology(self.sim.positions()),
        }


def _plain(obstacle: Any) -> dict[str, Any]:
    kept = ("point", "normal", "center", "radius", "size")
    found = {name: getattr(obstacle, name) for name in kept if hasattr(obstacle, name)}
    return {name: np.asarray(value, np.float64).tolist() for name, value in found.items()}


_ORDERS: dict[str, Callable[..., None]] = {
    "grab": Controller.grab,
    "drag": Controller.move,
    "drop": Controller.drop,
    "pause": Controller.pause,
    "step": Controller.single,
    "reset": Controller.reset,
    "speed": Controller.set_speed,
    "color": Controller.set_color,
    "hold": Controller.set_hold,
    "gravity": Controller.set_gravity,
    "material": Controller.set_material,
}
