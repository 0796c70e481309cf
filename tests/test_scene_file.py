"""Scene files: every key is read, and whatever is wrong is told in one sentence."""

import copy
import os
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tisoft import scene_mesh, where
from tisoft.errors import SceneError
from tisoft.geometry.mesh import SpringNet, TetMesh
from tisoft.models.materials import MODELS, Linear, MassSpring, NeoHookean, ViscoElastic
from tisoft.models.presets import PRESETS
from tisoft.pins import Pin
from tisoft.scene import Box, Camera, Load, Plane, Probe, Render, Scene, Sphere
from tisoft.scene_file import load_scene
from tisoft.scene_keys import field_names

BEAM = """
duration = 1.0

[[body]]
name = "beam"
model = "viscoelastic"
young = 1e6
poisson = 0.3
density = 1000.0
[body.mesh]
box = { size = [1, 0.2, 0.2], cells = [4, 2, 2] }
[[body.pin]]
where = { box = [[0, -1, -1], [0, 1, 1]] }
[[body.load]]
where = { box = [[1, 0, 0], [1, 1, 1]] }
force = [0, -1, 0]

[[obstacle]]
plane = { point = [0, -1, 0], normal = [0, 1, 0] }
friction = 0.5

[[probe]]
name = "tip"
body = "beam"
point = [1.0, 0.1, 0.1]

[camera]
fov = 30

[render]
color = "stress"
"""

BOX = "box = { size = [1, 0.2, 0.2], cells = [4, 2, 2] }"

NET = """
[[body]]
model = "mass-spring"
node_mass = 0.005
stiffness = 10.0
springs = [[0, 1], [1, 2, 20.0], [2, 0, 30.0, 0.5]]
[body.mesh]
points = [[0, 0, 0], [0.7, 0, 0], [0, 0.7, 0]]
"""


RICH = """
[[body]]
material = "rubber"
[body.mesh]
box = { size = [1, 0.2, 0.2], cells = [4, 2, 2] }
[[body.pin]]
where = { plane = { point = [0, 0, 0], normal = [1, 0, 0] } }
turn = { point = [0, 0.1, 0.1], axis = [1, 0, 0], rate = 2 }
release = 1.2
[[body.pin]]
where = { nearest = [1, 0, 0] }
path = [[0, 0, 0, 0], [1, 0, 0.5, 0]]
[[body.pin]]
where = { nodes = [44] }
axes = "x"
velocity = [0.1, 0, 0]
[[body.load]]
where = "all"
pressure = 10
table = [[0, 0], [1, 1]]
[[body.load]]
where = { plane = { point = [1, 0, 0], normal = [-1, 0, 0] } }
torque = { point = [1, 0.1, 0.1], axis = [1, 0, 0], moment = 3 }
start = 0.5
end = 1
ramp = 0.1
[[obstacle]]
sphere = { center = [0, -2, 0], radius = 1 }
[[obstacle]]
box = { center = [3, 0, 0], size = [1, 1, 1] }
friction = 0.1
"""


@pytest.fixture
def load(tmp_path):
    """Loads a scene from its text."""

    def load_text(text, *overrides):
        path = tmp_path / "beam.toml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return load_scene(path, overrides)

    return load_text


def changed(old, new, text=BEAM):
    assert old in text
    return text.replace(old, new, 1)


def refusal(load, text, *overrides):
    with pytest.raises(SceneError) as refused:
        load(text, *overrides)
    message = str(refused.value)
    assert "beam.toml" in message
    assert "\n" not in message
    return message


# What is read


def test_a_scene_file_gives_the_scene_that_python_would_build(load):
    scene = load(BEAM)
    assert (scene.duration, scene.frame_rate, scene.gravity) == (1.0, 60.0, (0.0, -9.81, 0.0))
    (beam,) = scene.bodies
    assert beam.name == "beam"
    assert beam.model == ViscoElastic(1e6, 0.3, 1000.0)
    assert beam.mesh.points.shape == (45, 3)
    assert beam.pins == [Pin(where.box((0, -1, -1), (0, 1, 1)))]
    assert beam.loads[0].force == (0.0, -1.0, 0.0)
    assert scene.obstacles == [Plane((0, -1, 0), (0, 1, 0), friction=0.5)]
    assert scene.probed(scene.probes[0]).rows.tolist() == [24]
    assert (scene.camera.fov, scene.camera.eye) == (30.0, None)
    assert (scene.render.color, scene.render.size) == ("stress", (1280, 720))


