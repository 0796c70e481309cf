"""A body's cells of one element and material, numbered inside: what a block is filled from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tisoft import elements
from tisoft.elements.matrices import AT_ONCE, top
from tisoft.geometry.cells import LATTICE
from tisoft.geometry.mesh import Mesh, SolidMesh
from tisoft.geometry.topology import morton_order
from tisoft.models.materials import SolidModel

if TYPE_CHECKING:
    from tisoft.geometry.cage.build import Cage

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


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
    shares: Floats | None = None
    """Mass of each corner over the density [m³], shape (cells, corners), where it is not an equal
    share of the volume."""
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
        columns = [omega2, damping, scale * lighter * self._spread, self.volume]
        if self.element.known > len(columns):
            more = lighter[:, None] * self._of("swinging", *elastic)
            slow = lighter[:, None] * self._of("swinging", *rate) if viscous else 0 * more
            columns += [scale * more, scale * slow]
        return np.column_stack(columns)

    @property
    def _lighter(self) -> Floats:
        """How many times lighter than an equal share each cell's lightest corner is."""
        if self.shares is None:
            return np.ones(len(self.volume))
        return np.asarray(self.volume / self.shares.shape[1] / self.shares.min(axis=1))

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
        if name != "frequency" or self.shares is None:
            return np.asarray(getattr(self.element, name)(self.rest, lam, mu), np.float64)
        root = np.repeat(1.0 / np.sqrt(self.shares), 3, axis=1)
        found = [
            top(
                root[own, :, None]
                * self.element.matrices(self.rest[own], lam, mu)
                * root[own, None]
            )
            for own in np.array_split(np.arange(len(root)), 1 + len(root) // AT_ONCE)
        ]
        return np.concatenate(found)

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
    shares = _shares(rest, own, cage)
    return Cells(Hex8, rank[own].astype(np.int32), rest, order, model, shares=shares)


def _shares(rest: Floats, nodes: NDArray[np.integer], cage: Cage) -> Floats:
    """Mass of each node over the density [m³] split among its cells, shape (cells, 8).

    Any split bounds the frequency by that of the cells alone (Irons and Treharne 1971); one in
    proportion to the stiffness of the corners, Σ_q V |b_a|² and the hourglass modes' own, is close.
    """
    from tisoft.elements.hex8 import Hex8

    volume = rest[:, 3]
    mass = np.bincount(nodes.ravel(), np.repeat(volume / 8.0, 8), len(cage.factor)) * cage.factor
    stiff = np.concatenate(
        [
            np.einsum("eaiai->ea", Hex8.matrices(part, 1.0, 1.0).reshape(-1, 8, 3, 8, 3))
            for part in np.array_split(rest, 1 + len(rest) // AT_ONCE)
        ]
    )
    total = np.bincount(nodes.ravel(), stiff.ravel(), len(mass))
    return np.asarray(stiff * (mass / total)[nodes])
