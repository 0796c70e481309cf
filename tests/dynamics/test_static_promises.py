"""What the static solver promises: no jumps, no absolute sizes, a word where it cannot."""

import numpy as np
import pytest
from static_cases import CLAMP, bar, face_load, row, string, tip

import tisoft as ts
from tisoft import where
from tisoft.equilibrium import linear_solve
from tisoft.equilibrium.statics import equilibrium


def test_turned_and_scaled_scene_gives_the_turned_and_scaled_answer():
    scene = bar("five", 1, ts.ViscoElastic(1e6, 0.3, 1000.0))
    plain = equilibrium(scene).positions
    # Lengths by 1000 with the density divided by it leaves the strains as they are.
    mesh = scene.bodies[0].mesh.transformed(scale=1000.0, rotate=(0, 0, 90))
    turned = ts.Scene(gravity=(0, 0, -9.81))
    body = turned.add_body(mesh, ts.ViscoElastic(1e6, 0.3, 1.0))
    body.pin(where.plane((0, 0, 0), (0, 1, 0)))
    x, y, z = equilibrium(turned).positions.T
    assert np.abs(np.stack([y, -x, z], axis=1) / 1000 - plain).max() < 1e-10


def test_bodies_balance_each_on_their_own():
    scene = bar("five", 1, ts.ViscoElastic(1e6, 0.3, 1000.0))
    alone = equilibrium(scene).positions
    mesh = ts.box((1, 0.2, 0.2), (3, 1, 1)).transformed(translate=(0, 5, 0))
    scene.add_body(mesh, ts.NeoHookean(1e4, 0.4, 300.0)).pin(CLAMP)
    both = equilibrium(scene)
    assert np.array_equal(both.positions[: len(alone)], alone)
    assert both.reactions.sum(axis=0)[2] == pytest.approx(9.81 * (40 + 12), rel=1e-9)


def test_a_body_that_nothing_holds_has_no_equilibrium():
    scene = ts.Scene()
    scene.add_body(ts.box((1, 1, 1), (1, 1, 1)), ts.ViscoElastic(1e5, 0.3, 1000.0), "jelly")
    with pytest.raises(ts.NoEquilibrium, match="no pin holds the piece of 'jelly'") as caught:
        equilibrium(scene)
    assert caught.value.load_factor == 0.0


def test_a_free_body_pulled_at_both_ends_stretches():
    mesh = ts.box((1, 0.2, 0.2), (10, 2, 2))
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add_body(mesh, ts.Linear(1e6, 0.0, 1000.0))
    x = mesh.points[:, 0]
    forces = face_load(mesh, x > 1 - 1e-9, (1e4, 0, 0)) - face_load(mesh, x < 1e-9, (1e4, 0, 0))
    found = equilibrium(scene, external=forces)
    length = found.positions[x > 1 - 1e-9, 0].mean() - found.positions[x < 1e-9, 0].mean()
    assert length == pytest.approx(1.01, abs=1e-10)


def test_a_beam_on_a_hinge_swings_down_to_hang():
    scene = ts.Scene()
    body = scene.add_body(ts.box((1, 0.2, 0.2), (5, 1, 1)), ts.ViscoElastic(1e6, 0.3, 1000.0))
    body.pin(where.box((0, 0, 0), (0, 0, 1)))
    found = equilibrium(scene)
    middle = found.positions.mean(axis=0)
    assert abs(middle[0]) < 0.02 and middle[1] < -0.45
    assert found.residual < 1e-7


def test_a_linear_beam_on_a_hinge_is_refused():
    scene = ts.Scene()
    body = scene.add_body(ts.box((1, 0.2, 0.2), (5, 1, 1)), ts.Linear(1e6, 0.3, 1000.0))
    body.pin(where.box((0, 0, 0), (0, 0, 1)))
    with pytest.raises(ts.NoEquilibrium, match="turn"):
        equilibrium(scene)


def test_obstacles_are_left_out_with_a_word():
    scene = bar("five", 1, ts.ViscoElastic(1e6, 0.3, 1000.0))
    scene.add_obstacle(ts.Plane(point=(0, 0, -0.1), normal=(0, 0, 1)))
    found = equilibrium(scene)
    assert "obstacles" in found.warnings[0]
    assert found.positions[:, 2].min() < -0.2


def test_a_straight_column_past_buckling_is_said_to_be_unstable():
    mesh = ts.box((1, 0.1, 0.1), (10, 2, 2))
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add_body(mesh, ts.ViscoElastic(1e6, 0.0, 1000.0)).pin(CLAMP)
    forces = face_load(mesh, mesh.points[:, 0] > 1 - 1e-9, (-1e4, 0, 0))  # 5 times Euler's load
    found = equilibrium(scene, external=forces)
    assert "unstable" in found.warnings[0]


def test_wrong_external_forces_are_refused():
    scene = bar("five", 1, ts.ViscoElastic(1e6, 0.3, 1000.0))
    with pytest.raises(ts.SceneError, match="shape"):
        equilibrium(scene, external=np.zeros((3, 3)))


