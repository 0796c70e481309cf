"""Valid files as programs of the field write them: all of it is read, or refused by its name."""

import base64
import zlib

import meshio
import numpy as np
import pytest
from mesh_texts import (
    BRICK,
    CUBE,
    inp_assembly,
    inp_nodes,
    inp_part,
    inp_tets,
    second_order,
    tetgen,
)

from tisoft.errors import MeshError
from tisoft.geometry.files import read_mesh, write_vtu
from tisoft.geometry.shapes import box

TWO_PARTS = inp_part("cube", CUBE) + inp_part("brick", BRICK)


def text(folder, name, content):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def is_cube(mesh):
    """A cube of 0.1 m in 5 tets."""
    assert len(mesh.points) == 8
    assert len(mesh.tets) == 5
    assert mesh.volumes.sum() == pytest.approx(1e-3, rel=1e-12)


def is_pair(mesh):
    """The cube, and the brick from x = 0.15 on."""
    assert (len(mesh.points), len(mesh.tets), mesh.pieces) == (16, 11, 2)
    assert mesh.volumes.sum() == pytest.approx(3e-3, rel=1e-12)
    assert np.ptp(mesh.points, axis=0) == pytest.approx([0.35, 0.1, 0.1])
    xs = mesh.points[:, 0]
    assert np.unique(xs.round(12)) == pytest.approx([0.0, 0.1, 0.15, 0.35])


def test_parts_of_an_assembly_are_placed_each_with_its_own_numbers(tmp_path):
    placed = inp_assembly(("c", "cube", ""), ("b", "BRICK", " .15, 0., 0.\n"))
    is_pair(
        read_mesh(text(tmp_path, "a.inp", "*Heading\n title, with commas\n" + TWO_PARTS + placed))
    )


def test_nodes_may_come_in_several_blocks_and_between_elements(tmp_path):
    moved = BRICK.points + np.array([0.15, 0.0, 0.0])
    content = (
        f"*NODE\n{inp_nodes(CUBE.points)}*ELEMENT, TYPE=C3D4, ELSET=one\n{inp_tets(CUBE.tets)}"
        f"** a comment\n*Node, nset=all\n{inp_nodes(moved, 9)}"
        f"*Element, elset=two, type=c3d4\n{inp_tets(BRICK.tets, 9, 6)}"
        "*Node, nset=pull\n17, .5, 0., 0.\n"
    )
    mesh = read_mesh(text(tmp_path, "a.inp", content))
    is_pair(mesh)
    assert mesh.dropped_nodes == 1
    assert [(region.name, len(region.tets)) for region in mesh.regions] == [("one", 5), ("two", 6)]


def test_an_instance_is_moved_then_turned(tmp_path):
    turned = " 0., 5., 0.\n 0., 5., 0., 0., 5., 1., 90.\n"
    content = inp_part("cube", CUBE) + inp_assembly(("c", "cube", turned))
    mesh = read_mesh(text(tmp_path, "a.inp", content))
    assert mesh.points.min(axis=0) == pytest.approx([-0.1, 5.0, 0.0])
    assert mesh.points.max(axis=0) == pytest.approx([0.0, 5.1, 0.1])


