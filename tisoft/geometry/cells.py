"""The kinds of cells that a solid is meshed with: corners, edges, faces, in the order of VTK.

Gmsh, Abaqus and VTK number the eight corners of a hexahedron alike: four round the bottom,
counter-clockwise seen from above, then the four above them.  The six nodes of a quadratic tet's
edges follow its corners in the order of `QUADRATIC_EDGES`, as VTK and Abaqus have them (Gmsh swaps
the last two).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

QUADRATIC_EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
"""Corners between which nodes 4..9 of a quadratic tet lie."""
LATTICE = np.array([0, 1, 3, 2, 4, 5, 7, 6])
"""Corners of a hexahedron as a lattice counts them (corner c at (c & 1, c >> 1 & 1, c >> 2)) in
VTK's order, and the other way round."""


@dataclass(frozen=True, eq=False)
class Cell:
    """One kind of cell.  Faces are seen counter-clockwise from outside."""

    word: str
    """As scene files and sentences call it."""
    corners: int
    """Nodes of a cell."""
    edges: Rows
    """Pairs of nodes that stand for its edges, shape (edges, 2)."""
    faces: Rows
    """Nodes of its faces, shape (faces, 3, 4 or 6): corners round the face, then the nodes of the
    edges that follow each of them."""


TET4 = Cell(
    "tet4",
    4,
    np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]),
    np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]),
)
SMALL = [
    [4, 5],
    [5, 6],
    [4, 6],
    [4, 7],
    [4, 8],
    [7, 8],
    [5, 8],
    [5, 9],
    [8, 9],
    [6, 7],
    [6, 9],
    [7, 9],
]
"""Sides of the small triangles on a quadratic tet's faces that lie inside the faces."""
TET10 = Cell(
    "tet10",
    10,
    np.array(
        [*([a, 4 + k] for k, ends in enumerate(QUADRATIC_EDGES.tolist()) for a in ends), *SMALL]
    ),
    np.array(
        [[1, 2, 3, 5, 9, 8], [0, 3, 2, 7, 9, 6], [0, 1, 3, 4, 8, 7], [0, 2, 1, 6, 5, 4]],
    ),
)
HEX8 = Cell(
    "hex8",
    8,
    np.array(
        [
            *([c, (c + 1) % 4] for c in range(4)),
            *([c + 4, (c + 1) % 4 + 4] for c in range(4)),
            *([c, c + 4] for c in range(4)),
        ]
    ),
    np.array(
        [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]],
    ),
)
CELLS = {cell.word: cell for cell in (TET4, TET10, HEX8)}

TRIANGLES = {
    3: np.array([[0, 1, 2]]),
    4: np.array([[0, 1, 2], [0, 2, 3]]),
    6: np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]),
}
"""Triangles that a face of so many nodes is drawn, picked and met with."""


