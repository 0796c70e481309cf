"""A5e: free bodies keep momentum exactly and energy in a band that halves with the step."""

import numpy as np
import pytest
from beams import (
    beam,
    cantilever,
    displaced,
    momentum,
    oscillator,
    place,
    pulled,
    rubber,
    simulate,
    total_energy,
)

import tisoft as ts

SPIN = np.array([0.5, 1.0, 3.0])


def _brick(h, *, kind=ts.ViscoElastic, gravity=(0, 0, 0), stir=0.3, substeps=1, **keys):
    """The spinning brick of A5e; other keys of ViscoElastic are damping."""
    damping = {k: keys.pop(k) for k in ("phi", "eta", "point_damping") if k in keys}
    mesh = ts.box(size=(1.0, 0.5, 0.5), cells=(4, 2, 2))
    model = kind(1e5, 0.3, 1000.0, **damping)
    sim = simulate((mesh, model), h=h, substeps=substeps, gravity=gravity, **keys)
    points = mesh.points
    v = np.cross(SPIN, points - [0.5, 0.25, 0.25])
    v[:, 0] += 1.0
    v[:, 0] += stir * np.sin(np.pi * points[:, 0])
    sim.set_state(points, v)
    return sim


def _energies(sim, substeps):
    """Total energy [J] at the start and after every substep."""
    out = [total_energy(sim)]
    for _ in range(substeps):
        sim.step()
        out.append(total_energy(sim))
    return np.array(out)


def test_free_fall_of_symplectic_euler():
    """v_n = −g n h, z_n = z_0 − g h² n (n + 1)/2."""
    n, h, g = 500, 2e-3, 9.81
    mesh = beam()
    sim = simulate((mesh, rubber()), h=h, substeps=n, gravity=(0, 0, -g))
    sim.step()
    fallen = mesh.points[:, 2] - sim.positions()[:, 2]
    assert fallen == pytest.approx(np.full(len(fallen), g * h**2 * n * (n + 1) / 2), rel=1e-10)
    assert sim.velocities()[:, 2] == pytest.approx(np.full(len(fallen), -g * n * h), rel=1e-12)
    assert np.abs(sim.velocities()[:, :2]).max() < 1e-10


def test_fall_with_drag_step_by_step_and_terminal_speed():
    """v_{n+1} = v_n (1 − γ h) − g h, towards g/γ."""
    n, h, g, drag = 200, 1e-3, 9.81, 5.0
    sim = simulate((beam(), rubber(point_damping=drag)), h=h, substeps=n, gravity=(0, 0, -g))
    sim.step()
    expected = -g / drag * (1 - (1 - drag * h) ** n)
    assert sim.velocities()[:, 2] == pytest.approx(expected, rel=1e-11)
    for _ in range(30):
        sim.step()
    assert sim.velocities()[:, 2] == pytest.approx(-1.962, rel=1e-9)


@pytest.mark.parametrize("kind", [ts.ViscoElastic, ts.NeoHookean])
def test_spinning_brick_keeps_momentum(kind):
    sim = _brick(5e-4, kind=kind, phi=20.0, eta=20.0, substeps=2000)
    before = momentum(sim)
    assert before[0] == pytest.approx([250.0 + 0.3 * _stirred(sim), 0, 0], rel=1e-12, abs=1e-12)
    for _ in range(5):
        sim.step()
        for old, new in zip(before, momentum(sim), strict=True):
            assert np.abs(new - old).max() < 1e-13 * np.linalg.norm(old)


def _stirred(sim):
    """Σ m sin π X: what the stirring of `_brick` adds to p_x per m/s of it."""
    points = sim.scene.bodies[0].mesh.points
    return float(_nodal_mass(points) @ np.sin(np.pi * points[:, 0]))


def _nodal_mass(points):
    """Lumped masses of the brick of five-tet cells, from the tets' volumes."""
    mesh = ts.box(size=(1.0, 0.5, 0.5), cells=(4, 2, 2))
    corners = mesh.points[mesh.tets]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6.0
    return np.bincount(mesh.tets.ravel(), np.repeat(250.0 * volume, 4), minlength=len(points))


