"""Static equilibrium against the reference values of the lectures' cases, each on its own mesh."""

import numpy as np
import pytest
from static_cases import CLAMP, bar, face_load, row, tip

import tisoft as ts
from tisoft import where
from tisoft.equilibrium.statics import equilibrium

SAGGING = [  # REFERENCES A4: split, n, u_x, u_y, u_z [m], strain energy [J]
    ("six", 1, -0.02089171, 0.02986441, -0.18847779, 15.2038423),
    ("six", 2, -0.04591567, 0.01828851, -0.28135233, 22.1975008),
    ("five", 1, -0.03372279, 0.0, -0.24285602, 19.2598482),
    ("five", 2, -0.05617358, 0.0, -0.31124985, 24.3941109),
]


@pytest.mark.parametrize(("split", "n", "x", "y", "z", "energy"), SAGGING)
def test_st_venant_cantilever_sags_under_its_weight(split, n, x, y, z, energy):
    scene = bar(split, n, ts.ViscoElastic(1e6, 0.3, 1000.0))
    found = equilibrium(scene)
    assert tip(scene, found) == pytest.approx([x, y, z], abs=1e-8)
    assert found.energy["elastic"] == pytest.approx(energy, rel=1e-8)
    assert found.residual < 1e-8 * 9.81 * 1000 * 0.04 / len(found.positions)
    assert found.reactions.sum(axis=0) == pytest.approx([0, 0, 9.81 * 40], abs=1e-6)
    assert found.load_factor == 1.0


@pytest.mark.parametrize(("split", "expected"), [("six", -0.19500025), ("five", -0.25273164)])
@pytest.mark.parametrize("kind", [ts.Linear, ts.MassTensor])
def test_linear_cantilever_sags_under_its_weight(split, expected, kind):
    scene = bar(split, 1, kind(1e6, 0.3, 1000.0))
    assert tip(scene, equilibrium(scene))[2] == pytest.approx(expected, abs=1e-8)


SMALL = [
    ("six", 1, -1.306241),
    ("six", 2, -2.015761),
    ("five", 1, -1.711630),
    ("five", 2, -2.257269),
]


@pytest.mark.parametrize(("split", "n", "expected"), SMALL)
def test_cantilever_bends_under_one_newton(split, n, expected):
    """REFERENCES A3: dead traction on the end face, u_z in mm."""
    scene = bar(split, n, ts.Linear(1e6, 0.3, 1000.0), gravity=(0, 0, 0))
    mesh = scene.bodies[0].mesh
    forces = face_load(mesh, mesh.points[:, 0] > 1 - 1e-9, (0, 0, -25.0))
    found = equilibrium(scene, external=forces)
    assert 1e3 * tip(scene, found)[2] == pytest.approx(expected, abs=1e-6)
    assert found.energy["external_work"] == pytest.approx(2 * found.energy["elastic"], rel=1e-9)


NETS = [
    ("six", 1, -1.7590443),
    ("six", 2, -2.2356156),
    ("five", 1, -1.7244377),
    ("five", 2, -2.0494639),
]


@pytest.mark.parametrize(("split", "n", "expected"), NETS)
def test_spring_cantilever_bends_under_little(split, n, expected):
    """REFERENCES A10: springs from Young's modulus, u_z in mm under 1 N (linear: small load)."""
    scene = bar(split, n, ts.MassSpring(young=1e6, density=1000.0), gravity=(0, 0, 0))
    mesh = scene.bodies[0].mesh
    forces = face_load(mesh, mesh.points[:, 0] > 1 - 1e-9, (0, 0, -25e-6))
    assert 1e9 * tip(scene, equilibrium(scene, external=forces))[2] == pytest.approx(
        expected, rel=1e-6
    )


TORQUES = [
    ("six", 1, 311.849337),
    ("six", 2, 187.131866),
    ("five", 1, 276.276107),
    ("five", 2, 178.069147),
]


def twisted(split, n, degrees):
    """Torque [N m] on the end of the bar that is turned about its axis."""
    scene = bar(split, n, ts.ViscoElastic(1e6, 0.3, 1000.0), gravity=(0, 0, 0), duration=1.0)
    turn = ts.Turn((0, 0.1, 0.1), (1, 0, 0), np.radians(degrees))
    scene.bodies[0].pin(where.plane((1, 0, 0), (-1, 0, 0)), turn=turn)
    found = equilibrium(scene)
    end = scene.bodies[0].mesh.points[:, 0] > 1 - 1e-9
    arms = found.positions[end] - (0, 0.1, 0.1)
    assert found.residual < 1e-8 * np.linalg.norm(found.reactions, axis=1).max()
    return np.cross(arms, found.reactions[end]).sum(axis=0)[0]


@pytest.mark.parametrize(("split", "n", "torque"), TORQUES)
def test_bar_twisted_by_a_quarter_turn(split, n, torque):
    """REFERENCES A5."""
    assert twisted(split, n, 90.0) == pytest.approx(torque, abs=1e-6)


@pytest.mark.parametrize(("split", "expected"), [("six", 202.083252), ("five", 179.487179)])
def test_bar_twisted_a_little(split, expected):
    angle = 1e-4
    assert twisted(split, 1, angle) / np.radians(angle) == pytest.approx(expected, rel=1e-8)


