"""Rigidity of spring networks: motions that no spring resists (`bracing` finds the springs that
would).

    R u = 0,   row of spring (a, b):  n · (u_a − u_b),   n = (x_a − x_b) / |x_a − x_b|

R is the rigidity matrix at rest (Maxwell 1864; Pellegrino & Calladine 1986, eq. 1). A connected
piece of N nodes has 3N − rank R − rank(rigid motions) zero-energy modes in space, and a flat one
2N − rank R − 3 in its plane.

| symbol | name         | meaning                                       | shape            |
|--------|--------------|-----------------------------------------------|------------------|
| x      | points       | rest positions [m]                            | (nodes, 3)       |
| n      | directions   | unit vectors of the springs                   | (springs, d)     |
| d      | dim          | dimensions that the piece fills: 3, 2, 1      |                  |
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tisoft.geometry.fronts import Ints, Kind, checked_net, eliminate, pieces_of

_RIGID_MOTIONS: dict[Kind, int] = {"point": 3, "line": 5, "flat": 6, "solid": 6}


@dataclass(frozen=True, eq=False)
class PieceRigidity:
    """Zero-energy modes of one connected piece of a spring network."""

    nodes: Ints
    """Nodes of the piece, ascending, shape (nodes of the piece,)."""
    kind: Kind
    """What the rest positions fill: "solid" space, "flat" a plane, "line", or "point"."""
    modes: int
    """Zero-energy modes in space, beyond rigid motion."""
    in_plane: int | None
    """Zero-energy modes within the plane of a flat piece, beyond rigid motion; None otherwise."""

    @property
    def mechanisms(self) -> int:
        """Modes worth a warning: of a flat piece those in its plane, of a line or point none."""
        if self.kind == "solid":
            return self.modes
        return self.in_plane or 0


@dataclass(frozen=True, eq=False)
class Rigidity:
    """Zero-energy modes of a spring network, beyond the rigid motions of every piece."""

    zero_energy_modes: int
    """Modes in space, summed over the pieces."""
    in_plane: int | None
    """Modes in their plane, summed over the flat pieces; None when no piece is flat."""
    pieces: tuple[PieceRigidity, ...]
    """Connected pieces in the order of their first nodes."""

    @property
    def mechanisms(self) -> int:
        """Modes worth a warning: in plane for flat pieces, in space for solid ones."""
        return sum(piece.mechanisms for piece in self.pieces)

    def warning(
        self,
        body: str,
        *,
        moving: Ints | None = None,
        missing: NDArray[np.integer] | None = None,
        after: Rigidity | None = None,
    ) -> str | None:
        """One sentence on the mechanisms of `body`, or None when there is nothing to warn of.

        `moving` are the nodes of the worst mechanism (`moving_nodes`), `missing` the proposed
        springs (`missing_springs`) and `after` the rigidity counted with them.
        """
        if not self.mechanisms:
            return None
        flat = {piece.kind == "flat" for piece in self.pieces if piece.mechanisms}
        where = "in its plane" if flat == {True} else "" if flat == {False} else "in plane or space"
        count = f"{self.mechanisms} mechanism{'s' if self.mechanisms > 1 else ''}"
        text = f'body "{body}" has {count} {where}'.rstrip() + ": motions that no spring resists"
        if moving is not None and len(moving):
            some = ", ".join(map(str, moving[:8])) + (", …" if len(moving) > 8 else "")
            text += f"; the worst moves {len(moving)} node{'s' * (len(moving) > 1)} ({some})"
        if missing is not None and len(missing):
            left = 0 if after is None else after.mechanisms
            end = f"leave {left}" if left else "remove them"
            text += f"; {len(missing)} more spring{'s' * (len(missing) > 1)} would {end}"
        return text


def rigidity(points: ArrayLike, springs: ArrayLike) -> Rigidity:
    """Count the zero-energy modes of a spring network at rest.

    `points` are rest positions [m], shape (nodes, 3); `springs` pairs of nodes, shape (springs, 2).
    Lengths and stiffnesses do not matter, nor do scale and attitude. Repeated springs count once;
    springs of zero length join pieces but resist nothing to first order. Raises `MeshError` for
    coordinates that are not finite and for springs between nodes that do not exist.
    """
    found = []
    for piece in pieces_of(*checked_net(points, springs)):
        rank = eliminate(piece)[0]
        size = len(piece.nodes)
        in_plane = 2 * size - rank - 3 if piece.kind == "flat" else None
        modes = 3 * size - rank - _RIGID_MOTIONS[piece.kind]
        found.append(PieceRigidity(piece.nodes, piece.kind, modes, in_plane))
    flat = [piece.in_plane for piece in found if piece.in_plane is not None]
    return Rigidity(sum(p.modes for p in found), sum(flat) if flat else None, tuple(found))