def test_every_setting_of_a_scene_is_read(load):
    head = """
    gravity = [0, 0, -1.62]
    frame_rate = 24
    step = 1e-4
    integrator = "velocity-verlet"
    start = "half-step"
    precision = "f64"
    checkpoint_every = 10
    """
    scene = load(head + BEAM)
    assert scene.gravity == (0.0, 0.0, -1.62)
    assert (scene.frame_rate, scene.step, scene.checkpoint_every) == (24.0, 1e-4, 10)
    assert (scene.integrator, scene.start) == ("velocity-verlet", "half-step")
    assert scene.precision == "f64"


@pytest.mark.parametrize("model", MODELS)
def test_one_word_changes_the_model(load, model):
    (body,) = load(BEAM, f"body.0.model={model}").bodies
    assert type(body.model) is MODELS[model]
    assert body.model.young == 1e6


def test_materials_by_preset_and_by_lame_constants(load):
    given = "young = 1e6\npoisson = 0.3\ndensity = 1000.0"
    (body,) = load(changed(given, 'material = "rubber"')).bodies
    assert body.model.young == PRESETS["rubber"].young
    assert body.model.damping_ratio == PRESETS["rubber"].damping_ratio
    (body,) = load(changed(given, 'material = "rubber"\nyoung = 2e5\neta = 3.0')).bodies
    assert (body.model.young, body.model.eta, body.model.damping_ratio) == (2e5, 3.0, None)
    assert body.model.density == PRESETS["rubber"].density
    lame = "lame_lambda = 400.0\nlame_mu = 400.0\ndensity = 1000.0"
    (body,) = load(changed(given, lame)).bodies
    assert (body.model.young, body.model.poisson) == pytest.approx((1000.0, 0.25))
    (body,) = load(changed(given, 'material = "jelly"'), "body.0.model=mass-spring").bodies
    assert isinstance(body.model, MassSpring)
    assert body.model.young == PRESETS["jelly"].young


def test_the_model_keys_of_solids(load):
    keys = 'mass = "consistent"\nphi = 3.0\neta = 2.0\npoint_damping = 0.1\nvelocity = [1, 0, 0]'
    text = changed('model = "viscoelastic"', f'model = "linear"\n{keys}\nspin = [0, 0, 2]')
    (body,) = load(text).bodies
    assert body.model == Linear(1e6, 0.3, 1000.0, 3.0, 2.0, 0.1, "consistent")
    assert (body.velocity, body.spin) == ((1.0, 0.0, 0.0), (0.0, 0.0, 2.0))
    damped = changed('"viscoelastic"', '"neo-hookean"\ndamping_ratio = 0.02\ndamping_at = 3')
    (body,) = load(damped).bodies
    assert body.model == NeoHookean(1e6, 0.3, 1000.0, damping_ratio=0.02, damping_at=3.0)


def test_a_bare_net_of_springs(load):
    (body,) = load(NET).bodies
    assert body.springs().tolist() == [[0, 1], [1, 2], [2, 0]]
    assert body.model.stiffness.tolist() == [10.0, 20.0, 30.0]
    np.testing.assert_array_equal(body.model.rest_lengths, [np.nan, np.nan, 0.5])
    (body,) = load(NET, "body.0.node_mass=[1, 2, 3.5]").bodies
    assert body.model.node_mass.tolist() == [1.0, 2.0, 3.5]


@pytest.mark.parametrize(
    ("shape", "kind"),
    [
        ("box = { size = [1, 1, 1], cells = [2, 2, 2], split = 'six' }", TetMesh),
        ("ball = { radius = 0.5, resolution = 2 }", TetMesh),
        ("cylinder = { radius = 0.5, height = 1, resolution = 2 }", TetMesh),
        ("cloth = { size = [1, 1], cells = [3, 2], diagonals = false }", SpringNet),
        ("grid = { size = [1, 1, 1], cells = [2, 2, 2] }", SpringNet),
    ],
)
def test_every_shape_makes_a_mesh(load, shape, kind):
    text = f"""
    [[body]]
    model = "mass-spring"
    node_mass = 0.01
    stiffness = 100
    [body.mesh]
    {shape}
    """
    (body,) = load(text).bodies
    assert type(body.mesh) is kind


