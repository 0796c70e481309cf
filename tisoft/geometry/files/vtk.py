"""Legacy VTK files, versions 1 to 5.1, as text and binary.

Source: the VTK file formats, "Simple Legacy Formats".
"""

from __future__ import annotations

import re
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError
from tisoft.geometry.files.content import Content
from tisoft.geometry.files.text import numbers, whole
from tisoft.geometry.files.vtk_cells import add_cells, tell_unused

Array = NDArray[Any]

SURFACE = (
    "it holds a surface (POLYDATA), no tets; tetrahedralise it first, with fTetWild, TetGen or "
    "Gmsh for instance"
)
_TYPES = {
    "char": "i1", "unsigned_char": "u1", "signed_char": "i1", "short": "i2", "unsigned_short": "u2",
    "int": "i4", "unsigned_int": "u4", "long": "i8", "unsigned_long": "u8", "vtkidtype": "i8",
    "vtktypeint64": "i8", "vtktypeuint64": "u8", "vtktypeint32": "i4", "long_long": "i8",
    "unsigned_long_long": "u8", "float": "f4", "double": "f8",
}  # fmt: skip
_ATTRIBUTES = {
    "VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6, "GLOBAL_IDS": 1, "PEDIGREE_IDS": 1,
    "TEXTURE_COORDINATES": 0, "SCALARS": 0,
}  # fmt: skip


_SECTION = re.compile(rb"^(POINTS|CELLS|CELL_TYPES|CELL_DATA|POINT_DATA)[ \t]+\d", re.M | re.I)


def read_vtk(data: bytes) -> Content:
    """The unstructured grid of a legacy VTK file.

    Raises MeshError where its counts contradict each other, and where it is another data set.
    """
    head = re.match(rb"# vtk DataFile Version[ \t]*([\d.]+)[^\n]*\n[^\n]*\n\s*(\w+)\s", data)
    if not head or head[2].upper() not in (b"ASCII", b"BINARY"):
        raise MeshError(
            "it should tell ASCII or BINARY in its third line; it is cut short or damaged"
        )
    words = _Words(data, head.end(), binary=head[2].upper() == b"BINARY")
    grid = _Grid(words)
    while (line := words.line()) is not None:
        if not grid.take(line):
            words.skip_to_section()
    return grid.content()


class _Words:
    """Lines and arrays of a file, one after the other."""

    def __init__(self, data: bytes, place: int, *, binary: bool) -> None:
        self.data, self.place, self.binary = data, place, binary

    def line(self) -> list[str] | None:
        """The words of the next line that holds some."""
        while self.place < len(self.data):
            end = self.data.find(b"\n", self.place)
            end = len(self.data) if end < 0 else end
            words = self.data[self.place : end].decode("latin-1").split()
            self.place = end + 1
            if words:
                return words
        return None

    def skip_to_section(self) -> None:
        """Past data that is no numbers, to the next section of the grid."""
        found = _SECTION.search(self.data, self.place)
        self.place = found.start() if found else len(self.data)

    def next_is(self, *words: bytes) -> bool:
        """Whether the next line that holds something begins with one of the words."""
        return bool(
            re.compile(rb"\s*(?:" + b"|".join(words) + rb")\b", re.I).match(self.data, self.place)
        )

    def array(self, count: int, kind: str, what: str) -> Array:
        """The next `count` numbers of a VTK type."""
        letters = _TYPES.get(kind.lower())
        if letters is None:
            raise MeshError(f"{what} is of the type {kind!r}, which is none of VTK's")
        rest = len(self.data) - self.place
        if count < 0 or count > rest:
            raise MeshError(
                f"{what} announces {count} numbers in {rest} bytes; the file is damaged"
            )
        return (
            self._bytes(count, letters, what) if self.binary else self._text(count, letters, what)
        )

    def _bytes(self, count: int, letters: str, what: str) -> Array:
        kind = np.dtype(">" + letters)
        if self.place + count * kind.itemsize > len(self.data):
            raise MeshError(
                f"{what} announces {count} numbers, but the file ends before; it is cut short"
            )
        values = np.frombuffer(self.data, kind, count, self.place)
        self.place += count * kind.itemsize
        return values.astype(kind.newbyteorder("="))

    def _text(self, count: int, letters: str, what: str) -> Array:
        word = re.compile(rb"^[ \t]*(?!nan|inf|-nan)[A-Za-z]", re.MULTILINE | re.IGNORECASE)
        found = word.search(self.data, self.place)
        end = found.start() if found else len(self.data)
        values = numbers(self.data[self.place : end], what)
        self.place = end
        if len(values) != count:
            raise MeshError(
                f"{what} announces {count} numbers, but {len(values)} follow; "
                "the file is cut short or damaged"
            )
        return values if letters[0] == "f" else whole(values, what)


