"""A8 and A7: orders of the integrators, how explicit Euler fails, and their exact step limits."""

import numpy as np
import pytest
from beams import oscillator, place, pulled, simulate

import tisoft as ts

OMEGA = 2 * np.pi
ORDERS = {"symplectic-euler": 1, "velocity-verlet": 2, "explicit-euler": 1}
DAMPINGS = [{}, {"drag": 1.5}, {"damper": 1.5}]
"""Undamped, and twice 2ζω = 1.5 1/s: by drag on the point, by a damper along the spring."""


def _place(h, time, *, integrator, **damping):
    """x(time) of x'' = −(2π)² x − 2ζω x', x(0) = 1, v(0) = 0."""
    sim = oscillator(OMEGA, h=h, substeps=round(time / h), integrator=integrator, **damping)
    pulled(sim, 1.0)
    sim.step()
    return place(sim)


def _exact(time, damping):
    rate = sum(damping.values()) / 2
    w = np.sqrt(OMEGA**2 - rate**2)
    return np.exp(-rate * time) * (np.cos(w * time) + rate / w * np.sin(w * time))


@pytest.mark.parametrize(
    ("integrator", "table"),
    [
        ("symplectic-euler", [-0.0316899, -0.0157745, -0.0078704]),
        ("velocity-verlet", [-2.58500e-4, -6.46036e-5, -1.61496e-5]),
    ],
)
def test_quarter_of_a_swing(integrator, table):
    found = [_place(h, 0.25, integrator=integrator) for h in (0.01, 0.005, 0.0025)]
    assert found == pytest.approx(table, rel=2e-6, abs=6e-8)


@pytest.mark.parametrize("damping", DAMPINGS)
@pytest.mark.parametrize("integrator", ORDERS)
def test_order(integrator, damping):
    errors = [
        abs(_place(h, 0.6, integrator=integrator, **damping) - _exact(0.6, damping))
        for h in (2e-3, 1e-3, 5e-4)
    ]
    orders = np.log2(errors[:-1]) - np.log2(errors[1:])
    assert orders == pytest.approx(np.full(2, ORDERS[integrator]), abs=0.06)


def test_symplectic_euler_started_half_a_step_back_gives_the_places_of_verlet():
    h, n = 0.01, 40
    verlet = oscillator(OMEGA, h=h, integrator="velocity-verlet")
    pulled(verlet, 1.0)
    euler = oscillator(OMEGA, h=h)
    pulled(euler, 1.0, v=0.5 * h * OMEGA**2)  # v(0) − h a(0)/2
    for _ in range(n):
        verlet.step()
        euler.step()
        assert place(euler) == pytest.approx(place(verlet), abs=1e-12)


def test_explicit_euler_gains_energy_at_its_rate():
    """Undamped, every substep multiplies the energy by exactly 1 + h² ω²."""
    h, n = 0.004, 300
    sim = oscillator(OMEGA, h=h, substeps=n, integrator="explicit-euler")
    pulled(sim, 1e-3)
    sim.step()
    energy = sim.velocities()[1, 0] ** 2 + OMEGA**2 * place(sim) ** 2
    assert energy / (OMEGA * 1e-3) ** 2 == pytest.approx((1 + (h * OMEGA) ** 2) ** n, rel=1e-9)


# Stable exactly while h²ω² + 2 h d <= 4 (symplectic Euler) or h²ω² + 4 h d <= 4 (Verlet), d = 2ζω.
DAMPING_WEIGHT = {"symplectic-euler": 2.0, "velocity-verlet": 4.0}
ZETAS = [0.0, 0.05, 0.3, 1.0, 3.0]


def _limit(integrator, omega, d):
    b = DAMPING_WEIGHT[integrator] * d
    return (-b + np.sqrt(b**2 + 16 * omega**2)) / (2 * omega**2)


def test_limit_of_the_seed_scheme_as_tabulated():
    limits = [_limit("symplectic-euler", 1.0, 2 * zeta) for zeta in ZETAS]
    assert limits == pytest.approx([2, 1.9024984, 1.4880613, 0.8284271, 0.3245553], abs=5e-8)


@pytest.mark.parametrize("kind", ["drag", "damper"])
@pytest.mark.parametrize("zeta", ZETAS)
@pytest.mark.parametrize("integrator", DAMPING_WEIGHT)
def test_bounded_below_the_limit_and_grows_above(integrator, zeta, kind):
    d = 2 * zeta * OMEGA
    limit = _limit(integrator, OMEGA, d)
    reach = []
    for share in (0.99, 1.01):
        sim = oscillator(OMEGA, integrator=integrator, **{kind: d})
        pulled(sim, 1e-12)
        sim.stepper.advance(2000, share * limit, (0, 0, 0))
        reach.append(abs(place(sim)))
    assert reach[0] < 1e-11
    assert not reach[1] < 1e-8


@pytest.mark.parametrize("kind", ["point_damping", "spring_damping"])
@pytest.mark.parametrize("zeta", ZETAS)
@pytest.mark.parametrize("integrator", DAMPING_WEIGHT)
def test_bound_of_a_free_pair_of_points_is_the_limit_itself(integrator, zeta, kind):
    """Two equal masses m on a spring k: ω² = 2k/m, and a damper c has 2ζω = 2c/m."""
    mass, d = 0.3, 2 * zeta * OMEGA
    size = {"point_damping": d, "spring_damping": d * mass / 2}[kind]
    model = ts.MassSpring(stiffness=OMEGA**2 * mass / 2, node_mass=mass, **{kind: size})
    mesh = ts.net([[0, 0, 0], [1, 2, 2]], [[0, 1]])
    sim = simulate((mesh, model), integrator=integrator)
    assert sim.stable_step() == pytest.approx(_limit(integrator, OMEGA, d), rel=1e-12)


@pytest.mark.parametrize("integrator", DAMPING_WEIGHT)
def test_bound_of_a_held_oscillator_is_safe(integrator):
    """Its other end is held, which the bound may count as a free node: at worst half the limit."""
    for d in (0.0, 1.5, 40.0):
        limit = _limit(integrator, OMEGA, d)
        for damping in ({"drag": d}, {"damper": d}):
            bound = oscillator(OMEGA, integrator=integrator, **damping).stable_step()
            assert 0.5 * limit <= bound <= limit * (1 + 1e-12)
