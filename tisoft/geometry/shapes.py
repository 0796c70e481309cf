"""Meshes made by rule: box, ball, cylinder of tets; cloth, grid and bare nets of springs."""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Sequence
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tisoft import checks
from tisoft.checks import FieldError
from tisoft.errors import MeshError
from tisoft.geometry import round_hexes, topology
from tisoft.geometry.cells import LATTICE
from tisoft.geometry.checks import FLAT, as_of
from tisoft.geometry.mesh import Floats, SpringNet, TetMesh, bare_net
from tisoft.geometry.quality import signed_volumes
from tisoft.geometry.solid import SolidMesh

Rows = NDArray[np.int64]

# Corner c of a cell lies at (c & 1, c >> 1 & 1, c >> 2).
_CORNERS = np.array([[c & 1, c >> 1 & 1, c >> 2] for c in range(8)])
_FIVE_EVEN = [(0, 1, 2, 4), (3, 1, 7, 2), (5, 1, 4, 7), (6, 2, 7, 4), (1, 2, 4, 7)]
_FIVE_ODD = [(1, 0, 5, 3), (2, 0, 3, 6), (4, 0, 6, 5), (7, 3, 5, 6), (0, 3, 6, 5)]
# Six tets round the diagonal 0-7: one for each order in which x, y, z are stepped.
_SIX = [(0, 1 << p, 1 << p | 1 << q, 7) for p, q, _ in itertools.permutations(range(3))]

_MOST_CELLS = 50_000_000


@overload
def box(
    size: Sequence[float], cells: Sequence[int], *, split: Literal["five", "six"] = "five"
) -> TetMesh: ...
@overload
def box(size: Sequence[float], cells: Sequence[int], *, split: Literal["hex"]) -> SolidMesh: ...
def box(size: Sequence[float], cells: Sequence[int], *, split: str = "five") -> TetMesh | SolidMesh:
    """A box with one corner at the origin, cut into cells[0] x cells[1] x cells[2] cells.

    `size` [m]; node (i, j, k) has number i + (nx + 1) (j + (ny + 1) k).  split "five" cuts each
    cell into five tets, mirrored from cell to cell; "six" into six round the (1, 1, 1) diagonal,
    which is much stiffer and lopsided.  Linear tets are too stiff in bending: two elements through
    the thickness give 33 % too little deflection, four 11 %, eight 3 %.  split "hex" makes each
    cell a hexahedron: one through the thickness bends to 2 %.  Raises MeshError.
    """
    with as_of("box"):
        checks.choice("split", split, ("five", "six", "hex"))
    lengths, counts = _lengths("box", "size", size, 3), _counts("box", "cells", cells, 3)
    if (axis := flat_axis(lengths, counts)) is not None:
        thin, wide = lengths[axis] / counts[axis], max(map(operator.truediv, lengths, counts))
        raise MeshError(f"box would have cells of {thin:.3g} m by {wide:.3g} m, too flat for tets")
    corners = _cell_corners(counts)
    if split == "hex":
        return _of_hexes(_lattice(lengths, counts), corners[:, LATTICE])
    tets = _five_tets(corners, counts) if split == "five" else corners[:, _oriented(_SIX)]
    return _whole(_lattice(lengths, counts), tets.reshape(-1, 4))


@overload
def ball(radius: float, resolution: int, *, split: Literal["tets"] = "tets") -> TetMesh: ...
@overload
def ball(radius: float, resolution: int, *, split: Literal["hex"]) -> SolidMesh: ...
def ball(radius: float, resolution: int, *, split: str = "tets") -> TetMesh | SolidMesh:
    """A ball round the origin, of 20 resolution³ tets.

    `radius` [m]; `resolution` elements along the radius.  An icosahedron's 20 cones are cut into
    concentric shells, so every node lies on a sphere about the origin.  split "hex" makes about
    5 resolution³ hexahedra: a block in the middle, layers around it.  Raises MeshError.
    """
    length, shells = _length("ball", "radius", radius), _count("ball", "resolution", resolution)
    if _is_hex("ball", split):
        _refuse_too_many("ball", 5 * shells**3)
        return _of_hexes(*round_hexes.hex_ball(length, shells))
    _refuse_too_many("ball", 20 * shells**3)
    vertices, faces = _icosahedron()
    steps, tets = _cut_cone(shells)
    # A node is named by its steps towards each of the 12 vertices: cones share these names.
    names = np.zeros((len(faces), len(steps), len(vertices)), dtype=np.int16)
    for cone, face in enumerate(faces):
        names[cone][:, face] = steps
    names, merged = np.unique(names.reshape(-1, len(vertices)), axis=0, return_inverse=True)
    directions = names @ vertices
    norms = np.linalg.norm(directions, axis=1, keepdims=True)
    norms[0] = 1.0  # the centre comes first: no step at all
    points = directions / norms * (names.sum(axis=1)[:, None] * (length / shells))
    corners = np.arange(len(faces))[:, None, None] * len(steps) + tets
    return _whole(points, merged.reshape(-1)[corners.reshape(-1, 4)])


