"""A hand on a body: it follows slowly moved targets, never costs a step, and its work is booked."""

import gc

import numpy as np
import pytest

import tisoft as ts
from tisoft.step.grab import patch_weights


def beam(**keys):
    scene = ts.Scene(precision="f64", frame_rate=60.0, **keys)
    mesh = ts.box(size=(1, 0.2, 0.2), cells=(8, 2, 2))
    body = scene.add_body(mesh, ts.ViscoElastic(2e5, 0.3, 1000.0, phi=50.0, eta=50.0))
    body.pin(ts.where.box((-1e-6, -9, -9), (1e-6, 9, 9)))
    return scene, body


def held(sim, body, near, count=20):
    """A grab at a rest point of the body."""
    x = body.mesh.points
    nodes = np.argsort(np.linalg.norm(x - near, axis=1))[:count]
    weights = patch_weights(x[nodes], sim.masses()[nodes], near)
    assert weights.sum() == pytest.approx(1.0) and weights @ x[nodes] == pytest.approx(near)
    return sim.grab(body, nodes, weights, weights @ sim.positions(body)[nodes])


def way(share):
    """Along the arc of a cantilever's end, 0.6 d²/L inwards: where nothing resists but bending."""
    return np.array([-0.0075 * share**2, 0.1 * share, 0.05 * share])


def test_the_point_follows_the_hand_and_the_step_stays():
    runs = []
    for pulls in (False, True):
        scene, body = beam(gravity=(0, 0, 0))
        sim = ts.Simulation(scene, threads=1, ledger=True)
        sim.step()
        if pulls:
            grab = held(sim, body, np.array([1.0, 0.1, 0.1]))
            start = grab.target
        for k in range(90):
            if pulls:
                grab.target = start + way(min(1.0, k / 60))
            sim.step()
        runs.append(sim)
    free, pulled = runs
    assert pulled.recoveries == []
    assert pulled.steps[1] == free.steps[1]  # the very frame of the press has no smaller step
    assert np.linalg.norm(grab.point - grab.target) < 0.01 * np.linalg.norm(grab.target - start)
    assert np.linalg.norm(grab.force) > 1.0
    energy = pulled.energy()
    assert energy["external_work"] > 0.5
    assert abs(energy["error"]) < 0.01 * energy["external_work"]
    grab.release()
    stored = energy["kinetic"] + energy["elastic"]
    for _ in range(30):
        pulled.step()
    energy = pulled.energy()
    assert energy["kinetic"] + energy["elastic"] < stored
    assert np.array_equal(grab.force, np.zeros(3)) and not grab.is_held


def test_a_wild_hand_breaks_nothing_and_pulls_with_bounded_force():
    scene, body = beam()
    sim = ts.Simulation(scene, threads=1)
    grab = held(sim, body, np.array([1.0, 0.2, 0.2]))
    most = 2e5 * 0.25**2  # E r², of a patch of twenty nodes
    rng = np.random.default_rng(1)
    for _ in range(60):
        grab.target = rng.uniform(-20, 20, 3)
        sim.step()
        assert np.isfinite(sim.positions()).all()
        assert np.linalg.norm(grab.force) < most
    assert len(sim.recoveries) <= 2


def test_forces_act_by_weight_and_sum_to_the_hand():
    """A free net: the hand gives it F t of momentum, and no other."""
    scene = ts.Scene(precision="f64", frame_rate=200.0, gravity=(0, 0, 0))
    net = ts.net(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1], [0, 2], [0, 3], [1, 2], [2, 3]]
    )
    body = scene.add_body(net, ts.MassSpring(stiffness=100.0, node_mass=0.5))
    sim = ts.Simulation(scene, threads=1)
    grab = sim.grab(body, [0, 2], [0.25, 0.75], [5.0, 0.75, 0])
    total = np.zeros(3)
    for _ in range(20):
        before = sim.velocities().sum(axis=0) * 0.5
        sim.step()
        if sim.steps[-1] == pytest.approx(1 / 200):  # one substep: its force is the frame's
            gained = sim.velocities().sum(axis=0) * 0.5 - before
            assert gained == pytest.approx(grab.force / 200, rel=1e-9)
            total += gained
    assert total[0] > 0.1


def test_a_hand_is_damped_by_half_a_step_of_its_stiffness():
    """On a mass alone, let go at rest: F₁ = k d, and F₂ = F₁ − k h v − c v with v = h F₁/m."""
    step, mass, away = 1.0 / 200.0, 0.5, 1e-8
    scene = ts.Scene(precision="f64", frame_rate=200.0, gravity=(0, 0, 0), step=step)
    net = ts.net([[0, 0, 0], [1, 0, 0]], [[0, 1]])
    body = scene.add_body(net, ts.MassSpring(stiffness=0.01, node_mass=mass))
    sim = ts.Simulation(scene, threads=1)
    grab = sim.grab(body, [0], [1.0], [away, 0, 0])
    forces = []
    for _ in range(2):
        sim.step()
        forces.append(grab.force[0])
    share = forces[0] * step**2 / (mass * away)  # h² k/m
    assert 0.1 < share < 1.0
    assert forces[1] / forces[0] == pytest.approx(1.0 - share - 0.5 * share, rel=1e-3)


def test_what_cannot_be_grabbed_is_told():
    scene, body = beam()
    sim = ts.Simulation(scene, threads=1)
    for nodes, weights, point, told in (
        ([0, 0], [0.5, 0.5], (0, 0, 0), "different numbers"),
        ([0, 999], [0.5, 0.5], (0, 0, 0), "different numbers from 0 to 80"),
        ([0, 1], [0.5, 0.2], (0, 0, 0), "add up to 1"),
        ([0], [1.0], (0, 0), "point"),
        ([0.5], [1.0], (0, 0, 0), "whole numbers"),
        (range(40), np.full(40, 0.025), (0, 0, 0), "1 to 32"),
    ):
        with pytest.raises(ts.SceneError, match=told):
            sim.grab(body, list(nodes), weights, point)
    for _ in range(4):
        sim.grab(body, [0], [1.0], (0, 0, 0))
    with pytest.raises(ts.SceneError, match="release another"):
        sim.grab(body, [0], [1.0], (0, 0, 0))
    other = ts.Scene()
    with pytest.raises(ts.SceneError, match="is not in this simulation"):
        sim.grab(other.add_body(body.mesh, body.model), [0], [1.0], (0, 0, 0))


@pytest.mark.parametrize(("size", "shift"), [(1.0, 1e6), (1e-3, 1.0), (1e3, 0.0)])
def test_weights_of_a_hand_depend_neither_on_size_nor_on_place(size, shift):
    points = np.random.default_rng(1).random((20, 3))
    mass, at = 1.0 + points[:, 0], np.array([0.4, 0.5, 0.3])
    place = shift * np.array([1.0, 0.0, -2.0])
    there = patch_weights(size * points + place, mass, size * at + place)
    assert there == pytest.approx(patch_weights(points, mass, at), abs=1e-6)


def test_a_hand_that_never_let_go_pulls_at_no_later_scene():
    """Rows of a scene that is no more are lent again."""

    def loaded():
        scene, body = beam()
        body.load(ts.where.everything(), force=(0, 0, 1.0))
        return ts.Simulation(scene, threads=1), body

    states = []
    for holds in (False, True, False):
        sim, body = loaded()
        if holds:
            held(sim, body, np.array([1.0, 0.1, 0.1])).target += 0.1
        sim.run(0.1)
        states.append(sim.positions())
        del sim
        gc.collect()
    assert not np.array_equal(states[0], states[1])
    assert np.array_equal(states[0], states[2])
