"""What probes follow: nodes, or points of surfaces that bodies carry, x = Σ w_k x_k."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tisoft.body import Body
from tisoft.checks import FieldError
from tisoft.scene_parts import Probe
from tisoft.where import Nearest, Nodes

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Probed:
    """What one probe follows."""

    body: Body
    number: int
    """The file's number of the node, or of the point of the carried surface."""
    rows: NDArray[np.int64]
    """Rows of `mesh.points`, shape (k,)."""
    weights: Floats
    """Their shares, shape (k,)."""

    def at(self, values: Floats) -> Floats:
        """The value there of values at the body's nodes, shape (nodes, …)."""
        return np.asarray(self.weights @ values[self.rows])


def probed(body: Body, probe: Probe) -> Probed:
    """What a probe of a body follows: by `point`, the nearest point of what is drawn of it.

    Raises:
        FieldError: a node that is not there.
    """
    mesh, skin = body.mesh, body.skin
    if skin is None or (probe.node is not None and getattr(mesh, "cage", None) is None):
        row = _row(probe, mesh.points) if probe.node is None else _numbered(probe, body)
        return Probed(body, int(mesh.kept_nodes[row]), np.array([row]), np.ones(1))
    places = skin.carried(mesh.points)
    row = _row(probe, places)
    return Probed(body, row, skin.corners[row].astype(np.int64), skin.weights[row])


def _row(probe: Probe, places: Floats) -> int:
    if probe.point is not None:
        return int(Nearest(probe.point).select(places)[0])
    assert probe.node is not None
    with _as_node(probe):
        return int(Nodes((probe.node,)).select(places)[0])


def _numbered(probe: Probe, body: Body) -> int:
    assert probe.node is not None
    with _as_node(probe):
        return int(Nodes((probe.node,)).rows_in(body.mesh)[0])


@contextmanager
def _as_node(probe: Probe) -> Iterator[None]:
    try:
        yield
    except FieldError as error:
        raise FieldError("node", error.problem, probe.node) from None


def places_of(found: Sequence[Probed], rows: Floats) -> Floats:
    """Values of probes, shape (…, probes, 3), of those at all their rows, one after the other,
    shape (…, rows, 3).  Frame by frame or of many frames, the same bits.
    """
    values = np.zeros((*rows.shape[:-2], len(found), 3))
    first = 0
    for k, own in enumerate(found):
        for j, weight in enumerate(own.weights.tolist(), first):
            values[..., k, :] += weight * rows[..., j, :]
        first += len(own.rows)
    return values
