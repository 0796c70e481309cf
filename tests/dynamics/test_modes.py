"""Natural frequencies against the reference values of the lectures' cases, each on its own mesh."""

import numpy as np
import pytest
from scipy.linalg import eigh

import tisoft as ts
from tisoft import where
from tisoft.equilibrium.modes import natural_modes

CLAMP = where.plane((0, 0, 0), (1, 0, 0))
STEEL_LIKE = {"young": 1e6, "poisson": 0.3, "density": 1000.0}


def bar(split, n, model=None, *, clamped=True):
    mesh = ts.box((1, 0.2, 0.2), (10 * n, 2 * n, 2 * n), split=split)
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(mesh, model or ts.ViscoElastic(**STEEL_LIKE))
    if clamped:
        body.pin(CLAMP)
    return scene


def masses(mesh, density):
    """Consistent mass of a tet mesh, dense, by its own plain loop."""
    out = np.zeros((len(mesh.points), len(mesh.points)))
    for tet in mesh.tets:
        a, b, c, d = mesh.points[tet]
        volume = np.dot(np.cross(b - a, c - a), d - a) / 6
        out[np.ix_(tet, tet)] += density * volume / 20 * (np.ones((4, 4)) + np.eye(4))
    return out


BENDING = [  # REFERENCES A3
    ("six", 1, "lumped", [1.2826311466, 1.5008717437, 5.6130222810, 6.5505060705]),
    ("six", 1, "consistent", [1.2891622890, 1.5134011909, 6.6914862835, 6.9352133405]),
    ("six", 2, "lumped", [1.0853448513, 1.1591490336, 4.9803985724]),
    ("five", 1, "lumped", [1.2118979928, 1.2118979928, 5.2898747879, 6.2297498475, 6.2297498475]),
    ("five", 1, "consistent", [1.2206809888, 1.2206809888, 6.4818072105, 6.4818072105]),
    ("five", 2, "lumped", [1.0605383564, 1.0605383564, 4.8616931433, 5.6577022153, 5.6577022153]),
    ("five", 2, "consistent", [1.0624751562, 1.0624751562, 5.1591719812]),
]  # fmt: skip


@pytest.mark.parametrize(("split", "n", "mass", "expected"), BENDING)
def test_cantilever_rings_as_tabulated(split, n, mass, expected):
    found = natural_modes(bar(split, n), len(expected), mass=mass)
    assert found.frequencies == pytest.approx(expected, rel=1e-8)


AXIAL = [  # REFERENCES A2, 20 x 2 x 2 cells
    ("five", "lumped", [7.903154, 23.648507, 39.211015]),
    ("five", "consistent", [7.907219]),
    ("six", "lumped", [7.903604]),
    ("six", "consistent", [7.907665]),
]


@pytest.mark.parametrize(("split", "mass", "expected"), AXIAL)
@pytest.mark.parametrize("kind", [ts.Linear, ts.MassTensor, ts.NeoHookean])
def test_axial_bar_rings_as_tabulated(split, mass, expected, kind):
    mesh = ts.box((1, 0.1, 0.1), (20, 2, 2), split=split)
    scene = ts.Scene()
    body = scene.add_body(mesh, kind(1e6, 0.0, 1000.0))
    body.pin(CLAMP)
    body.pin(where.everything(), "yz")
    found = natural_modes(scene, len(expected), mass=mass)
    assert found.frequencies == pytest.approx(expected, abs=1e-6)


def chain(nodes=10, stiffness=100.0, mass=0.01):
    points = np.zeros((nodes + 1, 3))
    points[:, 0] = np.arange(nodes + 1)
    scene = ts.Scene(gravity=(0, 0, 0))
    springs = [[i, i + 1] for i in range(nodes)]
    body = scene.add_body(
        ts.net(points, springs), ts.MassSpring(stiffness=stiffness, node_mass=mass)
    )
    body.pin(where.nodes([0]))
    body.pin(where.everything(), "yz")
    return scene


def test_chain_of_springs_rings_as_its_closed_form():
    """REFERENCES S3: ω = 2 √(k/m) sin((2n − 1) π/(2 (2N + 1)))."""
    found = natural_modes(chain(), 20).frequencies
    n = np.arange(1, 11)
    assert found == pytest.approx(2 * 100 * np.sin((2 * n - 1) * np.pi / 42) / 2 / np.pi, rel=1e-10)
    assert found[[0, 1, 2, 9]] == pytest.approx([2.3787328, 7.0830613, 11.6291660, 31.4754628])


def test_heavy_links_ring_on_a_long_chain_too():
    """400 links take the sparse solver; the closed form is the same."""
    found = natural_modes(chain(400), 5).frequencies
    n = np.arange(1, 6)
    assert found == pytest.approx(
        2 * 100 * np.sin((2 * n - 1) * np.pi / 1602) / 2 / np.pi, rel=1e-9
    )


@pytest.mark.parametrize("mass", ["lumped", "consistent"])
def test_free_body_has_six_rigid_motions_of_zero(mass):
    found = natural_modes(bar("five", 2, clamped=False), 9, mass=mass)
    assert (found.frequencies[:6] == 0).all()
    assert found.frequencies[6] > 4.0
    assert found.frequencies[6] == pytest.approx(found.frequencies[7], rel=1e-8)


