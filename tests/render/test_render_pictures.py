"""Pictures obey geometry and light: silhouettes, depth, shadows, and no absolute length."""

import itertools
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
import taichi as ti
from scipy import ndimage

from tisoft import bench_render, runtime
from tisoft.errors import SceneError
from tisoft.render.camera import Camera, auto_camera
from tisoft.render.items import Capsules, Spheres, Surface
from tisoft.render.obstacles import box_surface, cube, plane_surface, sphere_surface
from tisoft.render.renderer import GroundPlane, Renderer

SIZE = (192, 128)
RED, BLUE = (0.9, 0.1, 0.1), (0.1, 0.2, 0.9)


def draw(items, camera, **options):
    return Renderer(options.pop("size", SIZE), **options).draw(items, camera).astype(int)


def covered(items, camera, **options):
    """Pixels that the items change."""
    return (draw(items, camera, **options) != draw([], camera, **options)).any(axis=2)


def redness(picture):
    return picture[..., 0] - picture[..., 2]


def ball_on_ground(scale=1.0, shift=(0.0, 0.0, 0.0), dtype=np.float64):
    ball = sphere_surface((0, 0.5, 0), 0.5, color=RED)
    block = box_surface((1.0, 0.2, -0.3), (0.5, 0.4, 0.6))
    spring = Capsules(
        np.array([[-0.9, 0.05, 0.3], [-0.6, 0.7, 0.2], [-0.9, 0.9, 0.0]]),
        np.array([[0, 1], [1, 2]], dtype=np.int32),
        0.03 * scale,
        BLUE,
    )
    items = [ball, block, spring]
    for item in items:
        item.positions = (item.positions * scale + np.asarray(shift)).astype(dtype)
    lo, hi = np.array([-1.0, 0.0, -0.6]), np.array([1.3, 1.0, 0.5])
    camera = auto_camera(lo * scale + shift, hi * scale + shift, aspect=SIZE[0] / SIZE[1])
    return items, camera, GroundPlane(tuple(shift), (0.0, 1.0, 0.0))


def picture_of(items, camera, ground):
    return Renderer(SIZE, ground=ground).draw(items, camera)


@pytest.mark.parametrize("kind", ["surface", "point"])
def test_silhouette_of_a_sphere_has_the_area_of_its_cone(kind):
    radius, distance, fov, height = 0.6, 4.0, 30.0, 240
    camera = Camera((0, 0, distance), (0, 0, 0), fov=fov)
    if kind == "surface":
        items = [sphere_surface((0, 0, 0), radius, color=RED)]
    else:
        items = [Spheres(np.zeros((1, 3)), radius, RED)]
    picture = Renderer((height, height), samples=4).draw(items, camera).astype(float)
    empty = Renderer((height, height), samples=4).draw([], camera).astype(float)
    area = np.count_nonzero(np.abs(picture - empty).max(axis=2) > 40)
    tangent = radius / np.sqrt(distance**2 - radius**2)
    pixels = tangent / np.tan(np.radians(fov / 2)) * height / 2
    assert area == pytest.approx(np.pi * pixels**2, rel=0.01)


def test_a_capsule_is_as_long_and_as_wide_as_it_is():
    camera = Camera((0, 0, 100.0), (0, 0, 0), fov=2.0)
    ends = np.array([[-1.0, 0, 0], [1.0, 0, 0]])
    seen = covered([Capsules(ends, np.array([[0, 1]]), 0.2, RED)], camera, samples=4)
    pixel = 2 * 100.0 * np.tan(np.radians(1.0)) / SIZE[1]
    assert np.ptp(np.nonzero(seen)[1]) + 1 == pytest.approx(2.4 / pixel, abs=2.0)
    assert np.ptp(np.nonzero(seen)[0]) + 1 == pytest.approx(0.4 / pixel, abs=2.0)


