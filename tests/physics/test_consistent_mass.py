"""Consistent mass: a fixed Chebyshev iteration solves M a = f to the rounding of the floats."""

import numpy as np
import pytest

import tisoft as ts


def beam(precision, mass="consistent"):
    scene = ts.Scene(precision=precision, frame_rate=60.0)
    body = scene.add_body(
        ts.box((1.0, 0.2, 0.2), (10, 2, 2)), ts.ViscoElastic(1e6, 0.3, 1000.0, mass=mass)
    )
    body.pin(ts.where.box((-1e-6, -1, -1), (1e-6, 1, 1)))
    return ts.Simulation(scene)


@pytest.mark.parametrize(("precision", "most"), [("f32", 2e-6), ("f64", 1e-13)])
def test_residual_is_rounding_after_the_fixed_iterations(precision, most):
    sim = beam(precision)
    for _ in range(5):
        sim.step()
    told = sim.mass_solve()
    assert told["iterations"] in (18, 36)
    assert 0.0 <= told["residual"] < most


def test_rows_sum_to_the_lumped_masses():
    system = beam("f64").system
    rows, _, entries = system.mass_entries()
    np.testing.assert_allclose(np.bincount(rows, entries), system.mass, rtol=1e-13)


def test_lumped_masses_need_no_solve():
    assert beam("f32", mass="lumped").mass_solve() is None
