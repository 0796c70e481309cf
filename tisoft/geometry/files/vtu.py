"""VTK's XML files of unstructured grids: text, base64 and appended data, compressed or not.

Source: the VTK file formats, "XML File Formats".
"""

from __future__ import annotations

import base64
import binascii
import lzma
import re
import zlib
from collections.abc import Callable
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError
from tisoft.geometry.files.content import Content
from tisoft.geometry.files.text import numbers, whole
from tisoft.geometry.files.vtk import SURFACE
from tisoft.geometry.files.vtk_cells import add_cells, tell_unused

Array = NDArray[Any]

_TYPES = {
    "Int8": "i1", "UInt8": "u1", "Int16": "i2", "UInt16": "u2", "Int32": "i4", "UInt32": "u4",
    "Int64": "i8", "UInt64": "u8", "Float32": "f4", "Float64": "f8",
}  # fmt: skip
_COMPRESSORS: dict[str, Callable[[], Any]] = {
    "vtkZLibDataCompressor": zlib.decompressobj,
    "vtkLZMADataCompressor": lzma.LZMADecompressor,
}


def read_vtu(data: bytes) -> Content:
    """The unstructured grid of a VTK XML file, all its pieces.

    Raises MeshError where its counts contradict each other, and where it is another data set.
    """
    file = _File(data)
    kind = file.root.get("type", "nothing")
    grid = file.root.find("UnstructuredGrid")
    if kind == "PolyData":
        raise MeshError(SURFACE)
    if kind.startswith(("P", "vtkMultiBlock", "vtkPartitioned", "Collection")):
        raise MeshError(f"it holds a {kind}, which only lists other files; name one of those")
    if kind != "UnstructuredGrid" or grid is None:
        raise MeshError(f"it holds a {kind}, no tets; convert it to an UnstructuredGrid of tets")
    content = Content(np.empty((0, 3)))
    for piece in grid.findall("Piece"):
        _add_piece(content, file, piece)
    return content


