"""A skin moves as the tets that carry it."""

import numpy as np
import pytest

import tisoft as ts
from tisoft.geometry.solid import quadratic, solid_mesh

PYRAMID = np.array([[0.2, 0.2, 0.2], [0.8, 0.2, 0.2], [0.2, 0.8, 0.2], [0.3, 0.3, 0.7]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


@pytest.fixture
def cube():
    return ts.box(size=(1, 1, 1), cells=(3, 3, 3))


def test_a_skin_follows_every_linear_map_exactly(cube):
    skin = ts.skin(cube, PYRAMID, FACES)
    assert skin.weights.sum(axis=1) == pytest.approx(1.0)
    assert skin.weights.min() > -1e-9
    gradient, shift = np.random.default_rng(1).normal(size=(3, 3)), [1.0, -2.0, 3.0]
    carried = skin.carried(cube.points @ gradient.T + shift)
    assert carried == pytest.approx(PYRAMID @ gradient.T + shift)


def test_every_point_is_carried_by_the_tet_that_holds_it(cube):
    points = np.random.default_rng(2).uniform(0.0, 1.0, (500, 3))
    skin = ts.skin(cube, points, [[0, 1, 2]])
    assert skin.weights.min() > -1e-9
    assert skin.carried(cube.points) == pytest.approx(points)


@pytest.mark.parametrize(
    "make, field",
    [
        (lambda: ts.box((1, 1, 1), (3, 2, 2), split="hex"), lambda x, y, z: 1 + x * y * z - y * z),
        (lambda: quadratic(ts.box((1, 1, 1), (2, 2, 2))), lambda x, y, z: x * x + y * z - 2 * z),
    ],
)
def test_a_skin_bends_as_the_cells_do(make, field):
    """Fields that hexahedra and quadratic tets hold exactly are carried exactly."""
    mesh = make()
    points = np.random.default_rng(2).uniform(0.0, 1.0, (300, 3))
    skin = ts.skin(mesh, points, [[0, 1, 2]])
    values = field(*mesh.points.T)
    assert skin.carried(values[:, None])[:, 0] == pytest.approx(field(*points.T), abs=1e-12)
    bent = solid_mesh(
        mesh.points + 0.05 * np.sin(3 * mesh.points[:, ::-1]),
        quadratic_tets=mesh.quadratic_tets,
        hexes=mesh.hexes,
    )
    inside = 0.1 + 0.8 * points
    assert ts.skin(bent, inside, [[0, 1, 2]]).carried(bent.points) == pytest.approx(inside)


def test_a_point_a_little_outside_is_carried_along(cube):
    skin = ts.skin(cube, PYRAMID - [0.21, 0, 0], FACES)
    assert skin.carried(cube.points) == pytest.approx(PYRAMID - [0.21, 0, 0])


def test_a_skin_elsewhere_is_refused_with_its_place(cube):
    with pytest.raises(ts.MeshError, match=r"point 1 of the skin, at \(2.8, 0.2, 0.2\)"):
        ts.skin(cube, PYRAMID + np.array([2, 0, 0]), FACES)


def test_a_surface_file_becomes_a_skin(cube, tmp_path):
    lines = [f"v {x} {y} {z}" for x, y, z in 1000 * PYRAMID] + ["f 1 3 2", "f 1 2 3 4"]
    (tmp_path / "skin.obj").write_text("\n".join(lines))
    skin = ts.read_skin(tmp_path / "skin.obj", cube, scale=0.001)
    assert len(skin.triangles) == 3  # a quadrilateral is cut into two
    assert np.sort(skin.carried(cube.points), axis=0) == pytest.approx(np.sort(PYRAMID, axis=0))


@pytest.mark.parametrize(
    "name, text, told",
    [
        ("skin.vtu", "", "give one of .obj"),
        ("missing.obj", None, "no such file"),
        ("empty.obj", "", "needs at least one triangle"),
        ("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "needs at least one triangle"),
    ],
)
def test_files_that_hold_no_skin_are_told_by_name(cube, tmp_path, name, text, told):
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(ts.MeshError, match=told) as caught:
        ts.read_skin(tmp_path / name, cube)
    assert name in str(caught.value)


SCENE = """
[[body]]
young = 1e5
poisson = 0.3
density = 1000
[body.mesh]
box = {{ size = [1, 1, 1], cells = [3, 3, 3] }}
translate = [0, 5, 0]
{skin}
"""


def test_the_skin_of_a_scene_is_put_where_its_body_is(tmp_path):
    lines = [f"v {x} {y} {z}" for x, y, z in PYRAMID] + ["f 1 3 2", "f 1 2 4"]
    (tmp_path / "skin.obj").write_text("\n".join(lines))
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.format(skin='[body.skin]\nfile = "skin.obj"'))
    (body,) = ts.load_scene(scene).bodies
    carried = body.skin.carried(body.mesh.points)
    assert np.sort(carried, axis=0) == pytest.approx(np.sort(PYRAMID + np.array([0, 5, 0]), axis=0))


@pytest.mark.parametrize(
    "skin, told",
    [
        ("[body.skin]", r"body\[0\].skin.file is missing"),
        ('[body.skin]\nfile = "none.obj"', r"body\[0\].skin.file = \"none.obj\" is not found"),
        ('[body.skin]\nfile = "skin.obj"\nsize = 2', r"body\[0\].skin.size"),
        ('[body.skin]\nfile = "far.obj"', "lies away from the body's cells"),
    ],
)
def test_a_wrong_skin_is_told_in_a_sentence(tmp_path, skin, told):
    (tmp_path / "skin.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "far.obj").write_text("v 9 9 9\nv 8 9 9\nv 8 8 9\nf 1 2 3\n")
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.format(skin=skin))
    with pytest.raises(ts.SceneError, match=told):
        ts.load_scene(scene)


def test_springs_carry_no_skin(tmp_path):
    net = ts.cloth((1, 1), (2, 2))
    with pytest.raises(ts.MeshError, match="has none"):
        ts.skin(net, PYRAMID, FACES)


def test_a_checkpoint_keeps_the_skin(cube, tmp_path):
    scene = ts.Scene()
    body = scene.add_body(cube, ts.ViscoElastic(1e5, 0.3, 1000.0))
    body.skin = ts.skin(cube, PYRAMID, FACES)
    ts.Simulation(scene).save(tmp_path / "a.checkpoint")
    (again,) = ts.Simulation.load(tmp_path / "a.checkpoint").scene.bodies
    assert (again.skin.weights == body.skin.weights).all()
