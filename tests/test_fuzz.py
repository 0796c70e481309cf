"""Whatever is given to the command line, it ends in time, with a known code and without traceback.

Scene files are valid ones with hostile changes; mesh files are valid ones with bytes changed.
TISOFT_THOROUGH multiplies what is tried, and takes every kind of body: 500 scenes and more.
"""

import contextlib
import copy
import datetime
import io
import json
import math
import os
import re
import resource
import shutil
import sys
import time
from pathlib import Path

import meshio
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tisoft import runtime, scene_mesh
from tisoft.check import report
from tisoft.cli import COMMANDS, main
from tisoft.geometry.shapes import ball, box

LONGEST = 10.0
"""Seconds of the processor that a check of a tiny scene may take, compiling left out."""
MEMORY = 2**29
"""Bytes that a process may grow by over tiny scenes, kernels compiled."""
AFFORDABLE = 3000
"""Substeps that a run of the fuzz may take."""

THOROUGH = int(os.environ.get("TISOFT_THOROUGH", "1"))
HOSTILE = [
    *(0, -1, 1, 2, 3, 2**31, 2**63, 10**400, -(10**19)),
    *(0.0, -0.0, 5e-324, 1e-300, 1e-90, 1e-30, 1e-7, 0.3, 0.5, 1e7, 1e30, 1e90, 1e100, 1.1e100),
    *(1e300, -1e-30, -1e30, math.nan, math.inf, -math.inf),
    *(True, False, "", "text", "auto", "all", "from-young", "x" * 5000, "ünï→\u202e😀", "a\x00b"),
    *("../../x", "/etc/passwd", "..", "1e5", "\n\x1b[31m", "{0}", "%s%n", "-o", "edges"),
    *([], {}, [[]], [{}], [0, 0, 0], [1e90, 1e-90, -1e90], [math.nan] * 3, [1, 2], [0] * 50),
    *([[0, 1], [1, 0]], [[0, 0, 0], [1, 1, 1]], {"box": [[-9, -9, -9], [9, 9, 9]]}),
    *({"nodes": [0, 10**9]}, {"nearest": [1e99, 0, 0]}, {"a": {"b": {"c": [1, [2, [3]]]}}}),
    *(datetime.date(1979, 5, 27), datetime.time(7, 32)),
]
SOLID = {"young": 1e5, "poisson": 0.3, "density": 1000.0}
PIN = {"where": {"nearest": [0, 0, 0]}}
MESHES = [
    {"box": {"size": [1.0, 0.5, 0.5], "cells": [2, 1, 1]}},
    {"box": {"size": [1.0, 0.5, 0.5], "cells": [1, 1, 1], "split": "six"}, "scale": 2.0},
    {"ball": {"radius": 0.5, "resolution": 1}, "rotate": [10, 20, 30]},
    {"cylinder": {"radius": 0.5, "height": 1.0, "resolution": 1}, "translate": [0, 1, 0]},
    {"file": "brick.vtu"},
    {"file": "brick.vtu", "merge": True, "units": "m"},
]
SOLIDS = [
    {"box": {"size": [1.0, 0.5, 0.5], "cells": [2, 1, 1], "split": "hex"}},
    {"box": {"size": [1.0, 0.5, 0.5], "cells": [1, 1, 1]}, "element": "tet10"},
    {"box": {"size": [1.0, 0.5, 0.5], "cells": [2, 1, 1]}, "cage": {"size": 0.3}},
    {"file": "ball.stl", "cage": {"cells_across": 2}, "scale": 1.5},
    {"ball": {"radius": 0.5, "resolution": 1, "split": "hex"}, "translate": [0, 0.4, 0]},
    {"box": {"size": [1.0, 0.5, 0.5], "cells": [1, 1, 1]}, "refine": 1},
]
NETS = [
    {"cloth": {"size": [1.0, 1.0], "cells": [2, 2], "diagonals": True}},
    {"grid": {"size": [1.0, 1.0, 1.0], "cells": [1, 1, 1]}, "scale": 0.1},
    {"points": [[0, 0, 0], [0.7, 0, 0], [0, 0.5, 0]]},
]
PINS = [
    PIN,
    {"where": "all", "axes": "xy"},
    {"where": {"box": [[-1e-6, -1, -1], [1e-6, 1, 1]]}, "velocity": [0.1, 0, 0]},
    {"where": {"plane": {"point": [0.1, 0, 0], "normal": [1, 0, 0]}}, "release": 0.01},
    {"where": {"nodes": [0]}, "path": [[0, 0, 0, 0], [1, 0.1, 0, 0]]},
    {"where": {"nodes": [1]}, "turn": {"point": [0, 0, 0], "axis": [0, 1, 0], "rate": 2.0}},
]
LOADS = [
    {"where": "all", "force": [1.0, 0, 0]},
    {"where": "all", "traction": [1.0, 0, 0], "start": 0.01, "end": 0.5, "ramp": 0.1},
    {"where": "all", "force": [0, 1.0, 0], "table": [[0, 0], [1, 2.0]]},
    {"where": "all", "pressure": 10.0},
    {"where": "all", "torque": {"point": [0, 0, 0], "axis": [1, 0, 0], "moment": 1.0}},
]
OBSTACLES = [
    {"plane": {"point": [0, -0.1, 0], "normal": [0, 1, 0]}, "friction": 0.5},
    {"sphere": {"center": [0, -1, 0], "radius": 0.5}},
    {"box": {"center": [0, -1, 0], "size": [1, 1, 1]}, "friction": 0.2},
]
MOVING = [
    {"plane": {"point": [0, -0.1, 0], "normal": [0, 1, 0]}, "velocity": [0.5, 0.1, 0]},
    {"sphere": {"center": [0, -0.6, 0], "radius": 0.5}, "path": [[0, 0, 0, 0], [1, 0, 0.5, 0]]},
    {"plane": {}, "turn": {"point": [0, 0, 0], "axis": [0, 0, 1], "rate": 1.0}, "friction": 0.3},
    {"box": {"center": [0, -1, 0], "size": [1, 1, 1]}, "velocity": [0, 1, 0]},
    {"box": {"center": [0, -1, 0], "size": [1, 1, 1], "rotate": [10, 20, 30]},
     "turn": {"point": [0, 0, 0], "axis": [1, 1, 0], "rate": 3.0}},
    {"capsule": {"from": [-1, -0.3, 0], "to": [1, -0.3, 0], "radius": 0.2}},
    {"cylinder": {"from": [0, -0.5, -1], "to": [0, -0.5, 1], "radius": 0.4}, "friction": 0.1},
    {"file": "ball.stl", "translate": [0, -1, 0]},
]  # fmt: skip
REGIONS = [{"name": "1", "young": 2e5}, {"tag": 1, "density": 500.0, "eta": 1.0}]
MORE = {
    "region": [[], [], [REGIONS[0]], [REGIONS[1]]],
    "friction": [0.3, 0.0, 2.0],
    "thickness": [0.01, 0.1],
    "contact": [False],
}
"""Keys of a body that need no kernel of its own."""
SHAKES = [[0, 0, -9.81, 0], [0.01, 5, -9.81, 0], [0.02, 0, -9.81, 0]]
VISCOUS = {**SOLID, "phi": 5.0, "eta": 5.0}
NET = {"model": "mass-spring", "stiffness": 100.0, "node_mass": 0.01, "spring_damping": 0.1}
LATTICE = {"model": "mass-spring", "young": 1e5, "density": 1000.0}
CONSISTENT = {"model": "linear", **SOLID, "mass": "consistent"}
RATIO = {"model": "viscoelastic", **SOLID, "damping_ratio": 0.05, "damping_at": 10.0}
LAME = {"lame_lambda": 1e5, "lame_mu": 1e5, "density": 1000.0, "point_damping": 1.0}
# Body, its meshes, loads and obstacles of a scene: few, for each kind needs a kernel of its own,
# which takes seconds to compile; the first FEW are tried each time, each with one obstacle, all of
# them in thorough runs.
FEW = 3
PROFILES = [
    ({"model": "viscoelastic", **VISCOUS}, MESHES, LOADS[:3], OBSTACLES),
    (NET, NETS, LOADS[:1], []),
    ({"model": "neo-hookean", **VISCOUS}, MESHES, [], OBSTACLES),
    (LATTICE, MESHES, [], OBSTACLES),
    ({"model": "linear", **SOLID}, MESHES, LOADS[3:4], []),
    ({"model": "mass-tensor", **SOLID}, MESHES, [], []),
    (CONSISTENT, MESHES[:2], LOADS[:1], []),
    ({"material": "rubber"}, MESHES[:2], [], []),
    (RATIO, MESHES, [], OBSTACLES),
    (LAME, MESHES, LOADS[4:], []),
    ({"model": "viscoelastic", **VISCOUS}, SOLIDS, LOADS, [*OBSTACLES, *MOVING]),
    ({"model": "neo-hookean", **SOLID, "self_contact": True}, SOLIDS, LOADS, MOVING),
    ({**NET, "thickness": 0.02, "self_contact": True}, NETS, [], MOVING),
]
SETTINGS = {
    "gravity": [0.0, -9.81, 0.0],
    "duration": 0.1,
    "frame_rate": 60.0,
    "checkpoint_every": 1,
    "camera": {"eye": [3.0, 1.0, 3.0], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 40.0},
    "render": {"size": [64, 48], "color": "body", "samples": 1, "wireframe": False, "ground": True},
}
UNKNOWN = ("yung", "body", "", "a.b", "é", "step", "velocity", "spin", "name", "x" * 300)


