"""Runs that are cut short, by Ctrl-C or by SIGKILL, and go on as if they had not been."""

import csv
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from tisoft import checkpoint
from tisoft.cli import main
from tisoft.observers.progress import Progress

SCENE = """
duration = {duration}
frame_rate = 50
checkpoint_every = 4
precision = "{precision}"
integrator = "{integrator}"
start = "{start}"
step = {step}

[[body]]
name = "block"
model = "{model}"
mass = "{mass}"
young = 2e5
poisson = 0.3
density = 1000.0
phi = 5.0
eta = 5.0
spin = [1, 2, 0]
pin = [{{ where = {{ nearest = [0, 0, 0] }}, velocity = [0, 0.1, 0], release = 0.1 }}]
load = [{{ where = "all", force = [9, 0, 0], ramp = 0.3 }}]

[body.mesh]
box = {{ size = [0.5, 0.2, 0.2], cells = [2, 1, 1] }}

[[body]]
name = "net"
model = "mass-spring"
stiffness = 200.0
node_mass = 0.01
damping_ratio = 0.01
damping_at = 3.0

[body.mesh]
cloth = {{ size = [0.5, 0.5], cells = [3, 3] }}
translate = [2, 1, 0]

[[obstacle]]
plane = {{ point = [0, -0.2, 0], normal = [0.1, 1, 0.3] }}
friction = 0.3

[[probe]]
name = "tip, end"
body = "block"
point = [0.5, 0.2, 0.2]
"""
PLAIN = {
    "duration": 0.4,
    "precision": "f32",
    "integrator": "symplectic-euler",
    "model": "neo-hookean",
    "mass": "lumped",
    "start": "plain",
    "step": '"auto"',
}
TIMES = ("wall_seconds", "compile_seconds", "start_seconds", "setup_seconds")
SPEEDS = ("element_substeps_per_second", "real_time_factor")


def scene_in(folder, **changes):
    path = Path(folder) / "scene.toml"
    path.write_text(SCENE.format(**PLAIN | changes), encoding="utf-8")
    return str(path)


@pytest.fixture
def scene(tmp_path):
    return scene_in(tmp_path)


def files_of(folder):
    """What a run wrote, but for the checkpoint and for how long things took."""
    found = {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(Path(folder).rglob("*"))
        if path.is_file()
    }
    found.pop("checkpoint.npz", None)
    result = json.loads(found["summary.json"])
    found["summary.json"] = {
        key: value for key, value in result.items() if key not in (*TIMES, *SPEEDS)
    }
    return found


def state_of(folder):
    content, arrays = checkpoint.read(Path(folder) / "checkpoint.npz")
    return content["numbers"]["frame"], arrays["u"].tobytes(), arrays["v"].tobytes()


@pytest.mark.parametrize(
    "changes",
    [
        {"start": "half-step", "step": 1e-3},
        {"precision": "f64", "integrator": "velocity-verlet"},
        {"model": "viscoelastic", "mass": "consistent"},
    ],
)
def test_resumed_run_writes_the_files_of_the_uninterrupted_one(changes, tmp_path):
    scene = scene_in(tmp_path, **changes)
    run = ["run", scene, "--quiet", "-o"]
    assert main([*run, str(tmp_path / "whole"), "--save-every", "3"]) == 0
    cut = str(tmp_path / "cut")
    assert main([*run, cut, "--save-every", "3", "--set", "duration=0.1"]) == 0
    assert main([*run, cut, "--resume", "--set", "duration=0.24"]) == 0
    assert main([*run, cut, "--resume"]) == 0
    assert files_of(cut) == files_of(tmp_path / "whole")
    assert state_of(cut) == state_of(tmp_path / "whole")


def test_interrupted_run_goes_on(scene, tmp_path, monkeypatch, capsys):
    def press(self, frame):
        if frame.index == 7:
            signal.raise_signal(signal.SIGINT)

    whole, cut = str(tmp_path / "whole"), str(tmp_path / "cut")
    never = ["--set", "checkpoint_every=0"]
    assert main(["run", scene, "-o", whole, "--quiet"]) == 0
    with monkeypatch.context() as patch:
        patch.setattr(Progress, "on_frame", press)
        assert main(["run", scene, "-o", cut, "--quiet", *never]) == 130
    assert "go on with --resume" in capsys.readouterr().err
    assert state_of(cut)[0] == 7
    assert main(["run", scene, "-o", cut, "--quiet", "--resume"]) == 0
    assert files_of(cut) == files_of(whole)


