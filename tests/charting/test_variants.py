"""Variants of a scene, and what their errors are off by."""

import meshio
import numpy as np
import pytest
from sheets import sheet

import tisoft as ts
from tisoft.changes import scene_with
from tisoft.charting.costs import Kind, predicted
from tisoft.charting.estimate import Error, Ruler
from tisoft.charting.judged import Judged
from tisoft.charting.records import size_of
from tisoft.charting.rulers import pairs_of
from tisoft.charting.variants import Catalogue
from tisoft.scene_file import load_scene

FILE = """
[[body]]
name = "body"
young = 1.0e6
poisson = 0.3
density = 1000.0
[body.mesh]
file = "body.vtu"
refine = 1
[[body.region]]
tag = 2
poisson = 0.48
"""
BOX = """
[[body]]
young = 1.0e6
poisson = 0.3
density = 1000.0
[body.mesh]
box = { size = [0.8, %g, 0.15], cells = [10, 1, 2] }
"""

SHAPE = """
[[body]]
young = 1.0e6
poisson = 0.3
density = 1000.0
[body.mesh]
%s
"""
BAR = "box = { size = [0.3, 0.1, 0.1], cells = [3, 1, 1] }"
HEXES = """
box = { size = [0.3, 0.1, 0.1], cells = [3, 1, 1], split = "hex" }
element = "hex8"
"""
SHAPES = {
    "box": BAR,
    "box of quadratic tets": f'{BAR}\nelement = "tet10"',
    "box of hexahedra": HEXES,
    "cylinder": "cylinder = { radius = 0.1, height = 0.4, resolution = 3 }",
    "ball of hexahedra": 'ball = { radius = 0.1, resolution = 2, split = "hex" }',
}


def catalogue(path, text):
    path.write_text(text)
    return Catalogue(path, load_scene(path), ())


@pytest.fixture
def of_file(tmp_path):
    mesh = ts.box((0.2, 0.1, 0.1), (2, 1, 1))
    regions = {"MaterialIds": [np.where(np.arange(len(mesh.tets)) < 3, 2, 1)]}
    made = meshio.Mesh(mesh.points, [("tetra", mesh.tets)], cell_data=regions)
    made.write(tmp_path / "body.vtu")
    return catalogue(tmp_path / "scene.toml", FILE)


def test_tets_of_a_file_are_cut_once_more_once_less_and_twice_more(of_file):
    """Beyond what the scene cuts them itself, and no coarser than the file has them."""
    cuts = {v.name: v.settings for v in of_file.meshes() if "tet4" in v.name}
    assert cuts == {
        f"tet4, {factor:g} x as fine": (f"body.0.mesh.refine={times}",)
        for factor, times in ((0.5, 0), (2.0, 2), (4.0, 3))
    }


def test_a_region_that_is_nearly_incompressible_counts(of_file):
    assert of_file.poisson == 0.48


@pytest.mark.parametrize("shape", SHAPES)
def test_shapes_are_had_of_linear_and_quadratic_tets_and_hexahedra(tmp_path, shape):
    """Whichever of them the scene has, and whether a split or the key `element` says so."""
    path = tmp_path / "scene.toml"
    found = catalogue(path, SHAPE % SHAPES[shape])
    has = found.elements()[0]
    for element in {"tet4", "tet10", "hex8"} - {has}:
        variant = found.mesh(element, 1.0)
        assert list(scene_with(str(path), variant.settings).bodies[0].mesh.cells) == [element]


def test_the_ruler_is_of_quadratic_tets_in_every_body(tmp_path):
    """Of which one has them already."""
    path = tmp_path / "scene.toml"
    two = SHAPE % SHAPES["box of quadratic tets"] + SHAPE % SHAPES["cylinder"]
    pair = catalogue(path, two).tets(1.0)
    had = [[list(b.mesh.cells) for b in scene_with(str(path), v.settings).bodies] for v in pair]
    assert had == [[["tet4"], ["tet4"]], [["tet10"], ["tet10"]]]


def test_what_judges_itself_is_judged_by_ever_finer_meshes_of_itself(tmp_path):
    path = tmp_path / "net.toml"
    path.write_text(sheet(4))
    pairs = list(pairs_of(Catalogue(str(path), load_scene(path), ()), twin=False))
    names = [(pair.worse.name[8:11], pair.better.name[8:11]) for pair in pairs]
    assert names == [("", "1.5"), ("", "2 x"), ("1.5", "3 x"), ("2 x", "4 x")]
    assert {pair.ratio for pair in pairs} == {1.5, 2.0}


def test_a_ruler_is_of_meshes_of_which_every_side_gets_finer(tmp_path):
    """Beside a round body, which linear and quadratic tets on one mesh do not judge."""
    two = SHAPE % SHAPES["box"] + SHAPE % SHAPES["cylinder"]
    pairs = list(pairs_of(catalogue(tmp_path / "scene.toml", two), twin=False))
    assert min(pair.ratio for pair in pairs) == 1.5


@pytest.mark.parametrize(("turn", "warped"), [(0.0, False), (30.0, True)])
def test_hexahedra_that_are_no_bricks_are_known_to_take_longer(turn, warped):
    mesh = ts.box((0.3, 0.1, 0.1), (3, 1, 1), split="hex").transformed(rotate=(0.0, turn, 0.0))
    scene = ts.Scene(bodies=[ts.Body("b", mesh, ts.ViscoElastic(1e6, 0.3, 1e3))])
    size = size_of(scene, [])
    names = ("hex8", "viscoelastic", "f32", "symplectic-euler")
    costs = [predicted(Kind(*names, 1000, 6e3, 60.0, warped=w), []) for w in (False, warped)]
    assert size["warped"] is warped
    assert (costs[1] > 4.0 * costs[0]) is warped


def test_a_mesh_is_a_variant_once_whatever_factors_come_to_it(tmp_path):
    """Three cells are two, .5 and .75 times as fine."""
    made = catalogue(tmp_path / "scene.toml", SHAPE % SHAPES["cylinder"])
    coarser = [v.settings for v in made.meshes() if any("=2" in s for s in v.settings)]
    assert len(coarser) == len(set(coarser)) == 3


@pytest.mark.parametrize(("side", "ratio"), [(0.1, 1.0), (0.05, 2.0)])
def test_meshes_are_not_compared_whose_longest_cells_stay_as_they_are(tmp_path, side, ratio):
    """Along a side with one cell, where that is not the shortest of its edges."""
    assert catalogue(tmp_path / "scene.toml", BOX % side).ratio(0.5, 1.0) == ratio


def test_an_error_is_off_by_what_its_ruler_is_off_by():
    """In whatever direction, to first order; and as much along the answer."""
    rng = np.random.default_rng(3)
    own, truth, bar = 2.5 * rng.normal(size=3), rng.normal(size=3), 1e-4
    told = Ruler(truth, bar).error(own)

    def off(way):
        moved = truth + bar * np.linalg.norm(truth) * way / np.linalg.norm(way)
        return abs(Ruler(moved, bar).error(own).value - told.value)

    directions = [truth, own - truth, *rng.normal(size=(2000, 3))]
    assert 0.98 < max(map(off, directions)) / told.bar < 1.001


def test_an_error_that_another_ones_bar_hides_counts():
    errors = {"sag": Error(0.044, 0.01), "frequency": Error(0.017, 0.04)}
    one = Judged("tet4", (), "viscoelastic", "tet4", 8, 9, 1e-3, 1e-3, 1.0, errors)
    assert one.worst == errors["frequency"]
    assert (one.likely, one.least) == (0.044, pytest.approx(0.034))
