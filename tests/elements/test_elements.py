"""Every element: its forces are minus the gradient of its energy, see no rigid motion, add up to
nothing, and leave no mode without stiffness but the six of a rigid body; a linear field costs what
the law says; beams bend, swing and twist as tabulated.

Beams of 1 x 0.2 x 0.2 m, E = 1e6 Pa, 1000 kg/m³, clamped at x = 0 (references: quadratic hexahedra,
converged): a shear of 1 N at the end does 2.544 mJ of work (ν = .49: 2.497), f1 = .9995 Hz, a turn
of its end takes 87.077 N·m.
"""

import numpy as np
import pytest
import surfaces
from surfaces import block

import tisoft as ts
from tisoft.elements.brick import Brick
from tisoft.elements.hex8 import Hex8
from tisoft.elements.matrices import hooke_blocks, stiffest
from tisoft.elements.quadratic import PRODUCTS
from tisoft.elements.quadratic import QUADRATIC_EDGES as EDGES
from tisoft.equilibrium.modes import natural_modes
from tisoft.equilibrium.operators import Elastic
from tisoft.equilibrium.pointwise import Pointwise, is_pointwise
from tisoft.geometry.cage.build import caged
from tisoft.geometry.cage.lattice import Lattice
from tisoft.geometry.shapes import box
from tisoft.geometry.solid import SolidMesh, quadratic
from tisoft.model.part import parts_of
from tisoft.stable.sharp import sharp_step

LAWS = {"viscoelastic": ts.ViscoElastic, "linear": ts.Linear, "neo-hookean": ts.NeoHookean}
CORNERS = np.array([[c & 1, c >> 1 & 1, c >> 2] for c in (0, 1, 3, 2, 4, 5, 7, 6)], float)


def hexes(points):
    return SolidMesh(points, np.arange(8), hexes=np.arange(8)[None])


def brick():
    return hexes(CORNERS * [0.3, 0.2, 0.25])


def skewed():
    return hexes(CORNERS * [0.3, 0.2, 0.25] + 0.03 * np.random.default_rng(3).normal(size=(8, 3)))


def tet10(bend=0.0):
    tet = ts.tet_mesh(
        [[0, 0, 0], [0.3, 0, 0.02], [0.05, 0.25, 0], [0.02, 0.04, 0.28]], [[0, 1, 2, 3]]
    )
    mesh = quadratic(tet)
    points = mesh.points.copy()
    points[4:] += bend * np.random.default_rng(4).normal(size=(6, 3))
    return SolidMesh(points, mesh.kept_nodes, quadratic_tets=mesh.quadratic_tets)


def cut():
    """A cell of a turned lattice that is filled to a tenth."""
    points, triangles = block((0.15, 0.11, 0.12), (0.03, 0.02, 0.01))
    axes = surfaces.turn([1, 2, 3], 25)
    lattice = Lattice(
        axes, np.array([0, -0.06, -0.05]), np.array([0.3, 0.25, 0.28]), np.ones(3, int)
    )
    return caged(points, triangles, lattice)


MESHES = {"cut": cut, "brick": brick, "hex8": skewed, "tet10": tet10, "curved": lambda: tet10(0.01)}


def elastic_of(mesh, law, **more):
    model = LAWS[law](young=1e5, poisson=0.35, density=1000.0, **more)
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add_body(mesh, model)
    (part,) = parts_of(scene.bodies)
    return Elastic(part)


CASES = [("brick", "linear"), ("brick", "neo-hookean"), ("hex8", "viscoelastic")]
CASES += [("tet10", "viscoelastic"), ("curved", "neo-hookean")]


@pytest.fixture(params=CASES, ids="-".join, scope="module")
def case(request):
    mesh, law = request.param
    elastic = elastic_of(MESHES[mesh](), law, phi=20.0, eta=30.0)
    rng = np.random.default_rng(7)
    u, w = 0.04 * rng.normal(size=(2, elastic.nodes, 3))
    return law, elastic, u, w


