"""Where methods fail: first the raw method's failure, then what tisoft does instead."""

import failing
import numpy as np
import pytest

import tisoft as ts
from tisoft.geometry.rigidity import rigidity
from tisoft.simulation import Simulation
from tisoft.stable.limiting import limiting
from tisoft.stable.sharp import sharp_limit


def test_explicit_euler_grows_at_any_step():
    k, m, h, n = 50.0, 0.2, 1e-3, 2000
    net = ts.net([[0, 0, 0], [1, 0, 0]], [[0, 1]])
    model = ts.MassSpring(stiffness=k, node_mass=m)
    pin = ts.where.nodes([0])
    amplitude = {}
    for name in ("explicit-euler", "symplectic-euler"):
        scene = failing.scene_of(
            net, model, pinned=pin, step=h, integrator=name, frame_rate=1 / (n * h)
        )
        sim = Simulation(scene, precision="f64", certify=False)
        sim.set_state(np.array([[0, 0, 0], [1.001, 0, 0]]), np.zeros((2, 3)))
        sim.step()
        x = sim.positions()[1, 0] - 1.0
        v = sim.velocities()[1, 0]
        amplitude[name] = np.hypot(x, v / np.sqrt(k / m)) / 1e-3
    growth = (1.0 + h * h * k / m) ** (n / 2)  # |1 + iωh|ⁿ
    assert amplitude["explicit-euler"] == pytest.approx(growth, rel=1e-3)
    assert growth > 1.2
    assert amplitude["symplectic-euler"] == pytest.approx(1.0, abs=0.02)


def _grows(scene, share, sharp, **state):
    seen = failing.raw(scene, share * sharp, 600, **state)
    return bool(seen[-1] > 1e3 * seen[0]) or bool(seen[-1] > 1.0)


@pytest.mark.parametrize(("share", "grows"), [(0.99, False), (1.01, True)])
def test_springs_at_the_limit(share, grows):
    def scene():
        return failing.scene_of(failing.beam(), ts.MassSpring(1e6, 1000.0), pinned=failing.CLAMP)

    sharp = Simulation(scene()).limit.sharp()
    assert _grows(scene(), share, sharp) == grows


@pytest.mark.parametrize(("share", "grows"), [(0.99, False), (1.01, True)])
def test_st_venant_stretched_by_half_at_its_limit(share, grows):
    mesh = failing.beam(cells=(16, 2, 2))  # finest along the pull
    everything = ts.ViscoElastic(1e6, 0.3, 1000.0)

    def scene():
        made = failing.scene_of(mesh, everything)
        made.bodies[0].pin(failing.CLAMP)
        made.bodies[0].pin(ts.where.box((1 - 1e-6, -9, -9), (1 + 1e-6, 9, 9)), axes="x",
                           path=[(0, 0.5, 0, 0)])  # fmt: skip
        return made

    sim = Simulation(scene(), precision="f64")
    part = sim.parts[0]
    side = np.sqrt(1.0 - 0.3 * (1.5**2 - 1.0))  # its sides are free
    middle = [0.0, 0.1, 0.1]
    x = middle + (mesh.points - middle) * [1.5, side, side]
    clamped = mesh.points[:, 0] < 1e-6
    x[clamped] = mesh.points[clamped]
    rest, u = sim.limit.sharp(), (x - mesh.points)[part.order]
    sharp = sharp_limit(part, integrator="symplectic-euler", u=u).step
    assert sharp == pytest.approx(0.6 * rest, rel=0.05)  # √(2/(3·1.5² − 1)) = 0.59 of a thin bar
    # Near the stretched equilibrium, with drag towards it: only an unstable step leaves it.
    calm = _settled(scene, x, 0.5 * sharp)
    u = (calm - mesh.points)[part.order]
    sharp = sharp_limit(part, integrator="symplectic-euler", u=u).step
    assert _grows(scene(), share, sharp, x=calm) == grows
    sim.set_state(calm, np.zeros_like(calm))
    sim.step()
    assert sim.steps[-1] < sharp


def _settled(scene, x, step):
    made = scene()
    body = made.bodies[0]
    body.model = ts.ViscoElastic(1e6, 0.3, 1000.0, point_damping=60.0)
    made.step, made.frame_rate = step, 1 / (4000 * step)
    sim = Simulation(made, precision="f64", certify=False)
    sim.set_state(x, np.zeros_like(x))
    sim.step()
    return sim.positions()


@pytest.mark.parametrize("kind", [ts.ViscoElastic, ts.NeoHookean])
def test_inverted_tet(kind):
    mesh = ts.tet_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
    scene = failing.scene_of(mesh, kind(1e4, 0.3, 1000.0, phi=20.0, eta=20.0))
    sim = Simulation(scene, precision="f64")
    mirrored = mesh.points * [-1, 1, 1]
    sim.set_state(mirrored, np.zeros((4, 3)))
    pushed = np.abs(sim.forces()).max()
    for _ in range(120):
        sim.step()
    if kind is ts.ViscoElastic:
        assert pushed < 1e-9  # no force: content inside out
        assert failing.inverted(sim) == 1
    else:
        assert pushed > 100.0
        assert failing.inverted(sim) == 0


