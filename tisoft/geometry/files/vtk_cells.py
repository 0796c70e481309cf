"""What both kinds of VTK files share: the numbers of cells, and cell arrays that name regions.

Source: the VTK file formats, and vtkCellType.h.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError
from tisoft.geometry.files import kinds
from tisoft.geometry.files.content import Content, Ints, groups_by_number
from tisoft.geometry.files.kinds import Kind

KINDS: dict[int, Kind] = {
    0: kinds.NO_CELL,
    1: kinds.VERTEX,
    2: Kind("poly-vertex", 0, 0),
    3: kinds.LINE,
    4: Kind("poly-line", 1, 0),
    5: kinds.TRIANGLE,
    6: Kind("triangle strip", 2, 0),
    7: Kind("polygon", 2, 0),
    8: kinds.PIXEL,
    9: kinds.QUAD,
    10: kinds.TET,
    11: kinds.VOXEL,
    12: kinds.HEX,
    13: kinds.WEDGE,
    14: kinds.PYRAMID,
    15: Kind("pentagonal prism", 3, 0, 10),
    16: Kind("hexagonal prism", 3, 0, 12),
    41: Kind("convex point set", 3, 0),
    42: kinds.POLYHEDRON,
} | {
    number: kinds.of_order(base, nodes)
    for number, base, nodes in (
        (21, kinds.LINE, 3),
        (22, kinds.TRIANGLE, 6),
        (23, kinds.QUAD, 8),
        (24, kinds.TET, 10),
        (25, kinds.HEX, 20),
        (26, kinds.WEDGE, 15),
        (27, kinds.PYRAMID, 13),
        (28, kinds.QUAD, 9),
        (29, kinds.HEX, 27),
        (30, kinds.QUAD, 6),
        (31, kinds.WEDGE, 12),
        (32, kinds.WEDGE, 18),
        (33, kinds.HEX, 24),
        (34, kinds.TRIANGLE, 7),
        (35, kinds.LINE, 4),
        (37, kinds.PYRAMID, 19),
    )
}
# Lagrange and Bézier cells of any order: corners first.
for _first in (68, 75):
    for _number, _base in enumerate(
        (kinds.LINE, kinds.TRIANGLE, kinds.QUAD, kinds.TET, kinds.HEX, kinds.WEDGE, kinds.PYRAMID),
        start=_first,
    ):
        KINDS[_number] = Kind(f"higher-order {_base.name}", _base.dim, _base.corners)

_IN_ROWS = {kinds.VOXEL: [0, 1, 3, 2, 4, 5, 7, 6], kinds.PIXEL: [0, 1, 3, 2]}
"""Cells along the axes number their corners in rows; here in the order of hexahedra and quads."""

REGION_ARRAYS = (
    "gmsh:physical", "medit:ref", "cell_tags", "materialids", "materialid", "material_id",
    "material", "materials", "mat", "region", "regions", "regionid", "region_id", "physical",
    "physicalids", "subdomain", "subdomains", "domain", "elset", "group", "groupid", "label",
    "labels", "attribute", "attributes", "cellentityids", "block_id", "tag", "tags", "part",
    "partid",
    "scalars", "cell_scalars", "gmsh:geometrical",
)  # fmt: skip
"""Usual names of cell arrays that number regions, in the order in which they are believed."""
_NO_REGIONS = (
    "vtkoriginal",
    "vtkghost",
    "globalid",
    "global_id",
    "pedigree",
    "originalid",
    "cellid",
)
_DUPLICATE, _HIDDEN = 1, 32
"""Bits of vtkGhostType: another piece's cell, a cell that is blanked out."""