def test_meshes_are_scaled_then_turned_then_moved(load):
    where_to = "}\nscale = 2\nrotate = [0, 0, 90]\ntranslate = [10, 0, 0]"
    text = changed("cells = [4, 2, 2] }", f"cells = [4, 2, 2] {where_to}")
    text = changed("[[0, -1, -1], [0, 1, 1]]", "[[9, 0, -1], [10, 0, 1]]", text)
    text = changed("{ box = [[1, 0, 0], [1, 1, 1]] }", '"all"', text)
    (body,) = load(text).bodies
    np.testing.assert_allclose(body.mesh.points.min(axis=0), [9.6, 0, 0], atol=1e-14)
    np.testing.assert_allclose(body.mesh.points.max(axis=0), [10, 2, 0.4], atol=1e-14)
    assert len(body.nodes(body.pins[0].where)) == 9


def test_a_mesh_file_is_found_beside_the_scene_file(load, tmp_path, monkeypatch):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "tet.vtk").write_text(
        "# vtk DataFile Version 3.0\none tet\nASCII\nDATASET UNSTRUCTURED_GRID\n"
        "POINTS 5 double\n0 0 0\n1 0 0\n9 9 9\n0 1 0\n0 0 1\n"
        "CELLS 1 5\n4 0 1 3 4\nCELL_TYPES 1\n10\n"
    )
    text = """
    [[body]]
    material = "jelly"
    mesh = { file = "meshes/tet.vtk" }
    pin = [{ where = { nodes = [3, 4] }, axes = "xz" }]
    probe = []
    """
    monkeypatch.chdir("/")
    scene = load(text.replace("probe = []", ""))
    (body,) = scene.bodies
    assert body.nodes(body.pins[0].where).tolist() == [2, 3]  # node 2 is used by no tet
    message = refusal(load, text.replace("[3, 4]", "[2]").replace("probe = []", ""))
    assert "body[0].pin[0].where.nodes[0] = 2 is no node of the mesh: no element uses it" in message


def test_every_selection_motion_load_and_obstacle_is_read(load):
    scene = load(RICH)
    turning, moving, sliding = scene.bodies[0].pins
    assert turning.turn.rate == 2.0
    assert turning.release == 1.2
    assert moving.path == ((0, 0, 0, 0), (1, 0, 0.5, 0))
    assert sliding.velocity == (0.1, 0, 0)
    pressure, torque = scene.bodies[0].loads
    assert pressure.factor(0.5) == 0.5
    assert (torque.torque.moment, torque.start, torque.end, torque.ramp) == (3, 0.5, 1, 0.1)
    assert scene.obstacles == [
        Sphere((0, -2, 0), 1.0),
        Box((3, 0, 0), (1, 1, 1), friction=0.1),
    ]


