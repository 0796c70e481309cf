"""Mechanisms of spring networks: counted, shown, and braced."""

from itertools import combinations, permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from tisoft.errors import MeshError
from tisoft.geometry.bracing import mechanism, missing_springs, moving_nodes
from tisoft.geometry.rigidity import rigidity

TURN = Rotation.from_euler("xyz", [0.3, 1.1, -0.7]).as_matrix()


def lattice(nx, ny, nz=0):
    """Unit grid with springs along its axes only."""
    ids = np.arange((nx + 1) * (ny + 1) * (nz + 1)).reshape(nz + 1, ny + 1, nx + 1)
    z, y, x = np.meshgrid(*(np.arange(n + 1.0) for n in (nz, ny, nx)), indexing="ij")
    along = [(ids[:, :, 1:], ids[:, :, :-1]), (ids[:, 1:], ids[:, :-1]), (ids[1:], ids[:-1])]
    springs = [np.stack((a.ravel(), b.ravel()), axis=1) for a, b in along]
    return np.stack((x.ravel(), y.ravel(), z.ravel()), axis=1), np.concatenate(springs)


def tet_edges(nx, ny, nz):
    """Edges of cells split into 6 tets each around a diagonal."""
    points, _ = lattice(nx, ny, nz)
    step = np.array([1, nx + 1, (nx + 1) * (ny + 1)])
    cells = (points[(points < [nx, ny, nz]).all(axis=1)] @ step).astype(int)
    corners = [np.cumsum([0, *step[list(order)]]) for order in permutations(range(3))]
    pairs = {(a, b) for path in corners for a, b in combinations(path, 2)}
    edges = np.concatenate([cells[:, None] + np.array(pair) for pair in sorted(pairs)])
    return points, np.unique(edges, axis=0)


def strain(points, springs, motion):
    across = points[springs[:, 0]] - points[springs[:, 1]]
    unit = across / np.linalg.norm(across, axis=1, keepdims=True)
    return np.einsum("si,si->s", unit, motion[springs[:, 0]] - motion[springs[:, 1]])


def modes_by_svd(points, springs):
    """3N − rank R − rank of the rigid motions of every piece, all dense."""
    size = len(points)
    graph = coo_array((np.ones(len(springs)), springs.T), (size, size))
    across = points[springs[:, 0]] - points[springs[:, 1]]
    springs, across = springs[across.any(axis=1)], across[across.any(axis=1)]
    rows = np.zeros((len(springs), size, 3))
    unit = across / np.linalg.norm(across, axis=1, keepdims=True)
    rows[np.arange(len(springs)), springs[:, 0]] = unit
    rows[np.arange(len(springs)), springs[:, 1]] -= unit
    _, label = connected_components(graph, directed=False)
    rank = np.linalg.matrix_rank(rows.reshape(-1, 3 * size), tol=1e-6) if len(springs) else 0
    for piece in range(label.max() + 1):
        x = points[label == piece]
        moves = [np.broadcast_to(axis, x.shape) for axis in np.eye(3)]
        moves += [np.cross(axis, x - x.mean(axis=0)) for axis in np.eye(3)]
        rank += np.linalg.matrix_rank(np.stack([m.ravel() for m in moves]), tol=1e-6)
    return 3 * size - rank


@pytest.mark.parametrize("n", [1, 2, 4, 8])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("turn", [np.eye(3), TURN])
def test_square_grid_has_2n_minus_1_mechanisms_in_its_plane(n, scale, turn):
    points, springs = lattice(n, n)
    counted = rigidity(scale * points @ turn.T + 5.0 * scale, springs)
    assert counted.in_plane == 2 * n - 1
    # Out of the plane only three rigid motions are left of the N free shifts.
    assert counted.zero_energy_modes == 2 * n - 1 + len(points) - 3
    assert [piece.kind for piece in counted.pieces] == ["flat"]


@pytest.mark.parametrize("n", [1, 2, 4, 8])
def test_one_diagonal_per_cell_makes_a_square_grid_rigid_in_its_plane(n):
    points, springs = lattice(n, n)
    points = points @ TURN.T
    diagonals = missing_springs(points, springs)
    assert len(diagonals) == n * n
    reach = np.linalg.norm(points[diagonals[:, 0]] - points[diagonals[:, 1]], axis=1)
    np.testing.assert_allclose(reach, np.sqrt(2.0))
    braced = rigidity(points, np.concatenate((springs, diagonals)))
    assert braced.in_plane == 0
    assert braced.zero_energy_modes == len(points) - 3
    assert braced.warning("cloth") is None