def test_grid_without_diagonals_falls_like_a_rope():
    sag = {}
    for diagonals in (True, False):
        net = ts.grid((1, 0.2, 0.2), (5, 1, 1), diagonals=diagonals)
        model = ts.MassSpring(stiffness=2e4, node_mass=0.4, point_damping=3.0)
        scene = failing.scene_of(net, model, pinned=failing.CLAMP, gravity=(0, -9.81, 0))
        sim = failing.certified(scene, 2.0)
        sag[diagonals] = 0.2 - sim.positions()[net.points[:, 0] > 0.99, 1].max()
        modes = rigidity(net.points, net.edges)
        assert (modes.zero_energy_modes == 0) == diagonals
        assert (modes.warning("grid") is None) == diagonals
    assert sag[True] < 0.2
    assert sag[False] > 0.7


def test_linear_body_grows_when_it_spins():
    sizes = {}
    rate = 4.0
    for kind in (ts.Linear, ts.MassTensor, ts.ViscoElastic, ts.NeoHookean):
        mesh = ts.box(size=(1, 1, 0.5), cells=(2, 2, 1))
        scene = ts.Scene(gravity=(0, 0, 0), duration=0.5)
        scene.add_body(mesh, kind(1e6, 0.3, 1000.0), spin=(0, 0, rate))
        sim = failing.certified(scene, 0.5, precision="f64")
        x = sim.positions() - sim.positions().mean(axis=0)
        arm = mesh.points - mesh.points.mean(axis=0)
        sizes[kind] = np.linalg.norm(x[:, :2]) / np.linalg.norm(arm[:, :2])
    for kind in (ts.Linear, ts.MassTensor):
        assert sizes[kind] == pytest.approx(np.sqrt(1.0 + (0.5 * rate) ** 2), rel=1e-9)
    for kind in (ts.ViscoElastic, ts.NeoHookean):
        assert sizes[kind] == pytest.approx(1.0, abs=0.02)


def _sliver_beam(share):
    mesh = failing.beam()
    points = mesh.points.copy()
    node = int(np.argmin(np.abs(points - [0.5, 0.1, 0.1]).sum(axis=1)))
    points[node, 0] += (1.0 - share) / 6.0  # towards its neighbour
    return ts.tet_mesh(points, mesh.tets)


def test_sliver_costs_speed_and_nothing_else():
    model = ts.ViscoElastic(1e6, 0.3, 1000.0)
    good = Simulation(failing.scene_of(failing.beam(), model, pinned=failing.CLAMP)).limit.sharp()
    sliver = _sliver_beam(0.05)

    def scene():
        return failing.scene_of(sliver, model, pinned=failing.CLAMP, gravity=(0, -9.81, 0))

    assert failing.raw(scene(), 0.9 * good, 400)[-1] > 1.0  # the step of the good mesh
    sim = failing.certified(scene(), 0.2)
    assert sim.limit.sharp() < 0.6 * good
    assert np.abs(sim.positions() - sliver.points).max() < 0.5
    node = sliver.tets[limiting(sim.limit).element]
    assert np.abs(sliver.points[node] - [0.5, 0.1, 0.1]).max(axis=1).min() < 0.17


def test_nearly_incompressible_body_is_stiff_and_slow_and_bounded():
    def scene(poisson):
        model = ts.ViscoElastic(1e5, poisson, 1000.0)
        return failing.scene_of(failing.beam(), model, pinned=failing.CLAMP, gravity=(0, -1, 0))

    usual = Simulation(scene(0.3)).limit.sharp()
    assert failing.raw(scene(0.4999), 0.9 * usual, 400)[-1] > 1.0
    sim = failing.certified(scene(0.4999), 0.1)
    # c_P: √((1 − ν)/((1 + ν)(1 − 2ν))) is 40.8 at 0.4999 and 1.16 at 0.3
    assert usual / sim.limit.sharp() == pytest.approx(40.8 / 1.16, rel=0.1)
    assert np.abs(sim.positions() - failing.beam().points).max() < 0.1


@pytest.mark.parametrize("kind", [ts.ViscoElastic, ts.NeoHookean, ts.Linear, ts.MassSpring])
def test_body_at_ten_kilometres_behaves_as_at_zero(kind):
    # The raw method in f32: positions at 10 km are rounded to 1 mm, strains of 1 % are noise.
    away = np.float32(1e4)
    assert abs(float(np.float32(away + np.float32(1e-4)) - away) - 1e-4) > 0.5e-4
    end, offset = [], np.array([1e4, -1e4, 1e4])
    for shift in (np.zeros(3), offset):
        mesh = failing.beam().transformed(translate=tuple(shift))
        model = kind(1e6, 1000.0) if kind is ts.MassSpring else kind(1e6, 0.3, 1000.0)
        scene = failing.scene_of(
            mesh, model, pinned=ts.where.nodes([n for n in range(len(mesh.points)) if n % 7 == 0]),
            gravity=(0, -9.81, 0),
        )  # fmt: skip
        sim = failing.certified(scene, 0.5, precision="f32")
        end.append(sim.positions() - mesh.points)
    # rounding of the mesh's own points at 10 km in f64 is 2e-12 m
    assert np.abs(end[0]).max() > 2e-4
    assert np.abs(end[1] - end[0]).max() < 1e-3 * np.abs(end[0]).max()


