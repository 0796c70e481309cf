"""Which reader a mesh file needs: what it is shows in its first bytes, and in its suffix only where
they leave it open.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from tisoft import checks
from tisoft.errors import MeshError
from tisoft.geometry.checks import as_of
from tisoft.geometry.files.abaqus import read_abaqus
from tisoft.geometry.files.content import Content
from tisoft.geometry.files.foreign import read_foreign
from tisoft.geometry.files.gmsh import read_gmsh
from tisoft.geometry.files.medit import read_medit
from tisoft.geometry.files.mesh_of import REMEDY, mesh_of
from tisoft.geometry.files.nastran import read_nastran
from tisoft.geometry.files.tetgen import read_tetgen
from tisoft.geometry.files.text import BYTE_ORDER_MARK
from tisoft.geometry.files.vtk import read_vtk
from tisoft.geometry.files.vtu import read_vtu
from tisoft.geometry.mesh import Mesh

SURFACE_SUFFIXES = (".obj", ".off", ".ply", ".stl", ".svg", ".wkt", ".vtp")

_SIGNS: tuple[tuple[str, bytes], ...] = (
    ("vtk", rb"# vtk DataFile"),
    ("vtu", rb"(?s)\s*(?:<\?xml.*?\?>)?\s*(?:<!--.*?-->\s*)*<VTKFile\b"),
    ("gmsh", rb"(?s).*?^\s*\$(?:MeshFormat|NOD|NOE|Comments|PhysicalNames)\b"),
    ("abaqus", rb"\s*(?:\*\*[^\n]*\n\s*)*\*(?!KEYWORD)[A-Za-z]"),
    ("dolfin-xml", rb"(?s)\s*(?:<\?xml.*?\?>)?\s*<dolfin\b"),
    ("xdmf", rb"(?s)\s*(?:<\?xml.*?\?>)?\s*(?:<!DOCTYPE.*?>)?\s*<Xdmf\b"),
    ("medit", rb"\s*(?:#[^\n]*\n\s*)*MeshVersionFormatted\b"),
    ("netgen", rb"\s*mesh3d\b"),
    ("su2", rb"\s*(?:%[^\n]*\n\s*)*NDIME\s*="),
    ("mdpa", rb"\s*(?://[^\n]*\n\s*)*Begin\s+(?:ModelPartData|Properties|Nodes)\b"),
    ("nastran", rb"(?s).*?^(?:BEGIN\s+BULK|GRID\*?[ ,]|CEND\b|CTETRA\*?[ ,])"),
)  # fmt: skip
"""Formats by the words with which their files begin."""
_OTHERS: tuple[tuple[str, bytes], ...] = (
    ("a surface (PLY)", rb"ply\s"),
    ("a surface (OFF)", rb"\s*(?:#[^\n]*\n)*[CN4]?OFF\s"),
    ("a surface (STL)", rb"\s*solid\b[^\n]*\n\s*facet\b"),
    ("a CAD model (STEP)", rb"\s*ISO-10303-21"),
    ("a CAD model (IGES)", rb".{72}S\s*1\s*\n"),
    ("a CAD model (BREP)", rb"\s*(?:DBRep_DrawableShape|CASCADE Topology)"),
    ("a Gmsh geometry (.geo)", rb"(?s).*?^\s*(?:SetFactory|Point\s*\(\s*\d+\s*\)\s*=)"),
)
_UNREAD: tuple[tuple[str, bytes], ...] = (
    ("an LS-DYNA model", rb"(?:\$[^\n]*\n)*\*KEYWORD\b"),
    ("an MFEM mesh", rb"MFEM (?:NC )?mesh"),
    ("an I-DEAS universal file", rb"\s{0,4}-1\s*\n\s*\d+\s*\n"),
    ("an OpenFOAM file", rb"(?s)\s*/\*-.*?FoamFile"),
    ("a COMSOL mesh", rb"# (?:Created by|Major) .*(?:COMSOL|version)"),
)
_SUFFIXES = {".vtk": "vtk", ".vtu": "vtu"}
_FAULTS = (ValueError, TypeError, IndexError, KeyError, OverflowError, AttributeError, MemoryError,
           RecursionError)  # fmt: skip


def read_mesh(path: str | os.PathLike[str]) -> Mesh:
    """The mesh of a file: tets, hexahedra, or springs where the file holds lines alone.

    Reads Gmsh 1 to 4.1, VTK legacy and XML, Abaqus, TetGen, and every other tetrahedral format of
    meshio, whatever the suffix.  All blocks, parts and pieces become one mesh; hexahedra and
    10-node tets are read as they are, wedges and pyramids cut in tets, of other curved cells the
    corners are used, unused nodes are dropped and wrongly oriented cells turned round, all told by
    the mesh; names and numbers of parts of it become regions and sets.  Raises MeshError, one
    sentence that names the file, for whatever cannot be simulated.
    """
    with as_of(""):
        path = checks.path("path", path, "a mesh file")
    try:
        _check_readable(path)
        return mesh_of(_content(path))
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from error.__cause__


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
    name = _format(path)
    try:
        if name == "gmsh":
            return read_gmsh(_data(path))
        if name == "vtk":
            return read_vtk(_data(path))
        if name == "vtu":
            return read_vtu(_data(path))
        if name == "abaqus":
            return read_abaqus(path)
        if name == "tetgen":
            return read_tetgen(path)
        if name == "medit" and b"MeshVersionFormatted" in _head(path):
            return read_medit(_data(path))
        if name == "nastran":
            return read_nastran(_data(path))
    except OSError as error:
        raise MeshError(f"the file cannot be read: {error.strerror}") from None
    except _FAULTS as error:  # a number or word in a place that no file of this format has it in
        told = re.sub(r"\s+", " ", str(error))[:120] or type(error).__name__
        raise MeshError(f"the file is damaged: {told}") from error
    return read_foreign(path, name)


def _format(path: Path) -> str:
    """The format's name: of the first bytes, else of the suffix."""
    head = _head(path)
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise MeshError("it is text in UTF-16; save it as UTF-8")
    if b"\r" in head.rstrip() and b"\n" not in head and head.isascii():
        raise MeshError("its lines end with CR alone; save it with LF or CR LF")
    for name, words in _SIGNS:
        if re.compile(words, re.MULTILINE | re.IGNORECASE).match(head):
            return name
    for what, words in _OTHERS:
        if re.compile(words, re.MULTILINE).match(head):
            raise MeshError(f"it holds {what}, no tets; {REMEDY}")
    for what, words in _UNREAD:
        if re.compile(words, re.MULTILINE).match(head):
            raise MeshError(f"it is {what}, which is not read; save it as Gmsh, VTU or Abaqus file")
    suffix = path.suffix.lower()
    if suffix in SURFACE_SUFFIXES:
        raise MeshError(f"{suffix} files hold a surface, no tets; {REMEDY}")
    if suffix in (".poly", ".smesh"):
        raise MeshError(f"{suffix} files are what TetGen starts from; name the .ele it made")
    if suffix in (".node", ".ele", ".face"):
        return "tetgen"
    if suffix in _SUFFIXES:
        raise MeshError(f"this is no {_SUFFIXES[suffix].upper()} file, or its beginning is missing")
    return _meshio_format(path, head)


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(4096).removeprefix(BYTE_ORDER_MARK)


