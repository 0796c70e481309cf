"""The camera frames what moves, whatever its size, place and up."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tisoft.errors import SceneError
from tisoft.render.camera import MARGIN, Camera, auto_camera

lengths = st.floats(1e-3, 10.0)
places = st.floats(-100.0, 100.0)


def in_picture(camera, points, aspect):
    """Places in the picture, from -1 to 1 each way, and depths."""
    x, y, z = np.stack(camera.axes()) @ (points - np.array(camera.eye)).T
    tan = np.tan(np.radians(camera.fov) / 2)
    return x / (z * tan * aspect), y / (z * tan), z


@given(
    st.tuples(places, places, places),
    st.tuples(lengths, lengths, lengths),
    st.sampled_from([(0, 1, 0), (0, 0, 1), (1, 0, 0), (0, -1, 0), (0.3, 1, -0.2)]),
    st.sampled_from([16 / 9, 1.0, 0.5]),
)
def test_everything_is_in_the_picture_and_fills_it(lo, size, up, aspect):
    lo = np.array(lo)
    hi = lo + size
    camera = auto_camera(lo, hi, up, aspect=aspect)
    corners = np.array(np.meshgrid(*np.stack([lo, hi]).T)).reshape(3, 8).T
    x, y, depth = in_picture(camera, corners, aspect)
    assert (depth > 0).all()
    reach = max(np.abs(x).max(), np.abs(y).max())
    assert reach <= MARGIN + 1e-6
    assert reach >= MARGIN - 1e-6 - 0.05
    assert (np.array(camera.eye) - np.array(camera.target)) @ up > 0  # from above


def test_scaling_the_scene_scales_the_camera():
    lo, hi = np.array([-1.0, 0, 2]), np.array([2.0, 1, 3])
    one, other = auto_camera(lo, hi), auto_camera(1000 * lo, 1000 * hi)
    assert np.allclose(np.array(other.eye), 1000 * np.array(one.eye), rtol=1e-12)
    assert np.allclose(np.array(other.target), 1000 * np.array(one.target), rtol=1e-12)


def test_a_flat_or_single_point_scene_is_framed():
    for hi in ((1, 0, 1), (0, 0, 0), (1, 0, 0)):
        camera = auto_camera((0, 0, 0), hi)
        assert np.isfinite(camera.eye).all() and camera.distance > 0


def test_looking_straight_down_is_defined():
    right, up, forward = Camera((0, 5, 0), (0, 0, 0)).axes()
    assert np.allclose(np.stack([right, up, forward]) @ np.stack([right, up, forward]).T, np.eye(3))


@pytest.mark.parametrize(
    "wrong, word",
    [
        ({"eye": (0, 0, 0)}, "same point"),
        ({"fov": 0.0}, "fov"),
        ({"eye": (0, np.nan, 0)}, "camera.eye"),
        ({"target": (0, 0)}, "camera.target"),
    ],
)
def test_undefined_views_are_refused(wrong, word):
    with pytest.raises(SceneError, match=word):
        Camera(**{"eye": (0, 0, 1), "target": (0, 0, 0), **wrong})


def test_bounds_that_are_not_finite_are_refused():
    with pytest.raises(SceneError, match="finite bounds"):
        auto_camera((0, 0, 0), (1, np.inf, 1))
