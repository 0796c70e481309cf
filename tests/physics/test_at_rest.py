"""A3, A4, A10: where damped bodies come to rest, the same numbers as of a static solver."""

import numpy as np
import pytest
from beams import CLAMPED, beam, cantilever, gmsh_beam, node_at, rubber

import tisoft as ts
from tisoft import where
from tisoft.simulation import Simulation

G = (0.0, 0.0, -9.81)
DRAG = 15.0
"""Point damping [1/s] that nearly is critical for the beam's first bending, 1.2 Hz."""


def _settled(sim, seconds):
    """Displacements at rest [m], after a check that nothing moves any more."""
    for _ in range(round(seconds * sim.scene.frame_rate)):
        sim.step()
    u = sim.positions() - sim.scene.bodies[0].mesh.points
    assert np.abs(sim.velocities()).max() < 1e-8 * np.abs(u).max()
    return u


# -- A4: under its own weight -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("split", "tip", "energy"),
    [
        ("five", (-0.03372279, 0.0, -0.24285602), 19.2598482),
        ("six", (-0.02089171, 0.02986441, -0.18847779), 15.2038423),
    ],
)
def test_st_venant_beam_hangs(split, tip, energy):
    mesh = beam(split)
    sim = cantilever(rubber(point_damping=DRAG), mesh=mesh, h=1e-3, substeps=500, gravity=G)
    u = _settled(sim, 5.0)
    assert u[node_at(mesh, (1, 0.1, 0.1))] == pytest.approx(tip, abs=1e-8)
    assert sim.energy()["elastic"] == pytest.approx(energy, rel=1e-7)
    assert u.min() > -0.3457  # stiffer than the continuum


@pytest.mark.parametrize(
    ("name", "tip", "energy"),
    [
        ("c", (-0.00705614, 0.00320554, -0.27149194), 21.3204094),
        pytest.param(
            "m", (-0.01261323, 0.00120294, -0.30112428), 23.3407830, marks=pytest.mark.slow
        ),
    ],
)
def test_unstructured_st_venant_beam_hangs(name, tip, energy):
    mesh = gmsh_beam(name)
    model = rubber(point_damping=DRAG)
    sim = cantilever(model, mesh=mesh, h=6e-4, substeps=500, gravity=G)
    u = _settled(sim, 6.0)
    assert u[node_at(mesh, (1, 0.2, 0.2))] == pytest.approx(tip, abs=1e-8)
    assert sim.energy()["elastic"] == pytest.approx(energy, rel=1e-7)


@pytest.mark.parametrize("kind", [ts.Linear, ts.MassTensor])
@pytest.mark.parametrize(("split", "drop"), [("five", -0.25273164), ("six", -0.19500025)])
def test_linear_beam_hangs(kind, split, drop):
    mesh = beam(split)
    model = rubber(kind, point_damping=DRAG)
    sim = cantilever(model, mesh=mesh, h=1e-3, substeps=500, gravity=G)
    u = _settled(sim, 5.0)
    assert u[node_at(mesh, (1, 0.1, 0.1)), 2] == pytest.approx(drop, abs=1e-8)


def test_consistent_mass_hangs_where_lumped_mass_does():
    """At rest the mass is only weight, and both share it out alike."""
    mesh = beam()
    model = rubber(point_damping=DRAG, mass="consistent")
    sim = cantilever(model, mesh=mesh, h=8e-4, substeps=500, gravity=G)
    u = _settled(sim, 4.8)
    tip = (-0.03372279, 0.0, -0.24285602)
    assert u[node_at(mesh, (1, 0.1, 0.1))] == pytest.approx(tip, abs=1e-8)


# -- A3, A10: a small load on the free end ------------------------------------------------------

FREE_END = where.box((1 - 1e-9, -1, -1), (1 + 1e-9, 1, 1))


def _loaded(mesh, model, *, force, pins, h=1e-3, seconds=5):
    """Displacements under `force` [N], spread over the face x = 1."""
    scene = ts.Scene(gravity=(0, 0, 0), frame_rate=2.0, step=h, precision="f64")
    body = scene.add_body(mesh, model)
    for selection, axes in pins:
        body.pin(selection, axes)
    body.load(FREE_END, force=force)
    return _settled(Simulation(scene, certify=False, threads=1), seconds)


