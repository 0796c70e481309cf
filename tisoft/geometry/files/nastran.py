"""Nastran bulk data: grid points and solids, in small, large and free fields.

Regions are the property numbers.  Points in a coordinate system of their own, and included files,
are refused by name.  Source: the Quick Reference Guide, "Format of Bulk Data Entries".
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterator

import numpy as np

from tisoft.errors import MeshError
from tisoft.geometry.files import kinds
from tisoft.geometry.files.content import Content, groups_by_number, numbered
from tisoft.geometry.files.kinds import Kind

# Card: cell, and its nodes of second order.
_CELLS = {
    "CTETRA": (kinds.TET, 10), "CHEXA": (kinds.HEX, 20), "CPENTA": (kinds.WEDGE, 15),
    "CPYRAM": (kinds.PYRAMID, 13), "CPYRA": (kinds.PYRAMID, 13), "CTRIA3": (kinds.TRIANGLE, 3),
    "CTRIA6": (kinds.TRIANGLE, 6), "CQUAD4": (kinds.QUAD, 4), "CQUAD8": (kinds.QUAD, 8),
}  # fmt: skip
_LOST = re.compile(
    r"SPC1?|SPCADD|FORCE1?|MOMENT|PLOAD\d?|GRAV|MPC|RBE[123]|RBAR|RROD|CBAR|CBEAM|CROD|CONROD|CELAS\d|"
    r"CBUSH|CONM[12]|TEMP"
)
_ROW = tuple[list[int], int]


def read_nastran(data: bytes) -> Content:
    """The mesh of a bulk data file; other cards are passed over, and told where they matter."""
    labels: list[int] = []
    places: list[list[float]] = []
    cells: dict[Kind, list[_ROW]] = defaultdict(list)
    lost, shells = Counter[str](), 0
    for line, name, fields in _cards(data.decode("latin-1")):
        if name == "GRID":
            labels.append(_integer(fields, 0, line))
            places.append([_real(fields, k, line) for k in (2, 3, 4)])
            if len(fields) > 1 and fields[1].strip() not in ("", "0"):
                raise MeshError(
                    f"line {line}: grid points are given in coordinate system {fields[1].strip()}; "
                    "only the basic one is read"
                )
        elif name in _CELLS:
            base, second = _CELLS[name]
            given = [field for field in fields[2 : 2 + second] if field.strip()]
            kind = kinds.of_order(base, base.nodes if len(given) <= base.nodes else second)
            corners = [_integer(fields, 2 + k, line) for k in range(base.corners)]
            cells[kind].append((corners, _integer(fields, 1, line, missing=0)))
            shells += base.dim == 2
        elif name == "INCLUDE":
            raise MeshError(f"line {line}: it includes another file; put all into one")
        elif _LOST.fullmatch(name):
            lost[name] += 1
    content = Content(np.array(places, dtype=np.float64).reshape(-1, 3))
    _add_cells(content, cells, np.array(labels, dtype=np.int64))
    if shells and any(kind.dim == 3 for kind in cells):
        content.notes.append(f"{shells} shells are left out; they name faces")
    content.warnings += [f"{count} {name} cards are not taken over" for name, count in lost.items()]
    return content


def _add_cells(content: Content, cells: dict[Kind, list[_ROW]], labels: np.ndarray) -> None:
    for dim in (3, 2):
        members, properties = [], []
        for kind, rows in cells.items():
            if kind.dim != dim:
                continue
            corners = np.array([nodes for nodes, _ in rows], dtype=np.int64)
            members.append(content.cells() + np.arange(len(rows)))
            properties.append(np.array([number for _, number in rows]))
            content.blocks.append((kind, numbered(corners, labels, kind.name)))
        if members:
            content.cell_groups += groups_by_number(
                np.concatenate(properties), np.concatenate(members), {}
            )


def _cards(text: str) -> Iterator[tuple[int, str, list[str]]]:
    """Line, name and data fields of each card, continued lines put together."""
    begin = re.search(r"(?im)^[ \t]*BEGIN[ \t]+BULK.*$", text)
    first = text.count("\n", 0, begin.end()) + 1 if begin else 0
    name, fields, at = "", [], 0
    for number, line in enumerate(text.splitlines()[first:], start=first + 1):
        line = line.split("$", 1)[0].rstrip()
        if not line.strip():
            continue
        head, data = _split(line)
        if head in ("", "*") or head[0] in "+*":
            fields += data
            continue
        if name:
            yield at, name, fields
        name, fields, at = head.upper().rstrip("*"), data, number
        if name == "ENDDATA":
            return
    if name:
        yield at, name, fields


def _split(line: str) -> tuple[str, list[str]]:
    """The first field and the data fields of a line: 8, or 4 of double width."""
    if "," in line:
        words = line.split(",")
        head = words[0].strip()
        width = 4 if "*" in head else 8
        return head, (words[1:] + [""] * width)[:width]
    line = line.expandtabs(8)
    head = line[:8].strip()
    if "*" in head:
        return head, [line[k : k + 16] for k in range(8, 72, 16)]
    return head, [line[k : k + 8] for k in range(8, 72, 8)]


def _integer(fields: list[str], place: int, line: int, missing: int | None = None) -> int:
    text = fields[place].strip() if place < len(fields) else ""
    if not text and missing is not None:
        return missing
    if not re.fullmatch(r"[-+]?\d{1,15}", text):
        raise MeshError(f"line {line}: field {place + 2} holds {text!r}, no whole number")
    return int(text)


def _real(fields: list[str], place: int, line: int) -> float:
    """A real number, whose exponent may have no letter: 1.5-3."""
    text = fields[place].strip().lower().replace("d", "e") if place < len(fields) else ""
    if not text:
        return 0.0
    try:
        return float(re.sub(r"(?<=[\d.])([-+]\d+)$", r"e\1", text) if "e" not in text else text)
    except ValueError:
        raise MeshError(f"line {line}: field {place + 2} holds {text!r}, no number") from None
