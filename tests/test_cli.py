"""The command line: what it prints, writes and refuses, and the codes it ends with."""

import csv
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tisoft.cli import main
from tisoft.errors import Diverged
from tisoft.geometry.files import read_mesh
from tisoft.observers.progress import Progress
from tisoft.simulation import Simulation

SCENE = """
duration = 0.1
frame_rate = 50

[[body]]
name = "beam"
young = 1e5
poisson = 0.3
density = 1000.0
phi = 5.0
eta = 5.0

[body.mesh]
box = { size = [0.5, 0.2, 0.2], cells = [3, 1, 1] }

[[body.pin]]
where = { box = [[-1e-6, -1, -1], [1e-6, 1, 1]] }

[[probe]]
name = "tip, end"
body = "beam"
point = [0.5, 0.2, 0.2]
"""
NET = """
duration = 0.1

[[body]]
name = "net"
model = "mass-spring"
stiffness = 100.0
node_mass = 0.01

[body.mesh]
cloth = { size = [1, 1], cells = [3, 3], diagonals = false }
"""
RESULT_KEYS = {
    *("status", "time", "frames", "substeps", "step", "step_range", "stable_step"),
    *("limiting_element", "nodes", "elements", "springs", "wall_seconds", "compile_seconds"),
    *(
        "start_seconds",
        "setup_seconds",
        "element_substeps_per_second",
        "real_time_factor",
        "arch",
        "precision",
    ),
    *("energy", "probes", "recoveries", "warnings"),
}
ENERGY_KEYS = {"kinetic", "elastic", "gravity", "dissipated", "external_work", "error"}


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "beam.toml"
    path.write_text(SCENE, encoding="utf-8")
    return str(path)


@pytest.fixture
def net(tmp_path):
    path = tmp_path / "net.toml"
    path.write_text(NET, encoding="utf-8")
    return str(path)


def rows_of(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.reader(file))


def pixels(path):
    with Image.open(path) as image:
        return np.asarray(image)


