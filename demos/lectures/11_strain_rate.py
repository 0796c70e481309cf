"""Viscosity of the strain rate: ν = FᵀḞ + ḞᵀF is 0 in any rotation, so it brakes no spin.

A body that swells with v = a x loses V·3a²(3φ + 2η) watts.  One that spins loses nothing to
viscosity, however large; point damping takes its angular momentum by exp(−γt).
"""

from typing import Any

import numpy as np
import page

import tisoft as ts

PHI, ETA, SPIN = 40.0, 60.0, np.array([0, 0, 4.0])  # Pa·s, Pa·s, rad/s
VISCOUS, DRAG = {"phi": PHI, "eta": ETA}, {"point_damping": 1.0}  # γ = 1/s


def brick(damping: dict[str, Any]) -> ts.Simulation:
    scene = ts.Scene(gravity=(0, 0, 0), frame_rate=50, precision="f64")
    mesh = ts.box(size=(0.4, 0.4, 0.4), cells=(2, 2, 2)).transformed(translate=(-0.2, -0.2, -0.2))
    scene.add_body(mesh, ts.ViscoElastic(1e5, 0.3, 1000.0, **damping), spin=SPIN)
    return ts.Simulation(scene)


page.begin(__doc__)
sim = brick(VISCOUS)
x = sim.positions()
c, s = np.cos(0.5), np.sin(0.5)
turned = x @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
sim.set_state(turned, np.cross(SPIN, turned))
page.check("spinning and turned: largest force [N]", 0, abs(sim.forces()).max(), within=1e-9)
sim.set_state(x, 0.5 * x)
power = -(0.4**3) * 3 * 0.25 * (3 * PHI + 2 * ETA)
page.check("swelling: power of viscosity [W]", power, (sim.forces() * 0.5 * x).sum(), within=1e-12)
swelling = [sim.energy()["kinetic"] + sim.energy()["elastic"] for _ in sim.frames(1.0)]
assert swelling[-1] < 0.01 * swelling[0], "viscosity brakes what swells"

(axis,) = page.axes(xlabel="time [s]", ylabel="share of what there was at t = 0")
t = np.linspace(0, 1, 51)
for name, damping, rate in (("viscosity", VISCOUS, 0.0), ("point damping", DRAG, 1.0)):
    sim = brick(damping)
    momentum = [sim.measures.angular_momentum()[2] for _ in sim.frames(1.0)]
    share = np.array(momentum) / momentum[0]
    page.check(f"angular momentum left, {name}", np.exp(-rate), share[-1], within=5e-3)
    axis.plot(t, share, ".", label=f"angular momentum, {name}")
    axis.plot(t, np.exp(-rate * t), "k-", lw=0.8)
axis.plot(t, np.array(swelling) / swelling[0], label="energy of a swelling brick, viscosity")
axis.legend(loc="center right", bbox_to_anchor=(1.0, 0.78))
page.save(__file__, axis)
