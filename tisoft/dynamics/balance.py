"""The static problem of one body: what its nodes must balance at a load factor.

    f(u) + s L(u) − (1 − s) f(X) = 0 on free axes,   u = place(s) on held axes,   0 ≤ s ≤ 1

with L = gravity and loads, and s the load factor.  f(X), the forces of a net whose springs are not
at their rest lengths, is let go as the load comes on, so that the branch begins at rest.  Pins move
with s as well: along straight lines, or turned by s times their angle.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from tisoft.dynamics.operators import Elastic
from tisoft.dynamics.system import Part
from tisoft.errors import NoEquilibrium
from tisoft.models.laws import LINEAR

Floats = NDArray[np.float64]

TARGET = 1e-12
"""Out-of-balance forces that end an iteration, as a share of the load."""
ACCEPTED = 1e-8
"""Out-of-balance forces that are still an answer where rounding allows no less."""


def held_axes(part: Part, time: float) -> NDArray[np.bool_]:
    """Whether pins hold each node along each axis at `time` [s], shape (nodes, 3), inside order."""
    held = np.zeros((len(part.order), 3), bool)
    for pin in part.body.pins:
        if pin.release is None or time < pin.release:
            inside = part.rank[part.body.nodes(pin.where)]
            held[np.ix_(inside, ["xyz".index(axis) for axis in pin.axes])] = True
    return held


def pin_places(part: Part, time: float, factor: float) -> Floats:
    """Prescribed displacements [m] at a load factor, zero where free, shape (nodes, 3)."""
    place = np.zeros((len(part.order), 3))
    for pin in part.body.pins:
        if pin.release is not None and time >= pin.release:
            continue
        rows = part.body.nodes(pin.where)
        points = part.body.mesh.points[rows]
        if pin.turn is not None:
            way = replace(pin.turn, rate=factor * pin.turn.rate).displacement(points, time)
        else:
            way = factor * pin.displacement(points, time)
        axes = ["xyz".index(axis) for axis in pin.axes]
        moved = np.ix_(part.rank[rows], axes)
        # Of two pins that hold a node, one may be still: the moving one tells where it is.
        place[moved] = np.where(way[:, axes] != 0.0, way[:, axes], place[moved])
    return place


class Balance:
    """One body's static problem; all arrays (nodes, 3), inside order.

    Args:
        part: the body.
        time: when loads and pins are looked at [s].
        load: dead forces of gravity and loads at factor 1 [N].
    """

    def __init__(self, part: Part, time: float, load: Floats) -> None:
        self.part = part
        self.time = time
        self.elastic = Elastic(part)
        self.held = held_axes(part, time)
        self.free = ~self.held
        self.load = load
        self.linear = len(part.tets) > 0 and self.elastic.law == LINEAR
        self.start = self.elastic.force(np.zeros_like(load))
        self.start[self.held] = 0.0

    def place(self, factor: float) -> Floats:
        """Prescribed displacements at a load factor [m]."""
        return pin_places(self.part, self.time, factor)

    def external(self, factor: float) -> Floats:
        """All that the elastic forces must balance, apart from reactions [N]."""
        return factor * self.load - (1.0 - factor) * self.start

    def out_of_balance(self, u: Floats, factor: float) -> tuple[Floats, Floats]:
        """Forces left over on free axes, and the pins' forces on held ones [N]."""
        total = self.elastic.force(u) + self.external(factor)
        return np.where(self.free, total, 0.0), np.where(self.held, -total, 0.0)

    def scale(self, factor: float, reactions: Floats) -> float:
        """What residuals are compared with [N]: the largest nodal load, or reaction without any."""
        load = largest(np.where(self.free, self.external(factor), 0.0))
        return load if load > 0.0 else largest(reactions)

    def potential(self, u: Floats, factor: float) -> tuple[float, float]:
        """V(u) − s L·u [J], and the size of its terms, on which its rounding depends."""
        elastic = self.elastic.energy(u)
        work = float((self.external(factor) * u).sum())
        return elastic - work, abs(elastic) + abs(work)

    def is_admissible(self, u: Floats) -> bool:
        """Whether all is finite and no tet inverted (a linear body never says so itself)."""
        if not np.isfinite(u).all():
            return False
        return self.linear or self.elastic.least_volume_change(u) > 0.0

    def check_holds(self) -> None:
        """Raises NoEquilibrium where a piece is free to fly along an axis that loads push along."""
        part, nodes = self.part, self.elastic.nodes
        pairs = [part.tets[:, [0, k]] for k in (1, 2, 3)] + [part.springs]
        ends = np.concatenate([p.reshape(-1, 2).astype(np.int64) for p in pairs])
        graph = sparse.coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), (nodes, nodes))
        count, piece = connected_components(graph, directed=False)
        for k, axis in enumerate("xyz"):
            held = np.bincount(piece, self.held[:, k], minlength=count) > 0
            push = np.abs(np.bincount(piece, self.load[:, k], minlength=count))
            size = np.bincount(piece, np.abs(self.load).sum(axis=1), minlength=count)
            flying = np.flatnonzero(~held & (push > 1e-9 * size))
            if len(flying):
                node = int(part.order[np.flatnonzero(piece == flying[0])[0]])
                number = int(part.body.mesh.kept_nodes[node])
                raise no_equilibrium(
                    f"no pin holds the piece of {part.body.name!r} with node {number} along "
                    f"{axis}, where {push[flying[0]]:.4g} N push it",
                    0.0,
                )


def largest(forces: Floats) -> float:
    """Length of the longest row."""
    return float(np.sqrt(np.einsum("ni,ni->n", forces, forces).max(initial=0.0)))


def no_equilibrium(text: str, factor: float) -> NoEquilibrium:
    """The error, with the last load factor that had an equilibrium as `load_factor`."""
    error = NoEquilibrium(text)
    error.load_factor = factor  # type: ignore[attr-defined]
    return error
