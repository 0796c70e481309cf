"""Quantities that colours show, what is drawn for a body, the view, and checks' reasons."""

from dataclasses import replace

import numpy as np
import pytest

import tisoft as ts
from tisoft.check.limiting import damping_cost, limiting_element, metres
from tisoft.check.warnings import compression, elements_through, warnings_of
from tisoft.depth import depth_inside
from tisoft.geometry.groups import Region
from tisoft.observers.film import Film
from tisoft.observers.framing import Survey, camera_of, ground_of, room_of, up_of
from tisoft.observers.quantities import node_values, virial_stress
from tisoft.observers.scenery import actors_of, body_items
from tisoft.observers.track import Track
from tisoft.render.colormap import PALETTE
from tisoft.render.items import Capsules, Spheres, Surface

YOUNG, POISSON = 1e5, 0.3


def block(model=None, **scene_settings):
    scene = ts.Scene(**scene_settings)
    mesh = ts.box(size=(0.4, 0.2, 0.2), cells=(2, 1, 1))
    scene.add_body(mesh, model or ts.ViscoElastic(YOUNG, POISSON, 1000.0), "block")
    return scene


def deformed(scene, gradient):
    """A simulation whose positions are gradient @ rest position."""
    sim = ts.Simulation(scene, precision="f64")
    points = np.concatenate([body.mesh.points for body in scene.bodies])
    sim.set_state(points @ np.asarray(gradient, float).T, np.zeros_like(points))
    return sim


@pytest.mark.parametrize("model", [ts.ViscoElastic, ts.NeoHookean, ts.Linear])
def test_stress_of_a_small_pull_is_youngs_modulus_times_strain(model):
    pull = 1e-6
    stretch = np.diag([1 + pull, 1 - POISSON * pull, 1 - POISSON * pull])
    sim = deformed(block(model(YOUNG, POISSON, 1000.0)), stretch)
    assert node_values(sim, "stress") == pytest.approx(YOUNG * pull, rel=1e-4)
    shown = 100.0 * pull * 2.0 / 3.0 * (1.0 + POISSON)  # the deviator's equivalent, in per cent
    assert node_values(sim, "strain") == pytest.approx(shown, rel=1e-4)


def test_turning_and_swelling_are_no_equivalent_stress():
    turn = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    sim = deformed(block(), turn)
    assert node_values(sim, "stress") == pytest.approx(0.0, abs=1e-9 * YOUNG)
    assert node_values(sim, "strain") == pytest.approx(0.0, abs=1e-9)
    sim = deformed(block(), 1.1 * np.eye(3))
    assert node_values(sim, "stress") == pytest.approx(0.0, abs=1e-9 * YOUNG)


def test_springs_show_their_elongation():
    sim = deformed(block(ts.MassSpring(young=YOUNG, density=1000.0)), 1.05 * np.eye(3))
    assert node_values(sim, "strain") == pytest.approx(5.0, rel=1e-6)


def test_virial_stress_of_springs_does_the_work_that_they_store():
    pull = 1e-4
    sim = deformed(block(ts.MassSpring(young=YOUNG, density=1000.0)), np.diag([1 + pull, 1, 1]))
    (part,) = sim.parts
    stress = virial_stress(part, np.array(sim.system.u))
    mean = (part.mass / 1000.0) @ stress[:, 0, 0]  # a node's volume is its mass over the density
    assert 0.5 * pull * mean == pytest.approx(sim.energy()["elastic"], rel=1e-3)


def test_speed_is_the_length_of_the_velocity():
    scene = block()
    scene.bodies[0].velocity = (3.0, 4.0, 0.0)
    assert node_values(ts.Simulation(scene), "speed") == pytest.approx(5.0)


def test_bare_springs_have_no_stress_and_say_so():
    scene = ts.Scene()
    net = ts.net([[0, 0, 0], [1, 0, 0]], [[0, 1]])
    scene.add_body(net, ts.MassSpring(stiffness=10.0, node_mass=0.1), "rope")
    with pytest.raises(ts.SceneError, match="no volume, so no stress"):
        node_values(ts.Simulation(scene), "stress")


def test_springs_are_drawn_as_springs_and_cloth_as_cloth():
    spring = ts.MassSpring(stiffness=10.0, node_mass=0.1)
    kinds = {}
    for name, mesh in {
        "cloth": ts.cloth((1, 1), (2, 2)),
        "grid": ts.grid((1, 1, 1), (2, 2, 2)),
        "tets": ts.box((1, 1, 1), (1, 1, 1)),
    }.items():
        body = ts.Body(name, mesh, spring)
        items = body_items(body, 0, mesh.points, 0, wireframe=False)
        kinds[name] = [type(item) for item in items]
    assert kinds == {
        "cloth": [Surface],
        "grid": [Capsules, Spheres],
        "tets": [Capsules, Spheres],
    }


