"""Gmsh files of versions 1 ($NOD, $ELM), 2, 4.0 and 4.1, as text and binary.

Every count must agree with what is there.  Regions are the physical groups, or where there are
none the numbers of the geometry's entities.  Source: the Gmsh manual, "MSH file format".
"""

from __future__ import annotations

import re
from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError
from tisoft.geometry.files import kinds
from tisoft.geometry.files.content import Content, Ints
from tisoft.geometry.files.gmsh_groups import Elements, content_of
from tisoft.geometry.files.gmsh_numbers import Binary, Text
from tisoft.geometry.files.kinds import Kind

_ORDERS = {
    kinds.LINE: {1: 2, 8: 3, 26: 4, 27: 5, 28: 6},
    kinds.TRIANGLE: {2: 3, 9: 6, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21},
    kinds.QUAD: {3: 4, 10: 9, 16: 8, 36: 16, 37: 25, 38: 36, 39: 12, 40: 16, 41: 20},
    kinds.TET: {4: 4, 11: 10, 29: 20, 30: 35, 31: 56, 32: 22, 33: 28},
    kinds.HEX: {5: 8, 12: 27, 17: 20, 92: 64, 93: 125},
    kinds.WEDGE: {6: 6, 13: 18, 18: 15, 90: 40, 91: 75},
    kinds.PYRAMID: {7: 5, 14: 14, 19: 13, 118: 30, 119: 55},
}
KINDS: dict[int, Kind] = {15: kinds.VERTEX} | {
    number: kinds.of_order(base, nodes)
    for base, numbers in _ORDERS.items()
    for number, nodes in numbers.items()
}

Source = Text | Binary
_NUMBERED = {
    "NOD", "ELM", "Nodes", "ParametricNodes", "Elements", "Entities", "PartitionedEntities",
}  # fmt: skip
_NODES = {1.0: "NOD"}
_SECTION = re.compile(rb"^[ \t]*\$(\w+)[ \t\r]*$", re.MULTILINE)
Marks = NDArray[np.int64]


def read_gmsh(data: bytes) -> Content:
    """The mesh in a Gmsh file.

    Raises MeshError where counts disagree, a number cannot be read or a node is not defined.
    """
    file = _File(data)
    version, binary = file.format()
    sections = file.sections(binary)
    parametric = version < 4.0 and "ParametricNodes" in sections
    nodes = _needed(sections, _NODES.get(version, "ParametricNodes" if parametric else "Nodes"))
    cells = _needed(sections, "ELM" if version == 1.0 else "Elements")
    names = _physical_names(sections.get("PhysicalNames"))
    physicals: dict[tuple[int, int], list[int]] = {}
    if version < 4.0:
        labels, points = _parametric_nodes(nodes) if parametric else _plain_nodes(nodes)
    else:
        for name in ("Entities", "PartitionedEntities"):
            if name in sections:
                physicals |= _entities(sections[name], version, partitioned=name[0] == "P")
                sections[name].close()
        labels, points = _block_nodes(nodes, version)
    nodes.close()
    elements = Elements()
    if version < 4.0:
        _plain_elements(cells, elements, version)
    else:
        _block_elements(cells, elements, version)
    cells.close()
    return content_of(labels, points, elements, physicals, names)


