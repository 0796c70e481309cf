"""Loads and moved pins against closed forms and independent sums over faces."""

from dataclasses import replace

import numpy as np
import pytest

import tisoft as ts
from tisoft.loads import Load
from tisoft.simulation import Simulation
from tisoft.step.loading import external_forces, pressure_tangent
from tisoft.step.schedule import factor_integral, factor_signal, gravity_signal, windows

END = ts.where.box((1 - 1e-6, -9, -9), (9, 9, 9))
ROOT = ts.where.box((-9, -9, -9), (1e-6, 9, 9))


def _beam(kind=ts.ViscoElastic, *, gravity=(0, 0, 0), cells=(6, 2, 2), **keys):
    scene = ts.Scene(gravity=gravity, precision="f64", frame_rate=50)
    mesh = ts.box(size=(1, 0.2, 0.2), cells=cells)
    body = scene.add_body(mesh, kind(1e5, 0.3, 1000.0, **keys))
    return scene, body


def _forces(body, time=0.0, positions=None):
    """All loads on one body, in the mesh's node order."""
    scene = ts.Scene(bodies=[body])
    (part,) = Simulation(scene, threads=1, precision="f64").parts
    x = None if positions is None else np.asarray(positions)[part.order]
    out = np.empty((len(part.order), 3))
    out[part.order] = external_forces([part], time, x)
    return out


def _turned(points, axis, angle, about):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    K = np.cross(axis, np.eye(3)).T
    R = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    return (points - about) @ R.T + about


# -- the forces of one moment ------------------------------------------------------------------


def test_a_force_on_faces_is_shared_by_area():
    _, body = _beam()
    body.load(END, force=(1, -2, 3))
    f = _forces(body)
    assert f.sum(axis=0) == pytest.approx([1, -2, 3])
    end = body.nodes(END)
    assert np.flatnonzero(f.any(axis=1)) == pytest.approx(end)
    # It acts at the middle of the face: a uniform traction.
    middle = (f[:, 0] @ body.mesh.points) / f[:, 0].sum()
    assert middle == pytest.approx([1, 0.1, 0.1])
    traction = _beam()[1]
    traction.load(END, traction=np.array([1, -2, 3]) / 0.04)
    assert _forces(traction) == pytest.approx(f, abs=1e-12)


def test_a_force_without_faces_is_shared_equally():
    _, body = _beam()
    body.load(ts.where.nodes([0, 5]), force=(0, 0, 4))
    f = _forces(body)
    assert f[[0, 5]] == pytest.approx(np.array([[0, 0, 2], [0, 0, 2]]))
    assert f.sum() == pytest.approx(4.0)


def test_pressure_all_round_pushes_inward_and_adds_up_to_nothing():
    _, body = _beam()
    body.load(ts.where.everything(), pressure=300.0)
    x = _turned(body.mesh.points, (1, 2, 3), 0.7, np.zeros(3)) * [1.2, 1.0, 0.9]
    for positions in (None, x):
        f = _forces(body, positions=positions)
        points = body.mesh.points if positions is None else x
        assert f.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
        assert np.cross(points, f).sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
        # The work of a swelling is p dV: f·x = −3 p V.
        corners = points[body.mesh.tets]
        volume = np.linalg.det(corners[:, 1:] - corners[:, :1]).sum() / 6
        assert (f * points).sum() == pytest.approx(-3 * 300.0 * volume)


def test_pressure_follows_the_surface():
    _, body = _beam()
    body.load(END, pressure=100.0)
    x = _turned(body.mesh.points, (0, 0, 1), np.pi / 2, np.zeros(3))
    assert _forces(body).sum(axis=0) == pytest.approx([-4, 0, 0])
    assert _forces(body, positions=x).sum(axis=0) == pytest.approx([0, -4, 0], abs=1e-12)


def test_the_tangent_of_pressure_is_its_derivative():
    _, body = _beam(cells=(2, 1, 1))
    body.load(END, pressure=100.0)
    (part,) = Simulation(ts.Scene(bodies=[body]), threads=1, precision="f64").parts
    random = np.random.default_rng(1)
    x = body.mesh.points[part.order] + 0.05 * random.standard_normal((len(part.order), 3))
    d = random.standard_normal(x.shape)
    ahead, back = (external_forces([part], 0.0, x + s * 1e-6 * d) for s in (1, -1))
    assert pressure_tangent(part, 0.0, x) @ d.ravel() == pytest.approx(
        (ahead - back).ravel() / 2e-6, abs=1e-6
    )