def test_without_arguments_it_helps(capsys):
    assert main([]) == 0
    told = capsys.readouterr().out
    for command in ("demo", "run", "render", "check", "bench"):
        assert f"    {command} " in told
        assert main([command, "--help"]) == 0
    assert main(["--version"]) == 0
    assert "tisoft" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["swim"], "invalid choice: 'swim'"),
        (["--json", "run", "{scene}"], "options come after the command"),
        (["run"], "SCENE"),
        (["run", "nowhere.toml"], "nowhere.toml is not found"),
        (["run", "{scene}", "--arch", "abacus"], "invalid choice: 'abacus'"),
        (["run", "{scene}", "--precision", "f16"], "invalid choice: 'f16'"),
        (["run", "{scene}", "--set", "body.0.yung=1"], "did you mean young?"),
        (["run", "{scene}", "--set", "young"], "it must be KEY=VALUE"),
        (["run", "{scene}", "--set", "step=0.5"], "is above the stable limit"),
        (["run", "{scene}", "-o", "{scene}"], "is a file, and results need a folder"),
        (["run", "{scene}", "-o", "{scene}/out"], "cannot be written"),
        (["run", "{scene}", "--save-every", "2"], "add -o DIR"),
        (["run", "{scene}", "--save-every", "-2", "-o", "out"], "give a number of frames"),
        (["render", "{scene}"], "-o/--output"),
        (["render", "{scene}", "-o", "film.avi"], ".avi is none of .mp4"),
        (["render", "{scene}", "-o", "{scene}/film.mp4"], "cannot be written"),
        (["render", "{scene}", "-o", "film.mp4", "--size", "big"], "write WIDTHxHEIGHT"),
        (["render", "{scene}", "-o", "film.mp4", "--size", "4x4"], "render.size[0] = 4 must be"),
        (["render", "{net}", "-o", "net.png", "--color", "stress"], "colour by strain"),
        (["check", "{scene}", "--picture", "x.bmp"], ".bmp is none of"),
        (["demo", "elephant"], "choose one of creature"),
        (["bench", "--seconds", "-1"], "give a time above 0"),
    ],
)
def test_a_mistake_is_told_in_one_sentence(
    arguments, told, scene, net, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    code = main([argument.format(scene=scene, net=net) for argument in arguments])
    out, error = capsys.readouterr()
    assert code == 2
    assert out == ""
    assert error.startswith("tisoft: error: ") and error.count("\n") == 1
    assert told in error
    assert {path.name for path in tmp_path.iterdir()} <= {"beam.toml", "net.toml", "out"}


def test_run_prints_one_json_object(scene, capsys):
    assert main(["run", scene, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert set(result) == RESULT_KEYS
    assert result["status"] == "done"
    assert result["time"] == pytest.approx(0.1)
    assert result["frames"] == 5
    assert result["elements"] == 15 and result["nodes"] == 16
    assert result["step_range"][0] <= result["step"] <= result["step_range"][1]
    assert result["step"] <= result["stable_step"]
    assert set(result["limiting_element"]) == {"body", "element", "kind", "reason"}
    assert set(result["energy"]) == ENERGY_KEYS
    work = result["elements"] * result["substeps"] / result["wall_seconds"]
    assert result["element_substeps_per_second"] == pytest.approx(work)
    tip = result["probes"]["tip, end"]
    assert tip["node"] == 15
    assert tip["position"][1] == pytest.approx(0.2 + tip["displacement"][1])
    assert tip["displacement"][1] < 0.0 and tip["velocity"][1] < 0.0


def test_run_writes_tables_with_a_row_per_frame(scene, tmp_path, capsys):
    out = tmp_path / "deep" / "out"
    assert main(["run", scene, "-o", str(out), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert json.loads((out / "summary.json").read_text(encoding="utf-8")) == printed
    probes, energy = rows_of(out / "probes.csv"), rows_of(out / "energy.csv")
    assert probes[0] == ["time", "tip, end.x", "tip, end.y", "tip, end.z"]
    assert set(energy[0]) == {"time", *ENERGY_KEYS}
    assert len(probes) == len(energy) == 7
    assert [float(x) for x in probes[1]] == [0.0, 0.5, 0.2, 0.2]
    assert [float(x) for x in probes[-1][1:]] == printed["probes"]["tip, end"]["position"]
    assert sorted(path.name for path in out.iterdir()) == [
        "checkpoint.npz",
        "energy.csv",
        "probes.csv",
        "summary.json",
        "tisoft.json",
    ]


def test_run_saves_states(scene, tmp_path):
    out = tmp_path / "out"
    assert main(["run", scene, "-o", str(out), "--save-every", "1", "--quiet"]) == 0
    assert main(["run", scene, "-o", str(out), "--save-every", "2", "--quiet"]) == 0
    saved = sorted(path.name for path in (out / "frames").iterdir())
    assert saved == ["frame_00000.vtu", "frame_00002.vtu", "frame_00004.vtu"]
    assert all(name in (out / "frames.pvd").read_text(encoding="utf-8") for name in saved)
    assert len(read_mesh(out / "frames" / saved[-1]).tets) == 15


def test_settings_and_precision_reach_the_run(scene, capsys):
    run = ["run", scene, "--json", "--precision", "f64", "--set", "duration=0.02"]
    assert main([*run, "--set", "body.0.young=1e6"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["precision"] == "f64"
    assert result["frames"] == 1


def test_interruption_ends_between_frames_with_whole_files(scene, tmp_path, monkeypatch, capsys):
    def press(self, frame):
        if frame.index == 3:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Progress, "on_frame", press)
    out = tmp_path / "out"
    assert main(["run", scene, "-o", str(out), "--json"]) == 130
    told, error = capsys.readouterr()
    assert json.loads(told)["status"] == "interrupted"
    assert json.loads(told)["frames"] == 3
    assert error.count("\n") == 1
    assert len(rows_of(out / "probes.csv")) == len(rows_of(out / "energy.csv")) == 5
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_failed_simulation_ends_with_3_and_keeps_the_good_frames(
    scene, tmp_path, monkeypatch, capsys
):
    make = Simulation.make_frame

    def fail(self, **asked):
        if self.frame == 2:
            raise Diverged("frame 2 could not be carried by any step")
        return make(self, **asked)

    monkeypatch.setattr(Simulation, "make_frame", fail)
    out = tmp_path / "out"
    assert main(["run", scene, "-o", str(out), "--json"]) == 3
    told, error = capsys.readouterr()
    assert json.loads(told)["status"] == "diverged"
    assert error == "tisoft: error: frame 2 could not be carried by any step\n"
    assert len(rows_of(out / "probes.csv")) == 4
    film = tmp_path / "film.gif"
    assert main(["render", scene, "-o", str(film), "--size", "32x32"]) == 3
    assert not film.exists()


def test_missing_libx11_is_told_with_its_remedy(scene, tmp_path):
    fake = tmp_path / "taichi.py"
    fake.write_text("raise ImportError('libX11.so.6: cannot open shared object file')")
    paths = os.pathsep.join([str(tmp_path), str(Path(__file__).parents[1])])
    done = subprocess.run(
        [sys.executable, "-m", "tisoft", "run", scene],
        env=os.environ | {"PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "apt-get install -y libx11-6" in done.stderr


def test_check_tells_what_sets_the_step(scene, tmp_path, capsys):
    picture = tmp_path / "check.png"
    small = ["--set", "render.size=[48, 32]"]
    assert main(["check", scene, "--json", "--picture", str(picture), *small]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["element_bound"] <= result["stable_step"]
    assert result["limiting_element"]["body"] == "beam"
    assert result["damping_cost"] >= 1.0
    assert result["estimated_real_time_factor"] > 0.0
    assert result["zero_energy_modes"] == {} and result["in_plane"] == {}
    mesh = result["mesh"]["beam"]
    assert mesh["nodes"] == 16 and mesh["elements"] == 15 and mesh["pieces"] == 1
    assert mesh["volume"] == pytest.approx(0.5 * 0.2 * 0.2)
    assert 0.0 < mesh["worst_quality"] <= 1.0 and 0 <= mesh["worst_element"] < 15
    assert pixels(picture).shape == (32, 48, 3)
    assert main(["check", scene]) == 0
    assert "stable limit" in capsys.readouterr().out


def test_check_counts_the_mechanisms_of_a_net_without_diagonals(net, tmp_path, capsys):
    picture = tmp_path / "net.png"
    small = ["--set", "render.size=[48, 32]"]
    assert main(["check", net, "--json", "--picture", str(picture), *small]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["in_plane"] == {"net": 5}  # 2n - 1 of an n x n grid
    assert any("mechanisms" in warning for warning in result["warnings"])
    assert result["limiting_element"]["kind"] == "spring"
    assert np.ptp(pixels(picture)) > 50


def test_check_warns_of_what_surprises(scene, capsys):
    def warnings(*settings):
        assert main(["check", scene, "--json", *(f"--set={s}" for s in settings)]) == 0
        return " | ".join(json.loads(capsys.readouterr().out)["warnings"])

    assert "linear tets lock" in warnings("body.0.poisson=0.49")
    assert "brakes rigid motion" in warnings("body.0.point_damping=1.0")
    plane = "obstacle=[{ plane = { point = [0, 0.1, 0], normal = [0, 1, 0] } }]"
    assert "8 nodes inside obstacle[0]" in warnings(plane)


def test_bench_reports_speed(capsys):
    one = ["--sizes", "XS", "--models", "mass-spring", "--seconds", "0.02", "--no-compile"]
    assert main(["bench", "--json", *one]) == 0
    (row,) = json.loads(capsys.readouterr().out)["results"]
    assert row["elements"] > 240  # edges of 240 tets
    per_substep = 1e-6 * row["microseconds_per_substep"]
    assert row["element_substeps_per_second"] == pytest.approx(row["elements"] / per_substep)
    assert row["threads"] >= 1
    assert main(["bench", *one]) == 0
    assert "mass-spring" in capsys.readouterr().out


@pytest.mark.slow
def test_bench_times_compiling_cold_and_warm():
    from tisoft.bench import compile_seconds

    found = compile_seconds("mass-spring")
    assert found["cold"] > found["warm"] > 0.0
