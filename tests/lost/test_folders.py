"""A folder belongs to one result: what is replaced, what is refused, what is never touched."""

import json
import os
import sys
from pathlib import Path

import pytest

from tisoft.cli import main
from tisoft.folders import Owner, ResultFolder
from tisoft.manifest import MANIFEST, read_manifest
from tisoft.observers.progress import Progress


def names(folder):
    return sorted(str(p.relative_to(folder)) for p in Path(folder).rglob("*") if p.is_file())


def state(folder):
    return json.loads((Path(folder) / MANIFEST).read_text(encoding="utf-8"))["state"]


def told(capsys):
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and error.startswith("tisoft: error: ")
    return error


def cut(monkeypatch, at=4):
    """Let runs be interrupted at a frame."""

    def press(self, frame):
        if frame.index == at:
            raise KeyboardInterrupt

    monkeypatch.setattr(Progress, "on_frame", press)


def test_the_manifest_tells_scene_command_and_state(scene, tmp_path):
    out = tmp_path / "out"
    assert main(["run", scene, "-o", str(out), "--quiet", "--save-every", "5"]) == 0
    found = json.loads((out / MANIFEST).read_text(encoding="utf-8"))
    assert (found["command"], found["scene"]) == ("run", scene)
    assert (found["state"], found["progress"]) == ("done", 1.0)
    assert sorted([*read_manifest(out).names(), MANIFEST]) == names(out)


def test_a_new_run_leaves_nothing_of_the_old(scene, tmp_path):
    out = tmp_path / "out"
    run = ["run", scene, "-o", str(out), "--quiet"]
    assert main([*run, "--save-every", "2"]) == 0
    (out / "notes.txt").write_text("the user's")
    (out / "frames" / "frame_00077.png").write_text("the user's")
    assert main(run) == 0
    assert names(out) == [
        *("checkpoint.npz", "energy.csv", "frames/frame_00077.png", "notes.txt"),
        *("probes.csv", "summary.json", "tisoft.json"),
    ]


@pytest.mark.parametrize("command", ["static", "modes", "render", "stability"])
def test_a_result_of_another_command_is_not_written_over(command, scene, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["run", scene, "-o", str(out), "--quiet"]) == 0
    before = {name: (out / name).read_bytes() for name in names(out)}
    assert main([command, scene, "-o", str(out), "--quiet"]) == 2
    assert "holds the result of tisoft run beam.toml" in told(capsys)
    assert {name: (out / name).read_bytes() for name in names(out)} == before


def test_a_result_of_another_scene_is_not_written_over(scene, tmp_path, capsys):
    other = tmp_path / "other.toml"
    other.write_text(Path(scene).read_text())
    out = str(tmp_path / "out")
    assert main(["run", scene, "-o", out, "--quiet"]) == 0
    assert main(["run", str(other), "-o", out]) == 2
    assert "tisoft run beam.toml; name another folder with -o" in told(capsys)


def test_overwrite_replaces_what_tisoft_wrote_and_nothing_else(scene, tmp_path):
    out = tmp_path / "out"
    assert main(["run", scene, "-o", str(out), "--quiet", "--save-every", "2"]) == 0
    (out / "notes.txt").write_text("the user's")
    assert main(["modes", scene, "-n", "1", "-o", str(out), "--quiet", "--overwrite"]) == 0
    assert names(out) == ["notes.txt", "summary.json", "tisoft.json"]
    assert not (out / "frames").exists()


def test_an_unfinished_run_is_not_begun_anew_by_mistake(scene, tmp_path, monkeypatch, capsys):
    out = tmp_path / "out"
    run = ["run", scene, "-o", str(out), "--quiet"]
    with monkeypatch.context() as patch:
        cut(patch, at=6)
        patch.setattr("tisoft.observers.checkpoints.INTERVAL", 0.0)
        patch.setattr("tisoft.observers.checkpoints.MOST_SHARE", 0.0)
        assert main(run) == 130
    assert state(out) == "interrupted"
    capsys.readouterr()
    before = (out / "checkpoint.npz").read_bytes()
    assert main(run) == 2
    error = told(capsys)
    assert "holds an unfinished run, 60 % done: --resume goes on, --overwrite begins anew" in error
    assert (out / "checkpoint.npz").read_bytes() == before
    assert main([*run, "--resume"]) == 0
    assert state(out) == "done"
    assert main([*run, "--overwrite"]) == 0


def test_resume_and_overwrite_exclude_each_other(scene, tmp_path, capsys):
    assert main(["run", scene, "-o", str(tmp_path), "--resume", "--overwrite"]) == 2
    assert "give one of them" in told(capsys)


def test_a_finished_run_goes_on_for_longer(scene, tmp_path):
    whole, out = tmp_path / "whole", tmp_path / "out"
    assert main(["run", scene, "-o", str(whole), "--quiet"]) == 0
    assert main(["run", scene, "-o", str(out), "--quiet", "--set", "duration=0.1"]) == 0
    assert main(["run", scene, "-o", str(out), "--quiet", "--resume"]) == 0
    for name in ("probes.csv", "energy.csv"):
        assert (out / name).read_bytes() == (whole / name).read_bytes()


def test_resume_for_shorter_leaves_no_later_frames(scene, tmp_path, monkeypatch):
    out = tmp_path / "out"
    run = ["run", scene, "-o", str(out), "--quiet", "--save-every", "1"]
    with monkeypatch.context() as patch:
        patch.setattr("tisoft.commands.run._save_end", lambda run, kept: None)
        assert main([*run, "--set", "checkpoint_every=3"]) == 0  # as if killed after the end
    assert main([*run, "--resume", "--set", "duration=0.18"]) == 0
    assert len(list((out / "frames").iterdir())) == 10


