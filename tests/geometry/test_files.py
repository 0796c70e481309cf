"""Mesh files: every format, untidy files, and one sentence for every bad one."""

import contextlib
import io
import tracemalloc
import warnings

import hypothesis
import meshio
import numpy as np
import pytest
from hypothesis import strategies as st

from tisoft.errors import MeshError, SceneError
from tisoft.geometry.files import read_mesh, write_vtu
from tisoft.geometry.mesh import SpringNet
from tisoft.geometry.shapes import box

BRICK = box((1.0, 1.0, 0.5), (2, 2, 1))

FORMATS = {
    "a.avs": {},
    "b.bdf": {},
    "c.tec": {},
    "d.f3grid": {},
    "e.inp": {},
    "f.mdpa": {},
    "g.mesh": {},
    "h.meshb": {},
    "i.msh": {"file_format": "ansys", "binary": False},
    "j.msh": {"file_format": "gmsh22", "binary": False},
    "k.msh": {"file_format": "gmsh22"},
    "l.msh": {"file_format": "gmsh"},
    "m.msh": {"file_format": "gmsh", "binary": False},
    "n.post": {},
    "o.su2": {},
    "p.ele": {},
    "q.lb8.ugrid": {},
    "r.vol": {},
    "s.vtk": {},
    "t.vtk": {"file_format": "vtk42", "binary": False},
    "u.vtu": {},
    "v.vtu": {"binary": False},
    "w.xml": {},
    "x.vol.gz": {},
}

