"""Long runs: energy and momentum stay where they belong, memory stays flat.

TISOFT_SOAK=1000000 runs the full million substeps (and 600 scenes always run).
"""

import os
from pathlib import Path

import numpy as np
import pytest

import tisoft as ts

SUBSTEPS = int(os.environ.get("TISOFT_SOAK", "100000"))

pytestmark = pytest.mark.slow


def cantilever(precision):
    scene = ts.Scene(precision=precision, frame_rate=20.0)
    beam = scene.add_body(ts.box((1.0, 0.2, 0.2), (10, 2, 2)), ts.ViscoElastic(1e6, 0.3, 1000.0))
    beam.pin(ts.where.box((-1e-6, -1, -1), (1e-6, 1, 1)))
    return scene


def total_energy(sim):
    energy = sim.energy()
    return energy["kinetic"] + energy["elastic"] + energy["gravity"]


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_undamped_cantilever_keeps_its_energy(precision):
    """Dropped straight under gravity: total energy 0, swinging 38 J to and fro."""
    sim = ts.Simulation(cantilever(precision))
    energies = []
    while sim.substeps < SUBSTEPS:
        sim.step()
        energies.append(total_energy(sim))
    swing = 38.0  # J of gravity energy between the ends of a swing, mgh
    assert np.abs(energies).max() < 0.005 * swing
    tenth = len(energies) // 10
    # Each change of the step shifts the energy that symplectic Euler conserves, (h/2) v·f; steps
    # change while the beam falls for the first time.
    drift = np.mean(energies[-tenth:]) - np.mean(energies[tenth : 2 * tenth])
    assert abs(drift) < 0.002 * swing
    assert sim.recoveries == []


@pytest.mark.parametrize(("precision", "most"), [("f64", 1e-11), ("f32", 1e-3)])
def test_free_spinning_brick_keeps_its_momenta(precision, most):
    scene = ts.Scene(gravity=(0.0, 0.0, 0.0), precision=precision, frame_rate=20.0)
    brick = ts.box((1.0, 0.5, 0.5), (4, 2, 2))
    scene.add_body(brick, ts.ViscoElastic(1e5, 0.3, 1000.0), velocity=(1, 0, 0), spin=(0.5, 1, 3))
    sim = ts.Simulation(scene)
    masses = sim.masses()[:, None]

    def momenta():
        x, v = sim.positions(), sim.velocities()
        middle = (masses * x).sum(axis=0) / masses.sum()
        return (masses * v).sum(axis=0), (masses * np.cross(x - middle, v)).sum(axis=0)

    linear, angular = momenta()
    while sim.substeps < SUBSTEPS:
        sim.step()
    new_linear, new_angular = momenta()
    assert np.abs(new_linear - linear).max() < most * np.linalg.norm(linear)
    assert np.abs(new_angular - angular).max() < most * np.linalg.norm(angular)


def test_six_hundred_scenes_in_one_process_leave_memory_flat():
    def resident():
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 2**20

    for number in range(600):
        sim = ts.Simulation(cantilever("f32"))
        sim.step()
        if number == 100:
            early = resident()
    assert resident() - early < 20.0  # MiB
