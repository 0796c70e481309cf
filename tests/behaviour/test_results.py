"""What a run leaves behind says what happened in it: tables, states, summary, and its few lines."""

import csv
import json
import re
from xml.etree import ElementTree

import numpy as np
import pytest

import tisoft as ts
from tisoft.cli import main
from tisoft.geometry.files import read_mesh

SCENE = """
duration = 0.3
frame_rate = 20
precision = "f64"

[[body]]
name = "bar"
young = 1e4
poisson = 0.0
density = 1000.0
eta = 5.0

[body.mesh]
box = { size = [1, 0.2, 0.2], cells = [5, 1, 1] }

[[body.pin]]
where = { box = [[-1e-6, -9, -9], [1e-6, 9, 9]] }

[[body.load]]
where = { box = [[0.999, -9, -9], [9, 9, 9]] }
force = [2.0, 0, 0]

[[body]]
name = "net"
model = "mass-spring"
stiffness = 10.0
node_mass = 0.01
velocity = [0, 0, 1]

[body.mesh]
cloth = { size = [1, 1], cells = [2, 2] }
translate = [0, 3, 0]

[[probe]]
name = "tip"
body = "bar"
point = [1, 0.2, 0.2]

[[probe]]
name = "rim"
body = "net"
point = [0, 3, 0]
"""

STAR = """
gravity = [0, 0, 0]
precision = "f64"
step = 0.0127
frame_rate = 8.0
duration = 0.25

[[body]]
name = "star"
model = "mass-spring"
stiffness = 100.0
node_mass = 0.01
velocity = [0, 0, 2000]
springs = [[0, 1], [0, 2], [0, 3], [0, 4]]

[body.mesh]
points = [[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]

[[body.pin]]
where = { nodes = [1, 2, 3, 4] }
"""


def scene_in(folder, text=SCENE):
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def rows_of(path):
    header, *rows = csv.reader(path.read_text(encoding="utf-8").splitlines())
    return header, np.array([[float(cell) for cell in row] for row in rows])


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """The folder of a run, and the same run frame by frame."""
    folder = tmp_path_factory.mktemp("results")
    scene = scene_in(folder)
    out = folder / "out"
    assert main(["run", scene, "-o", str(out), "--save-every", "4", "--quiet"]) == 0
    sim = ts.Simulation(ts.load_scene(scene), ledger=True)
    frames = []
    for frame in sim.frames():
        bodies = sim.scene.bodies
        frames.append(
            {
                "time": frame.time,
                "energy": sim.energy(),
                "positions": [frame.positions(body) for body in bodies],
                "velocities": [frame.velocities(body) for body in bodies],
            }
        )
    return out, sim, frames


def test_energies_of_every_frame(done):
    out, _, frames = done
    header, rows = rows_of(out / "energy.csv")
    names = ["kinetic", "elastic", "gravity", "dissipated", "external_work", "error"]
    names += ["contact", "friction"]  # two bodies may touch
    assert header == ["time", *names]
    expected = [[f["time"], *(f["energy"][name] for name in names)] for f in frames]
    np.testing.assert_allclose(rows, expected, rtol=1e-12, atol=1e-15)
    assert rows[-1, 5] > 0.0  # the load has done work
    assert rows[-1, 4] > 0.0 and rows[-1, 3] < 0.0


def test_probes_of_every_frame(done):
    out, _, frames = done
    header, rows = rows_of(out / "probes.csv")
    assert header == ["time", *(f"{name}.{axis}" for name in ("tip", "rim") for axis in "xyz")]
    tip, rim = frames[0]["positions"]
    here = int(np.argmin(np.linalg.norm(tip - [1, 0.2, 0.2], axis=1)))
    there = int(np.argmin(np.linalg.norm(rim - [0, 3, 0], axis=1)))
    expected = [[f["time"], *f["positions"][0][here], *f["positions"][1][there]] for f in frames]
    np.testing.assert_allclose(rows, expected, rtol=1e-12)