class _Grid:
    """What the sections of an unstructured grid told so far."""

    def __init__(self, words: _Words) -> None:
        self._words = words
        self._points: Array | None = None
        self._cells: tuple[Array, Array] | None = None
        self._types: Array | None = None
        self._arrays: dict[str, Array] = {}
        self._names: list[str] = []
        self._of_cells = False
        self._rows = 0

    def take(self, line: list[str]) -> bool:
        """Reads a section by its first line; false where what follows is no numbers."""
        word = line[0].upper()
        words = self._words
        if word == "DATASET":
            _check_data_set(line)
        elif word == "POINTS":
            (count,) = _counts(line, 1)
            kind = line[2] if len(line) > 2 else "float"
            self._points = words.array(3 * count, kind, "POINTS").astype(np.float64).reshape(-1, 3)
        elif word == "CELLS":
            self._cells = self._read_cells(line)
        elif word == "CELL_TYPES":
            self._types = words.array(_counts(line, 1)[0], "int", "CELL_TYPES")
        elif word in ("CELL_DATA", "POINT_DATA"):
            self._of_cells, self._rows = word == "CELL_DATA", _counts(line, 1)[0]
        elif word == "METADATA":
            self._skip_metadata()
        elif word == "FIELD":
            return self._read_field(line)
        elif word in _ATTRIBUTES:
            return self._read_attribute(word, line)
        elif word == "LOOKUP_TABLE" and len(line) > 2:
            words.array(4 * int(line[2]), "unsigned_char" if words.binary else "float", word)
        elif word == "COLOR_SCALARS":
            kind = "unsigned_char" if words.binary else "float"
            words.array(self._rows * int(line[2]), kind, word)
        else:
            if self._points is None or self._cells is None or self._types is None:
                shown = " ".join(line)[:40]
                raise MeshError(f"{shown!r} is no section of a VTK file; the file is damaged")
            return False
        return True

    def content(self) -> Content:
        """The grid; raises MeshError where a section is missing or counts contradict."""
        for name, found in (
            ("POINTS", self._points),
            ("CELLS", self._cells),
            ("CELL_TYPES", self._types),
        ):
            if found is None:
                raise MeshError(f"it has no {name}; the file is cut short")
        assert self._points is not None and self._cells is not None and self._types is not None
        content = Content(self._points)
        ends, connectivity = self._cells
        wrong = connectivity[(connectivity < 0) | (connectivity >= len(self._points))]
        if len(wrong):
            raise MeshError(
                f"a cell uses node {wrong[0]} (counted from 0), but there are "
                f"{len(self._points)} nodes"
            )
        if len(ends) != len(self._types):
            raise MeshError(
                f"CELLS announces {len(ends)} cells, but CELL_TYPES {len(self._types)}; "
                "the file is damaged"
            )
        add_cells(content, connectivity, ends, self._types, self._arrays)
        tell_unused(content, self._names)
        return content

    def _read_cells(self, line: list[str]) -> tuple[Array, Array]:
        """Where each cell ends, and the nodes of all."""
        words = self._words
        count, size = _counts(line, 2)
        if words.next_is(b"OFFSETS"):
            kind = (words.line() or ["", "vtktypeint64"])[1]
            offsets = words.array(count, kind, "OFFSETS").astype(np.int64)
            told = words.line() or []
            if len(told) < 2 or told[0].upper() != "CONNECTIVITY":
                raise MeshError("no CONNECTIVITY follows OFFSETS; the file is damaged")
            nodes = words.array(size, told[1], "CONNECTIVITY").astype(np.int64)
            if len(offsets) and offsets[0] != 0:
                raise MeshError(f"OFFSETS begins at {offsets[0]}, not at 0; the file is damaged")
            return offsets[1:], nodes
        table = words.array(size, "int", "CELLS").astype(np.int64)
        return _split(table, count)

    def _read_field(self, line: list[str]) -> bool:
        for _ in range(_counts(line, 2)[0] if len(line) == 2 else _counts(line[1:], 1)[0]):
            head = self._words.line()
            while head is not None and head[0].upper() == "METADATA":
                self._skip_metadata()
                head = self._words.line()
            if head is None or len(head) < 4 or head[3].lower() not in _TYPES:
                return False
            name, width, rows = head[0], int(head[1]), int(head[2])
            self._keep(name, self._words.array(width * rows, head[3], f"FIELD {name}"), width)
        return True

    def _read_attribute(self, word: str, line: list[str]) -> bool:
        words = self._words
        width = _ATTRIBUTES[word]
        if word == "SCALARS":
            width = int(line[3]) if len(line) > 3 else 1
            if words.next_is(b"LOOKUP_TABLE"):
                words.line()
        elif word == "TEXTURE_COORDINATES":
            width = int(line[2])
            line = [*line[:2], line[3]]
        if len(line) < 3 or line[2].lower() not in _TYPES:
            return False
        self._keep(line[1], words.array(self._rows * width, line[2], f"{word} {line[1]}"), width)
        return True

    def _keep(self, name: str, values: Array, width: int) -> None:
        self._names.append(unquote(name))
        if self._of_cells and width == 1:
            self._arrays[name] = values

    def _skip_metadata(self) -> None:
        """Up to an empty line."""
        found = re.compile(rb"\n[ \t\r]*\n").search(self._words.data, self._words.place - 1)
        self._words.place = found.end() if found else len(self._words.data)


