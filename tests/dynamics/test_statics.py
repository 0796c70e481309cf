"""Static equilibrium against the reference values of the lectures' cases, each on its own mesh."""

import numpy as np
import pytest

import tisoft as ts
from tisoft import where
from tisoft.dynamics import linear_solve
from tisoft.dynamics.statics import equilibrium

CLAMP = where.plane((0, 0, 0), (1, 0, 0))


def bar(split, n, model, **scene):
    """Cantilever 1 x .2 x .2 with 10n x 2n x 2n cells, clamped at x = 0."""
    mesh = ts.box((1, 0.2, 0.2), (10 * n, 2 * n, 2 * n), split=split)
    scene = ts.Scene(**{"gravity": (0, 0, -9.81), **scene})
    scene.add_body(mesh, model).pin(CLAMP)
    return scene


def row(mesh, point):
    away = np.linalg.norm(mesh.points - point, axis=1)
    assert away.min() < 1e-9
    return int(away.argmin())


def tip(scene, found):
    mesh = scene.bodies[0].mesh
    k = row(mesh, (1, 0.1, 0.1))
    return found.positions[k] - mesh.points[k]


def face_load(mesh, on_face, traction):
    """Consistent nodal forces of a dead traction [Pa] on the boundary triangles in on_face."""
    forces = np.zeros_like(mesh.points)
    for triangle in mesh.surface[on_face[mesh.surface].all(axis=1)]:
        a, b, c = mesh.points[triangle]
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a))
        forces[triangle] += area / 3.0 * np.asarray(traction)
    return forces


# -- same mesh, same number -----------------------------------------------------------------------

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


# -- loads that scenes hold -----------------------------------------------------------------------


@pytest.mark.parametrize("pressure", [1e3, 3e4, -1e5])
def test_cube_under_pressure_from_all_sides(pressure):
    """Stretch l of a St.VK cube: 3K l (l² − 1)/2 = −p l² on the face as it is, 3K = E/(1 − 2ν)."""
    mesh = ts.box((1, 1, 1), (2, 2, 2))
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(mesh, ts.ViscoElastic(1e5, 0.3, 1000.0))
    for k, axis in enumerate("xyz"):
        normal = np.eye(3)[k]
        body.pin(where.plane((0, 0, 0), normal), axis)
        body.load(where.plane(normal, -normal), pressure=pressure)
    stretch = np.roots([1.0, 2 * pressure * (1 - 0.6) / 1e5, -1.0]).max()
    assert np.abs(equilibrium(scene).positions - stretch * mesh.points).max() < 1e-10


def test_free_ball_under_pressure_stays_where_it_is():
    mesh = ts.ball(1.0, 3)
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add_body(mesh, ts.ViscoElastic(1e6, 0.3, 1000.0)).load(where.everything(), pressure=1e5)
    found = equilibrium(scene)
    stretch = np.roots([1.0, 2e5 * (1 - 0.6) / 1e6, -1.0]).max()
    assert np.abs(found.positions - stretch * mesh.points).max() < 1e-9
    assert found.warnings == []


def test_force_and_traction_of_a_scene_are_its_external_forces():
    end = where.plane((1, 0, 0), (-1, 0, 0))
    model = ts.ViscoElastic(1e6, 0.3, 1000.0)
    scene = bar("five", 1, model, gravity=(0, 0, 0))
    mesh = scene.bodies[0].mesh
    forces = face_load(mesh, mesh.points[:, 0] > 1 - 1e-9, (0, 0, -1000.0))
    expected = equilibrium(scene, external=forces)
    for load in ({"force": (0, 0, -40.0)}, {"traction": (0, 0, -1000.0)}):
        scene = bar("five", 1, model, gravity=(0, 0, 0))
        scene.bodies[0].load(end, **load)
        found = equilibrium(scene)
        assert np.abs(found.positions - expected.positions).max() < 1e-12
        assert found.energy["external_work"] == pytest.approx(expected.energy["external_work"])


