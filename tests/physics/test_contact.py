"""Contact with obstacles: no penetration, no bounce, Coulomb friction, whatever the direction."""

import re

import numpy as np
import pytest
from beams import INTEGRATORS, displaced, masses, momentum, rotation, simulate

import tisoft as ts
from tisoft.gaps import gap_warnings
from tisoft.rows_in_time import coarse_rows

G = 9.81
STABLE = INTEGRATORS[:2]


def _slope(degrees):
    """Gravity that a plane tilted by `degrees` feels when it is drawn level; downhill is +x."""
    a = np.deg2rad(degrees)
    return (G * np.sin(a), -G * np.cos(a), 0.0)


def _rod(friction, degrees, *, substeps=200, h=1e-3, **keys):
    """Two points lying on the slope, joined along it."""
    mesh = ts.net([[0, 0, 0], [1, 0, 0]], [[0, 1]])
    model = ts.MassSpring(stiffness=100.0, node_mass=0.5)
    plane = ts.Plane(friction=friction)
    return simulate(
        (mesh, model), h=h, substeps=substeps, gravity=_slope(degrees), obstacles=[plane], **keys
    )


@pytest.mark.parametrize("integrator", STABLE)
@pytest.mark.parametrize(("friction", "degrees"), [(0.3, 30), (0.0, 10), (0.5, 27), (1.2, 60)])
def test_points_slide_down_a_slope(friction, degrees, integrator):
    """atan f < θ: the acceleration is g (sin θ − f cos θ), to rounding."""
    sim = _rod(friction, degrees, integrator=integrator)
    sim.step()
    a = G * (np.sin(np.deg2rad(degrees)) - friction * np.cos(np.deg2rad(degrees)))
    # Verlet's last kick is corrected by the next substep's contact only.
    within = 1e-11 if integrator == "symplectic-euler" else 0.5e-3 * G
    assert sim.velocities()[:, 0] == pytest.approx([0.2 * a] * 2, rel=1e-11, abs=within)
    moved = sim.positions()[:, 0] - [0, 1]
    assert moved == pytest.approx([0.5 * a * 0.2**2] * 2, rel=1.1 * 1e-3 / 0.2)


@pytest.mark.parametrize("integrator", STABLE)
@pytest.mark.parametrize(("friction", "degrees"), [(0.3, 16), (0.5, 26), (1.2, 50), (0.1, 0)])
def test_points_stick_on_a_slope(friction, degrees, integrator):
    sim = _rod(friction, degrees, substeps=1000, integrator=integrator)
    sim.step()
    assert sim.positions() == pytest.approx(np.array([[0, 0, 0], [1.0, 0, 0]]), abs=1e-12)


def _block(friction, degrees, **keys):
    """Well damped: with less viscosity a soft block flutters as it slides, about the same mean."""
    mesh = ts.box(size=(0.4, 0.2, 0.2), cells=(4, 2, 2))
    model = ts.ViscoElastic(2e5, 0.3, 1000.0, phi=800.0, eta=800.0)
    plane = ts.Plane(friction=friction)
    return simulate(
        (mesh, model), h=2e-4, substeps=500, gravity=_slope(degrees), obstacles=[plane], **keys
    )


@pytest.mark.parametrize(("friction", "degrees"), [(0.3, 25), (0.6, 40)])
def test_soft_block_slides(friction, degrees):
    sim = _block(friction, degrees)
    for _ in range(4):
        sim.step()  # the vibrations of its arrival die away
    before, t = momentum(sim)[0][0] / 16.0, 0.5
    for _ in range(5):
        sim.step()
    found = (momentum(sim)[0][0] / 16.0 - before) / t
    a = G * (np.sin(np.deg2rad(degrees)) - friction * np.cos(np.deg2rad(degrees)))
    assert found == pytest.approx(a, rel=1e-3)


@pytest.mark.parametrize(("friction", "degrees"), [(0.3, 14), (0.6, 28)])
def test_soft_block_sticks(friction, degrees):
    sim = _block(friction, degrees)
    for _ in range(6):
        sim.step()
    before = sim.positions()
    for _ in range(4):
        sim.step()
    assert np.abs(sim.positions() - before).max() < 1e-4
    assert np.abs(sim.velocities()).max() < 2e-3


