"""Explicit integration: Δv = h a, then Δx = h (v + Δv), or with the old v, which fails.

The error of a method of order p shrinks like h^p.  Explicit Euler (Δx = h v) multiplies the swing
by √(1 + h²ω²) each step, however small h is; symplectic Euler stays bounded while h ω < 2.
"""

import numpy as np
import page

import tisoft as ts

OMEGA = 2 * np.pi  # [rad/s]: a period of 1 s


def swing(integrator: str, h: float, steps: int) -> np.ndarray:
    """Where a mass on a spring is after each step, from x = 1 at rest."""
    scene = ts.Scene(gravity=(0, 0, 0), frame_rate=1 / h, step=h, integrator=integrator)
    scene.precision = "f64"
    net = ts.net([[-9, 0, 0], [0, 0, 0]], springs=[[0, 1]])
    body = scene.add_body(net, ts.MassSpring(stiffness=OMEGA**2, node_mass=1.0))
    body.pin(ts.where.nodes([0]))
    sim = ts.Simulation(scene, certify=False)  # takes any step, to show what fails
    sim.set_state([[-9, 0, 0], [1, 0, 0]], np.zeros((2, 3)))
    return np.array([frame.positions()[1, 0] for frame in sim.frames(steps * h)])


page.begin(__doc__)
left, middle, right = page.axes(3, xlabel="step h [s]", ylabel="error at 1.1 s [m]", title="order")
steps = np.array([88, 176, 352])
for integrator, order in (("explicit-euler", 1), ("symplectic-euler", 1), ("velocity-verlet", 2)):
    ends = np.array([swing(integrator, 1.1 / n, n)[-1] for n in steps])
    errors = np.abs(ends - np.cos(1.1 * OMEGA))
    page.check(f"order of {integrator}", order, np.log2(errors[1] / errors[2]), within=0.1)
    left.loglog(1.1 / steps, errors, "o-", label=integrator)
left.legend()

h, n = 0.02, 150
for integrator in ("explicit-euler", "symplectic-euler"):
    middle.plot(h * np.arange(n + 1), swing(integrator, h, n), label=integrator)
growth, grown = (1 + (h * OMEGA) ** 2) ** (n / 2), swing("explicit-euler", h, n)[-1]
page.check("explicit Euler, swing after 3 periods [m]", growth, grown, within=0.01)
middle.set(xlabel="time [s]", title=f"h = {h} s")
for share, color in ((0.99, "C1"), (1.01, "C3")):
    path = swing("symplectic-euler", share * 2 / OMEGA, 60)
    right.plot(path, color, label=f"h = {share} · 2/ω")
    stays = float(abs(path).max() < 50)
    page.check(f"stays bounded at {share} · 2/ω (1: yes)", share < 1, stays, within=0)
right.set(xlabel="step", title="symplectic Euler at its limit", ylim=(-60, 60))
right.legend()
page.save(__file__, left)