@pytest.mark.parametrize("kind", [ts.Linear, ts.MassTensor])
@pytest.mark.parametrize(("split", "tip"), [("five", -1.711630e-3), ("six", -1.306241e-3)])
def test_linear_beam_under_a_newton(kind, split, tip):
    """A3: −33 % and −49 % of the continuum's −2.5432 mm are right for this mesh."""
    mesh = beam(split)
    model = rubber(kind, point_damping=DRAG)
    u = _loaded(mesh, model, force=(0, 0, -1), pins=[(CLAMPED, "xyz")])
    assert u[node_at(mesh, (1, 0.1, 0.1)), 2] == pytest.approx(tip, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "compliance", "tip"),
    [("c", 1.852173e-3, -1.851297e-3), ("m", 2.091884e-3, -2.092280e-3)],
)
def test_unstructured_beam_under_a_newton(name, compliance, tip):
    """F·u = 2 W at rest, and W = ½ F·u whatever the node."""
    mesh = gmsh_beam(name)
    scene = ts.Scene(gravity=(0, 0, 0), frame_rate=2.0, step=5e-4, precision="f64")
    body = scene.add_body(mesh, rubber(ts.Linear, point_damping=DRAG))
    body.pin(CLAMPED)
    body.load(FREE_END, force=(0, 0, -1))
    sim = Simulation(scene, certify=False, threads=1)
    u = _settled(sim, 5.0)
    assert u[node_at(mesh, (1, 0.2, 0.2)), 2] == pytest.approx(tip, rel=1e-6)
    assert 2 * sim.energy()["elastic"] == pytest.approx(compliance, rel=1e-6)


@pytest.mark.parametrize(
    ("split", "cells", "tip"),
    [
        ("six", (10, 2, 2), -1.7590443e-3),
        ("five", (10, 2, 2), -1.7244377e-3),
        ("six", (20, 4, 4), -2.2356156e-3),
        ("five", (20, 4, 4), -2.0494639e-3),
    ],
)
def test_beam_of_springs_under_a_small_force(split, cells, tip):
    """A10: 10 to 30 % off the continuum, whatever the mesh."""
    mesh, small = beam(split, cells), 1e-3
    model = ts.MassSpring(young=1e6, density=1000.0, point_damping=DRAG)
    force = (0, 0, -small)
    u = _loaded(mesh, model, force=force, pins=[(CLAMPED, "xyz")], h=5e-4, seconds=7)
    assert u[node_at(mesh, (1, 0.1, 0.1)), 2] / small == pytest.approx(tip, rel=2e-6)


@pytest.mark.parametrize(
    ("split", "cells", "modulus", "poisson"),
    [
        ("six", (10, 2, 2), 1.083, 0.03),
        ("five", (10, 2, 2), 1.173, 0.15),
        ("six", (20, 4, 4), 1.072, 0.03),
        ("five", (20, 4, 4), 1.187, 0.18),
    ],
)
def test_pulled_springs_have_their_own_young_and_poisson(split, cells, modulus, poisson):
    mesh, stress = beam(split, cells), 1.0
    model = ts.MassSpring(young=1e6, density=1000.0, point_damping=80.0)
    rollers = [
        (where.box([-1e-9 if k == axis else -9 for k in range(3)],
                   [1e-9 if k == axis else 9 for k in range(3)]), "xyz"[axis])
        for axis in range(3)
    ]  # fmt: skip
    u = _loaded(mesh, model, force=(stress * 0.04, 0, 0), pins=rollers, h=5e-4)
    end = mesh.points[:, 0] == 1.0
    strain = u[end, 0].mean()
    assert stress / 1e6 / strain == pytest.approx(modulus, abs=1e-3)
    for axis in (1, 2):
        slope = np.polyfit(mesh.points[:, axis], u[:, axis], 1)[0]
        assert -slope / strain == pytest.approx(poisson, abs=5e-3)