OBSTACLES = {
    "plane": ts.Plane(point=(0, -1, 0), friction=0.4),
    # So large that nodes alone meet it: faces are for tests/touch.
    "sphere": ts.Sphere(center=(0.1, -3.6, 0.1), radius=3.2, friction=0.4),
    "box": ts.Box(center=(0.1, -0.7, 0.1), size=(0.7, 0.5, 0.6), friction=0.4),
}


def _gap(name, x):
    """Distance from an obstacle's surface, negative inside."""
    o = OBSTACLES[name]
    if name == "plane":
        return x[:, 1] + 1.0
    if name == "sphere":
        return np.linalg.norm(x - o.center, axis=1) - o.radius
    past = np.abs(x - o.center) - 0.5 * np.array(o.size)
    return np.where((past > 0).any(axis=1), np.linalg.norm(np.maximum(past, 0), axis=1),
                    past.max(axis=1))  # fmt: skip


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("name", OBSTACLES)
def test_dropped_block_stays_outside(name, precision):
    mesh = ts.box(size=(0.2, 0.2, 0.2), cells=(2, 2, 2))
    model = ts.ViscoElastic(1e5, 0.3, 1000.0)
    rounding = 1e-12 if precision == "f64" else 3e-6
    sim = simulate(
        (mesh, model), h=5e-4, substeps=20, gravity=(0, -G, 0), precision=precision,
        obstacles=[OBSTACLES[name]],
    )  # fmt: skip
    least = np.inf
    for _ in range(100):
        sim.step()
        least = min(least, _gap(name, sim.positions()).min())
    assert least > -rounding
    assert least < 1e-6  # it did come down


@pytest.mark.parametrize("name", OBSTACLES)
def test_no_bounce(name):
    """A point that arrives keeps nothing of its velocity towards the obstacle."""
    mesh = ts.net([[0.1, 0.5, 0.1], [0.1, 0.75, 0.1]], [[0, 1]])
    model = ts.MassSpring(stiffness=1e-6, node_mass=1.0)
    sim = simulate((mesh, model), gravity=(0, -G, 0), obstacles=[OBSTACLES[name]])
    sim.stepper.advance(800, 1e-3, (0, -G, 0))
    assert _gap(name, sim.positions()[:1]) == pytest.approx([0.0], abs=1e-12)
    assert np.abs(sim.velocities()[0]).max() < 1e-5


def test_frictionless_contact_takes_momentum_along_the_normal_only():
    normal = np.array([1.0, 2.0, -0.5]) / np.linalg.norm([1.0, 2.0, -0.5])
    mesh = ts.ball(radius=0.2, resolution=3)
    model = ts.ViscoElastic(1e5, 0.3, 1000.0)
    along = np.cross(normal, [0, 0, 1.0])
    start = {"velocity": tuple(-3 * normal + 2 * along)}
    plane = ts.Plane(point=tuple(-0.25 * normal), normal=tuple(normal))
    sim = simulate((mesh, model, start), h=2e-4, substeps=1500, obstacles=[plane])
    before, _ = momentum(sim)
    sim.step()
    change = momentum(sim)[0] - before
    assert change @ normal > 1.0 * np.linalg.norm(before)
    assert np.abs(change - (change @ normal) * normal).max() < 1e-12 * np.linalg.norm(before)


def test_friction_never_speeds_up():
    mesh = ts.ball(radius=0.2, resolution=3)
    start = {"velocity": (2.0, -1.0, 0.0), "spin": (0, 0, 5.0)}
    model = ts.ViscoElastic(1e5, 0.3, 1000.0)
    plane = ts.Plane(point=(0, -0.2, 0), friction=5.0)
    sim = simulate((mesh, model, start), h=2e-4, substeps=25, obstacles=[plane])
    energy = [sim.energy()["kinetic"]]
    for _ in range(60):
        sim.step()
        e = sim.energy()
        energy.append(e["kinetic"] + e["elastic"])
    assert max(energy) <= energy[0] * (1 + 2e-3)
    assert energy[-1] < 0.9 * energy[0]


def test_rigid_load_on_the_ground_weighs_what_it_weighs():
    """Impulses of contact carry the weight: at rest the block's momentum stays where it is."""
    sim = _block(0.5, 0)
    for _ in range(10):
        sim.step()
    elastic = sim.forces()
    bottom = sim.scene.bodies[0].mesh.points[:, 1] < 1e-9
    weight = G * masses(sim)
    assert elastic[bottom, 1].sum() == pytest.approx(-weight[~bottom].sum(), rel=1e-4)


