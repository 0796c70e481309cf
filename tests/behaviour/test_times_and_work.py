"""What happens at its own moment, and what it costs: releases, torques, pushes, mass, probes."""

import csv
import json

import numpy as np
import pytest

import tisoft as ts
from tisoft.cli import main


def block(model=None, *, settings=None, size=(0.4, 0.2, 0.2), cells=(2, 1, 1), **body_keys):
    keys = {"gravity": (0, 0, 0), "precision": "f64", "frame_rate": 50.0} | (settings or {})
    scene = ts.Scene(**keys)
    mesh = ts.box(size=size, cells=cells)
    body = scene.add_body(mesh, model or ts.ViscoElastic(1e5, 0.3, 1000.0), **body_keys)
    return scene, body


# -- a pin let go ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rate", "release", "frame"),
    [
        (50.0, 0.1, 5),
        (60.0, 0.1 + 0.2, 18),  # 0.30000000000000004
        (60.0, 0.3, 18),
        (30.0, 0.7, 21),
        (24.0, 1.0 / 3.0, 8),
        (10.0, 0.7 - 0.1, 6),  # 0.6 in floats is 0.6, this is 0.6 - 1e-16
        (3.0, 1.0 / 3.0, 1),
    ],
)
def test_a_pin_released_at_the_end_of_a_frame_holds_that_frame_and_not_the_next(
    rate, release, frame
):
    scene, body = block(settings={"gravity": (0, -9.81, 0), "frame_rate": rate})
    body.pin(ts.where.everything(), release=release)
    sim = ts.Simulation(scene, threads=1)
    for _ in range(frame):
        sim.step()
        assert (sim.velocities() == 0.0).all()
    for fallen in (1, 2):
        sim.step()
        assert sim.velocities()[:, 1] == pytest.approx(-9.81 * fallen / rate, rel=1e-9)


# -- a torque ----------------------------------------------------------------------------------


def spin_of(sim):
    """Angular momentum about the centre of mass [kg m²/s]."""
    mass, x, v = sim.masses()[:, None], sim.positions(), sim.velocities()
    middle = (mass * x).sum(axis=0) / mass.sum()
    return np.cross(x - middle, mass * v).sum(axis=0)


def test_a_torque_follows_its_face_within_a_frame():
    """A face that turns by half a radian a frame about x, under a moment about z: forces that lag
    by a quarter of a radian would have a quarter of their moment about y."""
    scene, body = block(ts.ViscoElastic(1e6, 0.3, 1000.0), spin=(25.0, 0, 0))
    end = ts.where.box((0.4 - 1e-6, -9, -9), (9, 9, 9))
    body.load(end, torque=ts.Torque((0.4, 0.1, 0.1), (0, 0, 1), 0.5))
    sim = ts.Simulation(scene, threads=1)
    start = spin_of(sim)
    for _ in range(10):
        sim.step()
    gained = (spin_of(sim) - start) / (0.5 * sim.time)
    assert gained == pytest.approx([0, 0, 1], abs=0.06)


def test_a_torque_does_moment_times_angle_of_work():
    scene, body = block(ts.ViscoElastic(1e6, 0.3, 1000.0), spin=(5.0, 0, 0))
    body.load(ts.where.everything(), torque=ts.Torque((0, 0.1, 0.1), (1, 0, 0), 0.5))
    sim = ts.Simulation(scene, threads=1, ledger=True)
    inertia = spin_of(sim)[0] / 5.0
    for _ in range(10):
        sim.step()
    assert spin_of(sim)[0] == pytest.approx(5.0 * inertia + 0.5 * sim.time, rel=3e-3)
    angle = 5.0 * sim.time + 0.5 * 0.5 / inertia * sim.time**2
    assert sim.energy()["external_work"] == pytest.approx(0.5 * angle, rel=0.01)


# -- a push out of an obstacle ---------------------------------------------------------------------


