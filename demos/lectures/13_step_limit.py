"""The time step against stiffness, size, density and viscosity.

The stiffest mode ω sets the step: h = √(τ² + 4/ω²) − τ, with viscosity φ = τλ, η = τμ.  Without
any, h = 2/ω ∝ size √(ρ/E): 16 times the stiffness, or a quarter of the size, quarters the step.
"""

import numpy as np
import page

import tisoft as ts

YOUNG, DENSITY, LAMBDA, MU = 1e5, 1000.0, 1e5 * 0.3 / (1.3 * 0.4), 1e5 / 2.6


def cube(young: float = 1, density: float = 1, size: float = 1, tau: float = 0) -> ts.Simulation:
    """A cube whose numbers are multiplied by these factors; τ [s]."""
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64")
    mesh = ts.box(size=[0.4 * size] * 3, cells=(2, 2, 2))
    phi, eta = tau * LAMBDA, tau * MU
    scene.add_body(mesh, ts.ViscoElastic(YOUNG * young, 0.3, DENSITY * density, phi=phi, eta=eta))
    return ts.Simulation(scene)


page.begin(__doc__)
own = cube().stable_step()
left, right = page.axes(2, xlabel="factor", ylabel="stable step [ms]")
factors = np.array([1 / 16, 1 / 4, 1, 4, 16])
for name, key, power in (
    ("stiffness E", "young", -0.5),
    ("density ρ", "density", 0.5),
    ("size", "size", 1),
):
    steps = np.array([cube(**{key: factor}).stable_step() for factor in factors])
    slope = np.polyfit(np.log(factors), np.log(steps), 1)[0]
    page.check(f"power of the step in {name}", power, slope, within=0.01)
    left.loglog(factors, 1e3 * steps, "o-", label=name)
left.legend(loc="lower center")

taus = own * np.array([0, 0.1, 0.3, 1, 3, 10])
steps = np.array([cube(tau=tau).stable_step() for tau in taus])
theory = np.sqrt(taus**2 + own**2) - taus
for k in (2, 5):
    page.check(f"step with τ = {taus[k]:.2g} s [s]", theory[k], steps[k], within=0.03)
fine = np.linspace(0, taus[-1], 100)
right.plot(1e3 * fine, 1e3 * (np.sqrt(fine**2 + own**2) - fine), label="√(τ² + 4/ω²) − τ")
right.plot(1e3 * taus, 1e3 * steps, "o", label="tisoft")
right.set(xlabel="τ of the viscosity [ms]", ylabel="stable step [ms]")
right.legend()
page.save(__file__, left)
