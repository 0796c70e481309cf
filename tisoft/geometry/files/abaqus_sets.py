"""Instances of an Abaqus file put together: one list of nodes and elements, with all their sets."""

from __future__ import annotations

import re

import numpy as np

from tisoft.errors import MeshError
from tisoft.geometry.files import kinds
from tisoft.geometry.files.abaqus_lines import Card, names_and_numbers
from tisoft.geometry.files.abaqus_parts import NO_STIFFNESS, Instance, Scope, key
from tisoft.geometry.files.content import Content, Floats, Group, Ints, numbered
from tisoft.geometry.files.kinds import Kind

_FACES: dict[int, list[tuple[int, ...]]] = {
    4: [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)],
    8: [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)],
    6: [(0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)],
    5: [(0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)],
}
"""Faces S1, S2, … of solids, by their number of corners."""


class Joined:
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
        self._nodes[key(instance.name)] = (labels, first)
        blocks = self._cells.setdefault(key(instance.name), [])
        whose = f" of {instance.name!r}" if instance.name else ""
        for kind, rows in _by_kind(scope):
            blocks.append((rows[:, 0], content.cells()))
            content.blocks.append((kind, numbered(rows[:, 1:], labels, kind.name + whose) + first))
        for name, count in scope.left_out.items():
            told = content.notes if NO_STIFFNESS.fullmatch(name) else content.warnings
            told.append(f"{count} elements of type {name}{whose} are left out")

    def add_sets(self) -> None:
        """Sets of all instances, those of one name together."""
        found: list[tuple[str, str, Ints]] = []
        for instance in self._placed:
            home = key(instance.name)
            for name in instance.scope.node_sets:
                found.append(("node", name, self._node_set(instance.scope, name, home, set())))
            for name in instance.scope.element_sets:
                found.append(("cell", name, self._cell_set(instance.scope, name, home, set())))
            for name, told in instance.scope.surfaces.items():
                for card in told:
                    self._add_surface(instance.scope, name, card, home, found)
        for what, groups in (
            ("node", self.content.node_groups),
            ("cell", self.content.cell_groups),
        ):
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
            where = key(card.options.get("INSTANCE", "")) or home
            if "ELSET" in card.options:
                cells = self._cell_set(scope, card.options["ELSET"], home, seen)
                parts.append(self._nodes_of(cells))
                continue
            labels, words = names_and_numbers(card)
            parts.append(self._node_places(where, labels))
            for word in words:
                instance, dot, label = word.partition(".")
                if dot and label.isdecimal():
                    parts.append(self._node_places(key(instance), np.array([int(label)])))
                elif key(word) not in seen:
                    parts.append(self._node_set(scope, word, home, seen | {key(word)}))
        return np.unique(np.concatenate(parts))

    def _cell_set(self, scope: Scope, name: str, home: str, seen: set[str]) -> Ints:
        parts = [np.empty(0, np.int64)]
        for card in _named(scope.element_sets, name):
            where = key(card.options.get("INSTANCE", "")) or home
            labels, words = names_and_numbers(card)
            parts.append(self._cell_places(where, labels))
            for word in words:
                instance, dot, label = word.partition(".")
                if dot and label.isdecimal():
                    parts.append(self._cell_places(key(instance), np.array([int(label)])))
                elif key(word) not in seen:
                    parts.append(self._cell_set(scope, word, home, seen | {key(word)}))
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
    return [
        (k, np.concatenate([rows for kind, rows in scope.elements if kind == k]))
        for k in kinds_there
    ]


def _named(sets: dict[str, list[Card]], name: str) -> list[Card]:
    return [card for other, found in sets.items() if key(other) == key(name) for card in found]