def test_every_region_has_a_colour_of_its_own_and_a_cell_of_two_shows_the_first():
    mesh = ts.box((3, 1, 1), (3, 1, 1))
    third = mesh.points[mesh.tets].mean(axis=1)[:, 0].astype(int)
    regions = (Region("middle", 1, np.flatnonzero(third == 1)),)
    regions += (Region("far", 2, np.flatnonzero(third >= 1)),)
    scene = ts.Scene(render=ts.Render(color="region"))
    for _ in range(2):
        scene.add_body(replace(mesh, regions=regions), ts.Linear(1e5, 0.3, 1000.0))
    for actor, number in zip(actors_of(scene), (0, 3), strict=True):
        assert [item.color for item in actor.items] == list(PALETTE[number : number + 3])
        for k, item in enumerate(actor.items):
            middle = item.positions[item.triangles].mean(axis=1)[:, 0]
            assert (middle.min() >= k) and (middle.max() <= k + 1)


def test_view_holds_the_motion_and_small_obstacles_but_not_large_ones():
    scene = block()
    scene.add_obstacle(ts.Sphere((0, -1, 0), 0.2))
    scene.add_obstacle(ts.Sphere((0, -100, 0), 50.0))
    survey = Survey(np.zeros(3), np.ones(3))
    lo, hi = room_of(scene, survey)
    assert lo[1] == pytest.approx(-1.2) and hi[1] == 1.0
    camera = camera_of(scene, survey)
    right, up, forward = camera.axes()
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    ray = corners - np.array(camera.eye)
    tan = np.tan(np.radians(camera.fov) / 2)
    assert (np.abs(ray @ up) < tan * (ray @ forward)).all()
    assert (np.abs(ray @ right) < tan * 16 / 9 * (ray @ forward)).all()


@pytest.mark.parametrize("radius", [1.45, 1.55])
def test_obstacles_of_up_to_three_times_the_motion_are_shown_whole(radius):
    scene = block()
    scene.add_obstacle(ts.Sphere((0, -10, 0), radius))
    lo, _ = room_of(scene, Survey(np.zeros(3), np.ones(3)))
    assert lo[1] == pytest.approx(-10.0 - radius if radius < 1.5 else 0.0)


def test_up_is_against_gravity_and_the_ground_is_the_most_level_plane():
    scene = block(gravity=(0.0, 0.0, -9.81))
    assert up_of(scene).tolist() == [0, 0, 1]
    scene.add_obstacle(ts.Plane((0, 0, 0), (1, 0, 0)))
    assert ground_of(scene, up_of(scene)) is None
    slope = scene.add_obstacle(ts.Plane((0, 0, 0), (1, 0, 1)))
    assert ground_of(scene, up_of(scene)) is slope
    floor = scene.add_obstacle(ts.Plane((0, 0, -1), (0, 0, 1)))
    assert ground_of(scene, up_of(scene)) is floor


def test_view_of_the_start_reaches_down_to_the_ground():
    scene = block()
    scene.add_obstacle(ts.Plane((0, -3, 0), (0, 1, 0)))
    survey = Survey.of_start(ts.Simulation(scene))
    assert survey.lo[1] == pytest.approx(-3.0)
    assert survey.hi[1] == pytest.approx(0.2)


class Pictures(list):
    write = list.append


def test_film_keeps_its_range_and_the_picture_asked_for():
    scene = block(duration=0.1, frame_rate=20.0)
    scene.bodies[0].velocity = (1.0, 0.0, 0.0)
    scene.render = ts.Render(size=(320, 240), color="speed", samples=1)
    scene.camera = ts.Camera(eye=(0.2, 0.1, 4.0), target=(0.2, 0.1, 0.0))  # not under the bar
    track = Track("speed")
    ts.Simulation(scene).run(observers=[track])
    survey = Survey.of(track)
    assert len(survey.tops) == 3
    film = Film(Pictures(), survey)
    film.kept_index = 1
    ts.Simulation(scene).run(observers=[film])
    assert len(film.sink) == 3
    assert film.kept is film.sink[1]
    bar = [picture[40:145, 280:303] for picture in film.sink]
    assert (bar[0][:, -5:] == bar[2][:, -5:]).all()  # the strip, and its ticks to the left
    assert (bar[0] == bar[2]).mean() > 0.7


