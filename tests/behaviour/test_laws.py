"""One tet of every law, in any state, against the formulas of docs/models.md in NumPy."""

import numpy as np
import pytest

import tisoft as ts

YOUNG, POISSON, DENSITY = 1e4, 0.3, 1000.0
MU = YOUNG / (2 * (1 + POISSON))
LAM = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
PHI, ETA = 30.0, 70.0
POINTS = np.array([[0.1, 0.0, 0.2], [1.1, 0.1, 0.0], [0.2, 0.9, 0.1], [0.0, 0.2, 1.2]])
SOLIDS = [ts.Linear, ts.MassTensor, ts.ViscoElastic, ts.NeoHookean]
I3 = np.eye(3)


def tet(kind, **keys):
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64")
    model = kind(YOUNG, POISSON, DENSITY, **keys)
    scene.add_body(ts.tet_mesh(POINTS, [[0, 1, 2, 3]]), model)
    return ts.Simulation(scene, threads=1)


def gradients():
    """∇N_a, shape (4, 3), and the volume."""
    edges = POINTS[1:] - POINTS[0]
    inner = np.linalg.inv(edges)  # columns are ∇N_1 … ∇N_3
    return np.vstack([-inner.sum(axis=1), inner.T]), np.linalg.det(edges) / 6.0


def hooke(strain, lam, mu):
    return lam * np.trace(strain) * I3 + 2.0 * mu * strain


def stress(kind, H, rate=None, phi=0.0, eta=0.0):
    """First Piola-Kirchhoff stress of H = ∇u and its rate."""
    F = I3 + H
    rate = 0.0 * H if rate is None else rate
    if kind in (ts.Linear, ts.MassTensor):
        return hooke(0.5 * (H + H.T), LAM, MU) + hooke(0.5 * (rate + rate.T), phi, eta)
    viscous = F @ hooke(0.5 * (F.T @ rate + rate.T @ F), phi, eta)
    if kind is ts.ViscoElastic:
        return F @ hooke(0.5 * (F.T @ F - I3), LAM, MU) + viscous
    mu, lam = 4.0 * MU / 3.0, LAM + 5.0 * MU / 6.0
    alpha = 1.0 + 0.75 * mu / lam
    J, square = np.linalg.det(F), np.trace(F.T @ F)
    cofactor = J * np.linalg.inv(F).T
    return mu * (1.0 - 1.0 / (square + 1.0)) * F + lam * (J - alpha) * cofactor + viscous


def density_of_energy(kind, H):
    F = I3 + H
    if kind is ts.NeoHookean:
        mu, lam = 4.0 * MU / 3.0, LAM + 5.0 * MU / 6.0
        alpha = 1.0 + 0.75 * mu / lam

        def psi(F):
            square = np.trace(F.T @ F)
            bulk = 0.5 * lam * (np.linalg.det(F) - alpha) ** 2
            return 0.5 * mu * (square - 3.0 - np.log(square + 1.0)) + bulk

        return psi(F) - psi(I3)
    strain = 0.5 * (F.T @ F - I3) if kind is ts.ViscoElastic else 0.5 * (H + H.T)
    return 0.5 * LAM * np.trace(strain) ** 2 + MU * (strain * strain).sum()


STATES = [("small", 1e-5), ("moderate", 0.2), ("large", 1.0)]


def random_gradient(size, seed):
    return size * np.random.default_rng(seed).standard_normal((3, 3))


@pytest.mark.parametrize(("name", "size"), STATES)
@pytest.mark.parametrize("kind", SOLIDS)
def test_elastic_forces_and_energy(kind, name, size):
    sim = tet(kind)
    slopes, volume = gradients()
    for seed in range(5):
        H = random_gradient(size, seed)
        sim.set_state(POINTS + POINTS @ H.T, np.zeros((4, 3)))
        expected = -volume * slopes @ stress(kind, H).T
        error = np.abs(sim.forces() - expected).max()
        assert error < 1e-9 * np.abs(expected).max()
        energy = volume * density_of_energy(kind, H)
        rounding = 1e-15 * YOUNG * volume  # of the differences that the formula above takes
        assert sim.energy()["elastic"] == pytest.approx(energy, rel=1e-9, abs=rounding)


@pytest.mark.parametrize(("name", "size"), STATES)
@pytest.mark.parametrize("kind", SOLIDS)
def test_viscous_forces(kind, name, size):
    """Resistance to the rate of strain, whatever the shape."""
    slopes, volume = gradients()
    for phi, eta in ((PHI, 0.0), (0.0, ETA), (PHI, ETA)):
        sim = tet(kind, phi=phi, eta=eta)
        for seed in range(2):
            H, rate = random_gradient(size, seed), random_gradient(3.0, seed + 10)
            velocities = np.array([1.0, -2.0, 0.5]) + POINTS @ rate.T
            sim.set_state(POINTS + POINTS @ H.T, velocities)
            expected = -volume * slopes @ stress(kind, H, rate, phi, eta).T
            assert np.abs(sim.forces() - expected).max() < 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize("kind", SOLIDS)
def test_the_substep_uses_the_same_forces(kind):
    """v' = v + h f/m, with a quarter of the mass at each corner."""
    step = 1e-6
    slopes, volume = gradients()
    model = kind(YOUNG, POISSON, DENSITY, phi=PHI, eta=ETA, point_damping=2.0)
    scene = ts.Scene(gravity=(0.5, -9.81, 0.25), precision="f64", step=step, frame_rate=1.0 / step)
    scene.add_body(ts.tet_mesh(POINTS, [[0, 1, 2, 3]]), model)
    sim = ts.Simulation(scene, threads=1, certify=False)
    H, rate = random_gradient(0.2, 3), random_gradient(3.0, 4)
    velocities = POINTS @ rate.T
    sim.set_state(POINTS + POINTS @ H.T, velocities)
    sim.step()
    force = -volume * slopes @ stress(kind, H, rate, PHI, ETA).T
    mass = 0.25 * DENSITY * volume
    change = force / mass + [0.5, -9.81, 0.25] - 2.0 * velocities
    gained = (sim.velocities() - velocities) / step
    assert np.abs(gained - change).max() < 1e-7 * np.abs(change).max()
    moved = (sim.positions() - (POINTS + POINTS @ H.T)) / step
    assert np.abs(moved - sim.velocities()).max() < 1e-8


@pytest.mark.parametrize("kind", [ts.ViscoElastic, ts.NeoHookean])
def test_turning_as_a_whole_makes_no_force(kind):
    sim = tet(kind, phi=PHI, eta=ETA)
    rng = np.random.default_rng(1)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    spin = np.cross([3.0, -1.0, 2.0], POINTS @ turn.T)
    sim.set_state(POINTS @ turn.T, spin)
    assert np.abs(sim.forces()).max() < 1e-9 * YOUNG
    assert abs(sim.energy()["elastic"]) < 1e-12 * YOUNG