def test_a_push_out_of_an_obstacle_is_booked():
    """Ten nodes begin 0.2 m inside a plane, in a weight: the obstacle lifts them, m g d each."""
    net = ts.net([[float(k), -0.2, 0] for k in range(10)], [[k, k + 1] for k in range(9)])
    scene = ts.Scene(gravity=(0, -10.0, 0), precision="f64", step=1e-3, frame_rate=100.0)
    scene.add_body(net, ts.MassSpring(stiffness=1.0, node_mass=0.5))
    scene.add_obstacle(ts.Plane(point=(0, 0, 0), normal=(0, 1, 0)))
    sim = ts.Simulation(scene, threads=1, ledger=True)
    for _ in range(102):  # it comes out within a second
        sim.step()
    energy = sim.energy()
    lifted = 10 * 0.5 * 10.0 * 0.2
    assert sim.positions()[:, 1] == pytest.approx(0.0, abs=1e-12)
    assert energy["gravity"] == pytest.approx(lifted)
    assert energy["external_work"] - energy["dissipated"] == pytest.approx(lifted, rel=1e-2)
    assert abs(energy["error"]) < 0.01 * lifted


def test_a_push_against_a_load_is_booked():
    net = ts.net([[0.0, -0.2, 0], [1.0, -0.2, 0]], [[0, 1]])
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64", step=1e-3, frame_rate=100.0)
    body = scene.add_body(net, ts.MassSpring(stiffness=1.0, node_mass=0.5))
    body.load(ts.where.everything(), force=(0, -20.0, 0))
    scene.add_obstacle(ts.Plane(point=(0, 0, 0), normal=(0, 1, 0)))
    sim = ts.Simulation(scene, threads=1, ledger=True)
    for _ in range(102):
        sim.step()
    energy = sim.energy()
    assert sim.positions()[:, 1] == pytest.approx(0.0, abs=1e-12)
    # What the load takes on the way, F d = 4 J a node, the obstacle gives.
    assert energy["external_work"] == pytest.approx(0.0, abs=0.08)
    assert energy["dissipated"] == pytest.approx(0.0, abs=0.08)
    assert abs(energy["error"]) < 0.04


# -- consistent mass -----------------------------------------------------------------------------


def consistent_mass(mesh, density):
    """M_ab = Σ ρ V/20 (1 + δ_ab), a dense matrix [kg]."""
    matrix = np.zeros((len(mesh.points),) * 2)
    weight = (np.ones((4, 4)) + np.eye(4)) / 20.0
    corners = mesh.points[mesh.tets]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0
    for tet, volume in zip(mesh.tets, volumes, strict=True):
        matrix[np.ix_(tet, tet)] += density * volume * weight
    return matrix


@pytest.mark.parametrize(("precision", "most"), [("f32", 1e-6), ("f64", 1e-14)])
def test_consistent_mass_turns_forces_into_the_accelerations_of_the_matrix(precision, most):
    """One substep from rest: v = h M⁻¹ f, however rough f is over the nodes."""
    step = 1e-6
    keys = {"precision": precision, "step": step, "frame_rate": 1.0 / step}
    model = ts.ViscoElastic(1e5, 0.3, 1000.0, mass="consistent")
    scene, body = block(model, settings=keys, size=(1, 0.4, 0.4), cells=(5, 2, 2))
    pushed = 7
    body.load(ts.where.nodes([pushed]), force=(1.0, -2.0, 3.0))
    body.pin(ts.where.nodes([0, 3]), axes="y")
    sim = ts.Simulation(scene, threads=1)
    sim.step()
    matrix = consistent_mass(body.mesh, 1000.0)
    expected = np.zeros_like(body.mesh.points)
    for axis, force in enumerate((1.0, -2.0, 3.0)):
        rows = np.array([k for k in range(len(matrix)) if axis != 1 or k not in (0, 3)])
        right = np.where(rows == pushed, force, 0.0)
        expected[rows, axis] = step * np.linalg.solve(matrix[np.ix_(rows, rows)], right)
    assert np.abs(sim.velocities() - expected).max() < most * np.abs(expected).max()


# -- what a run tells --------------------------------------------------------------------------

FALL = """
gravity = [0, -10, 2]
duration = 0.5
frame_rate = 20

[[body]]
name = "block"
young = 1e5
poisson = 0.3
density = 1000
velocity = [3, 4, 0]

[body.mesh]
box = { size = [0.4, 0.2, 0.2], cells = [2, 1, 1] }

[[probe]]
name = "corner"
body = "block"
point = [0.4, 0.2, 0.2]
"""