def test_film_without_a_first_look_never_narrows_its_range():
    scene = block(duration=0.1, frame_rate=20.0)
    scene.render = ts.Render(size=(320, 240), color="speed", samples=1)
    film = Film(Pictures())
    ts.Simulation(scene).run(observers=[film])
    assert film.scenery.survey.top == 1.0  # from 9.81 * 0.1, rounded up


def test_a_flat_tet_is_named_with_its_altitude():
    mesh = ts.box(size=(0.4, 0.2, 0.2), cells=(4, 2, 2))
    points = mesh.points.copy()
    corner = int(np.argmin(np.linalg.norm(points, axis=1)))
    (lonely,) = np.flatnonzero((mesh.tets == corner).any(axis=1))
    others = np.setdiff1d(mesh.tets[lonely], corner)
    points[corner] = 0.05 * points[corner] + 0.95 * points[others].mean(axis=0)
    scene = ts.Scene()
    flat = ts.tet_mesh(points, mesh.tets)
    scene.add_body(flat, ts.ViscoElastic(YOUNG, POISSON, 1000.0), "block")
    limiting = limiting_element(ts.Simulation(scene))
    assert limiting["element"] == lonely and limiting["kind"] == "tet"
    assert "smallest altitude is 2.89 mm" in limiting["reason"]
    assert "times in speed" in limiting["reason"]


def test_the_stiffer_body_sets_the_step_and_is_told_so():
    scene = block()
    stiff = ts.box(size=(0.4, 0.2, 0.2), cells=(2, 1, 1)).transformed(translate=(2, 0, 0))
    scene.add_body(stiff, ts.ViscoElastic(100 * YOUNG, POISSON, 1000.0), "stiff")
    limiting = limiting_element(ts.Simulation(scene))
    assert limiting["body"] == "stiff"
    assert "waves run 10 times faster" in limiting["reason"]


def test_a_light_node_is_named():
    net = ts.net([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]], [[0, 1], [1, 2], [2, 3]])
    scene = ts.Scene()
    masses = [1.0, 1.0, 1.0, 0.01]
    scene.add_body(net, ts.MassSpring(stiffness=100.0, node_mass=masses), "rope")
    limiting = limiting_element(ts.Simulation(scene))
    assert limiting["element"] == 2 and limiting["kind"] == "spring"
    assert "node 3 is 1e+02 times lighter" in limiting["reason"]


def test_damping_costs_what_the_bound_says():
    undamped = ts.Simulation(block())
    assert damping_cost(undamped) == 1.0
    damped = ts.Simulation(block(ts.ViscoElastic(YOUNG, POISSON, 1000.0, phi=300.0, eta=300.0)))
    assert damping_cost(damped) == pytest.approx(
        undamped.limit.bound() / damped.limit.bound(), rel=0.1
    )


def test_depth_inside_obstacles_is_positive_only_inside():
    points = np.array([[0.0, -0.1, 0.0], [0.0, 0.0, 0.0], [0.0, 0.5, 0.0]])
    plane = depth_inside(ts.Plane((0, 0, 0), (0, 1, 0)), points)
    assert plane[0] == pytest.approx(0.1) and plane[1] <= 0.0 and plane[2] < 0.0
    sphere = depth_inside(ts.Sphere((0, 0, 0), 0.2), points)
    assert (sphere > 0.0).tolist() == [True, True, False]
    box = depth_inside(ts.Box((0, 0, 0), (0.1, 0.3, 0.1)), points)
    assert (box > 0.0).tolist() == [True, True, False]


@pytest.mark.parametrize(("cells", "through"), [((8, 1, 1), 1), ((8, 2, 2), 2), ((16, 4, 4), 4)])
def test_elements_through_the_thickness_of_a_beam(cells, through):
    assert elements_through(ts.box((1, 0.2, 0.2), cells)) == through


def test_a_soft_heavy_faller_is_warned_of():
    scene = block(ts.ViscoElastic(5e3, POISSON, 1000.0))
    scene.bodies[0].mesh = scene.bodies[0].mesh.transformed(translate=(0, 1, 0))
    assert compression(scene.bodies[0], scene) == 0.0  # nothing to fall on
    scene.add_obstacle(ts.Plane())
    assert compression(scene.bodies[0], scene) > 1.0
    assert any("turn inside out" in told for told in warnings_of(scene))
    scene.bodies[0].model = ts.NeoHookean(5e3, POISSON, 1000.0)
    assert warnings_of(scene) == []


@pytest.mark.parametrize(
    ("length", "told"), [(2.0, "2 m"), (0.0123, "12.3 mm"), (3e-5, "30 µm"), (1e-9, "1e-09 m")]
)
def test_lengths_have_handy_units(length, told):
    assert metres(length) == told
