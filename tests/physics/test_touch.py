"""Surfaces that cages carry meet obstacles as they are, not the lattice around them."""

import numpy as np
import pytest
from beams import simulate
from surfaces import block, sphere

import tisoft as ts
from tisoft.geometry.cage.build import caged
from tisoft.geometry.cage.lattice import Lattice

G = 9.81
RUBBER = ts.ViscoElastic(1e5, 0.3, 1000.0, phi=40.0, eta=40.0)


def run(mesh, *, friction=0.0, seconds=0.2, velocity=(0, 0, 0), gravity=G):
    plane = ts.Plane(point=(0, 0, 0), normal=(0, 1, 0), friction=friction)
    body = (mesh, RUBBER, {"velocity": velocity})
    sim = simulate(body, h=4e-4, substeps=25, gravity=(0, -gravity, 0), obstacles=[plane])
    sim.ledger = True
    lowest = []
    for _ in range(round(seconds / 0.01)):
        sim.step()
        lowest.append(sim.scene.bodies[0].skin.carried(sim.positions())[:, 1].min())
    return sim, np.array(lowest)


def center_velocity(sim):
    part = sim.parts[0]
    return part.mass @ sim.velocities()[part.order] / part.mass.sum()


def test_a_ball_bounces_on_its_surface():
    """The lattice's corners hang below the ball's sides and would stop it otherwise; nothing pushes
    sideways; what the ground takes is told by the ledger.
    """
    points, triangles = sphere(0.1, 8)
    mesh = ts.cage(points, triangles, cells_across=4).transformed(translate=(0, 0.11, 0))
    sim, lowest = run(mesh, velocity=(0.3, 0, 0))
    assert lowest.min() > -0.002
    assert abs(lowest[2:8]).min() < 0.002
    x = sim.positions()[:, 1]
    assert x.min() < lowest[-1] + 0.05
    assert center_velocity(sim)[[0, 2]] == pytest.approx([0.3, 0.0], abs=2e-3)
    energy = sim.energy()
    fell = 1000 * G * mesh.volumes.sum() * 0.01
    assert abs(energy["error"]) < 0.05 * fell
    assert energy["dissipated"] > 0.05 * fell


def test_a_block_in_a_lattice_that_does_not_fit_slides_by_coulomb():
    """Its bottom lies at .4 of the lowest cells; μ g slows it."""
    points, triangles = block((0.2, 0.1, 0.1), (0, 0, 0))
    edge = 0.05
    lattice = Lattice(np.eye(3), np.array([0, -0.03, 0]), np.full(3, edge), np.array([4, 3, 2]))
    sim, lowest = run(caged(points, triangles, lattice), friction=0.3, velocity=(1.0, 0, 0))
    assert lowest.min() > -0.001
    assert center_velocity(sim)[0] == pytest.approx(1.0 - 0.3 * G * 0.2, rel=0.02)


def test_a_ball_that_starts_inside_comes_out_at_the_speed_of_pushing():
    """Many points push the same nodes, and none of them further than the deepest may come."""
    points, triangles = sphere(0.1, 8)
    mesh = ts.cage(points, triangles, cells_across=4).transformed(translate=(0, 0.09, 0))
    sim, lowest = run(mesh, seconds=0.5, gravity=0.0)
    speed = 0.01 / 0.344
    assert lowest[0] < -0.009 and -1e-4 < lowest[-1] < 0.01
    assert np.diff(lowest).max() < 2.0 * speed * 0.01
    assert np.linalg.norm(sim.velocities(), axis=1).max() < 2.0 * speed
    told = sim.energy()
    assert 0.0 < told["dissipated"] < told["external_work"]
    assert abs(told["error"]) < 0.5 * told["external_work"]
