"""The half-step start (REFERENCES A8): symplectic Euler's velocity lives half a step earlier."""

import numpy as np
import pytest

import tisoft as ts
from tisoft.errors import SceneError

OMEGA = 2.0 * np.pi


def oscillator(start, step, **more):
    """One mass of 1 kg on a spring with ω = 2π, let go 0.1 m from rest; quarter periods."""
    scene = ts.Scene(
        gravity=(0, 0, 0), precision="f64", frame_rate=4.0, start=start, step=step, **more
    )
    net = ts.net([[0, 0, 0], [1, 0, 0]], [[0, 1]])
    body = scene.add_body(net, ts.MassSpring(stiffness=OMEGA**2, node_mass=1.0))
    body.pin(ts.where.nodes([0]))
    return scene


def quarter(start, step):
    sim = ts.Simulation(oscillator(start, step))
    x = sim.positions()
    x[1, 0] += 0.1
    sim.set_state(x, 0.0 * x)
    sim.step()
    return (sim.positions()[1, 0] - 1.0) / 0.1, sim.velocities()[1, 0] / (0.1 * OMEGA), sim


@pytest.mark.parametrize(
    ("step", "plain", "half"),
    [(0.01, -0.0316899, -2.58500e-4), (0.005, -0.0157745, -6.46036e-5),
     (0.0025, -0.0078704, -1.61496e-5)],
)  # fmt: skip
def test_half_a_step_makes_positions_second_order(step, plain, half):
    assert quarter("plain", step)[0] == pytest.approx(plain, abs=1e-7)
    assert quarter("half-step", step)[0] == pytest.approx(half, abs=1e-9)


def test_velocities_are_told_at_whole_steps():
    errors = [abs(quarter("half-step", step)[1] + 1.0) for step in (0.01, 0.005)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.01)
    sim = quarter("half-step", 0.01)[2]
    energy = sim.energy()
    assert energy["kinetic"] + energy["elastic"] == pytest.approx(
        0.5 * (0.1 * OMEGA) ** 2, rel=2e-3
    )


def test_half_step_belongs_to_symplectic_euler():
    scene = oscillator("half-step", 0.01, integrator="velocity-verlet")
    with pytest.raises(SceneError, match="shifts the velocities of symplectic-euler"):
        ts.Simulation(scene)
