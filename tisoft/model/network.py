"""Mass-spring networks: masses, stiffnesses and node lists of a body.

    f = k (L − l)                                     (Hooke; Choi, mass-spring systems)
    k = E Σ_{tets at the edge} V / l²                 (after Van Gelder 1998, from Young's modulus)
    k = E t Σ_{triangles at the edge} A / l²          (sheets of thickness t)

The springs of a tet mesh have Young's modulus E for random edge directions only, and Poisson's
ratio 1/4 whatever is asked (a sheet: 1/3): expect 10 to 30 % of error in bending.  A sheet with
springs that are no triangle's edge shares k l² equally among its springs, k = 3 E t A/(n l²).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tisoft.body import Body
from tisoft.geometry.cells import CELLS
from tisoft.geometry.mesh import Mesh, SpringNet
from tisoft.models.materials import MassSpring

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Network:
    """Springs of one body, in the order of `Body.springs`."""

    ends: NDArray[np.int64]
    """Rows of `mesh.points`, shape (springs, 2)."""
    stiffness: Floats
    """k [N/m], shape (springs,)."""
    lengths: Floats
    """Rest lengths L₀ [m], shape (springs,)."""
    damping: float
    """c of the damper along each spring [N·s/m]."""
    masses: Floats
    """[kg], shape (nodes,)."""


def network(body: Body) -> Network:
    """Springs and masses of a MassSpring body."""
    model, mesh = body.model, body.mesh
    assert isinstance(model, MassSpring)
    ends = body.springs()
    vectors = mesh.points[ends[:, 1]] - mesh.points[ends[:, 0]]
    lengths = np.linalg.norm(vectors, axis=1)
    stiffness = np.full(len(ends), np.nan)
    if not isinstance(model.stiffness, str):
        stiffness[:] = model.stiffness
    if model.needs_young:
        assert model.young is not None
        made = _volume_share(mesh, ends, model.thickness, _of_cells(body, "young")) / lengths**2
        stiffness = np.where(np.isnan(stiffness), made, stiffness)
    rest = lengths.copy()
    if model.rest_lengths is not None:
        rest = np.where(np.isnan(model.rest_lengths), lengths, model.rest_lengths)
    return Network(ends, stiffness, rest, model.spring_damping, _masses(body, model))


def _of_cells(body: Body, name: str) -> Floats:
    """A number of each cell's material, shape (cells,); the body's own where there are none."""
    models, number = body.materials()
    values = np.array([getattr(model, name) for model in models], np.float64)
    return values[number] if len(number) else values


def _keys(pairs: NDArray[np.integer], nodes: int) -> NDArray[np.int64]:
    ends = np.sort(np.asarray(pairs, dtype=np.int64).reshape(-1, 2), axis=1)
    keys: NDArray[np.int64] = ends[:, 0] * nodes + ends[:, 1]
    return keys


def _volume_share(
    mesh: Mesh, ends: NDArray[np.int64], thickness: float | None, young: Floats
) -> Floats:
    """Volume that each spring stands for times Young's modulus there [Pa m³], shape (springs,)."""
    nodes = len(mesh.points)
    if mesh.elements:
        # A tet's edges stand for its volume six times; those of other cells in sum for as much.
        edges = [rows[:, CELLS[word].edges] for word, rows in mesh.cells.items()]
        keys = _keys(np.concatenate([own.reshape(-1, 2) for own in edges]), nodes)
        each = np.concatenate([np.full(len(own), own.shape[1]) for own in edges])
        share = np.repeat(6.0 / each * young * _volumes(mesh), each)
    else:
        assert thickness is not None
        areas = young[0] * triangle_areas(mesh.points, mesh.surface)
        keys = _keys(mesh.surface[:, [[0, 1], [1, 2], [2, 0]]], nodes)
        share = np.repeat(thickness * areas, 3)
        if not np.isin(_keys(ends, nodes), keys).all():
            return np.full(len(ends), 3.0 * thickness * areas.sum() / len(ends))
    known, index = np.unique(keys, return_inverse=True)
    total = np.bincount(index, share)
    wanted = _keys(ends, nodes)
    place = np.searchsorted(known, wanted).clip(max=len(known) - 1)
    found = known[place] == wanted
    # A spring that is no edge of the mesh stands for as much as the average edge does.
    volumes: Floats = np.where(found, total[place], total.mean())
    return volumes


def triangle_areas(points: Floats, triangles: NDArray[np.integer]) -> Floats:
    """Areas [m²], shape (triangles,)."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    areas: Floats = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return areas


def _volumes(mesh: Mesh) -> Floats:
    assert not isinstance(mesh, SpringNet)
    return mesh.volumes


def node_volumes(mesh: Mesh, density: Floats | float = 1.0) -> Floats:
    """Volume that each node stands for [m³] times the cells' density: every cell's shared out
    equally, shape (nodes,).
    """
    total, volumes, begun = np.zeros(len(mesh.points)), density * _volumes(mesh), 0
    for rows in mesh.cells.values():
        own = volumes[begun : begun + len(rows)] / rows.shape[1]
        begun += len(rows)
        each = np.repeat(own, rows.shape[1])
        total += np.bincount(rows.ravel(), each, minlength=len(total))
    return total


def _masses(body: Body, model: MassSpring) -> Floats:
    mesh = body.mesh
    nodes = len(mesh.points)
    if model.node_mass is not None:
        return np.broadcast_to(np.asarray(model.node_mass, float), (nodes,)).copy()
    assert model.density is not None
    if mesh.elements:
        return node_volumes(mesh, _of_cells(body, "density"))
    assert model.thickness is not None
    thirds = model.density * model.thickness * triangle_areas(mesh.points, mesh.surface) / 3.0
    weights = np.repeat(thirds, 3)
    return np.bincount(mesh.surface.ravel(), weights, minlength=nodes).astype(np.float64)