def test_dynamics_run_to_rest_agree():
    """Heavily damped St. Venant-Kirchhoff cantilever in f64 comes to the same rest."""
    model = ts.ViscoElastic(1e5, 0.3, 1000.0, phi=300.0, eta=300.0, point_damping=15.0)
    mesh = ts.box((0.5, 0.2, 0.2), (5, 2, 2))
    scene = ts.Scene(gravity=(0, 0, -2.0), precision="f64")
    scene.add_body(mesh, model).pin(CLAMP)
    still = equilibrium(scene).positions
    simulation = ts.Simulation(scene, certify=False)
    for _ in simulation.frames(seconds=4.0):
        pass
    sag = np.abs(still - mesh.points).max()
    assert np.abs(simulation.positions() - still).max() < 1e-6 * sag


def test_bodies_too_large_to_factorise_find_the_same(monkeypatch):
    monkeypatch.setattr(linear_solve, "FACTOR_LIMIT", 0)
    scene = bar("five", 1, ts.ViscoElastic(1e6, 0.3, 1000.0))
    expected = [-0.03372279, 0.0, -0.24285602]
    assert tip(scene, equilibrium(scene)) == pytest.approx(expected, abs=1e-8)
    flat = string([[-1, 0, 0], [0, 0, 0], [1, 0, 0]], 200.0, 2.0, [0, 2])
    assert equilibrium(flat).positions[1, 1] == pytest.approx(-0.4865936028, abs=1e-9)


def arch_under(load, model):
    """Height of the middle of a shallow clamped arch of 24 x 2 x 2 cells under a dead load [N]."""
    unit = ts.box((1, 1, 1), (24, 2, 2))
    x, y, z = unit.points.T
    radius, angle = 1 + 0.04 * (z - 0.5), x - 0.5
    points = np.stack([radius * np.sin(angle), 0.1 * y, radius * np.cos(angle)], axis=1)
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(ts.tet_mesh(points, unit.tets), model)
    body.pin(where.nodes(np.flatnonzero(np.abs(angle) > 0.5 - 1e-9).tolist()))
    top = np.flatnonzero((np.abs(angle) < 1e-9) & (z > 1 - 1e-9))
    forces = np.zeros_like(points)
    forces[top, 2] = -load / len(top)
    return equilibrium(scene, external=forces).positions[top[1], 2]


@pytest.mark.parametrize("kind", [ts.ViscoElastic, ts.NeoHookean])
def test_arch_does_not_snap_through_unsaid(kind):
    """The last load found does not depend on how much was asked for, and is an equilibrium's."""
    model = kind(1e6, 0.3, 1000.0)
    limits = []
    for load in (40.0, 300.0):
        with pytest.raises(ts.NoEquilibrium) as caught:
            arch_under(load, model)
        limits.append(load * caught.value.load_factor)
    assert limits[0] == pytest.approx(limits[1], rel=2e-3)
    assert 0.9 < arch_under(0.99 * limits[0], model) < 1.02


@pytest.mark.parametrize(("size", "young"), [(1e-6, 1e6), (1e6, 1e6), (1.0, 1e-3), (1.0, 1e14)])
def test_nothing_is_absolute(size, young):
    """The same number of ρgL/E gives the same shape, whatever the units."""
    mesh = ts.box((size, 0.2 * size, 0.2 * size), (10, 2, 2))
    scene = ts.Scene(gravity=(0, 0, -9.81))
    scene.add_body(mesh, ts.ViscoElastic(young, 0.3, 1e-3 * young / size)).pin(CLAMP)
    k = row(mesh.transformed(scale=1 / size), (1, 0.1, 0.1))
    sag = (equilibrium(scene).positions - mesh.points)[k] / size
    assert sag == pytest.approx([-0.03372279, 0.0, -0.24285602], abs=1e-8)


@pytest.mark.slow
def test_fifteen_thousand_tets_settle_within_the_time():
    from time import perf_counter

    begun = perf_counter()
    scene = bar("six", 4, ts.ViscoElastic(1e6, 0.3, 1000.0))
    found = equilibrium(scene)
    assert perf_counter() - begun < 20.0
    assert tip(scene, found) == pytest.approx([-0.06169842, 0.00633303, -0.32567431], abs=1e-8)
    assert found.energy["elastic"] == pytest.approx(25.4930180, rel=1e-8)


def test_a_simulation_tells_its_equilibrium_and_modes_without_moving():
    scene = bar("five", 1, ts.ViscoElastic(1e6, 0.3, 1000.0))
    simulation = ts.Simulation(scene)  # in f32; the answers are f64's all the same
    found = simulation.equilibrium()
    assert tip(scene, found) == pytest.approx([-0.03372279, 0.0, -0.24285602], abs=1e-8)
    assert simulation.modes(2).frequencies == pytest.approx([1.211897993, 1.211897993], rel=1e-8)
    assert np.abs(simulation.positions() - scene.bodies[0].mesh.points).max() < 1e-6
