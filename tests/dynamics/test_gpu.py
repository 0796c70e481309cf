"""The launches of a GPU, run on the CPU's arrays, against the one launch of the CPU."""

import numpy as np
import pytest

import tisoft as ts
from tisoft.simulation import Simulation
from tisoft.step.launches import make_advance as make_launches


def _scene(integrator, precision, mass):
    """A hanging beam, a spring block and a mass-tensor block that fall on the ground."""
    scene = ts.Scene(precision=precision, integrator=integrator, step=2e-4, frame_rate=500)
    beam = ts.box(size=(1, 0.2, 0.2), cells=(5, 2, 2))
    held = scene.add_body(beam, ts.ViscoElastic(1e5, 0.3, 1000.0, phi=20, eta=20, mass=mass))
    held.pin(ts.where.box((-1, -1, -1), (1e-6, 1, 1)))
    cube = ts.box(size=(0.2, 0.2, 0.2), cells=(2, 2, 2))
    lower = cube.transformed(translate=(0, -0.98, 0))
    springs = ts.MassSpring(young=1e4, density=500.0, spring_damping=0.3, point_damping=0.5)
    scene.add_body(lower, springs, velocity=(1, -2, 0))
    scene.add_body(
        lower.transformed(translate=(1, 0, 0)),
        ts.MassTensor(1e5, 0.3, 1000.0, eta=10.0),
        velocity=(0, -3, 1),
    )
    scene.add_obstacle(ts.Plane(point=(0, -1, 0), normal=(0, 1, 0), friction=0.4))
    for body in scene.bodies:
        body.contact = False  # bodies do not touch on a GPU
    return scene


def test_launches_per_substep_agree_with_one_launch_a_frame():
    one = Simulation(_scene("velocity-verlet", "f32", "lumped"), certify=False, threads=1)
    many = Simulation(_scene("velocity-verlet", "f32", "lumped"), certify=False, threads=1)
    many.stepper._advance = make_launches(many.stepper.structure)
    for _ in range(10):
        one.step()
        many.step()
    _check_same_motion(one, many)


def _check_same_motion(one, many):
    digits = float(np.finfo(one.system.real).eps)
    assert np.abs(one.positions() - one.system.world(0 * one.system.u)).max() > 0.01
    assert many.positions() == pytest.approx(one.positions(), abs=200 * digits)
    assert many.velocities() == pytest.approx(one.velocities(), abs=2e5 * digits)


def test_launches_of_any_length_give_the_same_bits():
    """Velocity Verlet with viscosity: a frame's bits hang on no count of launches."""
    results = []
    for longest in (64, 3):
        sim = Simulation(_scene("velocity-verlet", "f32", "lumped"), certify=False, threads=1)
        sim.stepper.longest = longest
        for _ in range(3):
            sim.step()
        results.append((sim.positions(), sim.velocities()))
    assert np.array_equal(*(x for x, _ in results))
    assert np.array_equal(*(v for _, v in results))


def test_launches_keep_the_same_account_under_loads():
    """With the other integrator, and with masses that join nodes."""
    sims = []
    for plain in (False, True):
        scene = _scene("symplectic-euler", "f64", "consistent")
        scene.bodies[0].load(ts.where.everything(), pressure=100.0)
        scene.bodies[1].load(ts.where.everything(), force=(1, 0, 0))
        sim = Simulation(scene, certify=False, threads=1, ledger=True)
        if plain:
            sim.stepper._advance = make_launches(sim.stepper.structure)
        for _ in range(10):
            sim.step()
        sims.append(sim)
    _check_same_motion(*sims)
    rows = [sim.energy() for sim in sims]
    assert rows[0]["dissipated"] > 0.1
    for key, value in rows[0].items():
        assert rows[1][key] == pytest.approx(value, rel=1e-9, abs=1e-9)