def test_a_part_may_be_placed_twice_and_one_not_at_all(tmp_path):
    placed = inp_assembly(("a", "cube", ""), ("b", "cube", "1, 0, 0\n"))
    mesh = read_mesh(text(tmp_path, "a.inp", TWO_PARTS + placed))
    assert (len(mesh.tets), mesh.pieces) == (10, 2)
    assert mesh.warnings == ('the file: part "brick" has no instance and is left out',)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("*Node, system=C\n1, 1, 0, 0\n", "SYSTEM=C"),
        ("*Node\n1,0,0,0\n*Ngen\n1, 5, 1\n", r"\*NGEN makes or places nodes"),
        ("*Instance, name=a, library=old\n", "instance 'a' is of a library"),
        (
            "*Part, name=b\n*End Part\n*Instance, name=a, part=c\n",
            "part 'c', which the file does not",
        ),
        (
            "*Node\n1,0,0,0\n1,1,0,0\n*Element, type=C3D4\n1, 1,2,3,4\n",
            "given twice, in two places",
        ),
        ("*Node\n1,0,0,0\n*Element, type=C3D4\n1, 1,2,3\n", "no rows of 5"),
        (
            "*Node\n1,0,0,0\n*Element, type=C3D4\n1, 1,2,3,4\n",
            "uses node 2, which the file does not",
        ),
        ("*Include, input=none.inp\n", "includes none.inp, which cannot be read"),
        ("*Node\n1, 0, 0, 0\n2, 1, 0, 0\n*Element, type=B31\n1, 1, 2\n", "1 elements of type B31"),
    ],
)
def test_what_an_abaqus_file_holds_beyond_that_is_named(tmp_path, content, words):
    with pytest.raises(MeshError, match=words):
        read_mesh(text(tmp_path, "a.inp", content))


def test_constraints_of_a_file_are_told_for_they_change_the_body(tmp_path):
    content = TWO_PARTS + "*Tie, name=t\n a, b\n*Step\n*Boundary\n base, 1, 3\n"
    mesh = read_mesh(text(tmp_path, "a.inp", content))
    assert any("*TIE (1 of them) is not taken over" in told for told in mesh.warnings)
    assert any("*BOUNDARY" in told for told in mesh.warnings)


@pytest.mark.parametrize("name", ["a.vtu", "a.vtk", "a.xml", "a.inp", "a.msh", "a.mesh", "a"])
def test_the_first_bytes_tell_the_format_and_not_the_suffix(tmp_path, name):
    write_vtu(tmp_path / "cube.vtu", CUBE.points, tets=CUBE.tets)
    is_cube(read_mesh(text(tmp_path, name, (tmp_path / "cube.vtu").read_bytes())))


def test_legacy_vtk_and_gmsh_may_have_each_others_suffix(tmp_path):
    cube = meshio.Mesh(CUBE.points, [("tetra", CUBE.tets)])
    cube.write(tmp_path / "c.vtk")
    is_cube(read_mesh((tmp_path / "c.vtk").rename(tmp_path / "c.msh")))
    cube.write(tmp_path / "d.msh", file_format="gmsh", binary=False)
    is_cube(read_mesh((tmp_path / "d.msh").rename(tmp_path / "d.vtk")))


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"ele_head": "1", "more": "1.5"},
        {"ele_head": "2", "more": "-2 7"},
        {"node_head": "1 1", "nodes": "3.25 -1"},
        {"node_head": "0 1", "nodes": "2 # a comment"},
        {"ele_head": ""},
    ],
)
def test_tetgens_optional_columns_are_passed_over(tmp_path, first, options):
    path = tetgen(tmp_path, "cube.1", CUBE.points, CUBE.tets, first=first, **options)
    is_cube(read_mesh(path))
    is_cube(read_mesh(path.with_suffix(".node")))


def test_tetgens_attributes_are_regions(tmp_path):
    path = tetgen(tmp_path, "c", CUBE.points, CUBE.tets, ele_head="1", more="1.5")
    path.write_text(path.read_text().replace("1.5", "-2", 2))
    regions = [(region.name, region.tag, len(region.tets)) for region in read_mesh(path).regions]
    assert regions == [("-2", -2, 2), ("1.5", None, 3)]


def test_tetgen_files_that_contradict_themselves_are_told_where(tmp_path):
    path = tetgen(tmp_path, "c", CUBE.points, CUBE.tets)
    path.write_text(path.read_text().replace("5 4", "6 4", 1))
    with pytest.raises(MeshError, match=r"c\.ele announces 6 rows"):
        read_mesh(path)


def enclosed(mesh):
    """Volume inside the boundary, by the flux of x through faces as they are curved."""
    rows, numbers = mesh.boundary.pressed(np.arange(len(mesh.boundary.triangles)))
    i, j, k = (mesh.points[column] for column in rows.T)
    return np.einsum("r,ri,ri->", numbers, i, np.cross(j - i, k - i)) / 3.0


