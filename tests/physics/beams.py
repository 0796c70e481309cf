"""Bodies of REFERENCES and simulations of them with a substep that the test chooses."""

from pathlib import Path

import numpy as np

import tisoft as ts
from tisoft import where
from tisoft.simulation import Simulation

CLAMPED = where.box((-1e-9, -1e3, -1e3), (1e-9, 1e3, 1e3))
"""The nodes at x = 0."""

INTEGRATORS = ["symplectic-euler", "velocity-verlet", "explicit-euler"]


def beam(split="five", cells=(10, 2, 2)):
    """The cantilever of A3: 1 × 0.2 × 0.2 m."""
    return ts.box(size=(1.0, 0.2, 0.2), cells=cells, split=split)


def gmsh_beam(name):
    """The same beam from Gmsh, unstructured: "c" with 484 tets, "m" with 1509."""
    with np.load(Path(__file__).parent / "data" / f"mesh_beam_{name}.npz") as data:
        return ts.tet_mesh(data["X"], data["T"])


def rubber(kind=ts.ViscoElastic, **parameters):
    """The material of A3."""
    return kind(1e6, 0.3, 1000.0, **parameters)


def node_at(mesh, point):
    """The node of a mesh at a rest position."""
    away = np.linalg.norm(mesh.points - np.array(point), axis=1)
    assert away.min() < 1e-9
    return int(away.argmin())


def simulate(
    *bodies,
    h=1e-3,
    substeps=1,
    gravity=(0.0, 0.0, 0.0),
    pins=(),
    obstacles=(),
    certify=False,
    threads=1,
    **scene_keys,
):
    """A simulation of (mesh, model[, {velocity, spin}]) whose frames have `substeps` of `h` [s].

    `pins` are (selection, axes) of the first body.  One thread suits small bodies, and does not
    wait for another where the machine is busy.
    """
    rate = 1.0 / (substeps * h)
    keys = {"precision": "f64", "step": h, **scene_keys}
    scene = ts.Scene(gravity=gravity, frame_rate=rate, **keys)
    for mesh, model, *start in bodies:
        body = scene.add_body(mesh, model, **(start[0] if start else {}))
        body.contact = False  # they may lie in each other
    for selection, axes in pins:
        scene.bodies[0].pin(selection, axes)
    for obstacle in obstacles:
        scene.add_obstacle(obstacle)
    return Simulation(scene, certify=certify, threads=threads)


def cantilever(model, *, mesh=None, **keys):
    """The beam of A3, clamped at x = 0."""
    return simulate((beam() if mesh is None else mesh, model), pins=[(CLAMPED, "xyz")], **keys)


def displaced(sim, u, v=0.0):
    """Set displacements from rest [m] and velocities [m/s]."""
    x = np.concatenate([body.mesh.points for body in sim.scene.bodies])
    sim.set_state(x + u, np.zeros_like(x) + v)


def masses(sim):
    """Lumped masses [kg] in the order of sim.positions(), shape (nodes, 1)."""
    return np.concatenate([_mass(part) for part in sim.parts])[:, None]


def _mass(part):
    mass = np.empty_like(part.mass)
    mass[part.order] = part.mass
    return mass


def momentum(sim):
    """Linear [kg m/s] and angular momentum [kg m²/s] about the world's origin."""
    p = masses(sim) * sim.velocities()
    return p.sum(axis=0), np.cross(sim.positions(), p).sum(axis=0)


def total_energy(sim):
    """Kinetic, elastic and gravity energy together [J]."""
    energy = sim.energy()
    return energy["kinetic"] + energy["elastic"] + energy["gravity"]


def one_step_force(sim):
    """m (v' − v)/h − m g of one substep of 1 s: what elements exert on each node [N]."""
    before = sim.velocities()
    sim.stepper.advance(1, 1.0, (0.0, 0.0, 0.0))
    return masses(sim) * (sim.velocities() - before)


def rotation(axis, angle):
    """The matrix of a turn by `angle` [rad] about `axis` (Rodrigues)."""
    x, y, z = np.array(axis, float) / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def oscillator(omega, *, mass=1.0, damper=0.0, drag=0.0, **keys):
    """A point mass on a long spring along x, the other end held; x'' = −ω² x − ….

    Args: damper: c of a damper along the spring [N·s/m]; drag: point damping [1/s].
    """
    mesh = ts.net([[-10.0, 0, 0], [0.0, 0, 0]], [[0, 1]])
    model = ts.MassSpring(
        stiffness=mass * omega**2, node_mass=mass, spring_damping=damper, point_damping=drag
    )
    return simulate((mesh, model), pins=[(where.nodes([0]), "xyz")], **keys)


def pulled(sim, x, v=0.0):
    """Start an `oscillator` at x [m] with v [m/s]."""
    displaced(sim, [[0, 0, 0], [x, 0, 0]], [[0, 0, 0], [v, 0, 0]])


def place(sim):
    """Where the `oscillator` is [m]."""
    return float(sim.positions()[1, 0])
