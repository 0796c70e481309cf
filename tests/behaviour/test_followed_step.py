"""The step that follows the bodies: what it leaves free, how soon it falls, how late it rises."""

import numpy as np
import pytest

import tisoft as ts

REGULAR = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
"""Corners of a regular tet, whose bound is its limit at rest and in a pull."""


def tet(model, points=REGULAR, **settings):
    settings = {"gravity": (0, 0, 0), "precision": "f64"} | settings
    scene = ts.Scene(**settings)
    points = np.asarray(points, float)
    corners = [0, 1, 2, 3]
    if np.linalg.det(points[1:] - points[0]) < 0.0:
        corners = [0, 2, 1, 3]
    scene.add_body(ts.tet_mesh(points, [corners]), model)
    return ts.Simulation(scene, threads=1)


def limit_at(sim, x):
    """2/ω_max [s] at positions x, K by differences of the forces; the state is x at rest."""
    still = np.zeros_like(x)
    weight = 1.0 / np.sqrt(np.repeat(sim.masses(), 3))
    stiffness = np.empty((x.size, x.size))
    for k in range(x.size):
        pair = []
        for sign in (1, -1):
            moved = x.copy()
            moved.ravel()[k] += sign * 1e-6
            sim.set_state(moved, still)
            pair.append(sim.forces().ravel())
        stiffness[k] = (pair[1] - pair[0]) / 2e-6
    sim.set_state(x, still)
    symmetric = 0.5 * (stiffness + stiffness.T)
    return 2.0 / np.sqrt(np.linalg.eigvalsh(weight[:, None] * symmetric * weight)[-1])


def turn(axis, angle):
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


# -- the bound ------------------------------------------------------------------------------------


@pytest.mark.parametrize("poisson", [0.0, 0.3])
@pytest.mark.parametrize("stretch", [1.0, 1.2, 1.5, 2.0])
def test_tension_stiffens_a_st_venant_tet_as_much_as_the_bound_says(stretch, poisson):
    """ω² ≤ ω₀² λ_max(FᵀF) + (4γ/ρ) λ_max(S): the second term is the geometric stiffness."""
    sim = tet(ts.ViscoElastic(1e5, poisson, 1000.0))
    R = turn((1, 2, 3), 0.8)
    x = (REGULAR * [stretch, 1.0, 1.0]) @ R.T
    limit = limit_at(sim, x)
    assert 0.8 * limit < sim.stable_step() <= limit * (1 + 1e-9)


STATES = {
    "squeezed": np.diag([0.4, 1.0, 1.0]),
    "pulled": np.diag([2.0, 1.0, 1.0]),
    "pulled in two ways": np.diag([2.0, 2.0, 1.0]),
    "swollen": 2.0 * np.eye(3),
    "sheared": np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
}


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("poisson", [0.0, 0.45])
def test_neo_hookean_tets_have_a_bound_below_their_limit(state, poisson):
    sim = tet(ts.NeoHookean(1e5, poisson, 1000.0))
    x = REGULAR @ STATES[state].T @ turn((1, 2, 3), 0.8).T
    limit = limit_at(sim, x)
    assert 0.3 * limit < sim.stable_step() <= limit * (1 + 1e-9)


# -- what the chosen step leaves free ------------------------------------------------------------


@pytest.mark.parametrize("kind", [ts.Linear, ts.MassTensor, ts.ViscoElastic, ts.NeoHookean])
def test_the_chosen_step_leaves_a_twentieth_of_the_limit_free(kind):
    sim = tet(kind(1e5, 0.3, 1000.0), frame_rate=0.05)  # frames of 150 substeps: hardly rounded
    limit = limit_at(sim, REGULAR)
    sim.step()
    assert 0.85 * limit < sim.steps[0] < 0.97 * limit


# -- following -----------------------------------------------------------------------------------


def bar(*, stretch, damping=0.0, rate=8.0):
    """A slender bar that can only move along its length, held at one end, let go stretched.

    Its rod waves travel at 3.2 m/s, so it swings in 1.3 s, 250 substeps.
    """
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64", frame_rate=rate)
    mesh = ts.box(size=(1.0, 0.1, 0.1), cells=(40, 1, 1))
    body = scene.add_body(mesh, ts.ViscoElastic(1e4, 0.0, 1000.0, point_damping=damping))
    body.pin(ts.where.everything(), axes="yz")
    body.pin(ts.where.box((-1e-6, -9, -9), (1e-6, 9, 9)), axes="x")
    sim = ts.Simulation(scene, threads=1)
    x = sim.positions() * [stretch, 1.0, 1.0]
    sim.set_state(x, np.zeros_like(x))
    return sim


def total(sim):
    energy = sim.energy()
    return energy["kinetic"] + energy["elastic"]


