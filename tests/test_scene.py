"""Scenes as plain data: what is derived, what is refused, and in which words."""

import dataclasses
import math

import numpy as np
import pytest

from tisoft import where
from tisoft.checks import FieldError
from tisoft.geometry import shapes
from tisoft.models.materials import (
    Linear,
    MassSpring,
    MassTensor,
    NeoHookean,
    ViscoElastic,
    lame_constants,
    young_and_poisson,
)
from tisoft.models.presets import PRESETS, preset
from tisoft.scene import Box, Camera, Load, Pin, Plane, Probe, Render, Scene, Sphere, Torque, Turn

MESH = shapes.box((1.0, 0.2, 0.2), (4, 2, 2))
FREE_END = where.box((1, -1, -1), (1, 1, 1))
RUBBER = ViscoElastic(1e6, 0.3, 1000.0)


def beam_scene():
    scene = Scene()
    beam = scene.add_body(MESH, RUBBER, "beam")
    beam.pin(where.box((0, -1, -1), (0, 1, 1)))
    return scene, beam


# Materials


@pytest.mark.parametrize("poisson", [-0.5, 0.0, 0.3, 0.49])
def test_lame_constants_there_and_back(poisson):
    lam, mu = lame_constants(1e6, poisson)
    young, back = young_and_poisson(lam, mu)
    assert young == pytest.approx(1e6, rel=1e-12)
    assert back == pytest.approx(poisson, abs=1e-12)
    assert lam + 2 * mu / 3 == pytest.approx(1e6 / (3 * (1 - 2 * poisson)))  # the bulk modulus


def test_a_model_from_lame_constants_knows_all_four():
    model = NeoHookean.from_lame(400.0, 400.0, 1000.0, phi=3.0, eta=2.0)
    assert (model.young, model.poisson) == pytest.approx((1000.0, 0.25))
    assert (model.lame_lambda, model.lame_mu) == pytest.approx((400.0, 400.0))


