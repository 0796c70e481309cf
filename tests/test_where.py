"""Selections: closed, indifferent to scale and to rounding, in the file's node numbers."""

import numpy as np
import pytest

from tisoft import where
from tisoft.checks import FieldError
from tisoft.geometry import shapes

MESH = shapes.box((1.0, 0.2, 0.2), (10, 2, 2))


def test_box_is_closed():
    picked = where.box((0.5, 0.0, 0.0), (1.0, 0.2, 0.2)).select(MESH.points)
    assert MESH.points[picked, 0].min() == 0.5
    assert MESH.points[picked, 0].max() == 1.0
    assert len(picked) == 6 * 9


def test_box_open_to_infinity_selects_a_side():
    inf = float("inf")
    picked = where.box((-inf, -inf, -inf), (0.0, inf, inf)).select(MESH.points)
    assert (MESH.points[picked, 0] == 0.0).all()
    assert len(picked) == 9


def test_plane_takes_the_side_that_its_normal_points_away_from():
    picked = where.plane((0.0, 0.1, 0.0), (0.0, 3.0, 0.0)).select(MESH.points)
    assert (MESH.points[picked, 1] <= 0.1).all()
    assert len(picked) == 11 * 2 * 3


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("angle", [0.0, 30.0, 90.0, 123.0])
def test_the_clamped_face_is_found_in_a_scaled_and_turned_mesh(scale, angle):
    mesh = MESH.transformed(scale=scale, rotate=(0.0, 0.0, angle), translate=(3 * scale, 0.0, 0.0))
    normal = (np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle)), 0.0)
    picked = where.plane((3 * scale, 0.0, 0.0), normal).select(mesh.points)
    expected = where.box((0.0, 0.0, 0.0), (0.0, 1.0, 1.0)).select(MESH.points)
    np.testing.assert_array_equal(picked, expected)


def test_rounding_does_not_lose_the_border():
    points = np.array([[0.1 * 3, 0.0, 0.0], [1.0, 0.0, 0.0]])  # 0.30000000000000004
    assert where.box((0.0, 0.0, 0.0), (0.3, 0.0, 0.0)).select(points).tolist() == [0]


def test_nearest_is_one_node_and_ties_go_to_the_first():
    assert where.nearest((0.5, 0.0, 0.0)).select(MESH.points).tolist() == [5]
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert where.nearest((0.5, 0.0, 0.0)).select(points).tolist() == [0]
    assert where.nearest((9e99, 0.0, 0.0)).select(points * 1e-300).size == 1


def test_nodes_are_numbered_as_in_the_file():
    points = np.eye(3)
    assert where.nodes([7, 4]).select(points, np.array([2, 4, 7])).tolist() == [1, 2]
    assert where.nodes([2, 0, 2]).select(points).tolist() == [0, 2]


def test_nodes_that_the_mesh_has_not_are_named():
    points = np.eye(3)
    with pytest.raises(FieldError, match=r"nodes\[1\] = 8 is no node .* the highest is 7"):
        where.nodes([4, 8]).select(points, np.array([2, 4, 7]))
    with pytest.raises(FieldError, match=r"nodes\[0\] = 3 .* no element uses it"):
        where.nodes([3]).select(points, np.array([2, 4, 7]))


def test_everything_selects_all():
    np.testing.assert_array_equal(where.everything().select(MESH.points), np.arange(99))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: where.box((1, 0, 0), (0, 1, 1)), r"box\[1\] = .* is below box\[0\] in x"),
        (lambda: where.box((0, 0), (1, 1, 1)), r"box\[0\] = \[0, 0\] must be 3 numbers"),
        (lambda: where.box((0, 0, float("nan")), (1, 1, 1)), r"box\[0\]\[2\] = nan must be"),
        (lambda: where.plane((0, 0, 0), (0, 0, 0)), r"plane.normal = .* has no direction"),
        (lambda: where.nearest("here"), r'nearest = "here" must be a list'),
        (lambda: where.nodes([1.5]), r"nodes\[0\] = 1.5 must be a whole number"),
        (lambda: where.nodes([-1]), r"nodes\[0\] = -1 must be at least 0"),
        (lambda: where.nodes([True]), r"nodes\[0\] = true must be a whole number"),
    ],
)
def test_impossible_selections_say_what_is_wrong(make, message):
    with pytest.raises(FieldError, match=message):
        make()
