"""Light in pictures: what any right renderer of a broad lamp must show, as ratios.

A picture with a caster is divided by the same picture without it, so colours, exposure and the
ground's pattern cancel.
"""

import numpy as np
import pytest

import tisoft as ts
from tisoft.render.camera import Camera
from tisoft.render.obstacles import box_surface, sphere_surface
from tisoft.render.renderer import Renderer

SIZE = (400, 400)
RED, GREY, BLACK = (0.9, 0.05, 0.05), (0.7, 0.7, 0.7), (0.02, 0.02, 0.02)
ABOVE = Camera((0, 9, 0), (0, 0, 0), up=(0, 0, -1))
FRONT = Camera((0, 3, 8), (0, 0.5, 0))


@pytest.fixture(scope="module", autouse=True)
def taichi_started():
    scene = ts.Scene()
    scene.add_body(
        ts.net([[0, 0, 0], [1, 0, 0]], [[0, 1]]), ts.MassSpring(stiffness=1.0, node_mass=1.0)
    )
    ts.Simulation(scene)


def draw(items, camera, **options):
    """Linear intensities, shape (height, width, 3)."""
    c = Renderer(SIZE, **options).draw(items, camera) / 255.0
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def table():
    return box_surface((0, -0.2, 0), (6, 0.4, 6), color=GREY)


def share_of_light(caster, camera, *, on):
    """What a caster leaves of the light on a "body" or the "ground", NaN where it is in front."""
    floor, options = ([table()], {}) if on == "body" else ([], {"ground": 0.0})
    lit, shaded = draw(floor, camera, **options), draw([*floor, caster], camera, **options)
    share = shaded.sum(axis=2) / lit.sum(axis=2)
    red = shaded[..., 0] > 2.0 * shaded[..., 2]
    near = red.copy()  # and what its edge is mixed into
    near[1:] |= red[:-1]
    near[:-1] |= red[1:]
    near[:, 1:] |= near[:, :-1]
    near[:, :-1] |= near[:, 1:]
    return np.where(near, np.nan, share), red


def middle(mask):
    rows, columns = np.nonzero(mask)
    return np.array([columns.mean(), rows.mean()])


@pytest.mark.parametrize("on", ["body", "ground"])
def test_a_ball_throws_a_shadow_of_about_its_own_size(on):
    share, ball = share_of_light(sphere_surface((0, 1.5, 0), 0.5, color=RED), ABOVE, on=on)
    dark = np.nan_to_num(share, nan=1.0) < 0.75
    assert np.nanmin(share) < 0.65  # the sky still reaches it
    assert np.nanmin(share) > 0.1
    # The ball is nearer to the eye by a sixth; its shadow is stretched by the slant of the lamp.
    assert 0.4 < dark.sum() / ball.sum() < 1.6
    far = np.ones_like(dark)
    far[60:340, 60:340] = False
    assert np.abs(share[far] - 1.0).max() < 0.02


@pytest.mark.parametrize("on", ["body", "ground"])
def test_shadows_soften_with_the_height_of_what_throws_them(on):
    """Of a slab's edge: the penumbra is as wide as the height times the lamp's apparent size."""

    def width(height):
        slab = box_surface((0, height, 0), (1.4, 0.1, 1.4), color=RED)
        share, red = share_of_light(slab, ABOVE, on=on)
        edge = np.nonzero(red)[1].max() + 2
        dark = np.nan_to_num(share[:, edge:], nan=1.0) < 0.75  # right of the slab
        row = share[int(np.median(np.nonzero(dark)[0])), edge:]
        depth = np.nanmin(row)
        assert depth < 0.75
        level = (row - depth) / (1.0 - depth)
        return np.count_nonzero((level > 0.2) & (level < 0.8))

    low, high = width(0.4), width(1.6)
    assert 1 <= low <= 8
    assert high >= 2 * low


def test_the_gloss_is_on_the_side_of_the_lamp_and_the_shadow_on_the_other():
    ball = sphere_surface((0, 1.0, 0), 0.8, color=BLACK)
    floor = draw([table()], FRONT)
    picture = draw([table(), ball], FRONT)
    outline = picture.sum(axis=2) < 0.25 * floor.sum(axis=2)
    centre = middle(outline)
    radius = np.sqrt(outline.sum() / np.pi)
    rows, columns = np.indices(outline.shape)
    away = np.hypot(columns - centre[0], rows - centre[1]) / radius
    inside = np.where(away < 0.75, picture.sum(axis=2), 0.0)
    gloss = middle(inside > 0.7 * inside.max()) - centre
    shadow = middle((away > 1.05) & (picture.sum(axis=2) < 0.7 * floor.sum(axis=2))) - centre
    assert inside.max() > 5.0 * np.median(inside[away < 0.75])
    assert gloss[0] * shadow[0] < 0.0  # left and right
    assert gloss[1] < -0.1 * radius  # above
    assert 0.2 < np.hypot(*gloss) / radius < 0.6  # between the lamp and the eye


def test_the_side_that_faces_the_lamp_is_the_bright_one():
    ball = sphere_surface((0, 1.0, 0), 0.8, color=GREY)
    picture = draw([ball], FRONT).sum(axis=2)
    empty = draw([], FRONT).sum(axis=2)
    outline = np.abs(picture - empty) > 0.02
    x, y = middle(outline)
    radius = np.sqrt(outline.sum() / np.pi)
    rows, columns = np.indices(outline.shape)

    def mean(dx, dy):
        spot = np.hypot(columns - x - dx * radius, rows - y - dy * radius) < 0.15 * radius
        return picture[spot].mean()

    assert mean(-0.5, -0.5) > 1.5 * mean(0.5, 0.5)