def test_a_probe_tells_where_it_is_how_far_it_went_and_how_fast(tmp_path, capsys):
    path = tmp_path / "fall.toml"
    path.write_text(FALL, encoding="utf-8")
    out = tmp_path / "out"
    assert main(["run", str(path), "--json", "-o", str(out), "--precision", "f64"]) == 0
    told = json.loads(capsys.readouterr().out)
    corner = told["probes"]["corner"]
    assert corner["velocity"] == pytest.approx([3.0, 4.0 - 10 * 0.5, 2 * 0.5], rel=1e-9)
    # Symplectic Euler falls h/2 ahead of the parabola.
    way = np.array([1.5, 2.0 - 1.25, 0.25])
    assert corner["displacement"] == pytest.approx(way, abs=0.03)
    assert np.array(corner["position"]) - corner["displacement"] == pytest.approx([0.4, 0.2, 0.2])
    rows = list(csv.reader((out / "probes.csv").read_text(encoding="utf-8").splitlines()))
    assert rows[0] == ["time", "corner.x", "corner.y", "corner.z"]
    assert [float(cell) for cell in rows[-1]] == pytest.approx([0.5, *corner["position"]])
    assert len(rows) == 12


def test_a_probe_has_the_velocity_of_its_own_node(tmp_path, capsys):
    path = tmp_path / "spin.toml"
    path.write_text(FALL.replace("velocity =", "spin = [0, 0, 2]\nvelocity ="), encoding="utf-8")
    short = ["--set", "frame_rate=1000", "--set", "duration=1e-3", "--set", "gravity=[0, 0, 0]"]
    assert main(["run", str(path), "--json", "--precision", "f64", *short]) == 0
    corner = json.loads(capsys.readouterr().out)["probes"]["corner"]
    # v + ω × r, r = (0.2, 0.1, 0.1) from the middle
    assert corner["velocity"] == pytest.approx([3.0 - 2 * 0.1, 4.0 + 2 * 0.2, 0.0], abs=0.01)


def test_speeds_are_told_per_second_of_stepping(tmp_path, capsys):
    path = tmp_path / "fall.toml"
    path.write_text(FALL, encoding="utf-8")
    assert main(["run", str(path), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    wall = told["wall_seconds"]
    assert 0.0 < wall < 60.0
    assert told["real_time_factor"] == pytest.approx(told["time"] / wall, rel=1e-6)
    done = told["elements"] * told["substeps"]
    assert told["element_substeps_per_second"] == pytest.approx(done / wall, rel=1e-6)
    assert told["time"] == pytest.approx(0.5) and told["frames"] == 10
    low, high = told["step_range"]
    assert low <= told["step"] <= high
    assert told["substeps"] == pytest.approx(0.5 / told["step"], rel=0.2)


# -- gravity in time -----------------------------------------------------------------------------

SHAKES = [[0, 0, 0, 0], [0.03, 12, -9.81, 0], [0.0301, -40, -9.81, 0], [0.030101, 0, -9.81, 3]]


def impulse(time):
    """∫ g dt of SHAKES [m/s], by the trapezoids of its rows."""
    rows = np.array([*[row for row in SHAKES if row[0] < time], [time, 0, -9.81, 3]])
    return np.trapezoid(rows[:, 1:], rows[:, 0], axis=0)


def test_gravity_in_time_gives_its_impulse_at_any_frame_rate_and_its_work_is_external(tmp_path):
    found = []
    for rate in (10.0, 50.0):
        scene, _ = block(settings={"gravity": SHAKES, "frame_rate": rate, "step": 1e-4})
        sim = ts.Simulation(scene, threads=1, ledger=True)
        for frame in sim.frames(0.2):
            table = frame.energy()
            size = table["kinetic"] + abs(table["gravity"])
            assert abs(table["error"]) <= 5e-3 * size + 1e-9
        found.append(sim.positions())
        fallen = impulse(0.2)
        assert sim.velocities() == pytest.approx(np.tile(fallen, (len(found[0]), 1)), abs=1e-12)
        weight = sim.masses()[:, None] * [0, -9.81, 3]
        moved = found[-1] - scene.bodies[0].mesh.points
        assert table["gravity"] == pytest.approx(-(weight * moved).sum(), rel=1e-9)
    assert found[0] == pytest.approx(found[1], abs=1e-3)
    sim.save(tmp_path / "half.npz")
    other = ts.Simulation.load(tmp_path / "half.npz")
    for one in (sim, other):  # to the bits, and quiet gravity leaves nothing of the shakes
        one.step()
        one.scene.gravity = (0, 0, 0)
        one.step()
    assert (sim.positions() == other.positions()).all() and sim.energy() == other.energy()
    assert sim.velocities()[0] == pytest.approx(impulse(0.22), abs=1e-12)