@pytest.mark.parametrize(("n", "modes"), [(1, 6), (2, 21)])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_cubes_of_axis_springs_alone_collapse_and_face_diagonals_hold_them(n, modes, scale):
    points, springs = lattice(n, n, n)
    points = scale * points @ TURN.T
    counted = rigidity(points, springs)
    assert (counted.zero_energy_modes, counted.in_plane) == (modes, None)
    diagonals = missing_springs(points, springs)
    assert len(diagonals) == 3 * n * n * (n + 1)
    assert rigidity(points, np.concatenate((springs, diagonals))).zero_energy_modes == 0


def test_edges_of_tets_have_no_mechanism():
    for cells in [(1, 1, 1), (3, 4, 5), (1, 1, 300)]:
        points, springs = tet_edges(*cells)
        assert rigidity(points @ TURN.T, springs).zero_energy_modes == 0
        assert len(missing_springs(points, springs)) == 0


def test_long_strip_with_diagonals_is_rigid_however_softly_it_bends():
    points, springs = lattice(1, 3000)
    diagonals = np.array([(2 * i, 2 * i + 3) for i in range(3000)])
    assert rigidity(points, springs).in_plane == 3000
    assert rigidity(points, np.concatenate((springs, diagonals))).in_plane == 0


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_count_agrees_with_dense_svd(data):
    size = data.draw(st.integers(1, 14))
    corner = st.tuples(*[st.integers(0, 3)] * 3)
    points = np.array(data.draw(st.lists(corner, min_size=size, max_size=size)), float)
    node = st.integers(0, size - 1)
    drawn = data.draw(st.lists(st.tuples(node, node), max_size=45))
    springs = np.array(drawn, int).reshape(-1, 2)
    clean = np.unique(np.sort(springs, axis=1), axis=0)
    modes = modes_by_svd(points, clean[clean[:, 0] != clean[:, 1]])
    assert rigidity(points, springs).zero_energy_modes == modes
    assert rigidity(1e3 * points @ TURN.T, springs).zero_energy_modes == modes


@pytest.mark.parametrize("seed", range(8))
def test_count_agrees_with_dense_svd_over_many_fronts(seed):
    random = np.random.default_rng(seed)
    points, springs = tet_edges(4, 3, 6)
    if seed % 2:
        points = points + 0.2 * random.random(points.shape)
    springs = springs[random.random(len(springs)) < (0.97, 0.85, 0.7, 0.5)[seed // 2]]
    counted = rigidity(points, springs)
    assert counted.zero_energy_modes == modes_by_svd(points, springs)
    braced = np.concatenate((springs, missing_springs(points, springs)))
    assert rigidity(points, braced).mechanisms == 0


def test_two_pieces_add_up_and_each_tells_its_own():
    square, ring = lattice(2, 2)
    cube, bars = lattice(1, 1, 1)
    points = np.concatenate((square @ TURN.T, cube + 7.0))
    counted = rigidity(points, np.concatenate((ring, bars + len(square))))
    assert [(p.kind, p.modes, p.in_plane) for p in counted.pieces] == [
        ("flat", 9, 3),
        ("solid", 6, None),
    ]
    assert (counted.zero_energy_modes, counted.in_plane, counted.mechanisms) == (15, 3, 9)
    np.testing.assert_array_equal(counted.pieces[1].nodes, np.arange(9, 17))


@pytest.mark.parametrize("size", [2, 3, 10, 200])
def test_chain_on_a_line_swings_sideways_without_a_warning(size):
    points = np.outer(np.arange(size) ** 1.5, TURN[0])
    springs = np.stack((np.arange(size - 1), np.arange(1, size)), axis=1)
    counted = rigidity(points, springs)
    # N sideways shifts in two directions, less two shifts and two turns of the whole.
    assert counted.zero_energy_modes == 2 * size - 4
    assert counted.pieces[0].kind == "line"
    assert counted.in_plane is None
    assert counted.warning("rope") is None
    assert not mechanism(points, springs, counted).any()
    assert len(missing_springs(points, springs)) == 0


def test_points_without_springs_are_rigid():
    counted = rigidity([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], [])
    assert [(piece.kind, piece.modes) for piece in counted.pieces] == [("point", 0), ("point", 0)]
    assert rigidity(np.empty((0, 3)), []).zero_energy_modes == 0


def test_collinear_nodes_inside_a_flat_piece_add_a_mechanism_when_a_bar_is_hinged():
    triangle = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [1, 0, 0]])
    rigid = [(0, 1), (1, 2), (0, 2)]
    hinged = rigidity(triangle @ TURN.T, [*rigid, (0, 3), (3, 1)])
    assert hinged.in_plane == 1
    assert rigidity(triangle @ TURN.T, [*rigid, (0, 3), (3, 1), (3, 2)]).in_plane == 0


@pytest.mark.parametrize(("rise", "kind"), [(1e-9, "flat"), (1e-3, "solid")])
def test_almost_flat_piece_is_flat_only_within_rounding(rise, kind):
    points, springs = lattice(4, 4)
    points[:, 2] = rise * np.sin(points[:, 0]) * np.cos(2.0 * points[:, 1])
    counted = rigidity(points @ TURN.T, springs)
    assert counted.pieces[0].kind == kind
    assert (counted.in_plane is None) == (kind == "solid")
    assert counted.zero_energy_modes == 29


