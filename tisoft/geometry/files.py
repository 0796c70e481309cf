"""Mesh files in and out.  meshio reads most formats; whatever it does with a bad file, a user sees
one sentence that names the file.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tisoft.errors import MeshError
from tisoft.geometry.gmsh import read_gmsh_text
from tisoft.geometry.mesh import SpringNet, TetMesh, spring_net, tet_mesh
from tisoft.geometry.quiet import guarded, no_surprises
from tisoft.geometry.vtk import check_vtk, read_vtu, vtk_counts
from tisoft.whole_files import written

Blocks = list[tuple[str, NDArray[np.int64]]]
Content = tuple[NDArray[np.float64], Blocks]

SURFACE_SUFFIXES = (".obj", ".off", ".ply", ".stl", ".svg", ".wkt", ".vtp")
_SOLIDS = ("hexa", "wedge", "pyramid", "polyhedron", "VTK_LAGRANGE_HEXA", "VTK_LAGRANGE_WEDGE")
_COMPRESSED = (".gz", ".h5", ".h5m", ".med", ".cgns", ".hmf", ".e", ".exo", ".ex2", ".vtu")
# Readers that wait for ever at the end of a file that is cut short; whether they read bytes.
_WAITING = {"ansys": True, "mdpa": True, "nastran": False, "tecplot": False}
_REMEDY = "tetrahedralise it first, with fTetWild, TetGen or Gmsh for instance"


def read_mesh(path: str | os.PathLike[str]) -> TetMesh | SpringNet:
    """The mesh of a file: tets, or springs where the file holds lines alone.

    Reads every tetrahedral format of meshio and Gmsh 1.  Several blocks of tets become one mesh;
    triangles, lines and vertices beside tets are ignored; of curved tets the four corners are used;
    unused nodes are dropped and wrongly oriented tets turned round, both counted.  Raises
    MeshError, one sentence that names the file, for whatever cannot be simulated.
    """
    path = Path(path)
    try:
        _check_readable(path)
        points, blocks = _content(path)
        return _mesh(path, points, blocks)
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from error.__cause__


def write_vtu(
    path: str | os.PathLike[str],
    points: ArrayLike,
    *,
    tets: ArrayLike | None = None,
    triangles: ArrayLike | None = None,
    lines: ArrayLike | None = None,
    point_data: Mapping[str, ArrayLike] | None = None,
    cell_data: Mapping[str, ArrayLike] | None = None,
) -> None:
    """Writes points [m], cells and data to a VTU file (binary, compressed), whole or not at all.

    An array of `point_data` has a row per node, one of `cell_data` a row per cell, in the order
    tets, triangles, lines.  Raises SceneError where the file cannot be written.
    """
    import meshio

    kinds = (("tetra", tets), ("triangle", triangles), ("line", lines))
    blocks = [(kind, np.asarray(rows)) for kind, rows in kinds if rows is not None]
    ends = np.cumsum([len(rows) for _, rows in blocks])[:-1]
    per_cell = {name: np.split(np.asarray(v), ends) for name, v in (cell_data or {}).items()}
    per_point = {name: np.asarray(v) for name, v in (point_data or {}).items()}
    mesh = meshio.Mesh(np.asarray(points), blocks, point_data=per_point, cell_data=per_cell)
    with written(Path(path)) as file:
        mesh.write(Path(file.name), file_format="vtu")  # it wants to open files itself


def _check_readable(path: Path) -> None:
    try:
        if path.is_dir():
            raise MeshError("this is a folder; name a mesh file")
        with path.open("rb") as file:
            if not file.read(1):
                raise MeshError("the file is empty")
    except FileNotFoundError:
        raise MeshError("there is no such file; check the path") from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        reason = getattr(error, "strerror", None) or error
        raise MeshError(f"the file cannot be read: {reason}") from None


def _content(path: Path) -> Content:
    """Points and cell blocks of a file, by its suffix and, for .msh, by its first words."""
    suffix = path.suffix.lower()
    if suffix in SURFACE_SUFFIXES:
        raise MeshError(f"{suffix} files hold a surface, no tets; {_REMEDY}")
    if suffix == ".msh":
        data = path.read_bytes()
        if data[:4] == b"$NOD" or re.match(
            rb"\s*\$(?:NOD|Comments|MeshFormat\s+[\d.]+\s+0\b)", data
        ):
            return read_gmsh_text(data)
    import meshio  # noqa: F401  (before memory is bounded)

    counts = vtk_counts(path) if suffix == ".vtk" else None
    with no_surprises(path):
        points, blocks = read_vtu(path) if suffix == ".vtu" else _by_meshio(path, suffix)
    if counts is not None:
        check_vtk(counts, blocks)
    return points, blocks


def _by_meshio(path: Path, suffix: str) -> Content:
    import meshio

    known = meshio.extension_to_filetypes
    endings = [s for s in known if path.name.lower().endswith(s)]
    if not endings:
        readable = " ".join(sorted(s for s in known if s not in SURFACE_SUFFIXES))
        raise MeshError(f"the suffix {suffix!r} is no mesh format; known are {readable}")
    (name, *_) = known[max(endings, key=len)]
    if suffix == ".msh":
        name = "gmsh" if b"$MeshFormat" in _head(path) else "ansys"
    if name == "tetgen":
        _check_tetgen(path)
    if name in _WAITING:
        with guarded(path, binary=_WAITING[name]) as file:
            mesh = meshio.read(file, file_format=name)
    else:
        mesh = meshio.read(path, file_format=name)
    _check_honest(path, len(mesh.points))
    if name == "dolfin-xml":
        _check_dolfin(path, mesh)
    points = np.asarray(mesh.points, dtype=np.float64)
    if points.ndim == 2 and points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    return points, [(block.type, np.asarray(block.data)) for block in mesh.cells]


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(200)


def _check_honest(path: Path, nodes: int) -> None:
    """Refuses more nodes than bytes: meshio allocates what a file announces before it looks."""
    companions = [path, path.with_suffix(".node"), path.with_suffix(".ele")]
    size = sum(p.stat().st_size for p in set(companions) if p.exists())
    if nodes > size and path.suffix.lower() not in (*_COMPRESSED, ".xdmf", ".xmf"):
        raise MeshError(f"it announces {nodes} nodes in {size} bytes; the file is damaged")


def _check_tetgen(path: Path) -> None:
    """meshio looks for the first row for ever where a file of the pair has none."""
    for part in (path.with_suffix(".node"), path.with_suffix(".ele")):
        if not part.exists():
            raise MeshError(
                f"TetGen meshes are pairs of files, and {part.name} is missing beside it"
            )
        with part.open("rb") as file:
            if not any(line.strip() and not line.lstrip().startswith(b"#") for line in file):
                raise MeshError(f"{part.name} holds no rows; the file is cut short")


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


def _mesh(path: Path, points: NDArray[np.float64], blocks: Blocks) -> TetMesh | SpringNet:
    blocks = [(kind, np.asarray(rows)) for kind, rows in blocks if len(rows)]
    solids = {kind for kind, _ in blocks if kind.startswith(_SOLIDS)}
    tets = [rows[:, :4] for kind, rows in blocks if kind.startswith("tetra")]
    if tets and not solids:
        return tet_mesh(points, np.concatenate(tets))
    lines = [rows[:, :2] for kind, rows in blocks if kind.startswith("line")]
    if lines and all(kind.startswith(("line", "vertex")) for kind, _ in blocks):
        return spring_net(points, np.concatenate(lines))
    held = Counter[str]()
    for kind, rows in blocks:
        held[kind] += len(rows)
    listed = ", ".join(f"{count} {kind}" for kind, count in held.items()) or "no cells at all"
    if solids:
        raise MeshError(
            f"it holds {listed}; only tets can be simulated: split the other cells in tets"
        )
    if held:
        raise MeshError(f"it holds {listed}, a surface and no tets; {_REMEDY}")
    raise MeshError(f"it holds {len(points)} nodes and no cells at all; a mesh of tets is needed")
