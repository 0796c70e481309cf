"""A run that was saved, frame by frame, as VTU files: read again to be drawn.

See vtu.py for what the files hold.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import SceneError
from tisoft.geometry.cells import point_volumes
from tisoft.geometry.faces import boundary_of
from tisoft.measures.elements import NodalAverage
from tisoft.observers.quantities import mises
from tisoft.observers.scenery import TRANSLUCENT, Actor, spring_items
from tisoft.observers.track import Snapshot
from tisoft.render.colormap import body_color
from tisoft.render.items import Surface

Floats = NDArray[np.float64]

SOLIDS = {"tetra": "tet4", "tetra10": "tet10", "hexahedron": "hex8"}
"""Kinds of cells of solids, as meshio and as `geometry.cells` calls them."""


class SavedRun:
    """The frames that a .pvd file lists; iterating reads them one by one.

    Args:
        path: of frames.pvd.
        color: what colours show, as in `render`.

    Raises:
        SceneError: a list or a frame that cannot be read, or that lacks what the colours need.
    """

    def __init__(self, path: Path, color: str) -> None:
        self.path = path
        self.color = color
        self.frames = _listed(path)
        first = self._read(self.frames[0][1])
        self.actors = _actors(first)
        self._averages = _averages(first)
        self._carriers = _carriers(first)
        self._shape = first.points.shape

    def __len__(self) -> int:
        return len(self.frames)

    def __iter__(self) -> Iterator[Snapshot]:
        for time, name in self.frames:
            mesh = self._read(name)
            if mesh.points.shape != self._shape:
                raise SceneError(f"{name} has other nodes than the frames before; run it anew")
            yield Snapshot(time, np.asarray(mesh.points, np.float64), self._values(mesh, name))

    def rate(self) -> float:
        """Frames a second of simulated time."""
        times = [time for time, _ in self.frames]
        span = times[-1] - times[0]
        return (len(times) - 1) / span if span > 0.0 else 30.0

    def _read(self, name: Path) -> Any:
        import meshio

        from tisoft.errors import MeshError
        from tisoft.geometry.files.quiet import no_surprises

        if not name.is_file():
            raise SceneError(f"{name} is missing, which {self.path} lists; run the scene anew")
        try:
            with no_surprises(name):
                return meshio.read(name)
        except MeshError as error:
            raise SceneError(f"{name} cannot be read: {error}") from None

    def _values(self, mesh: Any, name: Path) -> Floats | None:
        if self.color == "body":
            return None
        if self.color == "region":
            problem = "holds no regions; draw the scene, or take --color body"
            raise SceneError(f"{name} {problem}")
        if self.color == "speed":
            if "velocity" not in mesh.point_data:
                raise SceneError(f"{name} holds no velocity; draw it with --color body")
            return np.asarray(np.linalg.norm(mesh.point_data["velocity"], axis=1), np.float64)
        values = np.zeros(len(mesh.points))
        found = False
        for index, cells in enumerate(mesh.cells):
            each = _of_cells(mesh, index, cells.type, self.color)
            if each is not None and cells.type in self._averages:
                found = True
                own = np.unique(cells.data)
                values[own] = self._averages[cells.type](each)[own]
        if not found:
            raise SceneError(f"{name} holds no {self.color}; draw it with --color body")
        skin, near, shares = self._carriers
        values[skin] = (values[near] * shares).sum(axis=1)
        return values


def _of_cells(mesh: Any, index: int, kind: str, color: str) -> Floats | None:
    """The quantity of every cell of a block."""
    data = mesh.cell_data
    if kind in SOLIDS and color == "stress" and "von_mises" in data:
        return np.asarray(data["von_mises"][index], np.float64)
    if kind in SOLIDS and color == "strain" and "strain" in data:
        tensors = np.asarray(data["strain"][index], np.float64).reshape(-1, 3, 3)
        return 100.0 * mises(tensors) * 2.0 / 3.0
    if kind == "line" and color == "strain" and "spring_strain" in data:
        return 100.0 * np.abs(np.asarray(data["spring_strain"][index], np.float64))
    return None


def _listed(path: Path) -> list[tuple[float, Path]]:
    """Times [s] and files of a .pvd file."""
    try:
        root = ElementTree.parse(path).getroot()
        rows = [(float(e.attrib["timestep"]), e.attrib["file"]) for e in root.iter("DataSet")]
    except OSError as error:
        raise SceneError(f"{path} cannot be read: {error.strerror}; name a frames.pvd") from None
    except (ElementTree.ParseError, KeyError, ValueError):
        raise SceneError(f"{path} is no list of frames; name the frames.pvd of a run") from None
    if not rows:
        raise SceneError(f"{path} lists no frames; run the scene with --save-every 1")
    return [(time, path.parent / name) for time, name in rows]


def _averages(mesh: Any) -> dict[str, NodalAverage]:
    """How values of cells become values of nodes, by kind of cell."""
    made = {}
    for cells in mesh.cells:
        if cells.type in SOLIDS:
            volumes = _volumes(mesh, SOLIDS[cells.type], cells.data)
            made[cells.type] = NodalAverage([cells.data], len(mesh.points), volumes)
        elif cells.type == "line":
            made["line"] = NodalAverage([cells.data], len(mesh.points))
    return made


def _volumes(mesh: Any, word: str, cells: NDArray[np.int64]) -> Floats:
    """Of the cells at rest [m³]."""
    rest = mesh.points - mesh.point_data.get("displacement", 0.0)
    return np.abs(point_volumes(word, np.asarray(rest, np.float64)[cells])).sum(axis=1)


def _carriers(mesh: Any) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
    """Points of skins, the nodes of tets nearest to each at rest, and their shares in its value."""
    from scipy.spatial import cKDTree

    rest = np.asarray(mesh.points - mesh.point_data.get("displacement", 0.0), np.float64)
    blocks = [cells.data for cells in mesh.cells if cells.type != "triangle"]
    nodes = np.unique(np.concatenate([np.zeros(0, np.int64), *(b.ravel() for b in blocks)]))
    skin = np.setdiff1d(np.arange(len(rest)), nodes)
    if not len(skin) or not len(nodes):
        nothing = np.zeros((0, 4), np.int64)
        return nothing[:, 0], nothing, nothing.astype(np.float64)
    count = min(4, len(nodes))
    far, near = cKDTree(rest[nodes]).query(rest[skin], k=count)
    shares = 1.0 / np.maximum(far.reshape(-1, count), 1e-12 * np.ptp(rest))
    return skin, nodes[near.reshape(-1, count)], shares / shares.sum(axis=1, keepdims=True)


def _actors(mesh: Any) -> list[Actor]:
    """What shows the bodies of a file, at the places that it holds."""
    blocks = {cells.type: (cells.data, index) for index, cells in enumerate(mesh.cells)}
    owner = mesh.cell_data.get("body")
    made: list[Actor] = []
    points = np.asarray(mesh.points, np.float64)

    def of(kind: str, number: int) -> NDArray[np.int32]:
        if kind not in blocks:
            return np.zeros((0, 3), np.int32)
        rows, index = blocks[kind]
        mine = rows if owner is None else rows[np.asarray(owner[index]) == number]
        return np.asarray(mine, np.int32)

    numbers = [0] if owner is None else np.unique(np.concatenate(owner)).astype(int).tolist()
    for number in numbers:
        color = body_color(number)
        triangles, lines = (of(kind, number) for kind in ("triangle", "line"))
        solids = {word: of(kind, number) for kind, word in SOLIDS.items()}
        solids = {word: rows for word, rows in solids.items() if len(rows)}
        if solids and not len(triangles):
            triangles = boundary_of(solids).triangles.astype(np.int32)
        nodes = np.concatenate([a.ravel() for a in (*solids.values(), triangles, lines)])
        actor = Actor(f"body{number}", slice(int(nodes.min()), int(nodes.max()) + 1))
        if len(triangles):
            actor.items = [Surface(points, triangles, color, translucent=TRANSLUCENT)]
        else:
            actor.items = spring_items(points, lines, color)
        made.append(actor)
    return made
