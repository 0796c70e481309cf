"""The ledger closes: energy that leaves or enters a scene is accounted for."""

from dataclasses import replace

import numpy as np
import pytest

import tisoft as ts
from tisoft.simulation import Simulation
from tisoft.step.account import Account


def _run(scene, frames, *, start=None, **options):
    """A simulation with a ledger after some frames, and its rows of energies."""
    sim = Simulation(scene, ledger=True, threads=1, **options)
    if start is not None:
        sim.set_state(*start)
    rows = [sim.energy()]
    for _ in range(frames):
        sim.step()
        rows.append(sim.energy())
    return sim, {key: np.array([row[key] for row in rows]) for key in rows[0]}


def _closes(rows):
    """The printed error is the imbalance of the printed entries."""
    stored = rows["kinetic"] + rows["elastic"] + rows["gravity"]
    balance = stored + rows["dissipated"] - rows["external_work"]
    assert rows["error"] == pytest.approx(balance - stored[0], abs=1e-12 * np.abs(stored).max())


def _beam(kind, step, integrator="symplectic-euler", **keys):
    scene = ts.Scene(gravity=(0, 0, -9.81), precision="f64", frame_rate=50, step=step)
    scene.integrator = integrator
    mesh = ts.box(size=(1, 0.2, 0.2), cells=(5, 1, 1))
    if kind is ts.MassSpring:
        model = ts.MassSpring(young=1e6, density=1000.0, **keys)
    else:
        model = kind(1e6, 0.3, 1000.0, **keys)
    body = scene.add_body(mesh, model)
    body.pin(ts.where.box((-1, -1, -1), (1e-6, 1, 1)))
    return scene, body


@pytest.mark.parametrize(
    ("kind", "keys"),
    [
        (ts.ViscoElastic, {"phi": 200.0, "eta": 200.0}),
        (ts.ViscoElastic, {"phi": 200.0, "eta": 200.0, "mass": "consistent"}),
        (ts.NeoHookean, {"eta": 200.0, "point_damping": 0.5}),
        (ts.MassTensor, {"phi": 200.0, "eta": 200.0}),
        (ts.MassSpring, {"spring_damping": 30.0}),
    ],
)
def test_a_damped_beam_loses_what_viscosity_takes(kind, keys):
    """The imbalance is the integrator's own swing −(h/2) v·f, to second order in the step."""
    away = []
    for step in (1e-3, 5e-4):
        scene, body = _beam(kind, step, **keys)
        sim, rows = _run(scene, 50)
        _closes(rows)
        assert (np.diff(rows["dissipated"]) >= 0.0).all()
        assert np.abs(rows["external_work"]).max() < 1e-9 * rows["dissipated"][-1]
        lossless = {key: 0.0 for key in keys if key != "mass"}
        body.model = replace(body.model, **lossless)
        free, _ = _run(scene, 0, start=(sim.positions(), sim.velocities()))
        f = free.forces() + free.masses()[:, None] * np.array(scene.gravity)
        swing = -0.5 * step * (f * free.velocities()).sum()
        away.append(abs(rows["error"][-1] - swing))
        assert np.abs(rows["error"]).max() < 0.02 * rows["elastic"].max()
    assert away[0] < 2e-3 * rows["dissipated"][-1]
    assert away[1] < 0.3 * away[0] + 1e-9
    assert rows["dissipated"][-1] > 0.01 * rows["elastic"].max()


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_the_damped_beam_of_the_references_loses_energy_at_its_damping_ratio(precision):
    """REFERENCES A5d: f = 1.211898 Hz, zeta = 0.01341: two periods take 1 − exp(−8π zeta)."""
    scene = ts.Scene(gravity=(0, 0, 0), precision=precision, step=1e-4, frame_rate=100)
    mesh = ts.box(size=(1, 0.2, 0.2), cells=(10, 2, 2))
    body = scene.add_body(mesh, ts.ViscoElastic(1e6, 0.3, 1000.0, phi=500.0, eta=1500.0))
    body.pin(ts.where.box((-1, -1, -1), (1e-6, 1, 1)))
    x = mesh.points.copy()
    along = x[:, 0].copy()
    slope = 1e-4 * (3 * along - 1.5 * along**2)
    x[:, 2] += 1e-4 * (1.5 * along**2 - 0.5 * along**3)
    x[:, 0] -= slope * (mesh.points[:, 2] - 0.1)
    _, rows = _run(scene, 330, start=(x, 0 * x))
    _closes(rows)
    # After two periods the first mode is alone.
    left = rows["kinetic"][165] + rows["elastic"][165]
    lost = (rows["dissipated"][330] - rows["dissipated"][165]) / left
    assert lost == pytest.approx(1 - np.exp(-8 * np.pi * 0.01341), rel=0.01)
    band = 0.5 * 1e-4 * 2 * np.pi * 1.2119  # the swing of symplectic Euler, ω h/2
    late = rows["error"][165:] - rows["error"][165]
    assert np.abs(late).max() < 1.1 * band * left
    assert rows["external_work"][-1] == 0.0


