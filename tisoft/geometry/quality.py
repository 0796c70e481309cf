"""How good the shape of tets is: volume, altitude, radius ratio."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.cells import point_volumes

if TYPE_CHECKING:
    from tisoft.geometry.mesh import SolidMesh, TetMesh

Floats = NDArray[np.float64]


def quality(mesh: TetMesh | SolidMesh) -> Floats:
    """Quality of each cell, shape (elements,): 1 at best, 0 flat.

    Tets have their radius ratio, hexahedra the least Jacobian of a corner with its three sides
    scaled to length 1, quadratic tets the radius ratio of their corners times the least Jacobian of
    their points over the largest.
    """
    found = []
    for word, rows in mesh.cells.items():
        if word == "hex8":
            found.append(scaled_jacobians(mesh.points[rows]))
            continue
        ratio = radius_ratios(mesh.points, rows[:, :4])
        if word == "tet10":
            at = point_volumes(word, mesh.points[rows])
            ratio = ratio * at.min(axis=1) / at.max(axis=1)
        found.append(ratio)
    return np.concatenate(found)


def scaled_jacobians(X: Floats) -> Floats:
    """The least scaled Jacobian of each hexahedron's corners, shape (cells,); X: corners [m]."""
    least = np.full(len(X), np.inf)
    for base in (0, 4):
        for c in range(4):
            here = X[:, base + c]
            sides = [X[:, base + (c + 1) % 4], X[:, base + (c + 3) % 4], X[:, (base + 4) % 8 + c]]
            units = [(side - here) / _length(side - here)[:, None] for side in sides]
            volume = np.einsum("ij,ij->i", np.cross(units[0], units[1]), units[2])
            least = np.minimum(least, volume if base == 0 else -volume)
    return least


def radius_ratios(nodes: Floats, tets: NDArray[np.integer]) -> Floats:
    """Radius ratio of each tet, shape (tets,): 3 inradius / circumradius, 1 regular, 0 flat.

    q = 216 V² / (A √((a+b+c)(a+b−c)(a−b+c)(−a+b+c))), A the area of the four faces and a, b, c the
    products of the lengths of opposite edges.  Source: Liu & Joe (1994), with Crelle's formula.
    """
    low = nodes.min(axis=0)
    points = (nodes - low) / np.max(np.ptp(nodes, axis=0))
    x, y, z = _edge_vectors(points, tets)
    area = sum(_length(np.cross(u, v)) for u, v in ((x, y), (y, z), (z, x), (y - x, z - x))) / 2.0
    a = _length(x) * _length(z - y)
    b = _length(y) * _length(z - x)
    c = _length(z) * _length(y - x)
    crelle = (a + b + c) * (a + b - c) * (a - b + c) * (b + c - a)
    volumes = np.einsum("ij,ij->i", x, np.cross(y, z)) / 6.0
    bottom = area * np.sqrt(np.maximum(crelle, 0.0))
    ratio = np.divide(216.0 * volumes**2, bottom, out=np.zeros_like(volumes), where=bottom > 0)
    return np.minimum(ratio, 1.0)


def altitudes(mesh: TetMesh) -> Floats:
    """Smallest altitude of each tet [m], shape (tets,)."""
    return smallest_altitudes(mesh.points, mesh.tets)


def signed_volumes(points: Floats, tets: NDArray[np.integer]) -> Floats:
    """Volume of each tet [m³], shape (tets,); negative where the tet is wrongly oriented."""
    a, b, c = _edge_vectors(points, tets)
    return np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0


def smallest_altitudes(points: Floats, tets: NDArray[np.integer]) -> Floats:
    """Smallest altitude of each tet [m], shape (tets,): 3 V / largest face."""
    a, b, c = _edge_vectors(points, tets)
    doubled = [np.cross(a, b), np.cross(b, c), np.cross(c, a), np.cross(b - a, c - a)]
    largest = np.sqrt(np.max([np.einsum("ij,ij->i", n, n) for n in doubled], axis=0))
    volumes = np.abs(np.einsum("ij,ij->i", a, doubled[1]))
    return np.divide(volumes, largest, out=np.zeros_like(volumes), where=largest > 0)


def _edge_vectors(points: Floats, tets: NDArray[np.integer]) -> tuple[Floats, Floats, Floats]:
    origin = points[tets[:, 0]]
    return points[tets[:, 1]] - origin, points[tets[:, 2]] - origin, points[tets[:, 3]] - origin


def _length(vectors: Floats) -> Floats:
    return np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