def test_second_order_tets_are_read_as_they_are_however_their_nodes_are_numbered(tmp_path):
    points, tets = second_order(CUBE)
    bent = points.copy()
    bent[8:] += 0.004 * np.random.default_rng(2).uniform(-1, 1, (len(points) - 8, 3))
    # Four points take the volume of a curved tet to a few parts in a million.
    cases = ((points, [*range(10)], 1e-12), (bent, [0, 1, 2, 3, 8, 5, 9, 4, 7, 6], 1e-5))
    for places, order, digits in cases:
        mesh = read_mesh(tetgen(tmp_path, "c", places, tets[:, order]))
        assert list(mesh.cells) == ["tet10"]
        assert mesh.warnings == ()
        assert np.array_equal(mesh.points, places)
        assert enclosed(mesh) == pytest.approx(mesh.volumes.sum(), rel=digits)


def test_mixed_orders_are_read_by_their_corners_and_told(tmp_path):
    points, tets = second_order(CUBE)
    cells = [("tetra10", tets[:2]), ("tetra", tets[2:, :4])]
    meshio.Mesh(points, cells).write(tmp_path / "a.vtu")
    mesh = read_mesh(tmp_path / "a.vtu")
    is_cube(mesh)
    (told,) = mesh.warnings
    assert told.startswith("2 10-node tets are read by their corners")


LZ4 = "vtkLZ4DataCompressor"
VOXELS = """# vtk DataFile Version 3.0
voxels
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 12 float
{points}
CELLS 2 18
8 0 1 3 4 6 7 9 10
8 1 2 4 5 7 8 10 11
CELL_TYPES 2
11 11
"""


def test_voxels_are_hexahedra(tmp_path):
    grid = [f"{x / 10} {y / 10} {z / 10}" for z in range(2) for y in range(2) for x in range(3)]
    mesh = read_mesh(text(tmp_path, "a.vtk", VOXELS.format(points="\n".join(grid))))
    assert mesh.volumes.sum() == pytest.approx(2e-3, rel=1e-12)
    assert mesh.warnings == ()
    assert (len(mesh.hexes), len(mesh.surface), mesh.flipped) == (2, 2 * 10, 0)
    assert enclosed(mesh) == pytest.approx(2e-3, rel=1e-12)


def test_solids_of_all_kinds_are_cut_so_that_neighbours_agree(tmp_path):
    """A hexahedron, two wedges on it, six pyramids on those: no face is left open inside, and a
    side of the hexahedron meets two of the tets."""
    corner = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    points = np.concatenate([corner + np.array([0, 0, z]) for z in range(4)] + [[[0.5, 0.5, 2.5]]])
    hexahedra = np.array([[0, 1, 2, 3, 4, 5, 6, 7]])
    wedges = np.array([[4, 5, 8, 7, 6, 11], [5, 9, 8, 6, 10, 11]])
    faces = [
        [8, 11, 10, 9],
        [12, 13, 14, 15],
        [8, 9, 13, 12],
        [9, 10, 14, 13],
        [10, 11, 15, 14],
        [11, 8, 12, 15],
    ]
    pyramids = np.array([[*face[::-1], 16] for face in faces])
    cells = [("hexahedron", hexahedra), ("wedge", wedges), ("pyramid", pyramids)]
    for seed in range(5):  # whatever the numbers of the nodes
        new = np.random.default_rng(seed).permutation(len(points))
        shuffled = np.empty_like(points)
        shuffled[new] = points
        meshio.Mesh(shuffled, [(kind, new[rows]) for kind, rows in cells]).write(tmp_path / "a.vtu")
        mesh = read_mesh(tmp_path / "a.vtu")
        assert mesh.volumes.sum() == pytest.approx(3.0)
        assert (len(mesh.hexes), len(mesh.tets)) == (1, 2 * 3 + 6 * 2)
        assert len(mesh.surface) == 2 * (4 * 3 + 2)
        assert mesh.boundary.halves == mesh.pieces == 1
        assert enclosed(mesh) == pytest.approx(3.0)
        (told,) = mesh.warnings
        assert told.startswith("2 wedges, 6 pyramids are cut in tets")