def test_the_half_step_start_closes_better():
    """Its whole-step velocities make T + V what symplectic Euler conserves, but for half a step
    of viscosity.
    """
    errors = {}
    for start in ("plain", "half-step"):
        scene, body = _beam(ts.ViscoElastic, 1e-3, phi=200.0, eta=200.0)
        body.load(ts.where.everything(), pressure=20.0)
        scene.start = start
        _, rows = _run(scene, 50)
        errors[start] = np.abs(rows["error"]).max()
    assert errors["half-step"] < 0.05 * errors["plain"]


def test_velocity_verlet_closes_to_second_order():
    errors = []
    for step in (1e-3, 5e-4):
        scene, _ = _beam(ts.ViscoElastic, step, "velocity-verlet", phi=200.0, eta=200.0)
        _, rows = _run(scene, 50)
        errors.append(np.abs(rows["error"]).max())
    assert errors[1] < 0.3 * errors[0]
    assert errors[1] < 5e-4 * rows["dissipated"][-1]


def test_point_damping_takes_what_a_falling_body_loses():
    """Terminal fall: every joule of the way down is dissipated; sums in closed form."""
    scene = ts.Scene(gravity=(0, -10, 0), precision="f64", frame_rate=100, step=1e-2)
    model = ts.MassSpring(stiffness=1.0, node_mass=0.5, point_damping=5.0)
    scene.add_body(ts.net([[0, 0, 0], [1, 0, 0]], [[0, 1]]), model)
    _, rows = _run(scene, 200)
    v, taken = 0.0, 0.0
    for _ in range(200):
        new = v + 1e-2 * (-10 - 5.0 * v)
        taken += 1e-2 * 5.0 * 1.0 * v * (v + new) / 2
        v = new
    assert rows["dissipated"][-1] == pytest.approx(taken, rel=1e-12)
    assert np.abs(rows["error"]).max() < 0.01 * taken


@pytest.mark.parametrize("integrator", ["symplectic-euler", "velocity-verlet"])
def test_friction_takes_what_a_sliding_block_had(integrator):
    """m v²/2 = μ m g s: the block's whole energy ends up in friction."""
    scene = ts.Scene(gravity=(0, -10, 0), precision="f64", frame_rate=100, step=1e-3)
    scene.integrator = integrator
    mesh = ts.box(size=(0.2, 0.1, 0.2), cells=(2, 1, 2))
    scene.add_body(mesh, ts.ViscoElastic(1e5, 0.3, 1000.0, phi=50, eta=50), velocity=(1, 0, 0))
    scene.add_obstacle(ts.Plane(point=(0, 0, 0), normal=(0, 1, 0), friction=0.4))
    _, rows = _run(scene, 100)
    kinetic = rows["kinetic"][0]
    assert kinetic == pytest.approx(2.0)
    lost = rows["gravity"][0] - rows["gravity"][-1] - rows["elastic"][-1] + kinetic
    assert rows["dissipated"][-1] == pytest.approx(lost, rel=1e-3)
    _closes(rows)
    assert np.abs(rows["error"]).max() < 2e-2 * kinetic
    assert np.abs(rows["error"][-1]) < 1e-3 * kinetic


def test_an_impact_takes_the_kinetic_energy():
    """A point mass that hits the ground stops: no bounce, all of m v²/2 is gone."""
    scene = ts.Scene(gravity=(0, -10, 0), precision="f64", frame_rate=100, step=1e-3)
    model = ts.MassSpring(stiffness=1.0, node_mass=0.5)
    net = ts.net([[0, 1, 0], [1, 1, 0]], [[0, 1]])
    scene.add_body(net, model)
    scene.add_obstacle(ts.Plane(point=(0, 0, 0), normal=(0, 1, 0)))
    _, rows = _run(scene, 100)
    assert rows["kinetic"][-1] == 0.0
    assert rows["dissipated"][-1] == pytest.approx(10.0, rel=1e-3)
    assert rows["dissipated"][-1] == rows["dissipated"][-40]  # rest costs nothing
    assert rows["error"][-1] == pytest.approx(0.0, abs=0.01)