def shape(nodes: int, a: Floats, b: Floats) -> tuple[Floats, Floats, Floats]:
    """N, ∂N/∂a, ∂N/∂b of a face's nodes at points (a, b), shape (points, nodes) each: a and b run
    over the triangle a, b, 1 − a − b ≥ 0, or over the square of −1 .. 1.
    """
    if nodes == 4:
        s, t = np.array([-1.0, 1.0, 1.0, -1.0]), np.array([-1.0, -1.0, 1.0, 1.0])
        u, v = 1.0 + np.outer(a, s), 1.0 + np.outer(b, t)
        return u * v / 4.0, s * v / 4.0, u * t / 4.0
    L = np.stack([1.0 - a - b, a, b], axis=1)
    along = np.array([[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])  # ∂L/∂a, ∂L/∂b
    if nodes == 3:
        ones = np.ones((len(a), 1))
        return L, ones * along[0], ones * along[1]
    N = np.zeros((len(a), 6))
    d = np.zeros((2, len(a), 6))
    for c in range(3):
        N[:, c] = L[:, c] * (2.0 * L[:, c] - 1.0)
        d[:, :, c] = (4.0 * L[:, c] - 1.0) * along[:, c, None]
        e = (c + 1) % 3
        N[:, 3 + c] = 4.0 * L[:, c] * L[:, e]
        d[:, :, 3 + c] = 4.0 * (L[:, c] * along[:, e, None] + L[:, e] * along[:, c, None])
    return N, d[0], d[1]


def quadrature(nodes: int) -> tuple[Floats, Floats, Floats]:
    """Points (a, b) and weights that integrate N_i (∂x/∂a × ∂x/∂b) over a face exactly."""
    if nodes == 4:
        g = np.sqrt(1.0 / 3.0)
        a, b = np.array([-g, g, -g, g]), np.array([-g, -g, g, g])
        return a, b, np.ones(4)
    # A square of Gauss points, collapsed to the triangle (Duffy): exact for degree 4.
    x, w = np.polynomial.legendre.leggauss(4)
    x, w = (x + 1.0) / 2.0, w / 2.0
    a = np.repeat(x, 4)
    b = np.tile(x, 4) * (1.0 - a)
    return a, b, np.outer(w * (1.0 - x), w).ravel()


def area_shares(points: Floats, faces: Rows) -> Floats:
    """∫ N_i dA of each face's nodes [m²], shape (faces, nodes)."""
    nodes = faces.shape[1]
    a, b, weight = quadrature(nodes)
    N, da, db = shape(nodes, a, b)
    x = points[faces]
    normal = np.cross(np.einsum("qn,fni->fqi", da, x), np.einsum("qn,fni->fqi", db, x))
    size = np.linalg.norm(normal, axis=2) * weight
    return np.asarray(size @ N)


def pressed_pairs(nodes: int) -> tuple[Rows, Floats]:
    """How a pressure acts on a face: rows (i, j, k) of its nodes and numbers c with

    ∫ N_i n dA = Σ c (x_j − x_i) × (x_k − x_i)
    """
    a, b, weight = quadrature(nodes)
    N, da, db = shape(nodes, a, b)
    turn = np.einsum("qi,qj,qk,q->ijk", N, da, db, weight)
    turn = turn - turn.transpose(0, 2, 1)
    rows = [
        (i, j, k)
        for i in range(nodes)
        for j in range(nodes)
        for k in range(j + 1, nodes)
        if i not in (j, k) and abs(turn[i, j, k]) > 1e-14
    ]
    return np.array(rows), np.array([turn[row] for row in rows])


SIGNS = np.array([[(-1) ** (bin(k & ~a).count("1")) for a in range(8)] for k in range(8)])
"""sign(k, a): the product of the local coordinates, bits of k, of corner a of a lattice's cell."""


def hex_jacobians(X: Floats, at: Floats) -> tuple[Floats, Floats]:
    """∂N/∂ξ at local coordinates `at`, shape (points, 8, 3), and J_ij = ∂X_i/∂ξ_j there, shape
    (cells, points, 3, 3), of corners X [m] in a lattice's order, shape (cells, 8, 3).
    """
    xi = SIGNS[[1, 2, 4]].T
    f = 1.0 + xi[None] * at[:, None]
    d = np.stack([xi[:, i] * f[..., (i + 1) % 3] * f[..., (i + 2) % 3] for i in range(3)], axis=2)
    return d / 8.0, np.einsum("eai,qaj->eqij", X, d / 8.0)


HEX_POINTS = SIGNS[[1, 2, 4]].T / np.sqrt(3.0)
"""The 2 x 2 x 2 points of Gauss; all weights are 1."""

TET_POINTS = (5.0 - np.sqrt(5.0)) / 20.0 + np.sqrt(0.2) * np.eye(4)
"""Volume coordinates of the four points of a quadratic tet; all weights are a quarter."""


def tet10_slopes(L: Floats) -> Floats:
    """∂N/∂L_b − ∂N/∂L_0, b = 1..3, at volume coordinates L, shape (points, 10, 3)."""
    d = np.zeros((len(L), 10, 4))
    for a in range(4):
        d[:, a, a] = 4.0 * L[:, a] - 1.0
    for k, (a, b) in enumerate(QUADRATIC_EDGES):
        d[:, 4 + k, a], d[:, 4 + k, b] = 4.0 * L[:, b], 4.0 * L[:, a]
    return d[..., 1:] - d[..., :1]


def tet10_jacobians(X: Floats) -> Floats:
    """∂X_i/∂L_j at the four points, shape (cells, 4, 3, 3), of nodes X [m], (cells, 10, 3)."""
    return np.einsum("eai,qaj->eqij", X, tet10_slopes(TET_POINTS))


def point_volumes(word: str, X: Floats) -> Floats:
    """Volume that each point of cells stands for [m³], shape (cells, points); not positive where
    a cell is folded there.  X: nodes of the cells [m], in the order of the mesh.
    """
    if word == "hex8":
        return np.linalg.det(hex_jacobians(X[:, LATTICE], HEX_POINTS)[1])
    if word == "tet10":
        return np.linalg.det(tet10_jacobians(X)) / 24.0
    return np.linalg.det(X[:, 1:] - X[:, :1])[:, None] / 6.0
