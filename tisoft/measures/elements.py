"""Strain and stress of each tet and spring, and their averages at nodes.

    F = I + H,  J = det F,  E = (FᵀF − I)/2,  S = F⁻¹P,  σ = P Fᵀ/J,  σ_vM = √(3/2 dev σ : dev σ)

| symbol | name           | unit |
| ------ | -------------- | ---- |
| E      | `strain`       | 1    |
| S      | `second_piola` | Pa   |
| σ      | `cauchy`       | Pa   |
| J      | `volume_ratio` | 1; at or below 0 the tet is inverted |

Bodies of linear elasticity have one strain e = (H + Hᵀ)/2 and one stress.  Stresses are the elastic
ones, without viscosity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.equilibrium.operators import plain_body
from tisoft.measures.kernels import make_measures
from tisoft.model.part import Part
from tisoft.model.system import System

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class TetMeasures:
    """Strain and stress of one body's tets, in the mesh's order, f64."""

    strain: Floats
    """Green's strain, shape (tets, 3, 3)."""
    second_piola: Floats
    """Second Piola-Kirchhoff stress [Pa], shape (tets, 3, 3)."""
    cauchy: Floats
    """Cauchy stress [Pa], shape (tets, 3, 3); 0 in a tet without volume."""
    von_mises: Floats
    """Von Mises stress of `cauchy` [Pa], shape (tets,)."""
    volume_ratio: Floats
    """Volume over volume at rest, shape (tets,)."""

    @property
    def inverted(self) -> int:
        """Number of tets turned inside out or flat."""
        return int(np.count_nonzero(self.volume_ratio <= 0.0))


@dataclass(frozen=True)
class SpringMeasures:
    """Strain and tension of one body's springs, in the order of `Body.springs`, f64."""

    strain: Floats
    """(L − L₀)/L₀, shape (springs,)."""
    tension: Floats
    """k (L − L₀) [N], shape (springs,)."""


class TetGauge:
    """Measures the tets of one body, on fields of its own in f64 (where the device has it)."""

    def __init__(self, part: Part) -> None:
        self.part = part
        precision = "f64" if runtime.has_f64() else "f32"
        self._system = System([plain_body(part.body)], precision)
        self._model = part.body.model
        share = self._system.shares[0]
        self._first = share.row("batches")
        # The mesh's own order, so that nothing is permuted afterwards.
        own = self._system.parts[0]
        self._place = own.place[np.argsort(own.tet_order)].astype(np.int32)
        self._launch = self._system.lease.arena.kernel(
            ("measures", share.block), lambda: make_measures(self._system.state, share.block)
        )
        count = len(part.tets)
        shapes: list[tuple[int, ...]] = [(count, 3, 3)] * 3 + [(count,)] * 2
        self._outs = [np.zeros(shape, self._system.real) for shape in shapes]

    def read(self, u: NDArray[Any]) -> TetMeasures:
        """The tets' strain and stress at displacements u [m] of the body's nodes."""
        if self.part.body.model is not self._model:
            self._model = self.part.body.model
            self._system.parts[0].body = plain_body(self.part.body)
            self._system.reread_models()
        self._system.set_motion(u, np.zeros_like(u))
        self._launch(self._first, self._place, *self._outs)
        return TetMeasures(*(np.array(out, np.float64) for out in self._outs))


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
        elements: nodes of each element, shape (elements, corners).
        nodes: number of nodes.
        weights: of the elements, as rest volumes [m³], shape (elements,); left out, 1.
    """

    def __init__(
        self, elements: NDArray[np.integer], nodes: int, weights: Floats | None = None
    ) -> None:
        self._corners = np.asarray(elements).ravel()
        self._width = elements.shape[1]
        self._nodes = nodes
        self._weights = np.ones(len(elements)) if weights is None else weights
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
