"""A4: the beam released straight under its weight, undamped St. Venant-Kirchhoff, five 10x2x2."""

import numpy as np
import pytest
from beams import beam, cantilever, node_at, rubber

TIP = node_at(beam(), (1.0, 0.1, 0.1))

# z of the tip, exact in time, ±2e-6.
TIMES = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0])
HEIGHTS = np.array(
    [0.0366431, -0.1357890, -0.3016162, -0.3663717, -0.3148748, -0.1529045, 0.1005796, -0.1201049]
)


def _dropped(h, integrator):
    return cantilever(
        rubber(), h=h, substeps=round(0.1 / h), gravity=(0, 0, -9.81), integrator=integrator
    )


def _heights(h, integrator="symplectic-euler"):
    """z of the tip [m] at .1, .2, … 1 s."""
    sim = _dropped(h, integrator)
    return np.array([sim.step().positions()[TIP, 2] for _ in range(10)])


@pytest.mark.parametrize(("h", "z"), [(1e-3, -0.1519818), (5e-4, -0.1524473), (2.5e-4, -0.1526774)])
def test_symplectic_euler(h, z):
    assert _heights(h)[5] == pytest.approx(z, abs=1e-6)


def test_error_of_symplectic_euler_halves_with_the_step():
    errors = [_heights(h)[5] - HEIGHTS[5] for h in (1e-3, 5e-4, 2.5e-4)]
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.05)
    assert errors[1] / errors[2] == pytest.approx(2.0, abs=0.05)


def test_velocity_verlet():
    """A4 prints −.1529020; an independent NumPy run of the same scheme gives the longer number."""
    z = _heights(4e-4, "velocity-verlet")[5]
    assert z == pytest.approx(-0.1529020, abs=2e-6)
    assert z == pytest.approx(-0.15290097590881, abs=1e-12)


def test_trajectory_that_is_exact_in_time():
    heights = _heights(1e-4, "velocity-verlet")
    assert heights[[0, 1, 2, 3, 4, 5, 7, 9]] == pytest.approx(HEIGHTS, abs=2e-6)


def test_first_minimum():
    sim = cantilever(
        rubber(), h=5e-5, substeps=1, gravity=(0, 0, -9.81), integrator="velocity-verlet"
    )
    sim.stepper.advance(8000, 5e-5, (0, 0, -9.81))
    z = [sim.step().positions()[TIP, 2] for _ in range(80)]
    assert min(z) == pytest.approx(-0.3663978, abs=2e-6)
    assert 0.4 + 5e-5 * (np.argmin(z) + 1) == pytest.approx(0.40185, abs=5e-5)


def test_swing_falls_short_of_the_continuum_as_tabulated():
    """Linear tets are stiff: with two of them through the thickness 26 % of the swing is lost."""
    lowest = -0.3663978 - 0.1
    continuum = -0.630
    assert _heights(1e-3).min() - 0.1 == pytest.approx(lowest, abs=2e-3)
    assert 1 - lowest / continuum == pytest.approx(0.26, abs=0.005)