@overload
def cylinder(
    radius: float, height: float, resolution: int, *, split: Literal["tets"] = "tets"
) -> TetMesh: ...
@overload
def cylinder(
    radius: float, height: float, resolution: int, *, split: Literal["hex"]
) -> SolidMesh: ...
def cylinder(
    radius: float, height: float, resolution: int, *, split: str = "tets"
) -> TetMesh | SolidMesh:
    """A cylinder about the y axis, standing on y = 0.

    `radius`, `height` [m]; `resolution` elements along the radius and as many layers as make them
    as high as wide.  Six sectors are cut into rings; prisms are cut into three tets, mirrored from
    layer to layer.  split "hex" makes about 3 resolution² hexahedra a layer.  Raises MeshError.
    """
    length = _length("cylinder", "radius", radius)
    tall = _length("cylinder", "height", height)
    rings = _count("cylinder", "resolution", resolution)
    layers = max(1.0, float(np.rint(tall / (length / rings))))
    _refuse_too_many("cylinder", 18 * rings**2 * layers)
    if _is_hex("cylinder", split):
        return _of_hexes(*round_hexes.hex_cylinder(length, tall, rings))
    disc, triangles = _disc(rings)
    levels = np.arange(int(layers) + 1)
    points = np.empty((len(levels), len(disc), 3))
    points[..., 0] = disc[:, 0] * length
    points[..., 1] = np.linspace(0.0, tall, len(levels))[:, None]
    points[..., 2] = disc[:, 1] * length
    # Corners ascending: a diagonal then depends on its two nodes alone, so neighbours agree.
    low = np.sort(triangles, axis=1)
    prisms = []
    for level in levels[:-1]:
        a, b, c = (low if level % 2 == 0 else low[:, ::-1]).T + level * len(disc)
        top_a, top_b, top_c = a + len(disc), b + len(disc), c + len(disc)
        rows = [(a, b, c, top_c), (a, b, top_b, top_c), (a, top_a, top_b, top_c)]
        prisms.append(np.stack([np.stack(row, axis=1) for row in rows], axis=1).reshape(-1, 4))
    return _whole(points.reshape(-1, 3), np.concatenate(prisms))


def cloth(size: Sequence[float], cells: Sequence[int], *, diagonals: bool = True) -> SpringNet:
    """A sheet of springs in the x-z plane, one corner at the origin; its front faces +y.

    `size` [m] and `cells` along x and z; node (i, k) has number i + (nx + 1) k.  Springs along the
    cells' sides and, with `diagonals`, along both diagonals of each cell.  Raises MeshError.
    """
    width, depth = _lengths("cloth", "size", size, 2)
    across, along = _counts("cloth", "cells", cells, 2)
    diagonals = _flag("cloth", "diagonals", diagonals)
    numbers = np.arange((across + 1) * (along + 1)).reshape(along + 1, across + 1)
    corners = np.stack(
        [numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, :-1], numbers[1:, 1:]], axis=-1
    ).reshape(-1, 4)
    x, z = np.linspace(0.0, width, across + 1), np.linspace(0.0, depth, along + 1)
    points = np.zeros((len(z), len(x), 3))
    points[..., 0], points[..., 2] = x, z[:, None]
    pairs = [(0, 1), (2, 3), (0, 2), (1, 3)] + ([(0, 3), (1, 2)] if diagonals else [])
    edges = topology.unique_edges(corners[:, pairs])
    odd = (np.add.outer(np.arange(along), np.arange(across)) % 2 == 1).ravel()
    halves = np.where(
        odd[:, None, None],
        corners[:, [(0, 2, 3), (0, 3, 1)]],
        corners[:, [(0, 2, 1), (1, 2, 3)]],
    )
    return bare_net(points.reshape(-1, 3), edges, halves.reshape(-1, 3))


