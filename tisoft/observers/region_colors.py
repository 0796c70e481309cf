"""Colours of a mesh's regions: a colour for each, the body's own where a cell is in none."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tisoft.body import Body
from tisoft.geometry.mesh import Mesh
from tisoft.render.colormap import body_color
from tisoft.scene import Scene

Colors = NDArray[np.float32]
Rows = NDArray[np.int64]


def first_colors(scene: Scene) -> list[int]:
    """Number of each body's own colour, behind which those of its regions come."""
    widths = [1 + len(body.mesh.regions) for body in scene.bodies]
    return [int(n) for n in np.cumsum([0, *widths[:-1]])]


def region_of_cells(mesh: Mesh) -> Rows:
    """Number of the first region that each cell is in, from 1; 0 where it is in none."""
    found = np.zeros(mesh.elements, np.int64)
    for number, region in reversed(list(enumerate(mesh.regions, 1))):
        found[region.tets] = number
    return found


def region_of_triangles(mesh: Mesh) -> Rows:
    """The same of the cell behind each triangle of the surface."""
    nodes = len(mesh.points)
    cells = sparse.vstack([_incidence(rows, nodes) for rows in mesh.cells.values()])
    shared = (_incidence(mesh.surface, nodes) @ cells.T).tocoo()
    found = np.zeros(len(mesh.surface), np.int64)
    whole = shared.data == 3
    found[shared.row[whole]] = region_of_cells(mesh)[shared.col[whole]]
    return found


def node_colors(body: Body, first: int) -> Colors:
    """Of each node, by most of the cells around it, shape (nodes, 3)."""
    mesh = body.mesh
    votes = np.zeros((len(mesh.points), 1 + len(mesh.regions)))
    number, begun = region_of_cells(mesh), 0
    for rows in mesh.cells.values():
        own = np.repeat(number[begun : begun + len(rows)], rows.shape[1])
        np.add.at(votes, (rows.ravel(), own), 1.0)
        begun += len(rows)
    palette = np.array([body_color(first + k) for k in range(votes.shape[1])], np.float32)
    return np.asarray(palette[votes.argmax(axis=1)])


def _incidence(rows: NDArray[np.integer], nodes: int) -> sparse.csr_matrix:
    """1 where a row holds a node, shape (rows, nodes)."""
    pairs = np.repeat(np.arange(len(rows)), rows.shape[1]), rows.ravel()
    return sparse.csr_matrix((np.ones(rows.size), pairs), shape=(len(rows), nodes))
