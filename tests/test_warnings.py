"""What a run tells besides results."""

import numpy as np
import pytest

import tisoft as ts
from tisoft import runtime
from tisoft.check.warnings import warnings_of
from tisoft.checks import FieldError
from tisoft.model.part import parts_of
from tisoft.stable.inside import Inside


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


@pytest.mark.parametrize("axis", range(3))
def test_a_turn_is_told_about_whichever_axis(axis):
    sim = spinning(ts.Linear(1e5, 0.3, 1000.0))
    x = sim.positions()
    sim.set_state(x + np.cross(np.eye(3)[axis], x - x.mean(axis=0)), 0.0 * x)
    sim.watch.look(0.3)
    (warning,) = sim.warnings
    assert "turned by 45 degrees (t = 0.3 s)" in warning


def test_a_push_is_told_by_the_most_that_was_seen_of_it():
    watch = spinning(ts.Linear(1e5, 0.3, 1000.0)).watch
    watch.note_push("a", "b", 0, (0.1, 0.0, 2.0))
    (told,) = watch.pushed()
    assert told.startswith('body "a" starts with faces inside b, 0.1 m deep, and is pushed out ')
    watch.note_push("a", "b", 7, (0.05, 0.0, 3.0))
    (told,) = watch.pushed()
    assert "starts with 7 nodes inside b, 0.1 m deep, and is pushed out within 3 s;" in told


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_what_lies_between_nodes_is_told_in_any_size(size):
    """A ball of a tenth of a spring's length around the spring's middle."""
    net = ts.net([[0, 0, 0], [size, 0, 0], [0, size, 0]], [[0, 1], [1, 2], [2, 0]])
    scene = ts.Scene()
    scene.add_body(net, ts.MassSpring(stiffness=1.0, node_mass=1.0), "net")
    parts = parts_of(scene.bodies)
    inside, ball = Inside(parts), ts.Sphere((0.5 * size, 0, 0), 0.1 * size)
    far = ts.Sphere((0.5 * size, 0.11 * size, 0), 0.1 * size)
    inside.look(parts, (far, ball), 0.2, net.points[parts[0].order])
    (told,) = inside.warnings()
    assert f"was {0.1 * size:.3g} m inside obstacle[1] between its nodes" in told
    assert f"at ({0.5 * size:.4g}, 0, 0) at t = 0.2 s" in told


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


def test_a_thickness_that_a_body_cannot_have_is_told():
    """Larger than the body: refused.  Smaller than contact can keep, or so large that it would meet
    its own neighbours: what it keeps instead.
    """
    cube, model = ts.box((0.2, 0.2, 0.2), (2, 2, 2)), ts.ViscoElastic(1e5, 0.3, 1000.0)
    scene = ts.Scene()
    body = scene.add_body(cube, model, "cube")
    body.thickness = 0.01
    assert warnings_of(scene) == []
    body.thickness = 1e-9
    (told,) = warnings_of(scene)
    assert "keeps 2 mm from others, not the 1e-09 m" in told
    body.thickness = 0.07
    assert warnings_of(scene) == []
    body.self_contact = True
    (told,) = warnings_of(scene)
    assert "keeps 50 mm from itself and others, not the 70 mm of its thickness" in told
    (toucher,) = ts.Simulation(scene).touching.touchers
    assert toucher.thickness == pytest.approx(0.05)
    with pytest.raises(FieldError, match=r"thickness = 10.* is only 0.2 m long"):
        body.thickness = 10.0
        body.validate()
