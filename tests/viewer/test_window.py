"""The window: its camera anywhere; itself under Xvfb with a software Vulkan, where these are."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tisoft.viewer.window import Orbit, unusable

SCRIPT = """
import tisoft as ts
from tisoft.viewer.controller import Controller
from tisoft.viewer.window import Window, unusable
why = unusable()
if why:
    print("no window:", why)
    raise SystemExit
scene = ts.Scene()
body = scene.add_body(ts.box((0.4, 0.1, 0.1), (4, 1, 1)), ts.ViscoElastic(2e4, 0.3, 1000.0))
body.pin(ts.where.box((-1, -1, -1), (0.001, 1, 1)))
scene.add_obstacle(ts.Sphere((0.3, -0.6, 0.05), 0.1))
control = Controller(scene)
window = Window(control, size=(320, 240))
window.show()
x, y = window.orbit.project(control.snapshot.positions[-1].astype(float), 320 / 240)[0]
window._press(float(x) - 0.01, float(y) - 0.01, control.snapshot)
window._drag(float(x), float(y) + 0.1, 0.0, 0.1)
control.tick()
held = control.hands.held
hand = held[window]
window._drop()
window._key(" ")
control.tick()
window.show()
window.close()
print("pulled", hand.target[1] > control.snapshot.positions[-1][1], control.paused, held)
"""


def test_what_the_camera_shows_is_where_its_ray_goes():
    orbit = Orbit(np.array([1.0, 2.0, 3.0]), np.array([0.0, 1.0, 0.0]), 4.0)
    orbit.turn(0.2, -0.1)
    origin, along = orbit.ray(0.3, 0.8, 1.6)
    assert np.allclose(orbit.project(origin + 2.5 * along, 1.6), (0.3, 0.8))
    assert np.allclose(orbit.project(orbit.target, 1.6), (0.5, 0.5))


def test_a_window_pulls_and_pauses(tmp_path):
    if shutil.which("Xvfb") is None:
        pytest.skip("no Xvfb to open a window in")
    if not list(Path("/usr/share/vulkan/icd.d").glob("lvp*")):
        pytest.skip("no software Vulkan (mesa-vulkan-drivers)")
    ends, tells = os.pipe()
    screen = subprocess.Popen(
        ["Xvfb", "-displayfd", str(tells), "-screen", "0", "400x300x24"],
        pass_fds=[tells],
        stderr=subprocess.DEVNULL,
    )
    try:
        os.close(tells)
        with open(ends) as told:
            number = told.readline().strip()
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT],
            env=os.environ | {"DISPLAY": f":{number}"},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
    finally:
        screen.terminate()
        screen.wait()
    assert "pulled True True {}" in done.stdout, done.stdout + done.stderr
    assert not list(tmp_path.iterdir())


def test_without_a_display_it_says_so(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert "display" in unusable()
