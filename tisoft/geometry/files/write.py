"""Meshes and data written to VTU files."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from tisoft.whole_files import written

KINDS = {
    "tets": "tetra",
    "quadratic_tets": "tetra10",
    "hexes": "hexahedron",
    "triangles": "triangle",
    "lines": "line",
}
"""Kinds of cells, and what meshio calls them."""


def write_vtu(
    path: str | os.PathLike[str],
    points: ArrayLike,
    *,
    point_data: Mapping[str, ArrayLike] | None = None,
    cell_data: Mapping[str, ArrayLike] | None = None,
    **cells: ArrayLike,
) -> None:
    """Writes points [m], cells and data to a VTU file (binary, compressed), whole or not at all.

    `cells`: nodes of the cells, by kinds of KINDS.  An array of `point_data` has a row per node,
    one of `cell_data` a row per cell, in the order of KINDS.  Raises SceneError where the file
    cannot be written.
    """
    import meshio

    blocks = [(kind, np.asarray(cells.pop(name))) for name, kind in KINDS.items() if name in cells]
    if cells:
        raise TypeError(f"write_vtu knows no {next(iter(cells))}; it writes {', '.join(KINDS)}")
    ends = np.cumsum([len(rows) for _, rows in blocks])[:-1]
    per_cell = {name: np.split(np.asarray(v), ends) for name, v in (cell_data or {}).items()}
    per_point = {name: np.asarray(v) for name, v in (point_data or {}).items()}
    mesh = meshio.Mesh(np.asarray(points), blocks, point_data=per_point, cell_data=per_cell)
    with written(Path(path)) as file:
        mesh.write(Path(file.name), file_format="vtu")  # it wants to open files itself