def test_torque_on_a_face_is_borne_by_the_clamp():
    scene = bar("five", 1, ts.ViscoElastic(1e6, 0.3, 1000.0), gravity=(0, 0, 0))
    end = where.plane((1, 0, 0), (-1, 0, 0))
    scene.bodies[0].load(end, torque=ts.Torque((1, 0.1, 0.1), (1, 0, 0), 40.0))
    found = equilibrium(scene)
    moment = np.cross(found.positions, found.reactions).sum(axis=0)
    assert moment == pytest.approx([-40.0, 0, 0], abs=1e-8)
    assert found.reactions.sum(axis=0) == pytest.approx([0, 0, 0], abs=1e-8)


def test_loads_are_seen_at_the_end_of_the_scene():
    plain, late = (bar("five", 1, ts.Linear(1e6, 0.3, 1000.0), duration=4.0) for _ in range(2))
    end = where.plane((1, 0, 0), (-1, 0, 0))
    plain.bodies[0].load(end, force=(0, 0, -10.0))
    late.bodies[0].load(end, force=(0, 0, -40.0), table=[(0, 0), (8, 0.5)])
    late.bodies[0].load(end, force=(0, 0, -1e9), end=3.9)
    expected = equilibrium(plain).positions
    assert equilibrium(late).positions == pytest.approx(expected, abs=1e-12)


# -- springs --------------------------------------------------------------------------------------


def string(points, stiffness, mass, pins, *, length=None, **scene):
    """Points joined in a row."""
    springs = [[i, i + 1] for i in range(len(points) - 1)]
    rows = springs if length is None else [[i, j, stiffness, length] for i, j in springs]
    model = ts.MassSpring(stiffness=stiffness, node_mass=mass, springs=rows)
    if length is not None:
        model = ts.MassSpring(node_mass=mass, springs=rows)
    scene = ts.Scene(**scene)
    scene.add_body(ts.net(points, springs), model).pin(where.nodes(pins))
    return scene


def test_chain_hangs_longer_towards_its_top():
    """REFERENCES S3."""
    points = np.zeros((11, 3))
    points[:, 1] = -0.1 * np.arange(11)
    found = equilibrium(string(points, 100.0, 0.01, [0]))
    stretches = -np.diff(found.positions[:, 1]) - 0.1
    assert stretches == pytest.approx(0.00981 - 0.000981 * np.arange(10), abs=1e-12)
    assert stretches.sum() == pytest.approx(0.053955, abs=1e-12)
    assert found.reactions[0] == pytest.approx([0, 0.01 * 10 * 9.81 + 0.01 * 9.81, 0], abs=1e-9)


def test_flat_pair_of_springs_sinks_to_a_v():
    """REFERENCES S4: no stiffness at all against its load at rest."""
    found = equilibrium(string([[-1, 0, 0], [0, 0, 0], [1, 0, 0]], 200.0, 2.0, [0, 2]))
    assert found.positions[1] == pytest.approx([0, -0.4865936028, 0], abs=1e-10)


@pytest.mark.parametrize(
    ("links", "axial", "sag"),
    [(10, 1e5, 0.2668974), (20, 1e5, 0.2658244), (40, 1e5, 0.2655587), (20, 1e3, 0.2690408)],
)
@pytest.mark.parametrize("slack", [0.0, 0.3])
def test_slack_chain_hangs_in_a_catenary(links, axial, sag, slack):
    """REFERENCES S7, from a straight line of springs too long for it, and from a slack arc."""
    t = np.linspace(0, 1, links + 1)
    points = np.stack([0.8 * t, -slack * np.sin(np.pi * t), 0 * t], axis=1)
    scene = string(points, links * axial, 1 / links, [0, links], length=1 / links)
    assert equilibrium(scene).positions[:, 1].min() == pytest.approx(-sag, abs=5e-8)


