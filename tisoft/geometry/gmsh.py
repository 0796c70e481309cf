"""Gmsh files in ASCII: versions 1 ($NOD, $ELM), 2, 4.0 and 4.1.

meshio does not read version 1, and in the others it drops what exceeds a declared count without a
word; here every count must agree.  Source: the Gmsh manual, "MSH file format".
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError

# Gmsh number: name in meshio's words, nodes.
KINDS = {
    1: ("line", 2),
    2: ("triangle", 3),
    3: ("quad", 4),
    4: ("tetra", 4),
    5: ("hexahedron", 8),
    6: ("wedge", 6),
    7: ("pyramid", 5),
    8: ("line3", 3),
    9: ("triangle6", 6),
    10: ("quad9", 9),
    11: ("tetra10", 10),
    12: ("hexahedron27", 27),
    13: ("wedge18", 18),
    14: ("pyramid14", 14),
    15: ("vertex", 1),
    16: ("quad8", 8),
    17: ("hexahedron20", 20),
    18: ("wedge15", 15),
    19: ("pyramid13", 13),
    21: ("triangle10", 10),
    26: ("line4", 4),
    27: ("line5", 5),
    29: ("tetra20", 20),
    30: ("tetra35", 35),
}


@dataclass
class Section:
    """The lines between $Name and $EndName, read one after the other."""

    name: str
    lines: list[str]
    first: int
    """Line number of the first line in the file, from 1."""
    position: int = 0

    def take(self, count: int) -> list[list[str]]:
        """The words of the next `count` lines."""
        rest = len(self.lines) - self.position
        if count < 0 or count > rest:
            raise MeshError(
                f"${self.name} announces {count} further rows at line {self.where()}, "
                f"but {rest} follow; the file is cut short or damaged"
            )
        rows = [line.split() for line in self.lines[self.position : self.position + count]]
        self.position += count
        return rows

    def header(self, least: int) -> list[int]:
        """The next line, as at least `least` whole numbers."""
        words = self.take(1)[0]
        try:
            numbers = [int(word) for word in words]
        except ValueError:
            numbers = []
        if len(numbers) < least:
            raise MeshError(
                f"line {self.where() - 1} of ${self.name} should hold {least} whole number(s), "
                f"not {' '.join(words)[:60]!r}"
            )
        return numbers

    def end(self, counted: int, declared: int) -> None:
        """Refuses rows beyond those announced, and a total that disagrees."""
        rest = len(self.lines) - self.position
        if rest or counted != declared:
            raise MeshError(
                f"${self.name} announces {declared} entries, but holds {counted + rest}; "
                "the file is damaged, write it again"
            )

    def where(self) -> int:
        return self.first + self.position


@dataclass
class Elements:
    """Elements by kind: tags of their nodes."""

    rows: dict[str, list[list[str]]] = field(default_factory=dict)

    def add(self, kind: int, nodes: list[str], where: int) -> None:
        if kind not in KINDS:
            raise MeshError(f"line {where}: Gmsh element type {kind} is not known")
        name, count = KINDS[kind]
        if len(nodes) != count:
            raise MeshError(f"line {where}: a {name} needs {count} nodes, not {len(nodes)}")
        self.rows.setdefault(name, []).append(nodes)


def read_gmsh_text(data: bytes) -> tuple[NDArray[np.float64], list[tuple[str, NDArray[np.int64]]]]:
    """Node positions, shape (nodes, 3), and (kind, rows of node numbers from 0) of an ASCII file.

    Raises MeshError where counts disagree, a number cannot be read or a node is not defined.
    """
    sections = _sections(data.decode("utf-8", errors="replace"))
    if "NOD" in sections:
        tags, points = _plain_nodes(_section(sections, "NOD"))
        elements = _elements_1(_section(sections, "ELM"))
    else:
        version = _section(sections, "MeshFormat").take(1)[0][:1]
        nodes, cells = _section(sections, "Nodes"), _section(sections, "Elements")
        if version and version[0].startswith("2"):
            tags, points = _plain_nodes(nodes)
            elements = _elements_2(cells)
        elif version and version[0].startswith("4"):
            old = version[0] == "4.0"
            tags, points = _block_nodes(nodes, interleaved=old)
            elements = _elements_4(cells, old)
        else:
            raise MeshError(f"Gmsh format version {' '.join(version)!r} is not known")
    return points, [(name, _numbered(name, rows, tags)) for name, rows in elements.rows.items()]


def _sections(text: str) -> dict[str, Section]:
    """Sections by name; comments and blank lines are left out."""
    sections: dict[str, Section] = {}
    current: Section | None = None
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.strip()
        if line.startswith("$"):
            name = line[1:].strip()
            if current is None:
                current = Section(name, [], number + 1)
                if name in sections and name in ("NOD", "ELM", "Nodes", "Elements"):
                    raise MeshError(f"line {number}: a second ${name}; give every section once")
                sections[name] = current
            elif name in (f"End{current.name}", f"END{current.name}"):
                current = None
            else:
                raise MeshError(
                    f"line {number}: ${name} stands where $End{current.name} should; "
                    "the file is cut short or damaged"
                )
        elif line and current is not None:
            current.lines.append(line)
    if current is not None:
        raise MeshError(f"${current.name} is not closed; the file is cut short")
    return sections


def _section(sections: dict[str, Section], name: str) -> Section:
    if name not in sections:
        raise MeshError(f"there is no ${name}; the file is cut short, or no mesh")
    return sections[name]


def _plain_nodes(section: Section) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Versions 1 and 2: a count, then "tag x y z" rows."""
    (declared, *_) = section.header(1)
    rows = section.take(declared)
    section.end(len(rows), declared)
    return _node_rows(section, rows)


