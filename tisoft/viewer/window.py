"""A window on a Controller, drawn by Taichi's GGUI: where there is a display and Vulkan.

The window is drawn in the simulation's thread, so it yields: a picture is drawn when the simulation
is not late; while it is, SLOWEST seconds after the last one, or more where a picture takes long.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.observers.framing import up_of
from tisoft.observers.solids import solid_surface
from tisoft.render.obstacles import plane_surface
from tisoft.scene import Plane
from tisoft.viewer.controller import SLOWEST, Controller
from tisoft.viewer.picking import pick
from tisoft.viewer.picture import CULPRIT, Snapshot

Floats = NDArray[np.float64]

SIZE = (1280, 800)
FOV = 40.0
PANEL = (0.24, 0.62)
"""Width and height of the panel, as shares of the window's."""
NEAR_PIXELS = 14.0
"""From the pointer to a spring's end that it takes."""
YIELD = 4.0
"""Times as long as a picture takes that a late simulation has until the next."""
PROBE = """
import os; os.environ["ENABLE_TAICHI_HEADER_PRINT"] = "0"
import taichi as ti
ti.init(arch=ti.cpu, log_level=ti.ERROR)
window = ti.ui.Window("tisoft", (64, 64), show_window=True)
window.get_canvas(); window.show(); print("window is there")
"""
PATIENCE = 30.0
"""Seconds that the attempt to open a window may take."""