def test_very_stiff_chain_hangs_in_the_polygon_of_its_links():
    """Links that do not stretch: REFERENCES S7's catenary from below, and no load on the way."""
    t = np.linspace(0, 1, 21)
    points = np.stack([0.8 * t, 0 * t, 0 * t], axis=1)
    found = equilibrium(string(points, 20 * 1e8, 1 / 20, [0, 20], length=1 / 20))
    links = np.linalg.norm(np.diff(found.positions, axis=0), axis=1)
    assert links == pytest.approx(np.full(20, 0.05), rel=1e-6)
    slopes = np.diff(found.positions[:, 1]) / np.diff(found.positions[:, 0])
    assert np.diff(slopes) == pytest.approx(np.full(19, np.diff(slopes)[0]), rel=1e-6)


LIMIT = 2 * 1000 * (np.hypot(1, 0.3) ** (2 / 3) - 1) ** 1.5


def truss(load):
    """Von Mises truss (REFERENCES S5): height of its top under a dead load [N]."""
    scene = string([[-1, 0, 0], [0, 0.3, 0], [1, 0, 0]], 1000.0, 1.0, [0, 2], gravity=(0, 0, 0))
    forces = np.zeros((3, 3))
    forces[1, 1] = -load
    return equilibrium(scene, external=forces).positions[1, 1]


def test_truss_bears_half_its_limit():
    assert LIMIT == pytest.approx(9.9499170, abs=1e-7)
    assert truss(0.5 * LIMIT) == pytest.approx(0.2641108, abs=1e-7)
    assert truss(0.9999 * LIMIT) == pytest.approx(0.1707116, abs=2e-3)


@pytest.mark.parametrize("beyond", [1.001, 1.5, 10.0, 100.0])
def test_truss_does_not_snap_through_unsaid(beyond):
    """Newton's method alone would answer with the state on the other side."""
    with pytest.raises(ts.NoEquilibrium) as caught:
        truss(beyond * LIMIT)
    assert beyond * caught.value.load_factor == pytest.approx(1.0, rel=2e-3)


@pytest.mark.parametrize("corners", [[(0, 0, 0), (1, 0, 0)], [(0, 0, 0), (1, 0, 0), (1, 0, 1)]])
def test_cloth_held_at_corners_hangs(corners):
    mesh = ts.cloth((1, 1), (8, 8))
    scene = ts.Scene()
    body = scene.add_body(mesh, ts.MassSpring(stiffness=500.0, density=200.0, thickness=0.001))
    for corner in corners:
        body.pin(where.nearest(corner))
    found = equilibrium(scene)
    assert found.residual < 1e-8 * 9.81 * 0.2 / 81
    assert found.positions[:, 1].min() < -0.4
    assert found.reactions[:, 1].sum() == pytest.approx(9.81 * 0.2, rel=1e-8)


# -- what the solver promises ---------------------------------------------------------------------


def test_turned_and_scaled_scene_gives_the_turned_and_scaled_answer():
    scene = bar("five", 1, ts.ViscoElastic(1e6, 0.3, 1000.0))
    plain = equilibrium(scene).positions
    # Lengths by 1000 with the density divided by it leaves the strains as they are.
    mesh = scene.bodies[0].mesh.transformed(scale=1000.0, rotate=(0, 0, 90))
    turned = ts.Scene(gravity=(0, 0, -9.81))
    body = turned.add_body(mesh, ts.ViscoElastic(1e6, 0.3, 1.0))
    body.pin(where.plane((0, 0, 0), (0, 1, 0)))
    x, y, z = equilibrium(turned).positions.T
    assert np.abs(np.stack([y, -x, z], axis=1) / 1000 - plain).max() < 1e-10


def test_bodies_balance_each_on_their_own():
    scene = bar("five", 1, ts.ViscoElastic(1e6, 0.3, 1000.0))
    alone = equilibrium(scene).positions
    mesh = ts.box((1, 0.2, 0.2), (3, 1, 1)).transformed(translate=(0, 5, 0))
    scene.add_body(mesh, ts.NeoHookean(1e4, 0.4, 300.0)).pin(CLAMP)
    both = equilibrium(scene)
    assert np.array_equal(both.positions[: len(alone)], alone)
    assert both.reactions.sum(axis=0)[2] == pytest.approx(9.81 * (40 + 12), rel=1e-9)


