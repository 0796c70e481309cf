"""Where a mesh's topology is not what its geometry shows; nodes in one place can be merged."""

import numpy as np
import pytest
from mesh_texts import CUBE

from tisoft.errors import MeshError
from tisoft.geometry.joints import enclosed_volume
from tisoft.geometry.merging import merged
from tisoft.geometry.mesh import spring_net, tet_mesh
from tisoft.geometry.shapes import ball, box, cylinder

BEAM = box((1.0, 0.2, 0.2), (10, 2, 2))
BLOCK = box((1.0, 1.0, 1.0), (2, 2, 2))


def side_by_side(*meshes):
    """Meshes (points, tets) put into one list, nothing joined."""
    points, tets, first = [], [], 0
    for x, rows in meshes:
        points.append(x)
        tets.append(rows + first)
        first += len(x)
    return tet_mesh(np.concatenate(points), np.concatenate(tets))


def shifted(mesh, x=0.0, y=0.0, z=0.0):
    return mesh.points + np.array([x, y, z]), mesh.tets


def seam(*, all_of_it):
    """The beam with double nodes at x = 0.5, without its lowest row where not all of it."""
    points, tets = BEAM.points, BEAM.tets.copy()
    double = np.abs(points[:, 0] - 0.5) < 1e-12
    if not all_of_it:
        double &= points[:, 1] > 1e-12
    new = np.full(len(points), -1)
    new[double] = len(points) + np.arange(double.sum())
    right = points[tets].mean(axis=1)[:, 0] > 0.5
    tets[right] = np.where(new[tets[right]] >= 0, new[tets[right]], tets[right])
    return tet_mesh(np.concatenate([points, points[double]]), tets)


@pytest.mark.parametrize(
    "mesh", [BEAM, box((1, 1, 1), (2, 2, 2), split="six"), ball(0.5, 4), cylinder(0.1, 0.3, 3)]
)
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_sound_meshes_of_any_size_show_nothing(mesh, scale):
    joints = mesh.transformed(scale=scale, rotate=(10, 20, 30), translate=(scale, 0, 0)).joints
    for found in (joints.coincident, joints.hanging, joints.hinges, joints.folded, joints.doubled):
        assert len(found) == 0
    assert joints.lying == 0


@pytest.mark.parametrize(("all_of_it", "pairs", "pieces"), [(True, 9, 2), (False, 6, 1)])
def test_a_seam_of_double_nodes_is_counted_and_merged(all_of_it, pairs, pieces):
    mesh = seam(all_of_it=all_of_it)
    assert mesh.pieces == pieces
    assert len(mesh.joints.coincident) == pairs
    again = merged(mesh)
    assert len(again.points) == 99
    assert np.array_equal(again.points[again.tets], BEAM.points[BEAM.tets])
    assert len(again.joints.coincident) == 0
    first, last = again.joined[0], again.joined[-1]
    assert first[0] == 99  # the file's number of a node that is gone …
    assert again.points[first[1]] == pytest.approx(mesh.points[99])  # … and where it is now
    assert last[0] == 98 + pairs


@pytest.mark.parametrize("noise", [0.0, 2e-8])
@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_nodes_that_only_rounding_parts_are_in_one_place(noise, precision):
    mesh = side_by_side(shifted(BLOCK), shifted(BLOCK, 1, 0, 0))
    moved = mesh.points + np.random.default_rng(0).normal(0.0, noise, mesh.points.shape)
    rounded = tet_mesh(moved.astype(precision).astype(float), mesh.tets)
    assert len(rounded.joints.coincident) == 9
    assert len(merged(rounded).points) == 2 * 27 - 9


def test_touching_faces_of_other_triangulation_are_told():
    six = box((1.0, 1.0, 1.0), (2, 2, 2), split="six")
    finer = box((1.0, 1.0, 1.0), (3, 3, 3))
    quarter = side_by_side(shifted(BLOCK), shifted(BLOCK, 1.0, 0.3, 0.2)).joints
    assert (len(quarter.coincident), len(quarter.hanging), quarter.lying > 0) == (0, 8, True)
    assert side_by_side(shifted(BLOCK), shifted(finer, 1, 0, 0)).joints.lying > 0
    crossed = side_by_side(shifted(BLOCK), shifted(six, 1, 0, 0)).joints
    assert (len(crossed.coincident), len(crossed.hanging), crossed.lying) == (9, 0, 8)


