"""What a mesh file tells of its body reaches the user: regions, sets, seams, folds, units."""

import json

import meshio
import numpy as np
import pytest

import tisoft as ts
from tisoft.cli import main
from tisoft.errors import SceneError
from tisoft.geometry.files import write_vtu
from tisoft.geometry.shapes import box

SCENE = """
duration = {duration}
[[body]]
name = "beam"
young = 1e6
poisson = 0.3
density = 1000.0
[body.mesh]
file = "beam.vtu"
{mesh}
{more}
"""
CLAMP = "[[body.pin]]\nwhere = { box = [[-1e-6, -9, -9], [1e-6, 9, 9]] }\n"
TIP = '[[probe]]\nname = "tip"\nbody = "beam"\npoint = [1, 0.2, 0.2]\n'
BEAM = box((1.0, 0.2, 0.2), (10, 2, 2))
COMMANDS = ["check", "run", "static", "modes", "render"]


def scene(folder, *, mesh="", more="", duration=0.5):
    path = folder / "scene.toml"
    path.write_text(SCENE.format(mesh=mesh, more=more, duration=duration), encoding="utf-8")
    return path


def seam(folder, *, all_of_it):
    """The beam with double nodes at x = 0.5, as a file."""
    points, tets = BEAM.points, BEAM.tets.copy()
    double = (np.abs(points[:, 0] - 0.5) < 1e-12) & (all_of_it | (points[:, 1] > 1e-12))
    new = np.where(double, len(points) - 1 + np.cumsum(double), np.arange(len(points)))
    right = points[tets].mean(axis=1)[:, 0] > 0.5
    tets[right] = new[tets[right]]
    write_vtu(folder / "beam.vtu", np.concatenate([points, points[double]]), tets=tets)


def called(capsys, *arguments):
    """Exit code, and what was printed as a result and as a message."""
    code = main(list(map(str, arguments)))
    return code, *capsys.readouterr()


def arguments_of(command, path, folder):
    size = ["-o", folder / "a.png", "--size", "32x32"] if command == "render" else []
    return [command, path, *size, *(["-n", "2"] if command == "modes" else [])]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_tells_a_seam_at_its_start_and_in_json(tmp_path, capsys, command):
    seam(tmp_path, all_of_it=False)
    path = scene(tmp_path, more=CLAMP, duration=0.02)
    told = (
        'body "beam" may come apart: 6 pairs of nodes lie in the same place (as nodes 16 and 99 at'
    )
    code, out, err = called(capsys, *arguments_of(command, path, tmp_path))
    assert code == 0
    assert (out if command == "check" else err).count(told) == 1
    if command != "check":
        assert err.startswith(f"tisoft: warning: {told}")
    code, out, _ = called(capsys, *arguments_of(command, path, tmp_path), "--json")
    warnings = json.loads(out)["warnings"]
    assert sum(told in warning for warning in warnings) == 1
    assert "merge = true" in warnings[0]


@pytest.mark.parametrize("all_of_it", [False, True])
def test_merged_seams_are_as_strong_as_the_beam(tmp_path, capsys, all_of_it):
    seam(tmp_path, all_of_it=all_of_it)
    path = scene(tmp_path, mesh="merge = true", more=CLAMP + TIP)
    code, out, _ = called(capsys, "static", path, "--json")
    assert code == 0
    assert json.loads(out)["probes"]["tip"]["displacement"][1] == pytest.approx(-0.2478, abs=1e-4)
    code, out, _ = called(capsys, "run", path, "--json")
    assert json.loads(out)["probes"]["tip"]["displacement"][1] == pytest.approx(-0.4303, abs=5e-4)
    assert not any("come apart" in warning for warning in json.loads(out)["warnings"])


def test_a_piece_that_no_pin_holds_is_told(tmp_path, capsys):
    seam(tmp_path, all_of_it=True)
    _, out, _ = called(capsys, "check", scene(tmp_path, more=CLAMP))
    assert 'body "beam" has a piece of 2 that no pin holds, as that of node 6' in out


def test_nodes_that_were_merged_keep_their_numbers_for_pins_and_probes(tmp_path):
    seam(tmp_path, all_of_it=True)
    more = "[[body.pin]]\nwhere = { nodes = [99, 0] }\n"
    more += '[[probe]]\nname = "p"\nbody = "beam"\nnode = 99\n'
    made = ts.load_scene(scene(tmp_path, mesh="merge = true", more=more))
    rows = made.bodies[0].nodes(made.bodies[0].pins[0].where)
    assert sorted(made.bodies[0].mesh.points[rows][:, 0]) == [0.0, 0.5]
    assert made.probed(made.probes[0]).rows[0] in rows


