"""What viscosity takes is summed in elements of every kind (`step.heat`)."""

from itertools import pairwise

import pytest

import tisoft as ts
from tisoft.geometry.solid import quadratic

PULLED = ts.where.box((-1e-6, -1, -1), (1e-6, 1, 1))


def swinging(kind):
    """A beam that sags from rest, and its model."""
    beam = ts.box(size=(0.4, 0.1, 0.1), cells=(4, 1, 1), split="hex" if kind == "hex8" else "six")
    if kind == "tet10":
        beam = quadratic(ts.tet_mesh(beam.points, beam.tets))
    if kind == "spring":
        net = ts.grid(size=(0.4, 0.1, 0.1), cells=(4, 1, 1))
        return net, ts.MassSpring(stiffness=2000.0, node_mass=0.05, spring_damping=5.0)
    soft = {"young": 1e5, "poisson": 0.3, "density": 1000.0, "phi": 30.0, "eta": 30.0}
    return beam, (ts.MassTensor if kind == "tensor" else ts.ViscoElastic)(**soft)


@pytest.mark.parametrize("integrator", ["symplectic-euler", "velocity-verlet"])
@pytest.mark.parametrize("kind", ["tet4", "hex8", "tet10", "tensor", "spring"])
def test_what_viscosity_takes_closes_the_account(kind, integrator):
    """Nothing else takes any: what is missing of T + V is heat, at every frame."""
    mesh, model = swinging(kind)
    scene = ts.Scene(frame_rate=20.0, integrator=integrator, precision="f64")
    body = scene.add_body(mesh, model)
    body.pin(PULLED)
    scene.step = 0.02 * ts.Simulation(scene).stable_step()
    sim = ts.Simulation(scene, ledger=True)
    told = [sim.energy() for _ in sim.frames(0.3)]
    heat = [each["dissipated"] for each in told]
    assert all(a < b for a, b in pairwise(heat))
    most = 5e-5 if integrator == "velocity-verlet" else 5e-2  # their swing at this step
    worst = max(abs(each["error"]) for each in told) / heat[-1]
    assert worst < most
