"""Finite elements: consistent mass errs upwards in frequency, lumped mass downwards.

A rod held at one end sounds at c/4l, c = √(E/ρ).  The consistent mass matrix, M = ρV/20 (1 + δ_ab)
for a tet, is Galerkin's: its frequencies are never too low.  Lumped mass puts ρV/4 on each corner.
Both errors shrink like the square of the element's size.  A tet's heaviest and lightest mass differ
by 5, so the step of the consistent one is √5 times smaller: the price, beside solving with M.
"""

from typing import Any

import numpy as np
import page

import tisoft as ts
from tisoft.equilibrium.modes import natural_modes

LENGTH, YOUNG, DENSITY = 1.0, 1e6, 1000.0


def rod(cells: int, mass: Any) -> ts.Scene:
    """A rod along x that may move along x alone."""
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64")
    mesh = ts.box(size=(LENGTH, 0.1, 0.1), cells=(cells, 1, 1))
    body = scene.add_body(mesh, ts.Linear(YOUNG, 0.0, DENSITY, mass=mass))
    body.pin(ts.where.box((-1e-6, -1, -1), (1e-6, 1, 1)), "x")
    body.pin(ts.where.everything(), "yz")
    return scene


page.begin(__doc__)
exact = np.sqrt(YOUNG / DENSITY) / (4 * LENGTH)
counts = np.array([4, 8, 16, 32])
(axis,) = page.axes(xlabel="elements along the rod", ylabel="error of the lowest frequency [%]")
for mass, sign in (("consistent", 1), ("lumped", -1)):
    found = [natural_modes(rod(n, mass), 1).frequencies[0] for n in counts]
    error = np.array(found) / exact - 1
    page.check(f"frequency with {mass} mass, 32 cells [Hz]", exact, found[-1], within=2e-4)
    assert (sign * error > 0).all(), f"{mass} mass errs to the other side"
    order = np.log2(error[-2] / error[-1])
    page.check(f"order of its error, {mass} mass", 2, order, within=0.2)
    axis.semilogx(counts, 100 * error, "o-", label=f"{mass} mass")
steps = [ts.Simulation(rod(8, mass)).stable_step() for mass in ("lumped", "consistent")]
page.check("stable step, lumped over consistent", np.sqrt(5), steps[0] / steps[1], within=0.02)

axis.axhline(0, color="gray", lw=0.8)
axis.set_xticks(counts, counts)
axis.minorticks_off()
axis.legend()
page.save(__file__, axis)
