"""Linear against nonlinear: what linear strain makes of a rotation.

A turn by θ strains nothing, and Green's strain (FᵀF − I)/2 is 0.  Linear strain, (H + Hᵀ)/2, takes
it for a squeeze of cos θ − 1 across the axis: energy (1 − cos θ)² (2λ + 2μ) V.  Left alone, all of
a spinning linear bar goes straight on at the speed it started with: it grows by √(1 + ω²t²).
"""

import numpy as np
import page

import tisoft as ts

YOUNG, POISSON, OMEGA = 1e5, 0.3, 2.0  # Pa, 1, rad/s


def bar(model: type) -> ts.Simulation:
    scene = ts.Scene(gravity=(0, 0, 0), frame_rate=36 / np.pi * OMEGA, precision="f64")
    mesh = ts.box(size=(1, 0.2, 0.2), cells=(5, 1, 1)).transformed(translate=(-0.5, -0.1, -0.1))
    scene.add_body(mesh, model(YOUNG, POISSON, 1000.0), spin=(0, 0, OMEGA))
    return ts.Simulation(scene)


page.begin(__doc__)
lam, mu = ts.Linear(YOUNG, POISSON, 1000.0).lame_lambda, ts.Linear(YOUNG, POISSON, 1000.0).lame_mu
diagrams = page.axes(2)
for axis, model in zip(diagrams, (ts.Linear, ts.ViscoElastic), strict=True):
    name, is_linear = model.__name__, model is ts.Linear
    sim = bar(model)
    rest = sim.positions()
    turned = np.stack([-rest[:, 1], rest[:, 0], rest[:, 2]], axis=1)
    sim.set_state(turned, 0 * rest)
    energy = (2 * lam + 2 * mu) * 0.04 if is_linear else 0
    page.check(f"{name}: energy of a turn by 90° [J]", energy, sim.energy()["elastic"], within=1e-9)
    sim = bar(model)
    for k, frame in enumerate(sim.frames(np.pi / 2 / OMEGA)):
        if k % 6 == 0:
            faces = frame.positions()[sim.scene.bodies[0].mesh.surface][:, :, :2]
            axis.plot(*faces.transpose(2, 1, 0), color=f"C{k // 6}", lw=0.6)
    axis.set(title=f"{name}: 0 to 90°", aspect="equal", xlim=(-1, 1), ylim=(-1, 1))
    ends = sim.positions()[[0, 5]]  # two corners of one long edge, 1 m apart at rest
    length = np.linalg.norm(ends[1] - ends[0])
    grown = np.sqrt(1 + np.pi**2 / 4) if is_linear else 1.0
    page.check(f"{name}: length after 90° [m]", grown, length, within=1e-6 if is_linear else 7e-3)
diagrams[0].set(xlabel="x [m]", ylabel="y [m]")
page.save(__file__, diagrams[0])