def test_a_torque_is_a_pure_couple_whatever_the_face_does():
    _, body = _beam()
    body.load(END, torque=ts.Torque((1, 0.1, 0.1), (1, 0, 0), 5.0))
    random = np.random.default_rng(2)
    bent = body.mesh.points + 0.02 * random.standard_normal(body.mesh.points.shape)
    turned = _turned(body.mesh.points, (1, 0, 0), 1.9, [0, 0.1, 0.1])
    for x in (body.mesh.points, turned, bent):
        f = _forces(body, positions=x)
        assert f.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
        assert np.cross(x, f).sum(axis=0) == pytest.approx([5, 0, 0], abs=1e-12)


# -- times ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "times",
    [
        {"start": 0.013, "end": 0.141},
        {"start": 0.007, "ramp": 0.05},
        {"start": 0.01, "ramp": 0.05, "end": 0.033},
        {"table": [(0.01, 0.0), (0.013, 2.0), (0.08, -1.0)]},
    ],
)
def test_windows_take_the_mean_of_a_profile(times):
    load = Load(END, force=(1, 0, 0), **times)
    means = 50 * np.diff(factor_integral(load, np.arange(11) / 50))
    fine = [load.factor((k + 0.5) * 1e-5) for k in range(20000)]
    assert means == pytest.approx(np.reshape(fine, (10, -1)).mean(axis=1), abs=2e-3)


@pytest.mark.parametrize("what", ["load", "gravity"])
def test_a_kick_longer_than_its_window_takes_what_acts_at_its_start_for_the_rest(what):
    """What grows as t, in passes of 0.1 s from 0.2 s on, the first of them a kick of 0.125 s."""
    if what == "load":
        signal = factor_signal(Load(END, force=(1, 0, 0), ramp=1.0))
    else:
        signal = gravity_signal([(0.0, 0.0, 0.0, 0.0), (1.0, 1.0, 0.0, -2.0)], lambda: np.zeros(3))
    plain = windows(0.2, 0.1, np.arange(3), 3, centred=False, ends=False)
    assert signal(plain)[0] == pytest.approx([0.25, 0.35, 0.45])
    values = signal(replace(plain, first_share=0.8))
    assert values[0] == pytest.approx([0.8 * 0.25 + 0.2 * 0.2, 0.35, 0.45])
    if what == "gravity":
        assert values[1:] == pytest.approx(np.outer([0.0, -2.0], values[0]))


def test_an_impulse_gives_its_momentum_however_coarse_the_frames():
    scene, body = _beam()
    body.load(ts.where.everything(), force=(0, 6, 0), start=0.013, end=0.049)
    sim = Simulation(scene, threads=1)
    for _ in range(5):
        sim.step()
    assert sim.measures.momentum() == pytest.approx([0, 6 * 0.036, 0], abs=1e-12)


RATE = 2 * np.pi * 20
TIMES = np.arange(0, 0.2001, 1 / 800)
WAVE = np.sin(RATE * TIMES)


def _shaken(what, rate, *, start="half-step", integrator="symplectic-euler", weight=0.0):
    """A mass of 1 kg on a spring (41 Hz) that swings up and down: its y at .2 s, and frames."""
    scene = ts.Scene(gravity=(0, 0, 0), frame_rate=rate, step=2e-4, precision="f64", start=start)
    scene.integrator = integrator
    mesh = ts.net([[0, 0, 0], [0, 1, 0]], [[0, 1]])
    springs = [[0, 1, (2 * np.pi * 41) ** 2]]
    body = scene.add_body(mesh, ts.MassSpring(springs=springs, node_mass=[1.0, 1.0]))
    foot = {"path": [(t, 0, 0.005 * w, 0) for t, w in zip(TIMES, WAVE, strict=True)]}
    body.pin(ts.where.nodes([0]), **(foot if what == "foot" else {}))
    if weight:
        body.load(ts.where.nodes([1]), force=(0, weight, 0))
    if what == "force":
        table = list(zip(TIMES, WAVE, strict=True))
        body.load(ts.where.nodes([1]), force=(0, 100, 0), table=table)
    if what == "let go":
        body.pin(ts.where.nodes([1]), velocity=(0, 0.2, 0), release=0.0371)
    body.pin(ts.where.nodes([1]), axes="xz", release=None if what != "let go" else 0.0371)
    return [f.positions(body)[1, 1] - 1 for f in Simulation(scene).frames(0.2)][-1]