def test_a_pulled_pin_does_the_work_that_a_spring_stores():
    """k d²/2, and the pin's reaction times its way."""
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64", frame_rate=100, step=1e-4)
    model = ts.MassSpring(stiffness=50.0, node_mass=0.1)
    body = scene.add_body(ts.net([[0, 0, 0], [1, 0, 0]], [[0, 1]]), model)
    body.pin(ts.where.nodes([0]))
    body.pin(ts.where.nodes([1]), path=[(0, 0, 0, 0), (0.5, 0.2, 0, 0)])
    _, rows = _run(scene, 60)
    assert rows["elastic"][-1] == pytest.approx(1.0, rel=1e-12)
    assert rows["external_work"][-1] == pytest.approx(1.0, rel=1e-3)
    assert rows["error"][-1] == pytest.approx(0.0, abs=1e-3)
    assert np.abs(rows["dissipated"]).max() < 1e-12


def test_a_constant_force_does_force_times_way():
    scene, body = _beam(ts.ViscoElastic, 1e-3, phi=100.0, eta=100.0)
    end = ts.where.box((1 - 1e-6, -1, -1), (2, 1, 1))
    body.load(end, force=(3, 0, -40))
    sim, rows = _run(scene, 40)
    moved = sim.positions() - body.mesh.points
    nodes = body.nodes(end)
    faces = body.mesh.surface[body.faces(end)]
    corners = body.mesh.points[faces]
    sides = corners[:, 1:] - corners[:, :1]
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    share = np.bincount(faces.ravel(), np.repeat(areas, 3), minlength=len(moved))
    force = np.outer(share / share.sum(), (3, 0, -40))
    assert set(np.flatnonzero(share)) == set(nodes)
    assert rows["external_work"][-1] == pytest.approx((force * moved).sum(), rel=1e-12)
    assert np.abs(rows["error"]).max() < 0.02 * rows["external_work"].max()


def test_changes_between_frames_are_external_work():
    scene, body = _beam(ts.ViscoElastic, 1e-3)
    sim, before = _run(scene, 20)
    body.model = replace(body.model, young=2e6)
    scene.gravity = (0, 0, 9.81)
    sim.step()
    after = sim.energy()
    assert after["external_work"] > 0.5 * before["elastic"][-1]
    assert abs(after["error"]) < 0.05 * after["external_work"]


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_the_ledger_changes_no_bit(precision):
    states = []
    for ledger in (False, True):
        scene, body = _beam(ts.ViscoElastic, 1e-3, phi=100.0, eta=100.0)
        body.load(ts.where.everything(), pressure=50.0)
        sim = Simulation(scene, ledger=ledger, threads=1, precision=precision)
        for _ in range(5):
            sim.step()
        states.append(sim.positions())
    assert np.array_equal(*states)


def test_what_broke_in_a_frame_that_is_taken_back_stays_out_of_the_account():
    """And out of what another scene, or another body, computes: its first node's force is not 0."""
    scenes = [_beam(ts.ViscoElastic, 1e-3, phi=200.0, eta=200.0)[0] for _ in range(2)]
    sims = [Simulation(scene, ledger=True, threads=1) for scene in scenes]
    sim = max(sims, key=lambda sim: sim.system.lease.starts["copies"])
    assert sim.system.lease.starts["copies"] > 0  # row 0 is another scene's
    state = sim.system.state
    state.work.fill(np.nan)
    state.touched.fill(np.nan)
    state.force[0] = [np.nan] * 4
    sim.step()
    state.force[0] = [0.0] * 4
    assert 0.0 < sim.energy()["dissipated"] < 1.0
    assert np.isfinite(sim.positions()).all()


def test_the_ledger_can_be_switched_on_between_frames():
    scene, _ = _beam(ts.ViscoElastic, 1e-3, phi=100.0, eta=100.0)
    sim = Simulation(scene, threads=1)
    sim.step()
    assert sim.energy()["dissipated"] is None
    sim.ledger = True
    assert sim.energy()["dissipated"] == 0.0
    sim.step()
    assert sim.energy()["dissipated"] > 0.0
    sim.ledger = False
    assert sim.energy()["error"] is None


def test_an_account_begins_with_nothing_and_tells_what_is_missing():
    account = Account(2.0, touches=True)
    assert account.sums() == [0.0, 0.0, 0.0, 0.0]
    account.collect(3.0, 1.0, 0.5, 0.25)
    account.collect(1.0, 4.0, 0.5, 0.5)
    told = account.entries({"kinetic": 2.5, "elastic": 1.0})
    assert told["dissipated"] == 4.0 and told["external_work"] == 5.0
    assert told["contact"] == 1.0 and told["friction"] == 0.75
    assert told["error"] == 3.5 + 4.0 - 5.0 - 2.0
    again = Account(0.0, touches=True)
    again.set_state(account.state())
    assert again.entries({"kinetic": 3.5}) == account.entries({"kinetic": 3.5})
