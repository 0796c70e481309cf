"""Parts and instances of an Abaqus file, and its element types."""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from tisoft.errors import MeshError
from tisoft.geometry.files import kinds
from tisoft.geometry.files.abaqus_lines import Card
from tisoft.geometry.files.content import Floats, Ints
from tisoft.geometry.files.kinds import Kind

_SOLIDS = re.compile(r"(?:A?C3D|DCC?3D|Q3D|C3DT|CSS|SC|EC3D|PC3D|C3D)(\d+)(?!\d).*")
_FLAT = re.compile(r"(?:CPS|CPE|CPEG|CAX|DC2D|S|STRI|M3D|SFM3D|R3D|DS)(\d)(?!\d).*")
_LINES = re.compile(r"(?:T3D|T2D|R2D|RB3D)(\d)(?!\d).*")
NO_STIFFNESS = re.compile(r"(?:CPS|CPE|CAX|DC2D|SFM3D|R3D|R2D|DS|MASS|ROTARYI).*")
"""Elements that meshers write for faces and edges, or that only carry loads or masses."""
_BY_NODES = (
    (_SOLIDS, {4: kinds.TET, 10: kinds.TET, 8: kinds.HEX, 20: kinds.HEX, 21: kinds.HEX,
               27: kinds.HEX, 6: kinds.WEDGE, 15: kinds.WEDGE, 18: kinds.WEDGE, 5: kinds.PYRAMID,
               13: kinds.PYRAMID}),
    (_FLAT, {3: kinds.TRIANGLE, 6: kinds.TRIANGLE, 4: kinds.QUAD, 8: kinds.QUAD, 9: kinds.QUAD}),
    (_LINES, {2: kinds.LINE, 3: kinds.LINE}),
)  # fmt: skip


def kind_of(name: str) -> Kind | None:
    """The kind of cell of an element type, as C3D4 or C3D20RH; None for what is no cell."""
    for pattern, bases in _BY_NODES:
        found = pattern.fullmatch(name)
        if found and int(found[1]) in bases:
            return kinds.of_order(bases[int(found[1])], int(found[1]))
    return None


@dataclass
class Scope:
    """One numbering: a part, an instance with a mesh of its own, or the model without parts."""

    name: str
    labels: list[Ints] = field(default_factory=list)
    places: list[Floats] = field(default_factory=list)
    elements: list[tuple[Kind, Ints]] = field(default_factory=list)
    """Rows of element number and node numbers."""
    node_sets: dict[str, list[Card]] = field(default_factory=dict)
    element_sets: dict[str, list[Card]] = field(default_factory=dict)
    surfaces: dict[str, list[Card]] = field(default_factory=dict)
    left_out: Counter[str] = field(default_factory=Counter)


@dataclass
class Instance:
    """A copy of a part, placed."""

    name: str
    scope: Scope
    shift: Floats
    turn: tuple[Floats, Floats, float] | None = None
    """Two points of an axis, and the angle about it [degrees]."""

    def place(self, points: Floats) -> Floats:
        """Moved, then turned about the axis (Rodrigues)."""
        moved = points + self.shift
        if self.turn is None:
            return moved
        start, end, angle = self.turn
        length = float(np.linalg.norm(end - start))
        if length == 0.0:
            raise MeshError(f"instance {self.name!r} is turned about an axis without length")
        axis, arm = (end - start) / length, moved - start
        radians = math.radians(angle)
        along = (arm @ axis)[:, None] * axis
        return (
            start + along + (arm - along) * math.cos(radians)
            + np.cross(axis, arm) * math.sin(radians)
        )  # fmt: skip


def key(name: str) -> str:
    """Names do not heed case or quotes."""
    return name.strip().strip('"').lower()