def test_a_material_is_changed_by_replacing_it():
    softer = dataclasses.replace(RUBBER, young=1e5)
    assert softer.lame_mu == pytest.approx(RUBBER.lame_mu / 10)


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_makes_every_model_and_has_a_source(name):
    given = preset(name)
    for model in (ViscoElastic, Linear, MassTensor, NeoHookean):
        assert model(**given.parameters()).young == given.young
    assert "damping:" in given.source
    assert "density" in given.source


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ViscoElastic(-5, 0.3, 1), "young = -5 must be above 0 Pa"),
        (lambda: ViscoElastic(math.nan, 0.3, 1), "young = nan must be a number in Pa"),
        (lambda: ViscoElastic(math.inf, 0.3, 1), "young = inf must be a number in Pa"),
        (lambda: ViscoElastic(True, 0.3, 1), "young = true must be a number in Pa"),
        (lambda: ViscoElastic("1e6", 0.3, 1), "young = .* not text; drop the quotes"),
        (lambda: ViscoElastic(10**400, 0.3, 1), "young = 1000.* at most 1e.100"),
        (lambda: ViscoElastic(10**5000, 0.3, 1), "young = a number of thousands of digits"),
        (lambda: ViscoElastic(1, 0.5, 1), "poisson = 0.5 must be above -1 and below 0.5; .* 0.49"),
        (lambda: ViscoElastic(1, -1, 1), "poisson = -1 must be above -1"),
        (lambda: ViscoElastic(1, 0.3, 0), "density = 0 must be above 0 kg/m³"),
        (lambda: ViscoElastic(1, 0.3, 1, eta=-1), "eta = -1 must be at least 0 Pa·s"),
        (lambda: ViscoElastic(1, 0.3, 1, phi=-1), "phi = -1 must be at least"),
        (lambda: ViscoElastic(1, 0.3, 1, point_damping=-1), "point_damping = -1 must be"),
        (lambda: ViscoElastic(1, 0.3, 1, mass="lumpd"), 'mass = "lumpd" .* did you mean lumped'),
        (lambda: NeoHookean(1, 0.3, 1, mass="consistent"), "mass = .* linear and viscoelastic"),
        (lambda: MassTensor(1, 0.3, 1, mass="consistent"), "mass = .* linear and viscoelastic"),
        (lambda: Linear(1, 0.3, 1, damping_at=2.0), "damping_at = 2.0 needs a damping_ratio"),
        (lambda: Linear(1, 0.3, 1, damping_ratio=0.1, phi=1), "damping_ratio excludes phi and eta"),
        (lambda: Linear.from_lame(1.0, -1.0, 1.0), "lame_mu = -1.0 must be above 0"),
        (lambda: Linear.from_lame(1e20, 1.0, 1.0), "lame_lambda = 1e.20 is too far above"),
        (lambda: MassSpring(young=1e5), "density is missing; .* or node_mass"),
        (lambda: MassSpring(density=1.0), "young is missing; .* or stiffness"),
        (lambda: MassSpring(young=1, density=1, node_mass=1), "node_mass = 1 excludes density"),
        (lambda: MassSpring(node_mass=1, stiffness=[1, -2]), r"stiffness\[1\] = -2 must be above"),
        (lambda: MassSpring(node_mass=1, stiffness="from"), 'stiffness = "from" is not known'),
        (lambda: MassSpring(node_mass=1, stiffness=1, springs=[[0, 0]]), r"springs\[0\] .* itself"),
        (lambda: MassSpring(node_mass=1, stiffness=1, springs=[[0]]), r"springs\[0\] = \[0\] must"),
        (
            lambda: MassSpring(node_mass=1, stiffness=[2.0], springs=[[0, 1, 3.0]]),
            "stiffness is given per spring and in the rows",
        ),
        (lambda: preset("ruber"), 'material = "ruber" is not known; did you mean rubber'),
    ],
)
def test_impossible_materials_say_what_is_wrong(make, message):
    with pytest.raises(FieldError, match=message):
        make()


def test_rows_of_springs_override_the_stiffness_of_all():
    rows = [[0, 1], [1, 2, 5.0], [2, 3, 6.0, 0.5]]
    model = MassSpring(node_mass=0.1, stiffness=3.0, springs=rows)
    assert model.springs.tolist() == [[0, 1], [1, 2], [2, 3]]
    assert model.stiffness.tolist() == [3.0, 5.0, 6.0]
    np.testing.assert_array_equal(model.rest_lengths, [np.nan, np.nan, 0.5])
    again = dataclasses.replace(model, node_mass=0.2)
    np.testing.assert_array_equal(again.stiffness, model.stiffness)
    assert not model.needs_young
    assert MassSpring(young=1.0, density=1.0, springs=rows).needs_young


# Bodies, pins and loads


def test_bodies_without_a_name_get_one():
    scene = Scene()
    names = [scene.add_body(MESH, RUBBER).name for _ in range(2)]
    scene.add_body(MESH, RUBBER, "body2")
    assert [*names, scene.add_body(MESH, RUBBER).name] == ["body0", "body1", "body3"]
    with pytest.raises(FieldError, match='name = "body1" is another body'):
        scene.add_body(MESH, RUBBER, "body1")


def test_an_empty_selection_names_the_pin_and_the_extent_of_the_mesh():
    _, beam = beam_scene()
    with pytest.raises(FieldError) as refused:
        beam.pin(where.box((5, 5, 5), (6, 6, 6)))
    assert refused.value.field == "pin[1].where"
    assert 'no node of "beam", whose mesh spans (0, 0, 0) to (1, 0.2, 0.2)' in str(refused.value)
    assert len(beam.pins) == 1