class _File:
    """The sections $Name … $EndName of a file."""

    def __init__(self, data: bytes) -> None:
        self.data = data

    def format(self) -> tuple[float, str]:
        """Version, and "" for text or the byte order "<" or ">" of numbers."""
        if re.search(rb"^\s*\$NOD\b", self.data, re.MULTILINE) and b"$MeshFormat" not in self.data:
            return 1.0, ""
        found = re.search(rb"\$MeshFormat\s+([\d.]+)\s+(\d)\s+(\d+)[ \t\r]*\n", self.data)
        if not found:
            raise MeshError("there is no whole $MeshFormat; the file is cut short, or no mesh")
        text = found[1].decode()
        try:
            version = float(text)
        except ValueError:
            version = 0.0
        if not (2.0 <= version < 3.0 or version in (4.0, 4.1)):
            raise MeshError(f"Gmsh format version {text!r} is not known; save it as 4.1 or 2.2")
        if found[2] == b"0":
            return version, ""
        if found[3] != b"8":
            raise MeshError(
                f"its numbers have {found[3].decode()} bytes; save it with 8, or as text"
            )
        one = self.data[found.end() : found.end() + 4]
        if one not in (b"\1\0\0\0", b"\0\0\0\1"):
            raise MeshError("$MeshFormat does not tell the byte order; the file is damaged")
        return version, "<" if one[0] else ">"

    def sections(self, binary: str) -> dict[str, Source]:
        """What may hold numbers, by name; others are passed over."""
        held: dict[str, Source] = {}
        place = 0
        while found := _SECTION.search(self.data, place):
            name = found[1].decode()
            if name.startswith(("End", "END")):
                raise MeshError(f"${name} stands where no ${name[3:]} is open; the file is damaged")
            if name in held and name in _NUMBERED:
                raise MeshError(f"there is a second ${name}; give every section once")
            if binary and name in _NUMBERED:
                held[name] = Binary(self.data, found.end() + 1, name, binary)
            place = self._end(name, found.end())
            if name not in held or not binary:
                held[name] = Text(self.data[found.end() : place], name)
            place += len(name) + 4
        return held

    def _end(self, name: str, start: int) -> int:
        for word in (f"$End{name}", f"$END{name}"):
            place = self.data.find(word.encode(), start)
            if place >= 0:
                return place
        raise MeshError(f"${name} is not closed; the file is cut short")


def _needed(sections: dict[str, Source], name: str) -> Source:
    if name not in sections:
        raise MeshError(f"there is no ${name}; the file is cut short, or no mesh")
    return sections[name]


def _physical_names(section: Source | None) -> dict[int, dict[int, str]]:
    """Names by dimension and number."""
    names: dict[int, dict[int, str]] = defaultdict(dict)
    text = section.text if isinstance(section, Text) else b""
    for dim, tag, name in re.findall(rb'^\s*(\d)\s+(-?\d+)\s+"(.*)"', text, re.MULTILINE):
        names[int(dim)][abs(int(tag))] = name.decode("utf-8", errors="replace")
    return names


def _entities(
    section: Source, version: float, *, partitioned: bool
) -> dict[tuple[int, int], list[int]]:
    """Physical numbers of each entity, by dimension and number."""
    found: dict[tuple[int, int], list[int]] = {}
    if partitioned:
        (_,), (ghosts,) = section.whole(1, "z"), section.whole(1, "z")
        section.whole(2 * int(ghosts), "i")
    counts = section.whole(4, "z")
    for dim, count in enumerate(counts):
        for _ in range(int(count)):
            (tag,) = section.whole(1, "i")
            if partitioned:
                section.whole(2, "i")
                (parts,) = section.whole(1, "z")
                section.whole(int(parts), "i")
            section.take(3 if dim == 0 and version > 4.0 else 6, "d")
            (many,) = section.whole(1, "z")
            found[dim, int(tag)] = [abs(int(n)) for n in section.whole(int(many), "i")]
            if dim:
                (many,) = section.whole(1, "z")
                section.whole(int(many), "i")
    return found


def _plain_nodes(section: Source) -> tuple[Ints, NDArray[np.float64]]:
    """Versions 1 and 2: a count, then "tag x y z" rows."""
    count = section.count()
    tags, points = section.rows(count, ("i", 1), ("d", 3))
    return section.integers(tags)[:, 0], points


def _parametric_nodes(section: Source) -> tuple[Ints, NDArray[np.float64]]:
    """Version 2: a count, then "tag x y z dim entity parameters…" rows, as many as dim 1 or 2."""
    count = section.count()
    labels, points = [], []
    for _ in range(count):
        tag, place, entity = section.rows(1, ("i", 1), ("d", 3), ("i", 2))
        dim = int(entity[0, 0])
        section.take(dim if dim in (1, 2) else 0, "d")
        labels.append(section.integers(tag)[0, 0])
        points.append(place[0])
    return np.array(labels, dtype=np.int64), np.array(points).reshape(-1, 3)