def test_bodies_apart_are_no_seam():
    joints = side_by_side(shifted(BLOCK), shifted(BLOCK, 1.001, 0, 0)).joints
    assert (len(joints.coincident), len(joints.hanging), joints.lying) == (0, 0, 0)


CORNER = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1]], float)


@pytest.mark.parametrize(
    ("place", "tets"),
    [
        ([0.5, 0.5, 0], [[0, 1, 2, 3], [0, 5, 1, 4], [0, 2, 5, 4]]),
        ([0.3, 0.3, 0], [[0, 1, 2, 3], [0, 5, 1, 4], [0, 2, 5, 4], [1, 5, 2, 4]]),
    ],
)
def test_a_node_on_an_edge_or_a_face_of_one_side_only_hangs(place, tets):
    mesh = tet_mesh(np.concatenate([CORNER, [place]]), tets)
    assert mesh.pieces == 1
    assert mesh.joints.hanging.tolist() == [5]


def test_blocks_joined_by_an_edge_or_a_node_are_hinged():
    for shift, nodes in (((1, 1, 0), 3), ((1, 1, 1), 1)):
        apart = side_by_side(shifted(BLOCK), shifted(BLOCK, *shift))
        assert len(apart.joints.hinges) == 0  # two bodies as yet
        hinged = merged(apart)
        assert hinged.pieces == 1
        assert len(hinged.joints.hinges) == nodes


def test_a_staircase_that_touches_itself_in_an_edge_is_pinched_and_no_hinge():
    """Five blocks in a staircase: the last meets the first in one edge, joined elsewhere."""
    loop = [(0, 0, 0), (1, 0, 0), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    touching = merged(side_by_side(*(shifted(BLOCK, *place) for place in loop)))
    assert (len(touching.joints.hinges), len(touching.joints.pinched)) == (0, 2)


@pytest.mark.parametrize("backward", [False, True])
def test_folded_tets_are_found_whichever_way_the_file_counts(backward):
    good = box((0.4, 0.4, 0.4), (4, 4, 4))
    points = good.points.copy()
    points[62] = [0.33, 0.24, 0.22]
    tets = good.tets[:, [1, 0, 2, 3]] if backward else good.tets
    mesh = tet_mesh(points, tets)
    assert mesh.joints.folded.tolist() == [132, 191, 210]
    assert mesh.volumes.sum() == pytest.approx(0.0645, abs=5e-5)
    assert enclosed_volume(mesh.points, mesh.tets, mesh.joints.folded) == pytest.approx(0.064)


def test_a_file_without_orientation_is_no_fold():
    random = np.random.default_rng(1).random(len(BEAM.tets)) < 0.5
    tets = BEAM.tets.copy()
    tets[random] = tets[random][:, [1, 0, 2, 3]]
    mesh = tet_mesh(BEAM.points, tets)
    assert mesh.flipped == random.sum()
    assert len(mesh.joints.folded) == 0


@pytest.mark.parametrize("shift", [(0.5, 0.01, 0.02), (0.9, 0.01, 0.02), (0.3, 0.3, 0.3)])
def test_parts_that_fill_the_same_space_are_told(shift):
    assert len(side_by_side(shifted(BLOCK), shifted(BLOCK, *shift)).joints.doubled) > 0


def test_the_same_part_twice_in_one_place_is_told():
    joints = side_by_side(shifted(BLOCK), shifted(BLOCK)).joints
    assert len(joints.coincident) == 27
    assert (len(joints.folded), len(joints.doubled)) == (0, 80)


def test_merging_within_a_distance_joins_what_is_nearer_and_refuses_to_flatten_tets():
    mesh = side_by_side(shifted(CUBE), shifted(CUBE, 0.101, 0, 0))
    assert len(mesh.joints.coincident) == 0
    again = merged(mesh, 2e-3)
    assert (again.pieces, len(again.points)) == (1, 12)
    with pytest.raises(MeshError, match=r"joins corners of tet 0 .* below its shortest edge"):
        merged(mesh, 0.11)


def test_nets_merge_their_nodes_too():
    points = [[0, 0, 0], [1, 0, 0], [1, 0, 0], [2, 0, 0]]
    net = merged(spring_net(points, [[0, 1], [2, 3]]))
    assert (net.pieces, len(net.points), net.edges.tolist()) == (1, 3, [[0, 1], [1, 2]])
    assert net.joined.tolist() == [[2, 1]]
