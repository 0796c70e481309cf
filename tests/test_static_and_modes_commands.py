"""tisoft static and tisoft modes, as a user calls them."""

import json

import meshio
import pytest

from tisoft.cli import main

BEAM = """
gravity = [0.0, 0.0, -9.81]
[[body]]
name = "beam"
young = 1e6
poisson = 0.3
density = 1000.0
[body.mesh]
box = {{ size = [1.0, 0.2, 0.2], cells = [10, 2, 2] }}
[[body.pin]]
where = {{ {pin} }}
[[probe]]
name = "tip"
body = "beam"
point = [1.0, 0.1, 0.1]
{more}
"""
CLAMP = "box = [[-1e-6, -1, -1], [1e-6, 1, 1]]"


@pytest.fixture
def beam(tmp_path):
    def write(pin=CLAMP, more=""):
        path = tmp_path / "beam.toml"
        path.write_text(BEAM.format(pin=pin, more=more))
        return str(path)

    return write


def test_static_finds_the_reference_deflection(beam, capsys):
    """REFERENCES A4, five 10x2x2."""
    assert main(["static", beam(), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["status"] == "done"
    assert result["load_factor"] == 1.0
    moved = result["probes"]["tip"]["displacement"]
    assert moved == pytest.approx([-0.03372279, 0.0, -0.24285602], abs=1e-8)
    assert result["energy"]["elastic"] == pytest.approx(19.2598482, rel=1e-8)


def test_static_writes_whole_files(beam, tmp_path, capsys):
    assert main(["static", beam(), "-o", str(tmp_path / "out")]) == 0
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"summary.json", "probes.csv", "energy.csv", "equilibrium.vtu", "tisoft.json"}
    assert len(meshio.read(tmp_path / "out" / "equilibrium.vtu").points) == 99
    assert "displacement" in capsys.readouterr().out


def test_load_past_the_limit_has_no_equilibrium_and_exit_code_4(beam, capsys):
    """REFERENCES A1.2: St.VK softens at a nominal stress of 0.19245 E."""
    press = (
        "[[body.load]]\nwhere = { box = [[0.999999, -1, -1], [2, 1, 1]] }\ntraction = [-4e5, 0, 0]"
    )
    assert main(["static", beam(more=press), "--set", "gravity=[0,0,0]", "--json"]) == 4
    out, err = capsys.readouterr()
    result = json.loads(out)
    assert result["status"] == "no equilibrium"
    assert 0.0 < result["load_factor"] < 1.0
    assert err.startswith("tisoft: error: ")
    assert "Traceback" not in err


def test_modes_tells_the_reference_frequencies(beam, capsys):
    """REFERENCES A3, five 10x2x2, lumped."""
    assert main(["modes", beam(), "-n", "3", "--json"]) == 0
    frequencies = json.loads(capsys.readouterr().out)["frequencies"]
    assert frequencies == pytest.approx([1.211898, 1.211898, 5.289875], rel=1e-6)


def test_a_shape_becomes_a_film(beam, tmp_path, capsys):
    film = tmp_path / "swing.gif"
    assert main(["modes", beam(), "-n", "1", "-o", str(film), "--size", "96x64"]) == 0
    assert film.stat().st_size > 1000


@pytest.mark.parametrize(
    ("options", "problem"),
    [(["-n", "0"], "-n is 0"), (["--shape", "9"], "--shape is 9")],
)
def test_modes_refuses_impossible_numbers(beam, capsys, options, problem):
    assert main(["modes", beam(), *options]) == 2
    assert problem in capsys.readouterr().err