def test_a_body_that_nothing_holds_has_no_equilibrium():
    scene = ts.Scene()
    scene.add_body(ts.box((1, 1, 1), (1, 1, 1)), ts.ViscoElastic(1e5, 0.3, 1000.0), "jelly")
    with pytest.raises(ts.NoEquilibrium, match="no pin holds the piece of 'jelly'") as caught:
        equilibrium(scene)
    assert caught.value.load_factor == 0.0


def test_a_free_body_pulled_at_both_ends_stretches():
    mesh = ts.box((1, 0.2, 0.2), (10, 2, 2))
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add_body(mesh, ts.Linear(1e6, 0.0, 1000.0))
    x = mesh.points[:, 0]
    forces = face_load(mesh, x > 1 - 1e-9, (1e4, 0, 0)) - face_load(mesh, x < 1e-9, (1e4, 0, 0))
    found = equilibrium(scene, external=forces)
    length = found.positions[x > 1 - 1e-9, 0].mean() - found.positions[x < 1e-9, 0].mean()
    assert length == pytest.approx(1.01, abs=1e-10)


def test_a_beam_on_a_hinge_swings_down_to_hang():
    scene = ts.Scene()
    body = scene.add_body(ts.box((1, 0.2, 0.2), (5, 1, 1)), ts.ViscoElastic(1e6, 0.3, 1000.0))
    body.pin(where.box((0, 0, 0), (0, 0, 1)))
    found = equilibrium(scene)
    middle = found.positions.mean(axis=0)
    assert abs(middle[0]) < 0.02 and middle[1] < -0.45
    assert found.residual < 1e-7


def test_a_linear_beam_on_a_hinge_is_refused():
    scene = ts.Scene()
    body = scene.add_body(ts.box((1, 0.2, 0.2), (5, 1, 1)), ts.Linear(1e6, 0.3, 1000.0))
    body.pin(where.box((0, 0, 0), (0, 0, 1)))
    with pytest.raises(ts.NoEquilibrium, match="turn"):
        equilibrium(scene)


def test_obstacles_are_left_out_with_a_word():
    scene = bar("five", 1, ts.ViscoElastic(1e6, 0.3, 1000.0))
    scene.add_obstacle(ts.Plane(point=(0, 0, -0.1), normal=(0, 0, 1)))
    found = equilibrium(scene)
    assert "obstacles" in found.warnings[0]
    assert found.positions[:, 2].min() < -0.2


def test_a_straight_column_past_buckling_is_said_to_be_unstable():
    mesh = ts.box((1, 0.1, 0.1), (10, 2, 2))
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add_body(mesh, ts.ViscoElastic(1e6, 0.0, 1000.0)).pin(CLAMP)
    forces = face_load(mesh, mesh.points[:, 0] > 1 - 1e-9, (-1e4, 0, 0))  # 5 times Euler's load
    found = equilibrium(scene, external=forces)
    assert "unstable" in found.warnings[0]


def test_wrong_external_forces_are_refused():
    scene = bar("five", 1, ts.ViscoElastic(1e6, 0.3, 1000.0))
    with pytest.raises(ts.SceneError, match="shape"):
        equilibrium(scene, external=np.zeros((3, 3)))


def test_dynamics_run_to_rest_agree():
    """Heavily damped St. Venant-Kirchhoff cantilever in f64 comes to the same rest."""
    model = ts.ViscoElastic(1e5, 0.3, 1000.0, phi=300.0, eta=300.0, point_damping=15.0)
    mesh = ts.box((0.5, 0.2, 0.2), (5, 2, 2))
    scene = ts.Scene(gravity=(0, 0, -2.0), precision="f64")
    scene.add_body(mesh, model).pin(CLAMP)
    still = equilibrium(scene).positions
    simulation = ts.Simulation(scene, certify=False)
    for _ in simulation.frames(seconds=4.0):
        pass
    sag = np.abs(still - mesh.points).max()
    assert np.abs(simulation.positions() - still).max() < 1e-6 * sag


