"""The same input gives the same bits; scaled, turned, mirrored, moved ones the matching answer."""

import numpy as np
import pytest
from beams import CLAMPED, beam, cantilever, displaced, rotation, rubber, simulate

import tisoft as ts
from tisoft import where

G = (0.0, 0.0, -9.81)
SOLIDS = [ts.Linear, ts.MassTensor, ts.ViscoElastic, ts.NeoHookean]


def _springs(mesh=None, **keys):
    return beam() if mesh is None else mesh, ts.MassSpring(young=1e6, density=1000.0, **keys)


def _solid(kind, **keys):
    return beam(), rubber(kind, **keys)


SCENES = {
    "viscoelastic": [_solid(ts.ViscoElastic, phi=50.0, eta=50.0)],
    "mass-tensor": [_solid(ts.MassTensor, phi=50.0, eta=50.0)],
    "mass-spring": [_springs(spring_damping=1.0)],
    "consistent": [_solid(ts.Linear, mass="consistent")],
    "all": [
        *(_solid(kind, phi=50.0, eta=50.0) for kind in SOLIDS),
        _springs(spring_damping=1.0),
    ],
}


BALL = ts.Sphere(center=(0.5, 0.1, -30.02), radius=30.0, friction=0.3)
"""Nodes alone meet one so large; faces are for tests/touch."""
ON_A_BALL = ("viscoelastic", "mass-spring")


def _bits(bodies, *, precision, threads, substeps=150, h=5e-4, obstacles=(), **keys):
    """Positions and velocities after a twisting fall, as bytes."""
    sim = simulate(
        *bodies, h=h, substeps=substeps, gravity=G, precision=precision, threads=threads,
        obstacles=obstacles, **keys,
    )  # fmt: skip
    x = sim.positions()
    sim.set_state(x, np.sin(7 * x[:, [1, 2, 0]]))
    sim.step()
    assert np.isfinite(sim.positions()).all()
    return sim.positions().tobytes() + sim.velocities().tobytes()


CASES = [("all", "f64"), ("viscoelastic", "f32"), ("mass-spring", "f32"), ("consistent", "f64")]


@pytest.mark.parametrize(
    ("name", "precision"),
    [pytest.param(*case, marks=[pytest.mark.slow] if case[0] == "all" else []) for case in CASES],
)
def test_same_bits_from_run_to_run_and_for_any_threads(name, precision):
    obstacles = [BALL] if name in ON_A_BALL else []
    keys = {"precision": precision, "obstacles": obstacles}
    runs = [_bits(SCENES[name], threads=n, **keys) for n in (1, 2, 1, None)]
    assert len(set(runs)) == 1


def test_same_bits_however_often_threads_are_tried():
    """Velocity Verlet with damping: its kicks must not see where a launch ends."""
    bodies = [_solid(ts.ViscoElastic, phi=50.0, eta=50.0)]
    keys = {"precision": "f64", "integrator": "velocity-verlet", "substeps": 400, "h": 2e-4}
    runs = [_bits(bodies, threads=n, **keys) for n in (1, 2, None, None)]
    assert len(set(runs)) == 1


def test_frames_of_many_launches_have_the_bits_of_single_substeps():
    """For symplectic Euler a frame's length is only a matter of when one looks."""
    long, short = (cantilever(rubber(), h=1e-3, substeps=n, gravity=G) for n in (100, 1))
    long.step()
    for _ in range(100):
        short.step()
    assert long.positions().tobytes() == short.positions().tobytes()


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_a_body_among_others_is_the_body_alone(precision):
    others = [*SCENES["viscoelastic"], *SCENES["mass-spring"], *SCENES["mass-tensor"]]
    keys = {"h": 5e-4, "substeps": 150, "gravity": G, "precision": precision}
    together = simulate(*others, **keys)
    together.step()
    for k, one in enumerate(others):
        alone = simulate(one, **keys)
        alone.step()
        body = together.scene.bodies[k]
        assert together.positions(body).tobytes() == alone.positions().tobytes()


# -- scaled, turned, mirrored, shuffled --------------------------------------------------------


def _bend(mesh, model, *, gravity, pin=None, seconds=0.15, h=5e-4, speed=None, **keys):
    """Positions of a clamped body after `seconds` under gravity."""
    clamp = CLAMPED if pin is None else pin
    sim = simulate(
        (mesh, model), h=h, substeps=round(seconds / h), gravity=tuple(gravity),
        pins=[(clamp, "xyz")], **keys,
    )  # fmt: skip
    if speed is not None:
        displaced(sim, 0.0, speed)
    sim.step()
    return sim.positions()


CLAMPED_NODES = where.nodes(np.flatnonzero(beam().points[:, 0] == 0).tolist())
MODELS = [*SOLIDS, ts.MassSpring]