@pytest.mark.parametrize("kind", ["plane", "sphere"])
def test_turned_scene_gives_the_turned_answer(kind):
    R = rotation((1, -2, 0.5), 2.2)
    mesh = ts.box(size=(0.3, 0.2, 0.2), cells=(3, 2, 2)).transformed(translate=(0.05, 0.1, 0))
    turned = ts.TetMesh(mesh.points @ R.T, mesh.tets, mesh.kept_nodes)
    answers = []
    for body, T in ((mesh, np.eye(3)), (turned, R)):
        if kind == "plane":
            normal = np.array([0.2, 1.0, 0.1])
            obstacle = ts.Plane(point=(0, 0, 0), normal=tuple(T @ normal), friction=0.3)
        else:
            center = T @ np.array([0.1, -4.95, 0.05])
            obstacle = ts.Sphere(center=tuple(center), radius=5.0, friction=0.3)
        model = ts.ViscoElastic(1e5, 0.3, 1000.0, phi=20.0, eta=20.0)
        sim = simulate(
            (body, model), h=5e-4, substeps=600, gravity=tuple(T @ [1.0, -G, 0]),
            obstacles=[obstacle],
        )  # fmt: skip
        sim.step()
        answers.append(sim.positions())
    assert np.abs(answers[1] - answers[0] @ R.T).max() < 1e-9


def test_pinned_nodes_pass_through_obstacles():
    mesh = ts.net([[0, -0.5, 0], [0, 1, 0]], [[0, 1]])
    sim = simulate(
        (mesh, ts.MassSpring(stiffness=10.0, node_mass=1.0)),
        pins=[(ts.where.nodes([0]), "xyz")], obstacles=[ts.Plane()], substeps=100,
    )  # fmt: skip
    sim.step()
    assert sim.positions()[0] == pytest.approx([0, -0.5, 0])


def test_node_that_starts_inside_is_put_onto_the_surface():
    mesh = ts.net([[0, 0.5, 0], [0, 1, 0]], [[0, 1]])
    model = ts.MassSpring(stiffness=1e-6, node_mass=1.0)
    sim = simulate((mesh, model), obstacles=[ts.Plane()], substeps=5)
    displaced(sim, [[0, -0.6, 0], [0, 0, 0]])
    assert sim.pushing.speeds[0] == pytest.approx(0.1)  # m/s: within a second
    while sim.pushing.goes_on and sim.time < 1.1:
        sim.step()
    assert sim.positions()[0] == pytest.approx([0, 0, 0], abs=1e-8)
    assert np.abs(sim.velocities()[0]).max() < 1e-6


# -- obstacles that move, and starts inside them --------------------------------------------------


def _cube(obstacle, *, rate=50, gravity=(0, -10, 0), more=()):
    scene = ts.Scene(gravity=gravity, frame_rate=rate, precision="f64", obstacles=[obstacle, *more])
    mesh = ts.box((0.2, 0.2, 0.2), (2, 2, 2))
    body = scene.add_body(mesh, ts.NeoHookean(1e5, 0.3, 1000.0, damping_ratio=0.2))
    return scene, body


@pytest.mark.parametrize("rate", [10, 200])
def test_a_belt_drags_by_friction_and_its_work_is_work_from_outside(rate):
    """v = μ g t while the block slides; the belt gives μ m g w t, and half of it heats at first."""
    scene, _ = _cube(ts.Plane(friction=0.1, velocity=(2, 0, 0)), rate=rate)
    sim = ts.Simulation(scene, ledger=True, threads=1)
    sim.run(1.0)
    mass = 8.0
    told = sim.energy()
    assert sim.measures.momentum()[0] / mass == pytest.approx(1.0, rel=2e-3)
    assert told["external_work"] == pytest.approx(0.1 * mass * 10 * 2, rel=5e-3)
    assert told["dissipated"] == pytest.approx(0.1 * mass * 10 * (2 - 0.5), rel=1e-2)
    assert abs(told["error"]) < 1e-3
    assert not sim.recoveries


