"""Closed triangle surfaces: read, joined where points coincide, and checked to enclose a volume.

A surface is closed where every edge is used as often one way as the other.  By the divergence
theorem its triangles (a, b, c) then tell

    V = Σ a·(b × c)/6,   ∫ x_i dV = Σ V_t (a + b + c)_i/4,
    ∫ x_i x_j dV = Σ V_t (a_i a_j + b_i b_j + c_i c_j + s_i s_j)/20,   s = a + b + c
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tisoft import checks
from tisoft.errors import MeshError
from tisoft.geometry.checks import as_of, check_finite, check_range
from tisoft.geometry.files.quiet import no_surprises

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]

SUFFIXES = (".obj", ".off", ".ply", ".stl", ".vtp")


def read_surface(path: str | os.PathLike[str]) -> tuple[Floats, Rows]:
    """Points, shape (points, 3), and triangles, shape (triangles, 3), of a file; polygons are cut
    into triangles, points in one place joined.

    Raises:
        MeshError: a file that is no surface, or cannot be read.
    """
    with as_of(""):
        path = checks.path("path", path, "a surface file")
    if path.suffix.lower() not in SUFFIXES:
        raise MeshError(
            f"{path.suffix or 'it'} is no surface file: give one of {', '.join(SUFFIXES)}"
        )
    if not path.is_file():
        raise MeshError("there is no such file; check the path")
    points, fans = _polydata(path) if path.suffix.lower() == ".vtp" else _foreign(path)
    triangles = np.concatenate([np.zeros((0, 3), np.int64), *fans])
    if not len(triangles):
        raise MeshError("a surface needs at least one triangle, and this file has none")
    check_range(triangles, "triangle", len(points))
    return joined(points, triangles)


def _foreign(path: Path) -> tuple[Floats, list[Rows]]:
    import meshio

    with no_surprises(path):
        read = meshio.read(path)
        points = np.asarray(read.points, np.float64)
        polygons = [np.asarray(b.data, np.int64) for b in read.cells if b.data.shape[1] >= 3]
        fans = [p[:, [0, k, k + 1]] for p in polygons for k in range(1, p.shape[1] - 1)]
    return points, fans


def _polydata(path: Path) -> tuple[Floats, list[Rows]]:
    from tisoft.geometry.files.vtu import read_vtp

    try:
        points, corners, ends = read_vtp(path.read_bytes())
    except OSError as error:
        raise MeshError(f"the file cannot be read: {error.strerror}") from None
    starts = np.concatenate([[0], ends[:-1]]) if len(ends) else ends
    sizes = ends - starts
    fans = []
    for size in np.unique(sizes[sizes >= 3]):
        rows = corners[starts[sizes == size, None] + np.arange(size)]
        fans += [rows[:, [0, k, k + 1]] for k in range(1, size - 1)]
    return points, fans


def joined(points: Floats, triangles: Rows) -> tuple[Floats, Rows]:
    """The surface with one point for each place, the first there, without points that it does not
    use and without triangles that have lost a corner.
    """
    _, first, index = np.unique(points, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    first, rows = first[order], rank[index.reshape(-1)][triangles]
    a, b, c = rows.T
    rows = rows[(a != b) & (b != c) & (c != a)]
    used, rows = np.unique(rows, return_inverse=True)
    return points[first][used], rows.reshape(-1, 3)


def closed(points: Floats, triangles: Rows) -> tuple[Rows, bool]:
    """The triangles, outward, and whether they were turned round for that.

    Raises:
        MeshError: a surface that is open, whose triangles disagree about what is outside, or that
            encloses nothing, with the place.
    """
    check_finite(points, np.arange(len(points)))
    sides = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    low, high = sides.min(axis=1), sides.max(axis=1)
    keys, index, uses = np.unique(low * len(points) + high, return_inverse=True, return_counts=True)
    sense = np.bincount(index, np.where(sides[:, 0] < sides[:, 1], 1.0, -1.0), len(keys))
    wrong = np.flatnonzero(sense != 0.0)
    if len(wrong):
        open_ = wrong[uses[wrong] % 2 == 1]
        first = int((open_ if len(open_) else wrong)[0])
        ends = points[[keys[first] // len(points), keys[first] % len(points)]]
        place = told(ends.mean(axis=0))
        if len(open_):
            raise MeshError(
                f"the surface is open: {count(len(open_), 'edge')} of one triangle only, as that "
                f"at {place}; close the holes, and join points that should be one"
            )
        raise MeshError(
            f"its triangles disagree about what is outside at {count(len(wrong), 'edge')}, as "
            f"that at {place}; make all normals point outward"
        )
    volume = solid_moments(points, triangles)[0]
    size = float(np.ptp(points, axis=0).max())
    if not abs(volume) > 1e-12 * size**3:
        raise MeshError("the surface encloses no volume")
    return (triangles, False) if volume > 0.0 else (triangles[:, ::-1], True)


def solid_moments(points: Floats, triangles: Rows) -> tuple[float, Floats, Floats]:
    """V [m³], ∫ x dV [m⁴] and ∫ x xᵀ dV [m⁵] of what a closed surface encloses."""
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    x = points[triangles] - middle  # near the middle, lest digits are lost
    each = np.einsum("ti,ti->t", x[:, 0], np.cross(x[:, 1], x[:, 2])) / 6.0
    total = x.sum(axis=1)
    volume, first = float(each.sum()), each @ total / 4.0
    second = np.einsum("t,tci,tcj->ij", each, x, x, optimize=True)
    second = (second + np.einsum("t,ti,tj->ij", each, total, total, optimize=True)) / 20.0
    shifted = np.outer(middle, first)
    second = second + shifted + shifted.T + volume * np.outer(middle, middle)
    return volume, first + volume * middle, second


def told(place: Floats) -> str:
    """A place in a sentence."""
    return "(" + ", ".join(f"{x:.6g}" for x in place) + ")"


def count(number: int, what: str) -> str:
    """A number of things in a sentence."""
    return f"{number} {what}{'s' * (number != 1)}"
