"""Axes of the failure map: what they measure is what theory says, and their words follow it."""

import numpy as np
import pytest

import tisoft as ts
from tisoft.elements.tet4 import gradients
from tisoft.equilibrium.operators import Elastic
from tisoft.study import compression, diagonals, own, poisson, rotation, step_damping
from tisoft.study.closed_forms import predicted_energy, predicted_stress
from tisoft.study.compliance import Compliance
from tisoft.study.stability import AXES, Study, chosen
from tisoft.study.subject import Material, Subject, with_model

MATERIAL = Material(1e5, 0.3, 1000.0)
CLAMP = ts.where.box((-1e-6, -9, -9), (1e-6, 9, 9))


def scene_of(mesh, model, *, pinned=True, **settings):
    scene = ts.Scene(duration=0.2, **settings)
    body = scene.add_body(mesh, model, "body")
    if pinned:
        body.pin(CLAMP)
    return scene


def beam(model=None, **settings):
    mesh = ts.box(size=(1, 0.2, 0.2), cells=(5, 2, 2))
    return scene_of(mesh, model or ts.ViscoElastic(1e5, 0.3, 1000.0), **settings)


def measured(module, scene):
    subject = Subject(scene)
    count = [0]
    here = own.look(subject, lambda: None, run=module in (compression, rotation))

    def tick():
        count[0] += 1

    axis = module.measure(subject, here, tick)
    assert count[0] == module.work(subject)
    assert axis.table().count("\n") == len(axis.rows) + 1
    return axis


MODELS = {
    "viscous": ts.ViscoElastic(1e5, 0.3, 1000.0, phi=5.0, eta=5.0),
    "consistent": ts.ViscoElastic(1e5, 0.3, 1000.0, mass="consistent"),
    "mass-tensor": ts.MassTensor(1e5, 0.3, 1000.0),
    "neo-hookean": ts.NeoHookean(1e5, 0.3, 1000.0),
    "springs": ts.MassSpring(1e5, 1000.0),
}


@pytest.mark.parametrize(
    "name",
    ["viscous", pytest.param("consistent", marks=pytest.mark.slow), *list(MODELS)[2:]],
)
def test_every_run_of_the_grid_goes_as_predicted(name):
    axis = measured(step_damping, beam(MODELS[name]))
    assert axis.numbers["runs"] == len(step_damping.RATIOS) * len(step_damping.LEVELS)
    assert axis.numbers["grown_below_the_limit"] == 0
    assert axis.numbers["bounded_above_the_limit"] == 0


def test_velocity_verlet_never_grows_below_its_limit():
    axis = measured(step_damping, beam(integrator="velocity-verlet"))
    assert axis.numbers["grown_below_the_limit"] == 0
    undamped = [row for row in axis.rows if row[0] == 0.0]
    assert all(row[4] == (row[3] < 1.0) for row in undamped)


def test_curve_of_one_mode():
    zeta = np.array([0.0, 0.05, 0.3, 1.0, 3.0])
    limits = step_damping.curve(2.0, zeta, 1) * 2.0
    assert limits == pytest.approx([2, 1.9024984, 1.4880613, 0.8284271, 0.3245553], abs=1e-7)


def test_scene_with_too_long_a_step_is_told_and_not_refused():
    axis = measured(step_damping, beam(step=0.1))
    assert "which tisoft refuses" in axis.sentence


def test_st_venant_gives_way_at_one_over_root_three():
    axis = measured(compression, beam())
    assert axis.numbers["softening"]["viscoelastic"] == pytest.approx(3**-0.5, abs=1e-5)
    assert axis.numbers["largest_push"]["viscoelastic"] == pytest.approx(1e5 / 27**0.5, rel=1e-6)
    assert axis.numbers["softening"]["linear"] is None
    assert axis.numbers["softening"]["neo-hookean"] < 0.45
    assert 0.3 < axis.numbers["least_stretch"] < 1.0
    assert "0.577" in axis.sentence


@pytest.mark.parametrize("name", ["viscoelastic", "neo-hookean", "linear"])
def test_nodal_forces_give_the_closed_forms(name):
    subject = Subject(beam())
    elastic = Elastic(with_model(subject.solid, subject.model(name)))
    volume = float(subject.solid.volumes.sum())
    here = compression.measured_stress(elastic, volume)
    theory, energy = predicted_stress(name, MATERIAL), predicted_energy(name, MATERIAL)
    for a, t in ((0.4, 1.2), (0.9, 1.05), (1.3, 0.8)):
        assert here(a, t) == pytest.approx(theory(a, t), abs=1e-6)
        slope = (energy(a + 1e-5) - energy(a - 1e-5)) / 2e-5
        assert theory(a, 1.0)[0] == pytest.approx(slope, rel=1e-6)


def test_springs_all_ways_have_youngs_modulus_and_a_quarter():
    stress = predicted_stress("mass-spring", MATERIAL)
    t, pull = compression.free_sides(stress, 1.0001, 1.0)
    assert pull / 1e-4 == pytest.approx(1e5, rel=1e-3)
    assert (1.0 - t) / 1e-4 == pytest.approx(0.25, rel=1e-3)