def read_vtp(data: bytes) -> tuple[Array, Array, Array]:
    """Points [m], corners and ends of the polygons of a VTK XML file of PolyData, all its pieces.

    Raises MeshError where its counts contradict each other, and where it is another data set.
    """
    file = _File(data)
    surface = file.root.find("PolyData")
    if surface is None:
        raise MeshError(f"it holds a {file.root.get('type', 'nothing')}, no surface (PolyData)")
    points, corners, ends = [np.empty((0, 3))], [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    first = used = 0
    for piece in surface.findall("Piece"):
        if piece.get("NumberOfStrips", "0").strip() not in ("", "0"):
            raise MeshError("it holds strips of triangles; save them as polygons")
        nodes, count = _count(piece, "NumberOfPoints"), _count(piece, "NumberOfPolys")
        found = {tag.get("Name", "").lower(): tag for tag in piece.findall("Polys/DataArray")}
        place = piece.find("Points/DataArray")
        if not nodes or not count:
            continue
        if place is None or not {"connectivity", "offsets"} <= found.keys():
            raise MeshError("a piece lacks its points or polygons; the file is damaged")
        points.append(file.array(place, 3 * nodes).astype(np.float64).reshape(-1, 3))
        own_ends = file.array(found["offsets"], count).astype(np.int64)
        own = file.array(found["connectivity"]).astype(np.int64)
        if (np.diff(own_ends, prepend=0) < 0).any() or own_ends[-1] > len(own):
            raise MeshError("the offsets of its polygons do not ascend; the file is damaged")
        if len(own) and not (0 <= own.min() and own.max() < nodes):
            raise MeshError("a polygon uses a point that is not there; the file is damaged")
        corners.append(own[: own_ends[-1]] + first)
        ends.append(own_ends + used)
        first, used = first + nodes, used + int(own_ends[-1])
    return np.concatenate(points), np.concatenate(corners), np.concatenate(ends)


def _add_piece(content: Content, file: _File, piece: Element) -> None:
    nodes, cells = _count(piece, "NumberOfPoints"), _count(piece, "NumberOfCells")
    if nodes == 0 and cells == 0:
        return
    points = piece.find("Points/DataArray")
    if points is None:
        raise MeshError("a piece has no Points; the file is damaged")
    places = file.array(points, 3 * nodes).astype(np.float64).reshape(-1, 3)
    first = len(content.points)
    content.points = np.concatenate([content.points, places])
    found = {tag.get("Name", "").lower(): tag for tag in piece.findall("Cells/DataArray")}
    for name in ("connectivity", "offsets", "types"):
        if name not in found and cells:
            raise MeshError(f"a piece has no array {name!r} of its cells; the file is damaged")
    if not cells:
        return
    ends, types = (file.array(found[n], cells).astype(np.int64) for n in ("offsets", "types"))
    connectivity = file.array(found["connectivity"]).astype(np.int64)
    wrong = connectivity[(connectivity < 0) | (connectivity >= nodes)]
    if len(wrong):
        raise MeshError(
            f"a cell uses node {wrong[0]} (counted from 0), but there are {nodes} nodes"
        )
    add_cells(content, connectivity + first, ends, types, _cell_arrays(file, piece, cells))
    tags = [*piece.findall("PointData/DataArray"), *piece.findall("CellData/DataArray")]
    tell_unused(content, [tag.get("Name", "") for tag in tags])


def _cell_arrays(file: _File, piece: Element, cells: int) -> dict[str, Array]:
    """Scalars of the cells; those that cannot be read are not needed."""
    arrays = {}
    for tag in piece.findall("CellData/DataArray"):
        if tag.get("NumberOfComponents", "1").strip() in ("", "1") and tag.get("type") in _TYPES:
            try:
                arrays[tag.get("Name", "")] = file.array(tag, cells)
            except MeshError:
                continue
    return arrays


def _count(piece: Element, name: str) -> int:
    try:
        return int(piece.get(name, ""))
    except ValueError:
        raise MeshError(f"a piece does not tell its {name}; the file is damaged") from None


class _File:
    """The tree of a file, and how its numbers are written."""

    def __init__(self, data: bytes) -> None:
        self._size = len(data)
        self._appended, self._encoding, data = _cut_appended(data)
        try:
            self.root = ElementTree.fromstring(data)
        except (ElementTree.ParseError, ValueError, LookupError) as error:
            raise MeshError(
                f"it is no whole XML ({error}); the file is cut short or damaged"
            ) from None
        self._order = ">" if self.root.get("byte_order") == "BigEndian" else "<"
        head = self.root.get("header_type", "UInt32")
        if head not in ("UInt32", "UInt64"):
            raise MeshError(f"its header_type is {head!r}, not UInt32 or UInt64")
        self._head = np.dtype(self._order + _TYPES[head])
        self._compressor = self.root.get("compressor")

    def array(self, tag: Element, wanted: int | None = None) -> Array:
        """The numbers of a DataArray, shape (numbers,), as many as `wanted`."""
        name = tag.get("Name", "Points")
        letters = _TYPES.get(tag.get("type", ""))
        if letters is None:
            raise MeshError(
                f"the array {name!r} is of type {tag.get('type')!r}, which is no number"
            )
        written = tag.get("format", "ascii")
        if written == "ascii":
            values: Array = numbers((tag.text or "").encode(), f"the array {name!r}")
            if letters[0] != "f":
                values = whole(values, f"the array {name!r}")
        elif written in ("binary", "appended"):
            data = self._bytes(tag, name, written)
            kind = np.dtype(self._order + letters)
            if len(data) % kind.itemsize:
                raise MeshError(f"the array {name!r} ends within a number; the file is damaged")
            values = np.frombuffer(data, kind).astype(kind.newbyteorder("="))
        else:
            raise MeshError(
                f"the array {name!r} is written as {written!r}, which VTK does not know"
            )
        if wanted is not None and len(values) != wanted:
            raise MeshError(
                f"the array {name!r} holds {len(values)} numbers, but its piece announces "
                f"{wanted}; the file is damaged"
            )
        return values

    def _bytes(self, tag: Element, name: str, written: str) -> bytes:
        if self._compressor and self._compressor not in _COMPRESSORS:
            raise MeshError(
                f"it is compressed by {self._compressor}; save it with zlib, or uncompressed"
            )
        try:
            if written == "binary":
                return self._decoded("".join((tag.text or "").split()).encode(), name)
            place = int(tag.get("offset", ""))
            if not 0 <= place < len(self._appended):
                raise MeshError(
                    f"the array {name!r} begins beyond the appended data; it is cut short"
                )
            if self._encoding == "base64":
                return self._decoded(self._appended[place:], name)
            return self._unpacked(self._appended[place:], name)
        except (ValueError, zlib.error, lzma.LZMAError, EOFError) as error:
            told = str(error).split("\n")[0]
            raise MeshError(
                f"the array {name!r} cannot be decoded ({told}); the file is damaged"
            ) from None

    def _decoded(self, text: bytes, name: str) -> bytes:
        """Base64: a head, then data, either in one stream or each ended by its own padding."""
        size = self._head.itemsize
        if self._compressor:
            blocks = int(np.frombuffer(_from64(text, size), self._head)[0])
            size *= 3 + blocks
            self._check(size, name)
            head, rest = _from64(text, size), text[4 * -(-size // 3) :]
            packed = int(np.frombuffer(head, self._head)[3:].astype(np.int64).sum())
            self._check(packed, name)
            return self._unpacked(head + _from64(rest, packed), name)
        start = 4 * -(-size // 3)
        length = int(np.frombuffer(_from64(text, size), self._head)[0])
        self._check(length, name)
        if b"=" in text[:start]:
            return _from64(text[start:], length)
        return _from64(text, size + length)[size:]

    def _unpacked(self, data: bytes, name: str) -> bytes:
        """The data after its head: a length, or the sizes of compressed blocks."""
        size = self._head.itemsize
        if not self._compressor:
            length = int(np.frombuffer(data[:size], self._head)[0])
            return self._part(data, size, length, name)
        blocks = int(np.frombuffer(data[:size], self._head)[0])
        self._check(blocks * size, name)
        head = np.frombuffer(self._part(data, 0, (3 + blocks) * size, name), self._head).astype(
            np.int64
        )
        place, parts = (3 + blocks) * size, []
        for packed in head[3:]:
            block = self._part(data, place, int(packed), name)
            parts.append(_COMPRESSORS[self._compressor]().decompress(block, int(head[1]) + 1))
            place += int(packed)
        size, last = int(head[1]), int(head[2])
        whole_size = blocks * size - (size - last if last else 0)
        unpacked = b"".join(parts)
        if len(unpacked) != whole_size:
            raise MeshError(
                f"the array {name!r} unpacks to {len(unpacked)} bytes, not {whole_size}"
            )
        return unpacked

    def _part(self, data: bytes, place: int, size: int, name: str) -> bytes:
        if not 0 <= size <= len(data) - place:
            raise MeshError(
                f"the array {name!r} announces {size} bytes, but {max(len(data) - place, 0)} "
                "follow; the file is cut short or damaged"
            )
        return data[place : place + size]

    def _check(self, size: int, name: str) -> None:
        if not 0 <= size <= self._size:
            raise MeshError(
                f"the array {name!r} announces {size} bytes in a file of {self._size}; "
                "it is damaged"
            )


def _from64(text: bytes, size: int) -> bytes:
    """The first `size` bytes of base64 text."""
    needed = 4 * -(-size // 3)
    try:
        data = base64.b64decode(text[:needed])
    except binascii.Error as error:
        raise ValueError(str(error)) from None
    if len(data) < size:
        raise ValueError(f"{len(data)} bytes of {size}")
    return data[:size]


def _cut_appended(data: bytes) -> tuple[bytes, str, bytes]:
    """Appended data, which need not be XML, its encoding, and the file without it."""
    begin = re.search(rb'<AppendedData\s+encoding\s*=\s*["\'](\w+)["\']\s*>\s*_', data)
    if begin is None:
        return b"", "", data
    end = data.rfind(b"</AppendedData>")
    if end < begin.end():
        raise MeshError("its appended data is not closed; the file is cut short")
    encoding = begin[1].decode()
    appended = data[begin.end() : end]
    if encoding == "base64":
        appended = appended.strip()
    return appended, encoding, data[: begin.end() - 1] + data[end:]