def test_held_axes_of_overlapping_pins_unite_but_motions_must_agree():
    _, beam = beam_scene()
    beam.pin(where.nodes([0]), "y", velocity=(0.0, 0.0, 0.0))
    beam.pin(FREE_END, "x", velocity=(1.0, 0.0, 0.0))
    beam.pin(FREE_END, "yz")
    with pytest.raises(FieldError, match=r"pin\[5\] moves node 4 along x otherwise than pin\[4\]"):
        beam.pin(FREE_END, "x", velocity=(1.0, 0.0, 0.0))
        beam.pin(FREE_END, "x", velocity=(2.0, 0.0, 0.0))
    with pytest.raises(FieldError, match=r"moves node 0 along x otherwise than pin\[0\]"):
        beam.pin(where.nodes([0]), "x", velocity=(1.0, 0.0, 0.0))


def test_pins_that_turn_agree_along_their_axis_with_pins_that_stay():
    _, beam = beam_scene()
    turn = Turn(point=(0, 0, 0), axis=(0, 0, 5), rate=2.0)
    beam.pin(where.nodes([0]), "z", turn=turn)
    with pytest.raises(FieldError, match="moves node 0 along x"):
        beam.pin(where.nodes([0]), "xy", turn=turn)


def test_prescribed_motions_as_displacement_from_rest():
    points = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 7.0]])
    moved = Pin(where.everything(), velocity=(1, 2, 3)).displacement(points, 2.0)
    np.testing.assert_allclose(moved, [[2, 4, 6], [2, 4, 6]])
    path = Pin(where.everything(), path=[(0, 0, 0, 0), (1, 0, 4, 0), (2, 0, 0, 0)])
    np.testing.assert_allclose(path.displacement(points, 0.25)[0], [0, 1, 0])
    np.testing.assert_allclose(path.displacement(points, 9.0)[0], [0, 0, 0])
    turn = Pin(where.everything(), turn=Turn((0, 0, 0), (0, 0, 2), math.pi / 2))
    expected = [[0, 1, 0], [-2, 0, 7]]
    np.testing.assert_allclose(points + turn.displacement(points, 1.0), expected, atol=1e-15)


