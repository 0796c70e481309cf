"""What a picture of a scene shows, and how large: obstacles, springs, up; values behind colours."""

import numpy as np
import pytest
from PIL import Image

import tisoft as ts
from tisoft.cli import main
from tisoft.observers.quantities import node_values
from tisoft.observers.scenery import body_items
from tisoft.render.items import Capsules, Surface

SIZE = 240
FOV = 30.0

SCENE = """
gravity = {gravity}
duration = 0.001
frame_rate = 20

[[body]]
name = "block"
young = 1e5
poisson = 0.3
density = 1000.0

[body.mesh]
box = {{ size = {size}, cells = [1, 1, 1], split = "six" }}
translate = {place}

{obstacles}

[camera]
eye = [0, 0, {eye}]
target = [0, 0, 0]
fov = 30

[render]
size = [240, 240]
color = "body"
samples = 3
ground = false
"""


def picture(
    folder, obstacles="", *, size=(0.1, 0.1, 0.1), place=(50, 0, 0), gravity=(0, 0, 0), eye=10
):
    """Bytes of the scene's start; the body is far beside the view unless it is placed in it."""
    keys = {"size": list(size), "place": list(place), "gravity": list(gravity), "eye": eye}
    path = folder / "scene.toml"
    path.write_text(SCENE.format(obstacles=obstacles, **keys), encoding="utf-8")
    return rendered(path)


def rendered(path):
    out = path.with_suffix(".png")
    assert main(["render", str(path), "-o", str(out), "--quiet"]) == 0
    with Image.open(out) as image:
        return np.asarray(image).astype(int)


def covered(with_it, without):
    """Pixels that something changes, at its edges by half or more."""
    change = np.abs(with_it - without).max(axis=2)
    return change > 0.4 * np.median(change[change > 8])


def pixels(length, depth=10.0):
    """How many pixels a length [m] takes at a distance from the eye [m]."""
    return length / depth / np.tan(np.radians(FOV / 2)) * SIZE / 2


@pytest.mark.parametrize(
    ("size", "radius"),
    [
        ((0.05, 0.08, 0.16), 0.484),  # by the square of the body's longest edge over 4 R
        ((1.0, 1.0, 1.0), 0.475),  # a twentieth at the most
    ],
)
def test_a_sphere_is_drawn_smaller_by_what_triangles_on_it_cut_off(tmp_path, size, radius):
    sphere = "[[obstacle]]\nsphere = { center = [0, 0, 0], radius = 0.5 }"
    near = {"size": size, "eye": 3}
    change = np.abs(picture(tmp_path, sphere, **near) - picture(tmp_path, **near)).max(axis=2)
    rows, columns = np.nonzero(change > 8)
    outline = 3.0 * radius / np.sqrt(3.0**2 - radius**2)
    for places in (rows, columns):
        assert np.ptp(places) + 1 == pytest.approx(2 * pixels(outline, depth=3.0), abs=1.5)
        assert places.min() + places.max() == pytest.approx(239, abs=1)


def test_a_box_is_drawn_where_it_is(tmp_path):
    box = "[[obstacle]]\nbox = { center = [0.5, -0.5, -0.25], size = [1, 2, 0.5] }"
    rows, columns = np.nonzero(covered(picture(tmp_path, box), picture(tmp_path)))
    assert columns.min() - 120 == pytest.approx(0, abs=1)
    assert columns.max() - 119 == pytest.approx(pixels(1.0), abs=1)
    assert rows.min() - 120 == pytest.approx(-pixels(0.5), abs=1)
    assert rows.max() - 119 == pytest.approx(pixels(1.5), abs=1)