def grid(size: Sequence[float], cells: Sequence[int], *, diagonals: bool = True) -> SpringNet:
    """A block of springs with one corner at the origin; nodes numbered as in `box`.

    `size` [m] and `cells` along x, y, z.  Springs along the cells' sides and, with `diagonals`,
    along both diagonals of every cell face, which makes it rigid.  Raises MeshError.
    """
    lengths, counts = _lengths("grid", "size", size, 3), _counts("grid", "cells", cells, 3)
    diagonals = _flag("grid", "diagonals", diagonals)
    apart = np.abs(_CORNERS[:, None] - _CORNERS[None]).sum(axis=2)
    reach = 2 if diagonals else 1
    pairs = [(a, b) for a in range(8) for b in range(a + 1, 8) if apart[a, b] <= reach]
    corners = _cell_corners(counts)
    return bare_net(
        _lattice(lengths, counts),
        topology.unique_edges(corners[:, pairs]),
        topology.boundary_faces(_five_tets(corners, counts).reshape(-1, 4)),
    )


def net(points: ArrayLike, springs: ArrayLike) -> SpringNet:
    """A bare net: `points` [m], shape (nodes, 3), joined by `springs`, rows of two node numbers.

    Nodes and springs keep their order and number; a node may be without springs.  Raises MeshError.
    """
    return bare_net(points, springs)


def flat_axis(lengths: Sequence[float], counts: Sequence[int]) -> int | None:
    """Axis along which a lattice's cells are too thin for tets; None where they are not."""
    sides = [length / count for length, count in zip(lengths, counts, strict=True)]
    thin, *others = sorted(sides)
    return sides.index(thin) if thin < FLAT * math.hypot(*others) else None


def _is_hex(shape: str, split: str) -> bool:
    with as_of(shape):
        return checks.choice("split", split, ("tets", "hex")) == "hex"


def _of_hexes(points: Floats, hexes: Rows) -> SolidMesh:
    return SolidMesh(points, np.arange(len(points)), hexes=hexes.astype(np.int32))


def _whole(points: Floats, tets: Rows) -> TetMesh:
    """A TetMesh that uses all points; tets that a mirrored rule turned round are turned back."""
    turned = signed_volumes(points, tets) < 0.0
    tets[turned] = tets[turned][:, [0, 1, 3, 2]]
    return TetMesh(points, tets.astype(np.int32), np.arange(len(points)))


def _lattice(lengths: list[float], counts: list[int]) -> Floats:
    """Nodes of a box lattice, x fastest, shape (nodes, 3)."""
    x, y, z = (np.linspace(0.0, length, n + 1) for length, n in zip(lengths, counts, strict=True))
    points = np.empty((len(z), len(y), len(x), 3))
    points[..., 0], points[..., 1], points[..., 2] = x, y[:, None], z[:, None, None]
    return points.reshape(-1, 3)


def _cell_steps(counts: list[int]) -> tuple[Rows, Rows, Rows]:
    """(i, j, k) of every cell, i fastest."""
    nx, ny, nz = counts
    cell = np.arange(nx * ny * nz)
    return cell % nx, cell // nx % ny, cell // (nx * ny)


def _cell_corners(counts: list[int]) -> Rows:
    """The eight nodes of every cell, shape (cells, 8)."""
    nx, ny, _ = counts
    i, j, k = _cell_steps(counts)
    strides = np.array([1, nx + 1, (nx + 1) * (ny + 1)])
    return (i + strides[1] * j + strides[2] * k)[:, None] + _CORNERS @ strides


def _five_tets(corners: Rows, counts: list[int]) -> Rows:
    i, j, k = _cell_steps(counts)
    even = ((i + j + k) % 2 == 0)[:, None, None]
    return np.where(even, corners[:, _oriented(_FIVE_EVEN)], corners[:, _oriented(_FIVE_ODD)])


def _oriented(rows: list[tuple[int, int, int, int]]) -> Rows:
    """The rows of cell corners, each with positive volume (last two swapped where needed)."""
    tets = np.array(rows)
    turned = signed_volumes(_CORNERS.astype(float), tets) < 0.0
    tets[turned] = tets[turned][:, [0, 1, 3, 2]]
    return tets


