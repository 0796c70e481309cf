"""What a picture shows: surfaces, capsules (springs) and spheres (points).

An item is made once and drawn many times: its topology is prepared at the first picture, while
`positions` and `color` may be replaced, or change in place, before every picture. Positions are
NumPy arrays or Taichi ndarrays, float32 or float64, shape (nodes, 3), in metres; an item may refer
to a part of a larger array, so that the state of a simulation is drawn where it lies.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

CREASE = 40.0  # degrees between two triangles at which shading stops being smooth

Colors = NDArray[np.float32]


def to_linear(srgb: ArrayLike) -> Colors:
    """Light intensities of sRGB colours in 0..1 (IEC 61966-2-1)."""
    c = np.asarray(srgb, dtype=np.float64)
    curve = ((np.maximum(c, 0.04045) + 0.055) / 1.055) ** 2.4
    return np.where(c <= 0.04045, c / 12.92, curve).astype(np.float32)


def host(array: Any) -> NDArray[Any]:
    """The array in NumPy, whether it was NumPy's or Taichi's."""
    return array if isinstance(array, np.ndarray) else np.asarray(array.to_numpy())


@dataclass(eq=False)
class Surface:
    """Triangles, shape (t, 3), over positions [m]; drawn from both sides.

    `color` is one sRGB colour in 0..1 or one per node, shape (nodes, 3); `shine` scales the
    highlight; `wireframe` draws the triangles' edges; `translucent`, 0 to 1, lets light through
    where it is thin.
    """

    positions: Any
    triangles: NDArray[np.int32]
    color: ArrayLike = (0.8, 0.8, 0.8)
    wireframe: bool = False
    shine: float = 1.0
    translucent: float = 0.0

    @cached_property
    def smooth(self) -> SmoothVertices:
        """Vertices of shading, split along the creases of the first positions drawn."""
        return SmoothVertices.of(host(self.positions), np.asarray(self.triangles))

    def vertex_colors(self) -> Colors:
        """Linear colours, one row, or one per vertex of `smooth`."""
        colors = np.atleast_2d(np.asarray(self.color))
        return to_linear(colors if len(colors) == 1 else colors[self.smooth.nodes])


@dataclass(eq=False)
class Capsules:
    """Springs: the segments `edges`, shape (k, 2), between positions [m], of a radius [m].

    `color` is one sRGB colour, one per edge (k, 3), or else one per node (nodes, 3).
    """

    positions: Any
    edges: NDArray[np.int32]
    radius: float
    color: ArrayLike = (0.8, 0.8, 0.8)
    shine: float = 1.0

    def vertex_colors(self) -> Colors:
        """Linear colours, one row, or two per capsule: of its first and its second end."""
        colors = np.atleast_2d(np.asarray(self.color))
        if len(colors) == 1:
            return to_linear(colors)
        edges = np.asarray(self.edges)
        ends = np.repeat(colors, 2, axis=0) if len(colors) == len(edges) else colors[edges.ravel()]
        return to_linear(ends)

    def end_nodes(self) -> NDArray[np.int32]:
        """Nodes of the ends, two per capsule."""
        return np.ascontiguousarray(self.edges, dtype=np.int32).reshape(-1)


@dataclass(eq=False)
class Spheres:
    """Points: spheres of a radius [m] at positions [m], or at the chosen `nodes` of them.

    `color` is one sRGB colour, or one per sphere.
    """

    positions: Any
    radius: float
    color: ArrayLike = (0.8, 0.8, 0.8)
    nodes: NDArray[np.int32] | None = None
    shine: float = 1.0

    def vertex_colors(self) -> Colors:
        """Linear colours, one row, or two equal ones per sphere."""
        colors = np.atleast_2d(np.asarray(self.color))
        return to_linear(colors if len(colors) == 1 else np.repeat(colors, 2, axis=0))

    def end_nodes(self) -> NDArray[np.int32]:
        """A sphere is a capsule whose ends are the same node."""
        nodes = np.arange(self.positions.shape[0]) if self.nodes is None else self.nodes
        return np.repeat(np.asarray(nodes, dtype=np.int32), 2)


Item = Surface | Capsules | Spheres


@dataclass(frozen=True, eq=False)
class SmoothVertices:
    """Nodes split along creases: a vertex is a node as one smooth stretch of surface sees it."""

    nodes: NDArray[np.int32]  # (v,) the node of every vertex
    triangles: NDArray[np.int32]  # (t, 3) of vertices
    starts: NDArray[np.int32]  # (v + 1,) CSR: where a vertex's corners start in `corners`
    corners: NDArray[np.int32] = field(repr=False)  # (3t,) corner 3·triangle + k

    @classmethod
    def of(cls, points: NDArray[Any], triangles: NDArray[Any]) -> SmoothVertices:
        """Join the corners at a node whose triangles share an edge and nearly a normal."""
        count = len(triangles)
        if count == 0:
            nothing = np.zeros(0, dtype=np.int32)
            return cls(nothing, nothing.reshape(0, 3), np.zeros(1, dtype=np.int32), nothing)
        corner = np.arange(3 * count).reshape(count, 3)
        pairs = [_across_edges(points, triangles, corner)]
        graph = coo_matrix(
            (np.ones(sum(map(len, pairs))), np.concatenate(pairs).T), shape=(3 * count, 3 * count)
        )
        found, group = connected_components(graph, directed=False)
        nodes = np.zeros(found, dtype=np.int32)
        nodes[group] = np.ravel(triangles)
        starts = np.concatenate([[0], np.cumsum(np.bincount(group, minlength=found))])
        corners = np.argsort(group, kind="stable")
        return cls(
            nodes,
            group.reshape(count, 3).astype(np.int32),
            starts.astype(np.int32),
            corners.astype(np.int32),
        )


def _across_edges(
    points: NDArray[Any], triangles: NDArray[Any], corner: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Pairs of corners at the same node, in two triangles joined smoothly by an edge there."""
    a, b, c = (points[triangles[:, k]].astype(np.float64) for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    ends = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    at = np.concatenate([corner[:, [k, (k + 1) % 3]] for k in range(3)])
    swap = ends[:, 0] > ends[:, 1]
    ends[swap], at[swap] = ends[swap][:, ::-1], at[swap][:, ::-1]
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    ends, at = ends[order], at[order]
    same = (ends[1:] == ends[:-1]).all(axis=1)
    one, two = at[:-1][same], at[1:][same]
    flat = np.einsum("ij,ij->i", normal[one[:, 0] // 3], normal[two[:, 0] // 3])
    smooth = flat > np.cos(np.radians(CREASE))
    return np.stack([one[smooth].ravel(), two[smooth].ravel()], axis=1)