def test_a_turned_floor_and_a_lid_that_comes_down_are_followed(tmp_path):
    """A table that turns takes the block with it; a lid presses it to the height that is left."""
    turn = ts.Turn((0.1, 0, 0.1), (0, 1, 0), 1.0)
    lid = ts.Plane((0, 0.21, 0), (0, -1, 0), path=[(0.2, 0, 0, 0), (0.6, 0, -0.02, 0)])
    scene, body = _cube(ts.Plane(friction=1.0, turn=turn), more=[lid])
    sim = ts.Simulation(scene, ledger=True, threads=1)
    sim.run(0.5)
    sim.save(tmp_path / "a.npz")
    again = ts.Simulation.load(tmp_path / "a.npz")
    sim.run(0.5), again.run(0.5)
    assert np.array_equal(sim.positions(), again.positions())
    y = sim.positions(body)[:, 1]
    assert (y.min(), y.max()) == pytest.approx((0.0, 0.19), abs=1e-9)
    bottom = body.mesh.points[:, 1] < 1e-9
    arm = sim.positions(body)[bottom] - np.array(turn.point)
    speeds = sim.velocities(body)[bottom]
    assert speeds == pytest.approx(np.cross([0, 1.0, 0], arm), abs=2e-3)
    assert sim.energy()["dissipated"] > 0
    assert not sim.recoveries


def test_a_bead_slides_along_a_box_that_turns(tmp_path):
    """As seen from a face at d from the axis s̈ = ω² s, from ṡ = ω d: a bead at rest is hit there.
    The box's work is the bead's energy, and as much as the blow took at first.
    """
    d, omega, m = 0.05, 2.0, 1.0
    mesh = ts.net([[0.2, d, 0], [9, 9, 0]], [[0, 1]])
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64", frame_rate=20, step=1e-4)
    scene.add_body(mesh, ts.MassSpring(stiffness=1e-9, node_mass=m))
    turn = ts.Turn((0, 0, 0), (0, 0, 1), omega)
    # Halfway round, so that the frame's rotation goes past the largest that its numbers tell.
    scene.add_obstacle(ts.Box((0, 0, 0), (3, 2 * d, 1), rotate=(0, 0, 180), turn=turn))
    sim = ts.Simulation(scene, ledger=True, threads=1)
    sim.run(0.25)
    sim.save(tmp_path / "a.npz")
    again = ts.Simulation.load(tmp_path / "a.npz")
    sim.run(0.25), again.run(0.25)
    assert np.array_equal(sim.positions(), again.positions())
    t = omega * 0.5
    s = 0.2 * np.cosh(t) + d * np.sinh(t)
    rate = omega * (0.2 * np.sinh(t) + d * np.cosh(t))
    along, out = np.array([np.cos(t), np.sin(t), 0]), np.array([-np.sin(t), np.cos(t), 0])
    assert sim.positions()[0] == pytest.approx(s * along + d * out, abs=2e-4)
    v = (rate - omega * d) * along + omega * s * out
    assert sim.velocities()[0] == pytest.approx(v, abs=2e-3)
    told = sim.energy()
    assert told["dissipated"] == pytest.approx(0.5 * m * (omega * 0.2) ** 2, rel=2e-3)
    assert told["external_work"] == pytest.approx(0.5 * m * v @ v + told["dissipated"], rel=1e-3)


def test_a_start_inside_is_pushed_out_gently(tmp_path):
    depth = 0.02
    scene, body = _cube(ts.Plane((0, depth, 0), friction=0.5))
    sim = ts.Simulation(scene, ledger=True, threads=1)
    sim.run(0.04)
    assert sim.pushing.goes_on
    sim.save(tmp_path / "a.npz")
    again = ts.Simulation.load(tmp_path / "a.npz")
    sim.run(1.5), again.run(1.5)
    assert np.array_equal(sim.positions(), again.positions())
    told, y = sim.energy(), sim.positions(body)[:, 1] - depth
    free, _ = _cube(ts.Plane(friction=0.5))
    own = ts.Simulation(free, threads=1)
    own.run(1.5)
    assert not sim.recoveries and not sim.pushing.goes_on
    assert y.min() >= -1e-9
    assert y.max() == pytest.approx(own.positions()[:, 1].max(), abs=2e-5)
    assert told["dissipated"] > 0 and abs(told["error"]) < 0.02 * told["external_work"]