GMSH_1 = """$NOD
5
10 0 0 0
20 1 0 0
30 0 1 0
40 0 0 1
99 5 5 5
$ENDNOD
$ELM
2
1 2 1 1 3 10 20 30
2 4 1 1 4 10 30 20 40
$ENDELM
"""
GMSH_2 = """$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
4
1 0 0 0
2 1 0 0
3 0 1 0
4 0 0 1
$EndNodes
$Elements
2
1 15 2 0 1 1
2 4 2 0 1 1 2 3 4
$EndElements
"""
GMSH_41 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$Nodes
1 4 1 1000000000
3 1 0 4
1
2
3
1000000000
0 0 0
1 0 0
0 1 0
0 0 1
$EndNodes
$Elements
1 1 1 1
3 1 4 1
1 1 2 3 1000000000
$EndElements
"""
GMSH_40 = """$MeshFormat
4.0 0 8
$EndMeshFormat
$Nodes
1 4
1 3 0 4
1 0 0 0
2 1 0 0
3 0 1 0
4 0 0 1
$EndNodes
$Elements
1 1
1 3 4 1
1 1 2 3 4
$EndElements
"""
VTK = """# vtk DataFile Version 3.0
a tet
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 4 double
0 0 0 1 0 0 0 1 0 0 0 1
CELLS 1 5
4 0 1 2 3
CELL_TYPES 1
10
"""
VTU_PIECE = """<Piece NumberOfPoints="4" NumberOfCells="1"><Points>
<DataArray type="Float64" NumberOfComponents="3" format="ascii">{points}</DataArray></Points><Cells>
<DataArray type="Int32" Name="connectivity" format="ascii">0 1 2 3</DataArray>
<DataArray type="Int32" Name="offsets" format="ascii">4</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">10</DataArray></Cells></Piece>
"""
VTU = (
    '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian">'
    "<UnstructuredGrid>"
    + VTU_PIECE.format(points="0 0 0 1 0 0 0 1 0 0 0 1")
    + VTU_PIECE.format(points="5 0 0 6 0 0 5 1 0 5 0 1")
    + "</UnstructuredGrid></VTKFile>"
)


def written(folder, name, cells=None, points=BRICK.points):
    """A file written by meshio, silently."""
    mesh = meshio.Mesh(points, cells or [("tetra", BRICK.tets)])
    with warnings.catch_warnings(), contextlib.redirect_stderr(io.StringIO()):
        warnings.simplefilter("ignore")
        meshio.write(folder / name, mesh, **FORMATS.get(name, {}))
    return folder / name


def text(folder, name, content):
    path = folder / name
    path.write_text(content, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_mesh_back(tmp_path, name):
    mesh = read_mesh(written(tmp_path, name))
    assert mesh.points == pytest.approx(BRICK.points, abs=1e-6)
    assert np.array_equal(np.sort(mesh.tets), np.sort(BRICK.tets))


@pytest.mark.parametrize("content", [GMSH_1, GMSH_2, GMSH_40, GMSH_41])
def test_gmsh_text_of_every_version(tmp_path, content):
    mesh = read_mesh(text(tmp_path, "a.msh", content))
    assert mesh.volumes.sum() == pytest.approx(1.0 / 6.0)
    assert mesh.points.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]


def test_gmsh_1_drops_unused_nodes_and_turns_tets(tmp_path):
    mesh = read_mesh(text(tmp_path, "a.msh", GMSH_1))
    assert (mesh.flipped, mesh.dropped_nodes) == (1, 1)


def test_all_pieces_of_a_vtu_file_are_read(tmp_path):
    mesh = read_mesh(text(tmp_path, "a.vtu", VTU))
    assert len(mesh.tets) == 2
    assert mesh.pieces == 2
    assert mesh.points[:, 0].max() == 6.0


def test_cells_beside_tets_are_ignored_and_blocks_merged(tmp_path):
    half = len(BRICK.tets) // 2
    cells = [
        ("triangle", BRICK.surface),
        ("tetra", BRICK.tets[:half]),
        ("line", BRICK.edges),
        ("vertex", np.array([[0]])),
        ("tetra", BRICK.tets[half:]),
    ]
    assert np.array_equal(read_mesh(written(tmp_path, "a.vtu", cells)).tets, BRICK.tets)


def test_quadratic_tets_are_read_as_they_are(tmp_path):
    corners = BRICK.points[BRICK.tets[0]]
    middles = [
        (corners[a] + corners[b]) / 2 for a, b in ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
    ]
    points = np.concatenate([corners, middles])
    mesh = read_mesh(written(tmp_path, "a.vtu", [("tetra10", np.arange(10)[None])], points))
    assert len(mesh.points) == 10
    assert np.array_equal(mesh.quadratic_tets, np.arange(10)[None])


def test_a_file_of_lines_is_a_net_of_springs(tmp_path):
    net = read_mesh(written(tmp_path, "a.vtk", [("line", BRICK.edges)]))
    assert isinstance(net, SpringNet)
    assert np.array_equal(net.edges, BRICK.edges)


def surface(folder):
    return written(folder, "a.vtu", [("triangle", BRICK.surface)])


def polyhedra(folder):
    return text(folder, "a.vtk", VTK.replace("\n10\n", "\n42\n"))


def nan_node(folder):
    points = BRICK.points.copy()
    points[2, 1] = np.nan
    return written(folder, "a.vtu", None, points)


def far_index(folder):
    return written(folder, "a.vtk", [("tetra", np.array([[0, 1, 3, 99]]))])


def unreadable(folder):
    return folder / ("x" * 300 + ".vtu")


BAD = {
    "missing": (lambda d: d / "a.vtu", "no such file"),
    "folder": (lambda d: d, "a folder"),
    "name too long": (unreadable, "cannot be read"),
    "empty": (lambda d: text(d, "a.vtk", ""), "is empty"),
    "suffix": (lambda d: text(d, "a.step", "x"), "suffix '.step' is no mesh format"),
    "surface": (surface, "triangles, a surface and no tets; tetrahedralise"),
    "stl": (lambda d: text(d, "a.stl", "solid"), "hold a surface"),
    "polyhedra": (polyhedra, "1 polyhedron; tets, hexahedra, wedges and pyramids are read"),
    "polydata": (
        lambda d: text(d, "a.vtk", VTK.replace("UNSTRUCTURED_GRID", "POLYDATA")),
        "a surface \\(POLYDATA\\)",
    ),
    "voxels": (
        lambda d: text(d, "a.vtk", VTK.replace("UNSTRUCTURED_GRID", "STRUCTURED_POINTS")),
        "holds a STRUCTURED_POINTS",
    ),
    "nan": (nan_node, "node 2 .* must be finite"),
    "index": (far_index, "uses node 99"),
    "fewer cells": (
        lambda d: text(d, "a.vtk", VTK.replace("CELL_TYPES 1", "CELL_TYPES 0")),
        "CELL_TYPES announces 0 numbers, but 1 follow",
    ),
    "huge vtk": (
        lambda d: text(d, "a.vtk", VTK.replace("POINTS 4", "POINTS 999999999")),
        "announces",
    ),
    "vtk words": (lambda d: text(d, "a.vtk", VTK.replace("1 0 0", "1 x 0")), "POINTS holds 'x'"),
    "vtu counts": (
        lambda d: text(d, "a.vtu", VTU.replace('NumberOfCells="1"', 'NumberOfCells="7"')),
        "damaged",
    ),
    "vtu offsets": (lambda d: text(d, "a.vtu", VTU.replace(">4<", ">3<")), "offsets end at 3"),
    "vtu cut short": (lambda d: text(d, "a.vtu", VTU[:300]), "damaged"),
    "gmsh element left out": (
        lambda d: text(d, "a.msh", GMSH_2.replace("$Elements\n2", "$Elements\n3")),
        "announces 3 entries, but holds 2",
    ),
    "gmsh element too many": (
        lambda d: text(d, "a.msh", GMSH_2.replace("$Elements\n2", "$Elements\n1")),
        "holds 9 numbers more than it announces",
    ),
    "gmsh node left out": (
        lambda d: text(d, "a.msh", GMSH_41.replace("1 0 0\n", "")),
        "announces 4 further rows",
    ),
    "gmsh node twice": (lambda d: text(d, "a.msh", GMSH_2.replace("2 1 0 0", "1 1 0 0")), "twice"),
    "gmsh node unknown": (
        lambda d: text(d, "a.msh", GMSH_2.replace("1 1 2 3 4", "1 1 2 3 7")),
        "uses node 7, which",
    ),
    "gmsh huge": (
        lambda d: text(d, "a.msh", GMSH_2.replace("$Nodes\n4", "$Nodes\n4000000000000")),
        "announces 4000000000000",
    ),
    "gmsh 1 cut short": (lambda d: text(d, "a.msh", GMSH_1[:90]), "cut short"),
    "gmsh 1 without elements": (lambda d: text(d, "a.msh", GMSH_1.split("$ELM")[0]), "no \\$ELM"),
    "gmsh 9": (lambda d: text(d, "a.msh", GMSH_2.replace("2.2 0", "9.2 0")), "version '9.2'"),
    "twice the same tet": (
        lambda d: written(d, "a.vtu", [("tetra", np.repeat(BRICK.tets[:1], 2, axis=0))]),
        "tet 1 .* given twice",
    ),
    "flat": (
        lambda d: written(d, "a.vtu", [("tetra", np.array([[0, 1, 2, 3]]))]),
        "tet 0 .* degenerate",
    ),
    "nastran without cards": (lambda d: text(d, "a.bdf", "BEGIN BULK\n"), "no cells at all"),
    "endless mdpa": (lambda d: text(d, "a.mdpa", "Begin Nodes\n 1 0 0 0\n"), "ends too early"),
    "tetgen alone": (lambda d: text(d, "a.ele", "1 4 0\n1 1 2 3 4\n"), "a.node is missing"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_files_are_told_in_one_sentence_that_names_the_file(tmp_path, name, capfd):
    make, words = BAD[name]
    path = make(tmp_path)
    with pytest.raises(MeshError, match=words) as caught:
        read_mesh(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["huge vtk", "gmsh huge", "vtu counts"])
def test_announced_counts_do_not_fill_the_memory(tmp_path, name):
    path = BAD[name][0](tmp_path)
    tracemalloc.start()
    with pytest.raises(MeshError):
        read_mesh(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2_000_000


def test_missing_packages_are_named_with_their_remedy(tmp_path, monkeypatch):
    def no_package(path, file_format):
        raise ModuleNotFoundError("No module named 'h5py'", name="h5py")

    monkeypatch.setattr(meshio, "read", no_package)
    with pytest.raises(MeshError, match="pip install h5py"):
        read_mesh(text(tmp_path, "a.med", "x"))


def test_written_files_come_back_with_their_data(tmp_path):
    path = tmp_path / "out.vtu"
    speed, stress = np.arange(len(BRICK.points), dtype=np.float32), np.ones(len(BRICK.tets))
    write_vtu(
        path, BRICK.points, tets=BRICK.tets, point_data={"speed": speed}, cell_data={"s": stress}
    )
    back = meshio.read(path)
    assert np.array_equal(back.point_data["speed"], speed)
    assert np.array_equal(back.cell_data["s"][0], stress)
    assert [p.name for p in tmp_path.iterdir()] == ["out.vtu"]


def test_writing_is_whole_or_not_at_all(tmp_path, monkeypatch):
    path = text(tmp_path, "out.vtu", "before")

    def full(self, part, **options):
        part.write_text("half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(meshio.Mesh, "write", full)
    with pytest.raises(SceneError, match="the disk is full"):
        write_vtu(path, BRICK.points, tets=BRICK.tets)
    assert path.read_text() == "before"
    assert len(list(tmp_path.iterdir())) == 1


def test_writing_into_a_missing_folder_is_told(tmp_path):
    with pytest.raises(SceneError, match="cannot be written"):
        write_vtu(tmp_path / "none" / "out.vtu", BRICK.points, lines=BRICK.edges)


def damage(data, cut, changes):
    data = bytearray(data[: max(1, int(cut * len(data)))])
    for place, value in changes:
        data[int(place * (len(data) - 1))] = value
    return bytes(data)


def read_damaged(folder, name, cut, changes):
    """Reads a damaged file: a mesh or a MeshError, nothing else may come out."""
    path = folder / f"damaged{name}"
    path.write_bytes(damage((folder / name).read_bytes(), cut, changes))
    with contextlib.suppress(MeshError):
        read_mesh(path)


PLACES = st.floats(0.0, 1.0)
DAMAGE = st.lists(st.tuples(PLACES, st.integers(0, 255)), max_size=4)
CUTS = st.one_of(st.just(1.0), PLACES)


@pytest.fixture(scope="module")
def whole_files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("meshes")
    for name in FORMATS:
        written(folder, name)
    text(folder, "y.msh", GMSH_1)
    return folder


@hypothesis.given(st.sampled_from([*FORMATS, "y.msh"]), CUTS, DAMAGE)
@hypothesis.settings(max_examples=60, deadline=None, derandomize=True, database=None)
def test_damaged_files_give_a_mesh_or_a_sentence(whole_files, name, cut, changes):
    read_damaged(whole_files, name, cut, changes)


@pytest.mark.slow
@hypothesis.given(st.sampled_from([*FORMATS, "y.msh"]), CUTS, DAMAGE)
@hypothesis.settings(max_examples=3000, deadline=None, database=None)
def test_many_damaged_files_give_a_mesh_or_a_sentence(whole_files, name, cut, changes):
    read_damaged(whole_files, name, cut, changes)
