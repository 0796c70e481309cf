"""A7 and A3: the critical step, its safe bound, and what happens just below and above."""

import numpy as np
import pytest
from beams import beam, cantilever, displaced, gmsh_beam, rotation, rubber, simulate

import tisoft as ts
from tisoft import where
from tisoft.checks import FieldError
from tisoft.stable.sharp import SharpLimit

MESHES = {
    "six 10x2x2": lambda: beam("six"),
    "six 20x4x4": lambda: beam("six", (20, 4, 4)),
    "five 10x2x2": beam,
    "five 20x4x4": lambda: beam("five", (20, 4, 4)),
    "gmsh c": lambda: gmsh_beam("c"),
    "gmsh m": lambda: gmsh_beam("m"),
}
CRITICAL = {
    "six 10x2x2": 1.805912e-3,
    "six 20x4x4": 9.11644e-4,
    "five 10x2x2": 1.513076e-3,
    "five 20x4x4": 7.65851e-4,
    "gmsh c": 1.004773e-3,
    "gmsh m": 6.65964e-4,
}
CONSISTENT = {"six 10x2x2": 8.79181e-4, "five 10x2x2": 8.75445e-4, "five 20x4x4": 4.42430e-4}


def _clamped(name, kind=ts.ViscoElastic, *, certify=False, h=1e-3, damping=None, **keys):
    model = rubber(kind, **keys, **(damping or {}))
    return cantilever(model, mesh=MESHES[name](), certify=certify, h=h)


# -- the numbers -------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "bound"), [("six 10x2x2", 1.331542e-3),
                                             ("five 10x2x2", 1.287506e-3)])  # fmt: skip
def test_bound_is_at_least_that_of_the_worst_element_alone(name, bound):
    found = _clamped(name).stable_step()
    assert bound * (1 - 2e-5) < found < CRITICAL[name]


@pytest.mark.parametrize("name", CRITICAL)
def test_limit_is_met_from_the_safe_side(name):
    sim = _clamped(name)
    assert 0.99 * CRITICAL[name] < sim.limit.sharp() < CRITICAL[name] * (1 + 1e-6)
    assert 0.39 * CRITICAL[name] < sim.stable_step() <= sim.limit.sharp()


@pytest.mark.parametrize("name", CONSISTENT)
def test_limit_with_consistent_mass(name):
    sim = _clamped(name, ts.Linear, mass="consistent")
    assert 0.99 * CONSISTENT[name] < sim.limit.sharp() < CONSISTENT[name] * (1 + 1e-6)
    assert 0.39 * CONSISTENT[name] < sim.stable_step() <= sim.limit.sharp()


TAU = 0.01
DAMPED_LIMIT = 1.138220e-4
"""A7: φ = τ λ, η = τ μ on five 10x2x2."""


def _viscous():
    model = rubber()
    return {"phi": TAU * model.lame_lambda, "eta": TAU * model.lame_mu}


def test_limit_with_viscosity():
    sim = _clamped("five 10x2x2", damping=_viscous())
    exact = -TAU + np.sqrt(TAU**2 + CRITICAL["five 10x2x2"] ** 2)
    assert exact == pytest.approx(DAMPED_LIMIT, rel=2e-6)
    assert 0.99 * exact < sim.limit.sharp() < exact * (1 + 1e-6)
    assert 0.39 * DAMPED_LIMIT < sim.stable_step() <= sim.limit.sharp()


def test_velocity_verlet_feels_viscosity_twice():
    omega = 2 / CRITICAL["five 10x2x2"]
    limit = -2 * TAU + np.sqrt(4 * TAU**2 + 4 / omega**2)
    sim = cantilever(rubber(**_viscous()), integrator="velocity-verlet")
    assert 0.99 * limit < sim.limit.sharp() < limit * (1 + 1e-5)
    assert sim.stable_step() <= sim.limit.sharp()


