"""A simulation that goes on from a checkpoint is the one that never stopped."""

import numpy as np
import pytest

import tisoft as ts
from tisoft.errors import SceneError


def falling_pair(precision="f32", *, contact=True):
    scene = ts.Scene(precision=precision, frame_rate=50.0)
    block = ts.box((0.2, 0.2, 0.2), (2, 2, 2))
    soft = scene.add_body(block, ts.ViscoElastic(5e3, 0.3, 1000.0, eta=2.0), spin=(1.0, 0.0, 0.5))
    soft.pin(ts.where.nearest((0.2, 0.2, 0.2)), release=0.1)
    cloth = ts.cloth((0.5, 0.5), (4, 4)).transformed(translate=(1.0, 0.5, 0.0))
    sheet = scene.add_body(cloth, ts.MassSpring(stiffness=200.0, node_mass=0.01))
    sheet.pin(ts.where.nodes([0]), velocity=(0.0, 0.2, 0.0))
    scene.add_obstacle(ts.Plane(point=(0.0, -0.1, 0.0), friction=0.4))
    soft.contact = sheet.contact = contact
    scene.add_probe("corner", soft, point=(0.0, 0.0, 0.0))
    return scene


def state(sim):
    system = sim.system
    return system.u.tobytes(), system.v.tobytes(), sim.time, sim.frame, sim.substeps


@pytest.mark.parametrize(("precision", "contact"), [("f32", True), ("f64", False)])
def test_resumed_run_has_the_bits_of_the_uninterrupted_one(tmp_path, precision, contact):
    whole = ts.Simulation(falling_pair(precision, contact=contact))
    cut = ts.Simulation(falling_pair(precision, contact=contact))
    for _ in range(7):
        whole.step()
        cut.step()
    cut.save(tmp_path / "here.npz")
    resumed = ts.Simulation.load(tmp_path / "here.npz")
    assert state(resumed) == state(whole)
    for _ in range(15):
        whole.step()
        resumed.step()
    assert state(resumed) == state(whole)
    assert whole.stepper.structure.meets == contact
    assert resumed.steps == whole.steps
    np.testing.assert_array_equal(resumed.positions(), whole.positions())


def test_checkpoint_holds_the_scene(tmp_path):
    sim = ts.Simulation(falling_pair())
    sim.save(tmp_path / "a.npz")
    scene = ts.Simulation.load(tmp_path / "a.npz").scene
    assert [body.name for body in scene.bodies] == [body.name for body in sim.scene.bodies]
    assert scene.obstacles == sim.scene.obstacles
    assert scene.bodies[0].model == sim.scene.bodies[0].model
    assert scene.bodies[1].pins == sim.scene.bodies[1].pins
    assert scene.probes == sim.scene.probes


@pytest.mark.parametrize("cut", [0, 10, 500, -20])
def test_damaged_checkpoint_is_told_in_one_sentence(tmp_path, cut):
    path = tmp_path / "a.npz"
    ts.Simulation(falling_pair()).save(path)
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(SceneError, match=r"a\.npz"):
        ts.Simulation.load(path)


def test_missing_checkpoint_is_told(tmp_path):
    with pytest.raises(SceneError, match=r"nothing\.npz"):
        ts.Simulation.load(tmp_path / "nothing.npz")


def test_unwritable_folder_is_told_and_leaves_nothing(tmp_path):
    sim = ts.Simulation(falling_pair())
    with pytest.raises(SceneError, match="cannot be written"):
        sim.save(tmp_path / "no" / "such" / "a.npz")
    assert list(tmp_path.iterdir()) == []