def _model(kind, *, young=1e6, density=1000.0, damping=50.0):
    if kind is ts.MassSpring:
        return ts.MassSpring(young=young, density=density, spring_damping=0.1 * damping)
    return kind(young, 0.3, density, phi=damping, eta=damping)


@pytest.mark.parametrize("kind", MODELS)
@pytest.mark.parametrize("size", [1000.0, 1e-3])
def test_scaled_body_moves_alike(kind, size):
    """Lengths by s, times alike: E by s², viscosity by s² (dampers of springs by s³), g by s."""
    mesh = beam()
    spring = kind is ts.MassSpring
    small = _bend(mesh, _model(kind), gravity=G)
    model = _model(kind, young=1e6 * size**2, damping=50.0 * size ** (3 if spring else 2))
    places = where.nodes(list(CLAMPED_NODES.ids))
    large = _bend(mesh.transformed(scale=size), model, gravity=size * np.array(G), pin=places)
    assert np.abs(large / size - small).max() < 1e-10


OBJECTIVE = [ts.ViscoElastic, ts.NeoHookean, ts.MassSpring]


@pytest.mark.parametrize("kind", MODELS)
def test_turned_body_moves_alike(kind):
    """Turned at rest, with its gravity: so the linear models match too."""
    mesh = beam()
    R = rotation((3, -1, 2), 1.9)
    turned = ts.TetMesh(mesh.points @ R.T, mesh.tets, mesh.kept_nodes)
    plain = _bend(mesh, _model(kind), gravity=G)
    other = _bend(turned, _model(kind), gravity=R @ G, pin=CLAMPED_NODES)
    assert np.abs(other - plain @ R.T).max() < 1e-10


@pytest.mark.parametrize("kind", MODELS)
def test_mirrored_body_moves_alike(kind):
    mesh = beam("six")
    mirror = np.array([1.0, 1.0, -1.0])
    flipped = ts.tet_mesh(mesh.points * mirror, mesh.tets)
    assert flipped.flipped == len(mesh.tets)
    plain = _bend(mesh, _model(kind), gravity=(0, 3.0, -9.0))
    other = _bend(flipped, _model(kind), gravity=(0, 3.0, 9.0))
    assert np.abs(other - plain * mirror).max() < 1e-10


@pytest.mark.parametrize("kind", MODELS)
def test_shuffled_numbering_moves_alike(kind):
    """Nodes, tets and corners in another order; the answer comes in the file's own order."""
    mesh = beam()
    random = np.random.default_rng(8)
    order = random.permutation(len(mesh.points))
    number = np.argsort(order)
    tets = number[mesh.tets[random.permutation(len(mesh.tets))]]
    tets = tets[:, [1, 2, 0, 3]]  # an even permutation
    shuffled = ts.tet_mesh(mesh.points[order], tets)
    plain = _bend(mesh, _model(kind), gravity=G)
    other = _bend(shuffled, _model(kind), gravity=G)
    assert np.abs(other - plain[order]).max() < 1e-10


# -- far away ----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [ts.ViscoElastic, ts.MassSpring])
def test_body_at_ten_kilometres_bends_as_at_home_in_f32(kind):
    """1/1024 steps of space hold both meshes exactly: displacements agree to the last bit."""
    points = np.round(beam().points * 1024) / 1024
    clamp = where.nodes(np.flatnonzero(points[:, 0] == 0).tolist())
    answers = []
    for way in (0.0, 10240.0):
        mesh = ts.tet_mesh(points + np.array([way, -way, way]), beam().tets)
        x = _bend(mesh, _model(kind), gravity=G, pin=clamp, precision="f32")
        answers.append(x - mesh.points)
    assert np.abs(answers[0]).max() > 0.05
    assert np.abs(answers[1] - answers[0]).max() < 1e-11  # of f64 world positions at 10 km


@pytest.mark.parametrize("kind", [ts.ViscoElastic, ts.MassSpring])
def test_body_jiggles_in_f32_while_it_falls_a_hundred_metres(kind):
    """The origin follows: after 4.5 s the shape differs from the f64 run's by rounding alone."""
    mesh = beam()
    shapes = []
    for precision in ("f32", "f64"):
        sim = simulate(
            (mesh, _model(kind, damping=0.0)), h=5e-4, substeps=50, gravity=G, precision=precision
        )
        kick = np.zeros_like(mesh.points)
        kick[:, 2] = 0.3 * np.cos(2 * np.pi * mesh.points[:, 0])
        displaced(sim, 0.0, kick)
        for _ in range(180):
            sim.step()
        x = sim.positions()
        assert x[:, 2].mean() < -99.0
        shapes.append(x - x.mean(axis=0))
    assert np.abs(shapes[1] - (mesh.points - mesh.points.mean(axis=0))).max() > 1e-3
    assert np.abs(shapes[0] - shapes[1]).max() < 2e-4
