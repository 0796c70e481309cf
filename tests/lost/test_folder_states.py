"""Commands in any order into one folder: nothing is mixed, and what is the user's stays."""

import os
import random

import pytest
from stopping import press_at

from tisoft.cli import main
from tisoft.manifest import MANIFEST, read_manifest

LINES = [
    ["run", "--save-every", "3"],
    ["run"],
    ["run", "--set", "duration=0.3"],
    ["run", "--resume"],
    ["run", "--resume", "--set", "duration=0.24"],
    ["static"],
    ["modes", "-n", "1"],
    ["render", "--set", "duration=0.06"],
]
OWN = ("notes.txt", "frames/frame_00077.png", "frame_00500.png", "frames/frame_00004.vtu.bak")
TAKEN = ("probes.csv", "summary.json", "frame_00001.png", "frames/frame_00003.vtu", "tisoft.json")


def content(folder):
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def put(folder, name, own):
    """A file of the user's, unless the manifest has its name; without manifest all files are."""
    named = named_in(folder)
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"the user's {name}")
    if name == MANIFEST:
        own |= content(folder)
    elif name not in named:
        own[name] = path.read_bytes()


def named_in(folder):
    """The files that the manifest names."""
    manifest = read_manifest(folder, lenient=True)
    return {*manifest.names(), MANIFEST} if manifest else set()


def try_command(chance, scene, folder, monkeypatch):
    """One command, perhaps interrupted, damaged or in the way of a user's file."""
    line = list(chance.choice(LINES))
    if chance.random() < 0.4 and "--resume" not in line:
        line.append("--overwrite")
    with monkeypatch.context() as patch:
        if chance.random() < 0.3:
            press_at(patch, chance.randrange(12), 2)
        return line, main([line[0], scene, "-o", str(folder), "--quiet", *line[1:]])


def assert_consistent(folder, own):
    """What lies there is the user's, or named by the manifest."""
    there = content(folder)
    named = named_in(folder)
    assert set(there) <= named | set(own)
    for name in set(own) - named:
        assert there[name] == own[name]


def states(seed, scene, folder, monkeypatch):
    chance, own = random.Random(seed), {}
    folder.mkdir()
    for _ in range(6):
        if chance.random() < 0.4:
            put(folder, chance.choice(OWN), own)
        if chance.random() < 0.1:
            put(folder, chance.choice(TAKEN), own)
        before = content(folder)
        line, code = try_command(chance, scene, folder, monkeypatch)
        assert code in (0, 2, 130), line
        if code == 2:
            assert content(folder) == before, line
        elif "--overwrite" in line:
            for name in named_in(folder) & set(own):
                del own[name]
        assert_consistent(folder, own)


@pytest.mark.parametrize("seed", range(6))
def test_a_folder_in_any_state(seed, scene, tmp_path, monkeypatch):
    states(seed, scene, tmp_path / "out", monkeypatch)


@pytest.mark.slow
def test_many_folders_in_any_state(scene, tmp_path, monkeypatch):
    first = int(os.environ.get("TISOFT_SEED", "1")) * 1000
    for seed in range(first, first + 60):
        states(seed, scene, tmp_path / str(seed), monkeypatch)
