"""A net: internal forces K(x) come from its springs, external forces f from outside.

Internal forces are minus the gradient of the springs' energy.  They come in pairs along springs, so
they move no body as a whole: their sum and their moment are zero, whatever the shape.
"""

import numpy as np
import page

import tisoft as ts


def net() -> ts.Simulation:
    scene = ts.Scene(gravity=(0, -9.81, 0), precision="f64")
    mesh = ts.cloth(size=(1, 1), cells=(3, 3))
    scene.add_body(mesh, ts.MassSpring(stiffness=20.0, node_mass=0.05))
    return ts.Simulation(scene)


page.begin(__doc__)
sim = net()
rest, still = sim.positions(), np.zeros((16, 3))
x = rest + 0.08 * np.random.default_rng(1).standard_normal(rest.shape)
sim.set_state(x, still)
internal = sim.forces()

page.check("sum of the internal forces [N]", 0, np.linalg.norm(internal.sum(0)), within=1e-12)
moment = np.cross(x, internal).sum(axis=0)
page.check("their moment about the origin [N·m]", 0, np.linalg.norm(moment), within=1e-12)

node, step, energy = 5, 1e-6, []
for sign in (1, -1):
    moved = x.copy()
    moved[node, 0] += sign * step
    sim.set_state(moved, still)
    energy.append(sim.energy()["elastic"])
slope = -(energy[0] - energy[1]) / (2 * step)
page.check("x-force on node 5: −dV/dx by differences [N]", slope, internal[5, 0], within=1e-7)

external = sim.masses()[:, None] * sim.scene.gravity
page.check("external: weight of 16 x 50 g [N]", -0.8 * 9.81, external.sum(), within=1e-12)

(axis,) = page.axes(xlabel="x [m]", ylabel="z [m]", title="internal forces of a net")
for spring in sim.scene.bodies[0].mesh.edges:
    axis.plot(*x[spring][:, [0, 2]].T, color="lightgray")
axis.quiver(*x[:, [0, 2]].T, *internal[:, [0, 2]].T, color="C3", angles="xy", width=0.005)
axis.set_aspect("equal")
page.save(__file__, axis)