def test_files_that_nobody_claims_are_not_replaced(scene, tmp_path, capsys):
    out = tmp_path / "out"
    out.mkdir()
    (out / "probes.csv").write_text("the user's")
    assert main(["run", scene, "-o", str(out)]) == 2
    assert "probes.csv lies there and is of no result that tisoft knows" in told(capsys)
    assert (out / "probes.csv").read_text() == "the user's" and names(out) == ["probes.csv"]
    assert main(["run", scene, "-o", str(out), "--quiet", "--overwrite"]) == 0


def test_a_picture_in_the_way_is_told_before_the_work(scene, tmp_path, capsys):
    out = tmp_path / "pictures"
    out.mkdir()
    (out / "frame_00007.png").write_text("the user's")
    (out / "frame_00077.png").write_text("the user's")
    assert main(["render", scene, "-o", str(out), "--quiet"]) == 2
    assert "frame_00007.png lies there" in told(capsys)
    (out / "frame_00007.png").unlink()
    assert main(["render", scene, "-o", str(out), "--quiet"]) == 0
    assert main(["render", scene, "-o", str(out), "--quiet", "--set", "duration=0.1"]) == 0
    assert len(list(out.glob("frame_*.png"))) == 7
    assert (out / "frame_00077.png").read_text() == "the user's"


def test_a_folder_in_the_place_of_a_table_is_told_before_the_simulation(scene, tmp_path, capsys):
    (tmp_path / "out" / "probes.csv").mkdir(parents=True)
    for more in ([], ["--overwrite"]):
        assert main(["run", scene, "-o", str(tmp_path / "out"), *more]) == 2
        assert "probes.csv is a folder, and a result needs that name" in told(capsys)


def test_a_refused_scene_leaves_the_older_result(scene, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["run", scene, "-o", str(out), "--quiet"]) == 0
    before = {name: (out / name).read_bytes() for name in names(out)}
    assert main(["run", scene, "-o", str(out), "--set", "step=0.5"]) == 2
    assert "above the stable limit" in told(capsys)
    assert {name: (out / name).read_bytes() for name in names(out)} == before


def test_a_refused_scene_leaves_no_empty_folder(scene, tmp_path):
    assert main(["run", scene, "-o", str(tmp_path / "a" / "b"), "--set", "step=0.5"]) == 2
    assert not (tmp_path / "a").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such lock")
@pytest.mark.parametrize("command", ["run", "static", "modes", "render", "stability"])
def test_a_folder_at_work_is_left_alone(command, scene, tmp_path, capsys):
    out = tmp_path / "out"
    with ResultFolder(out, Owner("run", scene)) as folder:
        folder.begin(["probes.csv"])
        (out / "probes.csv").write_text("time\n")
        for more in ([], ["--overwrite"]):
            assert main([command, scene, "-o", str(out), "--quiet", *more]) == 2
            assert "another run is writing into" in told(capsys)
    assert names(out) == ["probes.csv", "tisoft.json"]


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", "\x00", '{"made_by": "tisoft", "format": 2}', "[" * 100_000, "null", "7"],
)
def test_a_damaged_manifest_is_told(text, scene, tmp_path, capsys):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / MANIFEST).write_text(text)
    run = ["run", scene, "-o", str(tmp_path / "out"), "--quiet"]
    assert main(run) == 2
    assert "tisoft.json is damaged, or of another program" in told(capsys)
    assert main([*run, "--overwrite"]) == 0


@pytest.mark.parametrize("name", ["../precious", "/precious", "a/../../precious", "..", "a/b/c"])
@pytest.mark.parametrize("where", ["files", "series"])
def test_no_manifest_reaches_outside_its_folder(name, where, scene, tmp_path, capsys):
    (tmp_path / "precious").write_text("the user's")
    (tmp_path / "out").mkdir()
    data = {"made_by": "tisoft", "version": "0", "format": 1, "command": "run", "scene": scene}
    data |= {"state": "done", "progress": 1.0, "files": [], "series": {}}
    data[where] = [name] if where == "files" else {f"{name}%05d.x": [1, 3]}
    (tmp_path / "out" / MANIFEST).write_text(json.dumps(data))
    assert main(["run", scene, "-o", str(tmp_path / "out")]) == 2
    assert "is damaged" in told(capsys)
    assert main(["run", scene, "-o", str(tmp_path / "out"), "--quiet", "--overwrite"]) == 0
    assert (tmp_path / "precious").read_text() == "the user's"


def test_a_link_is_removed_and_not_what_it_points_to(scene, tmp_path):
    out = tmp_path / "out"
    run = ["run", scene, "-o", str(out), "--quiet"]
    assert main(run) == 0
    os.rename(out / "summary.json", tmp_path / "kept.json")
    (out / "summary.json").symlink_to(tmp_path / "kept.json")
    before = (tmp_path / "kept.json").read_bytes()
    assert main([*run, "--set", "duration=0.1"]) == 0
    assert (tmp_path / "kept.json").read_bytes() == before


def test_a_picture_does_not_replace_one_of_a_folder_that_belongs_to_a_result(
    scene, tmp_path, capsys
):
    out = tmp_path / "out"
    assert main(["render", scene, "-o", str(out), "--quiet"]) == 0
    before = (out / "frame_00003.png").read_bytes()
    assert main(["check", scene, "--picture", str(out / "frame_00003.png")]) == 2
    assert "belongs to the result of tisoft render beam.toml" in told(capsys)
    assert (out / "frame_00003.png").read_bytes() == before
    assert main(["check", scene, "--quiet", "--picture", str(out / "check.png")]) == 0