COOK = [  # REFERENCES A6: split, Poisson, n, u_y at (48, 52)
    ("six", 0.3, 8, 15.844716),
    ("six", 0.49, 16, 10.869384),
    ("five", 0.3, 16, 21.268600),
    ("five", 0.49, 8, 14.826716),
    ("five", 0.499, 16, 16.186003),
]


@pytest.mark.parametrize(("split", "poisson", "n", "expected"), COOK)
def test_cooks_membrane_locks_as_tabulated(split, poisson, n, expected):
    unit = ts.box((1, 1, 1), (n, n, 1), split=split)
    s, t, z = unit.points.T
    points = np.stack([48 * s, 44 * s + (44 - 28 * s) * t, 48 / n * z], axis=1)
    mesh = ts.tet_mesh(points, unit.tets)
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(mesh, ts.Linear(1.0, poisson, 1.0))
    body.pin(CLAMP)
    body.pin(where.everything(), "z")
    forces = face_load(mesh, mesh.points[:, 0] > 48 - 1e-9, (0, 1 / 16, 0))
    found = equilibrium(scene, external=forces)
    assert found.positions[row(mesh, (48, 52, 0)), 1] - 52 == pytest.approx(expected, abs=1e-6)


# -- closed forms ---------------------------------------------------------------------------------


def test_patch_of_irregular_tets_keeps_a_uniform_strain():
    """REFERENCES A1.1: boundary moved by u = H X, the inside follows; linear and not."""
    gradient = np.array([[0.01, 0.003, -0.002], [0.004, -0.006, 0.005], [-0.001, 0.002, 0.008]])
    regular = ts.box((1, 1, 1), (3, 3, 3))
    inside = ((regular.points > 1e-9) & (regular.points < 1 - 1e-9)).all(axis=1)
    points = regular.points + 0.06 * inside[:, None] * np.random.default_rng(1).uniform(
        -1, 1, regular.points.shape
    )
    mesh = ts.tet_mesh(points, regular.tets)
    for kind in (ts.Linear, ts.MassTensor, ts.ViscoElastic, ts.NeoHookean):
        scene = ts.Scene(gravity=(0, 0, 0), duration=1.0)
        body = scene.add_body(mesh, kind(1e5, 0.3, 1000.0))
        for node in np.flatnonzero(~inside):
            way = tuple(gradient @ points[node])
            body.pin(where.nodes([int(node)]), path=[(0, 0, 0, 0), (1, *way)])
        found = equilibrium(scene)
        assert np.abs(found.positions - points - points @ gradient.T).max() < 1e-11, kind


def pulled(load, model=None, split="five"):
    """Unit cube with rollers on x, y, z = 0 under a dead pull [Pa] on x = 1: axial stretch."""
    mesh = ts.box((1, 1, 1), (1, 1, 1), split=split)
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(mesh, model or ts.ViscoElastic(1e5, 0.3, 1000.0))
    for k, axis in enumerate("xyz"):
        body.pin(where.plane((0, 0, 0), np.eye(3)[k]), axis)
    forces = face_load(mesh, mesh.points[:, 0] > 1 - 1e-9, (load, 0, 0))
    return equilibrium(scene, external=forces).positions.max(axis=0)


STRETCHES = [
    (-0.19, 0.6297529347),
    (-0.15, 0.7864825412),
    (-0.05, 0.9456492739),
    (0.05, 1.0466805318),
    (0.2, 1.1597048528),
    (0.5, 1.3247179572),
]


@pytest.mark.parametrize(("load", "stretch"), STRETCHES)
def test_st_venant_stretches_as_its_curve_says(load, stretch):
    """REFERENCES A1.2: P = E l (l² − 1)/2, lateral stretch √(1 − ν (l² − 1))."""
    sizes = pulled(load * 1e5)
    assert sizes[0] == pytest.approx(stretch, abs=1e-9)
    assert sizes[1] == pytest.approx(np.sqrt(1 - 0.3 * (stretch**2 - 1)), abs=1e-9)


@pytest.mark.parametrize("beyond", [1.001, 1.05, 3.0, 20.0])
def test_st_venant_gives_in_past_its_limit_load(beyond):
    """The softening at l = 1/√3: no equilibrium beyond P = −E/(3√3)."""
    with pytest.raises(ts.NoEquilibrium, match="load factor") as caught:
        pulled(-beyond * 1e5 / (3 * np.sqrt(3)))
    assert beyond * caught.value.load_factor == pytest.approx(1.0, rel=2e-3)
    assert beyond * caught.value.load_factor <= 1.0


def test_neo_hookean_cube_follows_its_own_curve():
    """The same pull, with the stresses of the energy by differences of a scalar function."""
    young, poisson, load = 1e5, 0.3, -4e4
    lam = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    mu = young / (2 * (1 + poisson))
    m, c = 4 * mu / 3, lam + 5 * mu / 6
    alpha = 1 + 0.75 * m / c

    def energy(x, y):
        trace = x * x + 2 * y * y
        return 0.5 * (m * trace + c * (x * y * y - alpha) ** 2 - m * np.log(trace + 1))

    x, y, _ = pulled(load, ts.NeoHookean(young, poisson, 1000.0))
    h = 1e-6
    assert (energy(x + h, y) - energy(x - h, y)) / (2 * h) == pytest.approx(load, rel=1e-6)
    assert (energy(x, y + h) - energy(x, y - h)) / (2 * h) == pytest.approx(0, abs=1e-4 * -load)