def test_pull_of_st_venant_with_free_sides():
    stress = predicted_stress("viscoelastic", MATERIAL)
    t, push = compression.free_sides(stress, 0.62, 1.0)
    assert push == pytest.approx(-19083.64, abs=0.1)
    assert t == pytest.approx(1.0884300621, abs=1e-9)


def test_rotation_costs_linear_bodies_only():
    axis = measured(rotation, beam())
    assert axis.numbers["one_percent_degrees"] == pytest.approx(8.11, abs=0.01)
    assert axis.numbers["ten_percent_degrees"] == pytest.approx(25.84, abs=0.01)
    assert axis.numbers["growth_of_linear"] == pytest.approx(10**0.5, rel=1e-9)
    assert axis.numbers["false_stress_of_others"] < 1e-8


def test_false_stress_of_thirty_degrees():
    mesh = ts.box(size=(1, 1, 1), cells=(2, 2, 2))
    elastic = Elastic(with_model(mesh, ts.Linear(1e5, 0.3, 1000.0)))
    stress = rotation.false_stress(elastic, 1.0, np.radians(30.0))
    assert stress == pytest.approx(25764.345, abs=1e-3)


def test_locking_and_step_towards_a_half():
    axis = measured(poisson, beam())
    assert 0.3 < axis.numbers["usable_below"] < 0.5
    steps = [row[1] for row in axis.rows]
    predicted = [row[2] for row in axis.rows]
    assert steps == pytest.approx(predicted, rel=0.05)
    assert steps[-1] < 0.05 * steps[0]


def test_ball_without_pins_is_clamped_somewhere():
    scene = scene_of(ts.ball(0.1, 3), ts.NeoHookean(1e5, 0.3, 1000.0), pinned=False)
    axis = measured(poisson, scene)
    assert all(row[3] > 0.0 and row[4] > row[3] for row in axis.rows)


def test_ten_node_tets_pull_a_bar_as_the_formula_says():
    """A bar hanging from rollers under its weight: f·u = ρ²g²A L³/3E, exact for 10-node tets."""
    mesh = ts.box(size=(0.1, 0.1, 1), cells=(1, 1, 3))
    body = ts.Scene().add_body(mesh, ts.Linear(1e6, 0.3, 1000.0))
    body.pin(ts.where.plane((0, 0, 1e-9), (0, 0, 1)), axes="z")
    body.pin(ts.where.plane((1e-9, 0, 0), (1, 0, 0)), axes="x")
    body.pin(ts.where.plane((0, 1e-9, 0), (0, 1, 0)), axes="y")
    body.model = ts.Linear(1e6, 0.0, 1000.0)
    exact = (1000.0 * 9.81) ** 2 * 0.01 / 3e6
    quadratic, linear = (Compliance(body, np.array([0, 0, -9.81]), k) for k in (2, 1))
    assert quadratic.of(0.0, 5e5) == pytest.approx(exact, rel=1e-9)
    assert 0.85 * exact < linear.of(0.0, 5e5) < exact
    assert gradients(mesh.points, mesh.tets)[1].sum() == pytest.approx(0.01)


def test_grid_without_diagonals_has_mechanisms_and_sags():
    axis = measured(diagonals, beam())
    assert axis.numbers["mechanisms_whole"] == 0
    assert axis.numbers["mechanisms_least_springs"] >= 50
    assert axis.numbers["sag_least_springs"] > 1.1 * axis.numbers["sag_whole"] > 0
    for row in axis.rows:
        assert row[2] >= row[3]  # Maxwell


def test_net_of_a_spring_scene_is_the_one_that_is_studied():
    model = ts.MassSpring(stiffness=100.0, node_mass=0.01)
    scene = scene_of(ts.grid((1, 0.2, 0.2), (4, 1, 1)), model)
    axis = measured(diagonals, scene)
    assert axis.numbers["net"] == "the net of 'body'"
    assert axis.columns[0] == "share of springs missing"
    assert all(np.isfinite(row[4]) for row in axis.rows)


def test_only_names_axes():
    assert chosen(None) == list(AXES)
    assert chosen("poisson,step-damping") == ["step-damping", "poisson"]
    for wrong in ("heat", "", "poisson,heat"):
        with pytest.raises(ts.SceneError, match="names no axis"):
            chosen(wrong)


def test_body_with_the_shortest_step_is_studied():
    scene = beam()
    scene.add_body(ts.ball(0.1, 2), ts.ViscoElastic(1e7, 0.3, 1000.0), "ball")
    assert Study(scene, ["poisson"]).subject.body.name == "ball"


def test_scene_without_bodies_is_refused():
    with pytest.raises(ts.SceneError, match="no body"):
        Subject(ts.Scene())


@pytest.mark.parametrize("angle", [0.0, 0.7, 3.0])
def test_extremes_of_a_turned_and_squeezed_tet(angle):
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    stretch, turned = own.extremes((turn @ np.diag([1.2, 0.4, 0.9]))[None])
    assert (stretch, turned) == pytest.approx((0.4, angle), abs=1e-7)
    assert own.extremes((turn @ np.diag([1.2, -0.4, 0.9]))[None])[0] == pytest.approx(-0.4)