def turn(axis, angle):
    k = np.asarray(axis) / np.linalg.norm(axis)
    K = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def test_force_is_minus_the_gradient_of_the_energy(case):
    _, elastic, u, w = case
    h = 1e-5
    slope = (elastic.energy(u + h * w) - elastic.energy(u - h * w)) / (2 * h)
    assert -(elastic.force(u) * w).sum() == pytest.approx(slope, rel=1e-7)


def test_product_is_the_slope_of_the_force(case):
    _, elastic, u, w = case
    h = 1e-6
    slope = -(elastic.force(u + h * w) - elastic.force(u - h * w)) / (2 * h)
    product = elastic.stiffness_times(w, u)
    assert np.abs(product - slope).max() < 1e-7 * np.abs(product).max()
    matrix = elastic.stiffness(u)
    assert np.abs(matrix @ w.ravel() - product.ravel()).max() < 1e-12 * np.abs(product).max()
    assert np.abs(matrix - matrix.T).max() < 1e-12 * np.abs(matrix).max()


def test_operators_at_points_are_those_of_the_kernels(case):
    _, elastic, u, w = case
    if not is_pointwise(elastic.part):
        pytest.skip("a law whose pull-back turns is left to the kernels")
    apart = Pointwise(elastic.part)
    assert apart.energy(u) == pytest.approx(elastic.energy(u), rel=1e-12)
    pairs = [(apart.force(u), elastic.force(u))]
    pairs += [(apart.stiffness_times(w, u), elastic.stiffness_times(w, u))]
    pairs += [(apart.viscosity_times(w, u), elastic.viscosity_times(w, u))]
    pairs += [(apart.stiffness(u).toarray(), elastic.stiffness(u).toarray())]
    for found, wanted in pairs:
        assert np.abs(found - wanted).max() < 1e-12 * np.abs(wanted).max()


def test_rigid_motion_costs_nothing(case):
    law, elastic, u, _ = case
    scale = np.abs(elastic.force(u)).max()
    if law == "linear":
        x = elastic.rest
        still = np.cross([0.1, 0.2, -0.3], x) + np.array([1.0, 2.0, 3.0])
    else:
        still = elastic.rest @ (turn([1, 2, 3], 1.1) - np.eye(3)).T + np.array([1.0, 2.0, 3.0])
    assert np.abs(elastic.force(still)).max() < 1e-12 * scale * 10
    assert abs(elastic.energy(still)) < 1e-12 * elastic.energy(u)


def test_forces_add_up_to_nothing(case):
    law, elastic, u, w = case
    x = elastic.rest + (0.0 if law == "linear" else u)
    for f in (elastic.force(u), elastic.viscosity_times(w, u)):
        assert np.abs(f.sum(axis=0)).max() < 1e-12 * np.abs(f).max()
        assert np.abs(np.cross(x, f).sum(axis=0)).max() < 1e-12 * np.abs(f).max()


def test_viscosity_takes_energy_from_every_motion_but_rigid_ones(case):
    _, elastic, u, _ = case
    C = elastic.viscosity(u)
    assert np.abs(C - C.T).max() < 1e-12 * np.abs(C).max()
    values = np.linalg.eigvalsh(C.toarray())
    assert (np.abs(values[:6]) < 1e-10 * values[-1]).all()
    assert values[6] > 1e-5 * values[-1]


def test_only_rigid_motions_have_no_stiffness(case):
    _, elastic, u, _ = case
    values = np.linalg.eigvalsh(elastic.stiffness(np.zeros_like(u)).toarray())
    assert (np.abs(values[:6]) < 1e-10 * values[-1]).all()
    assert values[6] > 1e-4 * values[-1]


@pytest.mark.parametrize("kind", ["hex8", "tet10"])
def test_a_linear_field_is_met_on_any_mesh(kind):
    rng = np.random.default_rng(5)
    mesh = box((3, 3, 3), (3, 3, 3), split="hex" if kind == "hex8" else "five")
    inner = ((mesh.points > 0) & (mesh.points < 3)).all(axis=1)
    points = mesh.points + np.where(inner[:, None], rng.uniform(-0.2, 0.2, mesh.points.shape), 0)
    if kind == "hex8":
        mesh = SolidMesh(points, mesh.kept_nodes, hexes=mesh.hexes)
    else:
        mesh = quadratic(ts.tet_mesh(points, mesh.tets))
    elastic = elastic_of(mesh, "viscoelastic")
    (part,) = parts_of([elastic.part.body])
    inside = ((mesh.points > 0) & (mesh.points < 3)).all(axis=1)[part.order]
    u = elastic.rest @ (0.1 * rng.normal(size=(3, 3)))
    f = elastic.force(u)
    assert np.abs(f[inside]).max() < 1e-12 * np.abs(f).max()


