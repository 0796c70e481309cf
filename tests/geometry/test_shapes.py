"""Shapes made by rule: numbering, volume, orientation, closed surfaces."""

import numpy as np
import pytest

from tisoft.errors import MeshError
from tisoft.geometry.mesh import TetMesh
from tisoft.geometry.quality import altitudes, quality
from tisoft.geometry.shapes import ball, box, cloth, cylinder, grid, net
from tisoft.geometry.surface import closed, solid_moments

SOLIDS = {
    "five": (box((1.0, 0.2, 0.3), (4, 3, 5)), 0.06),
    "six": (box((1.0, 0.2, 0.3), (4, 3, 5), split="six"), 0.06),
    "ball": (ball(0.5, 6), 4.0 / 3.0 * np.pi * 0.125),
    "cylinder": (cylinder(0.5, 2.0, 6), 0.5 * np.pi),
}


def enclosed_volume(mesh: TetMesh) -> float:
    a, b, c = mesh.points[mesh.surface].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


@pytest.mark.parametrize(
    ("split", "tets"),
    [
        (
            "six",
            [[0, 1, 3, 7], [0, 1, 7, 5], [0, 2, 7, 3], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 7, 6]],
        ),
        ("five", [[0, 1, 2, 4], [3, 1, 7, 2], [5, 1, 4, 7], [6, 2, 7, 4], [1, 2, 4, 7]]),
    ],
)
def test_one_cell_is_numbered_as_the_references_number_it(split, tets):
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1), split=split)
    assert mesh.tets.tolist() == tets
    assert np.array_equal(mesh.points[1], [1, 0, 0])
    assert np.array_equal(mesh.points[6], [0, 1, 1])


def test_five_tet_cells_are_mirrored_where_the_sum_of_steps_is_odd():
    mesh = box((2.0, 1.0, 1.0), (2, 1, 1))
    second = [[2, 1, 8, 5], [4, 1, 5, 10], [7, 1, 10, 8], [11, 5, 8, 10], [1, 5, 10, 8]]
    assert mesh.tets[5:].tolist() == second


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_filled_without_overlap(name):
    mesh, volume = SOLIDS[name]
    assert (mesh.volumes > 0).all()
    assert mesh.volumes.sum() == pytest.approx(volume, rel=0.02)
    assert enclosed_volume(mesh) == pytest.approx(mesh.volumes.sum(), rel=1e-12)
    assert mesh.pieces == 1
    assert mesh.flipped == mesh.dropped_nodes == 0


@pytest.mark.parametrize("name", SOLIDS)
def test_surfaces_are_closed(name):
    mesh, _ = SOLIDS[name]
    sides = mesh.surface[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    there = {tuple(side) for side in sides.tolist()}
    assert len(there) == len(sides)
    assert all((b, a) in there for a, b in there)
    nodes = len(np.unique(mesh.surface))
    assert nodes - len(sides) // 2 + len(mesh.surface) == 2  # Euler


def test_ball_and_cylinder_keep_their_quality_when_refined():
    for resolution in (1, 2, 5, 9):
        assert quality(ball(1.0, resolution)).min() > 0.5
        assert quality(cylinder(1.0, 1.5, resolution)).min() > 0.5


@pytest.mark.parametrize("resolution", [1, 2, 5])
def test_balls_and_cylinders_of_hexahedra(resolution):
    """Whole, closed, on their surface, of cells that are alike."""
    round_, tall = ball(0.5, resolution, split="hex"), cylinder(0.5, 1.0, resolution, split="hex")
    for mesh, volume, away in (
        (round_, np.pi / 6, np.linalg.norm(round_.points, axis=1)),
        (tall, np.pi / 4, np.hypot(tall.points[:, 0], tall.points[:, 2])),
    ):
        assert mesh.pieces == 1
        assert away.max() == pytest.approx(0.5)
        assert mesh.volumes.sum() == pytest.approx(volume, rel=1.4 / resolution**2)
        assert mesh.volumes.sum() < volume
        assert mesh.volumes.max() < 4.2 * mesh.volumes.min()
        solid = solid_moments(mesh.points, mesh.surface.astype(np.int64))[0]
        assert solid == pytest.approx(mesh.volumes.sum(), rel=0.02)  # quads drawn as triangles
        closed(mesh.points, mesh.surface.astype(np.int64))
    assert np.ptp(tall.points[:, 1]) == 1.0


def test_every_surface_node_of_a_ball_lies_on_its_sphere():
    mesh = ball(0.3, 4)
    radii = np.linalg.norm(mesh.points[np.unique(mesh.surface)], axis=1)
    assert radii == pytest.approx(0.3, rel=1e-12)
    assert len(mesh.tets) == 20 * 4**3


def test_quality_is_one_for_a_regular_tet_and_ignores_size():
    points = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=float)
    for size in (1e-6, 1.0, 1e6):
        mesh = TetMesh(size * points, np.array([[0, 2, 1, 3]]), np.arange(4))
        assert quality(mesh) == pytest.approx(1.0)
        assert altitudes(mesh) == pytest.approx(size * 4.0 / np.sqrt(3.0))