# What is refused


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "young",
            "yuong",
            "body[0].yuong = 1e6 is not a key that tisoft knows; did you mean young?",
        ),
        (
            "young",
            "translate",
            "body[0].translate = 1e6 is not a key that tisoft knows; it belongs in mesh, as mesh = "
            "{ …, translate = … }",
        ),
        ("duration", "duratoin", "duratoin = 1.0 is not a key that tisoft knows; did you mean dur"),
        ("size", "siz", "body[0].mesh.box.siz = [1, 0.2, 0.2] is not a key that tisoft knows; did"),
        ("force", "forc", "body[0].load[0].forc = [0, -1, 0] is not a key"),
        (
            "friction",
            "freeze",
            "obstacle[0].freeze = 0.5 is not a key that tisoft knows; use one of",
        ),
        ("fov", "fow", "camera.fow = 30 is not a key that tisoft knows; did you mean fov?"),
        (
            "color",
            "colour",
            'render.colour = "stress" is not a key that tisoft knows; did you mean',
        ),
        ("point = [1.0", "pont = [1.0", "probe[0].pont = [1.0, 0.1, 0.1] is not a key"),
        ("fov", '"a\\nb"', 'camera."a\\nb" = 30 is not a key'),
        ("[[body]]", "[body]", "body must be a list of tables; write [[body]] above its keys"),
        ("[[body.pin]]", "[body.pin]", "body[0].pin must be a list of tables; write [[body.pin]]"),
        ("[camera]", "[[camera]]", "camera = [{ fov = 30 }] must be a table of keys"),
        ("1e6", '"1e6"', 'body[0].young = "1e6" must be a number in Pa, not text; drop the quotes'),
        ("1e6", "true", "body[0].young = true must be a number in Pa, not true or false"),
        ("1e6", "nan", "body[0].young = nan must be a number in Pa that is finite"),
        ("1e6", "inf", "body[0].young = inf must be a number in Pa that is finite"),
        ("1e6", "-5.0", "body[0].young = -5.0 must be above 0 Pa"),
        ("1e6", "1979-05-27", "body[0].young = 1979-05-27 must be a number in Pa, not a date"),
        ("1e6", "[[[[[[1]]]]]]", "body[0].young = [[[…]]] must be a number in Pa, not a list"),
        ("1e6", "0x" + "f" * 5000, "body[0].young = a number of thousands of digits must be a"),
        ("poisson = 0.3", "poisson = 0.5", "body[0].poisson = 0.5 must be above -1 and below 0.5;"),
        ("young = 1e6", "", "body[0].young is missing: give it in Pa, or material"),
        ("density = 1000.0", "", "body[0].density is missing: give it in kg/m³"),
        (
            "young = 1e6",
            'material = "ruber"',
            'body[0].material = "ruber" is not known; did you me',
        ),
        ("young = 1e6", "lame_mu = 3", "body[0].lame_mu = 3 and poisson exclude each other"),
        (
            "young = 1e6\npoisson = 0.3",
            "lame_mu = 3",
            "body[0].lame_lambda is missing: lame_mu needs",
        ),
        (
            "young = 1e6\npoisson = 0.3",
            "lame_mu = 3\nlame_lambda = -3",
            "body[0].lame_lambda = -3 must be above -2 Pa",
        ),
        ("viscoelastic", "visco", 'body[0].model = "visco" is not known; use one of mass-spring,'),
        ("viscoelastic", "neo-hokean", "did you mean neo-hookean?"),
        (
            "young = 1e6",
            "young = 1e6\nstiffness = 3",
            'body[0].stiffness = 3 is a key of model = "mass-spring", and this body is "visco',
        ),
        (
            '"viscoelastic"',
            '"mass-spring"\neta = 3.0',
            "body[0].eta = 3.0 is the viscosity of tets; damp springs by damping_ratio",
        ),
        (
            '"viscoelastic"',
            '"mass-spring"\nmass = "consistent"',
            'body[0].mass = "consistent" needs tets; mass-spring has lumped masses only',
        ),
        (
            '"viscoelastic"',
            '"neo-hookean"\nmass = "consistent"',
            'body[0].mass = "consistent" works with the models linear and viscoelastic only',
        ),
        ('"beam"', '"a/b"', 'body[0].name = "a/b" must be 1 to 100 printable characters'),
        ('"beam"', '""', 'body[0].name = "" must be 1 to 100 printable characters'),
        ("[body.mesh]", "[body.cage]", "body[0].cage"),
        (
            "cells = [4, 2, 2]",
            "cells = [4, 2]",
            "body[0].mesh.box.cells = [4, 2] must be 3 whole num",
        ),
        ("cells = [4,", "cells = [4.0,", "body[0].mesh.box.cells[0] = 4.0 must be a whole number"),
        (
            "cells = [4,",
            "cells = [true,",
            "body[0].mesh.box.cells[0] = true must be a whole number",
        ),
        ("cells = [4,", "cells = [0,", "body[0].mesh.box.cells[0] = 0 must be at least 1"),
        (
            "cells = [4, 2, 2]",
            "cells = [4000, 2000, 2000]",
            "cells = [4000, 2000, 2000] makes 8e+10 elements, more than 10,000,000; take a coarser",
        ),
        ("size = [1,", "size = [-1,", "body[0].mesh.box.size[0] = -1 must be above 0 m"),
        ("size = [1, 0.2, 0.2], ", "", "body[0].mesh.box.size is missing"),
        (
            "[body.mesh]",
            "[body.mesh]\nball = { radius = 1, resolution = 2 }",
            "body[0].mesh.ball and box exclude each other",
        ),
        (
            BOX,
            "",
            "body[0].mesh needs one of file, b",
        ),
        ("[body.mesh]", "[body.mesh]\nscale = 0", "body[0].mesh.scale = 0 must be above 0"),
        (
            "[body.mesh]",
            "[body.mesh]\nrotate = 90",
            "body[0].mesh.rotate = 90 must be a list of numb",
        ),
        ("size = [1,", "size = [1e99,", "body[0].mesh.box"),
        (
            "[[0, -1, -1], [0, 1, 1]]",
            "[[5, 5, 5], [6, 6, 6]]",
            "body[0].pin[0].where = { box = [[5, 5, 5], [6, 6, 6]] } selects no node of "
            '"beam", whose mesh spans (0, 0, 0) to (1, 0.2, 0.2)',
        ),
        (
            "[[0, -1, -1], [0, 1, 1]]",
            "[[0, 1, 1], [0, 1, 0]]",
            "body[0].pin[0].where.box[1] = [0, 1,",
        ),
        ("[[0, -1, -1], [0, 1, 1]]", "[0, 1]", "body[0].pin[0].where.box[0] = 0 must be a list"),
        ("[[0, -1, -1], [0, 1, 1]]", "[0]", "body[0].pin[0].where.box = [0] must be two corners"),
        (
            "{ box = [[0, -1, -1], [0, 1, 1]] }",
            '"al"',
            'body[0].pin[0].where = "al" is not known; did you mean all? or one of box, nodes,',
        ),
        (
            "{ box = [[0, -1, -1], [0, 1, 1]] }",
            "{}",
            "body[0].pin[0].where needs one of box, nodes",
        ),
        (
            "{ box = [[0, -1, -1], [0, 1, 1]] }",
            "{ plane = { point = [0, 0, 0] } }",
            "body[0].pin[0].where.plane.normal is missing",
        ),
        ("where = { box = [[0, -1, -1], [0, 1, 1]] }", "", "body[0].pin[0].where is missing; give"),
        (
            "[[body.load]]",
            'axes = "xq"\n[[body.load]]',
            'body[0].pin[0].axes = "xq" must be letters',
        ),
        ("[[body.load]]", "release = -1\n[[body.load]]", "body[0].pin[0].release = -1 must be at"),
        (
            "[[body.load]]",
            "turn = 3\n[[body.load]]",
            "body[0].pin[0].turn = 3 must be a table of keys",
        ),
        (
            "[[body.load]]",
            "turn = { point = [0, 0, 0], axis = [1, 0, 0] }\n[[body.load]]",
            "body[0].pin[0].turn.rate is missing",
        ),
        (
            "[[body.load]]",
            '[[body.pin]]\nwhere = "all"\nvelocity = [1, 0, 0]\n[[body.load]]',
            "body[0].pin[1] moves node 0 along x otherwise than pin[0] does",
        ),
        (
            "force = [0, -1, 0]",
            "",
            "body[0].load[0] needs one of force, traction, pressure, torque",
        ),
        (
            "force = [0, -1, 0]",
            "force = [0, -1, 0]\npressure = 1",
            "body[0].load[0].pressure = 1 and force exclude each other",
        ),
        (
            "force = [0, -1, 0]",
            "force = [0, -1, 0]\ntable = [[0, 1], [2, 1], [1, 1]]",
            "body[0].load[0].table[2][0] = 1 goes back in time",
        ),
        (
            "{ box = [[1, 0, 0], [1, 1, 1]] }\nforce = [0, -1, 0]",
            "{ nodes = [4] }\npressure = 2",
            "body[0].load[0].where = { nodes = [4] } selects no face of 'beam', and pressure acts",
        ),
        (
            "normal = [0, 1, 0]",
            "normal = [0, 0, 0]",
            "obstacle[0].plane.normal = [0, 0, 0] has no dir",
        ),
        ("plane = {", "sphere = {}\nplane = {", "obstacle[0].sphere and plane exclude each other"),
        ("friction = 0.5", "friction = -1", "obstacle[0].friction = -1 must be at least 0"),
        ("plane =", "plain =", "obstacle[0].plain"),
        (
            'body = "beam"',
            'body = "baem"',
            'probe[0].body = "baem" names no body of the scene; did yo',
        ),
        ('body = "beam"', "", "probe[0].body is missing"),
        ("point = [1.0, 0.1, 0.1]", "", "probe[0] needs one of point, node"),
        (
            "point = [1.0, 0.1, 0.1]",
            "node = 45",
            "probe[0].node = 45 is no node of the mesh: the high",
        ),
        (
            "[camera]",
            '[[probe]]\nname = "tip"\nbody = "beam"\nnode = 1\n[camera]',
            "probe[1].name = ",
        ),
        ("duration = 1.0", "frame_rate = 0", "frame_rate = 0 must be above 0 frames per second"),
        ("duration = 1.0", 'start = "half-step"', 'start = "half-step" needs a step in seconds'),
        ("stress", "stres", 'render.color = "stres" is not known; did you mean stress?'),
    ],
)
def test_what_cannot_be_is_told_with_its_key_and_value(load, old, new, message):
    assert message in refusal(load, changed(old, new))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("duration 1.0", "is not valid TOML: Expected '=' .* line 1, .*\"duration 1.0\""),
        (
            "a = [1, .2]",
            "not valid TOML: .* line 1.*; numbers need a digit before the point, as 0.2",
        ),
        ("a = " + "9" * 5000, "not valid TOML: a whole number has thousands of digits"),
        ("a = " + "[" * 5000, "nests lists or tables too deeply"),
        ("a = '", "not valid TOML"),
        ("a\0b = 1", "not valid TOML"),
        (b"a = '\xff'", "is not text in UTF-8 .byte 0xff in line 1.; save it as UTF-8"),
        (b"\n" + "a = 'ü'".encode("latin-1"), "is not text in UTF-8 .byte 0xfc in line 2"),
        ("", "body is missing: a scene needs at least one body"),
        ("body = []", "body is missing: a scene needs at least one body"),
        ("body = [3]", r"body\[0\] = 3 must be a table of keys"),
        ("body = [{}]", r"body\[0\].young is missing"),
        ("body = 3", "body = 3 must be a list of tables"),
    ],
)
def test_files_that_are_no_scene(load, text, message):
    with pytest.raises(SceneError, match=message):
        load(text)