def test_limit_of_the_chain_of_springs():
    """S3: ten masses of .01 kg on springs of 100 N/m, one end held."""
    mesh = ts.net([[float(i), 0, 0] for i in range(11)], [[i, i + 1] for i in range(10)])
    model = ts.MassSpring(stiffness=100.0, node_mass=0.01)
    held = [(where.nodes([0]), "xyz")]
    sim = simulate((mesh, model), pins=held)
    assert 0.99 * 1.0112953e-2 < sim.limit.sharp() < 1.0112953e-2 * (1 + 1e-6)
    assert 0.39 * 1.0112953e-2 < sim.stable_step() <= sim.limit.sharp()
    u = 1e-9 * np.random.default_rng(0).standard_normal((11, 3)) * [1, 0, 0]
    for share, grows in ((0.99, False), (1.01, True)):
        h = share * 1.0112953e-2
        sim = simulate((mesh, model), pins=held, h=h, substeps=1000)
        displaced(sim, u)
        sim.step()
        assert (not np.abs(sim.velocities()).max() < 1e-3) == grows


@pytest.mark.parametrize("damper", [0.0, 0.2])
def test_bound_and_limit_of_two_masses_on_a_spring_are_the_same(damper):
    """ω² = 2 k/m and 2ζω = 2 c/m: h = 4/(2ζω + √((2ζω)² + 4ω²))."""
    model = ts.MassSpring(stiffness=100.0, node_mass=0.01, spring_damping=damper)
    sim = simulate((ts.net([[0, 0, 0], [1, 0, 0]], [[0, 1]]), model))
    rate, omega2 = 2 * damper / 0.01, 2 * 100.0 / 0.01
    limit = 4 / (rate + np.sqrt(rate**2 + 4 * omega2))
    assert sim.stable_step() == pytest.approx(limit, rel=1e-6)
    assert sim.limit.sharp() == pytest.approx(limit, rel=1e-6)


# -- just below and just above -----------------------------------------------------------------


def _speed_after(sim, h, substeps):
    """Largest speed [m/s] after a start from tiny random displacements of some 1e-9 m."""
    random = np.random.default_rng(2)
    free = sim.scene.bodies[0].mesh.points[:, :1] > 1e-9
    displaced(sim, 1e-9 * free * random.standard_normal((len(free), 3)))
    sim.stepper.advance(substeps, h, (0, 0, 0))
    with np.errstate(all="ignore"):
        return float(np.abs(sim.velocities()).max())


@pytest.mark.parametrize("name", ["five 10x2x2", "six 10x2x2", "gmsh c"])
@pytest.mark.parametrize(
    ("share", "substeps", "grows"),
    [(0.95, 10000, False), (0.99, 10000, False), (1.01, 1000, True), (1.05, 1000, True)],
)
def test_bounded_below_the_limit_and_blown_up_above(name, share, substeps, grows):
    h = share * CRITICAL[name]
    speed = _speed_after(_clamped(name), h, substeps)
    assert (not speed < 1e-3) == grows
    if not grows:
        assert speed < 1e-5


@pytest.mark.parametrize(("share", "grows"), [(0.99, False), (1.01, True)])
def test_consistent_mass_just_below_and_above(share, grows):
    sim = _clamped("five 10x2x2", ts.Linear, mass="consistent")
    speed = _speed_after(sim, share * CONSISTENT["five 10x2x2"], 2000)
    assert (not speed < 1e-3) == grows


@pytest.mark.parametrize(("share", "grows"), [(0.99, False), (1.01, True)])
def test_viscous_beam_decays_below_and_grows_above(share, grows):
    sim = _clamped("five 10x2x2", damping=_viscous())
    early, late = (_speed_after(sim, share * DAMPED_LIMIT, n) for n in (400, 4000))
    assert (late > 1e3 * early) == grows
    assert (late < early) == (not grows)


# -- a deforming body --------------------------------------------------------------------------


def _limit_here(sim):
    """2/ω_max of the present state, K by differences of the forces."""
    x = sim.positions()
    lumped = np.zeros(len(x))
    for part in sim.parts:
        lumped[part.order] = part.mass
    scale = 1 / np.sqrt(np.repeat(lumped, 3))
    K = np.empty((x.size, x.size))
    step = 1e-6 * np.ptp(x)
    for k in range(x.size):
        pair = []
        for sign in (1, -1):
            moved = x.copy()
            moved.ravel()[k] += sign * step
            sim.set_state(moved, 0 * x)
            pair.append(sim.forces().ravel())
        K[k] = (pair[1] - pair[0]) / (2 * step)
    sim.set_state(x, 0 * x)
    A = scale[:, None] * (0.5 * (K + K.T)) * scale
    return 2 / np.sqrt(np.linalg.eigvalsh(A)[-1])


