"""Forces are minus the gradient of the energy, and leave momentum alone, for every model."""

import numpy as np
import pytest

import tisoft as ts
from tisoft.geometry.mesh import tet_mesh
from tisoft.simulation import Simulation

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
MOVED = np.array([(0, 0, 0), (1.1, 0.05, 0), (0, 1, 0), (0.02, 0, 0.95)])
RATES = np.array([(0, 0, 0), (0.5, 0.2, 0), (0, -0.3, 0.1), (0.2, 0, 0.4)])
SOLIDS = [ts.Linear, ts.MassTensor, ts.ViscoElastic, ts.NeoHookean]
OBJECTIVE = [ts.ViscoElastic, ts.NeoHookean]

# REFERENCES 0.3: E = 1000, nu = 0.25, phi = 3, psi = 2.
ST_VENANT = [
    [25.07146667, 8.32066667, -1.102],
    [-19.844, -4.234, -1.39333333],
    [-3.66666667, -4.01333333, 0],
    [-1.5608, -0.07333333, 2.49533333],
]
LINEAR = [
    [21.33333333, 6.66666667, -2.0],
    [-16.66666667, -3.33333333, -1.33333333],
    [-3.33333333, -3.33333333, 0],
    [-1.33333333, 0, 3.33333333],
]
VISCOUS = [
    [0.93076, 0.25701667, 0.65201667],
    [-0.7664, -0.09643333, -0.07283333],
    [-0.06846667, -0.12508333, -0.03008333],
    [-0.09589333, -0.0355, -0.5491],
]


def _one_tet(model):
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64")
    scene.add_body(tet_mesh(CORNERS, [[0, 1, 2, 3]]), model)
    return Simulation(scene, threads=1)


def _spring_body(scene, mesh, **damping):
    model = ts.MassSpring(young=1e4, density=800.0, **damping)
    return scene.add_body(mesh, model)


def _bent_block(kind, *, precision="f64", damping=0.0):
    """A block of one model, strained by some 10 % and moving, away from the origin."""
    mesh = ts.box(size=(1.0, 0.4, 0.3), cells=(4, 2, 2)).transformed(translate=(3, -2, 1))
    scene = ts.Scene(gravity=(0, 0, 0), precision=precision)
    if kind is ts.MassSpring:
        _spring_body(scene, mesh, spring_damping=0.1 * damping)
    else:
        scene.add_body(mesh, kind(1e4, 0.3, 800.0, phi=damping, eta=2 * damping))
    sim = Simulation(scene, threads=1)
    random = np.random.default_rng(3)
    x = mesh.points + 0.02 * random.standard_normal(mesh.points.shape)
    sim.set_state(x, random.standard_normal(mesh.points.shape))
    return sim


def _neo_hookean_energy(x):
    """The stable neo-Hookean energy of the one tet, from principal stretches (Smith 2018)."""
    lam = mu = 400.0
    muhat, lamhat = 4 * mu / 3, lam + 5 * mu / 6
    alpha = 1 + 3 * muhat / (4 * lamhat)
    F = np.stack([x[k] - x[0] for k in (1, 2, 3)], axis=1)
    s = np.linalg.svd(F, compute_uv=False)

    def density(stretch, volume):
        i = (stretch**2).sum()
        log = np.log(i + 1)
        return muhat / 2 * (i - 3) + lamhat / 2 * (volume - alpha) ** 2 - muhat / 2 * log

    return (density(s, np.linalg.det(F)) - density(np.ones(3), 1.0)) / 6.0


@pytest.mark.parametrize(
    ("model", "table"),
    [(ts.ViscoElastic, ST_VENANT), (ts.Linear, LINEAR), (ts.MassTensor, LINEAR)],
)
def test_one_tet_forces_of_the_reference_table(model, table):
    sim = _one_tet(model(1000.0, 0.25, 1.0))
    sim.set_state(MOVED, RATES)
    assert sim.forces() == pytest.approx(np.array(table), abs=6e-9)


@pytest.mark.parametrize("model", OBJECTIVE)
def test_one_tet_viscous_forces_of_the_reference_table(model):
    sim = _one_tet(model(1000.0, 0.25, 1.0, phi=3.0, eta=2.0))
    sim.set_state(MOVED, 0 * RATES)
    still = sim.forces()
    sim.set_state(MOVED, RATES)
    viscous = sim.forces() - still
    assert viscous == pytest.approx(np.array(VISCOUS), abs=6e-9)
    assert (viscous * RATES).sum() == pytest.approx(-0.6067886667, rel=1e-9)