def _driven(amplitude, stiff, t):
    """y'' + ω₀² y = amplitude · sin ωt from rest."""
    own = np.sqrt(stiff)
    return amplitude / (stiff - RATE**2) * (np.sin(RATE * t) - RATE / own * np.sin(own * t))


@pytest.mark.parametrize("what", ["foot", "force", "let go"])
def test_what_acts_in_time_does_not_depend_on_the_frames(what):
    stiff = (2 * np.pi * 41) ** 2
    swing = np.sqrt(stiff)
    let = 0.2 * 0.0371
    free = 0.2 - 0.0371
    right = {
        "foot": _driven(0.005 * stiff, stiff, 0.2),
        "force": _driven(100.0, stiff, 0.2),
        "let go": let * np.cos(swing * free) + 0.2 / swing * np.sin(swing * free),
    }[what]
    size = {"foot": 0.01, "force": 0.004, "let go": let}[what]
    found = [_shaken(what, rate) for rate in (10, 60, 1000)]
    assert found == pytest.approx([right] * 3, abs=0.005 * size)
    assert np.ptp(found) < 1e-3 * size
    if what == "force":
        verlet = [_shaken(what, r, start="plain", integrator="velocity-verlet") for r in (10, 250)]
        assert verlet == pytest.approx([right] * 2, abs=0.005 * size)


def test_a_force_that_stays_acts_beside_a_pin_that_moves():
    """By superposition: it adds F/k (1 − cos ω₀t)."""
    stiff = (2 * np.pi * 41) ** 2
    more = _shaken("foot", 60, weight=50.0) - _shaken("foot", 60)
    assert more == pytest.approx(50.0 / stiff * (1 - np.cos(np.sqrt(stiff) * 0.2)), rel=0.01)


def test_a_pulse_within_a_substep_gives_its_impulse():
    scene, body = _beam()
    table = [(0.0301, 0), (0.030102, 1), (0.030103, 0)]
    body.load(ts.where.everything(), force=(0, 1e6, 0), table=table)
    sim = Simulation(scene, threads=1)
    for _ in range(5):
        sim.step()
    assert sim.measures.momentum() == pytest.approx([0, 1.5, 0], abs=1e-9)


def test_loads_come_and_go_between_frames():
    scene, body = _beam()
    sim = Simulation(scene, threads=1)
    sim.step()
    assert sim.measures.momentum() == pytest.approx(np.zeros(3), abs=1e-15)
    body.load(END, force=(0, 5, 0))
    sim.step()
    assert sim.measures.momentum() == pytest.approx([0, 0.1, 0])
    body.loads.clear()
    body.load(END, pressure=100.0)
    sim.step()
    assert sim.measures.momentum()[0] == pytest.approx(-0.08, rel=1e-3)
    body.loads.clear()
    p = sim.measures.momentum()
    sim.step()
    assert sim.measures.momentum() == pytest.approx(p, abs=1e-14)


# -- dynamics ------------------------------------------------------------------------------------


def test_pressure_all_round_turns_and_drives_nothing_in_a_spin():
    """A spinning body under pressure keeps both momenta: the forces are those of each substep."""
    scene, body = _beam()
    body.spin, body.velocity = (0, 1, 20.0), (1, 0, 0)
    body.load(ts.where.everything(), pressure=2000.0)
    sim = Simulation(scene, threads=1)
    p, spin = sim.measures.momentum(), sim.measures.angular_momentum()
    for _ in range(25):
        sim.step()
    assert sim.measures.momentum() == pytest.approx(p, rel=1e-11, abs=1e-11)
    assert sim.measures.angular_momentum() == pytest.approx(spin, rel=1e-11, abs=1e-10)


def test_a_body_under_pressure_settles_to_the_closed_form():
    """St. Venant-Kirchhoff, F = l I: the Cauchy stress (3λ + 2μ)(l² − 1)/(2 l) is −p."""
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64", frame_rate=20)
    mesh = ts.box(size=(1, 1, 1), cells=(2, 2, 2))
    model = ts.ViscoElastic(1e5, 0.3, 1000.0, phi=2000, eta=2000, point_damping=30)
    body = scene.add_body(mesh, model)
    body.load(ts.where.everything(), pressure=2e4)
    sim = Simulation(scene, threads=1)
    for _ in range(40):
        sim.step()
    x = sim.positions()
    stretch = np.ptp(x, axis=0)
    bulk = 3 * model.lame_lambda + 2 * model.lame_mu
    expected = max(np.roots([bulk / 2, 2e4, -bulk / 2]))
    assert stretch == pytest.approx(np.full(3, expected), rel=1e-6)


