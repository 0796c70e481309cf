"""What the guard must carry: violent scenes that end finite, whole and without a broken frame."""

import failing
import numpy as np
import pytest

import tisoft as ts
from tisoft.simulation import Simulation

SOLIDS = [ts.ViscoElastic, ts.NeoHookean]
FREE_END = ts.where.box((1 - 1e-6, -9, -9), (1 + 1e-6, 9, 9))


def test_drop_from_a_hundred_metres():
    scene = ts.Scene(frame_rate=60)
    mesh = ts.box(size=(0.2, 0.2, 0.2), cells=(3, 3, 3)).transformed(translate=(0, 100, 0))
    scene.add_body(mesh, ts.NeoHookean(1e5, 0.4, 1000.0, phi=10.0, eta=10.0))
    scene.add_obstacle(ts.Plane((0, 0, 0), (0, 1, 0), friction=0.5))
    sim = failing.certified(scene, 6.0)  # it lands after 4.5 s at 44 m/s
    assert sim.positions()[:, 1].min() > -1e-3
    assert sim.positions()[:, 1].max() < 20.0
    assert failing.inverted(sim) == 0


@pytest.mark.parametrize("kind", SOLIDS)
def test_pin_jerked_by_a_metre_in_a_frame(kind):
    mesh = failing.beam()
    scene = ts.Scene(gravity=(0, -9.81, 0), frame_rate=60)
    body = scene.add_body(mesh, kind(1e6, 0.3, 1000.0, phi=200.0, eta=200.0))
    body.pin(failing.CLAMP, path=[(0.1, 0, 0, 0), (0.1 + 1 / 60, 0, 1, 0), (9, 0, 1, 0)])
    sim = failing.certified(scene, 1.5)
    held = sim.positions()[mesh.points[:, 0] < 1e-6]
    assert np.allclose(held, mesh.points[mesh.points[:, 0] < 1e-6] + [0, 1, 0], atol=1e-5)
    assert np.abs(sim.positions() - mesh.points).max() < 4.0
    if kind is ts.NeoHookean:
        assert failing.inverted(sim) == 0


@pytest.mark.parametrize("kind", SOLIDS)
def test_mesh_with_one_sliver(kind):
    points = failing.beam().points.copy()
    mesh = failing.beam()
    points = mesh.points.copy()
    tet = mesh.tets[len(mesh.tets) // 2]
    face = points[tet[1:]].mean(axis=0)
    points[tet[0]] = face + 0.003 * (points[tet[0]] - face)  # an altitude of a third of a mm
    bad = ts.tet_mesh(points, _positive(points, mesh.tets))
    scene = failing.scene_of(bad, kind(1e5, 0.3, 1000.0), pinned=failing.CLAMP, gravity=(0, -5, 0))
    sim = failing.certified(scene, 0.5)
    assert np.abs(sim.positions() - bad.points).max() < 1.5


def _positive(points, tets):
    corners = points[tets]
    flat = np.linalg.det(corners[:, 1:] - corners[:, :1]) <= 0.0
    tets = tets.copy()
    tets[flat] = tets[flat][:, [0, 1, 3, 2]]
    return tets


@pytest.mark.parametrize("kind", SOLIDS)
def test_free_end_dragged_through_the_clamp_and_let_go(kind):
    mesh = failing.beam()
    scene = ts.Scene(gravity=(0, 0, 0), frame_rate=60)
    body = scene.add_body(mesh, kind(1e5, 0.3, 1000.0, phi=50.0, eta=50.0))
    body.pin(failing.CLAMP)
    body.pin(FREE_END, path=[(0.0, 0, 0, 0), (0.5, -1.5, 0, 0)], release=0.5)
    sim = failing.certified(scene, 4.0)
    assert np.abs(sim.positions() - mesh.points).max() < 4.0
    if kind is ts.NeoHookean:
        assert failing.inverted(sim) == 0


@pytest.mark.parametrize("kind", SOLIDS)
def test_load_of_a_hundred_times_the_sensible(kind):
    mesh = failing.beam()
    sensible = 4.0  # N: bends the beam by a tenth of its length
    scene = ts.Scene(gravity=(0, 0, 0), frame_rate=60)
    body = scene.add_body(mesh, kind(1e6, 0.3, 1000.0, phi=200.0, eta=200.0))
    body.pin(failing.CLAMP)
    body.load(FREE_END, force=(0, -100 * sensible, 0))
    sim = failing.certified(scene, 1.0)
    end = sim.positions()[mesh.points[:, 0] > 1 - 1e-6].mean(axis=0)
    assert end[1] < -0.5  # it hangs
    assert sim.remedies().startswith("make loads smaller, ")
    assert ("neo-hookean" in sim.remedies()) == (kind is ts.ViscoElastic)
    if kind is ts.NeoHookean:
        assert failing.inverted(sim) == 0


def star(**settings):
    """A node between four springs to fixed points: pulled aside, the springs line up."""
    net = ts.net(
        [[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], [[0, k] for k in range(1, 5)]
    )
    model = ts.MassSpring(stiffness=100.0, node_mass=0.01)
    return failing.scene_of(net, model, pinned=ts.where.nodes([1, 2, 3, 4]), **settings)


def test_springs_that_line_up_are_stiffer_than_at_rest():
    scene = star(frame_rate=80)
    sim = Simulation(scene, precision="f64")
    rest = 2.0 / np.sqrt(200.0 / 0.01)  # two springs along each axis
    lined_up = 2.0 / np.sqrt(400.0 / 0.01)
    assert sim.limit.sharp() == pytest.approx(rest, rel=1e-3)
    aside = sim.positions()
    aside[0] = 0, 0, 10
    grown = failing.raw(star(), 0.9 * rest, 200, x=aside, nudge=0.0)
    assert grown[-1] > 1e6
    sim.set_state(aside, np.zeros_like(aside))
    stretched = sim.energy()["elastic"]
    for _ in range(80):
        sim.step()
        assert sim.steps[-1] < lined_up
        assert sim.energy()["elastic"] < 3 * stretched
