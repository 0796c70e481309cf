"""Parts of a mesh that its file names: regions of tets, and sets of nodes or faces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Region:
    """Tets that a file calls by a name, a number or both."""

    name: str
    tag: int | None
    tets: Ints
    """Rows of `mesh.tets`, ascending."""


@dataclass(frozen=True, eq=False)
class NodeSet:
    """Nodes, or faces with their nodes, that a file calls by a name, a number or both."""

    name: str
    tag: int | None
    nodes: Ints
    """Rows of `mesh.points`, ascending."""
    faces: Ints
    """Triangles by rows of `mesh.points`, shape (faces, 3); none where the file gives nodes."""


Group = Region | NodeSet


def named(groups: Sequence[Group], wanted: str | float) -> list[int]:
    """Places of the groups that a user means: by name, else in any case, else by number."""
    text = str(wanted).strip()
    exact = [k for k, group in enumerate(groups) if group.name == text]
    loose = [k for k, group in enumerate(groups) if group.name.lower() == text.lower()]
    numbered = [k for k, group in enumerate(groups) if str(group.tag) == text]
    return exact or loose or numbered


def title(group: Group) -> str:
    """ "soft" (1), or 7 where the number is all there is."""
    if str(group.tag) == group.name:
        return group.name
    return f'"{group.name}"' + (f" ({group.tag})" if group.tag is not None else "")


def listed(groups: Sequence[Group], most: int = 8) -> str:
    """The titles of the first groups: "soft" (1), "stiff" (2), 7."""
    return ", ".join([title(group) for group in groups[:most]] + ["…"] * (len(groups) > most))