def test_load_factors_follow_start_end_ramp_and_table():
    load = Load(where.everything(), force=(0, 0, 1), start=1.0, ramp=2.0, end=5.0)
    assert [load.factor(t) for t in (0.9, 1.0, 2.0, 4.0, 5.0)] == [0.0, 0.0, 0.5, 1.0, 0.0]
    table = Load(where.everything(), pressure=1.0, table=[(1, 2.0), (3, 4.0)])
    assert [table.factor(t) for t in (0, 2, 9)] == [2.0, 3.0, 4.0]
    assert (load.kind, table.kind) == ("force", "pressure")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Pin(where.everything(), "xw"), 'axes = "xw" must be letters of "xyz"'),
        (lambda: Pin(where.everything(), ""), 'axes = "" must be'),
        (lambda: Pin("left"), 'where = "left" must be a selection'),
        (lambda: Pin(where.everything(), "x", velocity=(0, 1, 0)), "moves along y, .* leaves free"),
        (lambda: Pin(where.everything(), release=-1), "release = -1 must be at least 0 s"),
        (
            lambda: Pin(where.everything(), velocity=(1, 0, 0), path=[(0, 0, 0, 0)]),
            "path and velocity exclude each other",
        ),
        (
            lambda: Pin(where.everything(), path=[(1, 0, 0, 0), (0.5, 1, 0, 0)]),
            r"path\[1\]\[0\] = 0.5 goes back in time",
        ),
        (lambda: Pin(where.everything(), path=[]), r"path = \[\] has no rows"),
        (lambda: Turn((0, 0, 0), (0, 0, 0), 1.0), "axis = .* has no direction"),
        (lambda: Load(where.everything()), "needs one of force, traction, pressure, torque"),
        (
            lambda: Load(where.everything(), force=(1, 0, 0), pressure=2.0),
            "pressure and force exclude each other",
        ),
        (
            lambda: Load(where.everything(), pressure=2.0, start=2, end=1),
            "end = 1 must be above 2 s; a load cannot end before its start",
        ),
        (
            lambda: Load(where.everything(), pressure=2.0, table=[(0, 1), (0, 2)]),
            r"table\[1\]\[0\] = 0.0 goes back in time, or stands still",
        ),
        (
            lambda: Load(where.everything(), pressure=2.0, table=[(-1, 1)]),
            r"table\[0\]\[0\] = -1.0 must be a time of at least 0 s",
        ),
        (
            lambda: Load(where.everything(), pressure=2.0, table=[(0, 1)], ramp=1.0),
            "table excludes start, end and ramp",
        ),
        (lambda: Load(where.everything(), pressure=2.0, ramp=0), "ramp = 0 must be above 0 s"),
        (lambda: Load(where.everything(), torque=3.0), "torque = 3.0 must be a Torque"),
        (lambda: Plane(normal=(0, 0, 0)), "normal = .* has no direction"),
        (lambda: Plane(friction=-0.1), "friction = -0.1 must be at least 0"),
        (lambda: Sphere((0, 0, 0), 0), "radius = 0 must be above 0 m"),
        (lambda: Box((0, 0, 0), (1, 1, -1)), r"size\[2\] = -1 must be above 0 m"),
        (lambda: Camera(fov=300), "fov = 300 must be at least 1 and at most 150 degrees"),
        (lambda: Camera(eye=(1, 0, 0), target=(1, 0, 0)), "target = .* is where the eye is"),
        (lambda: Render(size=(0, 720)), r"size\[0\] = 0 must be at least 16"),
        (lambda: Render(color="stres"), 'color = "stres" is not known; did you mean stress'),
        (lambda: Probe("tip", "beam"), "needs one of point, node"),
        (lambda: Probe("a/b", "beam", node=1), 'name = "a/b" must be 1 to 100 printable'),
    ],
)
def test_impossible_parts_say_what_is_wrong(make, message):
    with pytest.raises(FieldError, match=message):
        make()


def test_loads_on_faces_need_faces():
    _, beam = beam_scene()
    assert len(beam.faces(FREE_END)) == 8  # the two triangles of each of four cell faces
    beam.load(FREE_END, traction=(1, 0, 0))
    beam.load(where.nodes([0]), force=(1, 0, 0))
    with pytest.raises(FieldError, match=r"load\[2\].where .* selects no face of 'beam'"):
        beam.load(where.nodes([0, 1]), torque=Torque((0, 0, 0), (1, 0, 0), 1.0))


@pytest.mark.parametrize(
    ("mesh", "model", "message"),
    [
        (
            shapes.cloth((1, 1), (2, 2)),
            RUBBER,
            "model needs tets or hexes, and the mesh of 'b' has none",
        ),
        (
            shapes.cloth((1, 1), (2, 2)),
            MassSpring(density=1.0, stiffness=1.0),
            "density = 1.0 needs a volume, .* node_mass .*, or thickness",
        ),
        (
            shapes.net([[0, 0, 0], [1, 0, 0]], [[0, 1]]),
            MassSpring(node_mass=1.0, young=1e5),
            "stiffness is from-young, which needs a volume",
        ),
        (
            MESH,
            MassSpring(node_mass=[1.0, 2.0], stiffness=1.0),
            "node_mass has 2 numbers for 45 nodes",
        ),
        (
            MESH,
            MassSpring(node_mass=1.0, stiffness=[1.0], springs=[[0, 1], [1, 2]]),
            "stiffness has 1 numbers for 2 springs",
        ),
        (
            MESH,
            MassSpring(node_mass=1.0, stiffness=1.0, springs=[[0, 1], [1, 45]]),
            r"springs\[1\]\[1\] = 45 is no node of .b.",
        ),
    ],
)
def test_a_model_must_fit_its_mesh(mesh, model, message):
    with pytest.raises(FieldError, match=message):
        Scene().add_body(mesh, model, "b")