def test_what_does_not_meet_or_is_folded_is_told(tmp_path):
    corner = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    points = np.concatenate([corner, corner + np.array([0, 0, 1]), [[0.5, 0.5, 2]]])
    cells = [("hexahedron", [[*range(8)]]), ("tetra", [[4, 5, 6, 8]])]
    meshio.Mesh(points, cells).write(tmp_path / "a.vtu")
    (told,) = read_mesh(tmp_path / "a.vtu").warnings
    assert "share nodes but no faces" in told
    in_rows = [[0, 1, 3, 2, 4, 5, 7, 6]]
    meshio.Mesh(points, [("hexahedron", in_rows)]).write(tmp_path / "a.vtu")
    with pytest.raises(MeshError, match=r"hex 0 \(counted from 0\) is folded.*row by row"):
        read_mesh(tmp_path / "a.vtu")
    places, tets = second_order(CUBE)
    places[tets[0, 4:7]] += 0.5 * (places[tets[0, 3]] - places[tets[0, 4:7]])
    meshio.Mesh(places, [("tetra10", tets)]).write(tmp_path / "a.vtu")
    with pytest.raises(MeshError, match="Jacobian is not positive at"):
        read_mesh(tmp_path / "a.vtu")


def test_a_wedge_written_as_hexahedron_keeps_its_volume(tmp_path):
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]]
    meshio.Mesh(points, [("hexahedron", [[0, 1, 2, 2, 3, 4, 5, 5]])]).write(tmp_path / "a.vtu")
    mesh = read_mesh(tmp_path / "a.vtu")
    assert (len(mesh.tets), mesh.volumes.sum()) == (3, pytest.approx(0.5))


def data_array(name, values, *, size=4, compressed=False, apart=False, components=1):
    """A DataArray in base64: one stream, or head and data apart, or compressed blocks."""
    head = f"<u{size}"
    data = values.tobytes()
    if compressed:
        blocks = [data[k : k + 64] for k in range(0, len(data), 64)]
        packed = [zlib.compress(block) for block in blocks]
        sizes = [len(blocks), 64, len(data) % 64, *map(len, packed)]
        coded = base64.b64encode(np.array(sizes, head).tobytes()) + base64.b64encode(
            b"".join(packed)
        )
    elif apart:
        coded = base64.b64encode(np.array([len(data)], head).tobytes()) + base64.b64encode(data)
    else:
        coded = base64.b64encode(np.array([len(data)], head).tobytes() + data)
    kind = {"f": "Float", "i": "Int", "u": "UInt"}[values.dtype.kind] + str(8 * values.itemsize)
    return (
        f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" format="binary">'
        f"{coded.decode()}</DataArray>"
    )


def vtu(arrays, *, size=4, compressed=False, extra=""):
    more = ' compressor="vtkZLibDataCompressor"' if compressed else ""
    points, *cells = arrays
    return (
        f'<?xml version="1.0"?><VTKFile type="UnstructuredGrid" byte_order="LittleEndian" '
        f'header_type="UInt{8 * size}"{more}><UnstructuredGrid>'
        f'<Piece NumberOfPoints="8" NumberOfCells="5"><Points>{points}</Points>'
        f"<Cells>{''.join(cells)}"
        f"</Cells>{extra}</Piece></UnstructuredGrid></VTKFile>"
    )


def cube_arrays(**options):
    return [
        data_array("Points", CUBE.points, components=3, **options),
        data_array("connectivity", CUBE.tets.astype(np.int64).ravel(), **options),
        data_array("offsets", np.arange(4, 24, 4, dtype=np.int32), **options),
        data_array("types", np.full(5, 10, np.uint8), **options),
    ]


@pytest.mark.parametrize("size", [4, 8])
@pytest.mark.parametrize("options", [{}, {"apart": True}, {"compressed": True}])
def test_vtu_data_in_base64_of_every_sort(tmp_path, size, options):
    content = vtu(cube_arrays(size=size, **options), size=size, compressed="compressed" in options)
    is_cube(read_mesh(text(tmp_path, "a.vtu", content)))