def beam(mesh, poisson=0.3, gravity=0.0):
    scene = ts.Scene(gravity=(0, 0, -gravity))
    body = scene.add_body(mesh, ts.ViscoElastic(young=1e6, poisson=poisson, density=1000.0))
    body.pin(ts.where.box((-1e-6, -1, -1), (1e-6, 1, 1)))
    return scene, body


END = ts.where.box((1 - 1e-6, -1, -1), (1 + 1e-6, 1, 1))


@pytest.mark.parametrize("kind", ["hex8", "tet10"])
def test_bound_on_the_step_holds_as_the_beam_deforms(kind):
    mesh = box((1, 0.2, 0.2), (2, 1, 1), split="hex") if kind == "hex8" else None
    mesh = mesh or quadratic(box((1, 0.2, 0.2), (2, 1, 1)))
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64")
    scene.add_body(mesh, ts.ViscoElastic(1e6, 0.3, 1000.0, phi=30.0, eta=20.0))
    sim = ts.Simulation(scene)
    X = mesh.points
    for bend in (0.0, 0.8):
        u = 0.01 * bend * np.random.default_rng(1).normal(size=X.shape)
        u[:, 0] += bend * X[:, 0] * (X[:, 2] - 0.1)
        u[:, 2] -= bend * X[:, 0] ** 2
        sim.set_state(X + u, np.zeros_like(X))
        sharp = sharp_step(sim.system, integrator="symplectic-euler", u=sim.system.u)
        assert 0.3 * sharp < sim.limit.present() <= sharp


def compliance_error(mesh, poisson, reference):
    """[%], at a load so small that the beam is linear."""
    scene, body = beam(mesh, poisson)
    body.load(END, force=(0, 0, -1e-3))
    energy = ts.Simulation(scene).equilibrium().energy["elastic"]
    return 100 * (2e6 * energy / reference - 1)


def torsion_error(mesh):
    scene, body = beam(mesh)
    turn_of_end = ts.Turn(point=(1, 0.1, 0.1), axis=(1, 0, 0), rate=1e-4)
    scene.duration = 1.0
    body.pin(END, turn=turn_of_end)
    energy = ts.Simulation(scene).equilibrium().energy["elastic"]
    return 100 * (2e8 * energy / 87.077 - 1)


@pytest.mark.parametrize(
    ("cells", "bending", "locked", "f1", "droop"),
    [
        ((5, 1, 1), -1.6, -1.8, -2.0, -2.05),
        ((10, 2, 2), -1.6, -5.1, 0.3, -1.94),
    ],
)
def test_beams_of_hexes(cells, bending, locked, f1, droop):
    mesh = box((1, 0.2, 0.2), cells, split="hex")
    assert compliance_error(mesh, 0.3, 2.544e-3) == pytest.approx(bending, abs=0.1)
    assert compliance_error(mesh, 0.49, 2.497e-3) == pytest.approx(locked, abs=0.2)
    scene, _ = beam(mesh, gravity=9.81)
    found = natural_modes(scene, 1).frequencies[0]
    assert 100 * (found / 0.9995 - 1) == pytest.approx(f1, abs=0.1)
    end = np.isclose(mesh.points[:, 0], 1.0)
    moved = (ts.Simulation(scene).equilibrium().positions - mesh.points)[end, 2].mean()
    assert 100 * (moved / -0.3457 - 1) == pytest.approx(droop, abs=0.1)