def _split(table: Array, count: int) -> tuple[Array, Array]:
    """Ends and nodes of cells written as "nodes-of-this-cell node node …"."""
    if (
        count
        and len(table) % count == 0
        and (table[:: len(table) // count] == len(table) // count - 1).all()
    ):
        width = len(table) // count  # all cells of one size
        nodes = table.reshape(count, width)[:, 1:].ravel()
        return (width - 1) * np.arange(1, count + 1), nodes
    starts = np.empty(count, dtype=np.int64)
    place, sizes = 0, table.tolist()
    for cell in range(count):
        if place >= len(sizes) or sizes[place] < 0:
            break
        starts[cell] = place
        place += sizes[place] + 1
    else:
        if place == len(sizes):
            heads = np.zeros(len(table), dtype=bool)
            heads[starts] = True
            return np.cumsum(table[starts]), table[~heads]
    raise MeshError(
        f"CELLS announces {count} cells in {len(table)} numbers, but the sizes of its cells do not "
        "add up to that; the file is damaged"
    )


def _counts(line: list[str], wanted: int) -> list[int]:
    try:
        counts = [int(word) for word in line[1 : 1 + wanted]]
    except ValueError:
        counts = []
    if len(counts) < wanted or min(counts) < 0:
        raise MeshError(f"{line[0]} does not tell its {wanted} count(s); the file is damaged")
    return counts


def _check_data_set(line: list[str]) -> None:
    kind = line[1].upper() if len(line) > 1 else "nothing"
    if kind == "POLYDATA":
        raise MeshError(SURFACE)
    if kind != "UNSTRUCTURED_GRID":
        raise MeshError(f"it holds a {kind}, no tets; convert it to an UNSTRUCTURED_GRID of tets")
