"""A disk that is full, stood for by a limit on the size of files: what was written stays."""

import contextlib
import csv
import json
import os
import sys

import pytest

from tisoft.cli import main
from tisoft.errors import SceneError
from tisoft.growing_file import GrowingFile

resource = pytest.importorskip("resource")


@contextlib.contextmanager
def files_of_at_most(size):
    """No file may grow beyond `size` bytes: the write that would ends in an error, in part."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def rows_of(path):
    text = path.read_text(encoding="utf-8")
    assert text.endswith("\n")
    return list(csv.reader(text.splitlines()))


def test_a_full_disk_keeps_the_rows_written_so_far(scene, tmp_path, capsys):
    out = tmp_path / "out"
    with files_of_at_most(3000):
        code = main(["run", scene, "-o", str(out), "--set", "duration=5", "--quiet"])
    assert code == 2
    error = capsys.readouterr().err
    assert "energy.csv was not written" in error and error.count("\n") == 1
    energy, probes = rows_of(out / "energy.csv"), rows_of(out / "probes.csv")
    assert len(energy) > 15 and len(probes) in (len(energy), len(energy) + 1)
    assert {len(row) for row in energy} == {7} and {len(row) for row in probes} == {4}
    assert json.loads((out / "tisoft.json").read_text())["state"] == "interrupted"
    assert json.loads((out / "summary.json").read_text())["status"] == "failed"
    assert not [path for path in out.iterdir() if path.name.startswith(".")]


def test_a_full_disk_keeps_the_frames_written_so_far(scene, tmp_path, capsys, monkeypatch):
    from tisoft.observers.vtu import StateFiles

    write = StateFiles.write

    def fails(self, path):
        if path.name == "frame_00003.vtu":
            with files_of_at_most(500):
                return write(self, path)
        return write(self, path)

    monkeypatch.setattr(StateFiles, "write", fails)
    out = tmp_path / "out"
    assert main(["run", scene, "-o", str(out), "--save-every", "1", "--quiet"]) == 2
    assert "frame_00003.vtu was not written" in capsys.readouterr().err
    assert len(list((out / "frames").iterdir())) == 3
    assert (out / "frames.pvd").read_text().count("<DataSet") == 3


def test_a_checkpoint_that_does_not_fit_leaves_the_one_before(scene, tmp_path, capsys):
    out = tmp_path / "out"
    run = ["run", scene, "-o", str(out), "--quiet"]
    assert main([*run, "--set", "duration=0.1"]) == 0
    before = (out / "checkpoint.npz").read_bytes()
    with files_of_at_most(len(before) // 2):
        assert main([*run, "--resume"]) == 2
    assert "checkpoint.npz was not written" in capsys.readouterr().err
    assert (out / "checkpoint.npz").read_bytes() == before
    assert main([*run, "--resume"]) == 0


@pytest.mark.parametrize("command", ["static", "modes", "render"])
def test_a_full_disk_is_told_and_leaves_the_older_result(command, scene, tmp_path, capsys):
    out = tmp_path / "out"
    with files_of_at_most(100):
        assert main([command, scene, "-o", str(out), "--quiet"]) == 2
    error = capsys.readouterr().err
    assert "was not written" in error and error.count("\n") == 1
    assert not out.exists()


def test_a_row_that_does_not_fit_is_taken_back(tmp_path):
    with GrowingFile(tmp_path / "a.csv") as file, files_of_at_most(10):
        file.append("1,2,3\n")
        with pytest.raises(SceneError):
            file.append("4,5,6\n")
        assert (tmp_path / "a.csv").read_text() == "1,2,3\n"
        file.append("7\n")
    assert (tmp_path / "a.csv").read_text() == "1,2,3\n7\n"


@pytest.mark.skipif(sys.platform != "linux", reason="needs /dev/full")
def test_a_device_that_is_full_is_told_in_a_sentence(tmp_path):
    from tisoft.whole_files import Unwritable, refusal

    full = os.open("/dev/full", os.O_WRONLY)
    with pytest.raises(OSError, match="No space left") as caught:
        os.write(full, b"x")
    os.close(full)
    told = refusal(tmp_path / "a.csv", caught.value)
    assert isinstance(told, Unwritable) and "the disk is full; make room" in str(told)
