"""S1 to S7 and A10: springs, dampers, pendulums, chains, and networks that stand for a material."""

import numpy as np
import pytest
from beams import displaced, momentum, oscillator, place, pulled, rotation, simulate
from fem import mode_of_motion

import tisoft as ts
from tisoft import where

G = 9.81


def _at_rest(sim, *, frames=4):
    """Run to rest; returns positions after checking that nothing moves any more."""
    for _ in range(frames):
        sim.step()
    before = sim.positions()
    sim.step()
    size = np.ptp(before, axis=0).max()
    assert np.abs(sim.positions() - before).max() < 1e-9 * size
    return sim.positions()


# -- S1, S2: one and two masses ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("h", "x"), [(0.01, -0.035806885), (5e-3, -0.036460153), (2.5e-3, -0.036686788),
                 (1.25e-3, -0.036779622)]
)  # fmt: skip
def test_damped_oscillator_step_by_step(h, x):
    """S1: m = .2, k = 50, drag .4 kg/s (2 1/s of the mass), x(0) = .1."""
    sim = oscillator(np.sqrt(250.0), mass=0.2, drag=2.0, h=h, substeps=round(1 / h))
    pulled(sim, 0.1)
    sim.step()
    assert place(sim) == pytest.approx(x, abs=6e-10)


def test_damped_oscillator():
    sim = oscillator(
        np.sqrt(250.0), mass=0.2, drag=2.0, h=1e-4, substeps=1000, integrator="velocity-verlet"
    )
    pulled(sim, 0.1)
    x = [0.1]
    for _ in range(20):
        sim.step()
        x.append(place(sim))
    exact = [0.005084625, 0.001665172, -0.036860415, 0.013517031]
    assert [x[1], x[5], x[10], x[20]] == pytest.approx(exact, abs=2e-7)


def _pair(**keys):
    """S2: masses .1 and .3 on a spring k = 30 with a damper c = .5 along it."""
    mesh = ts.net([[0, 0, 0], [1, 0, 0]], [[0, 1]])
    model = ts.MassSpring(stiffness=30.0, node_mass=[0.1, 0.3], spring_damping=0.5)
    return simulate((mesh, model), **keys)


def test_damper_along_a_spring():
    h = 1e-3
    sim = _pair(h=h)
    displaced(sim, [[-0.05, 0, 0], [0.05, 0, 0]])
    gap = []
    for _ in range(50):
        sim.step()
        gap.append(np.diff(sim.positions()[:, 0])[0] - 1.0)
    omega, zeta = mode_of_motion(gap, h)
    assert omega == pytest.approx(20.0, rel=1e-8)
    assert zeta == pytest.approx(1 / 6, rel=1e-8)


def test_damper_along_a_spring_leaves_rotation_alone():
    sim = _pair(h=1e-3, substeps=2000)
    v = np.cross([0, 0, 3.0], [[-0.75, 0, 0], [0.25, 0, 0]])
    displaced(sim, 0.0, v)
    turning = momentum(sim)[1]
    energies = []
    for _ in range(10):
        sim.step()
        energies.append(sim.energy()["kinetic"] + sim.energy()["elastic"])
        assert momentum(sim)[1] == pytest.approx(turning, rel=1e-11, abs=1e-14)
    # The pair stretches once, to k (r − 1) = μ ω² r, and then turns for ever.
    assert energies[-1] == pytest.approx(energies[0], rel=1e-5)
    assert energies[-1] > 0.2


# -- S3: the chain of ten ----------------------------------------------------------------------


def _chain(**damping):
    """S3: ten masses of .01 kg on springs of 100 N/m, hanging from node 0; 1 m apart."""
    points = [[0, -float(i), 0] for i in range(11)]
    mesh = ts.net(points, [[i, i + 1] for i in range(10)])
    return mesh, ts.MassSpring(stiffness=100.0, node_mass=0.01, **damping)


HELD_END = [(where.nodes([0]), "xyz")]
FREQUENCIES = [2.3787328, 7.0830613, 11.6291660]


def _mode(n):
    """Shape of mode n (from 1) of the chain with one end held."""
    return np.sin((2 * n - 1) * np.pi * np.arange(11) / 21)


def _swing(n, *, h=1e-3, substeps=12, **damping):
    """ω [rad/s] and ζ of mode n of the chain from a few substeps of its motion."""
    sim = simulate(_chain(**damping), h=h, pins=HELD_END)
    displaced(sim, 1e-3 * _mode(n)[:, None] * [0, 1, 0])
    q = []
    for _ in range(substeps):
        sim.step()
        q.append(_mode(n) @ (sim.positions()[:, 1] + np.arange(11)))
    return mode_of_motion(q, h)