def test_single_precision_coordinates_keep_the_counts():
    points, springs = lattice(30, 30)
    rounded = (points @ TURN.T * 0.01).astype(np.float32).astype(np.float64)
    assert rigidity(rounded, springs).in_plane == 59


def test_repeated_reversed_and_zero_length_springs_resist_nothing_more():
    points, springs = lattice(1, 1, 1)
    repeated = np.concatenate((springs, springs[:, ::-1], [(3, 3)]))
    assert rigidity(points, repeated).zero_energy_modes == 6
    # A node on top of another, tied by a spring without length, is free in three directions.
    tied = rigidity(np.vstack((points, points[:1])), np.vstack((springs, [(0, 8)])))
    assert len(tied.pieces) == 1
    assert tied.zero_energy_modes == 9


def test_mechanism_of_a_grid_slides_one_row_along_itself():
    points, springs = lattice(8, 8)
    points = points @ TURN.T
    counted = rigidity(points, springs)
    motion = mechanism(points, springs, counted)
    assert np.abs(strain(points, springs, motion)).max() < 1e-9
    assert np.linalg.norm(motion, axis=1).max() == pytest.approx(1.0)
    assert np.abs(motion @ TURN[:, 2]).max() < 1e-9  # stays in the plane
    centred = points - points.mean(axis=0)
    assert np.abs(motion.sum(axis=0)).max() < 1e-9
    assert np.abs(np.cross(centred, motion).sum(axis=0)).max() < 1e-9
    moving = moving_nodes(motion)
    assert len(moving) == 9
    assert len(set(moving % 9)) == 1 or len(set(moving // 9)) == 1


def test_mechanism_names_the_one_loose_node_of_a_solid():
    points, springs = tet_edges(3, 3, 3)
    points = np.vstack((points, [5.0, 5.0, 5.0]))
    springs = np.vstack((springs, [(0, 64)]))
    counted = rigidity(points, springs)
    assert counted.zero_energy_modes == 2
    motion = mechanism(points, springs, counted)
    assert moving_nodes(motion).tolist() == [64]
    extra = missing_springs(points, springs)
    assert len(extra) == 2
    assert (extra == 64).any(axis=1).all()
    assert rigidity(points, np.vstack((springs, extra))).zero_energy_modes == 0


def test_only_cells_that_shear_are_braced():
    points, springs = lattice(4, 4)
    every = missing_springs(points, springs)
    open_row = every[np.floor(points[every].mean(axis=1)[:, 1]) != 2.0]
    springs = np.concatenate((springs, open_row))
    assert rigidity(points, springs).in_plane == 1
    added = missing_springs(points, springs)
    assert set(map(tuple, added)) == set(map(tuple, every)) - set(map(tuple, open_row))


def test_honeycomb_gets_as_many_springs_as_it_has_mechanisms():
    points, springs = lattice(9, 8)
    low = springs.min(axis=1)
    bricks = (springs[:, 0] - springs[:, 1] == 1) | ((low % 10 + low // 10) % 2 == 0)
    counted = rigidity(points, springs[bricks])
    added = missing_springs(points, springs[bricks])
    assert len(added) == counted.mechanisms > 20
    assert rigidity(points, np.concatenate((springs[bricks], added))).mechanisms == 0


def test_warning_says_how_many_which_nodes_and_what_helps():
    points, springs = lattice(2, 2)
    counted = rigidity(points, springs)
    extra = missing_springs(points, springs)
    text = counted.warning(
        "cloth",
        moving=moving_nodes(mechanism(points, springs, counted)),
        missing=extra,
        after=rigidity(points, np.concatenate((springs, extra))),
    )
    assert text is not None
    assert text.startswith('body "cloth" has 3 mechanisms in its plane: motions that no spring')
    assert "the worst moves" in text
    assert text.endswith("4 more springs would remove them")


def test_input_that_is_no_network_is_named():
    with pytest.raises(MeshError, match="spring 1 joins nodes 1 and 2; nodes are 0 to 1"):
        rigidity(np.eye(3)[:2], [(0, 1), (1, 2)])
    with pytest.raises(MeshError, match="node 1 has coordinates"):
        rigidity([[0.0, 0, 0], [0, np.nan, 0]], [(0, 1)])


@pytest.mark.slow
@pytest.mark.parametrize("net", [tet_edges(14, 14, 14), lattice(100, 100), lattice(18, 18, 18)])
def test_twenty_thousand_springs_are_counted(net):
    counted = rigidity(*net)
    assert counted.mechanisms == {21014: 0, 20200: 199, 19494: 1077}[len(net[1])]
