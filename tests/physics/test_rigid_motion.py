"""A1.4 and A12: what rigid motion does to a body, objective or not."""

import numpy as np
import pytest
from beams import displaced, momentum, node_at, rotation, simulate

import tisoft as ts

OBJECTIVE = [ts.ViscoElastic, ts.NeoHookean]
EVERY = [ts.Linear, ts.MassTensor, *OBJECTIVE]
YOUNG, EDGE, VOLUME = 1e6, 0.1, 0.016
"""E, the size of an element (A1.4 tells forces by E h²) and the volume of `_block`."""


def _block(kind, **damping):
    mesh = ts.box(size=(0.4, 0.2, 0.2), cells=(4, 2, 2))
    if kind is ts.MassSpring:
        model = ts.MassSpring(young=YOUNG, density=1000.0, spring_damping=30.0)
    else:
        model = kind(YOUNG, 0.3, 1000.0, **damping)
    return simulate((mesh, model))


@pytest.mark.parametrize("kind", [*EVERY, ts.MassSpring])
def test_no_force_at_rest_nor_after_a_translation(kind):
    damping = {"phi": 30.0, "eta": 20.0}
    sim = _block(kind, **damping)
    assert np.abs(sim.forces()).max() < 1e-9 * YOUNG * EDGE**2
    displaced(sim, np.array([3.0, -2.0, 7.0]), np.array([1.0, 5.0, -4.0]))
    assert np.abs(sim.forces()).max() < 1e-9 * YOUNG * EDGE**2
    assert sim.energy()["elastic"] == pytest.approx(0.0, abs=1e-15 * YOUNG * VOLUME)


@pytest.mark.parametrize("kind", [*OBJECTIVE, ts.MassSpring])
def test_no_force_when_turned_and_turning(kind):
    sim = _block(kind, phi=30.0, eta=20.0)
    points = sim.scene.bodies[0].mesh.points
    R, v0, w = rotation((1, 2, -1), 2.0), np.array([1.0, 2.0, 3.0]), np.array([4.0, -7.0, 2.0])
    turned = points @ R.T
    sim.set_state(turned, np.cross(w, turned) + v0)
    assert np.abs(sim.forces()).max() < 1e-9 * YOUNG * EDGE**2
    assert sim.energy()["elastic"] == pytest.approx(0.0, abs=1e-15 * YOUNG * VOLUME)


def test_spin_of_a_scene_turns_the_body_about_its_centre_of_mass():
    mesh = ts.box(size=(0.4, 0.2, 0.2), cells=(4, 2, 2)).transformed(translate=(5, 6, 7))
    start = {"velocity": (1.0, 2.0, 3.0), "spin": (0.0, 0.0, 2.0)}
    sim = simulate((mesh, ts.ViscoElastic(YOUNG, 0.3, 1000.0), start))
    center = np.array([5.2, 6.1, 7.1])
    expected = np.array([1.0, 2.0, 3.0]) + np.cross([0, 0, 2.0], mesh.points - center)
    assert sim.velocities() == pytest.approx(expected, abs=1e-12)
    linear, _ = momentum(sim)
    assert linear == pytest.approx(16.0 * np.array([1.0, 2.0, 3.0]), rel=1e-12)


@pytest.mark.parametrize("kind", [ts.Linear, ts.MassTensor])
def test_spinning_linear_body_grows_without_a_force(kind):
    """A12: x = X + w t e × X, so the body grows by √(1 + w² t²) and nothing pulls it back."""
    mesh = ts.box(size=(1, 1, 1), cells=(2, 2, 2)).transformed(translate=(-0.5, -0.5, -0.5))
    model = kind(1e5, 0.3, 1000.0)
    sim = simulate((mesh, model, {"spin": (0, 0, 4.0)}), h=1e-3, substeps=500)
    sim.step()
    across = np.linalg.norm(sim.positions()[:, :2], axis=1)
    grown = np.linalg.norm(mesh.points[:, :2], axis=1) * 2.236068  # √5 at w t = 2
    assert across == pytest.approx(grown, rel=1e-7)
    assert sim.velocities() == pytest.approx(np.cross([0, 0, 4.0], mesh.points), abs=1e-12)


@pytest.mark.parametrize("kind", [ts.Linear, ts.MassTensor])
def test_turned_linear_cube_pushes_its_faces_outwards(kind):
    """A12: a unit cube turned by 30° about z, E = 1e5, ν = 0.3."""
    mesh = ts.box(size=(1, 1, 1), cells=(1, 1, 1))
    sim = simulate((mesh, kind(1e5, 0.3, 1000.0)))
    R = rotation((0, 0, 1), np.deg2rad(30))
    sim.set_state(mesh.points @ R.T, np.zeros_like(mesh.points))
    force = sim.forces()
    at_end = mesh.points == 1.0
    pushes = [force[at_end[:, k], k].sum() for k in range(3)]
    assert pushes == pytest.approx([25764.345, 25764.345, 15458.607], abs=6e-4)
    lam, mu = 1e5 * 0.3 / (1.3 * 0.4), 1e5 / 2.6
    lost = 1 - np.cos(np.deg2rad(30))
    assert pushes[0] == pytest.approx(2 * (lam + mu) * lost, rel=1e-12)
    assert pushes[2] == pytest.approx(2 * lam * lost, rel=1e-12)


def test_quarter_turn_of_st_venant_leaves_no_trace_where_linear_bursts():
    mesh = ts.box(size=(1, 1, 1), cells=(2, 2, 2))
    turned = mesh.points @ rotation((0, 0, 1), np.pi / 2).T
    largest = {}
    for kind in (ts.Linear, ts.ViscoElastic):
        sim = simulate((mesh, kind(1e5, 0.3, 1000.0)))
        sim.set_state(turned, np.zeros_like(turned))
        largest[kind] = np.abs(sim.forces()).max()
    assert largest[ts.ViscoElastic] < 1e-9 * 1e5
    assert largest[ts.Linear] > 1e4
    assert node_at(mesh, (1, 1, 1)) == len(mesh.points) - 1
