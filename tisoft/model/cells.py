"""A body's cells of one element and material, numbered inside: what a block is filled from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import elements
from tisoft.elements.matrices import AT_ONCE, top
from tisoft.geometry.cells import LATTICE
from tisoft.geometry.mesh import Mesh, SolidMesh
from tisoft.geometry.topology import morton_order
from tisoft.models.materials import SolidModel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

EVENED, MANY = 4, 4000
"""Times that the masses of a cage's nodes are split among its cells anew, and cells from which on
once has to do."""


@dataclass(eq=False)
class Cells:
    """Cells of one element and material; rows follow a Morton curve."""

    element: Any
    """Class of the element."""
    nodes: Ints
    """Nodes of each cell (counted from the body's first), shape (cells, corners)."""
    rest: Floats
    """Rest numbers of each cell."""
    order: NDArray[np.int64]
    """Number of each cell among all cells of the mesh."""
    model: SolidModel | None = None
    """What they are made of; None for springs and the edges of mass-tensors."""
    material: int = 0
    """Number of the model among those of the body (`Body.materials`)."""
    place: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    """Batch · lanes + lane of each cell in its block."""
    lumps: Floats | None = None
    """Mass of each of the body's nodes over the density [m³], where it is not what the cells' equal
    shares add up to."""
    _known: dict[tuple[str, float, float], Floats] = field(default_factory=dict)

    @cached_property
    def volume(self) -> Floats:
        """Of each cell [m³], shape (cells,)."""
        return np.asarray(self.element.volumes(self.rest), np.float64)

    @cached_property
    def gradients(self) -> Floats:
        """∇N of the corners at the points [1/m], shape (cells, points, corners, 3)."""
        return np.asarray(self.element.gradients(self.rest), np.float64)

    def deformation(self, u: Floats) -> Floats:
        """F at the points of each cell at displacements u [m] of the body's nodes, shape
        (cells, points, 3, 3).
        """
        return np.eye(3) + np.einsum("eai,eqaj->eqij", u[self.nodes], self.gradients)

    @property
    def solid(self) -> SolidModel:
        """The model of cells that are no edges."""
        assert self.model is not None
        return self.model

    @property
    def elastic(self) -> tuple[float, float]:
        """λ and μ [Pa]."""
        return self.solid.lame_lambda, self.solid.lame_mu

    @property
    def viscous(self) -> tuple[float, float]:
        """φ and η [Pa·s]."""
        return self.solid.phi, self.solid.eta

    @property
    def masses(self) -> Floats:
        """Lumped masses of the corners [kg], shape (cells, corners)."""
        return np.asarray(self.element.masses(self.rest, self.solid.density), np.float64)

    def matrices(self, lam: float, mu: float) -> Floats:
        """K_e at rest [N/m] of Lamé constants, shape (cells, 3 corners, 3 corners)."""
        return np.asarray(self.element.matrices(self.rest, lam, mu), np.float64)

    def known(self, *, heavier: float = 1.0) -> Floats:
        """Columns of `Block.modes`: ω² [1/s²] and damping rate 2ζω [1/s] of each cell's stiffest
        mode at rest with its own lumped mass over `heavier`, what the law's growth adds to ω²
        [1/(kg/m)], weight [m³], and what `stiffened` of the element asks for besides.
        """
        scale, elastic, rate = heavier / self.solid.density, self.elastic, self.viscous
        viscous = any(rate)
        omega2 = scale * self._of("frequency", *elastic)
        zero = np.zeros(len(omega2))
        damping = scale * self._of("frequency", *rate) if viscous else zero
        lighter = self._lighter
        columns = [omega2, damping, scale * lighter * self._spread, self._weight]
        if self.element.known > len(columns):
            more = lighter[:, None] * self._of("swinging", *elastic)
            slow = lighter[:, None] * self._of("swinging", *rate) if viscous else 0 * more
            columns += [scale * more, scale * slow]
        return np.column_stack(columns)

    @property
    def _lighter(self) -> Floats:
        """How many times lighter than an equal share each cell's lightest corner is."""
        if self.lumps is None:
            return np.ones(len(self.volume))
        own = self._shares(self._weight).min(axis=1)
        return np.asarray(self.volume / self.nodes.shape[1] / own)

    def _shares(self, weight: Floats) -> Floats:
        """The nodes' masses over the density split among their cells in proportion to `weight`
        [m³], shape (cells, corners).  Any split bounds the frequencies (Irons and Treharne 1971).
        """
        assert self.lumps is not None
        corners = self.nodes.shape[1]
        total = np.bincount(self.nodes.ravel(), np.repeat(weight, corners), len(self.lumps))
        return np.asarray(weight[:, None] * (self.lumps / total)[self.nodes])

    @cached_property
    def _weight(self) -> Floats:
        """What a cell counts with in its nodes' bounds: its volume; where masses are no sum of
        volumes, as much of its nodes as makes all cells about equally fast.
        """
        weight = self.volume.copy()
        if self.lumps is None:
            return weight
        lam, mu = self.elastic
        for _ in range(EVENED if len(weight) < MANY else 1):
            omega2 = self._frequency(self._shares(weight), lam, mu)
            weight *= np.sqrt(omega2 / omega2.mean())
        return weight

    def _frequency(self, shares: Floats, lam: float, mu: float) -> Floats:
        """ω² [1/s²] of the stiffest mode of each cell with density 1 and the given corners."""
        root = np.repeat(1.0 / np.sqrt(shares), 3, axis=1)
        found = []
        for own in np.array_split(np.arange(len(root)), 1 + len(root) // AT_ONCE):
            each = self.element.matrices(self.rest[own], lam, mu)
            found.append(top(root[own, :, None] * each * root[own, None]))
        return np.concatenate(found)

    def _of(self, name: str, lam: float, mu: float) -> Floats:
        """A function of the element that is proportional to its constants: found once for each
        ratio.
        """
        unit = (lam / mu, 1.0) if mu > 0.0 else (1.0, 0.0)
        key = name, round(unit[0], 12), unit[1]
        if key not in self._known:
            self._known[key] = self._found(name, *unit)
        return (mu if mu > 0.0 else lam) * self._known[key]

    def _found(self, name: str, lam: float, mu: float) -> Floats:
        if name == "frequency" and self.lumps is not None:
            return self._frequency(self._shares(self._weight), lam, mu)
        return np.asarray(getattr(self.element, name)(self.rest, lam, mu), np.float64)

    @cached_property
    def _spread(self) -> Floats:
        return np.asarray(self.element.spread_square(self.rest), np.float64)


def cells_of(
    mesh: Mesh,
    center: Floats,
    rank: NDArray[np.int64],
    materials: tuple[Sequence[Any], NDArray[np.int64]],
) -> list[Cells]:
    """The cells of a mesh, a list for each element and material; `rank`: inside node of each row of
    `mesh.points`, `center`: of the rest points [m], `materials`: as of `Body.materials`.
    """
    models, number = materials
    lattice = getattr(mesh, "cage", None)
    if lattice is not None:
        return [_cells_of_cage(mesh, center, rank, models[0])]
    found, begun = [], 0
    for word, rows in mesh.cells.items():
        order = morton_order(mesh.points[rows].mean(axis=1))
        element, corners = elements.element(word, mesh.points, rows)
        for material in np.unique(number[begun : begun + len(rows)]):
            mine = order[number[order + begun] == material]
            own = rows[mine][:, corners]
            rest = element.rest(mesh.points - center, own)
            model = models[material] if isinstance(models[material], SolidModel) else None
            cells = rank[own].astype(np.int32)
            found.append(Cells(element, cells, rest, mine + begun, model, int(material)))
        begun += len(rows)
    return found


def _cells_of_cage(mesh: Mesh, center: Floats, rank: NDArray[np.int64], model: Any) -> Cells:
    """The cells of a lattice that a surface fills in part."""
    from tisoft.elements.hex8 import Hex8

    assert isinstance(mesh, SolidMesh) and mesh.cage is not None
    cage = mesh.cage
    rows = mesh.cells["hex8"][:, LATTICE]
    order = morton_order(mesh.points[rows].mean(axis=1))
    own = rows[order]
    rest = Hex8.filled(mesh.points - center, own, cage.moments[order])
    nodes = rank[own].astype(np.int32)
    each = np.repeat(rest[:, 3] / 8.0, 8)
    lumps: Floats = np.bincount(nodes.ravel(), each, len(rank)).astype(np.float64)
    lumps[rank] = lumps[rank] * cage.factor
    return Cells(Hex8, nodes, rest, order, model, lumps=lumps)