@pytest.mark.parametrize("nearer", [RED, BLUE])
def test_what_is_nearer_hides_what_is_behind(nearer):
    camera = Camera((0, 0, 5.0), (0, 0, 0))
    farther = BLUE if nearer == RED else RED
    front = plane_surface((0, 0, 1.0), (0, 0, 1), 0.8, color=nearer)
    back = box_surface((0, 0, -1.0), (3, 3, 0.5), color=farther)
    for items in ([front, back], [back, front]):
        middle = redness(draw(items, camera))[SIZE[1] // 2, SIZE[0] // 2]
        assert (middle > 0) == (nearer == RED)


def test_triangles_that_reach_behind_the_eye_are_cut_not_lost():
    camera = Camera((0, 1.0, 5.0), (0, 0.9, 0))
    corners = np.array([[-50.0, 0, -50], [-50, 0, 50], [50, 0, 50], [50, 0, -50]])
    floor = Surface(corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), RED)
    assert (redness(draw([floor], camera))[-10:] > 0).all()


def test_a_sheet_is_seen_from_both_sides_alike_bright():
    sheet = plane_surface((0, 0, 0), (0, 0, 1), 2.0, color=RED)
    turned = plane_surface((0, 0, 0), (0, 0, -1), 2.0, color=RED)
    camera = Camera((0, 0, 4.0), (0, 0, 0))
    one, other = draw([sheet], camera), draw([turned], camera)
    assert np.abs(one - other).max() <= 1


def test_the_lamp_above_leaves_a_shadow_below_and_none_far_away():
    camera = Camera((0, 1.5, 6.0), (0, 0.8, 0))
    ball = sphere_surface((0, 1.0, 0), 0.5, color=RED)
    with_ball = draw([ball], camera, ground=0.0)
    without = draw([], camera, ground=0.0)
    change = (with_ball - without).sum(axis=2)[redness(with_ball) < 60]
    assert change.min() < -60
    assert (with_ball[-1, :3] == without[-1, :3]).all()


def test_shadow_softens_with_height():
    camera = Camera((0, 2.0, 6.0), (0, 0.8, 0))

    def darkest(height):
        ball = sphere_surface((0, height, 0), 0.12, color=(0.8, 0.8, 0.8))
        picture = draw([ball], camera, ground=0.0)
        return (picture - draw([], camera, ground=0.0)).sum(axis=2)[SIZE[1] // 2 :].min()

    assert darkest(0.14) < darkest(1.9) < 0


def test_a_body_hides_the_lamp_from_another():
    camera = Camera((0, 3.0, 6.0), (0, 0, 0))
    table = box_surface((0, -0.2, 0), (4, 0.4, 4))
    ball = sphere_surface((0, 0.6, 0), 0.5, color=RED)
    both, alone = draw([table, ball], camera), draw([table], camera)
    outside = redness(both) < 40
    assert (both - alone).sum(axis=2)[outside].min() < -60


def test_there_is_no_ground_from_below_and_bodies_in_it_are_hidden():
    below = Camera((0, -1.0, 5.0), (0, 0, 0))
    assert (draw([], below, ground=0.0) == draw([], below)).all()
    above = Camera((0, 1.0, 5.0), (0, 0, 0))
    sunken = sphere_surface((0, -2.0, 0), 0.5, color=RED)
    assert redness(draw([sunken], above, ground=0.0)).max() < 20


def test_ground_may_lie_at_any_tilt():
    items, camera, _ = ball_on_ground()
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # y to z: z is up
    straight = picture_of(items, camera, None).astype(int)
    for item in items:
        item.positions = item.positions @ turn.T
    turned = Camera(*(turn @ v for v in (camera.eye, camera.target, camera.up)), fov=camera.fov)
    tilted = Renderer(SIZE, up=(0, 0, 1)).draw(items, turned).astype(int)
    changed = np.abs(tilted - straight).max(axis=2) > 2
    assert changed.mean() < 1e-3  # samples on an edge may fall either way


@pytest.mark.parametrize("scale", [1000.0, 1e-6])
def test_a_scaled_scene_gives_the_identical_picture(scale):
    assert (picture_of(*ball_on_ground(scale)) == picture_of(*ball_on_ground())).all()


def test_a_scene_far_from_the_origin_loses_nothing():
    here, there = picture_of(*ball_on_ground()), picture_of(*ball_on_ground(shift=(4e6, 0, -2e6)))
    difference = np.abs(here.astype(int) - there)
    assert difference.max() <= 2  # 1e-9 of a metre is all that f64 has left there


def test_arrays_of_taichi_and_numpy_in_f32_and_f64_give_one_picture():
    items, camera, ground = ball_on_ground(dtype=np.float32)
    expected = picture_of(items, camera, ground)
    for item in items:
        item.positions = item.positions.astype(np.float64)
    assert (picture_of(items, camera, ground) == expected).all()
    for item in items:
        array = ti.ndarray(ti.f32, item.positions.shape)
        array.from_numpy(item.positions.astype(np.float32))
        item.positions = array
    assert (picture_of(items, camera, ground) == expected).all()


def test_items_are_drawn_where_they_are_now_and_pictures_repeat():
    items, camera, ground = ball_on_ground()
    renderer = Renderer(SIZE, ground=ground)
    first = renderer.draw(items, camera)
    assert (renderer.draw(items, camera) == first).all()
    home = items[0].positions.copy()
    items[0].positions += [0.0, 0.3, 0.0]
    moved = renderer.draw(items, camera)
    assert (moved != first).any()
    items[0].positions = home
    items[0].color = np.tile(RED, (len(home), 1))
    assert (renderer.draw(items, camera) == first).all()


THREADS = """
import sys; sys.path[:0] = [{here!r}]
import taichi as ti
ti.init(arch=ti.cpu, default_fp=ti.f32, fast_math=False, cpu_max_num_threads={threads})
import hashlib, importlib.util
spec = importlib.util.spec_from_file_location("pictures", {file!r})
pictures = importlib.util.module_from_spec(spec); spec.loader.exec_module(pictures)
print(hashlib.sha256(pictures.picture_of(*pictures.ball_on_ground()).tobytes()).hexdigest())
"""


@pytest.mark.slow
def test_one_thread_draws_what_two_draw():
    def digest(threads):
        program = THREADS.format(here=sys.path[0], file=__file__, threads=threads)
        run = subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, check=True
        )
        return run.stdout.split()[-1]

    assert digest(1) == digest(2)


