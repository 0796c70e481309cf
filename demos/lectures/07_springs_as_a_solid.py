"""Springs for a continuum: k = E Σ V/l² makes one solid, and seldom the one that was asked for.

Springs resist swelling as a solid of modulus E and ν = 1/4 does: exactly.  Along an axis it counts
which way the edges run.  For cells of five tets the sum over edges C = E Σ V n⊗n⊗n⊗n / Σ V has
C₁₁ = 4E/3 and C₁₂ = E/3: E₁ = 1.2 E and ν₁ = 1/5.  Finer nets come closer to that solid.
"""

import numpy as np
import page

import tisoft as ts
from tisoft.equilibrium.statics import equilibrium
from tisoft.where import plane

YOUNG, SPRINGS = 1e6, ts.MassSpring(young=1e6, density=1000.0)


def pulled(n: int) -> tuple[float, float]:
    """E [Pa] and ν of a cube of springs on rollers, pulled by 0.1 %."""
    scene = ts.Scene(gravity=(0, 0, 0), duration=1.0, precision="f64")
    cube = scene.add_body(ts.box((1, 1, 1), (n, n, n)), SPRINGS)
    for axis, normal in zip("xyz", np.eye(3), strict=True):
        cube.pin(plane((0, 0, 0), normal), axis)
    cube.pin(plane((1, 0, 0), (-1, 0, 0)), "x", velocity=(1e-3, 0, 0))
    found = equilibrium(scene)
    sides = found.positions[cube.nodes(plane((0, 1, 0), (0, -1, 0))), 1]
    return found.reactions[:, 0].clip(0).sum() / 1e-3, (1 - sides.mean()) / 1e-3


page.begin(__doc__)
scene = ts.Scene(gravity=(0, 0, 0), precision="f64")
cube = scene.add_body(ts.box((1, 1, 1), (4, 4, 4)), SPRINGS)
sim = ts.Simulation(scene)
sim.set_state(1.01 * cube.mesh.points, 0 * cube.mesh.points)
swelled = 3 * YOUNG * 0.01**2  # 9/2 K s² with K = 2E/3, a third of E/(1 − 2/4)
page.check("energy of swelling by s = 1 % [J]", swelled, sim.energy()["elastic"], within=1e-9)
counts = [2, 4, 6, 8]
young, poisson = np.transpose([pulled(n) for n in counts])
page.check("pulled along x, 8 cells: E₁ [Pa]", 1.2 * YOUNG, young[-1], within=0.01)
page.check("the cube thins: ν₁", 0.2, poisson[-1], within=0.06)

(axis,) = page.axes(xlabel="cells along an edge of the cube", ylabel="E₁ / E, and ν₁")
axis.plot(counts, young / YOUNG, "C0o-", label="E₁ / E, springs")
axis.plot(counts, poisson, "C1o-", label="ν₁, springs")
for value, style in ((1.2, "C0--"), (0.2, "C1--"), (1.0, "k:"), (0.25, "k:")):
    axis.plot(counts, 4 * [value], style, lw=1)
axis.text(2, 0.96, "asked for: E and ν = 1/4", va="top")
axis.set_ylim(0, 1.3)
axis.legend(loc="center")
page.save(__file__, axis)