def test_a_wall_is_a_patch_behind_the_bodies_half_as_large_again(tmp_path):
    wall = "[[obstacle]]\nplane = { point = [7, 7, -2], normal = [0, 0, 1] }"
    around = {"size": (1, 1, 1), "place": (-0.2, -0.5, -0.5)}
    seen = covered(picture(tmp_path, wall, **around), picture(tmp_path, **around))
    rows, columns = np.nonzero(seen)
    side = 1.5 * np.sqrt(3.0)
    centre = 119.5 + pixels(0.3, depth=12.0)
    assert np.ptp(columns) + 1 == pytest.approx(pixels(side, depth=12.0), abs=2)
    assert np.ptp(rows) + 1 == pytest.approx(pixels(side, depth=12.0), abs=2)
    assert (columns.min() + columns.max()) / 2 == pytest.approx(centre, abs=1)
    assert (rows.min() + rows.max()) / 2 == pytest.approx(119.5, abs=1)


def test_without_gravity_y_is_up(tmp_path):
    around = {"size": (1, 0.5, 0.3), "place": (-0.2, 0.1, 0)}
    floating = picture(tmp_path, **around)
    falling = picture(tmp_path, gravity=(0, -9.81, 0), **around)
    assert (floating == falling).all()
    sideways = picture(tmp_path, gravity=(-9.81, 0, 0), **around)
    assert (floating != sideways).any()


NET = """
gravity = [0, 0, 0]
duration = 0.001
frame_rate = 20

[[body]]
name = "net"
model = "mass-spring"
stiffness = 10.0
node_mass = 0.1
springs = [[0, 1], [1, 2], [2, 3]]

[body.mesh]
points = [[-1.5, 0, 0], [-0.5, 0, 0], [0.5, 0, 0], [1.5, 0, 0]]

[camera]
eye = [0, 0, 4]
target = [0, 0, 0]
fov = 30

[render]
size = [240, 240]
color = "body"
samples = 4
ground = false
"""


def test_nodes_are_drawn_as_beads_on_their_springs(tmp_path):
    path = tmp_path / "net.toml"
    path.write_text(NET, encoding="utf-8")
    empty = picture(tmp_path)
    height = covered(rendered(path), empty).sum(axis=0)
    bead = height[int(119.5 + pixels(0.5, depth=4.0))]
    spring = height[120]
    assert spring == pytest.approx(pixels(2 * 0.05, depth=4.0), abs=1.5)
    assert 1.3 < bead / spring < 1.9


def test_a_closed_surface_of_springs_is_drawn_as_springs():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    edges = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32)
    for surface, drawn in ((faces, Capsules), (faces[:3], Surface)):
        net = ts.SpringNet(points, np.array(edges, np.int32), surface, np.arange(4))
        body = ts.Body("net", net, ts.MassSpring(stiffness=1.0, node_mass=1.0))
        assert type(body_items(body, 0, points, 0, wireframe=False)[0]) is drawn


FRAMED = """
duration = 0.001
frame_rate = 20

[[body]]
name = "block"
young = 1e5
poisson = 0.3
density = 1000.0

[body.mesh]
box = { size = [1, 1, 1], cells = [1, 1, 1] }

PLACE

[render]
size = [240, 160]
color = "body"
samples = 1
"""
FLOOR = "[[obstacle]]\nplane = { point = [0, -0.2, 0], normal = [0, 1, 0] }\n"
BALL = "[[obstacle]]\nsphere = { center = [3, 0.5, 0.5], radius = 0.5 }\n"
CRATE = "[[obstacle]]\nbox = { center = [3, 0.5, 0.5], size = [1.6, 1.6, 1.6] }\n"


def framed(folder, place):
    path = folder / "framed.toml"
    path.write_text(FRAMED.replace("PLACE", place), encoding="utf-8")
    return rendered(path)


@pytest.mark.parametrize("obstacle", [BALL, CRATE])
def test_a_small_obstacle_is_in_the_picture_whatever_stands_before_it(tmp_path, obstacle):
    one, other = framed(tmp_path, FLOOR + obstacle), framed(tmp_path, obstacle + FLOOR)
    assert (one == other).all()
    alone = framed(tmp_path, obstacle)
    bare = alone[:, :1]  # the backdrop changes along a row by less than this
    drawn = np.abs(alone - bare).max(axis=2) > 40
    assert drawn.sum() > 1000
    assert not drawn[:, -4:].any() and not drawn[:4].any() and not drawn[-4:].any()