def _cut_cone(shells: int) -> tuple[Rows, Rows]:
    """A cone over a triangle cut into shells³ tets: the nodes' lattice coordinates and the tets.

    Coordinates (a, b, c) count steps along the cone's three sides; a + b + c is the shell.  The cut
    is Freudenthal's: cubes of the lattice x >= y >= z with x = a + b + c, y = b + c, z = c.
    """
    axis = np.arange(shells + 1)
    x, y, z = (values.ravel() for values in np.meshgrid(axis, axis, axis, indexing="ij"))
    inside = (x >= y) & (y >= z)
    number = np.cumsum(inside) - 1
    cells = np.stack([x, y, z], axis=1)[inside & (x < shells)]
    corners = cells[:, None, None] + _CORNERS[np.array(_SIX)]
    tets = corners[(np.diff(corners, axis=-1) <= 0).all(axis=(2, 3))]
    side = shells + 1
    rows = number[(tets[..., 0] * side + tets[..., 1]) * side + tets[..., 2]]
    return np.stack([x - y, y - z, z], axis=1)[inside], rows


def _icosahedron() -> tuple[Floats, Rows]:
    """The 12 vertices on the unit sphere and the 20 faces."""
    golden = (1.0 + math.sqrt(5.0)) / 2.0
    signs = list(itertools.product((-1.0, 1.0), (-golden, golden)))
    vertices = np.array(
        [p for s, g in signs for p in ((0.0, s, g), (s, g, 0.0), (g, 0.0, s))]
    ) / math.hypot(1.0, golden)
    near = np.linalg.norm(vertices[:, None] - vertices[None], axis=2) < 1.1
    triples = itertools.combinations(range(12), 3)
    faces = [t for t in triples if near[t[0], t[1]] and near[t[1], t[2]] and near[t[0], t[2]]]
    return vertices, np.array(faces)


def _disc(rings: int) -> tuple[Floats, Rows]:
    """Unit disc of six sectors cut into rings: nodes, shape (nodes, 2), and 6 rings² triangles."""
    radii = np.concatenate([[0.0]] + [np.full(6 * r, r / rings) for r in range(1, rings + 1)])
    turns = np.concatenate([[0.0]] + [np.arange(6 * r) / (6 * r) for r in range(1, rings + 1)])
    angles = 2.0 * np.pi * turns
    triangles = []
    for ring in range(rings):
        sector, step = (values.ravel() for values in np.mgrid[0:6, 0 : ring + 1])
        inner, inner_next = (_on_ring(ring, sector * ring + step + d) for d in (0, 1))
        outer, outer_next = (_on_ring(ring + 1, sector * (ring + 1) + step + d) for d in (0, 1))
        triangles.append(np.stack([inner, outer, outer_next], axis=1))
        between = step < ring
        triangles.append(np.stack([inner, outer_next, inner_next], axis=1)[between])
    points = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    return points, np.concatenate(triangles)


def _on_ring(ring: int, position: Rows) -> Rows:
    """Number of the node at a position of a ring of 6 ring nodes; ring 0 is the centre."""
    if ring == 0:
        return np.zeros_like(position)
    return 1 + 3 * ring * (ring - 1) + position % (6 * ring)


def _lengths(shape: str, key: str, values: Any, wanted: int) -> list[float]:
    with as_of(shape):
        return list(checks.numbers(key, values, wanted, "lengths in m", above=0.0, unit="m"))


def _length(shape: str, key: str, value: Any) -> float:
    with as_of(shape):
        return checks.number(key, value, above=0.0, unit="m")


def _counts(shape: str, key: str, values: Any, wanted: int) -> list[int]:
    with as_of(shape):
        items = checks.sequence(key, values, "whole numbers")
        if len(items) != wanted:
            raise FieldError(key, f"must be {wanted} whole numbers, not {len(items)}", values)
        counts = [checks.integer(f"{key}[{i}]", n, least=1) for i, n in enumerate(items)]
    _refuse_too_many(shape, math.prod(counts))
    return counts


def _count(shape: str, key: str, value: Any) -> int:
    with as_of(shape):
        return checks.integer(key, value, least=1)


def _flag(shape: str, key: str, value: Any) -> bool:
    with as_of(shape):
        return checks.flag(key, value)


def _refuse_too_many(shape: str, cells: float) -> None:
    if cells > _MOST_CELLS:
        raise MeshError(f"{shape} would have {cells:.3g} cells; take at most {_MOST_CELLS:,}")
