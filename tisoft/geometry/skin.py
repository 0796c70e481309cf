"""A fine surface carried by a coarse mesh.

Every point of the surface has the shape functions w of the cell that holds it, or of the nearest
one, so that it moves as that cell does: x = Σ w_k x_k over its nodes, Σ w_k = 1.  In linear tets
they are the barycentric coordinates.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tisoft import checks
from tisoft.errors import MeshError
from tisoft.geometry import carrying
from tisoft.geometry.checks import as_of, check_finite, check_range, index_rows, positions
from tisoft.geometry.mesh import SolidMesh, SpringNet, TetMesh, moved
from tisoft.geometry.surface import read_surface
from tisoft.live import frozen

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

NEIGHBOURS = (8, 64)
"""Tets, by the distance of their centres, among which a point looks for its own: first few, then
more where none of those holds it."""
FARTHEST = 1.0
"""Of a point outside of its tet, in heights of the tet."""


@frozen
@dataclass(frozen=True, eq=False)
class Skin:
    """Triangles between points that a mesh's nodes carry; made by `skin`, or by `cage`.  Raises
    MeshError for arrays that do not fit each other.
    """

    triangles: Ints
    """Points of each triangle, shape (triangles, 3), outward."""
    corners: Ints
    """Nodes that carry each point, shape (points, corners)."""
    weights: Floats
    """Their shares, shape (points, corners); each row sums to 1."""

    def __post_init__(self) -> None:
        for name, kinds in (("triangles", "iu"), ("corners", "iu"), ("weights", "f")):
            rows = getattr(self, name)
            is_array = isinstance(rows, np.ndarray) and rows.dtype.kind in kinds and rows.ndim == 2
            if not is_array or (name == "triangles" and rows.shape[1] != 3):
                problem = "must be rows of numbers; make a skin by tisoft.skin"
                raise MeshError(f"{name} {problem}")
        if self.corners.shape != self.weights.shape:
            raise MeshError("corners and weights must have one shape; make a skin by tisoft.skin")
        check_range(self.triangles, "triangle", len(self.corners))

    def carried(self, values: Floats) -> Floats:
        """Values at the nodes, shape (nodes, …), carried over to the points: positions [m] too."""
        from scipy.sparse import csr_matrix  # SciPy is slow to import

        (count, width), nodes = self.corners.shape, len(values)
        starts = np.arange(0, width * count + 1, width)
        matrix = csr_matrix(
            (self.weights.ravel(), self.corners.ravel(), starts), shape=(count, nodes)
        )
        out: Floats = matrix @ values
        return out


def skin(mesh: TetMesh | SolidMesh, points: ArrayLike, triangles: ArrayLike) -> Skin:
    """The surface with these points [m] and triangles, carried by the cells of a mesh at rest.

    Raises:
        MeshError: a mesh without cells, numbers that are not finite, a triangle with a point that
            is not there, or a surface that lies away from the cells.
    """
    if not isinstance(mesh, (TetMesh, SolidMesh)):
        if not isinstance(mesh, SpringNet):
            raise MeshError("mesh must be a mesh, as of tisoft.box or tisoft.read_mesh")
        raise MeshError("a skin is carried by tets or hexes, and this mesh has none")
    places = positions(points)
    check_finite(places, np.arange(len(places)))
    rows = check_range(index_rows(triangles, 3, "triangle"), "triangle", len(places))
    if not len(rows):
        raise MeshError("a skin needs at least one triangle, and this one has none")
    tets, weights = _holders(mesh, places)
    far = -weights.min(axis=1)
    if far.max() > FARTHEST:
        worst = int(far.argmax())
        place = ", ".join(f"{x:.6g}" for x in places[worst])
        raise MeshError(
            f"point {worst} of the skin, at ({place}), lies away from the body's cells; "
            "place both in the same coordinates and units"
        )
    corners, weights = _by_cells(mesh, places, tets, weights)
    return Skin(rows.astype(np.int32), corners.astype(np.int32), weights)


def _by_cells(
    mesh: TetMesh | SolidMesh, places: Floats, tets: NDArray[np.int64], weights: Floats
) -> tuple[NDArray[np.integer], Floats]:
    """Nodes that carry places, and their shares, where tets do with barycentric coordinates; all
    rows have the width of the largest cell.
    """
    corners = mesh.carriers[tets]
    if isinstance(mesh, TetMesh):
        return corners, weights
    cell, begun = mesh.carriers_of[1][tets], 0
    width = max(rows.shape[1] for rows in mesh.cells.values())
    nodes, shares = np.repeat(corners[:, :1], width, axis=1), np.zeros((len(places), width))
    nodes[:, :4], shares[:, :4] = corners, weights
    for word, rows in mesh.cells.items():
        own = np.flatnonzero((cell >= begun) & (cell < begun + len(rows)))
        mine = rows[cell[own] - begun]
        begun += len(rows)
        if word == "tet4" or not len(own):
            continue
        where = (mine[:, None] == corners[own][..., None]).argmax(axis=2)
        start = np.einsum("pk,pki->pi", weights[own], carrying.PLACES[word][where])
        found = carrying.shares(word, mesh.points[mine], places[own], start)
        good = np.isfinite(found).all(axis=1)
        row, columns = own[good, None], np.arange(mine.shape[1])
        nodes[row, columns], shares[row, columns] = mine[good], found[good]
    return nodes, shares


def _holders(mesh: TetMesh | SolidMesh, places: Floats) -> tuple[NDArray[np.int64], Floats]:
    """The tet of every place and the barycentric coordinates in it."""
    from scipy.spatial import cKDTree

    corners = mesh.points[mesh.carriers]
    origin = corners[:, 0]
    inverse = np.linalg.inv(np.swapaxes(corners[:, 1:] - origin[:, None], 1, 2))
    tree = cKDTree(corners.mean(axis=1))
    tets = np.zeros(len(places), np.int64)
    weights = np.full((len(places), 4), -np.inf)
    left = np.arange(len(places))
    for count in NEIGHBOURS:
        number = min(count, len(mesh.carriers))
        near = tree.query(places[left], k=number)[1].reshape(len(left), number)
        local = np.einsum("pkij,pkj->pki", inverse[near], places[left, None] - origin[near])
        shares = np.concatenate([1.0 - local.sum(axis=2, keepdims=True), local], axis=2)
        best = shares.min(axis=2).argmax(axis=1)
        rows = np.arange(len(left))
        tets[left], weights[left] = near[rows, best], shares[rows, best]
        left = left[weights[left].min(axis=1) < -1e-9]
        if not len(left):
            break
    return tets, weights


def read_skin(
    path: str | os.PathLike[str],
    mesh: TetMesh | SolidMesh,
    *,
    scale: float = 1.0,
    rotate: Sequence[float] = (0.0, 0.0, 0.0),
    translate: Sequence[float] = (0.0, 0.0, 0.0),
) -> Skin:
    """The surface of a file (.obj, .off, .ply, .stl, .vtp), scaled, turned about x, y and z
    [degrees] and moved [m], and carried by the cells of a mesh.

    Raises:
        MeshError: one sentence that names the file.
    """
    with as_of(""):
        path = checks.path("path", path, "a surface file")
    try:
        points, triangles = read_surface(path)
        return skin(mesh, moved(points, scale, rotate, translate), triangles)
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from error.__cause__