def _data(path: Path) -> bytes:
    return path.read_bytes().removeprefix(BYTE_ORDER_MARK)


def _meshio_format(path: Path, head: bytes) -> str:
    import meshio

    known = meshio.extension_to_filetypes
    endings = [s for s in known if path.name.lower().endswith(s)]
    if not endings and head.startswith((b"\x1f\x8b", b"PK\3\4", b"BZh", b"\xfd7zXZ")):
        raise MeshError("it is compressed as a whole; unpack it first")
    if not endings:
        readable = " ".join(sorted(s for s in known if s not in SURFACE_SUFFIXES))
        raise MeshError(
            f"the suffix {path.suffix!r} is no mesh format, and its content none that is known; "
            f"known are {readable}"
        )
    (name, *_) = known[max(endings, key=len)]
    if name == "abaqus":  # the suffix .inp is AVS's too
        if not re.match(rb"\s*(?:#[^\n]*\n\s*)*\d+\s+\d+\s+\d+\s+\d+\s+\d+\s", head):
            raise MeshError(
                "it begins neither as an Abaqus nor as an AVS file; it may be cut short"
            )
        return "avsucd"
    if path.suffix.lower() == ".msh":
        if not head.lstrip().startswith(b"("):
            raise MeshError("it begins neither as a Gmsh nor as an Ansys file; it may be cut short")
        return "ansys"
    return str(name)
