"""Names that a user may type: for results, scenes and meshes."""

import json
import sys
from pathlib import Path

import pytest
from stopping import SCENE

from tisoft.cli import main
from tisoft.geometry.files import write_vtu
from tisoft.geometry.shapes import box


@pytest.fixture(autouse=True)
def here(scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", [".", "./", "pictures", "pictures/", "a/b/"])
def test_pictures_go_into_any_folder(name, here):
    assert main(["render", "beam.toml", "-o", name, "--quiet", "--set", "duration=0.04"]) == 0
    assert sorted(path.name for path in Path(name).glob("*.png")) == [
        f"frame_{k:05d}.png" for k in range(3)
    ]


@pytest.mark.parametrize("name", ["", " ", "a\x00b"])
@pytest.mark.parametrize(
    "line",
    [
        ["run", "beam.toml", "-o", "?"],
        ["render", "beam.toml", "-o", "?"],
        ["static", "beam.toml", "-o", "?"],
        ["modes", "beam.toml", "-o", "?"],
        ["stability", "beam.toml", "-o", "?"],
        ["check", "beam.toml", "--picture", "?"],
        ["demo", "-o", "?"],
        ["run", "?"],
    ],
)
def test_an_empty_name_is_a_mistake_everywhere(name, line, here, capsys):
    assert main([name if word == "?" else word for word in line]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert ("is empty; give the name" if "\x00" not in name else "a null character") in error
    assert [path.name for path in here.iterdir()] == ["beam.toml"]


@pytest.mark.parametrize(
    "line",
    [
        ["run", "beam.toml", "-o", "beam.toml/x"],
        ["run", "beam.toml", "-o", "beam.toml/x/y"],
        ["static", "beam.toml", "-o", "beam.toml/x"],
        ["render", "beam.toml", "-o", "beam.toml/x.mp4"],
        ["render", "beam.toml", "-o", "beam.toml/x/"],
        ["check", "beam.toml", "--picture", "beam.toml/x/y.png"],
    ],
)
def test_a_path_under_a_file_names_the_file(line, here, capsys):
    assert main(line) == 2
    error = capsys.readouterr().err
    assert "beam.toml is a file, not a folder" in error and error.count("\n") == 1


def test_a_long_name(here, capsys):
    run = ["render", "beam.toml", "--quiet", "--set", "duration=0.04", "-o"]
    assert main([*run, "a" * 249 + ".gif"]) == 0
    assert main([*run, "a" * 252 + ".gif"]) == 2
    assert "File name too long" in capsys.readouterr().err


def test_a_picture_is_one_picture(here, capsys):
    assert main(["render", "beam.toml", "-o", "x.png"]) == 0
    assert "x.png: 1 picture of 48 x 32 pixels" in capsys.readouterr().out
    assert main(["render", "beam.toml", "-o", "x.png", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["pictures"] == 1


def test_home_is_expanded(here, monkeypatch, capsys):
    monkeypatch.setenv("HOME", str(here))
    monkeypatch.setenv("USERPROFILE", str(here))
    mesh = box((0.5, 0.2, 0.2), (2, 1, 1))
    write_vtu(here / "brick.vtu", mesh.points, tets=mesh.tets)
    brick = ["--set", 'body.0.mesh={ file = "~/brick.vtu" }']
    assert main(["run", "~/beam.toml", "-o", "~/out", "--quiet", *brick]) == 0
    assert (here / "out" / "summary.json").exists() and not (here / "~").exists()
    lost = ["--set", 'body.0.mesh={ file = "~nobody-of-that-name/brick.vtu" }']
    assert main(["check", "beam.toml", *lost]) == 2
    assert "names a home that is not known" in capsys.readouterr().err


@pytest.mark.skipif(sys.platform != "linux", reason="needs a folder that not even root may write")
@pytest.mark.parametrize("line", [["run", "-o", "/proc/out"], ["render", "-o", "/proc/film.mp4"]])
def test_a_folder_that_may_not_be_written_is_told(line, here, capsys):
    command, *place = line
    assert main([command, "beam.toml", *place]) == 2
    error = capsys.readouterr().err
    assert f"{place[-1]} cannot be written: " in error and error.count("\n") == 1


@pytest.mark.parametrize(
    ("mesh", "told"),
    [
        (
            "box = { size = [0.5, 0.2, 0.2], cells = [2000000, 1, 1] }",
            "box.cells[0] = 2000000 makes",
        ),
        ("box = { size = [0.5, 0.2, 1e-9], cells = [2, 1, 1] }", "box.size[2] = 1e-9 makes cells"),
        (
            "box = { size = [1, 1, 1], cells = [300, 300, 300] }",
            "box.cells = [300, 300, 300] makes 1.35e+08",
        ),
        (
            "cylinder = { radius = 1, height = 1e30, resolution = 2 }",
            "cylinder.height = 1e30 makes",
        ),
        ("cylinder = { radius = 1, height = 1, resolution = 9999 }", "cylinder.resolution = 9999"),
        ("ball = { radius = 1, resolution = 2000000 }", "ball.resolution = 2000000 makes 1.6e+20"),
    ],
)
def test_a_size_out_of_range_names_its_key(mesh, told, here, capsys):
    text = SCENE.replace("box = { size = [0.5, 0.2, 0.2], cells = [3, 1, 1] }", mesh)
    (here / "large.toml").write_text(text)
    assert main(["check", "large.toml"]) == 2
    error = capsys.readouterr().err
    assert f"body[0].mesh.{told}" in error and error.count("\n") == 1


def test_check_tells_the_range_of_its_estimate(here, capsys):
    assert main(["check", "beam.toml", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    low, high = found["estimated_real_time_range"]
    assert 0.0 < low <= found["estimated_real_time_factor"] <= high
    assert main(["check", "beam.toml"]) == 0
    assert "x real time on this machine (" in capsys.readouterr().out