def followed(sim, frames):
    """Substeps made and step [s] of every frame."""
    rows = []
    for _ in range(frames):
        sim.step()
        rows.append((sim.substeps, sim.steps[-1]))
    made, steps = np.array(rows).T
    return made, steps


def test_the_step_does_not_follow_each_swing():
    """It falls at once, and rises only to what would have served for 500 substeps."""
    sim = bar(stretch=1.08)
    made, steps = followed(sim, 300)
    risen = np.flatnonzero(steps[1:] > 1.02 * steps[:-1]) + 1
    assert (np.diff(made[risen], prepend=0) > 1000).all()
    assert sim.recoveries == []
    assert steps[-1] < 0.99 * steps[0]


def test_the_step_comes_back_when_the_body_has_come_to_rest():
    sim = bar(stretch=1.08, damping=0.6)
    at_rest = sim.stable_step()
    made, steps = followed(sim, 600)
    assert total(sim) < 1e-12
    assert sim.stable_step() > 1.1 * at_rest  # that of the stretched start
    assert steps.min() < 0.97 * steps[-1]
    assert steps[-1] == steps.max()
    assert made[np.argmax(steps == steps[-1])] < 14_000


def oscillator_beside_a_bar(phase, *, omega=5.0):
    """A mass on a long spring, hω = 0.25, beside a bar whose stretching after half a second cuts
    the step of both to a third; the mass starts at this phase of a swing of 1 m.
    """
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64", frame_rate=20.0)
    mesh = ts.box(size=(1, 0.5, 0.5), cells=(2, 1, 1))
    bar = scene.add_body(mesh, ts.ViscoElastic(1e4, 0.0, 1000.0))
    bar.pin(ts.where.everything(), axes="yz")
    bar.pin(ts.where.box((-1e-6, -9, -9), (1e-6, 9, 9)), axes="x")
    end = ts.where.box((1 - 1e-6, -9, -9), (9, 9, 9))
    bar.pin(end, axes="x", path=[(0.5, 0, 0, 0), (0.55, 0.8, 0, 0)])
    net = ts.net([[0, 5, 0], [10, 5, 0]], [[0, 1]])
    model = ts.MassSpring(stiffness=omega**2, node_mass=1.0)
    scene.add_body(net, model).pin(ts.where.nodes([0]))
    sim = ts.Simulation(scene, threads=1)
    x = sim.positions()
    v = np.zeros_like(x)
    x[-1, 0] += np.cos(phase)
    v[-1, 0] = -omega * np.sin(phase)
    sim.set_state(x, v)
    return sim


@pytest.mark.parametrize("eighth", range(8))
def test_a_change_of_the_step_leaves_the_amplitude_of_a_swing(eighth):
    """Symplectic Euler conserves m v²/2 + k x²/2 − (h/2) k x v: as the step falls to a third, v has
    to move, or the swing gains or loses (h/3) k x v, up to 8 %."""
    omega = 5.0
    sim = oscillator_beside_a_bar(eighth * np.pi / 8, omega=omega)
    seen = []
    for _ in range(14):
        sim.step()
        x, v = sim.positions()[-1, 0] - 10.0, sim.velocities()[-1, 0]
        seen.append(v * v + omega**2 * (x * x - sim.steps[-1] * x * v))
    assert sim.steps[-1] == pytest.approx(sim.steps[0] / 3)
    assert seen == pytest.approx([seen[0]] * len(seen), rel=0.02)


def test_a_body_that_falls_far_stays_exact_in_single_precision():
    """Bodies are centred as they travel, however rarely they are looked at."""
    sim = tet(ts.ViscoElastic(1e4, 0.3, 1000.0), gravity=(0, -10.0, 0), precision="f32")
    start, frames = sim.positions(), 60
    for _ in range(frames):
        sim.step()
    fallen, h = sim.positions() - start, sim.time / sim.substeps
    exact = -5.0 * sim.time * (sim.time + h)  # symplectic Euler's, which is h t g/2 ahead
    assert exact < -4.0
    assert fallen[:, 1] == pytest.approx(exact, rel=2e-5)
    edges = np.diff(sim.positions(), axis=0) - np.diff(start, axis=0)
    assert np.abs(edges).max() < 2e-6


def test_a_calm_body_that_is_held_is_looked_at_rarely(monkeypatch):
    sim = tet(ts.ViscoElastic(1e4, 0.3, 1000.0), gravity=(0, -0.1, 0), precision="f32")
    sim.scene.bodies[0].pin(ts.where.box((0.5, 0.5, 0.5), (2, 2, 2)))
    looks = []
    monkeypatch.setattr(sim.watch, "look", lambda time: looks.append(time))
    while sim.substeps < 4000:
        sim.step()
    assert 3 < len(looks) < 16