def _small_block(kind):
    mesh = ts.box(size=(1.0, 0.5, 0.5), cells=(4, 2, 2))
    return simulate((mesh, kind(1e5, 0.3, 1000.0)))


STATES = {
    "rest": np.eye(3),
    "stretched": np.diag([1.5, 0.9, 0.9]),
    "squeezed": np.diag([0.6, 1.15, 1.1]),
    "sheared": np.array([[1, 0.5, 0.2], [0, 1, -0.3], [0.1, 0, 1.0]]),
    "inside out": np.diag([-0.8, 1.1, 1.0]),
}


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("kind", [ts.ViscoElastic, ts.NeoHookean])
def test_bound_stays_below_the_limit_of_the_deformed_state(kind, state):
    sim = _small_block(kind)
    points = sim.scene.bodies[0].mesh.points
    rough = 0.02 * np.random.default_rng(4).standard_normal(points.shape)
    sim.set_state((points + rough) @ STATES[state].T, 0 * points)
    limit = _limit_here(sim)
    assert sim.stable_step() <= limit
    assert sim.stable_step() > 0.35 * limit


@pytest.mark.parametrize("kind", [ts.ViscoElastic, ts.NeoHookean])
def test_a_turn_leaves_the_bound_as_it_is(kind):
    sim = _small_block(kind)
    rest, points = sim.stable_step(), sim.scene.bodies[0].mesh.points
    for angle in (0.7, 2.0, 3.14):
        turned = points @ rotation((1, 2, -0.5), angle).T
        sim.set_state(turned, 0 * points)
        assert sim.stable_step() == pytest.approx(rest, rel=1e-4)


@pytest.mark.parametrize(("stretch", "fall"), [(1.2, 0.7762), (1.5, 0.5898)])
def test_st_venant_stiffens_in_tension(stretch, fall):
    """h falls by √(2/(3 l² − 1)) along a pull: one tet, all held but the pulled node's way."""
    mesh = ts.tet_mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [[0, 1, 2, 3]])
    young, density = 1e5, 1000.0
    rest_limit = 2 / np.sqrt(4 * young / density)  # ω² = V E/m, m = ρ V/4
    pull = young * stretch * (stretch**2 - 1) / 2  # P [Pa], balanced by gravity along x
    for share, grows in ((0.99, False), (1.01, True)):
        gravity = (4 * pull / density, 0, 0)
        h = share * fall * rest_limit
        sim = simulate((mesh, ts.ViscoElastic(young, 0.0, density)), h=h, gravity=gravity)
        sim.scene.bodies[0].pin(where.nodes([0, 2, 3]))
        sim.scene.bodies[0].pin(where.nodes([1]), "yz")
        u = np.zeros((4, 3))
        u[1, 0] = stretch - 1 + 1e-9
        displaced(sim, u)
        assert sim.stable_step() <= fall * rest_limit * (1 + 1e-4)
        sim.step()  # takes the pins over
        assert np.abs(sim.velocities()[[0, 2, 3]]).max() == 0.0
        sim.stepper.advance(2000, h, gravity)
        assert (not np.abs(sim.velocities()).max() < 1e-6) == grows


# -- what the user sees ------------------------------------------------------------------------


def test_step_above_the_limit_is_refused_with_the_limit():
    sim = _clamped("five 10x2x2", certify=True, h=1.02 * CRITICAL["five 10x2x2"])
    with pytest.raises(FieldError, match=r"above the stable limit 0\.00150\d*|0\.00151\d*"):
        sim.step()


def test_step_just_below_the_limit_is_taken_as_it_is():
    h = 0.985 * CRITICAL["five 10x2x2"]
    sim = _clamped("five 10x2x2", certify=True, h=h)
    sim.step()
    assert sim.steps == [pytest.approx(h)]


def test_uncertified_simulation_takes_any_step():
    sim = _clamped("five 10x2x2", h=1.0)
    sim.step()
    assert sim.steps == [1.0]


