"""Strain, stress and momentum against closed forms and an independent formula."""

import numpy as np
import pytest

import tisoft as ts
from tisoft.simulation import Simulation

YOUNG, POISSON = 1e5, 0.3
LAM = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
MU = YOUNG / (2 * (1 + POISSON))
SOLIDS = [ts.Linear, ts.MassTensor, ts.ViscoElastic, ts.NeoHookean]


def _cube(kind, gradient, *, precision="f64", **keys):
    """A cube under one uniform deformation gradient F."""
    mesh = ts.box(size=(1, 1, 1), cells=(2, 2, 2)).transformed(translate=(2, 0, -1))
    scene = ts.Scene(gravity=(0, 0, 0), precision=precision)
    body = scene.add_body(mesh, kind(YOUNG, POISSON, 1000.0, **keys))
    sim = Simulation(scene, threads=1)
    x = mesh.points @ np.asarray(gradient, float).T
    sim.set_state(x, 0 * x)
    return sim, body


def _stresses(kind, F):
    """Second Piola-Kirchhoff and Cauchy stress by differences of the energy in C = FᵀF."""
    muhat, lamhat = 4 * MU / 3, LAM + 5 * MU / 6
    alpha = 1 + 3 * muhat / (4 * lamhat)

    def energy(C):
        if kind is ts.ViscoElastic:
            E = (C - np.eye(3)) / 2
            return LAM / 2 * np.trace(E) ** 2 + MU * np.sum(E * E)
        J = np.sqrt(np.linalg.det(C)) * np.sign(np.linalg.det(F))
        i = np.trace(C)
        return muhat / 2 * i + lamhat / 2 * (J - alpha) ** 2 - muhat / 2 * np.log(i + 1)

    C, S, h = F.T @ F, np.zeros((3, 3)), 1e-5
    for r in range(3):
        for c in range(3):
            step = np.zeros((3, 3))
            step[r, c] += h / 2
            step[c, r] += h / 2
            S[r, c] = 2 * (energy(C + step) - energy(C - step)) / (2 * h)
    return S, F @ S @ F.T / np.linalg.det(F)


def test_patch_of_the_reference_table_has_its_stress_in_every_tet():
    H = np.array([[0.01, 0.003, -0.002], [0.004, -0.006, 0.005], [-0.001, 0.002, 0.008]])
    sim, body = _cube(ts.Linear, np.eye(3) + H)
    measured = sim.measures.elements(body)
    upper = [1461.538462, 269.230769, -115.384615, 230.769231, 269.230769, 1307.692308]
    rows, columns = np.triu_indices(3)
    assert measured.cauchy[:, rows, columns] == pytest.approx(
        np.tile(upper, (len(body.mesh.tets), 1)), abs=1e-6
    )
    assert np.array_equal(measured.cauchy, measured.second_piola)
    assert measured.strain[7] == pytest.approx((H + H.T) / 2, abs=1e-15)


@pytest.mark.parametrize("kind", [ts.ViscoElastic, ts.NeoHookean])
@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_stresses_are_derivatives_of_the_energy(kind, mirror):
    F = np.array([[1.1, 0.2, 0.0], [-0.1, 0.9, 0.05], [0.02, 0.1, 1.05]])
    F[:, 0] *= mirror
    sim, body = _cube(kind, F)
    measured = sim.measures.elements(body)
    S, cauchy = _stresses(kind, F)
    count = len(body.mesh.tets)
    assert measured.second_piola == pytest.approx(np.tile(S, (count, 1, 1)), abs=1e-4)
    assert measured.cauchy == pytest.approx(np.tile(cauchy, (count, 1, 1)), abs=1e-4)
    assert measured.strain[0] == pytest.approx((F.T @ F - np.eye(3)) / 2, abs=1e-14)
    assert measured.volume_ratio == pytest.approx(np.full(count, np.linalg.det(F)))
    deviator = cauchy - np.trace(cauchy) / 3 * np.eye(3)
    expected = np.sqrt(1.5 * np.sum(deviator**2))
    assert measured.von_mises == pytest.approx(np.full(count, expected), rel=1e-7)
    assert measured.inverted == (count if mirror < 0 else 0) == sim.measures.inverted()


@pytest.mark.parametrize("kind", [ts.ViscoElastic, ts.NeoHookean])
def test_flat_tets_have_finite_measures_and_count_as_inverted(kind):
    sim, body = _cube(kind, np.diag([1.0, 0.0, 1.0]))
    measured = sim.measures.elements(body)
    assert np.isfinite(measured.cauchy).all()
    assert measured.inverted == len(body.mesh.tets)