def test_a_byte_order_mark_and_windows_line_ends_are_no_error(load):
    assert len(load(b"\xef\xbb\xbf" + BEAM.replace("\n", "\r\n").encode()).bodies) == 1


def test_files_that_cannot_be_read(tmp_path):
    for path, message in (
        (tmp_path / "no.toml", "no.toml is not found"),
        (tmp_path, "is a folder; name a scene file"),
        ("a\0b", "must be the name of a scene file"),
        ("x" * 5000, "cannot be read: File name too long"),
        ("/dev/zero", "is larger than 16 MB"),
    ):
        with pytest.raises(SceneError, match=message):
            load_scene(path)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("no.vtu", "is not found; looked in"),
        (".", "is a folder; name a mesh file in it"),
        ("", "must be the name of a mesh file"),
        ("a\\u0000b", "must be the name of a mesh file"),
        ("/dev/null", "is a device or a pipe"),
        ("x" * 5000, "cannot be read: File name too long"),
        ("beam.toml", "is no usable mesh: "),
    ],
)
def test_mesh_files_that_cannot_be_used(load, name, message):
    text = changed(BOX, f'file = "{name}"')
    told = refusal(load, text)
    assert "body[0].mesh.file = " in told
    assert message in told


def test_a_pipe_is_not_waited_for(load, tmp_path):
    os.mkfifo(tmp_path / "pipe.vtu")
    text = changed(BOX, 'file = "pipe.vtu"')
    assert "is a device or a pipe" in refusal(load, text)


