"""Every element with every law: its forces are minus the gradient of its energy, see no rigid
motion, add up to nothing, and leave no mode without stiffness but the six of a rigid body.
"""

import numpy as np
import pytest

import tisoft as ts
from tisoft.equilibrium.operators import Elastic
from tisoft.geometry.solid import SolidMesh
from tisoft.model.part import parts_of

LAWS = {"viscoelastic": ts.ViscoElastic, "linear": ts.Linear, "neo-hookean": ts.NeoHookean}
CORNERS = np.array([[c & 1, c >> 1 & 1, c >> 2] for c in (0, 1, 3, 2, 4, 5, 7, 6)], float)


def hexes(points):
    return SolidMesh(points, np.arange(8), hexes=np.arange(8)[None])


def brick():
    return hexes(CORNERS * [0.3, 0.2, 0.25])


def skewed():
    return hexes(CORNERS * [0.3, 0.2, 0.25] + 0.03 * np.random.default_rng(3).normal(size=(8, 3)))


MESHES = {"brick": brick, "hex8": skewed}


def elastic_of(mesh, law, **more):
    model = LAWS[law](young=1e5, poisson=0.35, density=1000.0, **more)
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add_body(mesh, model)
    (part,) = parts_of(scene.bodies)
    return Elastic(part)


CASES = [("brick", law) for law in LAWS] + [("hex8", "viscoelastic")]


@pytest.fixture(params=CASES, ids="-".join, scope="module")
def case(request):
    mesh, law = request.param
    elastic = elastic_of(MESHES[mesh](), law, phi=20.0, eta=30.0)
    rng = np.random.default_rng(7)
    u, w = 0.04 * rng.normal(size=(2, elastic.nodes, 3))
    return law, elastic, u, w


def turn(axis, angle):
    k = np.asarray(axis) / np.linalg.norm(axis)
    K = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def test_force_is_minus_the_gradient_of_the_energy(case):
    _, elastic, u, w = case
    h = 1e-5
    slope = (elastic.energy(u + h * w) - elastic.energy(u - h * w)) / (2 * h)
    assert -(elastic.force(u) * w).sum() == pytest.approx(slope, rel=1e-7)


def test_product_is_the_slope_of_the_force(case):
    _, elastic, u, w = case
    h = 1e-6
    slope = -(elastic.force(u + h * w) - elastic.force(u - h * w)) / (2 * h)
    product = elastic.stiffness_times(w, u)
    assert np.abs(product - slope).max() < 1e-7 * np.abs(product).max()
    matrix = elastic.stiffness(u)
    assert np.abs(matrix @ w.ravel() - product.ravel()).max() < 1e-12 * np.abs(product).max()
    assert np.abs(matrix - matrix.T).max() < 1e-12 * np.abs(matrix).max()


def test_rigid_motion_costs_nothing(case):
    law, elastic, u, _ = case
    scale = np.abs(elastic.force(u)).max()
    if law == "linear":
        x = elastic.rest
        still = np.cross([0.1, 0.2, -0.3], x) + np.array([1.0, 2.0, 3.0])
    else:
        still = elastic.rest @ (turn([1, 2, 3], 1.1) - np.eye(3)).T + np.array([1.0, 2.0, 3.0])
    assert np.abs(elastic.force(still)).max() < 1e-12 * scale * 10
    assert abs(elastic.energy(still)) < 1e-12 * elastic.energy(u)


def test_forces_add_up_to_nothing(case):
    law, elastic, u, w = case
    x = elastic.rest + (0.0 if law == "linear" else u)
    for f in (elastic.force(u), elastic.viscosity_times(w, u)):
        assert np.abs(f.sum(axis=0)).max() < 1e-12 * np.abs(f).max()
        assert np.abs(np.cross(x, f).sum(axis=0)).max() < 1e-12 * np.abs(f).max()


def test_viscosity_takes_energy_from_every_motion_but_rigid_ones(case):
    _, elastic, u, _ = case
    C = elastic.viscosity(u)
    assert np.abs(C - C.T).max() < 1e-12 * np.abs(C).max()
    values = np.linalg.eigvalsh(C.toarray())
    assert (np.abs(values[:6]) < 1e-10 * values[-1]).all()
    assert values[6] > 1e-5 * values[-1]


def test_only_rigid_motions_have_no_stiffness(case):
    _, elastic, u, _ = case
    values = np.linalg.eigvalsh(elastic.stiffness(np.zeros_like(u)).toarray())
    assert (np.abs(values[:6]) < 1e-10 * values[-1]).all()
    assert values[6] > 1e-4 * values[-1]