def _block_nodes(
    section: Section, *, interleaved: bool
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Version 4: blocks of nodes; 4.0 gives "tag x y z" rows, 4.1 all tags and then all points."""
    blocks, declared, *_ = section.header(2)
    rows: list[list[str]] = []
    for _ in range(min(blocks, len(section.lines))):
        count = section.header(4)[3]
        if interleaved:
            rows += section.take(count)
        else:
            tags = section.take(count)
            rows += [tag[:1] + point for tag, point in zip(tags, section.take(count), strict=True)]
    section.end(len(rows), declared)
    return _node_rows(section, rows)


def _node_rows(
    section: Section, rows: list[list[str]]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    short = next((row for row in rows if len(row) < 4), None)
    if short is not None:
        raise MeshError(f"a node of ${section.name} needs a number and x, y, z, not {short}")
    try:
        tags = np.array([int(row[0]) for row in rows], dtype=np.int64)
        points = np.array([[float(word) for word in row[1:4]] for row in rows], dtype=np.float64)
    except (ValueError, OverflowError) as error:
        raise MeshError(f"${section.name}: {error}") from error
    return tags, points.reshape(-1, 3)


def _elements_1(section: Section) -> Elements:
    """Version 1: "number type physical elementary count nodes…"."""
    elements = Elements()
    for row, where in _announced(section):
        kind, count = _whole(row, 1, where), _whole(row, 4, where)
        if len(row) != 5 + count:
            raise MeshError(f"line {where}: announces {count} nodes, but holds {len(row) - 5}")
        elements.add(kind, row[5:], where)
    return elements


def _elements_2(section: Section) -> Elements:
    """Version 2: "number type count-of-tags tags… nodes…"."""
    elements = Elements()
    for row, where in _announced(section):
        kind, tags = _whole(row, 1, where), _whole(row, 2, where)
        elements.add(kind, row[3 + max(tags, 0) :], where)
    return elements


def _elements_4(section: Section, old: bool) -> Elements:
    """Version 4: blocks headed "dim tag type count" ("tag dim type count" in 4.0)."""
    blocks, declared, *_ = section.header(2)
    elements, total = Elements(), 0
    for _ in range(min(blocks, len(section.lines))):
        kind, count = section.header(4)[2:4]
        for where, row in enumerate(section.take(count), start=section.where()):
            elements.add(kind, row[1:], where)
        total += count
    section.end(total, declared)
    return elements


def _announced(section: Section) -> Iterator[tuple[list[str], int]]:
    (declared, *_) = section.header(1)
    where = section.where()
    rows = section.take(declared)
    section.end(len(rows), declared)
    return ((row, where + k) for k, row in enumerate(rows))


def _whole(row: list[str], place: int, where: int) -> int:
    try:
        return int(row[place])
    except (IndexError, ValueError):
        raise MeshError(f"line {where}: {' '.join(row)[:60]!r} is no element") from None


def _numbered(name: str, rows: list[list[str]], tags: NDArray[np.int64]) -> NDArray[np.int64]:
    """Tags of nodes as positions in the file; tags may be sparse, so they are looked up."""
    try:
        wanted = np.array([[int(word) for word in row] for row in rows], dtype=np.int64)
    except (ValueError, OverflowError) as error:
        raise MeshError(f"node numbers of the {name} elements: {error}") from error
    order = np.argsort(tags, kind="stable")
    ordered = tags[order]
    if len(ordered) == 0:
        raise MeshError("there are elements, but no nodes")
    double = ordered[1:][ordered[1:] == ordered[:-1]]
    if len(double):
        raise MeshError(f"node number {double[0]} is given twice; number the nodes anew")
    found = np.minimum(np.searchsorted(ordered, wanted), len(ordered) - 1)
    missing = ordered[found] != wanted
    if missing.any():
        row = int(np.flatnonzero(missing.any(axis=1))[0])
        raise MeshError(
            f"{name} {row} (counted from 0) uses node {wanted[missing][0]}, "
            "which the file does not define"
        )
    return order[found].astype(np.int64)