def _block_nodes(section: Source, version: float) -> tuple[Ints, NDArray[np.float64]]:
    """Version 4: blocks of nodes; 4.0 gives "tag x y z" rows, 4.1 all tags and then all points."""
    blocks, declared = section.whole(2 if version == 4.0 else 4, "z")[:2]
    labels, places = [np.empty(0, np.int64)], [np.empty((0, 3))]
    for _ in range(int(blocks)):
        dim, other, parametric = section.whole(3, "i")
        (count,) = section.whole(1, "z")
        dim = other if version == 4.0 else dim
        width = 3 + (int(dim) if parametric else 0)
        if version == 4.0:
            tags, points = section.rows(int(count), ("i", 1), ("d", width))
        else:
            (tags,) = section.rows(int(count), ("z", 1))
            (points,) = section.rows(int(count), ("d", width))
        labels.append(section.integers(tags)[:, 0])
        places.append(points[:, :3])
    section.agree(sum(len(rows) for rows in labels), int(declared))
    return np.concatenate(labels), np.concatenate(places)


def _plain_elements(section: Source, elements: Elements, version: float) -> None:
    """Versions 1 and 2, where every row tells its kind, and how many tags or nodes it has."""
    declared = section.count()
    done = 0
    while section.more(done, declared):
        if isinstance(section, Binary):
            kind, tags, nodes = _binary_rows(section, declared - done)
        elif version == 1.0:
            kind, tags, nodes = _rows_of_1(section, declared - done)
        else:
            kind, tags, nodes = _text_rows(section, declared - done)
        physical = tags[:, 0] if tags.shape[1] > 0 else 0
        elementary = tags[:, 1] if tags.shape[1] > 1 else 0
        elements.add(kind, nodes, elementary, physical)
        done += len(nodes)
    section.agree(done, declared)


Rows = tuple[Kind, Ints, Ints]
"""Kind, tags (physical, elementary, …) and nodes of elements, both with a row an element."""


def _rows_of_1(section: Text, most: int) -> Rows:
    """ "number type physical elementary nodes-in-this-row nodes…" """
    number, count = section.peek(1), section.peek(4)
    kind = _known(number)
    if count != kind.nodes:
        raise MeshError(f"an element announces {count} nodes, but a {kind.name} has {kind.nodes}")
    rows = section.run({1: number, 4: count}, 5 + kind.nodes, most)
    return kind, rows[:, 2:4], rows[:, 5:]


def _text_rows(section: Text, most: int) -> Rows:
    """ "number type tags-in-this-row tags… nodes…" """
    number, tags = section.peek(1), max(section.peek(2), 0)
    kind = _known(number)
    rows = section.run({1: number, 2: section.peek(2)}, 3 + tags + kind.nodes, most)
    return kind, rows[:, 3 : 3 + tags], rows[:, 3 + tags :]


def _binary_rows(section: Binary, most: int) -> Rows:
    """A head "type rows tags-in-each-row", then rows "number tags… nodes…".

    Gmsh may put a head before every single element.
    """
    number, count, tags = head = tuple(int(n) for n in section.whole(3, "i"))
    kind = _known(number)
    if count < 1 or tags < 0:
        raise MeshError(f"$Elements has a block of {count} elements; the file is damaged")
    width = 1 + tags + kind.nodes
    rows = section.same(head, width, most) if count == 1 else section.table(count, width)
    return kind, rows[:, 1 : 1 + tags], rows[:, 1 + tags :]


def _block_elements(section: Source, elements: Elements, version: float) -> None:
    """Version 4: blocks headed "dim tag type count" ("tag dim type count" in 4.0)."""
    blocks, declared = section.whole(2 if version == 4.0 else 4, "z")[:2]
    total = 0
    letter = "i" if version == 4.0 else "z"
    for _ in range(int(blocks)):
        first, second, number = section.whole(3, "i")
        (count,) = section.whole(1, "z")
        kind = _known(int(number))
        (rows,) = section.rows(int(count), (letter, 1 + kind.nodes))
        entity = first if version == 4.0 else second
        elements.add(kind, section.integers(rows)[:, 1:], int(entity), 0)
        total += int(count)
    section.agree(total, int(declared))


def _known(number: int) -> Kind:
    if number not in KINDS:
        raise MeshError(f"Gmsh element type {number} is not known; the file is damaged, or too new")
    return KINDS[number]