def test_a_region_of_several_pieces_is_one(tmp_path):
    numbers = data_array("material", np.array([1, 1, 2, 2, 2]))
    content = vtu(cube_arrays(), extra=f"<CellData>{numbers}</CellData>")
    piece = content[content.index("<Piece") : content.index("</UnstructuredGrid>")]
    mesh = read_mesh(text(tmp_path, "a.vtu", content.replace(piece, 2 * piece)))
    assert [(r.name, r.tag, r.tets.tolist()) for r in mesh.regions] == [
        ("1", 1, [0, 1, 5, 6]), ("2", 2, [2, 3, 4, 7, 8, 9])]  # fmt: skip


@pytest.mark.parametrize("order", ["<", ">"])
def test_raw_appended_data_need_not_be_xml(tmp_path, order):
    arrays = [
        CUBE.points,
        CUBE.tets.astype("i8"),
        np.arange(4, 24, 4, dtype="i8"),
        np.full(5, 10, "u1"),
    ]
    kinds = [
        ("Float64", "Points"),
        ("Int64", "connectivity"),
        ("Int64", "offsets"),
        ("UInt8", "types"),
    ]
    data, tags = b"", []
    for values, (kind, name) in zip(arrays, kinds, strict=True):
        tags.append(
            f'<DataArray type="{kind}" Name="{name}" format="appended" offset="{len(data)}"/>'
        )
        swapped = values.astype(values.dtype.newbyteorder(order))
        data += np.array([swapped.nbytes], order + "u4").tobytes() + swapped.tobytes()
    head = vtu(tags).replace("LittleEndian", "LittleEndian" if order == "<" else "BigEndian")
    content = head.replace("</VTKFile>", '<AppendedData encoding="raw">_').encode() + data
    is_cube(read_mesh(text(tmp_path, "a.vtu", content + b"</AppendedData></VTKFile>")))
    with pytest.raises(MeshError, match="cut short"):
        read_mesh(text(tmp_path, "b.vtu", content[:-20]))


def test_ghost_cells_of_a_piece_are_left_out(tmp_path):
    ghost = (
        f"<CellData>{data_array('vtkGhostType', np.array([0, 0, 0, 0, 1], np.uint8))}</CellData>"
    )
    mesh = read_mesh(text(tmp_path, "a.vtu", vtu(cube_arrays(), extra=ghost)))
    assert len(mesh.tets) == 4
    assert mesh.notes == ("1 ghost cells of its pieces are left out",)


