"""O'Brien and Hodgins's discretisation: forces of a tet, and a pull test that returns E and ν.

Corner i of a tet feels f_i = −(V/2) Σ_j p_j Σ_kl β_jl β_ik σ_kl (1999, eq. 27), ε = FᵀF − I.  A
bar pulled to a stretch s then answers with E s (s² − 1)/2, and thins to √(1 − ν (s² − 1)).
"""

import numpy as np
import page

import tisoft as ts
from tisoft.equilibrium.statics import equilibrium

YOUNG, POISSON, MODEL = 1e5, 0.3, ts.ViscoElastic(1e5, 0.3, 1000.0)


def pull(stretch: float) -> tuple[float, float]:
    """Nominal stress [Pa] and width of a bar on rollers, 0.5 m wide at rest."""
    scene = ts.Scene(gravity=(0, 0, 0), duration=1.0, precision="f64")
    bar = scene.add_body(ts.box(size=(1, 0.5, 0.5), cells=(2, 1, 1)), MODEL)
    for axis, normal in zip("xyz", np.eye(3), strict=True):
        bar.pin(ts.where.plane((0, 0, 0), normal), axis)
    bar.pin(ts.where.plane((1, 0, 0), (-1, 0, 0)), "x", velocity=(stretch - 1, 0, 0))
    end = equilibrium(scene)
    return end.reactions[end.positions[:, 0] > 0.1, 0].sum() / 0.25, end.positions[:, 1].max()


page.begin(__doc__)
one, rest = ts.Scene(precision="f64"), np.vstack([np.zeros(3), np.eye(3)])
one.add_body(ts.tet_mesh(rest, [[0, 1, 2, 3]]), MODEL)
sim = ts.Simulation(one)
x = rest @ [[1.1, 0.05, 0], [0, 1, 0], [0.02, 0, 0.95]]
sim.set_state(x, 0 * x)
beta = np.linalg.inv(np.vstack([rest.T, np.ones(4)]))[:, :3]
strain = (x.T @ beta).T @ (x.T @ beta) - np.eye(3)
sigma = MODEL.lame_lambda * np.trace(strain) * np.eye(3) + 2 * MODEL.lame_mu * strain
theory = -1 / 12 * np.einsum("jx,jl,ik,kl->ix", x, beta, beta, sigma)  # V = 1/6 m³
page.check("x-force on corner 0 by equation 27 [N]", theory[0, 0], sim.forces()[0, 0], within=1e-9)
assert np.allclose(sim.forces(), theory, rtol=0, atol=1e-9), "all corners feel equation 27"
stress, width = pull(1.001)
page.check("E from a pull by 0.1 % [Pa]", YOUNG, stress / 1e-3, within=2e-3)
page.check("ν from it", POISSON, (1 - width / 0.5) / 1e-3, within=2e-3)
page.check("stress at a stretch of 1.5 [Pa]", YOUNG * 1.5 * 1.25 / 2, pull(1.5)[0], within=1e-9)
s = np.linspace(0.65, 1.5, 18)
stresses, widths = np.transpose([pull(stretch) for stretch in s])
(axis,) = page.axes(xlabel="stretch s", title="a pull test: closed forms, and tisoft (dots)")
axis.plot(s, s * (s**2 - 1) / 2, "C0", label="stress / E: s (s² − 1)/2")
axis.plot(s, np.sqrt(1 - POISSON * (s**2 - 1)), "C1", label="width: √(1 − ν (s² − 1))")
axis.plot(s, stresses / YOUNG, "C0o", s, widths / 0.5, "C1o")
axis.legend()
page.save(__file__, axis)
