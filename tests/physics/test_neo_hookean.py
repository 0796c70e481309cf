"""The stable neo-Hookean law: the stiffness of the others at rest, and a way back from anywhere."""

import numpy as np
import pytest
from beams import CLAMPED, beam, cantilever, displaced, rubber, simulate
from fem import lame, stiffness

import tisoft as ts
from tisoft import where
from tisoft.simulation import Simulation


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.45])
def test_stiffness_at_rest_is_that_of_linear_elasticity(poisson):
    """Young and Poisson come out right at small strain, from K by differences of the forces."""
    mesh = ts.box(size=(0.6, 0.4, 0.4), cells=(3, 2, 2))
    sim = simulate((mesh, ts.NeoHookean(1e5, poisson, 1000.0)))
    K = stiffness(mesh.points, mesh.tets, *lame(1e5, poisson))
    assert np.abs(sim.forces()).max() < 1e-9
    random = np.random.default_rng(0)
    for _ in range(5):
        u = random.standard_normal(mesh.points.shape)
        forces = []
        for sign in (1, -1):
            displaced(sim, sign * 1e-6 * u)
            forces.append(sim.forces())
        slope = (forces[0] - forces[1]).ravel() / 2e-6
        expected = -K @ u.ravel()
        assert np.abs(slope - expected).max() < 1e-7 * np.abs(expected).max()


def test_pull_test_has_the_stress_of_the_law():
    """P = μ' l (1 − 1/(I_C + 1)) + λ' (J − α) ∂J/∂l, with the sides free of stress."""
    lam, mu = lame(1e5, 0.3)
    mu_, lam_ = 4 * mu / 3, lam + 5 * mu / 6
    alpha = 1 + 3 * mu_ / (4 * lam_)
    stretch, side = 1.3, 1.0
    for _ in range(60):  # Newton for the side stretch

        def sideways(s):
            shrink = 1 - 1 / (stretch**2 + 2 * s**2 + 1)
            return mu_ * s * shrink + lam_ * (stretch * s**2 - alpha) * stretch * s

        slope = (sideways(side + 1e-6) - sideways(side - 1e-6)) / 2e-6
        side -= sideways(side) / slope
    pull = mu_ * stretch * (1 - 1 / (stretch**2 + 2 * side**2 + 1))
    pull += lam_ * (stretch * side**2 - alpha) * side**2
    mesh = ts.box(size=(1, 1, 1), cells=(2, 2, 2))
    sim = simulate((mesh, ts.NeoHookean(1e5, 0.3, 1000.0)))
    sim.set_state(mesh.points * [stretch, side, side], 0 * mesh.points)
    force = sim.forces()
    assert force[mesh.points[:, 0] == 1.0, 0].sum() == pytest.approx(-pull, rel=1e-10)
    assert np.abs(force[:, 1:]).max() < 1e-8 * pull


def _inverted(sim, mesh):
    x = sim.positions()[mesh.tets]
    return int((np.linalg.det(x[:, 1:] - x[:, :1]) < 0).sum())


def _dragged_through_itself(kind):
    """Tets inverted when the free end is let go, and 5 s later; the largest x then [m]."""
    mesh = beam()  # 200 tets
    scene = ts.Scene(gravity=(0, 0, 0), frame_rate=100.0, step=2e-4, precision="f64")
    body = scene.add_body(mesh, rubber(kind, phi=30.0, eta=30.0, point_damping=0.5))
    body.pin(CLAMPED)
    end = where.box((1 - 1e-9, -1, -1), (1 + 1e-9, 1, 1))
    body.pin(end, path=[[0, 0, 0, 0], [0.3, -2.0, 0, 0]], release=0.3)
    sim = Simulation(scene, certify=False, threads=1)
    for _ in range(30):
        sim.step()
    assert sim.positions()[mesh.points[:, 0] == 1.0, 0] == pytest.approx(-1.0, abs=1e-12)
    held = _inverted(sim, mesh)
    for _ in range(500):
        sim.step()
    return held, _inverted(sim, mesh), float(sim.positions()[:, 0].max())


def test_a_beam_dragged_through_itself_swings_out():
    held, left, end = _dragged_through_itself(ts.NeoHookean)
    assert held > 0
    assert left == 0
    assert end == pytest.approx(1.0, abs=0.05)


def test_st_venant_dragged_through_itself_stays_tangled():
    """An inverted tet is at rest in its mirror image (A12): it has no reason to turn back."""
    held, left, _ = _dragged_through_itself(ts.ViscoElastic)
    assert held > 150
    assert left > 140


@pytest.mark.parametrize(("kind", "left"), [(ts.ViscoElastic, 200), (ts.NeoHookean, 0)])
def test_a_beam_mirrored_whole(kind, left):
    """Inside out and at rest: St. Venant-Kirchhoff feels nothing, the stable law turns back."""
    mesh = beam()
    sim = cantilever(rubber(kind, phi=30.0, eta=30.0), mesh=mesh, h=2e-4, substeps=5000)
    rough = 1e-3 * (mesh.points[:, :1] > 0) * np.random.default_rng(0).random(mesh.points.shape)
    sim.set_state(mesh.points * [-1, 1, 1] + rough, 0 * mesh.points)
    assert _inverted(sim, mesh) == 200
    for _ in range(4):
        sim.step()
    assert _inverted(sim, mesh) == left
    assert (sim.positions()[:, 0].max() > 0.8) == (left == 0)