@pytest.mark.parametrize("kind", [ts.Linear, ts.MassTensor, ts.ViscoElastic, ts.NeoHookean])
def test_every_model_of_a_solid_has_the_same_limit_at_rest(kind):
    sim = _clamped("five 10x2x2", kind)
    critical = CRITICAL["five 10x2x2"]
    assert 0.99 * critical < sim.limit.sharp() < critical * (1 + 1e-6)
    assert sim.stable_step() <= critical


def test_scaled_body_has_the_scaled_step():
    """h goes with the size over the speed of sound: 1000 times larger, 1000 times longer."""
    small, large = beam(), beam().transformed(scale=1000.0)
    steps = [simulate((mesh, rubber())).stable_step() for mesh in (small, large)]
    assert steps[1] == pytest.approx(1000 * steps[0], rel=1e-12)


@pytest.fixture
def squashed(monkeypatch):
    """A block at rest, and positions in which a node is pushed in: the bound of all falls to less
    than .6, the limit to .8."""
    monkeypatch.setattr("tisoft.stable.limit.FIRST", 0.0)
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add_body(ts.box(size=(1, 1, 1), cells=(4, 4, 4)), ts.ViscoElastic(1e5, 0.3, 1000.0))
    sim = ts.Simulation(scene, threads=1, precision="f64")

    def by(depth):
        x = sim.positions() if depth else scene.bodies[0].mesh.points.copy()
        x[np.abs(scene.bodies[0].mesh.points - [0.5, 1, 0.5]).sum(axis=1).argmin(), 1] = 1 - depth
        return x

    return sim, by


def test_a_bound_that_a_squashed_node_lets_fall_is_sharpened_soon(squashed):
    """By a step that is sharp's share again, where waiting as ever would keep a third of it."""
    sim, by = squashed
    at_rest = sim.limit.chosen(0)
    sim.set_state(by(0.22), 0 * by(0.22))
    sim.limit.sharpens = False
    assert sim.limit.chosen(1) < 0.6 * at_rest
    sim.limit.sharpens = True
    for substeps in (4000, 8000):  # it rises to what would have served for a while
        sim.limit.moved()
        found = sim.limit.chosen(substeps)
    assert 0.7 * at_rest < found < 1.01 * at_rest


def test_a_step_that_the_bound_would_refuse_is_looked_at_sharply_before(squashed):
    sim, by = squashed
    at_rest = sim.limit.sharp()
    sim.set_state(by(0.22), 0 * by(0.22))
    sim.limit.sharpens = False
    assert sim.limit.accepted(0.75 * at_rest) < 0.6 * at_rest
    sim.limit.sharpens = True
    assert 0.75 * at_rest < sim.limit.accepted(0.75 * at_rest) < 0.9 * at_rest


def test_sharp_limits_take_a_quarter_of_a_run_at_the_most(squashed, monkeypatch):
    """Of a body that swells until its bound is a thirtieth, by a quarter more in 1000 substeps."""
    sim, by = squashed
    sim.limit.sharp()
    asked, products = [], 200

    def find(part, **options):
        asked.append(options)
        return SharpLimit(1e-2, options["u"], products)

    monkeypatch.setattr("tisoft.stable.limit.sharp_limit", find)
    for k in range(16):
        sim.set_state(1.25**k * by(0), 0 * by(0))
        sim.limit.chosen(1000 * k)
    cost = 3 * products  # substeps that as many products with a matrix take as long as
    assert 1 < len(asked) <= 1 + 15_000 / (4 * cost)


def test_a_body_that_allows_more_does_not_change_what_another_allows():
    """Each body's bound is held against its own: at rest all have .9 of their sharp limit."""
    mesh = ts.box(size=(1.0, 0.5, 0.5), cells=(4, 2, 2))
    soft, stiff = ts.ViscoElastic(1e5, 0.3, 1000.0), ts.ViscoElastic(4e5, 0.3, 1000.0)
    together, alone = simulate((mesh, soft), (mesh, stiff)), simulate((mesh, stiff))
    assert together.limit.chosen(0) == pytest.approx(0.9 * alone.limit.sharp(), rel=1e-4)
