"""TetGen's pairs of files: NAME.node and NAME.ele, with NAME.face where it is there.

Counts from 0 or 1, comments, attributes, boundary markers and second order are optional.  Regions
are the first attribute of the tets, sets the boundary markers of faces and nodes.
Source: the TetGen manual, "File formats".
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError
from tisoft.geometry.files import kinds
from tisoft.geometry.files.content import Content, groups_by_number, numbered
from tisoft.geometry.files.text import BYTE_ORDER_MARK, numbers, whole

Table = NDArray[np.float64]


def read_tetgen(path: Path) -> Content:
    """The mesh of a pair of files, either of which is named."""
    nodes, tets = path.with_suffix(".node"), path.with_suffix(".ele")
    for part in (nodes, tets):
        if not part.is_file():
            raise MeshError(
                f"TetGen meshes are pairs of files, and {part.name} is missing beside it"
            )
    head, rows = _table(nodes, least=4)
    if len(head) > 1 and head[1] != 3:
        raise MeshError(f"{nodes.name} is of {head[1]} dimensions; a mesh of 3 is needed")
    labels = whole(rows[:, 0], nodes.name)
    content = Content(rows[:, 1:4].copy())
    marked = len(head) > 3 and head[3] == 1 and rows.shape[1] > 4
    if marked:
        content.node_groups = groups_by_number(rows[:, -1], np.arange(len(rows)), {})
    head, rows = _table(tets, least=5)
    corners = head[1] if len(head) > 1 else 4
    if corners not in (4, 10) or rows.shape[1] < 1 + corners:
        raise MeshError(
            f"{tets.name} announces {corners} nodes a tet, but its rows hold {rows.shape[1] - 1} "
            "numbers after their own; 4 or 10 are possible"
        )
    cells = whole(rows[:, 1 : 1 + corners], tets.name)
    kind = kinds.of_order(kinds.TET, corners)
    content.blocks.append((kind, numbered(cells, labels, kind.name)))
    if rows.shape[1] > 1 + corners:
        content.cell_groups = groups_by_number(rows[:, 1 + corners], np.arange(len(rows)))
    faces = path.with_suffix(".face")
    if faces.is_file():
        _add_faces(content, faces, labels)
    return content


def _add_faces(content: Content, path: Path, labels: NDArray[np.int64]) -> None:
    """Faces by their boundary markers; a file of faces that cannot be read is not needed."""
    try:
        head, rows = _table(path, least=4)
        if len(head) < 2 or head[1] != 1 or rows.shape[1] < 5:
            return
        corners = numbered(whole(rows[:, 1:4], path.name), labels, "triangle")
    except MeshError as error:
        content.notes.append(f"its faces are left out ({error})")
        return
    first = content.cells()
    content.blocks.append((kinds.TRIANGLE, corners))
    column = rows[:, 4] if rows.shape[1] in (5, 7) else rows[:, -1]
    content.cell_groups += groups_by_number(column, first + np.arange(len(rows)), {})


def _table(path: Path, least: int) -> tuple[list[int], Table]:
    """The head of a file, as whole numbers, and its rows, all of one width."""
    text = re.sub(rb"#[^\n]*", b"", path.read_bytes().removeprefix(BYTE_ORDER_MARK)).strip()
    first, _, rest = text.partition(b"\n")
    if not first.strip():
        raise MeshError(f"{path.name} holds no rows; the file is cut short")
    head = whole(numbers(first, path.name), path.name).tolist()
    count, values = head[0], numbers(rest, path.name)
    if count == 0 and path.suffix == ".node":
        raise MeshError(f"{path.name} holds no nodes: they are in another file (.poly or .smesh)")
    if count < 1 or len(values) % count or len(values) // count < least:
        raise MeshError(
            f"{path.name} announces {count} rows, but holds {len(values)} numbers, not {least} or "
            "more for each; the file is cut short or damaged"
        )
    rows = values.reshape(count, -1)
    width = len(rest[: (rest.find(b"\n") + 1) or None].split())
    if width != rows.shape[1]:
        raise MeshError(
            f"{path.name} announces {count} rows, but {len(values) / width:.4g} rows of {width} "
            "numbers follow; the file is cut short or damaged"
        )
    return head, rows
