"""Sweeps: every combination once, whatever ends the program, and the same rows on any workers."""

import os
import signal
import subprocess
import sys
import time

import pytest

from tisoft import cli
from tisoft.errors import SceneError
from tisoft.sweeping import cluster
from tisoft.sweeping.plan import axes_of, axis_of, plan_of, split
from tisoft.sweeping.sweep import sweep
from tisoft.sweeping.work import TIMES

PENDULUM = """
duration = 0.5
integrator = "velocity-verlet"
[[body]]
name = "mass"
model = "mass-spring"
stiffness = 50.0
node_mass = 0.2
springs = [[0, 1]]
[body.mesh]
points = [[0, 0, 0], [0, -1, 0]]
[[body.pin]]
where = { nodes = [0] }
[[probe]]
name = "end"
body = "mass"
node = 1
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "pendulum.toml"
    path.write_text(PENDULUM)
    return path


def steady(rows):
    """The rows without what the clock decides."""
    return [{k: v for k, v in row.items() if k not in TIMES} for row in rows]


def test_values_are_split_at_commas_outside_of_brackets():
    assert split("[10,2,2],[20,4,4]") == ["[10,2,2]", "[20,4,4]"]
    assert split("linear, 'a,b'") == ["linear", "'a,b'"]


def test_draws_fill_a_range_of_decades_evenly_and_are_the_same_again():
    axes = [axis_of("young=1e4..1e6"), axis_of("n=1..3")]
    plan = plan_of(axes, random=400, seed=1)
    values = [float(row[0]) for row in plan.rows]
    assert all(1e4 <= v <= 1e6 for v in values)
    assert 160 < sum(v < 1e5 for v in values) < 240
    assert {row[1] for row in plan.rows} == {"1", "2", "3"}
    assert plan_of(axes, random=400, seed=1) == plan


@pytest.mark.parametrize(
    "over, told",
    [("stifness=1,2", "is not a key"), ("body.7.stiffness=1", "out of range"),
     ("stiffness=1..9", "--random"), ("stiffness", "KEY=V1"), ("stiffness=9..1", "ascend"),
     ("stiffness=,", "KEY=V1"), ("stiffness=1,,2", "value 2 of 3 is empty"),
     ("stiffness=1,", "value 2 of 2 is empty"), ("stiffness=1..1e400", "at most"),
     ("stiffness=1..9 --random 9999999", "1,000,000 rows"),
     ("stiffness=1..9 --random 2 --seed -1", "--seed is -1")],
)  # fmt: skip
def test_a_wrong_axis_is_told_before_anything_runs(scene, tmp_path, capsys, over, told):
    out = str(tmp_path / "out")
    assert cli.main(["sweep", str(scene), "-o", out, "--over", *over.split()]) == 2
    error = capsys.readouterr().err
    assert told in error and error.count("\n") == 1


def test_a_failure_is_a_row_with_its_sentence(scene):
    rows = sweep(scene, {"stiffness": [50.0, -1.0]}).rows
    assert [row["status"] for row in rows] == ["done", "failed"]
    assert "stiffness" in rows[1]["error"]
    # Half a second of the oscillator of 50 N/m and 0.2 kg: y = −1 − g/ω² (1 − cos ωt)
    assert rows[0]["probes.end.position.1"] == pytest.approx(-1.0413, abs=1e-3)


def test_a_sweep_of_which_no_row_is_done_has_failed(scene, tmp_path, capsys):
    command = ["sweep", str(scene), "-o", str(tmp_path / "out"), "--over"]
    assert cli.main([*command, "stiffness=-1,-2"]) == 2
    assert "none of 2 rows is done; row 0: " in capsys.readouterr().err
    assert (tmp_path / "out" / "sweep.csv").read_text().count("must be above 0 N/m") == 2


def test_a_killed_sweep_goes_on_without_losing_or_repeating_a_row(scene, tmp_path):
    out = tmp_path / "out"
    over = "stiffness=" + ",".join(str(20 + k) for k in range(200))
    command = [sys.executable, "-m", "tisoft", "sweep", str(scene), "--over", over, "-o", str(out)]
    journal = out / "rows.jsonl"
    child = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    while not journal.exists() or journal.read_bytes().count(b"\n") < 3:
        assert child.poll() is None
        time.sleep(0.01)
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    before = journal.read_bytes()
    journal.write_bytes(before + b'{"key": "torn')
    assert cli.main(command[3:]) == 0
    assert journal.read_bytes().startswith(before[: before.rfind(b"\n") + 1])
    lines = journal.read_text().splitlines()
    assert len(lines) == 200 and len(set(lines)) == 200
    rows = (out / "sweep.csv").read_text().splitlines()
    assert [row.split(",")[:2] for row in rows[1:]] == [[str(k), str(20 + k)] for k in range(200)]


def suicide(job):
    """Ends the worker that computes job 3 for the first time."""
    path, number = job
    if number == 3 and not path.exists():
        path.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


@pytest.mark.filterwarnings("ignore")
def test_workers_give_the_same_rows_and_may_die(scene, tmp_path):
    pytest.importorskip("distributed")
    over = {"stiffness": [30.0, 40.0, 50.0, -1.0]}
    rows = sweep(scene, over, workers=2).rows
    assert steady(rows) == steady(sweep(scene, over).rows)
    jobs = [(tmp_path / "died", k) for k in range(8)]
    assert sorted(cluster.each(suicide, jobs, workers=2)) == [(k, k * k) for k in range(8)]


@pytest.mark.filterwarnings("ignore")
def test_a_scheduler_that_is_not_there_is_told(scene, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(cluster, "PATIENCE", 1.0)
    with pytest.raises(SceneError, match="does not answer"):
        sweep(scene, {"stiffness": [1.0]}, scheduler="tcp://127.0.0.1:9")


def test_python_values_become_the_texts_of_scene_files():
    plan = plan_of(axes_of({"body.0.mesh.box.cells": [[4, 1, 1]], "model": ["linear"]}))
    assert plan.rows == (("[4, 1, 1]", '"linear"'),)
    assert plan.settings(plan.rows[0], 2) == [
        "body.0.mesh.box.cells=[4, 1, 1]", 'body.0.model="linear"', 'body.1.model="linear"',
    ]  # fmt: skip
