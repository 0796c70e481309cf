"""Abaqus input files: parts, instances with their placement, node and element sets, surfaces.

Every part counts its nodes and elements for itself; an instance is a copy of a part, moved and then
turned.  Whatever generates nodes or elements, or places them in another system, is refused by name.
Source: the Abaqus keywords guide.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError
from tisoft.geometry.files import kinds
from tisoft.geometry.files.abaqus_lines import Card, cards, names_and_numbers, table
from tisoft.geometry.files.content import Content, Floats, Group, Ints, numbered
from tisoft.geometry.files.kinds import Kind

_GENERATING = {
    "NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM", "TRANSFORM NODES",
    "SUBSTRUCTURE GENERATE", "SYMMETRIC MODEL GENERATION",
}  # fmt: skip
"""Keywords that make nodes or elements, or place them."""
_JOINING = {
    "TIE", "EQUATION", "MPC", "COUPLING", "KINEMATIC COUPLING", "DISTRIBUTING COUPLING",
    "RIGID BODY", "EMBEDDED ELEMENT", "SHELL TO SOLID COUPLING", "FASTENER", "BOUNDARY", "CLOAD",
    "DLOAD", "DSLOAD", "INITIAL CONDITIONS", "CONTACT PAIR", "CONTACT", "AMPLITUDE", "PRE-TENSION SECTION",
}  # fmt: skip
"""Keywords whose effect is lost where they are not taken over."""

_FACES: dict[int, list[tuple[int, ...]]] = {
    4: [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)],
    8: [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)],
    6: [(0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)],
    5: [(0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)],
}
"""Faces S1, S2, … of solids, by their number of corners."""


_SOLIDS = re.compile(r"(?:A?C3D|DCC?3D|Q3D|C3DT|CSS|SC|EC3D|PC3D|C3D)(\d+)(?!\d).*")
_FLAT = re.compile(r"(?:CPS|CPE|CPEG|CAX|DC2D|S|STRI|M3D|SFM3D|R3D|DS)(\d)(?!\d).*")
_LINES = re.compile(r"(?:T3D|T2D|R2D|RB3D)(\d)(?!\d).*")
_NO_STIFFNESS = re.compile(r"(?:CPS|CPE|CAX|DC2D|SFM3D|R3D|R2D|DS|MASS|ROTARYI).*")
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


def read_abaqus(path: Path) -> Content:
    """The mesh of an Abaqus file; raises MeshError, naming the keyword, for what it cannot read."""
    model = _Model()
    for card in cards(path):
        model.take(card)
    return model.content()


class _Model:
    """The parts and instances told so far."""

    def __init__(self) -> None:
        self.flat = Scope("")
        self.parts: dict[str, Scope] = {}
        self.instances: list[Instance] = []
        self.ignored: Counter[str] = Counter()
        self._scope = self.flat
        self._in_assembly = False

    def take(self, card: Card) -> None:
        """One keyword with its rows."""
        word, options = card.word, card.options
        if word == "PART":
            self._scope = self.parts.setdefault(_key(options.get("NAME", "")), Scope(options.get("NAME", "")))
        elif word == "INSTANCE":
            self._begin_instance(card)
        elif word in ("END PART", "END INSTANCE", "END ASSEMBLY"):
            self._scope = self.flat
        elif word == "NODE":
            _add_nodes(self._scope, card)
        elif word == "ELEMENT":
            _add_elements(self._scope, card)
        elif word == "NSET":
            self._scope.node_sets.setdefault(options.get("NSET", ""), []).append(card)
        elif word == "ELSET":
            self._scope.element_sets.setdefault(options.get("ELSET", ""), []).append(card)
        elif word == "SURFACE":
            self._scope.surfaces.setdefault(options.get("NAME", ""), []).append(card)
        elif word in _GENERATING:
            raise MeshError(
                f"line {card.line}: *{word} makes or places nodes and elements by rule, which is not "
                "read; write them out (an input file of the flattened mesh)"
            )
        elif word in _JOINING:
            self.ignored[word] += 1

    def _begin_instance(self, card: Card) -> None:
        name, part = card.options.get("NAME", ""), _key(card.options.get("PART", ""))
        if "LIBRARY" in card.options:
            raise MeshError(f"instance {name!r} is of a library; only meshes in the file are read")
        scope = self.parts.get(part)
        if scope is None:
            raise MeshError(f"instance {name!r} is of part {part!r}, which the file does not define")
        shift, turn = np.zeros(3), None
        rows = [_floats(row, card.line) for row in card.rows]
        if rows:
            shift = np.array((rows[0] + [0.0] * 3)[:3])
        if len(rows) > 1:
            given = (rows[1] + [0.0] * 7)[:7]
            turn = (np.array(given[:3]), np.array(given[3:6]), given[6])
        own = Scope(scope.name) if not scope.labels else None
        self.instances.append(Instance(name, own or scope, shift, turn))
        self._scope = own or self.flat

    def content(self) -> Content:
        """All instances, and what stands outside parts, as one mesh."""
        placed = [Instance("", self.flat, np.zeros(3)), *self.instances]
        used = {id(instance.scope) for instance in self.instances}
        content = Content(np.empty((0, 3)))
        if not self.instances:
            placed += [Instance(part.name, part, np.zeros(3)) for part in self.parts.values()]
        else:
            for part in self.parts.values():
                if id(part) not in used and part.labels:
                    content.warnings.append(f'part "{part.name}" has no instance and is left out')
        joined = _Joined(content, placed)
        joined.add_sets()
        for keyword, count in self.ignored.items():
            content.warnings.append(
                f"*{keyword} ({count} of them) is not taken over: say it with pins and loads"
                if keyword in ("BOUNDARY", "CLOAD", "DLOAD", "DSLOAD", "INITIAL CONDITIONS", "AMPLITUDE")
                else f"*{keyword} ({count} of them) is not taken over: what it joins stays apart"
            )
        return content


class _Joined:
    """Instances put into one list of nodes and of elements, with their sets."""

    def __init__(self, content: Content, placed: list[Instance]) -> None:
        self.content = content
        self._placed = placed
        self._nodes: dict[str, tuple[Ints, int]] = {}
        """By instance: labels, and the first place of its nodes."""
        self._cells: dict[str, list[tuple[Ints, int]]] = {}
        """By instance: labels of each block, and the first place of its cells."""
        self._surfaces: list[Group] = []
        for instance in placed:
            self._add(instance)

    def _add(self, instance: Instance) -> None:
        scope, content = instance.scope, self.content
        labels, points = _once(scope)
        first = len(content.points)
        content.points = np.concatenate([content.points, instance.place(points)])
        self._nodes[_key(instance.name)] = (labels, first)
        blocks = self._cells.setdefault(_key(instance.name), [])
        whose = f" of {instance.name!r}" if instance.name else ""
        for kind, rows in _by_kind(scope):
            blocks.append((rows[:, 0], content.cells()))
            content.blocks.append((kind, numbered(rows[:, 1:], labels, kind.name + whose) + first))
        for name, count in scope.left_out.items():
            told = content.notes if _NO_STIFFNESS.fullmatch(name) else content.warnings
            told.append(f"{count} elements of type {name}{whose} are left out")

    def add_sets(self) -> None:
        """Sets of all instances, those of one name together."""
        found: list[tuple[str, str, Ints]] = []
        for instance in self._placed:
            home = _key(instance.name)
            for name in instance.scope.node_sets:
                found.append(("node", name, self._node_set(instance.scope, name, home, set())))
            for name in instance.scope.element_sets:
                found.append(("cell", name, self._cell_set(instance.scope, name, home, set())))
            for name, told in instance.scope.surfaces.items():
                for card in told:
                    self._add_surface(instance.scope, name, card, home, found)
        for what, groups in (("node", self.content.node_groups), ("cell", self.content.cell_groups)):
            for name in dict.fromkeys(name for kind, name, _ in found if kind == what and name):
                mine = [rows for kind, other, rows in found if (kind, other) == (what, name)]
                members = np.unique(np.concatenate(mine))
                tag = int(name) if name.isdecimal() else None
                if len(members):
                    groups.append(Group(name, tag, members))

    def _node_set(self, scope: Scope, name: str, home: str, seen: set[str]) -> Ints:
        """Places of the nodes of a set, which may be given by other sets."""
        parts = [np.empty(0, np.int64)]
        for card in _named(scope.node_sets, name):
            where = _key(card.options.get("INSTANCE", "")) or home
            if "ELSET" in card.options:
                cells = self._cell_set(scope, card.options["ELSET"], home, seen)
                parts.append(self._nodes_of(cells))
                continue
            labels, words = names_and_numbers(card)
            parts.append(self._node_places(where, labels))
            for word in words:
                instance, dot, label = word.partition(".")
                if dot and label.isdecimal():
                    parts.append(self._node_places(_key(instance), np.array([int(label)])))
                elif _key(word) not in seen:
                    parts.append(self._node_set(scope, word, home, seen | {_key(word)}))
        return np.unique(np.concatenate(parts))

    def _cell_set(self, scope: Scope, name: str, home: str, seen: set[str]) -> Ints:
        parts = [np.empty(0, np.int64)]
        for card in _named(scope.element_sets, name):
            where = _key(card.options.get("INSTANCE", "")) or home
            labels, words = names_and_numbers(card)
            parts.append(self._cell_places(where, labels))
            for word in words:
                instance, dot, label = word.partition(".")
                if dot and label.isdecimal():
                    parts.append(self._cell_places(_key(instance), np.array([int(label)])))
                elif _key(word) not in seen:
                    parts.append(self._cell_set(scope, word, home, seen | {_key(word)}))
        return np.unique(np.concatenate(parts))

    def _add_surface(
        self, scope: Scope, name: str, card: Card, home: str, found: list[tuple[str, str, Ints]]
    ) -> None:
        """Faces of elements become triangles and quadrangles; node surfaces are node sets."""
        nodal = card.options.get("TYPE", "ELEMENT").upper() == "NODE"
        for row in card.rows:
            what = row[0].strip() if row else ""
            side = row[1].strip().upper() if len(row) > 1 else ""
            if nodal:
                made = Card("NSET", {}, [[what]], card.line)
                inner = Scope("", node_sets={**scope.node_sets, "": [made]})
                found.append(("node", name, self._node_set(inner, "", home, set())))
                continue
            made = Card("ELSET", {}, [[what]], card.line)
            inner = Scope("", element_sets={**scope.element_sets, "": [made]})
            cells = self._cell_set(inner, "", home, set())
            if re.fullmatch(r"S[1-6]", side):
                self._add_faces(name, cells, int(side[1]) - 1, found)

    def _add_faces(
        self, name: str, cells: Ints, side: int, found: list[tuple[str, str, Ints]]
    ) -> None:
        place = 0
        for kind, rows in list(self.content.blocks):
            mine = cells[(cells >= place) & (cells < place + len(rows))] - place
            place += len(rows)
            faces = _FACES.get(kind.corners, []) if kind.dim == 3 else []
            if len(mine) and side < len(faces):
                corners = rows[mine][:, list(faces[side])]
                first = self.content.cells()
                flat = kinds.TRIANGLE if corners.shape[1] == 3 else kinds.QUAD
                self.content.blocks.append((flat, corners))
                found.append(("cell", name, first + np.arange(len(corners))))

    def _nodes_of(self, cells: Ints) -> Ints:
        parts, place = [np.empty(0, np.int64)], 0
        for _, rows in self.content.blocks:
            mine = cells[(cells >= place) & (cells < place + len(rows))] - place
            parts.append(rows[mine].ravel())
            place += len(rows)
        return np.unique(np.concatenate(parts))

    def _node_places(self, instance: str, wanted: Ints) -> Ints:
        labels, first = self._nodes.get(instance, (np.empty(0, np.int64), 0))
        return first + np.flatnonzero(np.isin(labels, wanted))

    def _cell_places(self, instance: str, wanted: Ints) -> Ints:
        blocks = self._cells.get(instance, [])
        found = [first + np.flatnonzero(np.isin(labels, wanted)) for labels, first in blocks]
        return np.concatenate([np.empty(0, np.int64), *found])


def _add_nodes(scope: Scope, card: Card) -> None:
    if card.options.get("SYSTEM", "R").upper() not in ("R", ""):
        raise MeshError(
            f"line {card.line}: *NODE is given in another system of coordinates "
            f"(SYSTEM={card.options['SYSTEM']}); only rectangular ones are read"
        )
    rows = table(card, 4, filled=True)
    if not len(rows):
        return
    labels = rows[:, 0].astype(np.int64)
    scope.labels.append(labels)
    scope.places.append(rows[:, 1:4])
    if name := card.options.get("NSET"):
        scope.node_sets.setdefault(name, []).append(Card("NSET", {}, [], card.line, labels))


def _add_elements(scope: Scope, card: Card) -> None:
    name = card.options.get("TYPE", "").upper()
    kind = kind_of(name)
    try:
        rows = None if kind is None else table(card, 1 + kind.nodes).astype(np.int64)
    except MeshError:
        if kind is not None and kind.dim == 3:
            raise
        rows = None  # elements that are not needed
    if kind is None or kind.dim < 3:
        count = len(card.text.split(b"\n")) - 1 if rows is None else len(rows)
        scope.left_out[name or "(none)"] += count
    if kind is None or rows is None or not len(rows):
        return
    scope.elements.append((kind, rows))
    if elset := card.options.get("ELSET"):
        scope.element_sets.setdefault(elset, []).append(Card("ELSET", {}, [], card.line, rows[:, 0]))


def _once(scope: Scope) -> tuple[Ints, Floats]:
    """Labels and positions; a node that is given again in the same place counts once."""
    labels = np.concatenate([np.empty(0, np.int64), *scope.labels])
    points = np.concatenate([np.empty((0, 3)), *scope.places])
    unique, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    if len(unique) == len(labels):
        return labels, points
    moved = (points != points[first[inverse.ravel()]]).any(axis=1)
    if moved.any():
        raise MeshError(
            f"node {labels[moved][0]}{f' of part {scope.name!r}' if scope.name else ''} is given "
            "twice, in two places; number the nodes anew"
        )
    kept = np.sort(first)
    return labels[kept], points[kept]


def _by_kind(scope: Scope) -> list[tuple[Kind, Ints]]:
    """Elements of a kind together, in the file's order."""
    kinds_there = dict.fromkeys(kind for kind, _ in scope.elements)
    return [(k, np.concatenate([rows for kind, rows in scope.elements if kind == k])) for k in kinds_there]


def _named(sets: dict[str, list[Card]], name: str) -> list[Card]:
    return [card for key, found in sets.items() if _key(key) == _key(name) for card in found]


def _key(name: str) -> str:
    """Names do not heed case or quotes."""
    return name.strip().strip('"').lower()


def _floats(row: list[str], line: int) -> list[float]:
    try:
        return [float(word.lower().replace("d", "e")) if word.strip() else 0.0 for word in row]
    except ValueError:
        raise MeshError(f"line {line}: {', '.join(row)[:60]!r} should be numbers") from None
