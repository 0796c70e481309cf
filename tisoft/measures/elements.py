"""Strain and stress of each cell and spring, and their averages at nodes.

    F = I + H,  J = det F,  E = (FᵀF − I)/2,  S = F⁻¹P,  σ = P Fᵀ/J,  σ_vM = √(3/2 dev σ : dev σ)

| symbol | name           | unit |
| ------ | -------------- | ---- |
| E      | `strain`       | 1    |
| S      | `second_piola` | Pa   |
| σ      | `cauchy`       | Pa   |
| J      | `volume_ratio` | 1; at or below 0 the cell is inverted |

Bodies of linear elasticity have one strain e = (H + Hᵀ)/2 and one stress.  Stresses are the elastic
ones, without viscosity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.equilibrium.operators import plain_body
from tisoft.measures.kernels import make_measures
from tisoft.model.lent import Share
from tisoft.model.part import Part
from tisoft.model.system import System

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class CellMeasures:
    """Strain and stress of one body's cells, in the mesh's order, f64: means over their points."""

    strain: Floats
    """Green's strain, shape (cells, 3, 3)."""
    second_piola: Floats
    """Second Piola-Kirchhoff stress [Pa], shape (cells, 3, 3)."""
    cauchy: Floats
    """Cauchy stress [Pa], shape (cells, 3, 3); 0 in a cell without volume."""
    von_mises: Floats
    """Von Mises stress of `cauchy` [Pa], shape (cells,)."""
    volume_ratio: Floats
    """Volume over volume at rest, shape (cells,)."""
    least_ratio: Floats
    """The least J of each cell's points, shape (cells,)."""

    @property
    def inverted(self) -> int:
        """Number of cells turned inside out or flat at a point."""
        return int(np.count_nonzero(self.least_ratio <= 0.0))


COLUMNS = tuple(field.name for field in fields(CellMeasures))


@dataclass(frozen=True)
class SpringMeasures:
    """Strain and tension of one body's springs, in the order of `Body.springs`, f64."""

    strain: Floats
    """(L − L₀)/L₀, shape (springs,)."""
    tension: Floats
    """k (L − L₀) [N], shape (springs,)."""


class CellGauge:
    """Measures the cells of one body, on fields of its own in f64 (where the device has it)."""

    def __init__(self, part: Part) -> None:
        self.part = part
        precision = "f64" if runtime.has_f64() else "f32"
        self._system = System([plain_body(part.body)], precision)
        self._made_of = part.body.made_of
        self._order = np.argsort(self._system.parts[0].cell_order)
        self._reads = [self._read_of(share) for share in self._system.shares]

    def _read_of(self, share: Share) -> tuple[Any, int, Any, list[NDArray[Any]]]:
        """Kernel, first batch, places of cells and room for results of one block."""
        launch = self._system.lease.arena.kernel(
            ("measures", share.block), lambda: make_measures(self._system.state, share.block)
        )
        place = np.concatenate([cells.place for _, cells in share.members]).astype(np.int32)
        count = len(place)
        shapes: list[tuple[int, ...]] = [(count, 3, 3)] * 3 + [(count,)] * 3
        outs = [np.zeros(shape, self._system.real) for shape in shapes]
        return launch, share.row("batches"), place, outs

    def read(self, u: NDArray[Any]) -> CellMeasures:
        """The cells' strain and stress at displacements u [m] of the body's nodes."""
        self._measure(u)
        return CellMeasures(*[self._column(k) for k in range(len(COLUMNS))])

    def read_one(self, u: NDArray[Any], name: str) -> Floats:
        """One field of `CellMeasures` alone."""
        self._measure(u)
        return self._column(COLUMNS.index(name))

    def _measure(self, u: NDArray[Any]) -> None:
        if self.part.body.made_of != self._made_of:
            self._made_of = self.part.body.made_of
            self._system.parts[0].body = plain_body(self.part.body)
            self._system.reread_models()
        self._system.set_motion(u, np.zeros_like(u))
        for launch, first, place, outs in self._reads:
            launch(first, place, *outs)

    def _column(self, number: int) -> Floats:
        found = np.concatenate([outs[number] for *_, outs in self._reads])[self._order]
        return found.astype(np.float64, copy=False)


def measure_springs(part: Part, u: Floats) -> SpringMeasures:
    """The springs' strain and tension at displacements u [m] of the body's nodes."""
    numbers, rest = part.spring_numbers, part.rest
    i, j = part.springs.T
    k, natural = numbers[:, 0], numbers[:, 1]
    d, change = rest[j] - rest[i], u[j] - u[i]
    length, own = np.linalg.norm(d + change, axis=1), np.linalg.norm(d, axis=1)
    # As in the force: small strains keep their digits.
    stretch = np.einsum("si,si->s", 2.0 * d + change, change) / (length + own) + (own - natural)
    return SpringMeasures(stretch / natural, k * stretch)


class NodalAverage:
    """Averages values of elements at the nodes of a mesh, weighted by volume (or equally).

    Args:
        elements: nodes of each element, an array of shape (elements, corners) for each kind.
        nodes: number of nodes.
        weights: of the elements, as rest volumes [m³], shape (elements,); left out, 1.
    """

    def __init__(
        self,
        elements: Sequence[NDArray[np.integer]],
        nodes: int,
        weights: Floats | None = None,
    ) -> None:
        self._corners = np.concatenate([np.asarray(own).ravel() for own in elements])
        self._width = np.concatenate([np.full(len(own), own.shape[1]) for own in elements])
        self._nodes = nodes
        self._weights = np.ones(len(self._width)) if weights is None else weights
        total = self._sum(self._weights)
        self._scale = np.divide(1.0, total, out=np.zeros(nodes), where=total > 0.0)

    def _sum(self, values: Floats) -> Floats:
        spread = np.repeat(values, self._width)
        total = np.bincount(self._corners, spread, minlength=self._nodes)
        return total.astype(np.float64, copy=False)

    def __call__(self, values: Any) -> Floats:
        """Nodal averages of `values`, shape (elements, …); 0 at nodes without elements."""
        rows = np.asarray(values, np.float64)
        columns = rows.reshape(len(rows), -1).T
        out = np.stack([self._sum(c * self._weights) * self._scale for c in columns], axis=1)
        return out.reshape(self._nodes, *rows.shape[1:])