def test_cloth_with_thickness_has_a_volume():
    sheet = MassSpring(density=1000.0, thickness=1e-3, young=1e6)
    body = Scene().add_body(shapes.cloth((1, 1), (2, 2)), sheet)
    np.testing.assert_array_equal(body.springs(), body.mesh.edges)


# The scene


def test_a_probe_follows_the_nearest_node_or_the_numbered_one():
    scene, beam = beam_scene()
    tip = scene.add_probe("tip", beam, point=(1.02, 0.1, 0.1))
    corner = scene.add_probe("corner", "beam", node=44)
    assert scene.probed(tip).rows.tolist() == [4 + 5 * (1 + 3 * 1)]
    assert scene.probed(corner).rows.tolist() == [44]
    assert scene.probed(tip).body is beam
    with pytest.raises(FieldError, match="node = 45 is no node of the mesh: the highest is 44"):
        scene.add_probe("x", beam, node=45)
    with pytest.raises(FieldError, match=r'body = "baem" names no body .*; did you mean beam'):
        scene.add_probe("x", "baem", node=4)
    with pytest.raises(FieldError, match='name = "tip" is another probe'):
        scene.add_probe("tip", beam, node=4)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"frame_rate": 0}, "frame_rate = 0 must be above 0 frames per second"),
        ({"frame_rate": -24.0}, "frame_rate = -24.0 must be above 0"),
        ({"duration": -1}, "duration = -1 must be at least 0 s"),
        ({"duration": 1e90}, "duration = 1e.90 at 60 frames per second is above 1e.09 frames"),
        ({"gravity": 9.81}, r"gravity = 9.81 must be a list of numbers"),
        ({"gravity": (0, "down", 0)}, r"gravity\[1\] = .down. must be a number in m/s²"),
        ({"step": 0}, "step = 0 must be above 0 s"),
        ({"step": "automatic"}, 'step = "automatic" is not known; did you mean auto'),
        (
            {"integrator": "euler"},
            'integrator = "euler" is not known; use one of symplectic-euler,',
        ),
        ({"integrator": "explicit-euler"}, "integrator = .* needs a step in seconds"),
        ({"start": "half-step"}, "start = .* needs a step in seconds"),
        ({"precision": "f16"}, 'precision = "f16" is not known'),
        ({"checkpoint_every": 1.5}, "checkpoint_every = 1.5 must be a whole number"),
        ({"camera": "front"}, 'camera = "front" must be a Camera'),
    ],
)
def test_impossible_settings_say_what_is_wrong(settings, message):
    with pytest.raises(FieldError, match=message):
        Scene(**settings)


def test_validate_sees_what_was_changed_since():
    scene, beam = beam_scene()
    scene.add_obstacle(Plane())
    scene.validate()
    scene.gravity = [0, 0, -1]
    scene.validate()
    assert scene.gravity == (0.0, 0.0, -1.0)
    beam.pins.append(Pin(where.nodes([99])))
    with pytest.raises(FieldError, match=r"body\[0\].pin\[1\].where.nodes\[0\] = 99 is no node"):
        scene.validate()
    beam.pins.pop()
    with pytest.raises(FieldError, match='model = "rubber" must be a model'):
        beam.model = "rubber"
    assert beam.model is RUBBER
    scene.bodies.append(dataclasses.replace(beam))
    with pytest.raises(FieldError, match=r'body\[1\].name = "beam" is the name of body\[0\] too'):
        scene.validate()


def test_a_scene_without_bodies_is_refused_before_it_runs():
    with pytest.raises(FieldError, match="body is missing"):
        Scene().validate()
    with pytest.raises(FieldError, match=r"obstacle\[0\] = 3 must be a Plane, Sphere, Box,"):
        Scene().add_obstacle(3)