@pytest.mark.parametrize("release", [0.2, 0.21])
def test_what_a_pin_lets_go_of_inside_an_obstacle_is_pushed_out_gently(release):
    """A lid goes over held nodes, which are let go of on a frame, or between two.  Put out at once,
    10.7 J came from nowhere, of 5.9 J that are needed.
    """
    lid = ts.Plane((0, 0.21, 0), (0, -1, 0), path=[(0.0, 0, 0, 0), (0.1, 0, -0.03, 0)])
    scene, body = _cube(lid, gravity=(0, 0, 0), more=[ts.Plane()])
    body.pin(ts.where.plane((0, 0.2, 0), (0, -1, 0)), release=release)
    sim = ts.Simulation(scene, ledger=True, threads=1)
    sim.run(0.19)
    assert not sim.pushing.goes_on and sim.watch.pushed() == []
    sim.run(0.04)
    assert sim.pushing.goes_on
    sim.run(1.0)
    told, y = sim.energy(), sim.positions(body)[:, 1]
    assert y.max() <= 0.18 + 1e-9 and not sim.pushing.goes_on and not sim.recoveries
    assert abs(told["error"]) < 0.02 * told["external_work"]
    assert told["external_work"] == pytest.approx(told["elastic"] + told["dissipated"], rel=0.02)
    (sentence,) = sim.watch.pushed()
    assert "9 nodes inside obstacle[0], 0.02 m deep" in sentence


def test_a_body_made_a_hundred_times_stiffer_knows_where_its_energy_comes_from():
    """Its step is a tenth and less then: a kick over half of the old one would be a blow."""
    scene, body = _cube(ts.Plane(friction=0.5))
    sim = ts.Simulation(scene, ledger=True, threads=1)
    sim.run(0.16)
    body.model = ts.NeoHookean(1e7, 0.3, 1000.0, damping_ratio=0.2)
    sim.run(0.1)
    told = sim.energy()
    assert abs(told["error"]) < 0.03 * told["external_work"]


def test_obstacles_put_elsewhere_between_frames_are_followed():
    scene, body = _cube(ts.Plane(), gravity=(0, 0, 0), more=[ts.Plane((0, 0.2, 0), (0, -1, 0))])
    sim = ts.Simulation(scene, ledger=True, threads=1)
    for frame in sim.frames(1.0):
        lid = 0.2 - 0.01 * min(1.0, 2 * frame.time)
        scene.obstacles[1] = ts.Plane((0, lid, 0), (0, -1, 0))
    y, told = sim.positions(body)[:, 1], sim.energy()
    assert (y.min(), y.max()) == pytest.approx((0.0, 0.19), abs=1e-6)
    assert told["external_work"] == pytest.approx(told["elastic"] + told["dissipated"], rel=0.05)
    assert told["dissipated"] > 0
    scene.obstacles.append(ts.Sphere((0.1, 1.3, 0.1), 0.05, friction=1.0))
    sim.step()
    scene.obstacles.clear()
    sim.step()
    assert not sim.recoveries


def test_an_obstacle_between_nodes_is_told_before_and_what_it_did_afterwards():
    """Where nodes alone meet obstacles a net that a ball fits through falls on, and says so."""
    scene = ts.Scene(gravity=(0, -9.81, 0), precision="f64", frame_rate=50)
    mesh = ts.cloth((1, 1), (4, 4)).transformed(translate=(-0.375, 0.3, -0.375))
    faceless = ts.net(mesh.points, mesh.edges)
    scene.add_body(faceless, ts.MassSpring(stiffness=100.0, node_mass=0.01), "cloth")
    scene.add_obstacle(ts.Sphere((0, 0.1, 0), 0.15))
    (before,) = gap_warnings(scene)
    assert before.startswith("obstacle[0] (radius 0.15 m) is smaller than the mesh of body ")
    assert "edges up to 0.354 m" in before and "take edges of 0.15 m or less" in before
    sim = ts.Simulation(scene, threads=1)
    for _ in sim.frames(0.3):
        pass
    (after,) = sim.warnings
    assert re.search(r'"cloth" was 0\.\d+ m inside obstacle\[0\] between its nodes, at', after)
    scene.bodies[0] = ts.Body("cloth", mesh, ts.MassSpring(stiffness=100.0, node_mass=0.01))
    assert not list(gap_warnings(scene))


def test_rows_finer_than_a_substep_are_told():
    scene = ts.Scene(gravity=[[0, 0, 0, 0], [0.5, 0, 0, 1], [0.501, 0, 0, 0]])
    body = scene.add_body(ts.box((1, 1, 1), (1, 1, 1)), ts.ViscoElastic(1e6, 0.3, 1000.0))
    body.pin(ts.where.everything(), path=[[0, 0, 0, 0], [1, 1, 0, 0]])
    (told,) = coarse_rows(scene, 2e-3)
    assert told.startswith("gravity has rows 0.001 s apart, as [1] and [2], finer than the substep")
    assert not list(coarse_rows(scene, 5e-4))