def test_the_form_for_a_gpu_draws_the_same_picture(monkeypatch):
    items, camera, ground = ball_on_ground()
    expected = picture_of(items, camera, ground).astype(int)
    monkeypatch.setattr(runtime, "on_cpu", lambda: False)  # arrays of Taichi, a thread a triangle
    difference = np.abs(picture_of(items, camera, ground).astype(int) - expected)
    assert difference.max() <= 2 and (difference > 0).mean() < 1e-3


def test_no_gap_opens_between_triangles():
    camera = Camera((0, 0, 4.0), (0, 0, 0))
    points, triangles = ball_points(40)
    ball = Surface(points, triangles, RED)
    rng = np.random.default_rng(0)
    for _ in range(4):
        ball.positions = points + rng.normal(0.0, 0.004, points.shape)
        red = redness(draw([ball], camera, size=(640, 480), samples=1)) > 20
        inner = ndimage.binary_erosion(ndimage.binary_fill_holes(red), iterations=2)
        assert inner.sum() > 1e4 and red[inner].all()


def ball_points(cells):
    grid, triangles = cube(cells)
    grid = np.tan(grid * np.pi / 4)
    return grid / np.linalg.norm(grid, axis=1, keepdims=True), triangles


def test_alpha_is_whole_on_bodies_partial_in_shadows_and_nothing_elsewhere():
    items, camera, ground = ball_on_ground()
    picture = Renderer(SIZE, ground=ground, alpha=True).draw(items, camera)
    opaque = picture_of(items, camera, ground)
    assert picture.shape == (*SIZE[::-1], 4)
    alpha = picture[..., 3]
    solid = alpha == 255
    assert 0.1 < solid.mean() < 0.6
    assert np.abs(picture[solid][:, :3].astype(int) - opaque[solid]).max() <= 1
    assert (alpha[0] == 0).all() and ((alpha > 20) & (alpha < 200)).sum() > 50
    shadow = (alpha > 60) & (alpha < 120)
    assert np.median(picture[shadow][:, :3]) == 0  # black, but for rims of bodies