def test_one_tet_energy_of_the_reference_table():
    sim = _one_tet(ts.ViscoElastic(1000.0, 0.25, 1.0))
    sim.set_state(MOVED, 0 * RATES)
    assert sim.energy()["elastic"] == pytest.approx(1.1201873333333333, rel=1e-9)


def test_one_tet_neo_hookean_energy_and_forces_from_principal_stretches():
    sim = _one_tet(ts.NeoHookean(1000.0, 0.25, 1.0))
    sim.set_state(MOVED, 0 * RATES)
    assert sim.energy()["elastic"] == pytest.approx(_neo_hookean_energy(MOVED), rel=1e-12)
    expected = np.zeros((4, 3))
    step = 1e-5
    for index in np.ndindex(4, 3):
        ahead, back = MOVED.copy(), MOVED.copy()
        ahead[index] += step
        back[index] -= step
        expected[index] = -(_neo_hookean_energy(ahead) - _neo_hookean_energy(back)) / (2 * step)
    assert sim.forces() == pytest.approx(expected, abs=1e-7)
    # The same, to keep the digits (E = 1000, nu = 0.25).
    assert sim.forces()[0] == pytest.approx([20.16165975, 6.73512372, -2.19585631], abs=6e-9)


@pytest.mark.parametrize("kind", [*SOLIDS, ts.MassSpring])
def test_force_is_minus_the_gradient_of_the_energy(kind):
    sim = _bent_block(kind)
    x, v = sim.positions(), 0 * sim.velocities()
    direction = np.random.default_rng(5).standard_normal(x.shape)
    sim.set_state(x, v)
    power = (sim.forces() * direction).sum()
    differences = []
    for step in (2e-5, 1e-5):
        energy = []
        for sign in (1, -1):
            sim.set_state(x + sign * step * direction, v)
            energy.append(sim.energy()["elastic"])
        differences.append(-(energy[0] - energy[1]) / (2 * step))
    extrapolated = (4 * differences[1] - differences[0]) / 3
    assert extrapolated == pytest.approx(power, rel=1e-8)


@pytest.mark.parametrize("kind", [*SOLIDS, ts.MassSpring])
def test_internal_forces_add_up_to_nothing(kind):
    sim = _bent_block(kind, damping=20.0)
    f = sim.forces()
    assert np.abs(f.sum(axis=0)).max() < 1e-11 * np.abs(f).sum()


@pytest.mark.parametrize("kind", [*OBJECTIVE, ts.MassSpring])
def test_internal_forces_turn_nothing(kind):
    sim = _bent_block(kind, damping=20.0)
    f = sim.forces()
    torque = np.cross(sim.positions(), f).sum(axis=0)
    assert np.abs(torque).max() < 1e-11 * np.abs(f).sum()


@pytest.mark.parametrize("kind", [*SOLIDS, ts.MassSpring])
def test_viscosity_takes_energy(kind):
    damped, free = _bent_block(kind, damping=20.0), _bent_block(kind)
    power = ((damped.forces() - free.forces()) * free.velocities()).sum()
    assert power < 0.0


def test_kinetic_and_gravity_energy_of_a_flying_block():
    mesh = ts.box(size=(1, 1, 1), cells=(2, 2, 2))
    scene = ts.Scene(gravity=(0, -10, 0), precision="f64")
    scene.add_body(mesh, ts.ViscoElastic(1e5, 0.3, 1000.0), velocity=(3, 4, 0))
    sim = Simulation(scene, threads=1)
    assert sim.energy()["kinetic"] == pytest.approx(12500.0)
    assert sim.energy()["gravity"] == 0.0
    sim.set_state(mesh.points + np.array([0, 2, 0]), sim.velocities())
    assert sim.energy()["gravity"] == pytest.approx(20000.0)
    assert sim.energy()["elastic"] == pytest.approx(0.0, abs=1e-20)


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize("kind", [*SOLIDS, ts.MassSpring])
def test_plain_forces_are_those_that_move_the_nodes(kind, precision):
    """One substep of the lane-batch kernel against x'' = f/m with the plain kernels' force."""
    sim = _bent_block(kind, precision=precision, damping=20.0)
    before, f = sim.velocities(), sim.forces()
    step = 1.0 / 1024
    sim.stepper.advance(1, step, (0, 0, 0))
    mass = sim._outside(sim.system.mass[:, None] * np.ones(3), None)
    moved = mass * (sim.velocities() - before) / step
    digits = np.finfo(sim.system.real).eps
    lost = digits * (np.abs(f).max() + (mass * np.abs(before)).max() / step)
    assert np.abs(moved - f).max() < 30 * lost
