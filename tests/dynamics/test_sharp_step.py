"""The sharp stable step against tabulated limits: within 1 % and never above."""

import numpy as np
import pytest

import tisoft as ts
from tisoft import where
from tisoft.model.system import System
from tisoft.stable.sharp import sharp_step

CLAMP = where.plane((0, 0, 0), (1, 0, 0))


def limit(*bodies):
    scene = ts.Scene()
    for mesh, model in bodies:
        scene.add_body(mesh, model).pin(CLAMP)
    ts.Simulation(scene)  # starts Taichi
    return sharp_step(System(scene.bodies, "f64"), integrator="symplectic-euler")


def near_below(found, true):
    return 0.99 * true < found <= true * (1 + 1e-9)


def bar(split, n, **options):
    mesh = ts.box((1, 0.2, 0.2), (10 * n, 2 * n, 2 * n), split=split)
    return mesh, ts.ViscoElastic(1e6, 0.3, 1000.0, **options)


LIMITS = [  # REFERENCES A3: ω_max [rad/s] of K φ = ω² M φ; h = 2/ω
    ("six", 1, "lumped", 1107.473757705244),
    ("six", 1, "consistent", 2274.845267104477),
    ("six", 2, "lumped", 2193.8385240507514),
    ("six", 2, "consistent", 4483.450203825309),
    ("five", 1, "lumped", 1321.8108270318617),
    ("five", 1, "consistent", 2284.5521786400295),
    ("five", 2, "lumped", 2611.475078123402),
    ("five", 2, "consistent", 4520.490607929559),
]


@pytest.mark.parametrize(("split", "n", "mass", "omega"), LIMITS)
def test_limit_of_a_cantilever(split, n, mass, omega):
    assert near_below(limit(bar(split, n, mass=mass)), 2 / omega)


def test_limit_with_viscosity_in_proportion():
    """REFERENCES A7: h = −τ + √(τ² + 4/ω²), 13 times smaller at τ = .01."""
    true = -0.01 + np.sqrt(1e-4 + 4 / 1321.8108270318617**2)
    assert true == pytest.approx(1.138220e-4, rel=2e-6)
    mesh, plain = bar("five", 1)
    model = ts.ViscoElastic(
        1e6, 0.3, 1000.0, phi=0.01 * plain.lame_lambda, eta=0.01 * plain.lame_mu
    )
    assert near_below(limit((mesh, model)), true)


def test_limit_with_viscosity_out_of_proportion():
    """Where 4M − 2hC − h²K, assembled densely from differences of forces, stops being positive."""
    mesh = ts.box((1, 0.4, 0.4), (3, 1, 1))
    model = ts.ViscoElastic(1e6, 0.45, 1000.0, phi=10.0, eta=800.0, point_damping=40.0)
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add_body(mesh, model).pin(CLAMP)
    simulation = ts.Simulation(scene, precision="f64")
    rest, still = mesh.points, np.zeros_like(mesh.points)
    free = np.flatnonzero(np.repeat(rest[:, 0] > 0, 3))
    stiffness, viscosity = [], []
    for k in free:
        way = np.zeros(rest.size)
        way[k] = 1e-6
        way = way.reshape(-1, 3)
        for columns, change in ((stiffness, (way, still)), (viscosity, (still, way))):
            pair = []
            for sign in (1, -1):
                simulation.set_state(rest + sign * change[0], sign * change[1])
                pair.append(simulation.forces().ravel()[free])
            columns.append((pair[1] - pair[0]) / 2e-6)
    volumes = np.linalg.det(rest[mesh.tets[:, 1:]] - rest[mesh.tets[:, :1]]) / 6
    mass = np.bincount(mesh.tets.ravel(), np.repeat(250.0 * volumes, 4))
    weight = np.diag(np.repeat(mass, 3)[free])
    k, c = np.array(stiffness), np.array(viscosity) + 40.0 * weight
    low, high = 1e-6, 1.0
    for _ in range(60):
        h = np.sqrt(low * high)
        stable = np.linalg.eigvalsh(4 * weight - 2 * h * c - h * h * k)[0] > 0
        low, high = (h, high) if stable else (low, h)
    assert near_below(limit((mesh, model)), low * (1 + 1e-6))


def test_limit_of_a_chain():
    """REFERENCES S3, with and without dashpots."""
    points = np.stack([np.arange(11.0), np.zeros(11), np.zeros(11)], axis=1)
    springs = [[i, i + 1] for i in range(10)]
    omega2 = 4 * 100 / 0.01 * np.sin(19 * np.pi / 42) ** 2
    for damper in (0.0, 0.05, 1.0):
        model = ts.MassSpring(stiffness=100.0, node_mass=0.01, spring_damping=damper)
        tau = damper / 100.0
        true = -tau + np.sqrt(tau * tau + 4 / omega2)
        assert near_below(limit((ts.net(points, springs), model)), true), damper
        if not damper:
            assert true == pytest.approx(1.0112953e-2, rel=1e-6)


def test_the_stiffest_body_sets_the_limit():
    soft, (mesh, stiff) = bar("five", 1), bar("six", 1)
    stiff = ts.ViscoElastic(4e6, 0.3, 1000.0)
    assert limit(soft, (mesh, stiff)) == limit((mesh, stiff))
