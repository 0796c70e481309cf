"""The shipped demos run, draw, and show what they say."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import tisoft as ts
from tisoft.cli import main
from tisoft.commands.demo import demos

ROOT = Path(__file__).parents[1]
SLOW = {"bowl", "cloth"}
"""Whose kernels few other tests have."""
SCENES = [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in demos()]


def test_list_names_every_demo_with_a_sentence(capsys):
    assert main(["demo", "--list", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    names = {row["name"] for row in rows}
    assert names == {"creature", "softness", "four-ways", "twist", "cloth", "nets", "bowl"}
    assert all(row["about"].endswith(".") and Path(row["file"]).is_file() for row in rows)
    assert all(row["seconds"] >= 1 for row in rows)


@pytest.mark.parametrize("name", SCENES)
def test_demo_draws_its_film_and_its_picture(name, tmp_path, capsys):
    short = ["--set", "duration=0.067", "--set", "render.samples=1", "--size", "64x48"]
    assert main(["demo", name, "-o", str(tmp_path), "--json", *short]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["frames"] == 2
    assert sorted(p.name for p in tmp_path.iterdir()) == [f"{name}.mp4", f"{name}.png"]
    with Image.open(tmp_path / f"{name}.png") as picture:
        assert np.ptp(np.asarray(picture)) > 50


def test_demo_without_a_name_is_the_creature(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["demo", "--set", "duration=0.034", "--size", "64x48"]) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["demo.mp4", "demo.png"]
    assert "demo.mp4" in capsys.readouterr().out


@pytest.mark.slow
def test_creature_squashes_stands_up_and_still_wobbles():
    scene = ts.load_scene(demos()["creature"])
    sim = ts.Simulation(scene)
    tops = [frame.positions()[:, 1].max() for frame in sim.frames()]
    rest = np.ptp(scene.bodies[0].mesh.points[:, 1])
    assert min(tops[:15]) < 0.9 * rest
    assert tops[-1] > 0.6 * rest
    assert np.abs(sim.velocities()).max() > 0.02
    assert sim.positions()[:, 1].min() > -1e-5


@pytest.mark.slow
def test_creature_is_carried_by_few_tets_and_runs_in_more_than_real_time():
    scene = ts.load_scene(demos()["creature"])
    (body,) = scene.bodies
    assert 500 <= len(body.mesh.tets) <= 2000
    assert 7000 <= len(body.skin.triangles) <= 10000
    assert (body.skin.weights.min(axis=1) < -0.25).mean() < 0.05  # little reaches beyond the tets
    sim = ts.Simulation(scene, threads=1)
    sim.run(0.5)
    # A core makes some 20 to 50 million tet-substeps a second (`tisoft bench`).
    assert len(body.mesh.tets) * sim.substeps / 0.5 < 1e7


@pytest.mark.slow
def test_softer_bears_squash_more():
    scene = ts.load_scene(demos()["softness"])
    sim = ts.Simulation(scene)
    tops = np.array([[f.positions(b)[:, 1].max() for b in scene.bodies] for f in sim.frames(0.5)])
    soft, firm, stiff = tops.min(axis=0)
    assert soft < firm - 0.05 < stiff - 0.1


@pytest.mark.slow
def test_a_net_without_diagonals_folds():
    scene = ts.load_scene(demos()["nets"])
    sim = ts.Simulation(scene)
    sim.run()
    braced, bare = (np.ptp(sim.positions(body)[:, 1]) for body in scene.bodies)
    assert bare < 0.5 * braced


@pytest.mark.slow
def test_spinning_brick_checks_itself(tmp_path):
    found = os.environ | {"PYTHONPATH": str(ROOT)}
    script = [sys.executable, ROOT / "examples" / "spinning_brick.py"]
    subprocess.run(script, check=True, cwd=tmp_path, env=found)
    assert (tmp_path / "spinning_brick.mp4").stat().st_size > 10_000


@pytest.mark.slow
def test_wheel_runs_the_demo(tmp_path):
    build = [sys.executable, "-m", "pip", "wheel", "--no-deps", "-q", "-w", str(tmp_path), ROOT]
    subprocess.run(build, check=True)
    (wheel,) = tmp_path.glob("*.whl")
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    short = ["--set", "duration=0.034", "--size", "64x48", "--quiet"]
    subprocess.run(
        [sys.executable, "-m", "tisoft", "demo", *short],
        check=True,
        cwd=tmp_path / "site",
        env={key: value for key, value in os.environ.items() if key != "PYTHONPATH"},
    )
    assert (tmp_path / "site" / "demo.mp4").is_file()
