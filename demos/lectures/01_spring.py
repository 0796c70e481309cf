"""A spring and its rest length: the force f = k (L − l) acts along the spring.

A spring of length L and rest length l pulls its ends together where L > l, and pushes them apart
where L < l.  The force is minus the slope of the energy V = k (L − l)²/2.
"""

import numpy as np
import page

import tisoft as ts

STIFFNESS, REST = 50.0, 0.8  # k [N/m], l [m]
DIRECTION = np.array([2.0, 1.0, 2.0]) / 3.0


def one_spring() -> ts.Simulation:
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64")
    net = ts.net([[0, 0, 0], [1, 0, 0]], springs=[[0, 1]])
    model = ts.MassSpring(springs=[[0, 1, STIFFNESS, REST]], node_mass=1.0)
    scene.add_body(net, model)
    return ts.Simulation(scene)


page.begin(__doc__)
sim = one_spring()
lengths = np.linspace(0.2, 1.6, 15)
pull, energy = [], []
for length in lengths:
    sim.set_state([[0, 0, 0], length * DIRECTION], np.zeros((2, 3)))
    force = sim.forces()
    assert np.allclose(force[0], -force[1], atol=1e-12), "action and reaction are equal"
    pull.append(force[0] @ DIRECTION)
    energy.append(sim.energy()["elastic"])
page.check("force where L = l [N]", 0.0, np.interp(REST, lengths, pull), within=1e-12)
page.check("force at L = 1.6 m [N]", STIFFNESS * 0.8, pull[-1], within=1e-12)
page.check("energy at L = 0.2 m [J]", STIFFNESS * 0.6**2 / 2, energy[0], within=1e-12)
page.check("slope of the force, k [N/m]", STIFFNESS, np.ptp(pull) / 1.4, within=1e-12)

(axis,) = page.axes(xlabel="length L [m]", ylabel="pull [N]")
axis.plot(lengths, STIFFNESS * (lengths - REST), label="k (L − l)")
axis.plot(lengths, pull, "o", label="tisoft")
axis.axvline(REST, color="gray", lw=0.8, label="rest length")
axis.legend()
page.save(__file__, axis)
