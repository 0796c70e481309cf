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

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime
from tisoft.dynamics.part import Part, law_of
from tisoft.dynamics.system import System
from tisoft.measures.kernels import tet_measures
from tisoft.models import laws
from tisoft.models.materials import SolidModel

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
    """Measures the tets of one body in a System's present state."""

    def __init__(self, system: System, part: Part) -> None:
        assert isinstance(part.body.model, SolidModel)
        self.part = part
        wide = np.float64 if runtime.has_f64() else np.float32
        count = len(part.tets)
        shapes: list[tuple[int, ...]] = [(count, 3, 3)] * 3 + [(count,)] * 2
        self._outs = [runtime.array(np.zeros(shape, wide)) for shape in shapes]
        self._numbers = runtime.array(np.zeros(2, wide))
        self._law = law_of(part.body.model)
        # The mesh's own order, so that nothing is permuted afterwards.
        back = np.argsort(part.tet_order)
        tets = np.ascontiguousarray((part.tets + part.start)[back], np.int32)
        gradient = np.ascontiguousarray(part.gradient[back], wide)
        self._launch: Callable[..., None] = runtime.bind(
            tet_measures, self._law, runtime.array(tets), runtime.array(gradient), self._numbers,
            system.u, *self._outs,
        )  # fmt: skip

    def read(self) -> TetMeasures:
        """The tets' present strain and stress."""
        model = self.part.body.model
        assert isinstance(model, SolidModel)
        numbers = laws.law_constants(self._law, model.lame_lambda, model.lame_mu)
        runtime.write(self._numbers, np.array(numbers))
        self._launch()
        return TetMeasures(*(np.array(runtime.read(out), np.float64) for out in self._outs))


def measure_springs(system: System, part: Part) -> SpringMeasures:
    """The springs' present strain and tension."""
    u = np.asarray(runtime.read(system.u)[part.nodes], np.float64)
    rest = system.rest_host[part.nodes]
    i, j = part.springs.T
    k, natural = part.spring_numbers[:, 0], part.spring_numbers[:, 1]
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