def test_a_couple_spins_a_free_body_up():
    """L grows by M t: the couple is that of each substep."""
    scene, body = _beam()
    body.load(END, torque=ts.Torque((1, 0.1, 0.1), (1, 0, 0), 0.3))
    sim = Simulation(scene, threads=1)
    for _ in range(50):
        sim.step()
    spin = sim.measures.angular_momentum(about=(0.5, 0.1, 0.1))
    angle = 0.5 * 0.3 / (40 * 0.08 / 12)
    assert angle > 0.5  # it has turned a good way
    assert spin == pytest.approx([0.3, 0, 0], abs=3e-5)


# -- pins ----------------------------------------------------------------------------------------


def test_turned_pins_are_exactly_where_they_belong():
    scene, body = _beam()
    body.pin(ROOT, turn=ts.Turn((0, 0.1, 0.1), (1, 0, 0), 4.0))
    sim = Simulation(scene, threads=1)
    for _ in range(20):
        sim.step()
    root = body.nodes(ROOT)
    expected = _turned(body.mesh.points[root], (1, 0, 0), 4.0 * sim.time, [0, 0.1, 0.1])
    assert sim.positions()[root] == pytest.approx(expected, abs=1e-14)


def test_a_path_is_followed_to_its_rows_and_held_after_the_last():
    scene, body = _beam()
    body.pin(ROOT, path=[(0.1, 0, 0, 0), (0.3, 0, 0.05, 0), (0.4, 0.02, 0.05, 0)])
    sim = Simulation(scene, threads=1)
    root, seen = body.nodes(ROOT), {}
    for frame in sim.frames(0.5):
        moved = frame.positions()[root] - body.mesh.points[root]
        seen[round(frame.time, 6)] = moved[0]
    assert seen[0.1] == pytest.approx(np.zeros(3))
    assert seen[0.2] == pytest.approx([0, 0.025, 0])
    assert seen[0.3] == pytest.approx([0, 0.05, 0])
    assert seen[0.5] == pytest.approx([0.02, 0.05, 0])


def test_what_is_released_flies_on_with_the_velocity_it_had():
    scene, body = _beam()
    body.pin(ts.where.everything(), velocity=(2, 0, 0), release=0.1)
    sim = Simulation(scene, threads=1)
    for _ in range(10):
        sim.step()
    assert sim.velocities() == pytest.approx(np.tile([2.0, 0, 0], (len(body.mesh.points), 1)))
    assert sim.positions() == pytest.approx(body.mesh.points + np.array([0.4, 0, 0]))
    assert not sim.reactions().any()


def test_rollers_hold_their_axes_alone():
    scene, body = _beam(gravity=(1, -9.81, 0))
    body.pin(ts.where.everything(), axes="y")
    sim = Simulation(scene, threads=1)
    for _ in range(10):
        sim.step()
    assert sim.positions()[:, 1] == pytest.approx(body.mesh.points[:, 1], abs=1e-15)
    assert sim.measures.momentum()[0] == pytest.approx(40 * 0.2)
    assert sim.reactions().sum(axis=0) == pytest.approx([0, 40 * 9.81, 0])


@pytest.mark.parametrize("mass", ["lumped", "consistent"])
def test_reactions_balance_weight_loads_and_inertia(mass):
    """Σ R + weight + loads = d(momentum)/dt, at any moment of the swing."""
    scene, body = _beam(gravity=(0, 0, -9.81), mass=mass, point_damping=0.4)
    scene.step, scene.frame_rate = 1e-5, 1e5
    body.pin(ROOT)
    body.load(END, force=(1, 2, 0))
    body.load(ts.where.everything(), pressure=50.0)
    sim = Simulation(scene, threads=1)
    random = np.random.default_rng(4)
    free = np.ones(len(body.mesh.points))
    free[body.nodes(ROOT)] = 0.0
    bend = 0.01 * free[:, None] * random.standard_normal(body.mesh.points.shape)
    sim.set_state(body.mesh.points + bend, bend)
    before, held = sim.measures.momentum(), sim.reactions().sum(axis=0)
    sim.step()
    rate = (sim.measures.momentum() - before) / 1e-5
    outside = np.array([1, 2, 0]) + 40 * np.array([0, 0, -9.81]) - 0.4 * before
    assert rate == pytest.approx(held + outside, rel=1e-3, abs=0.1)