def test_every_nth_state_with_its_time(done):
    out, _, frames = done
    names = ["frame_00000.vtu", "frame_00004.vtu"]
    assert sorted(path.name for path in (out / "frames").iterdir()) == names
    sets = ElementTree.parse(out / "frames.pvd").getroot().findall("Collection/DataSet")
    assert [entry.get("file") for entry in sets] == [f"frames/{name}" for name in names]
    assert [float(entry.get("timestep")) for entry in sets] == pytest.approx([0.0, 0.2])
    points = read_mesh(out / "frames" / names[1]).points
    np.testing.assert_allclose(points, frames[4]["positions"][0], atol=1e-12)


def test_the_summary_is_that_of_the_last_frame(done):
    out, sim, frames = done
    told = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert told["status"] == "done"
    assert (told["frames"], told["time"]) == (6, pytest.approx(0.3))
    assert told["substeps"] == sim.substeps
    assert told["step"] == sim.steps[0]
    assert told["step_range"] == [min(sim.steps), max(sim.steps)]
    assert told["energy"] == pytest.approx(frames[-1]["energy"])
    assert (told["nodes"], told["elements"]) == (24 + 9, 25)
    assert told["springs"] == len(sim.scene.bodies[1].springs())
    for name, body in (("tip", 0), ("rim", 1)):
        probe = told["probes"][name]
        moved = frames[-1]["positions"][body] - frames[0]["positions"][body]
        node = probe["node"]
        assert probe["position"] == pytest.approx(frames[-1]["positions"][body][node])
        assert probe["displacement"] == pytest.approx(moved[node])
        assert probe["velocity"] == pytest.approx(frames[-1]["velocities"][body][node])


def test_a_run_of_no_frames_tells_the_step_it_would_take(tmp_path, capsys):
    assert main(["run", scene_in(tmp_path), "--json", "--set", "duration=0.01"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["frames"], told["substeps"], told["time"]) == (0, 0, 0.0)
    low, high = told["step_range"]
    assert low == told["step"] == high
    assert 0.0 < low <= told["stable_step"]
    assert 0.05 / low == pytest.approx(round(0.05 / low))  # it divides a frame


def test_frames_taken_back_are_told(tmp_path, capsys):
    assert main(["run", scene_in(tmp_path, STAR), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["elements"] == 0 and told["springs"] == 4
    work = told["springs"] * told["substeps"] / told["wall_seconds"]
    assert told["element_substeps_per_second"] == pytest.approx(work)
    (first, second) = told["recoveries"]
    assert (first["time"], second["time"]) == pytest.approx((0.0, 0.125))
    for recovery in (first, second):
        assert recovery["step_before"] == pytest.approx(0.0125)
        assert recovery["step_after"] == pytest.approx(0.00625)
        assert "star" in recovery["element"] and "spring" in recovery["element"]
        assert recovery["cause"]


def test_the_few_lines_say_what_the_object_says(tmp_path, capsys):
    scene = scene_in(tmp_path)
    assert main(["run", scene]) == 0
    text = capsys.readouterr().out
    assert main(["run", scene, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    head = text.splitlines()[0]
    assert head.startswith(f"0.3 s in 6 frames, {told['substeps']} substeps of ")
    low, high = (f"{1e3 * step:.3g}" for step in told["step_range"])
    assert f" of {low if low == high else f'{low} to {high}'} ms: " in head
    wall, factor = re.search(r"ms: ([\d.]+) s, (\S+) x real time", head).groups()
    assert float(wall) * float(factor) == pytest.approx(0.3, rel=0.1)
    for line, name in zip(text.splitlines()[1:3], ("tip", "rim"), strict=True):
        assert name in line
        numbers = re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", line.split(" is at ")[1])
        probe = told["probes"][name]
        assert [float(n) for n in numbers] == pytest.approx(
            [*probe["position"], *probe["displacement"]], rel=1e-4
        )


def test_the_few_lines_tell_a_step_that_did_not_change_once(tmp_path, capsys):
    fixed = ["--set", "step=1e-3", "--set", "duration=0.05"]
    assert main(["run", scene_in(tmp_path), *fixed]) == 0
    assert ", 50 substeps of 1 ms: " in capsys.readouterr().out
