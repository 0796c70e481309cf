"""The same scenes on a graphics device and on the CPU; run where there is one: pytest -m gpu -n 0.

Sums are taken in another order there, so states agree to rounding, not bit for bit.
"""

import numpy as np
import pytest

import tisoft as ts
from tisoft import runtime
from tisoft.geometry.solid import quadratic
from tisoft.render.camera import Camera
from tisoft.render.items import Surface
from tisoft.render.renderer import Renderer
from tisoft.simulation import Simulation

pytestmark = pytest.mark.gpu
FRAMES = 20
SOFT = {"young": 1e5, "poisson": 0.3, "density": 1000.0, "phi": 20.0, "eta": 20.0}


def _solid(model, mesh, **keys):
    """A beam that its weight bends."""
    scene = ts.Scene(step=1e-4, frame_rate=100, **keys)
    body = scene.add_body(mesh, model, "beam")
    body.pin(ts.where.box((-1, -1, -1), (1e-6, 1, 1)))
    body.contact = False
    scene.add_probe("tip", "beam", point=(1, 0.1, 0.1))
    return scene


def _beam(element="tet4"):
    if element == "hex8":
        return ts.box((1, 0.2, 0.2), (5, 2, 2), split="hex")
    mesh = ts.box((1, 0.2, 0.2), (5, 2, 2), split="six")
    return mesh if element == "tet4" else quadratic(mesh)


def _springs(**keys):
    model = ts.MassSpring(young=1e5, density=500.0, spring_damping=0.3, point_damping=0.5)
    return _solid(model, _beam(), **keys)


def _landing(obstacle):
    """A cube whose nodes meet an obstacle, as they do with explicit Euler on the CPU too."""
    scene = ts.Scene(precision="f64", step=2e-4, frame_rate=100, integrator="explicit-euler")
    cube = ts.box((0.2, 0.2, 0.2), (3, 3, 3))
    body = scene.add_body(cube, ts.NeoHookean(**SOFT), "cube", velocity=(0.1, -3, 0))
    body.contact = False
    scene.add_obstacle(obstacle)
    return scene


def _loaded():
    scene = _solid(ts.ViscoElastic(**SOFT, mass="consistent"), _beam(), precision="f64")
    scene.bodies[0].load(ts.where.everything(), pressure=100.0)
    grip = ts.box((0.2, 0.2, 0.2), (2, 2, 2)).transformed(translate=(0, 1, 0))
    held = scene.add_body(grip, ts.ViscoElastic(**SOFT), "held")
    held.contact = False
    held.pin(ts.where.box((-1, 1.19, -1), (1, 2, 1)), velocity=(0, 0.5, 0))
    return scene


CASES = {
    "st-venant": lambda: _solid(ts.ViscoElastic(**SOFT), _beam(), precision="f64"),
    "st-venant-f32": lambda: _solid(ts.ViscoElastic(**SOFT), _beam(), precision="f32"),
    "linear": lambda: _solid(ts.Linear(**SOFT), _beam(), precision="f64"),
    "neo-hookean": lambda: _solid(ts.NeoHookean(**SOFT), _beam(), precision="f64"),
    "tensor": lambda: _solid(ts.MassTensor(**SOFT), _beam(), precision="f64"),
    "hex8": lambda: _solid(ts.ViscoElastic(**SOFT), _beam("hex8"), precision="f64"),
    "tet10": lambda: _solid(ts.NeoHookean(**SOFT), _beam("tet10"), precision="f64"),
    "springs": lambda: _springs(precision="f64"),
    "springs-f32": lambda: _springs(precision="f32"),
    "explicit-euler": lambda: _springs(precision="f64", integrator="explicit-euler"),
    "verlet": lambda: _springs(precision="f64", integrator="velocity-verlet"),
    "plane": lambda: _landing(ts.Plane((0, 0, 0), (0, 1, 0), friction=0.4)),
    "ball": lambda: _landing(ts.Sphere((0.1, -0.15, 0.1), 0.15, friction=0.4)),
    "box": lambda: _landing(ts.Box((-0.02, -0.1, 0.0), (0.35, 0.18, 0.4), friction=0.4)),
    "loads": _loaded,
}


def _run(arch):
    """{case: (positions, velocities, energies)} after FRAMES frames, on `arch`."""
    found = {}
    for name, make in CASES.items():
        sim = Simulation(make(), arch=arch, ledger=name == "loads")
        for _ in range(FRAMES):
            sim.step()
        found[name] = sim.positions(), sim.velocities(), sim.energy() if sim.ledger else {}
    return found


@pytest.fixture(scope="module")
def both():
    """What the CPU and the device make of every case."""
    runtime.start("cpu")
    return _run("cpu"), _run("cuda")


@pytest.mark.parametrize("name", CASES)
def test_a_device_moves_bodies_as_the_cpu_does(both, name):
    (x, v, energy), (device_x, device_v, device_energy) = (results[name] for results in both)
    single = name.endswith("f32")
    assert np.abs(v).max() > 0.01
    assert device_x == pytest.approx(x, abs=2e-5 if single else 1e-10)
    assert device_v == pytest.approx(v, abs=2e-3 if single else 1e-8)
    for key, value in energy.items():
        assert device_energy[key] == pytest.approx(value, rel=1e-9, abs=1e-9)


def test_a_device_draws_what_the_cpu_draws():
    ball = ts.ball(0.5, 4)
    camera = Camera((2.0, 1.0, 2.0), (0.0, 0.0, 0.0))
    pictures = []
    for arch in ("cpu", "cuda"):
        runtime.start(arch)
        renderer = Renderer((160, 120), ground=-0.5)
        pictures.append(renderer.draw([Surface(ball.points, ball.surface)], camera).astype(int))
    difference = np.abs(pictures[1] - pictures[0])
    assert np.ptp(pictures[0]) > 50
    assert difference.max() <= 2 and (difference > 0).mean() < 1e-2
