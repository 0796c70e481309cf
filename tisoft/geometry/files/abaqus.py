"""Abaqus input files: parts, instances with their placement, node and element sets, surfaces.

Every part counts its nodes and elements for itself; an instance is a copy of a part, moved and then
turned.  Whatever generates nodes or elements, or places them in another system, is refused by name.
Source: the Abaqus keywords guide.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from tisoft.errors import MeshError
from tisoft.geometry.files.abaqus_lines import Card, cards, table
from tisoft.geometry.files.abaqus_parts import Instance, Scope, key, kind_of
from tisoft.geometry.files.abaqus_sets import Joined
from tisoft.geometry.files.content import Content

_GENERATING = {
    "NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM", "TRANSFORM NODES",
    "SUBSTRUCTURE GENERATE", "SYMMETRIC MODEL GENERATION",
}  # fmt: skip
"""Keywords that make nodes or elements, or place them."""
_JOINING = {
    "TIE", "EQUATION", "MPC", "COUPLING", "KINEMATIC COUPLING", "DISTRIBUTING COUPLING",
    "RIGID BODY", "EMBEDDED ELEMENT", "SHELL TO SOLID COUPLING", "FASTENER", "BOUNDARY", "CLOAD",
    "DLOAD", "DSLOAD", "INITIAL CONDITIONS", "CONTACT PAIR", "CONTACT", "AMPLITUDE",
    "PRE-TENSION SECTION",
}  # fmt: skip
"""Keywords whose effect is lost where they are not taken over."""


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
            self._scope = self.parts.setdefault(
                key(options.get("NAME", "")), Scope(options.get("NAME", ""))
            )
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
                f"line {card.line}: *{word} makes or places nodes and elements by rule, which is "
                "not read; write them out (an input file of the flattened mesh)"
            )
        elif word in _JOINING:
            self.ignored[word] += 1

    def _begin_instance(self, card: Card) -> None:
        name, part = card.options.get("NAME", ""), key(card.options.get("PART", ""))
        if "LIBRARY" in card.options:
            raise MeshError(f"instance {name!r} is of a library; only meshes in the file are read")
        scope = self.parts.get(part)
        if scope is None:
            raise MeshError(
                f"instance {name!r} is of part {part!r}, which the file does not define"
            )
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
        joined = Joined(content, placed)
        joined.add_sets()
        for keyword, count in self.ignored.items():
            content.warnings.append(
                f"*{keyword} ({count} of them) is not taken over: say it with pins and loads"
                if keyword
                in ("BOUNDARY", "CLOAD", "DLOAD", "DSLOAD", "INITIAL CONDITIONS", "AMPLITUDE")
                else f"*{keyword} ({count} of them) is not taken over: what it joins stays apart"
            )
        return content


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
        scope.element_sets.setdefault(elset, []).append(
            Card("ELSET", {}, [], card.line, rows[:, 0])
        )


def _floats(row: list[str], line: int) -> list[float]:
    try:
        return [float(word.lower().replace("d", "e")) if word.strip() else 0.0 for word in row]
    except ValueError:
        raise MeshError(f"line {line}: {', '.join(row)[:60]!r} should be numbers") from None