def test_rows_after_the_checkpoint_are_cut(scene, tmp_path):
    whole, out = tmp_path / "whole", tmp_path / "out"
    assert main(["run", scene, "-o", str(whole), "--quiet"]) == 0
    assert main(["run", scene, "-o", str(out), "--quiet", "--set", "duration=0.16"]) == 0
    with (out / "probes.csv").open("a", encoding="utf-8") as table:
        table.write("0.18,1,2,3\n0.2,1,2,3\n")
    assert main(["run", scene, "-o", str(out), "--quiet", "--resume"]) == 0
    assert files_of(out) == files_of(whole)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--set", "body.0.young=1e5"], "body[0].young = 100000.0 was 200000.0 when"),
        (["--set", "body.0.model=linear"], "body[0].model is not what it was"),
        (["--set", "body.0.mesh.box.cells=[3, 1, 1]"], "body[0].mesh is not what it was"),
        (["--set", "body.1.mesh.translate=[2, 1, 1]"], "body[1].mesh is not what it was"),
        (["--set", "body.0.pin=[]"], "body[0].pin is not what it was"),
        (["--set", "obstacle.0.friction=0.4"], "obstacle[0].friction = 0.4 was 0.3"),
        (["--set", "probe.0.name=a"], 'probe[0].name = "a" was "tip, end"'),
        (["--set", "gravity=[0, -1, 0]"], "gravity[1] = -1.0 was -9.81"),
        (["--precision", "f64"], 'precision = "f64" was "f32"'),
        (["--set", "duration=0.05"], "duration = 0.05 ends before frame 8"),
        (["--save-every", "2"], "the run so far had --save-every 0"),
    ],
)
def test_another_scene_is_not_resumed(arguments, told, done, capsys):
    scene, out = done
    before = files_of(out)
    assert main(["run", scene, "-o", out, "--resume", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and told in error
    assert files_of(out) == before


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A scene and the folder of its run, 8 frames long."""
    folder = tmp_path_factory.mktemp("done")
    scene = scene_in(folder, duration=0.16)
    assert main(["run", scene, "-o", str(folder / "out"), "--quiet"]) == 0
    return scene, str(folder / "out")


def test_resume_needs_a_checkpoint(scene, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["run", scene, "-o", str(out), "--resume"]) == 2
    assert "holds no checkpoint.npz to resume from" in capsys.readouterr().err
    assert not out.exists()
    assert main(["run", scene, "--resume"]) == 2
    assert "add -o DIR" in capsys.readouterr().err


@pytest.mark.parametrize("place", [3, 100, 400, 1000, -300, -30])
def test_damaged_checkpoint_is_told(place, done, tmp_path, capsys):
    scene, out = done
    data = bytearray((Path(out) / "checkpoint.npz").read_bytes())
    data[place] ^= 0x55
    (tmp_path / "checkpoint.npz").write_bytes(data)
    code = main(["run", scene, "-o", str(tmp_path), "--resume", "--quiet"])
    error = capsys.readouterr().err
    assert code == 2 and error.count("\n") == 1
    assert "checkpoint.npz is damaged" in error


def test_missing_rows_are_told(done, tmp_path, capsys):
    scene, out = done
    for name in ("checkpoint.npz", "probes.csv"):
        (tmp_path / name).write_bytes((Path(out) / name).read_bytes())
    with (tmp_path / "energy.csv").open("w", encoding="utf-8") as table:
        table.write("time,kinetic\n0,0\n")
    assert main(["run", scene, "-o", str(tmp_path), "--resume"]) == 2
    assert "energy.csv ends before frame 8" in capsys.readouterr().err


def test_new_run_does_not_leave_the_checkpoint_of_the_old(scene, tmp_path):
    run = ["run", scene, "-o", str(tmp_path), "--quiet"]
    assert main([*run, "--set", "duration=0.16", "--save-every", "1"]) == 0
    old = state_of(tmp_path)
    (tmp_path / "notes.txt").write_text("the user's")
    (tmp_path / ".tisoft-0a1b2c3d-0a1b2c3d.part").write_text("of a killed run")
    assert main([*run, "--set", "duration=0.04"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {
        *("scene.toml", "notes.txt", "summary.json", "probes.csv", "energy.csv"),
        *("checkpoint.npz", "tisoft.json"),
    }
    assert old[0] == 8 and state_of(tmp_path)[0] == 2


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such lock")
def test_second_run_into_a_folder_is_refused(scene, tmp_path, monkeypatch, capsys):
    codes = []

    def run_again(self, frame):
        if frame.index == 2:
            codes.append(main(["run", scene, "-o", str(tmp_path / "out")]))

    with monkeypatch.context() as patch:
        patch.setattr(Progress, "on_frame", run_again)
        assert main(["run", scene, "-o", str(tmp_path / "out"), "--quiet"]) == 0
    assert codes == [2]
    assert "another run is writing into" in capsys.readouterr().err
    assert main(["run", scene, "-o", str(tmp_path / "out"), "--quiet"]) == 0


def assert_whole(folder):
    """Every file in the folder is whole; what is not yet has a hidden name."""
    for path in Path(folder).rglob("*"):
        if path.is_dir():
            continue
        if path.name.startswith("."):
            assert path.suffix == ".part"
        elif path.suffix == ".csv":
            text = path.read_text(encoding="utf-8")
            rows = list(csv.reader(text.splitlines()))
            assert text.endswith("\n") and len({len(row) for row in rows}) == 1
            np.testing.assert_allclose([float(row[0]) for row in rows[1:]], times_of(rows))
        elif path.suffix in (".vtu", ".pvd"):
            ElementTree.parse(path)
        elif path.suffix == ".npz":
            checkpoint.read(path)
        else:
            json.loads(path.read_text(encoding="utf-8"))


def times_of(rows):
    return np.arange(len(rows) - 1) / 50.0


def killed_many_times(folder, kills, seed):
    """Kill a run and those that go on from it; then let it end, and compare."""
    scene = scene_in(folder, duration=0.2 * kills + 1.0)
    whole, out = Path(folder) / "whole", Path(folder) / "out"
    run = ["run", scene, "--quiet", "--save-every", "5", "-o"]
    # In a process that ends, which leaves its kernels in Taichi's cache for those that do not.
    assert start([*run, str(whole)], resume=False).wait() == 0
    chance = random.Random(seed)
    early = set(chance.sample(range(kills), kills // 2))
    for kill in range(kills):
        seen = has_begun(out)
        child = start([*run, str(out)], resume=(out / "checkpoint.npz").exists())
        end = time.monotonic() + 60.0
        if kill in early:  # while it starts
            end = time.monotonic() + chance.uniform(0.0, 3.0)
        while child.poll() is None and time.monotonic() < end and has_begun(out) == seen:
            time.sleep(0.001)
        time.sleep(chance.uniform(0.0, 0.1))
        child.kill()
        child.wait()
        if out.exists():
            assert_whole(out)
    assert start([*run, str(out)], resume=(out / "checkpoint.npz").exists()).wait() == 0
    assert files_of(out) == files_of(whole)
    assert state_of(out) == state_of(whole)


def has_begun(out):
    path = out / "checkpoint.npz"
    try:
        return path.stat().st_mtime_ns
    except FileNotFoundError:
        return None


def start(arguments, *, resume):
    command = [sys.executable, "-m", "tisoft", *arguments, *["--resume"] * resume]
    paths = os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    return subprocess.Popen(command, env=os.environ | {"PYTHONPATH": paths})


@pytest.mark.slow
def test_run_killed_at_random_moments_goes_on(tmp_path):
    kills = 3 * int(os.environ.get("TISOFT_THOROUGH", "1"))
    killed_many_times(tmp_path, kills, seed=int(os.environ.get("TISOFT_SEED", "2")))