def unusable() -> str:
    """Why no window can be opened here; empty where one can.

    Tried in a child process: GLFW ends a process in which it fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        try:
            done = subprocess.run(
                [sys.executable, "-c", PROBE], cwd=folder, capture_output=True, text=True,
                timeout=PATIENCE, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return f"no window opened in {PATIENCE:g} s"
    if "window is there" in done.stdout:
        return ""
    text = " ".join((done.stdout + done.stderr).split())
    if "GLFW" in text:
        return "there is no display"
    return "there is no Vulkan" if "Vulkan" in text else "a window ended the process that opened it"


class Orbit:
    """A camera that turns about a target."""

    def __init__(self, target: Floats, up: Floats, far: float) -> None:
        self.target, self.far = target, far
        self._up = up
        side = np.eye(3)[int(np.argmin(abs(up)))]
        self._right = np.cross(side, up) / np.linalg.norm(np.cross(side, up))
        self._front = np.cross(self._right, up)
        self.around, self.above = 1.2, 0.3

    def axes(self) -> tuple[Floats, Floats, Floats]:
        """Unit vectors to the right, up in the picture, and towards the eye."""
        level = np.cos(self.around) * self._right + np.sin(self.around) * self._front
        back = np.cos(self.above) * level + np.sin(self.above) * self._up
        right = np.cross(self._up, back)
        right /= np.linalg.norm(right)
        return right, np.cross(back, right), back

    @property
    def eye(self) -> Floats:
        """Where it is [m]."""
        return np.asarray(self.target + self.far * self.axes()[2])

    @property
    def up(self) -> Floats:
        """Up in the world."""
        return self._up

    def ray(self, x: float, y: float, aspect: float) -> tuple[Floats, Floats]:
        """Origin and direction of the ray through a point of the picture (0 to 1, from below)."""
        right, up, back = self.axes()
        half = np.tan(np.radians(0.5 * FOV))
        d = (2.0 * x - 1.0) * half * aspect * right + (2.0 * y - 1.0) * half * up - back
        return self.eye, d / np.linalg.norm(d)

    def project(self, points: Floats, aspect: float) -> Floats:
        """Points [m] in the picture, shape (n, 2), 0 to 1 from below left."""
        right, up, back = self.axes()
        d = np.atleast_2d(points) - self.eye
        half = np.tan(np.radians(0.5 * FOV)) * np.maximum(-(d @ back), 1e-12)
        return 0.5 + 0.5 * np.stack([d @ right / (half * aspect), d @ up / half], axis=1)

    def turn(self, across: float, upward: float) -> None:
        """Turn by shares of the picture."""
        self.around += 4.0 * across
        self.above = float(np.clip(self.above - 3.0 * upward, -1.5, 1.5))

    def move(self, across: float, upward: float) -> None:
        """Move the target by shares of the picture."""
        right, up, _ = self.axes()
        self.target = self.target - self.far * (across * right + upward * up)


class Window:
    """The window; raises what GGUI raises where none can be opened (see `unusable`)."""

    def __init__(self, control: Controller, *, size: tuple[int, int] = SIZE) -> None:
        import taichi as ti

        self.ti, self.control = ti, control
        hello = control.hello()
        self._rows = np.array(hello["vertices"], np.int64)
        self._triangles = np.array(hello["triangles"], np.int64)
        self._segments = np.array(hello["segments"], np.int64)
        self._map = np.array(hello["map"], np.float32).reshape(-1, 3) / 255.0
        self._plain = {
            "body": np.array(hello["plain"], np.float32).reshape(-1, 3) / 255.0,
            "region": np.array(hello["regions"], np.float32).reshape(-1, 3) / 255.0,
        }
        lo, hi = np.array(hello["lo"]), np.array(hello["hi"])
        self._size = float(np.linalg.norm(hi - lo))
        self._home = 0.5 * (lo + hi)
        self.orbit = Orbit(self._home, up_of(control.scene), 2.2 * self._size)
        self._held: dict[str, Any] | None = None
        self._last: tuple[float, float] | None = None
        self._drags, self._drawn_at, self._cost = 0, 0.0, 0.0
        self._make(size)

    def _make(self, size: tuple[int, int]) -> None:
        """The window, and fields of what it draws."""
        ti = self.ti
        self._folder = tempfile.TemporaryDirectory()
        with self._aside():
            self.window = ti.ui.Window("tisoft", size, vsync=False)
            self.canvas = self.window.get_canvas()
            self.gui = self.window.get_gui()
        self.canvas.set_background_color((0.87, 0.9, 0.93))
        self.scene, self.camera = self.window.get_scene(), ti.ui.Camera()
        many = max(1, len(self._rows)), max(1, len(self._segments))
        self._places, self._colors = (ti.Vector.field(3, ti.f32, many[0]) for _ in range(2))
        self._ends, self._end_colors = (ti.Vector.field(3, ti.f32, many[1]) for _ in range(2))
        self._index = self._field(self._triangles)
        self._thread = ti.Vector.field(3, ti.f32, 2)
        self._marks = ti.Vector.field(3, ti.f32, 2 * CULPRIT)
        self._things = []
        for obstacle in self.control.scene.obstacles:
            item = _surface(obstacle, self._home, self._size)
            places = ti.Vector.field(3, ti.f32, len(item.positions))
            index = self._field(np.asarray(item.triangles).ravel())
            self._things.append((np.asarray(item.positions, np.float64), places, index))

    def _field(self, numbers: NDArray[Any]) -> Any:
        field = self.ti.field(self.ti.i32, max(1, len(numbers)))
        if len(numbers):
            field.from_numpy(numbers.astype(np.int32))
        return field

    @property
    def is_open(self) -> bool:
        """Whether nobody has closed it."""
        return bool(self.window.running)

    def close(self) -> None:
        """Close it."""
        with self._aside():
            self.window.destroy()
        self._folder.cleanup()

    @contextmanager
    def _aside(self) -> Iterator[None]:
        """In a folder of its own: GGUI writes its imgui.ini wherever the process is."""
        before = os.getcwd()
        os.chdir(self._folder.name)
        try:
            yield
        finally:
            os.chdir(before)

    def show(self) -> None:
        """Draw, where there is time for it, and hand on what mouse and keys ask for."""
        control = self.control
        now = control.clock()
        control.want()
        due = now - self._drawn_at > 1.0 / 60.0 and (control.paused or now < control.due)
        if not due and now - self._drawn_at < max(SLOWEST, YIELD * self._cost):
            return
        self._drawn_at = now
        self._listen(control.snapshot)
        self._draw(control.snapshot)
        self._panel()
        with self._aside():
            self.window.show()
        self._cost = control.clock() - now

    def _post(self, do: str, **words: Any) -> None:
        self.control.post({"do": do, **words}, self)

    # -- the hand ------------------------------------------------------------------------------

    def _listen(self, shot: Snapshot) -> None:
        ti, window = self.ti, self.window
        x, y = window.get_cursor_pos()
        for event in window.get_events(ti.ui.PRESS):
            if event.key == ti.ui.LMB and not (x < PANEL[0] and y > 1.0 - PANEL[1]):
                self._press(x, y, shot)
            self._key(event.key)
        for event in window.get_events(ti.ui.RELEASE):
            if event.key == ti.ui.LMB:
                self._drop()
        if self._last is not None and (x, y) != self._last:
            self._drag(x, y, x - self._last[0], y - self._last[1])
        self._last = (x, y)

    def _aspect(self) -> float:
        wide, high = self.window.get_window_shape()
        return float(wide) / max(1.0, float(high))

    def _press(self, x: float, y: float, shot: Snapshot) -> None:
        if self.window.is_pressed(self.ti.ui.ALT):
            return
        origin, along = self.orbit.ray(x, y, self._aspect())
        body = self._on_body(origin, along, x, y, shot)
        carries = self.window.is_pressed(self.ti.ui.SHIFT)
        thing = self._on_thing(origin, along, shot) if carries else None
        if thing is not None and (body is None or thing[0] < body[0]):
            self._take("obstacle", origin + thing[0] * along, obstacle=thing[1])
        elif body is not None:
            far, rows, weights = body
            kind = "pin" if carries else "grab"
            self._take(kind, origin + far * along, rows=rows, weights=weights)

    def _on_body(
        self, origin: Floats, along: Floats, x: float, y: float, shot: Snapshot
    ) -> tuple[float, list[int], list[float]] | None:
        """Distance, rows and weights of what a ray meets of the bodies."""
        places = shot.positions.astype(np.float64)
        triangles = self._rows[self._triangles].reshape(-1, 3)
        hit = pick(origin, along, places, triangles) if len(triangles) else None
        if hit is not None:
            return hit[0], triangles[hit[1]].tolist(), hit[2].tolist()
        if not len(self._segments):
            return None
        spots = self.orbit.project(places[self._segments], self._aspect())
        away = np.hypot(*((spots - (x, y)) * self.window.get_window_shape()).T)
        if away.min() > NEAR_PIXELS:
            return None
        row = int(self._segments[int(np.argmin(away))])
        return float((places[row] - origin) @ along), [row], [1.0]

    def _on_thing(self, origin: Floats, along: Floats, shot: Snapshot) -> tuple[float, int] | None:
        """Distance and number of the obstacle that a ray meets."""
        found = []
        for number, (_, places, index) in enumerate(self._things):
            triangles = index.to_numpy().reshape(-1, 3).astype(np.int64)
            hit = pick(origin, along, places.to_numpy().astype(np.float64), triangles)
            if hit is not None:
                found.append((hit[0], number))
        return min(found, default=None)

    def _take(self, kind: str, point: Floats, **what: Any) -> None:
        self._drags += 1
        self._held = {"from": point, "to": point, **what}
        self._post(kind, point=point.tolist(), number=self._drags, **what)

    def _drag(self, x: float, y: float, across: float, upward: float) -> None:
        ti, window = self.ti, self.window
        if self._held is not None:
            origin, along = self.orbit.ray(x, y, self._aspect())
            back = self.orbit.axes()[2]
            far = float((self._held["from"] - origin) @ back) / float(along @ back)
            self._held["to"] = origin + far * along
            self._drags += 1
            self._post("drag", point=self._held["to"].tolist(), number=self._drags)
        elif window.is_pressed(ti.ui.RMB):
            self.orbit.move(across, upward)
        elif window.is_pressed(ti.ui.LMB) and not (x < PANEL[0] and y > 1.0 - PANEL[1]):
            self.orbit.turn(across, upward)
        elif window.is_pressed(ti.ui.MMB):
            self.orbit.far *= float(np.exp(-2.0 * upward))

    def _drop(self) -> None:
        if self._held is not None:
            self._held = None
            self._post("drop")

    def _key(self, key: str) -> None:
        ti, control = self.ti, self.control
        if key == ti.ui.SPACE:
            self._post("pause", on=not control.paused)
        elif key in (ti.ui.RIGHT, "n"):
            self._post("step")
        elif key == ti.ui.BACKSPACE:
            self._post("reset")
        elif key == "u":
            self._post("undo")
        elif key == "v":
            self._post("record", on=control.recorder.recording is None, kind="mp4")
        elif key == "h":
            self._post("hold", on=not control.painter.hold)
        elif key == "f":
            self.orbit.target, self.orbit.far = self._home, 2.2 * self._size
        elif key == ti.ui.ESCAPE:
            self._drop()

    # -- the picture ---------------------------------------------------------------------------

    def _draw(self, shot: Snapshot) -> None:
        scene, orbit = self.scene, self.orbit
        self.camera.position(*orbit.eye)
        self.camera.lookat(*orbit.target)
        self.camera.up(*orbit.up)
        self.camera.fov(FOV)
        scene.set_camera(self.camera)
        scene.ambient_light((0.45, 0.45, 0.45))
        scene.point_light(tuple(orbit.eye + 2.0 * self._size * orbit.up), (0.7, 0.7, 0.7))
        colors = self._plain.get(shot.color)
        colors = self._map[shot.values] if colors is None else colors
        if len(self._rows):
            self._places.from_numpy(np.ascontiguousarray(shot.positions[self._rows]))
            self._colors.from_numpy(np.ascontiguousarray(colors[self._rows]))
            scene.mesh(self._places, self._index, per_vertex_color=self._colors, two_sided=True)
        if len(self._segments):
            self._ends.from_numpy(np.ascontiguousarray(shot.positions[self._segments]))
            self._end_colors.from_numpy(np.ascontiguousarray(colors[self._segments]))
            scene.lines(self._ends, width=2.0, per_vertex_color=self._end_colors)
        self._draw_things(shot)
        if self._held is not None and "rows" in self._held:
            at = np.array(self._held["weights"]) @ shot.positions[self._held["rows"]]
            self._thread.from_numpy(np.array([at, self._held["to"]], np.float32))
            scene.lines(self._thread, width=3.0, color=(0.08, 0.38, 0.74))
        self.canvas.scene(scene)

    def _draw_things(self, shot: Snapshot) -> None:
        poses = shot.extra[: 7 * len(self._things)].reshape(-1, 7).astype(np.float64)
        for (rest, places, index), row in zip(self._things, poses, strict=True):
            now = rest + 2.0 * np.cross(row[3:6], np.cross(row[3:6], rest) + row[6] * rest)
            places.from_numpy((now + row[:3]).astype(np.float32))
            self.scene.mesh(places, indices=index, color=(0.8, 0.82, 0.84), two_sided=True)
        marks = shot.extra[len(shot.extra) - 6 * CULPRIT :].reshape(-1, 3)
        if not np.isnan(marks).all():
            self._marks.from_numpy(np.where(np.isnan(marks), marks[:1], marks))
            self.scene.lines(self._marks, width=2.0, color=(0.83, 0.08, 0.35))

    def _panel(self) -> None:
        control, told = self.control, self.control.status()
        with self.gui.sub_window("tisoft", 0.005, 0.005, *PANEL) as panel:
            panel.text(f"t = {told['time']:.2f} s  real time x {told['real_time']:.2f}")
            share = (
                "" if told["share"] is None else f", {100 * told['share']:.0f} % of the stable one"
            )
            panel.text(f"step {told['step'] or 0.0:.2e} s{share}")
            limit = told["limit"]
            panel.text(f"set by {limit['kind']} {limit['element']} of {limit['body']}")
            panel.text("" if told["pull"] is None else f"pull {told['pull']:.3g} N")
            for sentence in (told["said"], told["error"], *told["warnings"]):
                if sentence:
                    panel.text(sentence)
            if panel.button("go on" if control.paused else "pause"):
                self._post("pause", on=not control.paused)
            for label, do in (("frame", "step"), ("reset", "reset"), ("undo", "undo")):
                if panel.button(label):
                    self._post(do)
            if panel.button("end" if control.recorder.recording else "record"):
                self._post("record", on=control.recorder.recording is None, kind="mp4")
            for name in ("stress", "strain", "speed", "body", "region"):
                if panel.button(name):
                    self._post("color", name=name)
            self._sliders(panel, told["numbers"])

    def _sliders(self, panel: Any, numbers: dict[str, Any]) -> None:
        """Young's modulus by its logarithm, what may be 0 as it is."""
        now = numbers["gravity"]
        new = panel.slider_float("gravity", now, -20.0, 20.0)
        if abs(new - now) > 1e-3:
            self._post("gravity", value=float(new))
        for body, model in enumerate(numbers["models"]):
            name = self.control.scene.bodies[body].name
            for key, now in model.items():
                if key == "young":
                    old = float(np.log10(now))
                    new = panel.slider_float(f"lg young, {name}", old, 2.0, 11.0)
                    if abs(new - old) > 1e-3:
                        self._post("material", body=body, name=key, value=float(10.0**new))
                else:
                    most = 0.49 if key == "poisson" else 100.0
                    new = panel.slider_float(f"{key}, {name}", now, 0.0, max(most, now))
                    if abs(new - now) > 1e-3 * most:
                        self._post("material", body=body, name=key, value=float(new))


def _surface(obstacle: Any, middle: Floats, size: float) -> Any:
    """What shows an obstacle, where the scene has it."""
    if isinstance(obstacle, Plane):
        normal = np.array(obstacle.normal)
        below = normal * (normal @ (middle - np.array(obstacle.point)))
        return plane_surface(middle - below, normal, 6.0 * size)
    return solid_surface(obstacle)
