"""The formats that meshio reads, and what it does not look at itself."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from tisoft.errors import MeshError
from tisoft.geometry.files import kinds
from tisoft.geometry.files.content import Content, Group, groups_by_number
from tisoft.geometry.files.kinds import Kind
from tisoft.geometry.files.quiet import guarded, no_surprises

_COMPRESSED = (".gz", ".h5", ".h5m", ".med", ".cgns", ".hmf", ".e", ".exo", ".ex2", ".xdmf", ".xmf")
# Readers that wait for ever at the end of a file that is cut short; whether they read bytes.
_WAITING = {"ansys": True, "mdpa": True, "tecplot": False}

_NUMBERINGS = {
    "tecplot": (rb"^\s*ZONE\b", "zones"),
    "su2": (rb"^\s*IZONE\s*=", "zones"),
    "permas": (rb"^\s*\$COOR\b", "lists of nodes"),
    "mdpa": (rb"^\s*Begin\s+Nodes\b", "lists of nodes"),
    "dolfin-xml": (rb"<vertices\b", "lists of nodes"),
    "netgen": (rb"^\s*points\s*$", "lists of nodes"),
}
"""Where a file of the format begins to count nodes anew; meshio reads the first list, or mixes."""

_BASES = {
    "vertex": kinds.VERTEX, "line": kinds.LINE, "triangle": kinds.TRIANGLE, "quad": kinds.QUAD,
    "tetra": kinds.TET, "hexahedron": kinds.HEX, "wedge": kinds.WEDGE, "pyramid": kinds.PYRAMID,
}  # fmt: skip
REGION_DATA = ("medit:ref", "nastran:ref", "gmsh:physical", "cell_tags", "flac3d:group", "su2:tag",
               "netgen:index", "ansys:zone")  # fmt: skip


def read_foreign(path: Path, name: str) -> Content:
    """The mesh of a file in the format that meshio calls `name`.

    Raises MeshError for whatever meshio does with a bad file, and for counts that disagree.
    """
    import meshio

    _check_numberings(path, name)
    with no_surprises(path):
        if name in _WAITING:
            with guarded(path, binary=_WAITING[name]) as file:
                mesh = meshio.read(file, file_format=name)
        else:
            mesh = meshio.read(path, file_format=name)
        _check_honest(path, len(mesh.points))
        if name == "dolfin-xml":
            _check_dolfin(path, mesh)
        return _content(mesh)


def _content(mesh: Any) -> Content:
    points = np.asarray(mesh.points, dtype=np.float64)
    if points.ndim == 2 and points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    content = Content(points)
    starts = np.cumsum([0, *(len(block.data) for block in mesh.cells)])
    for block in mesh.cells:
        content.blocks.append((_kind(block.type, block.data), np.asarray(block.data, np.int64)))
    for name in REGION_DATA:
        if name in mesh.cell_data:
            content.cell_groups = _by_data(content, mesh.cell_data[name], starts)
            break
    for name, parts in mesh.cell_sets.items():
        rows = [
            start + np.asarray(part, np.int64).ravel()
            for start, part in zip(starts, parts, strict=False)
            if part is not None and np.size(part)
        ]
        if rows:
            content.cell_groups.append(Group(str(name), None, np.concatenate(rows)))
    for name, nodes in mesh.point_sets.items():
        content.node_groups.append(Group(str(name), None, np.asarray(nodes, np.int64).ravel()))
    return content


def _by_data(content: Content, data: Any, starts: Any) -> list[Group]:
    """Groups by a cell array, solids and faces apart: their numbers need not mean the same."""
    groups = []
    for dim in (3, 2):
        numbers, members = [], []
        for (kind, rows), values, start in zip(content.blocks, data, starts, strict=False):
            if kind.dim == dim and len(rows) and np.shape(values) == (len(rows),):
                numbers.append(np.asarray(values))
                members.append(start + np.arange(len(rows)))
        if numbers:
            groups += groups_by_number(np.concatenate(numbers), np.concatenate(members), {})
    return groups


def _kind(name: str, rows: Any) -> Kind:
    """The kind of cell that meshio calls tetra10, VTK_LAGRANGE_HEXAHEDRON and so on."""
    plain = re.sub(r"\d+$", "", name.lower().removeprefix("vtk_lagrange_"))
    base = _BASES.get(
        {"tetrahedron": "tetra", "curve": "line", "quadrilateral": "quad"}.get(plain, plain)
    )
    width = np.shape(rows)[1] if np.ndim(rows) == 2 else 0
    if base is None or width < base.corners:
        return Kind(name, 3 if "poly" in plain and plain != "polygon" else 2, 0)
    return kinds.of_order(base, width)


def _check_numberings(path: Path, name: str) -> None:
    """Refuses files that hold more than one list of nodes."""
    if name not in _NUMBERINGS or path.suffix == ".gz":
        return
    begin, what = _NUMBERINGS[name]
    count = len(re.findall(begin, path.read_bytes(), re.MULTILINE | re.IGNORECASE))
    if count > 1:
        raise MeshError(
            f"it holds {count} {what}, of which one can be read; write one file for each"
        )


def _check_honest(path: Path, nodes: int) -> None:
    """Refuses more nodes than bytes: meshio allocates what a file announces before it looks."""
    size = path.stat().st_size
    if nodes > size and path.suffix.lower() not in _COMPRESSED:
        raise MeshError(f"it announces {nodes} nodes in {size} bytes; the file is damaged")


def _check_dolfin(path: Path, mesh: object) -> None:
    """meshio fills rows that a file announces, but does not give, with what memory held."""
    data = path.read_bytes()
    counts = {"vertex": len(mesh.points)}  # type: ignore[attr-defined]
    for block in mesh.cells:  # type: ignore[attr-defined]
        tag = {"tetra": "tetrahedron"}.get(block.type, block.type)
        counts[tag] = counts.get(tag, 0) + len(block.data)
    for tag, announced in counts.items():
        given = len(re.findall(rb"<" + tag.encode() + rb"\s", data))
        if given != announced:
            raise MeshError(f"it announces {announced} <{tag}> entries, but holds {given}")
