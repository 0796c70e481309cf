"""A law of one's own is one file and its line in the registry (examples/yeoh.py).

It then passes what the built-in laws do: stress and tangent are derivatives, rotations cost
nothing, small strains see E and ν, the bound on the step holds, and energy is kept.
"""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

import tisoft as ts
from tisoft.equilibrium.operators import Elastic
from tisoft.model.part import parts_of
from tisoft.models.materials import MODELS
from tisoft.stable.sharp import sharp_limit

FILE = Path(__file__).parents[2] / "examples/yeoh.py"


def load():
    spec = importlib.util.spec_from_file_location("yeoh", FILE)
    module = importlib.util.module_from_spec(spec)
    sys.modules["yeoh"] = module
    spec.loader.exec_module(module)
    return module


yeoh = load()
KINDS = [yeoh.Yeoh, ts.ViscoElastic, ts.NeoHookean]


def block(kind, **keys):
    mesh = ts.box((1.0, 0.4, 0.3), (3, 2, 2))
    return ts.Scene().add_body(mesh, kind(1e4, 0.3, 1000.0, **keys))


def elastic(kind):
    return Elastic(parts_of([block(kind)])[0])


def state(body, size=0.03, seed=0):
    rng = np.random.default_rng(seed)
    return size * rng.standard_normal((body.nodes, 3)), rng.standard_normal((body.nodes, 3))


def test_it_is_one_short_file():
    assert FILE.read_text().split("def pull")[0].count("\n") < 100


def test_a_scene_file_knows_it_by_its_word():
    assert MODELS["yeoh"] is yeoh.Yeoh


@pytest.mark.parametrize("kind", KINDS)
def test_forces_are_minus_the_gradient_of_the_energy(kind):
    body = elastic(kind)
    u, w = state(body)
    h = 1e-6
    slope = (body.energy(u + h * w) - body.energy(u - h * w)) / (2 * h)
    assert -(body.force(u) * w).sum() == pytest.approx(slope, rel=1e-7)


@pytest.mark.parametrize("kind", KINDS)
def test_the_tangent_is_the_gradient_of_the_force_and_symmetric(kind):
    body = elastic(kind)
    u, w = state(body)
    z = state(body, seed=1)[1]
    h = 1e-6
    difference = -(body.force(u + h * w) - body.force(u - h * w)) / (2 * h)
    product = body.stiffness_times(w, u)
    assert np.abs(product - difference).max() < 1e-7 * np.abs(product).max()
    assert (z * product).sum() == pytest.approx((w * body.stiffness_times(z, u)).sum(), rel=1e-11)
    whole = body.stiffness(u) @ w.ravel()
    assert whole == pytest.approx(product.ravel(), rel=1e-10, abs=1e-9 * np.abs(product).max())


@pytest.mark.parametrize("kind", KINDS)
def test_a_rotation_costs_nothing(kind):
    body = elastic(kind)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    u = body.rest @ turn.T - body.rest
    assert abs(body.energy(u)) < 1e-12 * 1e4
    assert np.abs(body.force(u)).max() < 1e-10 * 1e4


def test_small_strains_see_the_constants_of_linear_elasticity():
    own, linear = elastic(yeoh.Yeoh), elastic(ts.Linear)
    _, w = state(own)
    rest = np.zeros_like(w)
    ours, theirs = own.stiffness_times(w, rest), linear.stiffness_times(w, rest)
    assert np.abs(ours - theirs).max() < 1e-12 * np.abs(theirs).max()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("stretch", [0.7, 1.0, 1.5, 2.0])
def test_the_bound_is_below_the_limit_of_the_deformed_state(kind, stretch):
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64")
    body = scene.add_body(ts.box((1.0, 0.4, 0.3), (3, 2, 2)), kind(1e4, 0.3, 1000.0, eta=5.0))
    sim = ts.Simulation(scene, certify=False, threads=1)
    x = body.mesh.points * [stretch, 1.0, 1.0]
    sim.set_state(x, 0 * x)
    part = sim.part(body)
    u = (x - body.mesh.points)[part.order]
    sharp = sharp_limit(part, integrator="symplectic-euler", u=u).step
    assert 0.2 * sharp < sim.stable_step() <= sharp


def test_a_free_body_keeps_its_energy_and_its_momenta():
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64", step=1e-4, frame_rate=100)
    body = scene.add_body(ts.box((1.0, 0.4, 0.3), (3, 2, 2)), yeoh.Yeoh(1e5, 0.3, 1000.0))
    sim = ts.Simulation(scene, threads=1, ledger=True)
    x = body.mesh.points * [1.3, 0.9, 0.9]
    sim.set_state(x, np.cross([0.0, 0.0, 2.0], x))
    spin = sim.measures.angular_momentum()
    start = sim.energy()
    for _ in range(30):
        sim.step()
    now = sim.energy()
    assert sim.measures.angular_momentum() == pytest.approx(spin, rel=1e-11, abs=1e-11)
    assert abs(now["error"]) < 0.02 * start["elastic"]
    assert not sim.recoveries