@pytest.mark.parametrize(
    "shape",
    [
        "box = { size = [1, 1, 1], cells = [300, 300, 300] }",
        "ball = { radius = 1, resolution = 1000 }",
        "cylinder = { radius = 1, height = 1e20, resolution = 2 }",
        "cloth = { size = [1, 1], cells = [100000, 100000] }",
        "grid = { size = [1, 1, 1], cells = [2147483647, 2147483647, 1] }",
    ],
)
def test_giant_shapes_are_refused_before_they_are_built(load, shape):
    text = changed(BOX, shape)
    began = time.monotonic()
    assert "elements, more than 10,000,000" in refusal(load, text)
    assert time.monotonic() - began < 1.0


def test_many_bodies_may_not_have_what_one_may_not(load, monkeypatch):
    monkeypatch.setattr(scene_mesh, "MOST_ELEMENTS", 100)
    with pytest.raises(SceneError, match=r"body\[1\].mesh brings the scene to 160 elements"):
        load(BEAM + '[[body]]\nmaterial = "jelly"\n[body.mesh]\n' + BOX)


@pytest.mark.parametrize("cells", [(3, 4, 5), (1, 1, 1), (8, 2, 2)])
def test_the_count_before_building_is_no_underestimate(cells):
    for name, keys in {
        "box": {"size": (1, 1, 1), "cells": cells, "split": "six"},
        "ball": {"radius": 1.0, "resolution": cells[0]},
        "cylinder": {"radius": 1.0, "height": float(cells[1]), "resolution": cells[0]},
        "cloth": {"size": (1, 1), "cells": cells[:2]},
        "grid": {"size": (1, 1, 1), "cells": cells},
    }.items():
        shape = scene_mesh.SHAPES[name]
        mesh = shape.make(**keys)
        elements = len(mesh.tets) or len(mesh.edges)
        assert 0.3 * elements <= shape.count(keys) <= 2.0 * elements, name


