"""Static equilibrium: K(x) + f = 0.  A chain hangs in a catenary, y = a cosh(x/a).

Newton's method finds where all forces cancel.  The chain's links are so stiff that its length
stays; then 2 a sinh(d/2a) = its length, d the span, and its ends pull by H = (weight/length) a.
"""

import numpy as np
import page
from scipy.optimize import brentq

import tisoft as ts
from tisoft.equilibrium.statics import equilibrium

LINKS, LENGTH, SPAN, MASS = 40, 1.5, 1.0, 2.0


def chain() -> ts.Scene:
    """A V of links, held at both ends."""
    x = np.linspace(0, SPAN, LINKS + 1)
    depth = np.sqrt(LENGTH**2 - SPAN**2) / SPAN * np.minimum(x, SPAN - x)
    points = np.stack([x, -depth, 0 * x], axis=1)
    links = [[i, i + 1] for i in range(LINKS)]
    masses = [MASS / LINKS] * (LINKS + 1)
    scene = ts.Scene(precision="f64")
    body = scene.add_body(ts.net(points, links), ts.MassSpring(stiffness=1e7, node_mass=masses))
    body.pin(ts.where.nodes([0, LINKS]))
    return scene


page.begin(__doc__)
scene = chain()
found = equilibrium(scene)
a = brentq(lambda a: 2 * a * np.sinh(SPAN / (2 * a)) - LENGTH, 0.1, 10.0)
weight = MASS * 9.81
page.check("largest force out of balance [N]", 0, found.residual, within=1e-6)
sag = a * (np.cosh(SPAN / (2 * a)) - 1)
page.check("sag [m]", sag, -found.positions[:, 1].min(), within=2e-3)
page.check("pull of an end along x [N]", weight / LENGTH * a, -found.reactions[0, 0], within=3e-3)
page.check("ends carry chain [N]", weight * 41 / 40, found.reactions[:, 1].sum(), within=1e-6)

(axis,) = page.axes(xlabel="x [m]", ylabel="y [m]")
x = np.linspace(0, SPAN, 200)
axis.plot(x, a * (np.cosh((x - SPAN / 2) / a) - np.cosh(SPAN / (2 * a))), label="catenary")
axis.plot(*found.positions[:, :2].T, ".", label="tisoft, 40 links")
axis.plot(*scene.bodies[0].mesh.points[:, :2].T, "--", color="lightgray", label="before")
axis.set_aspect("equal")
axis.legend()
page.save(__file__, axis)
