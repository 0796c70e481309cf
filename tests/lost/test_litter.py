"""Half-written files of killed programs go; those of living ones stay."""

import subprocess
import sys
import time

import pytest
from stopping import wait_for

from tisoft.cli import main
from tisoft.whole_files import lock, part_name, sweep, unlock, written


def parts(folder):
    return [path for path in folder.iterdir() if path.name.endswith(".part")]


@pytest.fixture
def killed(scene, tmp_path, start):
    """A folder where a render of film.mp4 was killed."""
    child = start("render", scene, "-o", "film.mp4", "--set", "duration=2000")
    wait_for(lambda: parts(tmp_path), child)
    child.kill()
    child.wait()
    assert len(parts(tmp_path)) == 1
    return tmp_path


def test_the_next_render_of_the_name_sweeps(killed, scene):
    assert main(["render", scene, "-o", str(killed / "other.gif"), "--quiet"]) == 0
    assert len(parts(killed)) == 1
    assert main(["render", scene, "-o", str(killed / "film.mp4"), "--quiet"]) == 0
    assert sorted(path.name for path in killed.iterdir()) == ["beam.toml", "film.mp4", "other.gif"]


def test_check_sweeps(killed, scene, capsys):
    assert main(["check", scene]) == 0
    assert "removed 1 hidden files" in capsys.readouterr().out
    assert not parts(killed)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such lock")
def test_what_a_living_program_writes_stays(scene, tmp_path, start):
    child = start("render", scene, "-o", "film.mp4", "--set", "duration=2000")
    wait_for(lambda: parts(tmp_path), child)
    assert main(["render", scene, "-o", str(tmp_path / "film.mp4"), "--quiet"]) == 0
    assert main(["check", scene, "--quiet"]) == 0
    assert len(parts(tmp_path)) == 1 and child.poll() is None


def test_files_of_others_are_no_litter(tmp_path):
    for name in (".film.mp4.part", ".tisoft-x-y.part", "tisoft-00000000-00000000.part"):
        (tmp_path / name).write_text("the user's")
    assert sweep(tmp_path) == 0
    assert len(list(tmp_path.iterdir())) == 3


def test_an_error_while_a_file_is_written_leaves_the_older_one(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("before")
    with pytest.raises(RuntimeError), written(path) as file:
        file.write(b"half")
        raise RuntimeError
    assert path.read_text() == "before" and list(tmp_path.iterdir()) == [path]


def test_the_longest_name_that_a_file_may_have(tmp_path):
    path = tmp_path / ("a" * 255)
    with written(path) as file:
        file.write(b"whole")
    assert path.read_bytes() == b"whole"


def test_a_lock_ends_with_its_process(tmp_path):
    part = part_name(tmp_path / "x")
    part.touch()
    program = (
        f"import time; from tisoft.whole_files import lock; from pathlib import Path; "
        f"lock(Path({str(part)!r})); print('locked', flush=True); time.sleep(60)"
    )
    child = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE)
    child.stdout.readline()
    assert lock(part) is None and sweep(tmp_path) == 0
    child.kill()
    child.communicate()
    end = time.monotonic() + 10.0
    while (handle := lock(part)) is None and time.monotonic() < end:
        time.sleep(0.01)
    unlock(handle)
    assert sweep(tmp_path) == 1
