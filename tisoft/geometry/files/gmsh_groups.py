"""Elements of a Gmsh file with their physical groups, as content of a mesh."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.files.content import Content, Group, Ints, groups_by_number, numbered
from tisoft.geometry.files.kinds import Kind

Marks = NDArray[np.int64]


@dataclass
class Elements:
    """Elements by kind in the file's order, and the physical and elementary number of each."""

    rows: dict[Kind, list[Ints]] = field(default_factory=lambda: defaultdict(list))
    marks: dict[Kind, list[Ints]] = field(default_factory=lambda: defaultdict(list))
    """Per element: elementary number and physical number, shape (elements, 2)."""

    def add(self, kind: Kind, nodes: Ints, elementary: Ints | int, physical: Ints | int) -> None:
        mark = np.empty((len(nodes), 2), dtype=np.int64)
        mark[:, 0], mark[:, 1] = elementary, np.abs(physical)
        self.rows[kind].append(nodes)
        self.marks[kind].append(mark)


def content_of(
    labels: Ints,
    points: NDArray[np.float64],
    elements: Elements,
    physicals: dict[tuple[int, int], list[int]],
    names: dict[int, dict[int, str]],
) -> Content:
    content = Content(points)
    marks: dict[int, list[tuple[Ints, Ints]]] = defaultdict(list)
    for kind, parts in elements.rows.items():
        rows = numbered(np.concatenate(parts), labels, kind.name)
        mark = np.concatenate(elements.marks[kind])
        cells = np.arange(len(rows))
        if kind.dim == 3 and len(np.unique(mark[:, 1])) > 1:
            rows, cells = _once(rows)
        marks[kind.dim].append((cells + content.cells(), mark))
        content.blocks.append((kind, rows))
    for dim, found in marks.items():
        members, mark = (np.concatenate(parts) for parts in zip(*found, strict=True))
        groups = _groups(dim, members, mark, physicals, names.get(dim, {}))
        if dim:
            content.cell_groups += groups
        else:
            nodes = np.concatenate([rows.ravel() for kind, rows in content.blocks if kind.dim == 0])
            content.node_groups += [
                Group(g.name, g.tag, nodes[_places(g, members)]) for g in groups
            ]
    return content


def _places(group: Group, members: Ints) -> Ints:
    return np.searchsorted(members, group.members)


def _once(rows: Ints) -> tuple[Ints, Ints]:
    """The rows without repeats, and where each row went.

    Versions 1 and 2 repeat an element for every physical group that it belongs to.
    """
    ordered = np.sort(rows, axis=1)
    order = np.lexsort(ordered.T)
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (ordered[order[1:]] != ordered[order[:-1]]).any(axis=1)
    if new.all():
        return rows, np.arange(len(rows))
    first = order[new]  # lexsort is stable: the first of equal rows
    place = np.empty(len(rows), dtype=np.int64)
    place[order] = np.argsort(np.argsort(first))[np.cumsum(new) - 1]
    return rows[np.sort(first)], place


def _groups(
    dim: int,
    members: Ints,
    mark: Marks,
    physicals: dict[tuple[int, int], list[int]],
    names: dict[int, str],
) -> list[Group]:
    """Physical groups, or the geometry's entities where no element has one."""
    entities = np.unique(mark[:, 0])
    listed = {int(e): physicals.get((dim, int(e)), []) for e in entities[:100_000]}
    if any(listed.values()):
        found = []
        for tag in sorted({tag for tags in listed.values() for tag in tags}):
            mine = [entity for entity, tags in listed.items() if tag in tags]
            rows = members[np.isin(mark[:, 0], mine)]
            found.append(Group(names.get(tag, str(tag)), tag, rows))
        return found
    if mark[:, 1].any():
        return groups_by_number(mark[:, 1], members, names)
    return groups_by_number(mark[:, 0], members, {}) if dim == 3 else []