@pytest.mark.parametrize("command", COMMANDS)
def test_folded_tets_are_told_with_both_volumes_by_every_command(tmp_path, capsys, command):
    cube = box((0.4, 0.4, 0.4), (4, 4, 4))
    points = cube.points.copy()
    points[62] = [0.33, 0.24, 0.22]
    write_vtu(tmp_path / "beam.vtu", points, tets=cube.tets)
    path = scene(tmp_path, more=CLAMP, duration=0.02)
    code, out, err = called(capsys, *arguments_of(command, path, tmp_path))
    assert code == 0
    told = out if command == "check" else err
    assert "tets 132, 191, 210 (3) are folded over their neighbours" in told
    assert "the tets add up to 0.0645" in told
    assert "the surface encloses 0.064 m³" in told


def test_a_mirrored_mesh_is_no_warning(tmp_path, capsys):
    cube = box((0.4, 0.4, 0.4), (4, 4, 4))
    write_vtu(tmp_path / "beam.vtu", cube.points, tets=cube.tets[:, [1, 0, 2, 3]])
    path = scene(tmp_path, more=CLAMP, duration=0.02)
    code, out, err = called(capsys, "check", path, "--json")
    result = json.loads(out)
    assert (code, err, result["warnings"]) == (0, "", [])
    assert result["mesh"]["beam"]["volume"] == pytest.approx(0.064, rel=1e-12)


def two_materials(folder):
    """A bar of two regions with a named face at its end, as a Gmsh file."""
    bar = box((1.0, 0.1, 0.1), (10, 1, 1))
    stiff = bar.points[bar.tets].mean(axis=1)[:, 0] > 0.5
    end = bar.surface[(bar.points[bar.surface][:, :, 0] > 1.0 - 1e-9).all(axis=1)]
    cells = [("triangle", end), ("tetra", bar.tets)]
    tags = [np.full(len(end), 7), np.where(stiff, 2, 1)]
    fields = {"soft": np.array([1, 3]), "stiff": np.array([2, 3]), "end": np.array([7, 2])}
    meshio.Mesh(
        bar.points,
        cells,
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data=fields,
    ).write(folder / "beam.msh", file_format="gmsh22")
    return bar


def test_regions_and_sets_of_a_file_are_listed_with_volume_and_count(tmp_path, capsys):
    two_materials(tmp_path)
    path = scene(tmp_path)
    changed = ["--set", "body.0.mesh.file=beam.msh"]
    _, out, _ = called(capsys, "check", path, *changed, "--json")
    result = json.loads(out)
    regions = result["mesh"]["beam"]["regions"]
    assert [(r["name"], r["tag"], r["elements"]) for r in regions] == [
        ("soft", 1, 25),
        ("stiff", 2, 25),
    ]
    assert [r["volume"] for r in regions] == pytest.approx([5e-3, 5e-3])
    assert result["mesh"]["beam"]["sets"] == [
        {"name": "end", "tag": 7, "nodes": 4, "faces": 2, "used": False}
    ]
    one = '2 regions in its file ("soft" (1): 25 tets, "stiff" (2): 25 tets), and one material is'
    assert sum(one in warning for warning in result["warnings"]) == 1
    assert sum('no pin or load uses: "end" (7)' in warning for warning in result["warnings"]) == 1
    for command in ("run", "static", "modes"):
        held = ["--set", "body.0.pin=[{where={region='soft'}}]", "--set", "duration=0.01"]
        _, _, err = called(capsys, command, path, *changed, *held)
        assert err.count(one) == 1


@pytest.mark.parametrize(("soft", "end"), [("'soft'", "'end'"), ("1", "7"), ("'SOFT'", "'7'")])
def test_pins_and_loads_select_by_region_and_set(tmp_path, capsys, soft, end):
    bar = two_materials(tmp_path)
    path = scene(tmp_path)
    held = f"body.0.pin=[{{where={{region={soft}}}}}]"
    load = f"body.0.load=[{{where={{set={end}}}, traction=[1, 0, 0]}}]"
    made = ts.load_scene(path, ["body.0.mesh.file=beam.msh", held, load])
    (body,) = made.bodies
    assert np.array_equal(
        body.nodes(body.pins[0].where), np.flatnonzero(bar.points[:, 0] < 0.5 + 1e-9)
    )
    faces = body.mesh.surface[body.faces(body.loads[0].where)]
    assert len(faces) == 2
    assert body.mesh.points[faces][:, :, 0] == pytest.approx(1.0)
    _, out, _ = called(
        capsys, "check", path, "--set", "body.0.mesh.file=beam.msh", "--set", held, "--set", load
    )
    assert "no pin or load uses" not in out