def test_legacy_vtk_with_words_attributes_and_metadata_between(tmp_path):
    points = "\n".join(" ".join(map(str, p)) for p in CUBE.points)
    cells = "\n".join("4 " + " ".join(map(str, row)) for row in CUBE.tets)
    content = (
        "# vtk DataFile Version 4.2\nwritten by somebody\nASCII\nDATASET UNSTRUCTURED_GRID\n"
        "FIELD FieldData 2\nTIME 1 1 double\n0.5\nwho 1 1 string\nme%20too\n"
        f"POINTS 8 double\n{points}\nMETADATA\nINFORMATION 1\nNAME L2_NORM LOCATION vtkDataArray\n"
        f"DATA 2 0 1\n\nCELLS 5 25\n{cells}\nCELL_TYPES 5\n10 10\n10 10 10\n"
        "POINT_DATA 8\nSCALARS t float 1\nLOOKUP_TABLE default\n1 2 3 4 nan 6 7 8\n"
        "CELL_DATA 5\nVECTORS fibre double\n" + "1 0 0 " * 5 + "\nSCALARS material int\n"
        "LOOKUP_TABLE default\n1 1 2 2 2\n"
    )
    mesh = read_mesh(text(tmp_path, "a.vtk", content))
    is_cube(mesh)
    assert [(region.name, len(region.tets)) for region in mesh.regions] == [("1", 2), ("2", 3)]


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.vtk", "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\n", "a surface"),
        ("a.vtk", "# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_GRID\n",
         "a STRUCTURED_GRID"),
        ("a.vtu", '<VTKFile type="PUnstructuredGrid"></VTKFile>', "only lists other files"),
        ("a.pvd", '<VTKFile type="Collection"></VTKFile>', "only lists other files"),
        ("a.inp", "*Node\n1, 0., 0., 0.\n".encode("utf-16"), "in UTF-16; save it as UTF-8"),
        ("a.inp", "*Node\r1, 0., 0., 0.\r", "CR alone"),
        ("a.vtu", '<VTKFile type="ImageData"></VTKFile>', "it holds a ImageData"),
        ("a.vtu", vtu(cube_arrays()).replace("<VTKFile", f"<VTKFile compressor='{LZ4}'"),
         "vtkLZ4DataCompressor; save it with zlib"),
        ("a.msh", "solid x\nfacet normal 0 0 1\n", "a surface \\(STL\\)"),
        ("a.vtk", "ISO-10303-21;\nHEADER;\n", "a CAD model \\(STEP\\)"),
        ("a.inp", "*KEYWORD\n*NODE\n", "LS-DYNA model, which is not read"),
        ("a.mesh", "MFEM mesh v1.0\n", "MFEM mesh, which is not read"),
        ("a.inp", "hello\n", "neither as an Abaqus nor as an AVS"),
        ("a.smesh", "1 2 3\n", "what TetGen starts from"),
        ("a.msh", "$MeshFormat\n4.1 1 4\n", "numbers have 4 bytes"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_called_what_it_is_and_never_damaged(tmp_path, name, content, words):
    with pytest.raises(MeshError, match=words) as caught:
        read_mesh(text(tmp_path, name, content))
    assert "damaged" not in str(caught.value)


GMSH_22 = """$Comments
anything $Nodes
$EndComments
$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
3 1 "soft part"
2 5 "clamp"
$EndPhysicalNames
$Nodes
5
1 0 0 0
2 1 0 0
3 0 1 0
7 0 0 1
9 0 0 -1
$EndNodes
$Elements
5
1 15 2 6 1 1
2 2 3 5 1 0 1 2 3
3 4 2 1 1 1 2 3 7
4 4 4 2 1 1 -2 2 1 3 9
5 4 2 3 1 1 2 3 7
$EndElements
$Periodic
1
0 1 3
0
$EndPeriodic
"""


def test_gmsh_elements_of_several_physical_groups_are_one_element(tmp_path):
    mesh = read_mesh(text(tmp_path, "a.msh", GMSH_22.replace("\n", "\r\n")))
    assert (len(mesh.tets), mesh.flipped) == (2, 0)
    assert mesh.volumes.sum() == pytest.approx(1 / 3)
    regions = [(region.name, region.tag, region.tets.tolist()) for region in mesh.regions]
    assert regions == [("soft part", 1, [0]), ("2", 2, [1]), ("3", 3, [0])]
    sets = {group.name: (group.tag, group.nodes.tolist(), len(group.faces)) for group in mesh.sets}
    assert sets == {"clamp": (5, [0, 1, 2], 1), "6": (6, [0], 0)}


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("version", ["gmsh22", "gmsh"])
def test_gmsh_files_of_both_sorts_give_the_same_mesh(tmp_path, version, binary):
    brick = box((1.0, 1.0, 0.5), (3, 2, 1))
    cells = [("triangle", brick.surface), ("tetra", brick.tets)]
    cells = cells if version == "gmsh22" else cells[1:]
    data = {
        name: [np.full(len(rows), k + 1) for k, (_, rows) in enumerate(cells)]
        for name in ("gmsh:physical", "gmsh:geometrical")
    }
    meshio.Mesh(brick.points, cells, cell_data=data if version == "gmsh22" else {}).write(
        tmp_path / "a.msh", file_format=version, binary=binary
    )
    mesh = read_mesh(tmp_path / "a.msh")
    assert np.array_equal(mesh.tets, brick.tets)
    assert mesh.points == pytest.approx(brick.points, abs=1e-15)


MEDIT = """MeshVersionFormatted 2
Dimension
3
# a comment
Vertices
5
0 0 0 1
1. 0 0 1
0 1 0 2
0 0 1 2
0 0 -1e0 2
Corners
2
1 2
RequiredVertices
1
1
Triangles 1
1 2 3 9
Tetrahedra
2
1 2 3 4 7
2 1 3 5 8
Ridges 1
1
End
"""


def test_medit_files_with_corners_and_required_vertices(tmp_path):
    mesh = read_mesh(text(tmp_path, "a.mesh", MEDIT))
    assert mesh.volumes.sum() == pytest.approx(1 / 3)
    assert [region.tag for region in mesh.regions] == [7, 8]
    assert [(group.tag, group.nodes.tolist()) for group in mesh.sets] == [(9, [0, 1, 2])]
    with pytest.raises(MeshError, match="Tetrahedra announces 3 rows"):
        read_mesh(text(tmp_path, "b.mesh", MEDIT.replace("Tetrahedra\n2", "Tetrahedra\n3")))


TECPLOT = (
    """TITLE = "t"
VARIABLES = "X" "Y" "Z"
"""
    + """ZONE NODES=4, ELEMENTS=1, DATAPACKING=POINT, ZONETYPE=FETETRAHEDRON
0 0 0
1 0 0
0 1 0
0 0 1
1 2 3 4
"""
)


def test_several_zones_of_a_file_are_never_read_as_one(tmp_path):
    assert len(read_mesh(text(tmp_path, "a.tec", TECPLOT)).tets) == 1
    with pytest.raises(MeshError, match="it holds 2 zones, of which one can be read"):
        read_mesh(text(tmp_path, "b.tec", TECPLOT + TECPLOT.split("\n", 2)[2]))


NASTRAN = {
    "small": "GRID    1               0.0     0.0     0.0\n"
    "GRID    2               1.0     0.0     0.0\n"
    "GRID    3               0.0     1.0+0   0.0\nGRID    4               0.0     0.0     1.0\n"
    "CTETRA  7       5       1       2       3       4\n",
    "free": "GRID,1,,0.,0.,0.\nGRID,2,0,1.,0.,0.\nGRID,3,,0.,1.,0.\nGRID,4,,0.,0.,10.-1\n"
    "CTETRA,7,5,1,2,3,4\n",
    "large": "GRID*   1                               0.0             0.0\n*       0.0\n"
    "GRID*   2                               1.0             0.0             *A\n*A      0.0\n"
    "GRID*   3                               0.0             1.0\n*       0.0\n"
    "GRID*   4                               0.0             0.0\n*       1.0\n"
    "CTETRA*,7,5,1,2\n*,3,4\n",
}


@pytest.mark.parametrize("fields", NASTRAN)
@pytest.mark.parametrize("begin", ["", "SOL 101\nCEND\n$ a comment\nBEGIN BULK\n"])
def test_nastran_files_in_fields_of_every_sort(tmp_path, fields, begin):
    content = f"$ made by hand\n{begin}{NASTRAN[fields]}PSOLID,5,1\nSPC1,1,123,1\nENDDATA\n"
    mesh = read_mesh(text(tmp_path, "a.bdf", content))
    assert mesh.volumes.sum() == pytest.approx(1 / 6, rel=1e-12)
    assert [region.tag for region in mesh.regions] == [5]
    assert mesh.warnings == ("the file: 1 SPC1 cards are not taken over",)


def test_a_million_tets_are_no_loop_in_python(tmp_path):
    """196,520 tets are read in half a second; a loop over rows would take several."""
    import time

    brick = box((1.0, 1.0, 1.0), (34, 34, 34))
    write_vtu(tmp_path / "a.vtu", brick.points, tets=brick.tets)
    begun = time.process_time()
    assert np.array_equal(read_mesh(tmp_path / "a.vtu").tets, brick.tets)
    assert time.process_time() - begun < 3.0
