"""A2: waves and vibrations along a bar clamped at x = 0; A3, A5d: vibrations of the beam."""

import numpy as np
import pytest
from beams import CLAMPED, beam, displaced, rubber, simulate
from fem import lame, largest_frequency, mass, mode_of_motion, modes, stiffness

import tisoft as ts
from tisoft import where

YOUNG, DENSITY, LENGTH = 1e6, 1000.0, 1.0
SPEED = np.sqrt(YOUNG / DENSITY)


# -- the bar as a chain of springs: linear elements in one dimension, lumped mass ----------------


def _chain(n, **keys):
    """A bar of 1 m² in n equal elements: k = E A/l, node masses ρ A l, half at the end."""
    node_mass = np.full(n + 1, DENSITY / n)
    node_mass[[0, -1]] /= 2
    points = np.stack([np.linspace(0, LENGTH, n + 1), np.zeros(n + 1), np.zeros(n + 1)], axis=1)
    mesh = ts.net(points, [[i, i + 1] for i in range(n)])
    model = ts.MassSpring(stiffness=YOUNG * n, node_mass=node_mass)
    return simulate((mesh, model), pins=[(CLAMPED, "xyz")], **keys)


def _lumped(n, mode):
    """ω = (2 c/h) sin(k h/2), k = (2 mode − 1) π/2L."""
    return 2 * SPEED * n * np.sin((2 * mode - 1) * np.pi / (4 * n))


@pytest.mark.parametrize(("mode", "frequency"), [(1, 7.903662), (2, 23.662258), (3, 39.274969)])
def test_frequencies_of_lumped_elements(mode, frequency):
    n, h = 20, 2e-4
    sim = _chain(n, h=h)
    shape = np.sin((2 * mode - 1) * np.pi / 2 * np.linspace(0, 1, n + 1))
    displaced(sim, 1e-3 * shape[:, None] * [1, 0, 0])
    q = []
    for _ in range(20):
        sim.step()
        q.append(shape @ (sim.positions()[:, 0] - np.linspace(0, LENGTH, n + 1)))
    omega, _ = mode_of_motion(q, h)
    assert omega == pytest.approx(_lumped(n, mode), rel=1e-8)
    assert omega / (2 * np.pi) == pytest.approx(frequency, abs=6e-7)


def _response(sim, unit, *, seconds):
    """Times [s] and displacements of the end over the static one [m] after a step of force."""
    times, ends = [0.0], [0.0]
    while times[-1] < seconds:
        sim.step()
        times.append(times[-1] + sim.scene.step)
        ends.append((sim.positions()[:, 0].max() - LENGTH) / unit)
    return np.array(times), np.array(ends)


def _check_wave(times, response, speed, element):
    """Grows as F c t/(E A) until the wave is back at 2L/c, peaks near 2, is back at 4L/c."""
    there_and_back = 2 * LENGTH / speed
    assert abs(times[response.argmax()] - there_and_back) < element / speed
    ramp = times < 0.8 * there_and_back
    assert response[ramp] == pytest.approx(speed * times[ramp] / LENGTH, abs=0.75 * element)
    back = np.argmin(np.abs(times - 2 * there_and_back))
    assert abs(response[back]) < 0.25
    assert 1.95 < response.max() < 2.05


@pytest.mark.parametrize(("n", "peak"), [(10, 1.954), (20, 1.970), (40, 1.979), (80, 1.987)])
def test_step_force_at_the_end_of_a_chain(n, peak):
    sim = _chain(n, h=0.5 / (SPEED * n))  # half the critical step l/c
    force = 100.0
    sim.scene.bodies[0].load(where.nodes([n]), force=(force, 0, 0))
    times, response = _response(sim, force * LENGTH / YOUNG, seconds=0.14)
    assert response.max() == pytest.approx(peak, abs=6e-4)
    _check_wave(times, response, SPEED, LENGTH / n)


