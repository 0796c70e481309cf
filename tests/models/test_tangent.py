"""The tangent stiffness against differences of forces, forces against differences of energy."""

import numpy as np
import pytest

import tisoft as ts
from tisoft.equilibrium.operators import Elastic
from tisoft.model.part import parts_of

SOLIDS = [ts.Linear, ts.MassTensor, ts.ViscoElastic, ts.NeoHookean]


def elastic(model, mesh):
    return Elastic(parts_of([ts.Scene().add_body(mesh, model)])[0])


def solid(kind, **options):
    mesh = ts.box((1.0, 0.4, 0.3), (3, 2, 2))
    return elastic(kind(1e4, 0.3, 1000.0, **options), mesh)


def springs(damping=0.0):
    mesh = ts.box((1.0, 0.4, 0.3), (3, 2, 2))
    return elastic(ts.MassSpring(young=1e4, density=1000.0, spring_damping=damping), mesh)


def bodies():
    return [(kind.__name__, solid(kind)) for kind in SOLIDS] + [("MassSpring", springs())]


def random_state(body, size=0.02, seed=0):
    rng = np.random.default_rng(seed)
    return size * rng.standard_normal((body.nodes, 3)), rng.standard_normal((body.nodes, 3))


def test_forces_are_minus_the_gradient_of_the_energy():
    for name, body in bodies():
        u, w = random_state(body)
        h = 1e-6
        slope = (body.energy(u + h * w) - body.energy(u - h * w)) / (2 * h)
        assert -(body.force(u) * w).sum() == pytest.approx(slope, rel=1e-7), name


def test_stiffness_is_minus_the_gradient_of_the_force():
    for name, body in bodies():
        u, w = random_state(body)
        h = 1e-6
        difference = -(body.force(u + h * w) - body.force(u - h * w)) / (2 * h)
        product = body.stiffness_times(w, u)
        assert np.abs(product - difference).max() < 1e-7 * np.abs(product).max(), name


def test_stiffness_is_symmetric():
    for name, body in bodies():
        u, w = random_state(body)
        z = random_state(body, seed=1)[1]
        one, other = (z * body.stiffness_times(w, u)).sum(), (w * body.stiffness_times(z, u)).sum()
        assert one == pytest.approx(other, rel=1e-12), name


def test_stiffness_at_rest_has_the_six_rigid_motions_and_nothing_negative():
    for name, body in bodies():
        rest = np.zeros((body.nodes, 3))
        values = np.linalg.eigvalsh(body.stiffness(rest).toarray())
        assert values[0] > -1e-10 * values[-1], name
        assert np.sum(np.abs(values) < 1e-9 * values[-1]) == 6, name


def test_sparse_matrices_multiply_as_the_kernels_do():
    for name, body in bodies():
        u, w = random_state(body)
        product = body.stiffness_times(w, u)
        sparse = (body.stiffness(u) @ w.ravel()).reshape(-1, 3)
        assert np.abs(product - sparse).max() < 1e-12 * np.abs(product).max(), name


def test_viscosity_is_symmetric_takes_energy_and_leaves_turning_alone():
    damped = [(k.__name__, solid(k, phi=3.0, eta=2.0)) for k in SOLIDS]
    for name, body in [*damped, ("MassSpring", springs(damping=2.0))]:
        u, w = random_state(body)
        product = body.viscosity_times(w, u)
        assert (w * product).sum() > 0, name
        sparse = (body.viscosity(u) @ w.ravel()).reshape(-1, 3)
        assert np.abs(product - sparse).max() < 1e-12 * np.abs(product).max(), name
        place = body.rest if name in ("Linear", "MassTensor") else body.rest + u
        turning = np.cross([0.3, -1.0, 0.5], place)
        assert np.abs(body.viscosity_times(turning, u)).max() < 1e-12 * np.abs(product).max(), name


def test_one_tet_of_st_venant_feels_the_forces_of_the_reference():
    """REFERENCES 0.3: E = 1000, ν = 1/4."""
    mesh = ts.tet_mesh(
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float), np.array([[0, 1, 2, 3]])
    )
    x = np.array([[0, 0, 0], [1.1, 0.05, 0], [0, 1, 0], [0.02, 0, 0.95]])
    body = elastic(ts.ViscoElastic(1000.0, 0.25, 1.0), mesh)
    order = body.part.order
    u = (x - mesh.points)[order]
    expected = np.array(
        [
            [25.07146667, 8.32066667, -1.102],
            [-19.844, -4.234, -1.39333333],
            [-3.66666667, -4.01333333, 0],
            [-1.5608, -0.07333333, 2.49533333],
        ]
    )
    assert np.allclose(body.force(u), expected[order], atol=1e-8)
    assert body.energy(u) == pytest.approx(1.1201873333, abs=1e-10)


def test_mass_tensor_and_linear_have_one_stiffness():
    one, other = solid(ts.Linear), solid(ts.MassTensor)
    u, w = random_state(one)
    assert np.array_equal(one.stiffness_times(w, u), other.stiffness_times(w, u))


def test_consistent_mass_sums_to_the_lumped_one():
    body = solid(ts.ViscoElastic)
    assert np.allclose(body.consistent_mass().sum(axis=1).ravel(), body.mass, rtol=1e-12)