@pytest.mark.parametrize(
    ("cells", "bending", "locked", "f1", "torsion"),
    [((5, 1, 1), -3.4, -17.3, 1.2, 16.4)],
)
def test_beams_of_quadratic_tets(cells, bending, locked, f1, torsion):
    mesh = quadratic(box((1, 0.2, 0.2), cells))
    assert compliance_error(mesh, 0.3, 2.544e-3) == pytest.approx(bending, abs=0.1)
    assert compliance_error(mesh, 0.49, 2.497e-3) == pytest.approx(locked, abs=0.2)
    if torsion is not None:
        assert torsion_error(mesh) == pytest.approx(torsion, abs=0.1)
    found = natural_modes(beam(mesh)[0], 1).frequencies[0]
    assert 100 * (found / 0.9995 - 1) == pytest.approx(f1, abs=0.1)


def test_a_cell_filled_in_part_passes_the_patch_test():
    """A linear field has the energy of the filled volume, on any cut; NumPy has its matrix."""
    elastic = elastic_of(cut(), "viscoelastic")
    (cells,) = elastic.part.solids
    model = elastic.part.body.model
    volume = 0.15 * 0.11 * 0.12
    assert cells.volume.sum() == pytest.approx(volume, rel=1e-12)
    H = 0.02 * np.random.default_rng(5).normal(size=(3, 3))
    E = 0.5 * (H + H.T + H.T @ H)
    wanted = volume * (0.5 * model.lame_lambda * np.trace(E) ** 2 + model.lame_mu * (E * E).sum())
    assert elastic.energy(elastic.rest @ H.T) == pytest.approx(wanted, rel=1e-10)
    (K,) = cells.matrices(model.lame_lambda, model.lame_mu)
    own = (3 * cells.nodes[0][:, None] + np.arange(3)).ravel()
    found = elastic.stiffness(np.zeros_like(elastic.rest)).toarray()[np.ix_(own, own)]
    assert np.abs(found - K).max() < 1e-12 * np.abs(K).max()


def test_consistent_mass_of_a_quadratic_tet():
    """420 ∫ N_a N_b dV/V: 6 and 1 of corners, −4 and −6 of a corner and an edge's middle that touch
    and do not, 32, 16 and 8 of two middles that are the same, share a corner, do not.
    """
    at = np.vstack([np.eye(4), 0.5 * (np.eye(4)[EDGES[:, 0]] + np.eye(4)[EDGES[:, 1]])])
    shared = np.rint(4 * at @ at.T).astype(int)  # four times Σ L_i L_i of both nodes
    wanted = np.empty((10, 10))
    wanted[:4, :4] = np.where(shared[:4, :4] > 0, 6, 1)
    wanted[4:, 4:] = np.choose(shared[4:, 4:], [8, 16, 32])
    wanted[:4, 4:] = np.where(shared[:4, 4:] > 0, -4, -6)
    wanted[4:, :4] = wanted[:4, 4:].T
    assert np.abs(420 * PRODUCTS - wanted).max() < 1e-12


def test_cells_along_the_axes_are_bricks_wherever_they_stand_and_all_others_hex8():
    bar = box((1, 0.2, 0.3), (5, 1, 2), split="hex")
    turned = bar.transformed(rotate=(0, 0, 1))
    cases = [(bar, Brick), (bar.transformed(translate=(3, -7, 2)), Brick), (brick(), Brick)]
    for mesh, kind in [*cases, (turned, Hex8), (skewed(), Hex8)]:
        scene = ts.Scene()
        scene.add_body(mesh, ts.Linear(1e5, 0.3, 1000.0))
        (part,) = parts_of(scene.bodies)
        assert [cells.element for cells in part.solids] == [kind]


@pytest.mark.parametrize("lam, mu", [(1.0, 1.0), (50.0, 1.0), (-0.6, 1.0), (0.0, 1.0), (1.0, 0.0)])
def test_stiffest_is_the_largest_eigenvalue_of_the_element_matrix(lam, mu):
    g = np.random.default_rng(5).normal(size=(6, 4, 3)) * [[[3.0, 1.0, 0.01]]]
    g[0] = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]]  # three axes alike
    full = hooke_blocks(g[:, None], np.ones((6, 1)), lam, mu)
    assert stiffest(g, lam, mu) == pytest.approx(np.linalg.eigvalsh(full)[:, -1], rel=1e-7)