@pytest.mark.parametrize("poisson", [0.0, 0.3])
def test_step_traction_on_a_confined_bar_of_tets(poisson):
    """c = √(M/ρ) where u_y = u_z = 0: the P-wave."""
    n, traction = 20, 10.0
    lam, mu = lame(YOUNG, poisson)
    speed = np.sqrt((lam + 2 * mu) / DENSITY)
    mesh = ts.box(size=(LENGTH, 0.1, 0.1), cells=(n, 2, 2))
    pins = [(CLAMPED, "xyz"), (where.everything(), "yz")]
    model = ts.Linear(YOUNG, poisson, DENSITY)
    sim = simulate((mesh, model), h=0.25 * LENGTH / n / speed, pins=pins)
    end = where.box((LENGTH - 1e-9, -1, -1), (LENGTH + 1e-9, 1, 1))
    sim.scene.bodies[0].load(end, traction=(traction, 0, 0))
    seconds = 4.4 * LENGTH / speed
    times, response = _response(sim, traction * LENGTH / (lam + 2 * mu), seconds=seconds)
    _check_wave(times, response, speed, LENGTH / n)


# -- the bar in tets --------------------------------------------------------------------------


def _hertz(sim, mesh, mode, *, weight, substeps=12):
    """Frequency [Hz] and ζ of a body started in `mode` (nodes, 3), from a few substeps.

    `weight` is the mass matrix that tells this mode from all others.
    """
    displaced(sim, 1e-6 * mode / np.abs(mode).max())
    q = []
    for _ in range(substeps):
        sim.step()
        q.append((weight @ (sim.positions() - mesh.points).ravel()) @ mode.ravel())
    omega, zeta = mode_of_motion(q, sim.scene.step)
    return omega / (2 * np.pi), zeta


@pytest.mark.parametrize(
    ("split", "kind", "consistent", "table"),
    [
        ("five", ts.Linear, False, [7.903154, 23.648507, 39.211015]),
        ("five", ts.MassTensor, False, [7.903154]),
        ("five", ts.ViscoElastic, False, [7.903154]),
        ("five", ts.NeoHookean, False, [7.903154]),
        ("six", ts.Linear, False, [7.903604]),
        ("five", ts.Linear, True, [7.907219]),
        ("six", ts.Linear, True, [7.907665]),
    ],
)
def test_frequencies_of_a_bar_of_tets(split, kind, consistent, table):
    """20x2x2 of a 1 x .1 x .1 bar, ν = 0, u_y = u_z = 0; lumped mass below, consistent above."""
    mesh = ts.box(size=(LENGTH, 0.1, 0.1), cells=(20, 2, 2), split=split)
    M = mass(mesh.points, mesh.tets, DENSITY, consistent=consistent)
    K = stiffness(mesh.points, mesh.tets, *lame(YOUNG, 0.0))
    free = np.zeros(mesh.points.shape, bool)
    free[mesh.points[:, 0] > 1e-9, 0] = True
    expected, shapes = modes(K, M, free, count=3)
    keys = {"mass": "consistent"} if consistent else {}
    pins = [(CLAMPED, "xyz"), (where.everything(), "yz")]
    for k, frequency in enumerate(table):
        model = kind(YOUNG, 0.0, DENSITY, **keys)
        sim = simulate((mesh, model), h=2e-4, pins=pins)
        found, _ = _hertz(sim, mesh, shapes[k], weight=M)
        linear = kind in (ts.Linear, ts.MassTensor)
        assert found == pytest.approx(expected[k], rel=1e-7 if linear else 1e-5)
        assert found == pytest.approx(frequency, rel=1e-6 if linear else 1e-5)


# -- the beam of A3 ----------------------------------------------------------------------------


def _beam_modes(split, *, consistent=False, count=3):
    mesh = beam(split)
    M = mass(mesh.points, mesh.tets, 1000.0, consistent=consistent)
    K = stiffness(mesh.points, mesh.tets, *lame(1e6, 0.3))
    free = np.repeat(mesh.points[:, :1] > 1e-9, 3, axis=1)
    return mesh, M, K, free, modes(K, M, free, count=count)


@pytest.mark.parametrize(
    ("split", "consistent", "table"),
    [
        ("five", False, {0: 1.211898, 1: 1.211898, 2: 5.289875}),
        ("six", False, {0: 1.282631, 1: 1.500872, 2: 5.613022}),
        ("five", True, {0: 1.220681}),
        ("six", True, {0: 1.289162}),
    ],
)
def test_frequencies_of_the_beam(split, consistent, table):
    mesh, M, _, _, (expected, shapes) = _beam_modes(split, consistent=consistent)
    keys = {"mass": "consistent"} if consistent else {}
    for k, frequency in table.items():
        sim = simulate((mesh, rubber(ts.Linear, **keys)), h=5e-4, pins=[(CLAMPED, "xyz")])
        found, _ = _hertz(sim, mesh, shapes[k], weight=M, substeps=30)
        assert found == pytest.approx(expected[k], rel=2e-7)
        assert found == pytest.approx(frequency, abs=1e-6)