def test_a_flipped_normal_a_lost_shadow_and_a_wrong_light_change_the_small_picture():
    items, camera, ground = ball_on_ground()
    whole = picture_of(items, camera, ground).astype(int)
    ball = redness(whole) > 40
    rows, columns = np.nonzero(ball)
    middle = np.abs(columns - columns.mean()) < 3
    upper, lower = rows[middle] < np.median(rows), rows[middle] > np.percentile(rows, 90)
    light = whole.sum(axis=2)
    top = light[rows[middle][upper], columns[middle][upper]].mean()
    bottom = light[rows[middle][lower], columns[middle][lower]].mean()
    assert top > 1.3 * bottom  # the lamp is above
    left, right = columns < np.percentile(columns, 25), columns > np.percentile(columns, 75)
    assert light[rows[left], columns[left]].mean() > light[rows[right], columns[right]].mean()
    bare = Renderer(SIZE, ground=ground).draw([], camera).astype(int)
    darker = (bare - whole).sum(axis=2)[~ball]
    assert (darker > 60).sum() > 300  # the shadows on the ground


def test_light_passes_through_thin_parts_only():
    leaf = box_surface((0, 0, 0), (1.6, 0.05, 1.6), color=RED)
    block = box_surface((0, 0, 0), (1.6, 1.6, 1.6), color=RED)
    below = Camera((0, -6.0, 0.5), (0, 0, 0))
    gains = []
    for item in (leaf, block):
        dark = draw([item], below)
        item.translucent = 1.0
        gains.append((draw([item], below) - dark).sum(axis=2)[SIZE[1] // 2, SIZE[0] // 2])
    assert gains[0] > 30 and gains[0] > 1.5 * gains[1]


def test_edges_are_drawn_on_request_and_thinly():
    camera = Camera((0, 0, 4.0), (0, 0, 0))
    ball = sphere_surface((0, 0, 0), 1.0, color=(0.9, 0.9, 0.9))
    plain = draw([ball], camera, size=(384, 384))
    ball.wireframe = True
    wired = draw([ball], camera, size=(384, 384))
    inked = (plain - wired).sum(axis=2) > 60
    inside = covered([ball], camera, size=(384, 384))
    assert 0.1 < inked.sum() / inside.sum() < 0.6
    assert not inked[~inside].any()


def test_sharp_edges_stay_sharp_and_round_ones_smooth():
    box, ball = box_surface((0, 0, 0), (1, 1, 1)), sphere_surface((0, 0, 0), 1.0)
    grid = box.smooth
    assert len(ball.smooth.nodes) == len(ball.positions)
    on_edge = (np.abs(np.abs(box.positions) - 0.5) < 1e-9).sum(axis=1)
    assert (np.bincount(grid.nodes) == np.maximum(on_edge, 1)).all()


def test_empty_items_draw_nothing():
    camera = Camera((0, 0, 4.0), (0, 0, 0))
    nothing = Surface(np.zeros((2, 3)), np.zeros((0, 3), dtype=np.int32))
    bare = Capsules(np.zeros((2, 3)), np.zeros((0, 2), dtype=np.int32), 0.1)
    assert not covered([nothing, bare], camera).any()


def test_positions_that_are_not_finite_draw_nothing_and_do_no_harm():
    camera = Camera((0, 0, 4.0), (0, 0, 0))
    ball = sphere_surface((0, 0, 0), 1.0, color=RED)
    ball.positions[:] = np.nan
    dot = Spheres(np.array([[0.0, 0, 0], [np.nan, np.inf, 0]]), 0.3, RED)
    assert 0 < covered([ball, dot], camera, ground=-1.0).sum() < SIZE[0] * SIZE[1] / 2


@pytest.mark.parametrize("options", [{"size": (0, 10)}, {"size": (10, 9000)}, {"samples": 0}])
def test_pictures_that_cannot_be_drawn_are_refused(options):
    with pytest.raises(SceneError, match="render"):
        Renderer(**options)


def test_bench_tells_the_time_of_every_stage(monkeypatch):
    """By a clock that goes on by a millisecond each time it is looked at."""
    clock = SimpleNamespace(perf_counter=map((0.001).__mul__, itertools.count()).__next__)
    monkeypatch.setattr(bench_render, "time", clock)
    row = bench_render.measure((64, 48), 1_000)
    assert list(row["stages"].values()) == pytest.approx([1.0] * 6)
    assert row["milliseconds"] == pytest.approx(7.0)
    assert list(row["stages"]) == ["places", "projection", "lamp", "ground", "seeing", "shading"]
    assert "64x48" in bench_render.as_text([row])
