"""What the caller changes between frames acts from the next frame on, as if it had been so."""

from dataclasses import replace

import numpy as np
import pytest
from beams import CLAMPED, beam, rubber, simulate

import tisoft as ts
from tisoft import where
from tisoft.checks import FieldError
from tisoft.simulation import Simulation

G = (0.0, 0.0, -9.81)
KEYS = {"h": 5e-4, "substeps": 40, "gravity": G}


def _springs(**keys):
    return ts.MassSpring(young=1e6, density=1000.0, **keys)


CHANGES = {
    "softer": (rubber(), rubber(), {"young": 5e5}),
    "viscous": (rubber(), rubber(), {"phi": 50.0, "eta": 50.0}),
    "not viscous": (rubber(phi=50.0, eta=50.0), rubber(), {}),
    "dragged": (rubber(), rubber(), {"point_damping": 5.0}),
    "heavier": (rubber(), rubber(), {"density": 3000.0}),
    "heavier, consistent": (
        rubber(mass="consistent"),
        rubber(mass="consistent"),
        {"density": 3000.0},
    ),
    "mass-tensor": (rubber(ts.MassTensor), rubber(ts.MassTensor), {"young": 5e5, "eta": 30.0}),
    "springs": (_springs(), _springs(), {"young": 5e5, "spring_damping": 2.0}),
    "heavier springs": (_springs(), _springs(), {"density": 3000.0}),
}


@pytest.mark.parametrize("name", CHANGES)
def test_changed_material(name):
    """Against a simulation made anew with the changed material, from the same state."""
    first, second, changes = CHANGES[name]
    changed = replace(second, **changes)
    mesh = beam()
    sim = simulate((mesh, first), pins=[(CLAMPED, "xyz")], **KEYS)
    sim.step()
    anew = simulate((mesh, changed), pins=[(CLAMPED, "xyz")], **KEYS)
    anew.set_state(sim.positions(), sim.velocities())
    sim.scene.bodies[0].model = changed
    for _ in range(3):
        sim.step()
        anew.step()
    assert np.abs(sim.positions() - anew.positions()).max() < 1e-12
    assert sim.energy()["elastic"] == pytest.approx(anew.energy()["elastic"], rel=1e-9)
    assert sim.stable_step() == pytest.approx(anew.stable_step(), rel=1e-9)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (rubber(), rubber(ts.NeoHookean)),
        (rubber(), rubber(mass="consistent")),
        (rubber(ts.Linear), rubber(ts.MassTensor)),
        (rubber(), _springs()),
        (_springs(), rubber()),
        (_springs(), _springs(springs=[[0, 1], [1, 2]])),
    ],
)
def test_another_kind_of_model_is_refused(first, second):
    sim = simulate((beam(), first), **KEYS)
    sim.step()
    sim.scene.bodies[0].model = second
    with pytest.raises(FieldError, match=r"body\[0\].model .*make a new Simulation"):
        sim.step()


def test_changed_gravity():
    sim = simulate((beam(), rubber()), **KEYS)
    sim.step()
    sim.scene.gravity = (5.0, 0.0, 0.0)
    before = sim.velocities()
    sim.step()
    gained = sim.velocities() - before
    assert gained == pytest.approx(np.tile([0.1, 0, 0], (len(gained), 1)), abs=1e-9)


def test_new_pin_holds_and_a_removed_one_lets_go():
    mesh = beam()
    scene = ts.Scene(gravity=G, frame_rate=50.0, step=5e-4, precision="f64")
    body = scene.add_body(mesh, rubber())
    sim = Simulation(scene, threads=1)
    sim.step()
    held = mesh.points[:, 0] < 1e-9
    body.pin(CLAMPED)
    before = sim.positions()
    sim.step()
    assert (sim.positions()[held] == before[held]).all()
    assert (sim.velocities()[held] == 0).all()
    body.pins.clear()
    sim.step()
    assert (sim.velocities()[held, 2] < 0).all()


def test_moved_pin_carries_its_nodes_and_lets_them_go_with_their_speed():
    mesh = ts.net([[0, 0, 0], [1, 0, 0]], [[0, 1]])
    scene = ts.Scene(gravity=(0, 0, 0), frame_rate=50.0, step=1e-3, precision="f64")
    body = scene.add_body(mesh, ts.MassSpring(stiffness=1e-9, node_mass=1.0))
    body.pin(where.nodes([0]), velocity=(0, 0.5, 0), release=0.2)
    sim = Simulation(scene, threads=1)
    for frame in range(1, 31):
        sim.step()
        assert sim.positions()[0, 1] == pytest.approx(0.5 * frame / 50, rel=1e-9)
    assert sim.velocities()[0] == pytest.approx([0, 0.5, 0], abs=1e-7)


def test_new_load_pushes():
    mesh = beam()
    sim = simulate((mesh, rubber()), h=5e-4, substeps=40)
    sim.step()
    sim.scene.bodies[0].load(where.everything(), force=(0, 80.0, 0))
    sim.step()
    momentum = 80.0 * 40 * 5e-4
    mass = sim.masses()[:, None]
    assert (mass * sim.velocities()).sum(axis=0) == pytest.approx([0, momentum, 0], abs=1e-9)