@pytest.mark.parametrize(("n", "frequency"), [*zip((1, 2, 3), FREQUENCIES, strict=True),
                                              (10, 31.4754628)])  # fmt: skip
def test_frequencies_of_the_chain(n, frequency):
    omega, zeta = _swing(n)
    assert omega / (2 * np.pi) == pytest.approx(frequency, abs=6e-8)
    assert zeta == pytest.approx(0.0, abs=1e-7)


@pytest.mark.parametrize(
    ("damping", "ratios"),
    [
        ({"spring_damping": 0.05}, [0.0037365, 0.0111260, 0.0182671]),
        ({"point_damping": 1.0}, [0.0334537, 0.0112349, 0.0068429]),  # drag .01 kg/s on .01 kg
    ],
)
def test_damping_of_the_chain(damping, ratios):
    found = [_swing(n, **damping)[1] for n in (1, 2, 3)]
    assert found == pytest.approx(ratios, abs=6e-8)


def test_hanging_chain():
    sim = simulate(
        _chain(point_damping=25.0), h=5e-3, substeps=600, gravity=(0, -G, 0), pins=HELD_END
    )
    stretch = -np.diff(_at_rest(sim)[:, 1]) - 1.0
    assert stretch.sum() == pytest.approx(0.053955, rel=1e-9)
    assert stretch == pytest.approx(0.000981 * np.arange(10, 0, -1), rel=1e-8)


# -- S4, S5, S7: shapes at rest ----------------------------------------------------------------


def test_depth_of_a_loaded_v():
    """S4: from flat, where the springs have no stiffness across."""
    mesh = ts.net([[-1, 0, 0], [0, 0, 0], [1, 0, 0]], [[0, 1], [1, 2]])
    model = ts.MassSpring(stiffness=200.0, node_mass=2.0, point_damping=12.0)
    sim = simulate(
        (mesh, model), h=5e-3, substeps=400, gravity=(0, -G, 0), pins=[(where.nodes([0, 2]), "xyz")]
    )
    assert _at_rest(sim)[1, 1] == pytest.approx(-0.4865936028, abs=1e-10)


def _truss(load):
    """S5: half-span 1, rise .3, k = 1000 each; the weight of its 1 kg apex is the load [N]."""
    mesh = ts.net([[-1, 0, 0], [0, 0.3, 0], [1, 0, 0]], [[0, 1], [1, 2]])
    model = ts.MassSpring(stiffness=1000.0, node_mass=1.0, point_damping=15.0)
    pins = [(where.nodes([0, 2]), "xyz"), (where.nodes([1]), "xz")]
    return simulate((mesh, model), h=5e-3, substeps=1000, gravity=(0, -load, 0), pins=pins)


LIMIT_LOAD = 9.9499170


def test_von_mises_truss_below_and_above_its_limit_load():
    assert _at_rest(_truss(0.5 * LIMIT_LOAD))[1, 1] == pytest.approx(0.2641108, abs=6e-8)
    assert _at_rest(_truss(0.98 * LIMIT_LOAD))[1, 1] > 0.1707116
    assert _at_rest(_truss(1.02 * LIMIT_LOAD))[1, 1] < -0.3489393
    snapped = _truss(LIMIT_LOAD)
    displaced(snapped, [[0, 0, 0], [0, -0.4, 0], [0, 0, 0]])
    assert _at_rest(snapped)[1, 1] == pytest.approx(-0.3489393, abs=6e-8)


@pytest.mark.parametrize(
    ("links", "axial", "sag"),
    [(10, 1e3, 0.2701219), (20, 1e3, 0.2690408), (40, 1e3, 0.2687731)],
)
def test_sag_of_a_catenary(links, axial, sag):
    """S7: arc 1 m over a span of .8 m, 1 kg in all on the free nodes' 1/N each."""
    _check_catenary(links, axial, sag, h=5e-4, time=6.0)


@pytest.mark.parametrize(
    ("links", "axial", "sag"),
    [(10, 1e5, 0.2668974), (20, 1e5, 0.2658244), (40, 1e5, 0.2655587)],
)
def test_sag_of_a_stiff_catenary(links, axial, sag):
    _check_catenary(links, axial, sag, h=2e-5, time=8.0)


