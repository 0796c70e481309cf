"""Damping ratios turned into viscosity, and measured in free vibration."""

import numpy as np
import pytest

import tisoft as ts
from tisoft import where
from tisoft.equilibrium.damping import body_first_frequency, resolve_damping
from tisoft.equilibrium.modes import natural_modes

CLAMP = where.plane((0, 0, 0), (1, 0, 0))


def axial_bar(**options):
    mesh = ts.box((1, 0.1, 0.1), (10, 1, 1))
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64", frame_rate=1000.0)
    body = scene.add_body(mesh, ts.ViscoElastic(1e6, 0.0, 1000.0, **options))
    body.pin(CLAMP)
    body.pin(where.everything(), "yz")
    return scene


def measured_ratio(scene, shape, amplitude, seconds, node, axis):
    """ζ from two maxima one period apart of a free vibration in `shape`."""
    rest = np.concatenate([body.mesh.points for body in scene.bodies])
    simulation = ts.Simulation(scene, certify=False)
    simulation.set_state(rest + amplitude * shape, 0 * rest)
    way = [frame.positions()[node, axis] for frame in simulation.frames(seconds)]
    way = np.array(way) - rest[node, axis]
    inner = way[1:-1]
    tops = np.flatnonzero((inner > way[:-2]) & (inner >= way[2:]) & (inner > 0)) + 1
    peaks = []
    for k in tops[:2]:  # parabola through three frames
        a, b, c = way[k - 1 : k + 2]
        peaks.append(b + (a - c) ** 2 / (8 * (2 * b - a - c)))
    decrement = np.log(peaks[0] / peaks[1])
    return decrement / np.hypot(2 * np.pi, decrement)


def test_damping_ratio_of_an_axial_bar_is_what_was_asked():
    """REFERENCES A5d: ζ = τω/2; ν = 0, so φ = 0 and η = τE/2."""
    scene = axial_bar(damping_ratio=0.05)
    body = scene.bodies[0]
    frequency = body_first_frequency(body)
    assert frequency == pytest.approx(7.90, abs=0.02)
    (model,) = resolve_damping(scene)
    assert model.phi == 0.0 and model.damping_ratio is None
    assert model.eta == pytest.approx(0.05 / (np.pi * frequency) * 5e5, rel=1e-12)
    assert model.eta == pytest.approx(1006.584, rel=2e-3)  # the continuum's
    body.model = model
    mode = natural_modes(scene, 1)
    end = len(body.mesh.points) - 1
    shape = mode.shape(0) * np.sign(mode.shape(0)[end, 0])
    ratio = measured_ratio(scene, shape, 1e-5, 0.3, end, 0)
    assert ratio == pytest.approx(0.05, rel=1e-2)


def test_damping_at_another_frequency():
    (model,) = resolve_damping(axial_bar(damping_ratio=0.05, damping_at=20.0))
    assert model.eta == pytest.approx(0.05 / (np.pi * 20.0) * 5e5, rel=1e-12)


def test_viscosity_is_in_proportion_to_stiffness():
    scene = ts.Scene()
    mesh = ts.box((1, 0.2, 0.2), (10, 2, 2))
    body = scene.add_body(mesh, ts.NeoHookean(1e6, 0.3, 1000.0, damping_ratio=0.02))
    body.pin(CLAMP)
    (model,) = resolve_damping(scene)
    assert model.phi / model.lame_lambda == pytest.approx(model.eta / model.lame_mu)
    assert model.eta == pytest.approx(0.02 / (np.pi * 1.211897993) * model.lame_mu, rel=1e-8)


def test_undamped_models_are_left_alone():
    scene = axial_bar(eta=3.0)
    assert resolve_damping(scene)[0] is scene.bodies[0].model
    scene = axial_bar(damping_ratio=0.0)
    assert resolve_damping(scene)[0].eta == 0.0


@pytest.mark.parametrize("stiffness", [100.0, [50.0, 100.0, 150.0]])
def test_damper_of_a_chain(stiffness):
    """Equal springs: c = τ k.  Others: one c that damps the first mode as asked."""
    points = np.stack([np.arange(4.0), np.zeros(4), np.zeros(4)], axis=1)
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64", frame_rate=2000.0)
    body = scene.add_body(
        ts.net(points, [[0, 1], [1, 2], [2, 3]]),
        ts.MassSpring(stiffness=stiffness, node_mass=0.01, damping_ratio=0.03),
    )
    body.pin(where.nodes([0]))
    body.pin(where.everything(), "yz")
    (model,) = resolve_damping(scene)
    frequency = body_first_frequency(body)
    if stiffness == 100.0:
        assert model.spring_damping == pytest.approx(0.03 / (np.pi * frequency) * 100, rel=1e-9)
    body.model = model
    shape = natural_modes(scene, 1).shape(0)
    shape = shape * np.sign(shape[3, 0])
    ratio = measured_ratio(scene, shape, 1e-4, 2.5 / frequency, 3, 0)
    assert ratio == pytest.approx(0.03, rel=1e-2)


def test_net_whose_modes_cost_nothing_asks_for_a_frequency():
    scene = ts.Scene()
    net = ts.MassSpring(stiffness=100.0, node_mass=0.01, damping_ratio=0.1)
    scene.add_body(ts.cloth((1, 1), (8, 8), diagonals=False), net)
    with pytest.raises(ts.SceneError, match="damping_at"):
        resolve_damping(scene)
    scene.bodies[0].model = ts.MassSpring(
        stiffness=100.0, node_mass=0.01, damping_ratio=0.1, damping_at=5.0
    )
    (model,) = resolve_damping(scene)
    assert model.spring_damping == pytest.approx(0.1 / (np.pi * 5.0) * 100.0)


@pytest.mark.slow
def test_viscous_cantilever_decays_as_predicted():
    """REFERENCES A5d: φ = 500, η = 1500 on 10 x 2 x 2 cells, ζ = .01341173, by the shape's
    own K(φ, η) and by two maxima of a run."""
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64", frame_rate=1000.0, step=1e-4)
    mesh = ts.box((1, 0.2, 0.2), (10, 2, 2))
    model = ts.ViscoElastic(1e6, 0.3, 1000.0, phi=500.0, eta=1500.0)
    scene.add_body(mesh, model).pin(CLAMP)
    mode = natural_modes(scene, 1)
    shape = mode.shape(0)
    node, axis = np.unravel_index(np.abs(shape).argmax(), shape.shape)
    ratio = measured_ratio(scene, shape * np.sign(shape[node, axis]), 1e-4, 1.8, node, axis)
    assert ratio == pytest.approx(0.01341173, rel=1e-2)