def test_shapes_are_orthonormal_in_the_mass_and_vanish_at_pins():
    scene = bar("five", 1)
    mesh = scene.bodies[0].mesh
    for mass in ("lumped", "consistent"):
        found = natural_modes(scene, 6, mass=mass)
        weight = masses(mesh, 1000.0)
        if mass == "lumped":
            weight = np.diag(weight.sum(axis=1))
        products = np.einsum("kni,nm,lmi->kl", found.shapes, weight, found.shapes)
        assert np.abs(products - np.eye(6)).max() < 1e-9
        assert (found.shapes[:, mesh.points[:, 0] == 0] == 0).all()
        assert np.linalg.norm(found.shape(0), axis=1).max() == pytest.approx(1.0)


def test_sparse_and_dense_solvers_agree():
    """A cube of 27 nodes, all its modes by LAPACK from columns of the force's differences."""
    mesh = ts.box((1, 1, 1), (2, 2, 2))
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add_body(mesh, ts.ViscoElastic(1e4, 0.25, 500.0))
    simulation = ts.Simulation(scene, precision="f64")
    size = 3 * len(mesh.points)
    stiffness = np.zeros((size, size))
    h = 1e-6
    for k in range(size):
        way = np.zeros(size)
        way[k] = h
        pair = []
        for sign in (1, -1):
            simulation.set_state(mesh.points + sign * way.reshape(-1, 3), 0 * mesh.points)
            pair.append(simulation.forces().ravel())
        stiffness[:, k] = (pair[1] - pair[0]) / (2 * h)
    weight = np.kron(np.diag(masses(mesh, 500.0).sum(axis=1)), np.eye(3))
    squares = eigh(0.5 * (stiffness + stiffness.T), weight)[0]
    found = natural_modes(scene, 20).frequencies
    assert found[6:] == pytest.approx(np.sqrt(squares[6:20]) / 2 / np.pi, rel=1e-6)


def test_flat_cloth_has_motions_without_energy():
    scene = ts.Scene()
    scene.add_body(ts.cloth((1, 1), (10, 10)), ts.MassSpring(stiffness=100.0, node_mass=0.01))
    assert (natural_modes(scene, 8).frequencies == 0).all()


def test_pendulum_about_its_equilibrium():
    """A stiff spring of length 1 hanging: √(g/L)/2π twice, and √(k/m)/2π along it."""
    scene = ts.Scene()
    body = scene.add_body(
        ts.net([[0, 0, 0], [0, -1, 0]], [[0, 1]]), ts.MassSpring(stiffness=1e4, node_mass=0.5)
    )
    body.pin(where.nodes([0]))
    length = 1 + 0.5 * 9.81 / 1e4
    found = natural_modes(scene, 3, about="equilibrium").frequencies
    swing = np.sqrt(9.81 / length) / 2 / np.pi
    assert found == pytest.approx([swing, swing, np.sqrt(1e4 / 0.5) / 2 / np.pi], rel=1e-9)


def test_modes_about_given_positions():
    scene = chain(1)
    rest = scene.bodies[0].mesh.points
    stretched = rest + np.array([[0, 0, 0], [0.5, 0, 0]])
    same = natural_modes(scene, 1).frequencies
    assert natural_modes(scene, 1, about=stretched).frequencies == pytest.approx(same)


def test_column_past_buckling_grows():
    """Negative frequencies tell an unstable state: −√(−ω²)/2π."""
    mesh = ts.box((1, 0.1, 0.1), (10, 2, 2))
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add_body(mesh, ts.ViscoElastic(1e6, 0.0, 1000.0)).pin(CLAMP)
    squeezed = mesh.points * (0.8, 1.0, 1.0)
    found = natural_modes(scene, 4, about=squeezed).frequencies
    assert found[0] < 0 and found[1] < 0
    assert (np.diff(found) >= 0).all()


def test_bodies_bring_their_modes_together():
    scene = bar("five", 1)
    one = natural_modes(scene, 4)
    scene.add_body(ts.box((1, 0.2, 0.2), (10, 2, 2)), ts.ViscoElastic(4e6, 0.3, 1000.0)).pin(CLAMP)
    both = natural_modes(scene, 4)
    assert both.frequencies[:2] == pytest.approx(one.frequencies[:2], rel=1e-10)
    assert both.frequencies[2:] == pytest.approx(2 * one.frequencies[:2], rel=1e-9)
    half = both.shapes.shape[1] // 2
    assert (both.shapes[:2, half:] == 0).all() and (both.shapes[2:, :half] == 0).all()


@pytest.mark.parametrize(
    "wrong",
    [{"n": 0}, {"n": 2.5}, {"mass": "heavy"}, {"about": "noon"}, {"about": np.zeros((2, 3))}],
)
def test_wrong_arguments_are_refused(wrong):
    with pytest.raises(ts.SceneError, match=next(iter(wrong))):
        natural_modes(bar("five", 1), **wrong)