def test_cloth_has_sides_diagonals_and_a_face_upward():
    sheet = cloth((2.0, 1.0), (4, 3))
    assert len(sheet.edges) == 4 * 4 + 5 * 3 + 2 * 12
    assert len(cloth((2.0, 1.0), (4, 3), diagonals=False).edges) == 4 * 4 + 5 * 3
    a, b, c = sheet.points[sheet.surface].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    assert (normals[:, 1] > 0).all()
    assert normals[:, 1].sum() / 2.0 == pytest.approx(2.0)
    assert len(sheet.tets) == 0


def test_grid_joins_faces_by_both_diagonals():
    block = grid((1.0, 1.0, 1.0), (2, 2, 2))
    assert len(block.edges) == 54 + 2 * 36
    assert len(grid((1, 1, 1), (2, 2, 2), diagonals=False).edges) == 54
    assert len(block.surface) == 6 * 4 * 2


def test_bare_net_keeps_the_order_of_nodes_and_springs():
    pair = net([[0.7, 0, 0], [0, 0, 0], [0, 5, 0]], [[1, 0]])
    assert pair.edges.tolist() == [[1, 0]]
    assert pair.pieces == 2
    assert len(net([[0, 0, 0]], []).edges) == 0


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: box((1, 0, 1), (1, 1, 1)), r"box.size\[1\] = 0 must be above 0 m"),
        (lambda: box((1, 1, float("nan")), (1, 1, 1)), "finite"),
        (lambda: box((1, 1), (1, 1, 1)), "must be 3 lengths in m, not 2"),
        (lambda: box((1, 1, 1), (1, 0, 1)), "at least 1"),
        (lambda: box((1, 1, 1), (1, 1.5, 1)), "whole number"),
        (lambda: box((1, 1, 1), (9999, 9999, 9999)), "at most"),
        (lambda: box((1, 1, 1), (1, 1, 1), split="seven"), "use one of five, six, hex"),
        (lambda: ball(-1.0, 3), "ball.radius = -1.0 must be above 0 m"),
        (lambda: ball(1.0, 0), "at least 1"),
        (lambda: cylinder(1.0, 1e9, 50), "at most"),
        (lambda: cloth((1, 1), (2,)), "must be 2 whole numbers, not 1"),
        (lambda: net([[0, 0, 0], [1, 0, 0]], [[0, 2]]), "uses node 2"),
        (lambda: net([[0, 0, 0], [1, 0, 0]], [[0, 0]]), "without length"),
        (lambda: net([[0, 0], [1, 0]], [[0, 1]]), "three numbers"),
        (lambda: net([[0, 0, 0], [1, 0, float("inf")]], [[0, 1]]), "finite"),
    ],
)
def test_impossible_shapes_are_refused_in_a_sentence(make, words):
    with pytest.raises(MeshError, match=words):
        make()
