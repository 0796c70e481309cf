"""The creature of the demos is what its script makes."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tisoft.geometry.files import read_mesh
from tisoft.geometry.quality import quality

ASSETS = Path(__file__).parents[2] / "assets"


def test_creature_is_small_whole_and_of_good_tets():
    path = ASSETS / "creature.vtu"
    mesh = read_mesh(path)
    assert path.stat().st_size < 400_000
    assert 500 <= len(mesh.tets) <= 2000
    assert mesh.pieces == 1
    assert mesh.flipped == mesh.dropped_nodes == 0
    assert quality(mesh).min() > 0.2
    assert mesh.points[:, 1].min() == pytest.approx(-0.01, abs=0.005)  # inflated: it holds its skin
    assert mesh.points[:, 1].max() == pytest.approx(0.72, abs=0.02)


@pytest.mark.slow
def test_script_makes_the_creature_anew(tmp_path):
    script = (ASSETS / "make_creature.py").read_text(encoding="utf-8")
    (tmp_path / "make_creature.py").write_text(script, encoding="utf-8")
    subprocess.run(
        [sys.executable, tmp_path / "make_creature.py"],
        check=True,
        cwd=ASSETS.parent,
        env={"PYTHONPATH": str(ASSETS.parent)},
        capture_output=True,
    )
    made, kept = read_mesh(tmp_path / "creature.vtu"), read_mesh(ASSETS / "creature.vtu")
    assert np.array_equal(made.tets, kept.tets)
    assert made.points == pytest.approx(kept.points, abs=2e-5)
    skins = [(folder / "creature.obj").read_text().splitlines() for folder in (tmp_path, ASSETS)]
    assert abs(len(skins[0]) - len(skins[1])) <= 0.01 * len(skins[1])