# Overrides


def test_overrides_replace_and_create_keys(load):
    scene = load(
        BEAM,
        "body.0.young=2e5",
        "body[0].poisson = 0.4",
        "body.0.pin.0.axes=xy",
        "body[0].mesh.box.cells=[2, 2, 2]",
        "camera.eye=[0, 0, 5]",
        "precision=f64",
        "body.0.name='stiff = beam'",
        "probe.0.body=stiff = beam",
    )
    (body,) = scene.bodies
    assert body.model == ViscoElastic(2e5, 0.4, 1000.0)
    assert body.pins[0].axes == "xy"
    assert len(body.mesh.points) == 27
    assert scene.camera.eye == (0.0, 0.0, 5.0)
    assert scene.precision == "f64"
    assert body.name == "stiff = beam"


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("body.0.yuong=2", "--set body.0.yuong=2: body[0].yuong = 2 is not a key"),
        ("body.3.young=1", "--set body.3.young=1: body[3] is out of range: the last is body[0]"),
        ("wall.0.young=1", "wall[0] is out of range: the scene has none"),
        ("body.young=2", "body is a list: write body[0], not body.young"),
        ("body.99999999999.young=2", "body is a list"),
        ("duration.x=2", "duration = 1.0 is a single value and has no key x"),
        ("x.y.z=1", "x = { y = { z = 1 } } is not a key that tisoft knows"),
        ("young", "--set young: it must be KEY=VALUE, as body.0.young=2e5"),
        ("=3", "it must be KEY=VALUE"),
        ("body..young=3", "it must be KEY=VALUE"),
        ("body[0=3", "it must be KEY=VALUE"),
        ("body.0.density=1\nfoo=3", 'body[0].density = "1\\nfoo=3" must be a number'),
        ("gravity=[0, 0", 'gravity = "[0, 0" must be a list of numbers (x, y, z), or rows (t'),
        ("body.0.young=" + "[" * 5000, "must be a number in Pa, not text"),
        ("body=3", "body = 3 must be a list of tables"),
        ("a" + ".a" * 3000 + "=1", "a = { a = { a = { a = … } } } is not a key"),
    ],
)
def test_wrong_overrides_are_told(load, override, message):
    assert message in refusal(load, BEAM, override)


# Anything at all


BASES = [tomllib.loads(text) for text in (BEAM, NET, RICH)]
KEYS = sorted(
    {key for shape in scene_mesh.SHAPES.values() for key in shape.check}
    | {key for model in MODELS.values() for key in field_names(model)}
    | {key for part in (Scene, Pin, Load, Camera, Render, Probe) for key in field_names(part)}
    | {"body", "obstacle", "probe", "mesh", "pin", "load", "model", "material", "plane", "sphere"}
    | {*scene_mesh.SOURCES, *scene_mesh.TRANSFORM, "merge", "region", "set"}
    | {"lame_lambda", "lame_mu", "friction", "yuong"}
)
WORDS = sorted({"all", "xy", "auto", "f64", "six", "consistent", "edges", *MODELS, *PRESETS, *KEYS})
VALUES = st.one_of(
    st.integers(-2, 5),
    st.floats(),
    st.sampled_from([1e-300, 1e300, 1e99, 10**400, 2**31, 2**63, "", [], {}, [[]], [{}], True]),
    st.sampled_from(WORDS),
    st.text(max_size=5),
    st.lists(st.one_of(st.integers(-2, 4), st.floats(-2, 2)), min_size=2, max_size=4),
    st.lists(st.lists(st.integers(0, 3), min_size=2, max_size=4), max_size=3),
    st.dictionaries(st.sampled_from(KEYS), st.integers(), max_size=2),
)