def test_a_stretched_net_at_rest_is_no_growth_of_energy():
    """1250 J of tension whose rounding moves nodes in f32: out of nothing, by that measure."""
    cloth = ts.cloth(size=(1.37, 1.11), cells=(4, 3)).transformed(rotate=(20, 31, 47))
    length = np.linalg.norm(np.diff(cloth.points[cloth.edges], axis=1)[:, 0], axis=1)
    springs = [
        [*map(int, edge), 1e3, 0.5 * long] for edge, long in zip(cloth.edges, length, strict=True)
    ]
    rim = [n for n in range(20) if n % 5 in (0, 4) or n // 5 in (0, 3)]
    scene = failing.scene_of(
        ts.net(cloth.points, cloth.edges), ts.MassSpring(springs=springs, node_mass=0.1),
        pinned=ts.where.nodes(rim), step=1e-3,
    )  # fmt: skip
    sim = failing.certified(scene, 1.0, precision="f32", threads=1)
    assert 0.0 < sim.energy()["kinetic"] < 1e-9 < 1e3 < sim.energy()["elastic"]
    assert sim.recoveries == []


def test_stiffness_ratio_of_a_million():
    def scene():
        made = failing.scene_of(
            failing.beam(), ts.ViscoElastic(1e3, 0.3, 1000.0), pinned=failing.CLAMP
        )
        stiff = made.add_body(failing.beam(), ts.ViscoElastic(1e9, 0.3, 1000.0))
        stiff.pin(failing.CLAMP)
        for body in made.bodies:  # they stand in each other's place
            body.contact = False
        made.gravity = (0, -0.05, 0)
        return made

    soft = Simulation(failing.scene_of(failing.beam(), ts.ViscoElastic(1e3, 0.3, 1000.0),
                                       pinned=failing.CLAMP)).limit.sharp()  # fmt: skip
    assert failing.raw(scene(), 0.9 * soft, 100)[-1] > 1e3
    sim = failing.certified(scene(), 0.1)
    assert soft / sim.limit.sharp() == pytest.approx(1000.0, rel=0.01)
    u = sim.positions() - np.tile(failing.beam().points, (2, 1))
    half = len(u) // 2
    # The soft one has fallen nearly freely; the stiff one swings a million times less.
    assert np.abs(u[:half]).max() == pytest.approx(0.5 * 0.05 * 0.1**2, rel=0.1)
    assert np.abs(u[half:]).max() < 5e-6


def test_mass_ratio_of_a_million():
    net = ts.grid((1, 0.2, 0.2), (5, 1, 1))
    masses = np.where(np.arange(len(net.points)) % 3 == 0, 1e-4, 1e2)

    def scene(node_mass):
        model = ts.MassSpring(stiffness=1e4, node_mass=node_mass, spring_damping=0.01)
        return failing.scene_of(net, model, pinned=failing.CLAMP, gravity=(0, -1, 0))

    heavy = Simulation(scene(1e2)).limit.sharp()
    assert failing.raw(scene(masses), 0.9 * heavy, 100)[-1] > 1e3
    sim = failing.certified(scene(masses), 0.05)
    assert heavy / sim.limit.sharp() > 500.0
    assert np.abs(sim.positions() - net.points).max() < 0.01


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_mesh_in_millimetres_and_in_kilometres(unit):
    """With E/(ρ g L) kept, a scaled body moves as the scaled one does, in scaled time."""

    def moved(scale):
        mesh = failing.beam().transformed(scale=scale)
        model = ts.NeoHookean(1e5 * scale, 0.3, 1000.0)
        pin = ts.where.box(
            (-1e-6 * scale, -9 * scale, -9 * scale), (1e-6 * scale, 9 * scale, 9 * scale)
        )
        second = np.sqrt(scale)
        scene = failing.scene_of(
            mesh, model, pinned=pin, gravity=(0, -9.81, 0), frame_rate=60 / second
        )
        sim = failing.certified(scene, 0.5 * second, precision="f64")
        return sim.positions() / scale, sim.stable_step() / second

    (x, step), (ours, our_step) = moved(1.0), moved(unit)
    assert our_step == pytest.approx(step, rel=1e-6)
    assert np.abs(ours - x).max() < 1e-9
    assert np.abs(x - failing.beam().points).max() > 0.1  # a large deflection, so no linear affair