def test_unknown_regions_and_sets_are_told_with_those_that_there_are(tmp_path):
    two_materials(tmp_path)
    path = scene(tmp_path)
    for key, name, words in (
        ("region", "'hard'", 'is no region of the mesh: it has "soft" (1), "stiff" (2)'),
        ("set", "12", 'is no set of the mesh: it has "end" (7)'),
        ("set", "true", "must be the name or the number of a set"),
    ):
        with pytest.raises(SceneError) as caught:
            ts.load_scene(
                path, ["body.0.mesh.file=beam.msh", f"body.0.pin=[{{where={{{key}={name}}}}}]"]
            )
        assert f"body[0].pin[0].where.{key}" in str(caught.value)
        assert words in str(caught.value)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("tag = 2\nyoung = -1", "body[0].region[0].young = -1 must be above 0 Pa"),
        ('name = "hard"\nyoung = 1', 'is no region of the mesh: it has "soft" (1), "stiff" (2)'),
        ('name = "stiff"', "body[0].region[0] changes nothing"),
        ('name = "stiff"\ntag = 2\nphi = 1', "tag = 2 and name exclude each other"),
        ('name = "stiff"\nmass = 2', "body[0].region[0].mass = 2 is not a key"),
    ],
)
def test_materials_of_regions_are_checked(tmp_path, keys, words):
    two_materials(tmp_path)
    path = scene(tmp_path, more=f"[[body.region]]\n{keys}\n")
    with pytest.raises(SceneError) as caught:
        ts.load_scene(path, ["body.0.mesh.file=beam.msh"])
    assert words in str(caught.value)


def test_a_set_of_faces_is_those_faces_alone(tmp_path):
    """All nodes of a corner's third face belong to the two in the set, and it is not in it."""
    tet = ts.tet_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
    faces = np.array([[0, 2, 1], [0, 1, 3]])
    tags = [np.array([4, 4]), np.array([1])]
    meshio.Mesh(
        tet.points,
        [("triangle", faces), ("tetra", tet.tets)],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
    ).write(tmp_path / "tet.msh", file_format="gmsh22")
    mesh = ts.read_mesh(tmp_path / "tet.msh")
    body = ts.Scene().add_body(mesh, ts.Linear(1e5, 0.3, 1000.0))
    picked = body.faces(ts.where.named_set(4))
    assert {tuple(row) for row in np.sort(mesh.surface[picked]).tolist()} == {(0, 1, 2), (0, 1, 3)}


@pytest.mark.parametrize(
    ("units", "factor"), [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("in", 0.0254)]
)
def test_units_are_a_word_for_the_scale(tmp_path, units, factor):
    write_vtu(tmp_path / "beam.vtu", BEAM.points, tets=BEAM.tets)
    (body,) = ts.load_scene(scene(tmp_path, mesh=f'units = "{units}"')).bodies
    assert np.ptp(body.mesh.points[:, 0]) == pytest.approx(factor)


@pytest.mark.parametrize(
    ("size", "asked"), [(2000.0, True), (5e-5, True), (99.0, False), (2e-4, False)]
)
def test_sizes_that_are_no_metres_are_asked_about(tmp_path, capsys, size, asked):
    write_vtu(tmp_path / "beam.vtu", size * BEAM.points, tets=BEAM.tets)
    _, out, _ = called(capsys, "check", scene(tmp_path), "--json")
    assert ("is the file in metres?" in out) == asked
    _, out, _ = called(capsys, "check", scene(tmp_path, mesh='units = "m"'), "--json")
    assert "is the file in metres?" not in out


@pytest.mark.parametrize(
    ("mesh", "words"),
    [
        ('units = "inch"', 'body[0].mesh.units = "inch" is not known'),
        ('units = "mm"\nscale = 2', 'body[0].mesh.units = "mm" and scale exclude each other'),
        ("merge = 0.0", "body[0].mesh.merge = 0.0 must be above 0 m"),
        ("merge = 'all'", 'body[0].mesh.merge = "all" must be a number in m'),
        ("merge = 0.3", "joins corners of tet 0"),
    ],
)
def test_wrong_units_and_distances_are_told(tmp_path, mesh, words):
    write_vtu(tmp_path / "beam.vtu", BEAM.points, tets=BEAM.tets)
    with pytest.raises(SceneError) as caught:
        ts.load_scene(scene(tmp_path, mesh=mesh))
    assert words in str(caught.value)


def test_checkpoints_keep_regions_sets_and_what_was_told(tmp_path):
    two_materials(tmp_path)
    held = "body.0.pin=[{where={region='soft'}}]"
    made = ts.load_scene(scene(tmp_path, duration=0.05), ["body.0.mesh.file=beam.msh", held])
    sim = ts.Simulation(made)
    sim.step()
    sim.save(tmp_path / "state.npz")
    again = ts.Simulation.load(tmp_path / "state.npz")
    sim.step()
    again.step()
    assert np.array_equal(sim.positions(), again.positions())
    mesh = again.scene.bodies[0].mesh
    assert [region.name for region in mesh.regions] == ["soft", "stiff"]
    assert [group.tag for group in mesh.sets] == [7]