def _check_catenary(links, axial, sag, *, h, time):
    s = np.linspace(0, 1, links + 1)
    points = np.stack([0.8 * s - 0.4, -0.3 * np.sin(np.pi * s), 0 * s], axis=1)
    rows = [[i, i + 1, links * axial, 1.0 / links] for i in range(links)]
    model = ts.MassSpring(springs=rows, node_mass=1.0 / links, point_damping=12.0)
    ends = [(where.nodes([0, links]), "xyz")]
    mesh = ts.net(points, [row[:2] for row in rows])
    sim = simulate((mesh, model), h=h, substeps=round(time / 4 / h), gravity=(0, -G, 0), pins=ends)
    y = _at_rest(sim)[:, 1]
    assert y[0] - y[links // 2] == pytest.approx(sag, abs=6e-8)


# -- S6: the pendulum --------------------------------------------------------------------------


def _period(degrees):
    """Time between two passages of the lowest point in the same direction [s]."""
    h, stretch = 2e-4, 1e-5
    a = np.deg2rad(degrees)
    mesh = ts.net([[0, 0, 0], [np.sin(a), -np.cos(a), 0]], [[0, 1]])
    model = ts.MassSpring(stiffness=G / stretch, node_mass=1.0)
    sim = simulate((mesh, model), h=h, gravity=(0, -G, 0), pins=HELD_END)
    passages, x, t = [], sim.positions()[1, 0], 0.0
    while len(passages) < 3:
        sim.stepper.advance(10, h, (0, -G, 0))
        t += 10 * h
        before, x = x, float(sim.positions()[1, 0])
        if before * x < 0:
            passages.append(t - 10 * h * x / (x - before))
    return passages[2] - passages[0]


@pytest.mark.parametrize(("degrees", "ratio"), [(30, 1.0174088), (90, 1.1803406), (150, 1.7622037)])
def test_period_of_a_pendulum(degrees, ratio):
    """A spring that its weight stretches by 1e-5 shifts the period by as much."""
    assert _period(degrees) / 2.0060667 == pytest.approx(ratio, rel=3e-5)


# -- spring lists ------------------------------------------------------------------------------


def test_springs_of_their_own_stiffness_and_rest_length():
    """A point between two springs in line: k1 (x − L1) = k2 (3 − x − L2)."""
    mesh = ts.net([[0, 0, 0], [1, 0, 0], [3, 0, 0]], [[0, 1], [1, 2]])
    model = ts.MassSpring(
        springs=[[0, 1, 40.0, 0.5], [1, 2, 10.0, 1.2]], node_mass=1.0, point_damping=10.0
    )
    sim = simulate((mesh, model), h=0.01, substeps=400, pins=[(where.nodes([0, 2]), "xyz")])
    x = (40.0 * 0.5 + 10.0 * (3 - 1.2)) / 50.0
    assert _at_rest(sim)[1] == pytest.approx([x, 0, 0], abs=1e-9)
    tension = 40.0 * (x - 0.5)
    assert sim.energy()["elastic"] == pytest.approx(tension**2 / 80 + tension**2 / 20, rel=1e-9)


def test_rest_lengths_of_a_net_pull_it_tight():
    mesh = ts.net([[0, 0, 0], [1, 0, 0]], [[0, 1]])
    sim = simulate((mesh, ts.MassSpring(stiffness=8.0, rest_lengths=[0.75], node_mass=1.0)))
    assert sim.forces() == pytest.approx(np.array([[2.0, 0, 0], [-2.0, 0, 0]]), rel=1e-12)


# -- A10: networks that stand for a material ---------------------------------------------------


def _stretched_energy(mesh, model, F):
    sim = simulate((mesh, model))
    sim.set_state(mesh.points @ np.array(F, float).T, np.zeros_like(mesh.points))
    return sim.energy()["elastic"]


@pytest.mark.parametrize(
    "mesh",
    [
        ts.box(size=(1, 0.2, 0.2), cells=(10, 2, 2), split="six"),
        ts.box(size=(1, 0.2, 0.2), cells=(10, 2, 2)),
        ts.ball(radius=0.4, resolution=3),
    ],
)
def test_springs_from_young_swell_as_a_solid_of_poisson_one_quarter(mesh):
    """Σ k l² = 6 E V on any mesh, so W = 9/2 K e² V with the bulk modulus K = E/(3 (1 − 2ν))."""
    corners = mesh.points[mesh.tets]
    volume = (np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6).sum()
    model = ts.MassSpring(young=1e6, density=1000.0)
    energy = _stretched_energy(mesh, model, 1.001 * np.eye(3))
    bulk = 1e6 / (3 * (1 - 2 * 0.25))
    assert energy == pytest.approx(4.5 * bulk * 1e-6 * volume, rel=1e-9)


AFFINE = {"six": (1.4444, 0.2778, 0.2778), "five": (1.3333, 0.3333, 0.3333)}


@pytest.mark.parametrize("split", AFFINE)
def test_affine_moduli_of_springs_from_young(split):
    """C11, C12 and C44 over E of cubic cells, from the energy of small affine strains."""
    n, e = 4, 1e-5
    mesh = ts.box(size=(1, 1, 1), cells=(n, n, n), split=split)
    # Springs of whole cells only, as in an endless lattice: stiffness does not see the border,
    # where edges have fewer tets, because the formula shares out each tet's own volume.
    model = ts.MassSpring(young=1.0, density=1.0)
    x, y, _ = np.eye(3)
    cases = [
        np.outer(x, x),
        np.outer(x, x) + np.outer(y, y),
        0.5 * (np.outer(x, y) + np.outer(y, x)),
    ]
    plus, both, shear = (
        2
        * (_stretched_energy(mesh, model, np.eye(3) + e * s)
           + _stretched_energy(mesh, model, np.eye(3) - e * s)) / 2 / e**2
        for s in cases
    )  # fmt: skip
    moduli = (plus, both / 2 - plus, shear)
    assert moduli == pytest.approx(AFFINE[split], abs=6e-5)


def test_sheet_of_springs_spreads_as_a_sheet_of_poisson_one_third():
    """Σ k l² = 3 E t A, so W = E/(1 − ν) e² t A when stretched evenly in its plane."""
    young, thickness = 1e5, 2e-3
    # Without diagonals the sheet has E along its threads, and ν = 0.
    for diagonals, poisson in ((True, 1 / 3), (False, 0.0)):
        mesh = ts.cloth(size=(1.0, 0.7), cells=(10, 7), diagonals=diagonals)
        model = ts.MassSpring(young=young, density=300.0, thickness=thickness)
        energy = _stretched_energy(mesh, model, 1.001 * np.eye(3))
        expected = young / (1 - poisson) * 1e-6 * thickness * 0.7
        assert energy == pytest.approx(expected, rel=1e-9)


def test_weight_of_a_hanging_cloth_pulls_its_top_row():
    mesh = ts.cloth(size=(0.6, 0.6), cells=(6, 6))
    mesh = mesh.transformed(rotate=(90, 0, 0))
    model = ts.MassSpring(young=1e5, density=300.0, thickness=2e-3, point_damping=6.0)
    top = mesh.points[:, 1].max()
    held = where.box((-1e3, top - 1e-9, -1e3), (1e3, top + 1e-9, 1e3))
    sim = simulate((mesh, model), h=1e-3, substeps=2000, gravity=(0, -G, 0), pins=[(held, "xyz")])
    _at_rest(sim)
    pull = sim.forces()[np.abs(mesh.points[:, 1] - top) < 1e-9].sum(axis=0)
    free = 1.0 - 0.5 / 6  # the top row carries half a row of cells by itself
    weight = 300.0 * 2e-3 * 0.36 * G * free
    assert pull == pytest.approx([0, -weight, 0], abs=1e-7 * weight)


def test_turned_net_gives_the_turned_answer():
    R = rotation((1, 1, 2), 1.0)
    mesh, model = _chain()
    turned = ts.net(mesh.points @ R.T, mesh.edges)
    places = []
    for net, gravity in ((mesh, np.array([1.0, -G, 2.0])), (turned, R @ [1.0, -G, 2.0])):
        sim = simulate((net, model), h=1e-3, substeps=500, gravity=tuple(gravity), pins=HELD_END)
        sim.step()
        places.append(sim.positions())
    assert places[1] == pytest.approx(places[0] @ R.T, abs=1e-9)


def test_a_mass_without_any_spring_falls():
    """x = −g h² n (n + 1)/2 after n steps of symplectic Euler, here of a frame each."""
    scene = ts.Scene(frame_rate=60.0)
    scene.add_body(ts.net([[0, 1, 0]], []), ts.MassSpring(stiffness=1.0, node_mass=0.1))
    sim = ts.Simulation(scene, threads=1)
    sim.run(0.5)
    fallen = 9.81 / 3600 * 15 * 31
    assert sim.positions()[0] == pytest.approx([0, 1 - fallen, 0], abs=1e-6 * fallen)  # f32