@pytest.mark.parametrize("kind", [ts.ViscoElastic, ts.NeoHookean])
def test_turned_bodies_are_unstrained_and_unstressed(kind):
    c, s = np.cos(1.1), np.sin(1.1)
    sim, body = _cube(kind, [[c, -s, 0], [s, c, 0], [0, 0, 1]])
    measured = sim.measures.elements(body)
    assert np.abs(measured.strain).max() < 1e-14
    assert measured.von_mises.max() < 1e-9 * YOUNG
    assert measured.volume_ratio == pytest.approx(1.0)


def test_small_strains_keep_their_digits_in_f32():
    sim, body = _cube(ts.ViscoElastic, np.diag([1 + 1e-6, 1.0, 1.0]), precision="f32")
    strain = sim.measures.elements(body).strain[:, 0, 0]
    assert strain == pytest.approx(np.full(len(strain), 1e-6), rel=1e-5)


def test_springs_report_strain_and_tension():
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64")
    mesh = ts.net([[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 1], [1, 2]])
    body = scene.add_body(mesh, ts.MassSpring(stiffness=50.0, node_mass=0.1))
    sim = Simulation(scene, threads=1)
    sim.set_state([[0, 0, 0], [1.2, 0, 0], [1.2, 0.9, 0]], np.zeros((3, 3)))
    measured = sim.measures.elements(body)
    assert measured.strain == pytest.approx([0.2, -0.1])
    assert measured.tension == pytest.approx([10.0, -5.0])
    assert sim.measures.nodal(body, measured.strain) == pytest.approx([0.2, 0.05, -0.1])


@pytest.mark.parametrize("kind", SOLIDS)
def test_nodal_averages_are_weighted_by_volume(kind):
    sim, body = _cube(kind, np.diag([1.1, 1.0, 0.9]))
    values = np.arange(len(body.mesh.tets), dtype=float)
    averaged = sim.measures.nodal(body, values)
    for node in (0, 13, 26):
        mine = (body.mesh.tets == node).any(axis=1)
        weights = body.mesh.volumes[mine]
        assert averaged[node] == pytest.approx(weights @ values[mine] / weights.sum())
    tensors = sim.measures.nodal(body, sim.measures.elements(body).strain)
    assert tensors.shape == (27, 3, 3)


@pytest.mark.parametrize("mass", ["lumped", "consistent"])
def test_momentum_of_a_spinning_flying_brick(mass):
    mesh = ts.box(size=(1, 0.5, 0.5), cells=(4, 2, 2))
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64")
    model = ts.ViscoElastic(YOUNG, POISSON, 1000.0, mass=mass)
    body = scene.add_body(mesh, model, velocity=(1, 2, 3), spin=(0.5, 1.0, 3.0))
    sim = Simulation(scene, threads=1)
    center = np.array([0.5, 0.25, 0.25])
    kilograms = 250.0
    assert sim.measures.momentum() == pytest.approx(kilograms * np.array([1, 2, 3]))
    spin = sim.measures.angular_momentum(body, about=center)
    whole = sim.measures.angular_momentum(body)
    assert whole - spin == pytest.approx(np.cross(center, kilograms * np.array([1, 2, 3])))
    if mass == "consistent":  # exact for velocities linear in space
        inertia = kilograms / 12 * np.array([0.5, 1.25, 1.25])
        assert spin == pytest.approx(inertia * [0.5, 1.0, 3.0])
        v = sim.velocities()
        exact = kilograms / 2 * 14 + 0.5 * inertia @ np.array([0.25, 1.0, 9.0])
        assert sim.energy()["kinetic"] == pytest.approx(exact)
        assert v.shape == (len(mesh.points), 3)


def test_what_belongs_to_another_scene_is_refused():
    sim, _ = _cube(ts.Linear, np.eye(3))
    _, stranger = _cube(ts.Linear, np.eye(3))
    with pytest.raises(ts.SceneError, match="not in this simulation's scene"):
        sim.measures.elements(stranger)


def test_a_body_with_a_damping_ratio_is_measured_as_others_are():
    sim, body = _cube(ts.NeoHookean, 2 * np.eye(3), damping_ratio=0.1, damping_at=5.0)
    measured = sim.measures.elements(body)
    assert sim.measures.inverted() == sim.measures.inverted(body) == measured.inverted == 0
    sim, body = _cube(ts.NeoHookean, np.diag([-1, 1, 1]), damping_ratio=0.1, damping_at=5.0)
    assert sim.measures.inverted() == sim.measures.inverted(body) == len(body.mesh.tets)
