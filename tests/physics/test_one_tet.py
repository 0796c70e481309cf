"""REFERENCES 0.2 and 0.3: forces of one tet, as the acceleration of one substep tells them."""

import numpy as np
import pytest
from beams import displaced, one_step_force, simulate

import tisoft as ts

X = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
x = np.array([(0, 0, 0), (1.1, 0.05, 0), (0, 1, 0), (0.02, 0, 0.95)])
V = np.array([(0, 0, 0), (0.5, 0.2, 0), (0, -0.3, 0.1), (0.2, 0, 0.4)])
E, NU, LAM, MU, PHI, ETA = 1000.0, 0.25, 400.0, 400.0, 3.0, 2.0


def _exactly(table):
    """The tabulated numbers are sixths of short decimals, which gives back the digits cut off."""
    return np.round(6 * np.array(table), 5) / 6


ST_VENANT = _exactly(
    [
        (25.07146667, 8.32066667, -1.10200000),
        (-19.844, -4.234, -1.39333333),
        (-3.66666667, -4.01333333, 0),
        (-1.5608, -0.07333333, 2.49533333),
    ]
)
LINEAR = _exactly(
    [
        (21.33333333, 6.66666667, -2.0),
        (-16.66666667, -3.33333333, -1.33333333),
        (-3.33333333, -3.33333333, 0),
        (-1.33333333, 0, 3.33333333),
    ]
)
VISCOUS = _exactly(
    [
        (0.93076000, 0.25701667, 0.65201667),
        (-0.76640000, -0.09643333, -0.07283333),
        (-0.06846667, -0.12508333, -0.03008333),
        (-0.09589333, -0.03550000, -0.54910000),
    ]
)
GRADIENTS = np.array([(-1, -1, -1), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
VOLUME = 1.0 / 6.0


def _force(model, positions, velocities=0.0):
    mesh = ts.tet_mesh(X, [[0, 1, 2, 3]])
    sim = simulate((mesh, model))
    displaced(sim, positions - X, velocities)
    return one_step_force(sim)


def _close(force, table):
    return np.abs(force - table).max() < 1e-9


def test_st_venant_force():
    assert _close(_force(ts.ViscoElastic(E, NU, 1.0), x), ST_VENANT)


@pytest.mark.parametrize("kind", [ts.Linear, ts.MassTensor])
def test_linear_force(kind):
    assert _close(_force(kind(E, NU, 1.0), x), LINEAR)


@pytest.mark.parametrize("kind", [ts.ViscoElastic, ts.NeoHookean])
def test_viscous_force(kind):
    damped = _force(kind(E, NU, 1.0, phi=PHI, eta=ETA), x, V)
    viscous = damped - _force(kind(E, NU, 1.0), x, V)
    assert _close(viscous, VISCOUS)
    assert (viscous * V).sum() == pytest.approx(-0.6067886667, abs=1e-9)


def test_published_force_with_half_the_volume_is_the_physical_one():
    """The factor-4 trap: ε = FᵀF − I, σ = 2S, f = −(V/2) F σ ∇N; the gradient of ½∫σ:ε is 4 f."""
    F = sum(np.outer(p, g) for p, g in zip(x, GRADIENTS, strict=True))
    eps = F.T @ F - np.eye(3)
    sigma = LAM * np.trace(eps) * np.eye(3) + 2 * MU * eps
    published = -0.5 * VOLUME * GRADIENTS @ sigma @ F.T
    force = _force(ts.ViscoElastic(E, NU, 1.0), x)
    assert _close(force, published)
    assert 4 * force[0, 0] == pytest.approx(100.286, abs=1e-3)  # what the trap gives


def test_mass_tensor_force_is_the_linear_force_to_rounding():
    mesh = ts.ball(radius=0.4, resolution=3)
    random = np.random.default_rng(1)
    u, v = 0.1 * random.standard_normal((2, *mesh.points.shape))
    forces = []
    for kind in (ts.Linear, ts.MassTensor):
        sim = simulate((mesh, kind(E, 0.4, 1.0, phi=PHI, eta=ETA)))
        displaced(sim, u, v)
        forces.append(one_step_force(sim))
    assert np.abs(forces[0] - forces[1]).max() < 1e-13 * np.abs(forces[0]).max()


def _neo_hookean_force(F, lam, mu):
    """−V P ∇N with P = ∂Ψ/∂F = μ' F (1 − 1/(I_C + 1)) + λ' (J − α) J F⁻ᵀ."""
    mu_, lam_ = 4 * mu / 3, lam + 5 * mu / 6
    alpha = 1 + 3 * mu_ / (4 * lam_)
    J = np.linalg.det(F)
    P = mu_ * F * (1 - 1 / (np.trace(F.T @ F) + 1)) + lam_ * (J - alpha) * J * np.linalg.inv(F).T
    return -VOLUME * GRADIENTS @ P.T


TURNED_OUT = np.array([(0, 0, 0), (-0.8, 0.3, 0.1), (0.1, 0.9, -0.2), (0.3, 0, 1.2)])


@pytest.mark.parametrize("positions", [x, TURNED_OUT])
def test_neo_hookean_force(positions):
    F = (positions[1:] - positions[0]).T
    expected = _neo_hookean_force(F, LAM, MU)
    assert _close(_force(ts.NeoHookean(E, NU, 1.0), positions), expected)


def test_neo_hookean_row_of_its_own():
    """Digits of the independent form above at the positions of REFERENCES 0.3."""
    force = _force(ts.NeoHookean(E, NU, 1.0), x)
    assert force[0] == pytest.approx([20.16165975, 6.73512372, -2.19585631], abs=6e-9)


def test_small_displacements_feel_the_linear_force():
    u = 1e-6 * (x - X)
    expected = 1e-6 * LINEAR
    for kind in (ts.ViscoElastic, ts.NeoHookean):
        assert np.abs(_force(kind(E, NU, 1.0), X + u) - expected).max() < 1e-5 * 1e-6 * 25
