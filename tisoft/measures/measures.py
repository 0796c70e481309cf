"""Measures: what can be read off a running scene besides positions and energies."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tisoft import checks
from tisoft.body import Body
from tisoft.measures.elements import (
    CellGauge,
    CellMeasures,
    NodalAverage,
    SpringMeasures,
    measure_springs,
)
from tisoft.measures.momentum import angular_momentum, linear_momentum
from tisoft.model.part import Part
from tisoft.model.system import System

Floats = NDArray[np.float64]


class Measured(Protocol):
    """What measures ask of a running scene."""

    system: System

    def part(self, body: Body) -> Part:
        """A body's share of the arrays."""
        ...

    def whole_velocities(self) -> Floats:
        """Velocities [m/s] of all nodes at the present time, shape (nodes, 3), internal order."""
        ...


class Measures:
    """Reads strain, stress and momentum off a simulation's present state, `simulation.measures`."""

    def __init__(self, simulation: Measured) -> None:
        self._simulation = simulation
        self._gauges: dict[int, CellGauge] = {}
        self._averages: dict[int, NodalAverage] = {}

    def elements(self, body: Body) -> CellMeasures | SpringMeasures:
        """Strain and stress of a body's cells, in the mesh's order, or of its springs."""
        part = self._simulation.part(body)
        if part.is_springs:
            return measure_springs(part, self._u(part))
        return self._gauge(part).read(self._u(part))

    def of_cells(self, body: Body, name: str) -> Floats:
        """One field of `CellMeasures` alone, of a body with cells, shape (cells, …)."""
        part = self._simulation.part(body)
        return self._gauge(part).read_one(self._u(part), name)

    def nodal(self, body: Body, values: Any) -> Floats:
        """Averages at nodes, shape (nodes, …), of values per cell (by volume) or spring; raises
        SceneError for another number of values.
        """
        part = self._simulation.part(body)
        count = len(part.springs) if part.is_springs else part.elements
        what = "a value for each spring" if part.is_springs else "a value for each cell"
        rows = checks.floats("values", values, (count, ...), what)
        if part.index not in self._averages:
            mesh = body.mesh
            if part.is_springs:
                average = NodalAverage([body.springs()], len(mesh.points))
            else:
                volumes = np.empty(part.elements)
                volumes[part.cell_order] = part.volume
                average = NodalAverage(list(mesh.cells.values()), len(mesh.points), volumes)
            self._averages[part.index] = average
        return self._averages[part.index](rows)

    def inverted(self, body: Body | None = None) -> int:
        """Number of cells of a body, or of all, that are turned inside out or flat."""
        parts = [part for part in self._parts(body) if not part.is_springs]
        return sum(self._gauge(part).read(self._u(part)).inverted for part in parts)

    def momentum(self, body: Body | None = None) -> Floats:
        """Linear momentum [kg·m/s] of a body, or of all, shape (3,)."""
        return linear_momentum(self._parts(body), self._simulation.whole_velocities())

    def angular_momentum(self, body: Body | None = None, *, about: Any = (0.0, 0.0, 0.0)) -> Floats:
        """Angular momentum about a point [m] of a body, or of all [kg·m²/s], shape (3,)."""
        seen = self._simulation.system.world() - checks.vector("about", about, unit="m")
        return angular_momentum(self._parts(body), seen, self._simulation.whole_velocities())

    def _parts(self, body: Body | None) -> Any:
        simulation = self._simulation
        return simulation.system.parts if body is None else [simulation.part(body)]

    def _u(self, part: Part) -> Floats:
        return self._simulation.system.u[part.nodes].astype(np.float64)

    def _gauge(self, part: Part) -> CellGauge:
        if part.index not in self._gauges:
            self._gauges[part.index] = CellGauge(part)
        return self._gauges[part.index]