@pytest.mark.parametrize(
    ("split", "lumped", "consistent"),
    [("six", 1.805912e-3, 8.79181e-4), ("five", 1.513076e-3, 8.75445e-4)],
)
def test_independent_form_has_the_tabulated_critical_steps(split, lumped, consistent):
    """The NumPy elements that these tests lean on, against A3."""
    for kind, h in ((False, lumped), (True, consistent)):
        _, M, K, free, _ = _beam_modes(split, consistent=kind, count=1)
        assert 2 / largest_frequency(K, M, free) == pytest.approx(h, rel=1e-6)


@pytest.mark.parametrize("kind", [ts.Linear, ts.MassTensor, ts.ViscoElastic])
def test_damping_of_the_first_mode_from_phi_and_eta(kind):
    """A5d: φ = 500, η = 1500 on five 10x2x2 give ζ = .01341173."""
    mesh, M, _, _, (frequencies, shapes) = _beam_modes("five", count=2)
    C = stiffness(mesh.points, mesh.tets, 500.0, 1500.0)
    mode = shapes[0].ravel()
    ratio = mode @ C @ mode / (2 * 2 * np.pi * frequencies[0] * (mode @ M @ mode))
    sim = simulate((mesh, rubber(kind, phi=500.0, eta=1500.0)), h=1e-4, pins=[(CLAMPED, "xyz")])
    assert ratio == pytest.approx(0.01341173, abs=6e-9)
    found, zeta = _decay(sim, mesh, shapes[0], weight=M, every=100)
    assert zeta == pytest.approx(ratio, rel=0.01)
    assert zeta == pytest.approx(0.01341172, rel=1e-3)
    assert found == pytest.approx(1.211898, rel=1e-4)


def _decay(sim, mesh, mode, *, weight, every):
    """Frequency [Hz] and ζ of a body started in `mode`, looked at each `every` substeps."""
    displaced(sim, 1e-4 * mode / np.abs(mode).max())
    q = []
    for _ in range(100):
        sim.stepper.advance(every, sim.scene.step, (0, 0, 0))
        q.append((weight @ (sim.positions() - mesh.points).ravel()) @ mode.ravel())
    rows = np.stack([q[1:-1], -np.array(q[:-2])], axis=1)  # a damped cosine's recurrence
    (trace, det), *_ = np.linalg.lstsq(rows, np.array(q[2:]), rcond=None)
    time = every * sim.scene.step
    rate, w = -np.log(det) / 2 / time, np.arccos(trace / 2 / np.sqrt(det)) / time
    omega = np.hypot(rate, w)
    return omega / (2 * np.pi), rate / omega


@pytest.mark.parametrize("kind", [ts.Linear, ts.ViscoElastic])
def test_damping_of_an_axial_bar(kind):
    """A5d: ζ_1 = .05 needs η = 1006.584 Pa s where ν = 0; log decrement .314553."""
    mesh = ts.box(size=(LENGTH, 0.1, 0.1), cells=(20, 2, 2))
    model = kind(YOUNG, 0.0, DENSITY, eta=1006.584)
    M = mass(mesh.points, mesh.tets, DENSITY)
    K = stiffness(mesh.points, mesh.tets, *lame(YOUNG, 0.0))
    free = np.zeros(mesh.points.shape, bool)
    free[mesh.points[:, 0] > 1e-9, 0] = True
    _, shapes = modes(K, M, free, count=1)
    pins = [(CLAMPED, "xyz"), (where.everything(), "yz")]
    sim = simulate((mesh, model), h=2e-5, pins=pins)
    found, zeta = _decay(sim, mesh, shapes[0], weight=M, every=100)
    assert zeta == pytest.approx(0.05 * found / 7.905694, rel=3e-4)  # τ ω/2 at this mesh's ω
    assert 2 * np.pi * zeta / np.sqrt(1 - zeta**2) == pytest.approx(0.314553, rel=1e-3)