def toml(value):
    """A value as TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value).replace("\x7f", "\\u007f")
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(toml(item) for item in value) + "]"
    return str(value)


def document(scene):
    return "".join(f"{json.dumps(key)} = {toml(value)}\n" for key, value in scene.items())


def paths_in(value, path=()):
    """Where a value may be changed: every key and index."""
    items = enumerate(value) if isinstance(value, list) else value.items()
    for key, item in items:
        yield (*path, key)
        if isinstance(item, dict | list):
            yield from paths_in(item, (*path, key))


def at(value, path):
    for key in path:
        value = value[key]
    return value


@st.composite
def scenes(draw, profiles):
    """A valid scene with up to four hostile changes."""
    model, meshes, loads, obstacles = draw(st.sampled_from(profiles))
    scene = copy.deepcopy(SETTINGS)
    scene["body"] = []
    for number in range(draw(st.sampled_from([1, 1, 1, 2]))):
        body = {"name": f"b{number}", **model, "mesh": draw(st.sampled_from(meshes))}
        if "points" in body["mesh"]:
            body["springs"] = [[0, 1], [1, 2, 50.0], [0, 2, 50.0, 0.4]]
        body["pin"] = draw(st.lists(st.sampled_from(PINS), max_size=2))
        body["load"] = [draw(st.sampled_from(loads))] if loads else []
        if THOROUGH > 1 and draw(st.booleans()):
            key = draw(st.sampled_from(list(MORE)))
            body[key] = draw(st.sampled_from(MORE[key]))
        scene["body"].append(body)
    scene["obstacle"] = [draw(st.sampled_from(obstacles))] if obstacles else []
    scene["probe"] = [{"name": "p", "body": "b0", "point": [1.0, 0.0, 0.0]}]
    if THOROUGH > 1 and draw(st.booleans()):  # what is driven needs kernels of its own
        scene["gravity"] = draw(st.sampled_from([SHAKES, SHAKES[:1], SHAKES[::-1]]))
        scene["no_contact"] = [{"bodies": ["b0", "b1"]}] if len(scene["body"]) > 1 else []
    scene = copy.deepcopy(scene)
    for _ in range(draw(st.integers(0, 4))):
        change(draw, scene)
    return scene


def change(draw, scene):
    """One hostile change: a number far from what it was, or anything anywhere."""
    places = list(paths_in(scene))
    if draw(st.booleans()):
        numbers = [place for place in places if is_number(at(scene, place))]
        *before, key = draw(st.sampled_from(numbers or places))
        holder = at(scene, before)
        if is_number(holder[key]) and abs(holder[key]) < 1e200:
            size = float(holder[key] or 1.0) * draw(SCALES)
            holder[key] = draw(st.sampled_from([size, size, size, -size]))
        return
    *before, key = draw(st.sampled_from(places))
    holder = at(scene, before)
    kind = draw(st.sampled_from(["replace", "replace", "remove", "add", "twice"]))
    if kind == "remove":
        del holder[key]
    elif kind == "add" and isinstance(holder, dict):
        holder[draw(st.sampled_from(UNKNOWN))] = copy.deepcopy(draw(st.sampled_from(HOSTILE)))
    elif kind == "twice" and isinstance(holder, list):
        holder.append(copy.deepcopy(holder[key]))
    else:
        holder[key] = copy.deepcopy(draw(st.sampled_from(HOSTILE)))


def is_number(value):
    return isinstance(value, int | float) and not isinstance(value, bool)


SCALES = st.one_of(
    st.sampled_from([1e-90, 1e-45, 1e-20, 1e-9, 1e-3, 1e3, 1e9, 1e20, 1e45, 1e90]),
    st.floats(-15.0, 15.0).map(lambda power: 10.0**power),
)


def call(*arguments):
    """Exit code, standard output, standard error; fails where anything is raised."""
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        code = main(list(arguments))
    return code, out.getvalue(), error.getvalue()


def assert_told(code, error):
    """A mistake is told in one line that begins as all of them."""
    if code:
        lines = [line for line in error.splitlines() if "tisoft: warning" not in line]
        assert len(lines) == 1 and lines[0].startswith("tisoft: error: "), error
        assert len(lines[0]) < 3000
    assert "Traceback" not in error


class Laboratory:
    """A folder with a scene file and its output, and nothing around it that may change."""

    def __init__(self, folder):
        self.root = folder
        self.home = folder / "a" / "b" / "home"
        self.home.mkdir(parents=True)
        self.memory = peak_memory()
        self.scene = self.home / "scene.toml"
        self.out = self.home / "out"
        mesh = box((1.0, 0.5, 0.5), (2, 1, 1))
        parts = {"MaterialIds": [np.arange(mesh.elements) % 2]}
        brick = meshio.Mesh(mesh.points, [("tetra", mesh.tets)], cell_data=parts)
        brick.write(self.home / "brick.vtu")
        whole = ball(0.5, 1)
        with contextlib.redirect_stdout(io.StringIO()):
            meshio.Mesh(whole.points, [("triangle", whole.surface)]).write(self.home / "ball.stl")

    def try_scene(self, text):
        self.scene.write_text(text, encoding="utf-8")
        begun, compiled = time.process_time(), runtime.compile_seconds
        code, out, error = call("check", str(self.scene), "--json")
        seconds = time.process_time() - begun - (runtime.compile_seconds - compiled)
        assert code in (0, 2), error
        assert_told(code, error)
        assert seconds < LONGEST, text
        assert peak_memory() - self.memory < MEMORY, self.scene.read_text(encoding="utf-8")
        if code == 0:
            self.try_run(json.loads(out))
        return code

    def try_run(self, checked):
        few = ["--set", "duration=0.05"]
        if not checked["step"] or 0.05 / checked["step"] > AFFORDABLE:
            few = ["--set", "duration=0"]
        code, _, error = call("run", str(self.scene), "--quiet", "-o", str(self.out), *few)
        assert code in (0, 2, 3), error
        assert_told(code, error)
        self.assert_nothing_outside()

    def assert_nothing_outside(self):
        everything = {path.relative_to(self.root) for path in self.root.rglob("*")}
        home = Path("a", "b", "home")
        names = ("summary.json", "probes.csv", "energy.csv", "checkpoint.npz", "tisoft.json")
        known = {Path("a"), Path("a", "b"), home, home / "out", home / "scene.toml"}
        known |= {home / "brick.vtu", home / "ball.stl", *(home / "out" / name for name in names)}
        assert everything <= known


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    patch = pytest.MonkeyPatch()
    patch.setattr(report, "TRIAL_SECONDS", 0.002)
    patch.setattr(scene_mesh, "MOST_ELEMENTS", 20_000)  # what memory and time are measured for
    made = Laboratory(tmp_path_factory.mktemp("fuzz"))
    yield made
    patch.undo()


FULL = settings(
    max_examples=13 if THOROUGH == 1 else 500 * THOROUGH,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=list(HealthCheck),
)
MANY = settings(FULL, max_examples=200 * THOROUGH)


QUICK = [(*profile[:3], profile[3][k : k + 1]) for k, profile in enumerate(PROFILES[:FEW])]


@pytest.mark.slow
@FULL
@given(scene=scenes(QUICK if THOROUGH == 1 else PROFILES))
def test_hostile_scenes(laboratory, scene):
    laboratory.try_scene(document(scene))


MESH_FILES = {
    "a.vtu": {"binary": False},
    "b.vtu": {},
    "c.vtk": {"file_format": "vtk42", "binary": False},
    "d.vtk": {},
    "e.msh": {"file_format": "gmsh", "binary": False},
    "f.msh": {"file_format": "gmsh22"},
    "g.mesh": {},
    "h.inp": {},
    "i.ele": {},
    "j.xml": {},
    "k.bdf": {},
}
WORDS = [b"nan", b"inf", b"-1", b"99999999", b"2147483648", b"1e308", b"1e-320", b"", b"x", b"0"]
DAMAGE = st.lists(
    st.one_of(
        st.tuples(st.just("flip"), st.floats(0.0, 1.0), st.integers(1, 255)),
        st.tuples(st.just("word"), st.floats(0.0, 1.0), st.sampled_from(WORDS)),
        st.tuples(st.just("cut"), st.floats(0.0, 1.0), st.just(0)),
        st.tuples(st.just("repeat"), st.floats(0.0, 1.0), st.integers(1, 200)),
    ),
    min_size=1,
    max_size=6,
)


def damaged(data, changes):
    """The bytes with some flipped, words replaced, the end cut off or pieces repeated."""
    for kind, share, value in changes:
        place = int(share * (len(data) - 1)) if data else 0
        if kind == "flip" and data:
            data = data[:place] + bytes([data[place] ^ value]) + data[place + 1 :]
        elif kind == "cut":
            data = data[:place]
        elif kind == "repeat":
            data = data[:place] + data[place : place + value] + data[place:]
        elif kind == "word" and (word := re.compile(rb"[-+.\w]+").search(data, place)):
            data = data[: word.start()] + value + data[word.end() :]
    return data


class MeshLaboratory(Laboratory):
    """A folder with a mesh file of every kind, one of which is damaged at a time."""

    def __init__(self, folder):
        super().__init__(folder)
        mesh = box((1.0, 0.5, 0.5), (2, 1, 1))
        self.whole = {}
        for name, options in MESH_FILES.items():
            silent = io.StringIO()
            with contextlib.redirect_stdout(silent), contextlib.redirect_stderr(silent):
                made = meshio.Mesh(mesh.points, [("tetra", mesh.tets)])
                made.write(self.home / name, **options)
            self.whole[name] = (self.home / name).read_bytes()

    def try_mesh(self, name, changes):
        path = self.home / name
        path.write_bytes(damaged(self.whole[name], changes))
        body = {"name": "b", **SOLID, "mesh": {"file": name}}
        self.scene.write_text(document({"body": [body]}), encoding="utf-8")
        begun = time.process_time()
        code, _, error = call("check", str(self.scene), "--quiet")
        path.write_bytes(self.whole[name])
        assert code in (0, 2), error
        assert_told(code, error)
        assert time.process_time() - begun < LONGEST
        assert peak_memory() - self.memory < MEMORY, self.scene.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def meshes(tmp_path_factory):
    return MeshLaboratory(tmp_path_factory.mktemp("meshes"))


def peak_memory():
    """Bytes that this process has had at the most."""
    unit = 1 if sys.platform == "darwin" else 1024
    return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


@pytest.mark.slow
@MANY
@given(name=st.sampled_from(list(MESH_FILES)), changes=DAMAGE)
def test_damaged_meshes(meshes, name, changes):
    meshes.try_mesh(name, changes)


BRIEF = ("run", "check")
OPTIONS = [
    *("--json", "--quiet", "--help", "-o", "--output", "--save-every", "--resume", "--set"),
    *("--arch", "--precision", "--size", "--color", "--wireframe", "--picture", "--only", "-n"),
    *("--jsn", "-", "--", "-x", "--set=", "--set==", "--save-every=-3", "-oout", "--version"),
]
VALUES = [
    *("scene.toml", "", ".", "..", "out", "nowhere.toml", "brick.vtu", "/dev/null", "-1", "3"),
    *("a\x00b", "ünï", "x" * 300, "/nowhere/out", "scene.toml/out", "cpu", "cuda", "f64", "1x1"),
    *("young", "body.0.young=2e5", "body.9.young=1", "body.0=", "=", "a=[", "duration=nan"),
    *("body[0].mesh.box.cells=[1,1,1]", "body.0.name=../../x", "probe.0.name=../../x"),
    *("step=1e-300", "step=1e300", "frame_rate=1e-90", "gravity=0", "x.png", "x.gif", "out/x.png"),
]


@st.composite
def command_lines(draw):
    """Arguments in any order and number; commands that take long never get a valid line."""
    command = draw(st.sampled_from([*BRIEF, *BRIEF, *COMMANDS, "", "--json", "swim"]))
    words = draw(st.lists(st.sampled_from([*OPTIONS, *VALUES]), max_size=6))
    if draw(st.booleans()):
        words.insert(0, "scene.toml")
    return [command, *words, *([] if command in BRIEF else ["--nonsense"])]


def try_line(laboratory, monkeypatch, line):
    scene = {"duration": 0.02, "render": {"size": [32, 32]}}
    scene["body"] = [{"name": "b", **VISCOUS, "mesh": MESHES[0]}]
    laboratory.scene.write_text(document(scene), encoding="utf-8")
    with monkeypatch.context() as patch:
        patch.chdir(laboratory.home)
        code, _, error = call(*line)
    assert code in (0, 2, 3), (code, error)
    assert "Traceback" not in error
    for path in laboratory.home.iterdir():
        if path.name not in ("scene.toml", "brick.vtu", "ball.stl"):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    assert {path.name for path in laboratory.root.iterdir()} == {"a"}


@pytest.mark.slow
@MANY
@given(line=command_lines())
def test_hostile_command_lines(laboratory, monkeypatch, line):
    try_line(laboratory, monkeypatch, line)
