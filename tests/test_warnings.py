"""What a run tells besides results."""

import numpy as np
import pytest

import tisoft as ts
from tisoft import runtime
from tisoft.check.warnings import warnings_of


def spinning(model, rate=2.0):
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64", frame_rate=50.0)
    scene.add_body(ts.box((1.0, 0.5, 0.5), (4, 2, 2)), model, "bar", spin=(0.0, 0.0, rate))
    return ts.Simulation(scene)


def test_linear_body_that_turns_is_told_its_angle_and_error():
    sim = spinning(ts.Linear(1e5, 0.3, 1000.0))
    for _ in range(5):
        sim.step()
    assert sim.warnings == []  # 11 degrees
    while sim.time < 0.5 - 1e-9:
        sim.step()
    apparent = np.degrees(np.arctan(2.0 * sim.time))  # REFERENCES A12
    (warning,) = sim.warnings
    assert f"turned by {apparent:.0f} degrees" in warning
    # 44.8 degrees: 35 % (A4b); linear between the rows of that table
    assert "36 % too large" in warning


def test_objective_body_may_turn():
    sim = spinning(ts.ViscoElastic(1e5, 0.3, 1000.0))
    for _ in range(50):
        sim.step()
    assert sim.warnings == []


def test_inverted_tets_are_counted_and_told():
    sim = spinning(ts.ViscoElastic(1e5, 0.3, 1000.0), rate=0.0)
    x = sim.positions()
    x[:, 2] *= -1.0
    sim.set_state(x, 0.0 * x)
    sim.step()
    assert sim.watch.inverted == sim.system.elements
    (warning,) = sim.warnings
    assert warning.startswith(f"{sim.system.elements} elements were inside out")
    assert "t = 0.02 s" in warning


@pytest.mark.parametrize("model", [ts.ViscoElastic, ts.NeoHookean])
def test_no_tet_is_inverted_at_rest(model):
    sim = spinning(model(1e5, 0.3, 1000.0), rate=0.0)
    sim.step()
    assert sim.watch.inverted == 0


def test_that_surfaces_do_not_touch_on_a_device_is_told(monkeypatch):
    cube, model = ts.box((1.0, 1.0, 1.0), (1, 1, 1)), ts.ViscoElastic(1e5, 0.3, 1000.0)
    scene = ts.Scene()
    for place in (0.0, 2.0):
        scene.add_body(cube.transformed(translate=(place, 0, 0)), model)
    assert warnings_of(scene) == []
    monkeypatch.setattr(runtime, "on_device", lambda: True)
    (told,) = warnings_of(scene)
    assert "bodies pass through each other" in told and "--arch cpu" in told
    scene.bodies[1].contact = False
    assert warnings_of(scene) == []