def test_a_camera_with_a_target_alone_looks_from_above(tmp_path):
    target = "[camera]\ntarget = [0.5, 0.5, 0.5]\n"
    change = np.abs(framed(tmp_path, FLOOR + target) - framed(tmp_path, target)).max(axis=2)
    assert (change[80:] > 2).mean() > 0.35  # the lower half is ground


def test_stress_of_a_cloth_does_the_work_that_it_stores():
    """Pulled along x, its springs along x alone: ½ Σ V σ ε, a node's volume its share of sheet."""
    mesh = ts.cloth((1.0, 2.0), (4, 8), diagonals=False)
    scene = ts.Scene(gravity=(0, 0, 0))
    model = ts.MassSpring(stiffness=50.0, density=1000.0, thickness=0.002)
    scene.add_body(mesh, model, "cloth")
    sim = ts.Simulation(scene, precision="f64")
    pull = 1e-4
    sim.set_state(mesh.points * [1.0 + pull, 1.0, 1.0], np.zeros_like(mesh.points))
    stress = node_values(sim, "stress")
    corners = mesh.points[mesh.surface]
    sides = corners[:, 1:] - corners[:, :1]
    areas = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    volumes = 0.002 / 3.0 * np.bincount(mesh.surface.ravel(), np.repeat(areas, 3))
    assert volumes.sum() == pytest.approx(2.0 * 0.002)
    assert 0.5 * pull * (volumes @ stress) == pytest.approx(sim.energy()["elastic"], rel=1e-3)


TWO = """
gravity = [0, 0, 0]
duration = 0.1
frame_rate = 20

[[body]]
name = "still"
young = 1e5
poisson = 0.3
density = 1000.0

[body.mesh]
box = { size = [0.5, 0.5, 0.5], cells = [1, 1, 1] }
translate = [-1.5, -0.25, -0.25]

[[body]]
name = "turning"
young = 1e7
poisson = 0.3
density = 1000.0
velocity = [0, 10, 0]
spin = [0, 0, 15.708]

[body.mesh]
box = { size = [2, 0.2, 0.2], cells = [10, 1, 1] }
translate = [0, -1.1, -0.1]

[camera]
eye = [0, 0, 10]
target = [0, 0, 0]
fov = 30

[render]
size = [240, 240]
samples = 2
ground = false
"""


def test_bodies_are_drawn_where_they_are_now_in_the_colours_of_now(tmp_path):
    """A bar that flies up by 1 m and turns by a quarter; its ends are fast, its middle slower."""
    path = tmp_path / "two.toml"
    path.write_text(TWO, encoding="utf-8")
    out = tmp_path / "pictures"
    assert main(["render", str(path), "-o", str(out), "--quiet", "--color", "speed"]) == 0
    first, *_, last = (np.asarray(Image.open(p)).astype(int) for p in sorted(out.glob("*.png")))

    def seen(shot, left, right):
        warm = shot[..., 0] > shot[..., 2] + 20  # yellow to red, before a bluish backdrop
        rows, columns = np.nonzero(warm[:, left:right])
        return np.ptp(columns) + 1, np.ptp(rows) + 1, (columns + left).mean(), rows.mean()

    still = (pixels(0.5, depth=9.75), pixels(0.5, depth=9.75), 119.5 - pixels(1.25), 119.5)
    assert seen(last, 40, 90) == pytest.approx(still, abs=3)
    wide, high, x, y = seen(first, 110, 212)
    assert (wide, high) == pytest.approx((pixels(2, depth=9.9), pixels(0.2, depth=9.9)), abs=3)
    assert (x, y) == pytest.approx((119.5 + pixels(1.0), 119.5 + pixels(1.0)), abs=3)
    wide, high, x, y = seen(last, 110, 200)
    assert high > 4 * wide
    assert (x, y) == pytest.approx((119.5 + pixels(1.0), 119.5), abs=4)
    paleness = last[..., 2] / last[..., 0]  # blue over red, of yellow to red
    column = round(x)
    assert paleness[int(y) - 38, column] < 0.8 * paleness[int(y), column]
