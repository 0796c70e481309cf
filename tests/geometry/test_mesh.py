"""Meshes are cleaned, checked once and free of absolute lengths."""

import numpy as np
import pytest

from tisoft.errors import MeshError
from tisoft.geometry import topology
from tisoft.geometry.mesh import TetMesh, spring_net, tet_mesh
from tisoft.geometry.shapes import box

CORNER = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)


def test_wrongly_oriented_tets_are_turned_round_and_counted():
    good = box((1.0, 1.0, 1.0), (2, 2, 2))
    tets = good.tets.copy()
    tets[[3, 7]] = tets[[3, 7]][:, [1, 0, 2, 3]]
    mesh = tet_mesh(good.points, tets)
    assert mesh.flipped == 2
    assert mesh.volumes.sum() == pytest.approx(1.0)


def test_unused_nodes_are_dropped_and_the_files_numbers_kept():
    points = np.insert(CORNER, 2, [9.0, 9.0, 9.0], axis=0)
    mesh = tet_mesh(points, [[0, 1, 3, 4]])
    assert mesh.dropped_nodes == 1
    assert mesh.kept_nodes.tolist() == [0, 1, 3, 4]
    assert mesh.tets.tolist() == [[0, 1, 2, 3]]


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1.0, 1e3, 1e9])
def test_meshes_in_any_unit_are_accepted(scale):
    mesh = box((1.0, 0.01, 0.1), (3, 2, 2)).transformed(scale=scale)
    again = tet_mesh(mesh.points, mesh.tets)
    assert again.volumes.sum() == pytest.approx(1e-3 * scale**3)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_flat_tets_are_refused_in_any_unit_with_their_numbers(scale):
    points = np.concatenate([CORNER, [[0.3, 0.3, 1e-9]]]) * scale
    with pytest.raises(MeshError, match=r"tet 1 \(counted from 0\) is degenerate"):
        tet_mesh(points, [[0, 1, 2, 3], [0, 1, 2, 4]])


@pytest.mark.parametrize(
    ("points", "tets", "words"),
    [
        (CORNER, [[0, 1, 2, 2]], "degenerate"),
        (CORNER, [[0, 1, 2, 3], [3, 2, 1, 0]], "given twice"),
        (CORNER, [[0, 1, 2, 4]], "uses node 4 .* but there are 4 nodes"),
        (CORNER, [[0, 1, 2, -1]], "uses node -1"),
        (CORNER * [1, 1, np.nan], [[0, 1, 2, 3]], "node 0 .* must be finite"),
        (CORNER * 0.0, [[0, 1, 2, 3]], "lie in one point"),
        (CORNER * 1e200, [[0, 1, 2, 3]], "beyond the range of numbers"),
        (CORNER + 1e17, [[0, 1, 2, 3]], "one point|degenerate"),
        (CORNER, [], "none"),
        (CORNER, [[0, 1, 2]], "rows of 4"),
        (CORNER, [[0.0, 1.0, 2.0, 3.0]], "whole node numbers"),
    ],
)
def test_impossible_meshes_are_refused_in_a_sentence(points, tets, words):
    with pytest.raises(MeshError, match=words):
        tet_mesh(points, tets)


def test_a_frozen_mesh_refuses_what_is_not_clean():
    with pytest.raises(MeshError, match="negative volume"):
        TetMesh(CORNER, np.array([[1, 0, 2, 3]]), np.arange(4))
    mesh = tet_mesh(CORNER, [[0, 1, 2, 3]])
    with pytest.raises(ValueError, match="read-only"):
        mesh.points[0, 0] = 1.0


def test_transform_scales_then_turns_about_x_y_z_then_moves():
    mesh = tet_mesh(CORNER, [[0, 1, 2, 3]])
    moved = mesh.transformed(scale=2.0, rotate=(90, 0, 90), translate=(0, 0, 5))
    # y to z about x; then, about z, x to y.
    expected = [[0, 0, 5], [0, 2, 5], [0, 0, 7], [2, 0, 5]]
    assert moved.points == pytest.approx(np.array(expected), abs=1e-12)
    with pytest.raises(MeshError, match=r"scale = -1.0 must be above"):
        mesh.transformed(scale=-1.0)
    with pytest.raises(MeshError, match="rotate"):
        mesh.transformed(rotate=(0, 0))


def test_pieces_edges_and_repeated_springs():
    two = np.concatenate([CORNER, CORNER + 3.0])
    mesh = tet_mesh(two, [[0, 1, 2, 3], [4, 5, 6, 7]])
    assert mesh.pieces == 2
    assert len(mesh.edges) == 12
    assert (mesh.edges[:, 0] < mesh.edges[:, 1]).all()
    assert spring_net(two, [[1, 0], [0, 1], [2, 1]]).edges.tolist() == [[0, 1], [1, 2]]


def test_incidence_lists_slots_in_element_order():
    mesh = box((1.0, 1.0, 1.0), (2, 2, 1))
    starts, slots = topology.incidence(mesh.tets, len(mesh.points))
    for node in range(len(mesh.points)):
        own = slots[starts[node] : starts[node + 1]]
        assert (np.diff(own) > 0).all()
        assert (mesh.tets.ravel()[own] == node).all()
    assert starts[-1] == 4 * len(mesh.tets)


def test_morton_order_is_a_permutation_that_keeps_neighbours_close():
    points = box((1.0, 1.0, 1.0), (7, 7, 7)).points
    order = topology.morton_order(points)
    assert np.array_equal(np.sort(order), np.arange(512))
    assert np.array_equal(topology.morton_order(1e6 * points - 3e6), order)
    steps = np.linalg.norm(np.diff(points[order], axis=0), axis=1)
    shuffled = np.random.default_rng(0).permutation(512)
    far = np.linalg.norm(np.diff(points[shuffled], axis=0), axis=1)
    assert steps.mean() < 0.4 * far.mean()
    first = points[order[:8]]
    assert np.ptp(first, axis=0) == pytest.approx(1.0 / 7.0)
