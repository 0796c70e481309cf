"""Nearest points of triangles, against a search among many points of them."""

import numpy as np
import pytest
import taichi as ti

import tisoft as ts
from tisoft.touch.closest import from_triangle, on_triangle

ARRAY = ti.types.ndarray()


@pytest.fixture(scope="module")
def both():
    """The distance by either function, of rows p, a, b, c."""
    ts.Simulation(ts.Scene(bodies=[ts.Body("net", ts.net([[0, 0, 0]], []), SPRING)]))

    @ti.kernel
    def found(points: ARRAY, out: ARRAY):
        for k in range(points.shape[0]):
            x = ti.Matrix.zero(ti.f64, 4, 3)
            for i in ti.static(range(4)):
                for d in ti.static(range(3)):
                    x[i, d] = points[k, i, d]
            p, a, b, c = x[0, :], x[1, :], x[2, :], x[3, :]
            w = on_triangle(p, a, b, c)
            out[k, 0] = (p - w[0] * a - w[1] * b - w[2] * c).norm()
            out[k, 1] = ti.sqrt(from_triangle(p, a, b, c))

    def asked(points):
        out = np.zeros((len(points), 2))
        found(np.ascontiguousarray(points, np.float64), out)
        return out

    return asked


SPRING = ts.MassSpring(stiffness=1.0, node_mass=1.0)
SHARES = np.array([(i, j, 60 - i - j) for i in range(61) for j in range(61 - i)]) / 60.0


def test_distances_are_those_of_the_nearest_of_many_points(both):
    x = np.random.default_rng(3).uniform(-1, 1, (400, 4, 3))
    near = np.linalg.norm(x[:, 0, None] - np.einsum("sc,kcd->ksd", SHARES, x[:, 1:]), axis=2).min(1)
    told = both(x)
    assert np.abs(told[:, 0] - told[:, 1]).max() < 1e-12
    assert (told[:, 0] <= near + 1e-12).all() and (near - told[:, 0] < 0.03).all()


def test_a_triangle_without_area_is_an_edge_or_a_point(both):
    p, a, b = np.array([0.3, 0.4, 0.0]), np.zeros(3), np.array([1.0, 0, 0])
    lines = [(p, a, b, b), (p, a, a, b), (p, a, b, 0.5 * b), (p, a, a, a)]
    assert both(np.array(lines))[:, 1] == pytest.approx([0.4, 0.4, 0.4, 0.5])
