"""What a mesh file holds, as its reader found it: nodes, cells, named groups, and what was said."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError
from tisoft.geometry.files.kinds import Kind

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

MOST_GROUPS = 1000
"""Different numbers beyond which a cell array describes cells one by one, and no regions."""


@dataclass
class Group:
    """Cells or nodes that a file calls by a name or a number."""

    name: str
    tag: int | None
    members: Ints
    """Cells by their place over all blocks, or nodes, counted from 0."""


@dataclass
class Content:
    """A file's mesh, not yet checked."""

    points: Floats
    """Shape (nodes, 3)."""
    blocks: list[tuple[Kind, Ints]] = field(default_factory=list)
    """Cells of one kind: rows of node numbers from 0, shape (cells, nodes of a cell)."""
    cell_groups: list[Group] = field(default_factory=list)
    node_groups: list[Group] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    """What changes the body if it is not known, as the rest of a sentence after "the file"."""
    notes: list[str] = field(default_factory=list)
    regions_of: str = ""
    """The cell array that numbers regions."""

    def cells(self) -> int:
        """How many cells there are."""
        return sum(len(rows) for _, rows in self.blocks)


def groups_by_number(
    numbers: NDArray[Any], members: Ints, names: Mapping[int, str] | None = None
) -> list[Group]:
    """A group for every different number, as long as those are few; `numbers` has a row a member.

    Whole numbers are tags too; 0 without a name means no group.
    """
    found, inverse = np.unique(numbers, return_inverse=True)
    if len(found) > MOST_GROUPS or (found.dtype.kind == "f" and not np.isfinite(found).all()):
        return []
    order = np.argsort(inverse.ravel(), kind="stable")
    ends = np.searchsorted(inverse.ravel()[order], np.arange(len(found) + 1))
    groups = []
    for k, value in enumerate(found):
        tag = int(value) if float(value).is_integer() else None
        name = (names or {}).get(tag) if tag is not None else None
        if tag == 0 and name is None and names is not None:
            continue
        rows = members[order[ends[k] : ends[k + 1]]]
        groups.append(Group(name or (f"{float(value):.12g}"), tag, rows))
    return groups


def joined(groups: list[Group]) -> list[Group]:
    """Groups of one name and number, as pieces of a file have them, as one."""
    found: dict[tuple[str, int | None], list[Ints]] = {}
    for group in groups:
        found.setdefault((group.name, group.tag), []).append(group.members)
    return [Group(*key, np.concatenate(members)) for key, members in found.items()]


def numbered(rows: Ints, labels: Ints, what: str) -> Ints:
    """Node labels of cells as places in the list of nodes, whose labels may be sparse.

    Raises MeshError where a label is given twice, or used and not given.
    """
    if rows.size == 0:
        return rows.astype(np.int64)
    if len(labels) == 0:
        raise MeshError(f"there are {what} cells, but no nodes")
    order = np.argsort(labels, kind="stable")
    ordered = labels[order]
    double = ordered[1:][ordered[1:] == ordered[:-1]]
    if len(double):
        raise MeshError(f"node number {double[0]} is given twice; number the nodes anew")
    if ordered[-1] - ordered[0] == len(ordered) - 1:
        found = np.clip(rows - ordered[0], 0, len(ordered) - 1)
    else:
        found = np.minimum(np.searchsorted(ordered, rows), len(ordered) - 1)
    missing = ordered[found] != rows
    if missing.any():
        row = int(np.flatnonzero(missing.any(axis=1))[0])
        raise MeshError(
            f"{what} {row} (counted from 0) uses node {rows[missing][0]}, "
            "which the file does not define"
        )
    return order[found]