def places(value):
    """Every (holder, key or index) inside a document."""
    keys = value if isinstance(value, dict) else range(len(value))
    for key in keys:
        yield value, key
        if isinstance(value[key], dict | list):
            yield from places(value[key])


@st.composite
def documents(draw):
    """A scene that loads, with up to four random changes anywhere in it."""
    document = copy.deepcopy(draw(st.sampled_from(BASES)))
    for _ in range(draw(st.integers(1, 4))):
        spots = list(places(document))
        if not spots:
            break
        holder, key = draw(st.sampled_from(spots))
        change = draw(st.sampled_from(["replace", "remove", "add", "repeat", "copy"]))
        if change == "remove":
            del holder[key]
        elif change == "add" and isinstance(holder, dict):
            holder[draw(st.sampled_from(KEYS))] = copy.deepcopy(draw(VALUES))
        elif change == "repeat" and isinstance(holder, list):
            holder.append(copy.deepcopy(holder[key]))
        elif change == "copy":
            other, there = draw(st.sampled_from(spots))
            holder[key] = copy.deepcopy(other[there])
        else:
            holder[key] = copy.deepcopy(draw(VALUES))
    return document


def as_toml(value):
    """A value as TOML, inline."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{as_toml(k)} = {as_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(as_toml, value)) + "]"
    if isinstance(value, str):
        return '"' + "".join(f"\\U{ord(c):08x}" for c in value) + '"'
    return repr(value)


def document_text(document):
    return "\n".join(f"{as_toml(key)} = {as_toml(value)}" for key, value in document.items())


def loads_or_tells(path, text, overrides=()):
    """Whether the scene loads; anything but a Scene or one sentence, in good time, is a failure."""
    path.write_text(text, encoding="utf-8", errors="replace")
    began = time.monotonic()
    try:
        scene = load_scene(path, overrides)
    except SceneError as error:
        assert "\n" not in str(error)
        assert len(str(error)) < 1500
        loaded = False
    else:
        assert isinstance(scene, Scene)
        loaded = True
    assert time.monotonic() - began < 5.0
    return loaded


@pytest.fixture(scope="module")
def small_meshes_only():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scene_mesh, "MOST_ELEMENTS", 2000)
        yield


QUICK = settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
LONG = settings(QUICK, max_examples=2000)


def check_document(tmp_path_factory, document):
    path = Path(tmp_path_factory.getbasetemp()) / "fuzz.toml"
    loads_or_tells(path, document_text(document))


@QUICK
@given(document=documents())
def test_random_scenes_load_or_tell(tmp_path_factory, small_meshes_only, document):
    check_document(tmp_path_factory, document)


@pytest.mark.slow
@LONG
@given(document=documents())
def test_many_random_scenes_load_or_tell(tmp_path_factory, small_meshes_only, document):
    check_document(tmp_path_factory, document)


@QUICK
@given(data=st.data())
def test_damaged_scene_files_load_or_tell(tmp_path_factory, data):
    path = Path(tmp_path_factory.getbasetemp()) / "damaged.toml"
    start = data.draw(st.integers(0, len(BEAM)))
    cut = data.draw(st.integers(0, 20))
    piece = data.draw(st.one_of(st.text(max_size=5), st.sampled_from(["0", "]", "[[", "nan", '"'])))
    loads_or_tells(path, BEAM[:start] + piece + BEAM[start + cut :])


@QUICK
@given(override=st.one_of(st.text(), st.from_regex(r"body(\.0|\[0\])\.\w+(\.\w+)?=.*")))
def test_random_overrides_load_or_tell(tmp_path_factory, small_meshes_only, override):
    path = Path(tmp_path_factory.getbasetemp()) / "override.toml"
    loads_or_tells(path, BEAM, [override])


def test_an_obstacle_file_is_read_from_beside_the_scene_and_moves(tmp_path):
    off = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
    (tmp_path / "bowl.off").write_text(off)
    obstacle = '[[obstacle]]\nfile = "bowl.off"\npath = [[0, 0, 0, 0], [1, 0, 1, 0]]\nscale = 2.0\n'
    (tmp_path / "scene.toml").write_text(BEAM + obstacle)
    *_, shell = load_scene(tmp_path / "scene.toml").obstacles
    assert shell.points.max() == 2.0 and shell.path[1] == (1.0, 0.0, 1.0, 0.0)