def add_cells(
    content: Content,
    connectivity: Ints,
    ends: Ints,
    types: Ints,
    arrays: Mapping[str, NDArray[Any]],
) -> None:
    """Adds the cells of one piece, whose points are the last of `content`, by kinds.

    `ends` are where each cell's nodes end in `connectivity`, `types` VTK's numbers, and `arrays`
    cell arrays with a row a cell.  Raises MeshError where they contradict each other.
    """
    sizes = np.diff(ends, prepend=0)
    if (sizes < 0).any() or (len(ends) and ends[-1] != len(connectivity)):
        raise MeshError(
            f"its offsets end at {ends[-1]}, but there are {len(connectivity)} connectivity "
            "entries; the file is damaged"
        )
    if len(types) != len(ends):
        raise MeshError(
            f"it holds {len(ends)} cells, but {len(types)} cell types; the file is damaged"
        )
    ghost = _ghosts(arrays, len(types))
    place = content.cells()
    order = np.full(len(types), -1, dtype=np.int64)
    for number in dict.fromkeys(types[~ghost].tolist()):
        kind = KINDS.get(number, Kind(f"cell of VTK type {number}", 3, 0))
        if kind is kinds.NO_CELL:
            continue
        chosen = np.flatnonzero((types == number) & ~ghost)
        rows = _rows(kind, chosen, sizes, ends, connectivity)
        content.blocks.append((kind, rows))
        order[chosen] = place + np.arange(len(chosen))
        place += len(chosen)
    if ghost.any():
        content.notes.append(f"{int(ghost.sum())} ghost cells of its pieces are left out")
    _add_regions(content, arrays, order, types)


def _rows(kind: Kind, chosen: Ints, sizes: Ints, ends: Ints, connectivity: Ints) -> Ints:
    """Nodes of cells of one kind; of kinds with any number of nodes the corners alone."""
    least = kind.nodes or kind.corners
    wrong = sizes[chosen] < least if kind.nodes == 0 else sizes[chosen] != least
    if wrong.any():
        cell = int(chosen[wrong][0])
        raise MeshError(
            f"cell {cell} (counted from 0), a {kind.name}, has {sizes[cell]} nodes, not {least}; "
            "the file is damaged"
        )
    starts = ends[chosen] - sizes[chosen]
    rows = connectivity[starts[:, None] + np.arange(least)]
    return rows[:, _IN_ROWS[kind]] if kind in _IN_ROWS else rows


def _ghosts(arrays: Mapping[str, NDArray[Any]], cells: int) -> NDArray[np.bool_]:
    for name, values in arrays.items():
        if len(values) == cells and values.ndim == 1 and values.dtype.kind in "iu":
            if name.lower() == "vtkghosttype":
                return (values & (_DUPLICATE | _HIDDEN)) != 0
            if name.lower() == "vtkghostlevels":
                return values > 0
    return np.zeros(cells, dtype=bool)


def _add_regions(
    content: Content, arrays: Mapping[str, NDArray[Any]], order: Ints, types: Ints
) -> None:
    """Regions of the cell array that most likely numbers them."""
    solid = np.isin(types, [number for number, kind in KINDS.items() if kind.dim == 3]) & (
        order >= 0
    )
    counted = {
        name: values
        for name, values in arrays.items()
        if values.shape == types.shape and _numbers_regions(name, values[solid])
    }
    rank = {name: place for place, name in enumerate(REGION_ARRAYS)}
    names = sorted(counted, key=lambda name: rank.get(name.lower(), len(rank)))
    if not names:
        return
    kept = order >= 0
    content.cell_groups += groups_by_number(counted[names[0]][kept], order[kept])
    content.regions_of = names[0]


def tell_unused(content: Content, names: list[str]) -> None:
    """A note of the data that is neither regions nor needed otherwise."""
    needed = (content.regions_of, "vtkGhostType", "vtkGhostLevels")
    other = [name for name in dict.fromkeys(names) if name not in needed]
    if other:
        listed = ", ".join(f'"{name}"' for name in other[:6]) + ", …" * (len(other) > 6)
        note = f"data of the file that is not used: {listed}"
        content.notes = [told for told in content.notes if told != note] + [note]


def _numbers_regions(name: str, values: NDArray[Any]) -> bool:
    """Whether whole numbers, few and more than one, stand at the solids."""
    if any(word in name.lower().replace(" ", "") for word in _NO_REGIONS) or len(values) == 0:
        return False
    if values.dtype.kind == "f":
        with np.errstate(invalid="ignore"):
            if not (values == np.rint(values)).all():
                return False
    elif values.dtype.kind not in "iu":
        return False
    different = len(np.unique(values))
    return 1 < different <= max(2, min(1000, len(values) // 2))
