"""tisoft stability: files, words, exit codes."""

import csv
import json
import re

import pytest
from PIL import Image

from tisoft.cli import main
from tisoft.study import pictures

SCENE = """
duration = 0.1
[[body]]
name = "beam"
young = 1e5
poisson = 0.3
density = 1000.0
[body.mesh]
box = { size = [0.5, 0.2, 0.2], cells = [3, 1, 1] }
[[body.pin]]
where = { box = [[-1e-6, -1, -1], [1e-6, 1, 1]] }
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "beam.toml"
    path.write_text(SCENE)
    return str(path)


@pytest.mark.slow
def test_map_is_written_whole(scene, tmp_path, capsys):
    folder = tmp_path / "map"
    assert main(["stability", scene, "-o", str(folder), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["status"] == "done"
    names = ["step-damping", "compression", "rotation", "poisson", "diagonals"]
    assert list(result["axes"]) == names
    assert result == json.loads((folder / "summary.json").read_text())
    page = (folder / "stability.md").read_text()
    for name in names:
        with Image.open(folder / f"{name}.png") as picture:
            assert picture.width > 800
            assert len(picture.convert("L").histogram()) == 256
        assert (folder / f"{name}.svg").read_text().rstrip().endswith("</svg>")
        rows = list(csv.reader((folder / f"{name}.csv").read_text().splitlines()))
        assert len(rows) > 5
        assert len({len(row) for row in rows}) == 1
        assert result["axes"][name]["sentence"] in page
        assert f"]({name}.png)" in page
    expected = {f"{n}.{e}" for n in names for e in ("png", "svg", "csv")}
    assert {p.name for p in folder.iterdir()} == expected | {
        "summary.json",
        "stability.md",
        "tisoft.json",
    }


def test_only_some_axes_and_a_page_for_people(scene, tmp_path, capsys):
    folder = tmp_path / "map"
    assert main(["stability", scene, "-o", str(folder), "--only", "step-damping"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"A step above \d.* ms blows 'beam' up", out)
    assert "stability.md" in out
    assert not (folder / "poisson.png").exists()


def test_quiet_says_nothing(scene, tmp_path, capsys):
    folder = str(tmp_path / "map")
    assert main(["stability", scene, "-o", folder, "--only", "step-damping", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--only", "heat"], "names no axis 'heat'; choose from step-damping"),
        (["--set", "body.0.poisson=0.5"], "poisson = 0.5"),
    ],
)
def test_mistakes_are_told_in_one_sentence(scene, tmp_path, capsys, more, words):
    assert main(["stability", scene, "-o", str(tmp_path / "map"), *more]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1


def test_folder_that_is_a_file_is_told_before_the_work(scene, capsys):
    assert main(["stability", scene, "-o", scene]) == 2
    assert "is a file" in capsys.readouterr().err


def test_interrupted_map_keeps_the_axes_that_are_done(scene, tmp_path, monkeypatch, capsys):
    folder = tmp_path / "map"
    save = pictures.save

    def interrupted(axis, place, **options):
        if axis.name == "poisson":
            raise KeyboardInterrupt
        return save(axis, place, **options)

    monkeypatch.setattr(pictures, "save", interrupted)
    code = main(["stability", scene, "-o", str(folder), "--only", "step-damping,poisson"])
    assert code == 130
    assert json.loads((folder / "summary.json").read_text())["status"] == "interrupted"
    names = {p.name for p in folder.iterdir()}
    assert "step-damping.png" in names
    assert not any(name.startswith((".", "poisson")) for name in names)


def test_damping_ratio_is_part_of_the_map(scene, tmp_path, capsys):
    """The map's stable step is that of the scene as it runs, viscosity included."""
    damped = ["--set", "body.0.damping_ratio=0.02"]
    assert main(["check", scene, "--json", *damped]) == 0
    limit = json.loads(capsys.readouterr().out)["stable_step"]
    folder = str(tmp_path / "map")
    assert main(["stability", scene, "-o", folder, "--only", "rotation", "--json", *damped]) == 0
    assert json.loads(capsys.readouterr().out)["status"] == "done"
    page = (tmp_path / "map" / "stability.md").read_text()
    assert f"stable step of {1e3 * limit:.4g} ms" in page
