"""MEDIT's text files (.mesh): vertices and cells with their references, of first and second order.

Source: Frey, "MEDIT: an interactive mesh visualization software" (2001), and its keywords since.
"""

from __future__ import annotations

import re

import numpy as np

from tisoft.errors import MeshError
from tisoft.geometry.files import kinds
from tisoft.geometry.files.content import Content, Floats, Ints, groups_by_number
from tisoft.geometry.files.text import numbers, whole

_BASES = {
    "edges": kinds.LINE, "triangles": kinds.TRIANGLE, "quadrilaterals": kinds.QUAD,
    "tetrahedra": kinds.TET, "hexahedra": kinds.HEX, "prisms": kinds.WEDGE,
    "pyramids": kinds.PYRAMID,
}  # fmt: skip
_CELLS = re.compile(rf"({'|'.join(_BASES)})([pq]\d)?")
"""Cells of first order, and of others as TetrahedraP2."""
_WORD = re.compile(rb"(?<!\S)(?!nan\b|inf\b)[A-Za-z]\w*", re.IGNORECASE)


def read_medit(data: bytes) -> Content:
    """The mesh of a MEDIT text file; keywords that tell no cells are passed over."""
    text = re.sub(rb"#[^\n]*", b"", data)
    words = list(_WORD.finditer(text))
    content, dim, closed = Content(np.empty((0, 3))), 3, False
    marks: dict[int, tuple[list[Ints], list[Floats]]] = {}
    seen: set[str] = set()
    for k, found in enumerate(words):
        word = found[0].decode().lower()
        body = text[found.end() : words[k + 1].start() if k + 1 < len(words) else len(text)]
        closed = word == "end"
        if word == "dimension":
            (dim,) = whole(numbers(body, "Dimension")[:1], "Dimension").tolist()
        elif word == "vertices":
            rows = _rows(body, dim + 1, "Vertices")
            content.points = np.zeros((len(rows), 3))
            content.points[:, :dim] = rows[:, :dim]
            seen.add(word)
        elif cells := _CELLS.fullmatch(word):
            base = _BASES[cells[1]]
            rows = _rows(body, 0 if cells[2] else base.nodes + 1, word.capitalize())
            kind = kinds.of_order(base, max(rows.shape[1] - 1, base.nodes))
            members, references = marks.setdefault(kind.dim, ([], []))
            members.append((content.cells() + np.arange(len(rows))).astype(np.int64))
            references.append(rows[:, -1])
            content.blocks.append((kind, whole(rows[:, :-1], word.capitalize()) - 1))
    if "vertices" not in seen or not closed:
        raise MeshError("it has no Vertices or no End; the file is cut short")
    _check(content)
    for of_dim, (members, references) in marks.items():
        if of_dim > 1:
            content.cell_groups += groups_by_number(
                np.concatenate(references), np.concatenate(members), {}
            )
    return content


def _rows(text: bytes, width: int, word: str) -> Floats:
    """Rows after their count; `width` 0: as wide as they are."""
    values = numbers(text, word)
    count = int(values[0]) if len(values) else -1
    if not width and count > 0:
        width = max((len(values) - 1) // count, 4)
    if count < 0 or len(values) - 1 != count * width:
        raise MeshError(
            f"{word} announces {count} rows of {width} numbers, but {max(len(values) - 1, 0)} "
            "numbers follow; the file is cut short or damaged"
        )
    return values[1:].reshape(count, width)


def _check(content: Content) -> None:
    nodes = len(content.points)
    for kind, rows in content.blocks:
        wrong = rows[(rows < 0) | (rows >= nodes)]
        if len(wrong):
            raise MeshError(f"a {kind.name} uses vertex {wrong[0] + 1}, but there are {nodes}")
