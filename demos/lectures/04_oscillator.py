"""Dynamics: m x'' + c x' + k x = 0, and two kinds of damping.

A damper along the spring (c) and point damping (a = f/m − γ v) brake this one mass alike where
c = γ m.  They differ in free flight: point damping brakes it, dampers do not see it.
"""

import numpy as np
import page

import tisoft as ts

MASS, STIFFNESS, RATE = 0.2, 50.0, 4.0  # kg, N/m, γ [1/s]
OMEGA = np.sqrt(STIFFNESS / MASS)


def swing(held: bool = True, **damping: float) -> np.ndarray:
    """Where the mass is, each hundredth of a second of one second."""
    scene = ts.Scene(gravity=(0, 0, 0), frame_rate=100, step=1e-4, precision="f64")
    net = ts.net([[-1, 0, 0], [0, 0, 0]], springs=[[0, 1]])
    model = ts.MassSpring(stiffness=STIFFNESS, node_mass=MASS, **damping)
    body = scene.add_body(net, model, velocity=(0 if held else 1, 0, 0))
    if held:
        body.pin(ts.where.nodes([0]))
    sim = ts.Simulation(scene)
    if held:
        sim.set_state([[-1, 0, 0], [0.1, 0, 0]], np.zeros((2, 3)))
    return np.array([frame.positions()[1, 0] for frame in sim.frames(1.0)])


page.begin(__doc__)
free, spring, point = swing(), swing(spring_damping=RATE * MASS), swing(point_damping=RATE)
t, decay = np.linspace(0, 1, 101), RATE / 2
slower = np.sqrt(OMEGA**2 - decay**2)
damped = 0.1 * np.exp(-decay * t) * (np.cos(slower * t) + decay / slower * np.sin(slower * t))
k = np.flatnonzero(np.diff(np.sign(free)))[[0, 2]]  # the first and the third time through 0
period = np.diff(t[k] + 0.01 * free[k] / (free[k] - free[k + 1]))[0]
page.check("period 2π √(m/k) [s]", 2 * np.pi / OMEGA, period, within=1e-3)
page.check("damper: largest error [m]", 0, abs(spring - damped).max(), within=2e-4)
page.check("point damping: largest error [m]", 0, abs(point - damped).max(), within=2e-4)
flight = swing(held=False, spring_damping=RATE * MASS), swing(held=False, point_damping=RATE)
page.check("free flight in 1 s with a damper [m]", 1, flight[0][-1], within=1e-9)
slow = (1 - np.exp(-RATE)) / RATE
page.check("free flight in 1 s, point damping [m]", slow, flight[1][-1], within=1e-3)

(axis,) = page.axes(xlabel="time [s]", ylabel="x of the mass [m]", ylim=(-0.15, 0.11))
axis.plot(t, 0.1 * np.cos(OMEGA * t), label="closed form, free")
axis.plot(t, damped, label="closed form, damped")
axis.plot(t, free, "C0.", t, spring, "C1.", t, point, "k+", ms=4)
axis.legend(loc="lower right", ncols=2)
page.save(__file__, axis)
