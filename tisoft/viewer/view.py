"""The page for notebooks and scripts: the caller owns the loop."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

from tisoft import checks
from tisoft.checks import FieldError
from tisoft.errors import SceneError
from tisoft.runtime import ARCHS
from tisoft.scene import Scene
from tisoft.simulation import Frame, Simulation
from tisoft.viewer.controller import Controller
from tisoft.viewer.orders import COLORS
from tisoft.viewer.server import Server

HEIGHT = 560
"""Pixels of the page in a notebook."""


class View:
    """A running scene, served as a page from now until `close`; made by `view`."""

    def __init__(self, control: Controller, server: Server, proxy: str | None) -> None:
        self.control = control
        self._server = server
        self._proxy = proxy
        self.is_open = True
        """Whether the page is served."""

    @property
    def sim(self) -> Simulation:
        """What is shown; after a reset another one."""
        return self.control.sim

    @property
    def url(self) -> str:
        """The page's address, with the key that opens it."""
        return self._server.url

    def _repr_html_(self) -> str:
        address = self.url
        if self._proxy is not None:
            address = f"{self._proxy.rstrip('/')}/proxy/{self._server.port}/?key={self._server.key}"
        return (
            f'<iframe src="{address}" width="100%" height="{HEIGHT}" '
            'style="border: 0" allow="fullscreen"></iframe>'
        )

    def run(self, seconds: float | None = None) -> None:
        """Step and pace for so many simulated seconds; left out, until `close`, or until Ctrl-C or
        a notebook's interrupt button, which end this call and nothing else.
        """
        try:
            for _ in self.frames(seconds):
                pass
        except KeyboardInterrupt:
            self.control.hands.drop_all()

    def frames(self, seconds: float | None = None) -> Iterator[Frame]:
        """The present frame, then each as it is made, in step with the clock: for so many simulated
        seconds, or until `close`.  Pauses and failures are waited out: the page tells of them.
        """
        if seconds is not None:
            checks.number("seconds", seconds, least=0.0, unit="s")
        control = self.control
        frame = 1.0 / control.scene.frame_rate
        end = None if seconds is None else control.sim.time + seconds - 0.5 * frame
        yield control.sim.here()
        while self.is_open and (end is None or control.sim.time < end):
            if control.tick():
                yield control.sim.here()

    def record(self, path: str | Path) -> None:
        """Record every frame from the present one on, into a film (.mp4, .gif, .webp) or a page
        that plays by itself (.html).  Raises SceneError for a bad place.
        """
        if self.control.recorder.recording is not None:
            raise SceneError(
                f"{self.control.recorder.recording.path} is being recorded; end that first"
            )
        self.control.record_to(checks.path("path", path, "a film or a page"))

    def end_recording(self) -> int:
        """Write what was recorded; returns its frames."""
        return max(self.control.recorder.rest(), default=0)

    def close(self) -> None:
        """Write what is recorded, put pins and obstacles back, and end the page."""
        if self.is_open:
            self.is_open = False
            self.end_recording()
            self.control.hands.drop_all()
            self.control.put_back()
            self._server.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    # -- as an observer of a run -----------------------------------------------------------------

    def on_start(self, sim: Simulation) -> None:
        """Show this run from now on.  Raises SceneError for other bodies than those shown."""
        shown = [body.mesh for body in self.control.scene.bodies]
        bodies = [body.mesh for body in sim.scene.bodies]
        if len(shown) != len(bodies) or any(a is not b for a, b in zip(shown, bodies, strict=True)):
            raise SceneError("this view shows other bodies; make one of this run's scene")
        self.control.hands.drop_all()
        self.control.owns = sim is self.control.sim and self.control.owns
        self.control.adopt(sim)

    def on_frame(self, frame: Frame) -> None:
        """Show a frame, and wait until the next one is due."""
        if self.is_open:
            self.control.stepped()
            self.control.pace()

    def on_end(self, sim: Simulation) -> None:
        """Let go."""
        self.control.hands.drop_all()


def view(
    shown: Scene | Simulation,
    *,
    port: int = 0,
    host: str = "127.0.0.1",
    color: str | None = None,
    speed: float = 1.0,
    arch: str = "cpu",
    proxy: str | None = None,
) -> View:
    """Serve a scene as a page that takes its bodies in the hand, at once.

        view = ts.view(scene)
        view                           # in a notebook: the page
        view.run()                     # or: for frame in view.frames(): …
        sim.run(2.0, observers=[view])     # or a run of one's own

    Args:
        shown: a scene, or a simulation that runs already (of `Simulation(scene, interactive=True)`
            nothing compiles on the way).
        port: of the page; 0: any free one.
        host: where to listen; 127.0.0.1 is this machine alone.
        color: "stress", "strain", "speed", "body" or "region"; left out, the scene's.
        speed: simulated seconds per second.
        arch: "cpu", "cuda", "metal", "vulkan" or "auto".
        proxy: the notebook server's base address, where it has jupyter-server-proxy: the page in a
            notebook then comes through that; left out, JupyterHub's where there is one.

    Raises:
        SceneError: a scene that cannot run, or a port that is taken.
    """
    sim = shown if isinstance(shown, Simulation) else None
    scene = sim.scene if sim is not None else shown
    if not isinstance(scene, Scene):
        raise FieldError("shown", "must be a Scene or a Simulation", shown)
    checks.integer("port", port, most=65535)
    checks.choice("arch", arch, ARCHS)
    if color is not None:
        checks.choice("color", color, COLORS)
    checks.number("speed", speed)
    wanted = color or (scene.render.color if scene.render.color in COLORS else "stress")
    if wanted not in COLORS:
        raise SceneError(f"color is {wanted!r}; give one of {', '.join(COLORS)}")
    if not 0.01 <= speed <= 10.0:
        raise SceneError(f"speed is {speed:g}; give a number from 0.01 to 10")
    control = Controller(scene, sim=sim, arch=arch, color=wanted, speed=speed)
    server = Server(control, host=host, port=port)
    return View(control, server, proxy or os.environ.get("JUPYTERHUB_SERVICE_PREFIX"))
