"""Loads that scenes hold, as statics see them."""

import numpy as np
import pytest
from static_cases import bar, face_load

import tisoft as ts
from tisoft import where
from tisoft.equilibrium.statics import equilibrium


@pytest.mark.parametrize("pressure", [1e3, 3e4, -1e5])
def test_cube_under_pressure_from_all_sides(pressure):
    """Stretch l of a St.VK cube: 3K l (l² − 1)/2 = −p l² on the face as it is, 3K = E/(1 − 2ν)."""
    mesh = ts.box((1, 1, 1), (2, 2, 2))
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(mesh, ts.ViscoElastic(1e5, 0.3, 1000.0))
    for k, axis in enumerate("xyz"):
        normal = np.eye(3)[k]
        body.pin(where.plane((0, 0, 0), normal), axis)
        body.load(where.plane(normal, -normal), pressure=pressure)
    stretch = np.roots([1.0, 2 * pressure * (1 - 0.6) / 1e5, -1.0]).max()
    assert np.abs(equilibrium(scene).positions - stretch * mesh.points).max() < 1e-10


def test_free_ball_under_pressure_stays_where_it_is():
    mesh = ts.ball(1.0, 3)
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add_body(mesh, ts.ViscoElastic(1e6, 0.3, 1000.0)).load(where.everything(), pressure=1e5)
    found = equilibrium(scene)
    stretch = np.roots([1.0, 2e5 * (1 - 0.6) / 1e6, -1.0]).max()
    assert np.abs(found.positions - stretch * mesh.points).max() < 1e-9
    assert found.warnings == []


def test_force_and_traction_of_a_scene_are_its_external_forces():
    end = where.plane((1, 0, 0), (-1, 0, 0))
    model = ts.ViscoElastic(1e6, 0.3, 1000.0)
    scene = bar("five", 1, model, gravity=(0, 0, 0))
    mesh = scene.bodies[0].mesh
    forces = face_load(mesh, mesh.points[:, 0] > 1 - 1e-9, (0, 0, -1000.0))
    expected = equilibrium(scene, external=forces)
    for load in ({"force": (0, 0, -40.0)}, {"traction": (0, 0, -1000.0)}):
        scene = bar("five", 1, model, gravity=(0, 0, 0))
        scene.bodies[0].load(end, **load)
        found = equilibrium(scene)
        assert np.abs(found.positions - expected.positions).max() < 1e-12
        assert found.energy["external_work"] == pytest.approx(expected.energy["external_work"])


def test_torque_on_a_face_is_borne_by_the_clamp():
    scene = bar("five", 1, ts.ViscoElastic(1e6, 0.3, 1000.0), gravity=(0, 0, 0))
    end = where.plane((1, 0, 0), (-1, 0, 0))
    scene.bodies[0].load(end, torque=ts.Torque((1, 0.1, 0.1), (1, 0, 0), 40.0))
    found = equilibrium(scene)
    moment = np.cross(found.positions, found.reactions).sum(axis=0)
    assert moment == pytest.approx([-40.0, 0, 0], abs=1e-8)
    assert found.reactions.sum(axis=0) == pytest.approx([0, 0, 0], abs=1e-8)


def test_loads_are_seen_at_the_end_of_the_scene():
    plain, late = (bar("five", 1, ts.Linear(1e6, 0.3, 1000.0), duration=4.0) for _ in range(2))
    end = where.plane((1, 0, 0), (-1, 0, 0))
    plain.bodies[0].load(end, force=(0, 0, -10.0))
    late.bodies[0].load(end, force=(0, 0, -40.0), table=[(0, 0), (8, 0.5)])
    late.bodies[0].load(end, force=(0, 0, -1e9), end=3.9)
    expected = equilibrium(plain).positions
    assert equilibrium(late).positions == pytest.approx(expected, abs=1e-12)
