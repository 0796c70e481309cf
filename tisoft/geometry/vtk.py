"""VTK files whose counts agree: meshio keeps only the last piece of a VTU file, and does not look
whether offsets, types and announced counts fit.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError

# VTK number: name in meshio's words, nodes (0: any number).
KINDS = {
    1: ("vertex", 1),
    3: ("line", 2),
    5: ("triangle", 3),
    9: ("quad", 4),
    10: ("tetra", 4),
    12: ("hexahedron", 8),
    13: ("wedge", 6),
    14: ("pyramid", 5),
    21: ("line3", 3),
    22: ("triangle6", 6),
    24: ("tetra10", 10),
    25: ("hexahedron20", 20),
    71: ("tetra of high order", 0),
    2: ("vertices", 0),
    4: ("line strips", 0),
    6: ("triangle strips", 0),
    7: ("polygon", 0),
    8: ("pixel", 4),
    23: ("quad8", 8),
    28: ("quad9", 9),
}


def read_vtu(path: Path) -> tuple[NDArray[np.float64], list[tuple[str, NDArray[np.int64]]]]:
    """Points, shape (nodes, 3), and cell blocks of all pieces of a VTU file."""
    from meshio.vtu._vtu import VtuReader

    class Recorder(VtuReader):
        """Keeps the arrays that describe the cells of each piece."""

        def __init__(self) -> None:
            self.arrays: list[dict[str, NDArray[np.integer]]] = []
            super().__init__(path)

        def read_data(self, tag: Any) -> Any:
            values = super().read_data(tag)
            name = tag.attrib.get("Name")
            if name in ("connectivity", "offsets", "types"):
                if not self.arrays or name in self.arrays[-1]:
                    self.arrays.append({})
                self.arrays[-1][name] = values.ravel()
            return values

    reader = Recorder()
    points = np.asarray(reader.points, dtype=np.float64)
    announced = [int(n) for n in re.findall(rb'NumberOfPoints\s*=\s*"\s*(\d+)', path.read_bytes())]
    if len(announced) != len(reader.arrays) or sum(announced) != len(points):
        raise MeshError(f"its pieces announce {announced} points, but hold {len(points)}")
    blocks, first = [], 0
    for arrays, nodes in zip(reader.arrays, announced, strict=True):
        blocks += [(kind, rows + first) for kind, rows in _cells(arrays, nodes)]
        first += nodes
    return points, blocks


def _cells(
    arrays: dict[str, NDArray[np.integer]], nodes: int
) -> list[tuple[str, NDArray[np.int64]]]:
    """Blocks of one kind from VTK's connectivity, offsets (ends) and types."""
    connectivity = arrays["connectivity"].astype(np.int64)
    ends, types = arrays["offsets"].astype(np.int64), arrays["types"]
    sizes = np.diff(ends, prepend=0)
    if (sizes < 0).any() or (len(ends) and ends[-1] != len(connectivity)):
        raise MeshError(
            f"its offsets end at {ends[-1]}, but there are {len(connectivity)} connectivity entries"
        )
    wrong = connectivity[(connectivity < 0) | (connectivity >= nodes)]
    if len(wrong):
        raise MeshError(
            f"a cell uses node {wrong[0]} (counted from 0), but there are {nodes} nodes"
        )
    blocks = []
    for number in dict.fromkeys(types.tolist()):
        kind, wanted = KINDS.get(number, (f"polyhedron (VTK type {number})", 0))
        chosen = np.flatnonzero(types == number)
        if wanted and (sizes[chosen] != wanted).any():
            cell = int(chosen[sizes[chosen] != wanted][0])
            raise MeshError(
                f"cell {cell} (from 0), a {kind}, has {sizes[cell]} nodes, not {wanted}"
            )
        width = int(sizes[chosen].min())
        starts = ends[chosen] - sizes[chosen]
        blocks.append((kind, connectivity[starts[:, None] + np.arange(width)]))
    return blocks


def vtk_counts(path: Path) -> tuple[int, int]:
    """Cells and nodes of cells that a legacy VTK file announces.

    Raises MeshError where it holds no unstructured grid or announces more than its size can hold.
    """
    data = path.read_bytes()
    kind = re.search(rb"^DATASET[ \t]+(\w+)", data[:4096], re.MULTILINE | re.IGNORECASE)
    if not data.startswith(b"# vtk DataFile") or kind is None:
        raise MeshError("this is no VTK file, or it is cut short")
    name = kind.group(1).decode(errors="replace").upper()
    if name == "POLYDATA":
        raise MeshError(
            "it holds a surface (POLYDATA), no tets; tetrahedralise it first, "
            "with fTetWild, TetGen or Gmsh for instance"
        )
    if name != "UNSTRUCTURED_GRID":
        raise MeshError(f"it holds a {name}, no tets; convert it to an UNSTRUCTURED_GRID of tets")
    _announced(data, "POINTS", 1)
    cells, entries = _announced(data, "CELLS", 2)
    (types,) = _announced(data, "CELL_TYPES", 1)
    # Version 5.1 announces one offset more than cells, older ones count each cell's size too.
    new = re.match(rb"# vtk DataFile Version\s+5\.1", data) is not None
    if types != (cells - 1 if new else cells):
        raise MeshError(f"CELLS announces {cells - new} cells, but CELL_TYPES {types}")
    return types, entries if new else entries - cells


def _announced(data: bytes, word: str, wanted: int) -> list[int]:
    found = re.search(rb"^" + word.encode() + rb"((?:[ \t]+-?\d{1,18})+)", data, re.MULTILINE)
    numbers = [int(n) for n in found.group(1).split()] if found else []
    if len(numbers) < wanted:
        raise MeshError(f"it has no {word} with {wanted} count(s); the file is cut short")
    if max(numbers) > len(data) or min(numbers) < 0:
        raise MeshError(f"{word} announces {numbers} in {len(data)} bytes; the file is damaged")
    return numbers[:wanted]


def check_vtk(counts: tuple[int, int], blocks: list[tuple[str, NDArray[np.int64]]]) -> None:
    """Refuses cells that are not as many as announced."""
    cells, entries = counts
    held = sum(len(rows) for _, rows in blocks)
    used = sum(rows.size for _, rows in blocks)
    if (held, used) != (cells, entries):
        raise MeshError(
            f"CELLS announces {cells} cells of {entries} nodes in all, "
            f"but {held} cells of {used} nodes were found; the file is damaged"
        )
