"""Regions of their own material: a body of two is the sum of its halves."""

from dataclasses import replace

import numpy as np
import pytest

import tisoft as ts
from tisoft import where
from tisoft.errors import SceneError
from tisoft.geometry.groups import Region

SOFT, STIFF = {"young": 1e5, "density": 800.0}, {"young": 1e6, "density": 2500.0}


def bar():
    """1 x .1 x .1 m; "stiff" is its half of x > .5 m."""
    made = ts.box((1.0, 0.1, 0.1), (10, 1, 1))
    right = made.points[made.tets].mean(axis=1)[:, 0] > 0.5
    regions = [Region(n, k, np.flatnonzero(right == k)) for k, n in enumerate(("soft", "stiff"))]
    return replace(made, regions=tuple(regions)), right


def model(kind, numbers):
    if kind is ts.MassSpring:
        return kind(**numbers)
    more = {"phi": 30.0, "eta": 20.0} if numbers is SOFT else {"phi": 0.0, "eta": 50.0}
    return kind(**numbers, poisson=0.3, **more)


def of_two(kind, mesh, **scene):
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64", **scene)
    body = scene.add_body(mesh, model(kind, SOFT))
    more = {} if kind is ts.MassSpring else {"phi": 0.0, "eta": 50.0}
    body.region("stiff", **STIFF, **more)
    return scene, body


def state_of(sim, u, v):
    sim.set_state(sim.scene.bodies[0].mesh.points + u, v)
    return sim


@pytest.mark.parametrize("kind", [ts.ViscoElastic, ts.MassTensor, ts.MassSpring])
def test_a_body_of_two_regions_is_the_sum_of_its_halves(kind):
    mesh, right = bar()
    scene, _ = of_two(kind, mesh)
    rng = np.random.default_rng(1)
    u, v = 2e-3 * rng.standard_normal((2, *mesh.points.shape))
    sim = state_of(ts.Simulation(scene), u, v)
    force, mass, energy = np.zeros_like(u), np.zeros(len(u)), 0.0
    for half, numbers in ((~right, SOFT), (right, STIFF)):
        nodes = np.unique(mesh.tets[half])
        alone = ts.Scene(gravity=(0, 0, 0), precision="f64")
        part = ts.tet_mesh(mesh.points[nodes], np.searchsorted(nodes, mesh.tets[half]))
        alone.add_body(part, model(kind, numbers))
        own = state_of(ts.Simulation(alone), u[nodes], v[nodes])
        force[nodes] += own.forces()
        mass[nodes] += own.masses()
        energy += own.energy()["elastic"]
    if kind is ts.MassSpring:  # a spring between the halves has the stiffness of both
        between = np.abs(mesh.points[:, 0] - 0.5) < 1e-9
        assert sim.forces()[~between] == pytest.approx(force[~between], rel=1e-9, abs=1e-9)
    else:
        assert sim.forces() == pytest.approx(force, rel=1e-9, abs=1e-9)
    assert sim.masses() == pytest.approx(mass, rel=1e-12)
    assert sim.energy()["elastic"] == pytest.approx(energy, rel=1e-9)


def test_equilibrium_and_step_follow_the_regions():
    mesh, _ = bar()
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64")
    body = scene.add_body(mesh, ts.Linear(1e5, 0.0, 1000.0, damping_ratio=0.1, damping_at=1.0))
    body.pin(where.plane((0, 0, 0), (1, 0, 0)))
    body.load(where.plane((1, 0, 0), (-1, 0, 0)), force=(1, 0, 0))
    whole = ts.Simulation(scene).stable_step()
    region = body.region("stiff", young=1e6)
    sim = ts.Simulation(scene)
    found = sim.equilibrium()
    end = found.positions[mesh.points[:, 0] > 1 - 1e-9, 0]
    assert end == pytest.approx(1.0 + 5.5e-4, abs=5.5e-10)
    assert found.energy["elastic"] == pytest.approx(2.75e-4, rel=1e-6)
    sim.measures.elements(body)
    sim.set_state(found.positions, np.zeros_like(mesh.points))
    stress = sim.measures.elements(body).cauchy[:, 0, 0]
    assert stress == pytest.approx(np.full(len(stress), 100.0), rel=1e-6)
    (soft, stiff) = sim.parts[0].solids
    assert stiff.solid.eta == pytest.approx(10 * soft.solid.eta, rel=1e-12)
    assert sim.stable_step() < 0.35 * whole
    # A region may change while the scene runs; its cells may not.
    body.regions[0] = ts.RegionMaterial("stiff", young=1e5)
    sim.step()
    assert sim.stable_step() == pytest.approx(whole, rel=1e-6)
    body.regions[0] = region
    sim.step()
    body.regions.append(ts.RegionMaterial("soft", young=2e5))
    with pytest.raises(SceneError, match="cannot take in other cells while it runs"):
        sim.step()
    body.regions.append(ts.RegionMaterial(tag=0, young=2e5))
    with pytest.raises(SceneError, match=r"region\[2\] has 25 cells that region\[1\] gives"):
        scene.validate()


def test_consistent_mass_and_checkpoints_follow_the_regions(tmp_path):
    mesh, _ = bar()
    scene = ts.Scene(gravity=(0, 0, -1.0), precision="f64", frame_rate=1000)
    body = scene.add_body(mesh, ts.Linear(1e5, 0.3, 1000.0, mass="consistent"))
    body.pin(where.plane((0, 0, 0), (1, 0, 0)))
    body.region("stiff", young=1e6, density=3000.0)
    sim = ts.Simulation(scene)
    v = np.random.default_rng(1).standard_normal(mesh.points.shape)
    v[mesh.points[:, 0] < 1e-9] = 0.0  # held nodes keep the velocity of their pin
    sim.set_state(mesh.points, v)
    tets = mesh.tets
    local = (np.ones((4, 4)) + np.eye(4)) / 20.0
    rho = np.where(mesh.points[tets].mean(axis=1)[:, 0] > 0.5, 3000.0, 1000.0) * mesh.volumes
    kinetic = 0.5 * np.einsum("e,ab,eai,ebi->", rho, local, v[tets], v[tets])
    assert sim.energy()["kinetic"] == pytest.approx(kinetic, rel=1e-12)
    sim.step()
    sim.save(tmp_path / "a.npz")
    again = ts.Simulation.load(tmp_path / "a.npz")
    sim.step(), again.step()
    assert np.array_equal(sim.positions(), again.positions())