def test_spinning_brick_keeps_momentum_in_f32():
    sim = _brick(2e-4, precision="f32", substeps=2000)
    before = momentum(sim)
    for _ in range(5):
        sim.step()
    for old, new in zip(before, momentum(sim), strict=True):
        assert np.abs(new - old).max() < 1e-4 * np.linalg.norm(old)


@pytest.mark.parametrize(
    ("h", "low", "high", "digit"),
    [
        (4e-3, 333.92, 334.36, 0.01),
        (1e-3, 334.041, 334.152, 0.001),
        (5e-4, 334.067, 334.123, 0.001),
    ],
)
def test_energy_of_the_spinning_brick_stays_in_its_band(h, low, high, digit):
    energies = _energies(_brick(h), round(2.0 / h))
    assert energies[0] == pytest.approx(334.094, abs=digit)
    assert energies.min() == pytest.approx(low, abs=digit)
    assert energies.max() == pytest.approx(high, abs=digit)


def test_viscous_spinning_brick_only_loses_energy():
    h = 5e-4
    energies = _energies(_brick(h, phi=20.0, eta=20.0), round(2.0 / h))
    assert energies[0] == pytest.approx(334.094, abs=1.5e-3)
    assert energies[-1] == pytest.approx(331.903, abs=0.03)
    band = 334.123 - 334.067
    highest_since = np.maximum.accumulate(energies[::-1])[::-1]
    assert (highest_since - energies).max() < band
    smooth = energies[: 40 * (len(energies) // 40)].reshape(-1, 40).mean(axis=1)
    assert (np.diff(smooth) < 0).all()


def test_point_drag_multiplies_both_momenta_by_the_same_number():
    drag, h, n = 3.0, 1e-3, 400
    sim = _brick(h, point_damping=drag, substeps=n)
    before = momentum(sim)
    sim.step()
    for old, new in zip(before, momentum(sim), strict=True):
        assert new == pytest.approx(old * (1 - drag * h) ** n, rel=1e-11, abs=1e-11)


def test_energy_of_an_undamped_beam_swings_in_a_band_that_halves_with_the_step():
    widths = []
    for h in (1e-3, 5e-4):
        sim = cantilever(rubber(), h=h, gravity=(0, 0, -9.81))
        energies = _energies(sim, round(1.0 / h))
        half = len(energies) // 2
        widths.append(np.ptp(energies))
        assert energies[:half].mean() == pytest.approx(energies[half:].mean(), abs=0.2 * widths[-1])
    swing = 0.5 * 40.0 * 9.81 * 0.35  # what gravity gives to the beam on its way down [J]
    assert widths[0] < 0.01 * swing
    assert widths[0] / widths[1] == pytest.approx(2.0, rel=0.05)


def test_energy_ratio_of_an_oscillator():
    """max E/min E = (1 + ωh/2)/(1 − ωh/2), 1.06487 at ωh = .0628."""
    omega, h = 2 * np.pi, 0.01
    sim = oscillator(omega, h=h)
    pulled(sim, 1.0)
    energies = []
    for _ in range(2000):
        sim.step()
        energies.append(0.5 * sim.velocities()[1, 0] ** 2 + 0.5 * omega**2 * place(sim) ** 2)
    ratio = max(energies) / min(energies)
    assert ratio == pytest.approx((1 + omega * h / 2) / (1 - omega * h / 2), abs=1e-5)
    assert ratio == pytest.approx(1.06487, abs=2e-5)


@pytest.mark.parametrize("kind", [ts.Linear, ts.MassTensor])
def test_linear_bodies_keep_linear_momentum(kind):
    sim = _brick(1e-3, kind=kind, phi=20.0, eta=20.0, substeps=500)
    before, _ = momentum(sim)
    sim.step()
    assert np.abs(momentum(sim)[0] - before).max() < 1e-13 * np.linalg.norm(before)


def test_viscosity_does_not_brake_a_flight():
    mesh = beam()
    sim = simulate((mesh, rubber(phi=100.0, eta=100.0)), h=1e-4, substeps=100)
    displaced(sim, 0.0, np.array([1.0, 2.0, 3.0]))
    sim.step()
    assert sim.velocities() == pytest.approx(np.tile([1.0, 2.0, 3.0], (len(mesh.points), 1)))
