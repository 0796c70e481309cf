"""Elements, one file each: rest numbers, forces, energy, product, frequency bound.

`element` tells which class computes the cells of a kind of a mesh (`geometry.cells`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.cells import LATTICE


def element(
    word: str, points: NDArray[np.float64], cells: NDArray[np.integer]
) -> tuple[Any, NDArray[np.int64]]:
    """The element's class, and the order in which it takes the corners of a cell.

    Args:
        word: of the kind of cells: "tet4", "tet10", "hex8".
        points: rest positions [m], shape (nodes, 3).
        cells: nodes of the cells, shape (cells, corners).
    """
    if word == "hex8":
        from tisoft.elements import hex8

        return hex8.element_of(points, cells[:, LATTICE]), LATTICE
    if word == "tet10":
        from tisoft.elements import tet10

        return tet10.element_of(points, cells), np.arange(10)
    from tisoft.elements.tet4 import Tet4

    return Tet4, np.arange(4)
