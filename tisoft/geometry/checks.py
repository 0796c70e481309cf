"""What a mesh must satisfy, and the sentences that tell where it does not.  All is relative."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tisoft.checks import FieldError
from tisoft.errors import MeshError
from tisoft.geometry import topology
from tisoft.geometry.quality import signed_volumes, smallest_altitudes

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

FLAT = 1e-6
"""A tet whose smallest altitude is below this fraction of its longest edge is degenerate."""


@contextmanager
def as_of(what: str) -> Iterator[None]:
    """Tell a wrong value as one of a mesh: "box.size[0] = -1 must be above 0 m"."""
    try:
        yield
    except FieldError as error:
        raise MeshError(str(error.inside(what))) from None


def check_tets(points: Floats, tets: Ints) -> NDArray[np.bool_]:
    """Refuses degenerate tets; returns which ones are oriented the wrong way round."""
    scaled = unit_sized(points)
    corners = scaled[tets]
    longest = np.zeros(len(tets))
    for i, j in topology.TET_EDGES:
        longest = np.maximum(longest, np.linalg.norm(corners[:, i] - corners[:, j], axis=1))
    # Far from the origin the coordinates themselves are rounded: flat up to that is flat too.
    extent = float(np.max(np.ptp(points, axis=0)))
    rounding = 4.0 * np.finfo(np.float64).eps * float(np.max(np.abs(points))) / extent
    flat = smallest_altitudes(scaled, tets) <= np.maximum(FLAT * longest, rounding)
    if flat.any():
        raise MeshError(
            f"{numbers('tet', flat)} degenerate (flat, or with a repeated node); "
            "repair the mesh with a mesh generator"
        )
    with np.errstate(all="ignore"):
        volumes = signed_volumes(points, tets)
    if not np.all(np.isfinite(volumes) & (volumes != 0.0)):
        raise MeshError(
            f"an extent of {extent:.3g} m gives volumes beyond the range of numbers; scale the mesh"
        )
    return volumes < 0.0


def check_repeats(tets: Ints) -> None:
    """Refuses tets of the same four nodes."""
    rows = np.sort(tets, axis=1)
    order = np.lexsort(rows.T)
    repeated = np.zeros(len(tets), dtype=bool)
    repeated[order[1:]] = (rows[order[1:]] == rows[order[:-1]]).all(axis=1)
    if repeated.any():
        raise MeshError(f"{numbers('tet', repeated)} given twice; take the copies out")


def unit_sized(points: Floats) -> Floats:
    """The points moved and scaled into a box of size 1, so that products cannot overflow."""
    low, high = points.min(axis=0), points.max(axis=0)
    with np.errstate(over="ignore"):
        extent = float(np.max(high - low))
    if not np.isfinite(extent):
        raise MeshError("the coordinates span more than numbers can hold; scale the mesh")
    if extent < np.finfo(np.float64).tiny:
        if len(points) > 1:
            raise MeshError(f"all {len(points)} nodes lie in one point; the mesh has no extent")
        extent = 1.0
    return (points - low) / extent


def index_rows(values: ArrayLike, width: int, what: str) -> NDArray[np.integer]:
    """The values as rows of node numbers, shape (rows, width)."""
    try:
        rows = np.asarray(values)
    except ValueError as error:  # rows of different lengths
        raise MeshError(f"{what}s must be rows of {width} whole node numbers") from error
    if rows.size == 0:
        return np.empty((0, width), dtype=np.int32)
    if rows.ndim != 2 or rows.shape[1] != width or rows.dtype.kind not in "iu":
        raise MeshError(
            f"{what}s must be rows of {width} whole node numbers, "
            f"not an array of shape {rows.shape} and type {rows.dtype}"
        )
    return rows


def index_numbers(values: ArrayLike, what: str) -> NDArray[np.int64]:
    """The values as whole numbers, shape (n,)."""
    try:
        found = np.asarray(values)
    except ValueError:  # rows of different lengths
        found = np.empty(1, object)
    if found.ndim != 1 or (found.size and found.dtype.kind not in "iu"):
        raise MeshError(f"{what} must be a list of whole numbers")
    return found.astype(np.int64)


def check_range(rows: NDArray[np.integer], what: str, nodes: int) -> Ints:
    """The rows, once it is sure that every number is one of `nodes` nodes."""
    wrong = (rows < 0) | (rows >= nodes)
    if wrong.any():
        number = int(np.flatnonzero(wrong.any(axis=1))[0])
        raise MeshError(
            f"{what} {number} (counted from 0) uses node {int(rows[wrong][0])} (counted from 0), "
            f"but there are {nodes} nodes"
        )
    return rows.astype(np.int32)


def positions(points: ArrayLike) -> Floats:
    """The points as an array of shape (nodes, 3)."""
    try:
        given = np.asarray(points)
    except (TypeError, ValueError) as error:
        raise MeshError("points must be rows of three numbers") from error
    if given.size == 0:
        return np.empty((0, 3))
    if given.dtype.kind not in "iuf":
        kind = {"c": "complex numbers", "b": "true and false", "U": "text"}.get(given.dtype.kind)
        raise MeshError(f"points must be rows of three numbers, not of {kind or 'other things'}")
    values = given.astype(np.float64)
    if values.ndim != 2 or values.shape[1] != 3:
        raise MeshError(f"points must be rows of three numbers, not of shape {values.shape}")
    return values


def only_used(
    points: ArrayLike, cells: NDArray[np.integer], what: str
) -> tuple[Floats, Ints, NDArray[np.int64]]:
    """Points that cells use, the cells in new numbers, and the old number of each kept node."""
    nodes = positions(points)
    used = np.zeros(len(nodes), dtype=bool)
    check_range(cells, what, len(nodes))
    used[cells.ravel()] = True
    kept = np.flatnonzero(used).astype(np.int64)
    check_finite(nodes[kept], kept)
    renumber = np.cumsum(used, dtype=np.int64) - 1
    return nodes[kept], renumber[cells].astype(np.int32), kept


def check_finite(points: Floats, kept: NDArray[np.int64]) -> None:
    """Refuses positions that are not finite; `kept` are the nodes' numbers in the file."""
    wrong = ~np.isfinite(points).all(axis=1)
    if wrong.any():
        first = int(np.flatnonzero(wrong)[0])
        raise MeshError(
            f"node {int(kept[first])} (counted from 0) lies at {points[first].tolist()}; "
            f"coordinates must be finite, and {int(wrong.sum())} of {len(points)} nodes are not"
        )


def numbers(what: str, wrong: NDArray[np.bool_]) -> str:
    """ "tet 7 is" or "12 of 300 tets (numbers 3, 7, 9, … counted from 0) are"."""
    found = np.flatnonzero(wrong)
    if len(found) == 1:
        return f"{what} {found[0]} (counted from 0) is"
    shown = ", ".join(str(i) for i in found[:5]) + (", …" if len(found) > 5 else "")
    return f"{len(found)} of {len(wrong)} {what}s (numbers {shown} counted from 0) are"