def test_bodies_too_large_to_factorise_find_the_same(monkeypatch):
    monkeypatch.setattr(linear_solve, "FACTOR_LIMIT", 0)
    scene = bar("five", 1, ts.ViscoElastic(1e6, 0.3, 1000.0))
    expected = [-0.03372279, 0.0, -0.24285602]
    assert tip(scene, equilibrium(scene)) == pytest.approx(expected, abs=1e-8)
    flat = string([[-1, 0, 0], [0, 0, 0], [1, 0, 0]], 200.0, 2.0, [0, 2])
    assert equilibrium(flat).positions[1, 1] == pytest.approx(-0.4865936028, abs=1e-9)


def arch_under(load, model):
    """Height of the middle of a shallow clamped arch of 24 x 2 x 2 cells under a dead load [N]."""
    unit = ts.box((1, 1, 1), (24, 2, 2))
    x, y, z = unit.points.T
    radius, angle = 1 + 0.04 * (z - 0.5), x - 0.5
    points = np.stack([radius * np.sin(angle), 0.1 * y, radius * np.cos(angle)], axis=1)
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_body(ts.tet_mesh(points, unit.tets), model)
    body.pin(where.nodes(np.flatnonzero(np.abs(angle) > 0.5 - 1e-9).tolist()))
    top = np.flatnonzero((np.abs(angle) < 1e-9) & (z > 1 - 1e-9))
    forces = np.zeros_like(points)
    forces[top, 2] = -load / len(top)
    return equilibrium(scene, external=forces).positions[top[1], 2]


@pytest.mark.parametrize("kind", [ts.ViscoElastic, ts.NeoHookean])
def test_arch_does_not_snap_through_unsaid(kind):
    """The last load found does not depend on how much was asked for, and is an equilibrium's."""
    model = kind(1e6, 0.3, 1000.0)
    limits = []
    for load in (40.0, 300.0):
        with pytest.raises(ts.NoEquilibrium) as caught:
            arch_under(load, model)
        limits.append(load * caught.value.load_factor)
    assert limits[0] == pytest.approx(limits[1], rel=2e-3)
    assert 0.9 < arch_under(0.99 * limits[0], model) < 1.02


@pytest.mark.parametrize(("size", "young"), [(1e-6, 1e6), (1e6, 1e6), (1.0, 1e-3), (1.0, 1e14)])
def test_nothing_is_absolute(size, young):
    """The same number of ρgL/E gives the same shape, whatever the units."""
    mesh = ts.box((size, 0.2 * size, 0.2 * size), (10, 2, 2))
    scene = ts.Scene(gravity=(0, 0, -9.81))
    scene.add_body(mesh, ts.ViscoElastic(young, 0.3, 1e-3 * young / size)).pin(CLAMP)
    k = row(mesh.transformed(scale=1 / size), (1, 0.1, 0.1))
    sag = (equilibrium(scene).positions - mesh.points)[k] / size
    assert sag == pytest.approx([-0.03372279, 0.0, -0.24285602], abs=1e-8)


@pytest.mark.slow
def test_fifteen_thousand_tets_settle_within_the_time():
    from time import perf_counter

    begun = perf_counter()
    scene = bar("six", 4, ts.ViscoElastic(1e6, 0.3, 1000.0))
    found = equilibrium(scene)
    assert perf_counter() - begun < 20.0
    assert tip(scene, found) == pytest.approx([-0.06169842, 0.00633303, -0.32567431], abs=1e-8)
    assert found.energy["elastic"] == pytest.approx(25.4930180, rel=1e-8)
