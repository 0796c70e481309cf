"""Whatever is handed over wrongly from Python is told in one sentence, where it enters, and nothing
is taken of it; what changes while a simulation runs is followed, or refused by its name.
"""

import inspect
import re
from pathlib import Path

import numpy as np
import pytest

import tisoft as ts
from tisoft.checks import FieldError

NAN = float("nan")
MODELS = ("ViscoElastic", "Linear", "NeoHookean", "MassTensor")
WRONG = [
    # shapes and meshes
    "ts.box(1.0, (1, 1, 1))", "ts.box((1, 1, 1), 2)", "ts.box((1, 1), (1, 1, 1))",
    "ts.box((1, 1, True), (1, 1, 1))", "ts.box((1, 1, 1), (1, 1, True))",
    "ts.box((1, 1, 1), (1, 1, 1.0))", "ts.box((1, 1, 0), (1, 1, 1))", "ts.box('1', (1, 1, 1))",
    "ts.box((1, 1, 1), (1, 1, 1), split='four')", "ts.box((1, 1, 1), (1, 1, 1), split=5)",
    "ts.box((1, 1, NAN), (1, 1, 1))", "ts.box((1, 1, '1'), (1, 1, 1))", "ts.box(None, None)",
    "ts.box((1, 1, 1), (1, 1, 10**9))", "ts.box(np.array(1.0), (1, 1, 1))", "ts.ball('a', 3)",
    "ts.ball(-1, 3)", "ts.ball(1, 0)", "ts.ball(True, 3)", "ts.ball(1, None)", "ts.ball([1, 2], 3)",
    "ts.cylinder(1, 'x', 2)", "ts.cylinder(1, 1, 2.5)", "ts.cylinder(1, NAN, 2)", "ts.cloth(1, 2)",
    "ts.cloth((1, 1), (2, 2), diagonals='no')", "ts.cloth((1, 1, 1), (2, 2))",
    "ts.grid((1, 1, 1), (1, 1, 1), diagonals=1)", "ts.grid((1, 1, 1), 'abc')",
    "ts.net(5, [[0, 1]])", "ts.net([[0, 0, 0], [1, 0, 0]], [[0, 2]])",
    "ts.net([[0, 0, 0], [1j, 0, 0]], [[0, 1]])", "ts.net([[0, 0, 0], [1, 0, 0]], [[0, 0.5]])",
    "ts.net([[0, 0, 0], [True, False, True]], [[0, 1], [1]])",
    "ts.tet_mesh('points', [[0, 1, 2, 3]])",
    "ts.tet_mesh(np.ones((4, 3), complex), [[0, 1, 2, 3]])", "ts.tet_mesh(mesh.points, None)",
    "ts.tet_mesh([['0', '0', '0']], [[0, 0, 0, 0]])", "ts.tet_mesh(mesh.points, mesh.tets * 1.0)",
    "ts.tet_mesh(mesh.points > 0, mesh.tets)", "ts.tet_mesh([[0, 0, 0], [1]], mesh.tets)",
    "ts.TetMesh(mesh.points, mesh.tets, 'abc')", "ts.TetMesh(mesh.points, mesh.tets, [0.5])",
    "ts.SpringNet(mesh.points, [[0, 1]], (), None)", "mesh.transformed(scale='2')",
    "mesh.transformed(scale=-1)", "mesh.transformed(scale=True)",
    "mesh.transformed(scale=(1, 2, 3))", "mesh.transformed(rotate=5)",
    "mesh.transformed(translate='up')", "mesh.transformed(rotate=(0, NAN, 0))",
    "setattr(mesh, 'points', 0)", "ts.read_mesh(None)", "ts.read_mesh(5)", "ts.read_mesh('')",
    "ts.read_mesh('a\\0b')", "ts.read_mesh('nowhere.vtu')", "ts.read_surface(None)",
    "ts.read_surface('nowhere.stl')", "ts.read_skin(None, mesh)", "ts.read_skin('nowhere.stl', 5)",
    "ts.skin(None, mesh.points, mesh.surface)", "ts.skin(mesh, 5, mesh.surface)",
    "ts.skin(mesh, mesh.points, [[0, 1, 999]])", "ts.Skin('a', 'b', 'c')",
    "ts.cage(mesh.points, mesh.surface)", "ts.cage(mesh.points, mesh.surface, size='1')",
    "ts.cage(mesh.points, mesh.surface, size=1, cells_across=2)",
    "ts.cage(mesh.points, mesh.surface, cells_across=True)", "ts.cage(None, None, size=1)",
    "ts.cage(mesh.points, mesh.surface, size=-1)",
    # materials
    *(f"ts.{m}('1e6', 0.3, 1000)" for m in MODELS), *(f"ts.{m}(1e6, 0.5, 1000)" for m in MODELS),
    "ts.ViscoElastic(1e6, 0.3, True)", "ts.ViscoElastic(1e6, 0.3, None)",
    "ts.ViscoElastic(1j, 0.3, 1)", "ts.ViscoElastic(1e6, 0.3, 1000, mass='heavy')",
    "ts.NeoHookean(1e6, 0.3, 1000, mass='consistent')", "ts.Linear(1e6, 0.3, 1000, eta=-1)",
    "ts.Linear(1e6, 0.3, 1000, damping_at=5)", "ts.Linear.from_lame(1e6, 'mu', 1000)",
    "setattr(body.model, 'young', 5)", "delattr(body.model, 'young')", "ts.MassSpring()",
    "ts.MassSpring(stiffness='stiff', node_mass=1)", "ts.MassSpring(stiffness=1, node_mass='1')",
    "ts.MassSpring(stiffness=[1, NAN, -1], node_mass=1)",
    "ts.MassSpring(stiffness=1, node_mass=1, springs=[[0, 0]])",
    "ts.MassSpring(young=1e6, density=1, springs=7)",
    "ts.MassSpring(stiffness=1, node_mass=1, springs=[[0, 1.5]])", "ts.RegionMaterial()",
    "ts.RegionMaterial('a')", "ts.RegionMaterial(5, young=1)", "ts.RegionMaterial('a', young='x')",
    "ts.RegionMaterial('a', poisson=0.6)", "ts.RegionMaterial(tag=True, young=1)",
    # selections, pins, loads, obstacles
    "ts.where.box(1, 2)", "ts.where.box((1, 1, 1), (0, 0, 0))", "ts.where.nodes('all')",
    "ts.where.nodes([0.5])", "ts.where.nodes(3)", "ts.where.plane((0, 0, 0), (0, 0, 0))",
    "ts.where.plane(0, 1)", "ts.where.nearest(NAN)", "ts.where.nearest((0, 0))",
    "ts.where.region(None)", "ts.where.named_set(True)", "body.pin('left')", "body.pin(None)",
    "body.pin(LEFT, 'abc')", "body.pin(LEFT, axes=5)", "body.pin(LEFT, velocity=3)",
    "body.pin(LEFT, velocity=(0, 0, '1'))", "body.pin(LEFT, path=[[0, 0, 0]])",
    "body.pin(LEFT, path=[[1, 0, 0, 0], [0, 0, 0, 0]])", "body.pin(LEFT, path=5)",
    "body.pin(LEFT, turn=5)", "body.pin(LEFT, release=-1)", "body.pin(LEFT, release='soon')",
    "body.pin(ts.where.nodes([10**6]))", "body.pin(LEFT, velocity=(1, 0, 0), path=[[0, 0, 0, 0]])",
    "body.load(LEFT)", "body.load(5, force=(1, 0, 0))", "body.load(LEFT, force=5)",
    "body.load(LEFT, force=(1, 0, 0), traction=(1, 0, 0))", "body.load(LEFT, pressure='high')",
    "body.load(LEFT, torque=3)", "body.load(LEFT, force=(1, 0, 0), start=-1)",
    "body.load(LEFT, force=(1, 0, 0), start=2, end=1)", "body.load(LEFT, force=(1, 0, 0), ramp=0)",
    "body.load(LEFT, force=(1, 0, 0), table=[[0]])", "body.load(ts.where.nodes([0]), pressure=1)",
    "ts.Pin(5)", "ts.Load(LEFT)", "ts.Turn(0, 0, 0)", "ts.Turn((0, 0, 0), (0, 0, 1), 'fast')",
    "ts.Torque((0, 0, 0), (0, 0, 0), 1)", "ts.Torque((0, 0, 0), (0, 0, 1), None)", "ts.Plane(0)",
    "ts.Plane(normal=(0, 0, 0))", "ts.Plane(friction=-1)", "ts.Plane(velocity=5)",
    "ts.Plane(turn=5)", "ts.Plane(path=[[0, 0, 0, 0], [0, 1, 1, 1]])", "ts.Sphere((0, 0, 0), 0)",
    "ts.Sphere((0, 0, 0), True)", "ts.Sphere(0, 1)", "ts.Box((0, 0, 0), 1)",
    "ts.Capsule(0, 1, 2)", "ts.Capsule((0, 0, 0), (0, 0, 0), 1)", "ts.Capsule((0, 0, 0), UP, 'r')",
    "ts.Cylinder((0, 0, 0), UP, -1)", "ts.Cylinder(None, UP, 1)", "ts.Shell('a', 'b')",
    "ts.Shell(mesh.points, [[0, 1, 99]])", "ts.Shell(mesh.points, [[0, 1, 2]])",
    "ts.read_shell(None)", "ts.read_shell('nowhere.stl')",
    "ts.Box((0, 0, 0), (1, 1, 0))", "setattr(scene.obstacles[0], 'friction', 1)",
    # scenes and bodies
    "ts.Scene(gravity=9.81)", "ts.Scene(gravity=(0, 0, NAN))", "ts.Scene(gravity=[[0, 0, 0]])",
    "ts.Scene(gravity=[[1, 0, 0, 0], [1, 0, 0, 1]])", "ts.Scene(duration=-1)",
    "ts.Scene(frame_rate='60')", "ts.Scene(step='small')", "ts.Scene(step=0)",
    "ts.Scene(integrator='rk4')", "ts.Scene(start=1)", "ts.Scene(precision=64)",
    "ts.Scene(checkpoint_every=True)", "ts.Scene(camera={})", "ts.Scene(render=None)",
    "ts.Scene(bodies=[5])", "ts.Scene(obstacles=ts.Plane())", "ts.Scene(start='half-step')",
    "scene.add_body(None, None)", "scene.add_body(mesh, 'rubber')",
    "scene.add_body(mesh, RUBBER, 5)", "scene.add_body(mesh, RUBBER, 'beam')",
    "scene.add_body(mesh, RUBBER, velocity=1)", "scene.add_body(mesh, RUBBER, spin=(0, 0, NAN))",
    "scene.add_obstacle('floor')", "scene.add_obstacle(None)", "scene.add_probe(5, body, node=0)",
    "scene.add_probe('tip', body)", "scene.add_probe('tip', 'x', node=0)",
    "scene.add_probe('tip', body, node=10**6)", "scene.add_probe('tip', body, point=1)",
    "scene.add_probe('tip', 5, node=0)", "scene.body('x')", "scene.body(5)", "scene.probed('tip')",
    "setattr(scene, 'gravity', (0, 0, NAN))", "setattr(scene, 'gravity', 'down')",
    "setattr(scene, 'gravty', 0)", "setattr(scene, 'duration', True)",
    "setattr(scene, 'bodies', [mesh])", "scene.bodies.append(mesh)", "scene.obstacles.insert(0, 5)",
    "scene.obstacles.__setitem__(0, 'plane')", "scene.obstacles.extend(5)",
    "scene.obstacles.__iadd__([ts.Plane(), 5])", "scene.probes.append('tip')",
    "scene.no_contact.append(('a', 'b'))", "setattr(body, 'model', 'rubber')",
    "setattr(body, 'velocity', 5)", "setattr(body, 'pins', 5)",
    "setattr(body, 'friction', 'rough')", "setattr(body, 'contact', 'no')",
    "setattr(body, 'thickness', 0)", "setattr(body, 'colour', 'red')",
    "setattr(body, 'skin', mesh)", "body.pins.append('pin')", "body.loads.append(5)",
    "body.regions.append('stiff')", "body.nodes(5)", "body.faces('all')",
    "body.region('stiff', young=1e6)", "body.region('stiff')",
    "ts.Body('b', mesh, RUBBER, pins=[5])", "ts.Body('', mesh, RUBBER)", "ts.NoContact('ab')",
    "ts.NoContact(('a', 5))", "ts.NoContact(('a', 'a'))",
    "ts.Probe('a', 'b')", "ts.Camera(fov=0.5)", "ts.Camera(fov=160)",
    "ts.Camera(eye=5)", "ts.Camera(up=(0, 0, 0))", "ts.Camera(follow=5)", "ts.Camera(turn='slow')",
    "ts.Render(size=100)", "ts.Render(size=(True, 100))", "ts.Render(wireframe='no')",
    "ts.Render(color='red')", "ts.Render(samples=0)", "ts.Render(ground=1)", "ts.load_scene(None)",
    "ts.load_scene('nowhere.toml')", "ts.load_scene(5)",
    # simulations
    "ts.Simulation(None)", "ts.Simulation('nowhere.toml')", "ts.Simulation(ts.Scene())",
    "ts.Simulation(mesh)", "ts.Simulation(object())", "ts.Simulation(scene, threads=-1)",
    "ts.Simulation(scene, threads=True)",
    "ts.Simulation(scene, threads=1.5)", "ts.Simulation(scene, arch='gpu')",
    "ts.Simulation(scene, arch=None)", "ts.Simulation(scene, precision='f16')",
    "ts.Simulation(scene, certify='no')", "ts.Simulation(scene, ledger='no')",
    "ts.Simulation.load(None)", "ts.Simulation.load('nowhere.npz')", "sim.save(None)",
    "sim.save(5)", "sim.frames(NAN)", "sim.frames(float('inf'))", "sim.frames('0.1')",
    "sim.frames(-1)", "sim.frames(True)", "sim.run(-1)", "sim.run('1')", "sim.run(0, observers=5)",
    "sim.run(0, observers=['x'])", "sim.run(0, observers=[None])", "sim.run(0, observers=[Path()])",
    "sim.run(0, observers=[ts.Scene])", "sim.run(0, observers=len)", "sim.positions('beam')",
    "sim.positions(mesh)", "sim.velocities(5)", "sim.forces('x')", "sim.reactions(5)",
    "sim.set_state(None, None)", "sim.set_state(X * NAN, X)", "sim.set_state(X, X * NAN)",
    "sim.set_state(X[1:], X[1:])", "sim.set_state(X + 0j, X)", "sim.set_state('x', X)",
    "sim.set_state(X, 0)", "sim.set_state(X * 1e60, 0 * X)", "sim.set_state(X + 1, 0 * X)",
    "sim.set_state(X > 0, X)", "setattr(sim, 'gravity', (0, 0, 0))", "setattr(sim, 'step', 1e-4)",
    "setattr(sim, 'scene', scene)", "setattr(sim, 'precision', 'f64')",
    "setattr(sim, 'frame_rate', 30)", "setattr(sim, 'ledger', 'yes')",
    "setattr(sim.here(), 'time', 5)", "sim.measures.elements(None)",
    "sim.measures.nodal(body, [1, 2])", "sim.measures.nodal(body, 5)",
    "sim.measures.nodal(body, 'x')", "sim.measures.momentum('beam')",
    "sim.measures.angular_momentum(about=5)", "sim.measures.angular_momentum(about=(0, 0, NAN))",
    "sim.measures.inverted(5)", "sim.modes(0)", "sim.modes(2.5)", "sim.modes(True)",
    "sim.modes(1, about='up')", "sim.modes(1, about=[1, 2])", "sim.modes(1, mass='heavy')",
    "sim.equilibrium(external=5)", "sim.equilibrium(external=X[1:])",
    "sim.equilibrium(external=X * NAN)", "sim.grab(body, [0], [1], 5)",
    "sim.grab('beam', [0], [1], (0, 0, 0))", "sim.grab(body, [0.5], [1], (0, 0, 0))",
    "sim.grab(body, [0], ['1'], (0, 0, 0))", "sim.grab(body, 'all', 1, 1)",
    # views, charts, sweeps
    "ts.view('scene.toml')", "ts.view(None)", "ts.view(scene, port=-1)",
    "ts.view(scene, port=True)",
    "ts.view(scene, color='red')", "ts.view(scene, speed='fast')", "ts.view(scene, speed=0)",
    "ts.view(scene, arch='gpu')", "ts.Simulation(scene, interactive='yes')", "ts.chart(None)",
    "ts.chart('nowhere.toml')", "ts.chart(scene, budget='1')", "ts.chart(scene, budget=-1)",
    "ts.advise(5)", "ts.advise(scene, '2 %')", "ts.advise(scene, 2.0)", "ts.ball(1, 1, split='no')",
    "ts.cylinder(1, 1, 1, split=5)",
    "ts.sweep(None, {'young': [1]})", "ts.sweep(scene, None)", "ts.sweep(scene, {})",
    "ts.sweep(scene, {'yung': [1]})", "ts.sweep(scene, {'young': None})",
    "ts.sweep(scene, {5: [1]})", "ts.sweep(scene, {'young': [1e5]}, workers=0)",
    "ts.sweep(scene, {'young': [1e5]}, random='10')", "ts.sweep(scene, {'young': [1e5]}, seed='x')",
    "ts.sweep(scene, {'young': [1e5]}, output=5)", "ts.sweep(scene, {'young': []})",
    "ts.sweep(scene, {'young': [1e5]}, scheduler=5)",
]  # fmt: skip
RETURNED = ("Advice", "Chart", "Frame", "Sweep", "View")
"""Public names that are made by other public names alone."""
RUBBER = ts.ViscoElastic(1e5, 0.3, 1000.0)
LEFT = ts.where.plane((0, 0, 0), (1, 0, 0))


def told(thing):
    """What an object holds, in words."""
    if isinstance(thing, list):
        return [told(item) for item in thing]
    return {k: told(v) for k, v in vars(thing).items()} if hasattr(thing, "pins") else repr(thing)


@pytest.fixture(scope="module")
def world():
    scene = ts.Scene(duration=0.1, gravity=(0, -9.81, 0))
    body = scene.add_body(ts.box((1, 0.5, 0.5), (2, 1, 1)), RUBBER, "beam")
    body.pin(LEFT)
    scene.add_obstacle(ts.Plane(point=(0, -5, 0)))
    sim = ts.Simulation(scene, threads=1)
    sim.step()
    return {
        **{
            "ts": ts,
            "np": np,
            "Path": Path,
            "NAN": NAN,
            "RUBBER": RUBBER,
            "LEFT": LEFT,
            "UP": (0, 1, 0),
        },
        **{
            "UP": (0, 1, 0),
            "scene": scene,
            "body": body,
            "mesh": body.mesh,
            "sim": sim,
            "X": sim.positions(),
        },
    }


def state(world):
    """All that a wrong call must leave as it is."""
    sim, scene = world["sim"], world["scene"]
    settings = {key: told(value) for key, value in vars(scene).items()}
    return settings, sim.frame, sim.time, sim.ledger, sim.positions().tobytes()


@pytest.mark.parametrize("call", WRONG)
def test_a_wrong_call_is_told_in_a_sentence_and_takes_nothing(world, call):
    before = state(world)
    with pytest.raises(ts.TisoftError) as caught:
        eval(call, world)
    words = str(caught.value)
    assert words and "\n" not in words and len(words) < 400, words
    assert not re.search(r"object at 0x|<class|numpy\.|dtype\(", words), words
    assert state(world) == before


CHANGES = {
    "scene.integrator = 'velocity-verlet'": "integrator",
    "scene.precision = 'f64'": "precision",
    "scene.start = 'half-step'": "start",
    "scene.step = 1.0": "step",
    "scene.gravity = (0, 0, 1e35)": "gravity",
    "scene.bodies.append(ts.Body('new', mesh, RUBBER))": r"body\[1\]",
    "scene.bodies.clear()": r"body\[0\]",
    "scene.probes.append(ts.Probe('tip', 'beam', node=0))": r"probe\[0\]",
    "scene.no_contact.append(ts.NoContact(('a', 'b')))": r"no_contact\[0\]",
    "scene.obstacles.append(ts.Sphere((0, 1e35, 0), 1))": r"obstacle\[1\]",
    "body.mesh = ts.box((1, 1, 1), (1, 1, 1))": r"body\[0\].mesh",
    "body.name = 'log'": r"body\[0\].name",
    "body.velocity = (1, 0, 0)": r"body\[0\].velocity",
    "body.contact = False": r"body\[0\].contact",
    "body.thickness = 0.1": r"body\[0\].thickness",
    "body.model = ts.Linear(1e5, 0.3, 1000.0)": r"body\[0\].model",
    "body.model = ts.ViscoElastic(1e5, 0.3, 1e38)": r"body\[0\] has a mass",
    "body.pins.append(ts.Pin(ts.where.nodes([99])))": r"body\[0\].pin\[1\].where",
    "body.loads.append(ts.Load(ts.where.nodes([0]), pressure=1.0))": r"body\[0\].load\[0\].where",
    "body.regions.append(ts.RegionMaterial('stiff', young=1e6))": r"body\[0\].region\[0\].name",
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_that_is_not_followed_is_refused_by_name(world, change):
    scene, body, sim = world["scene"], world["body"], world["sim"]
    before, shown = state(world), {k: list(v) for k, v in vars(scene).items() if type(v) is not str
                                   and isinstance(v, list)}  # fmt: skip
    kept = {holder: dict(vars(holder)) for holder in (scene, body)}
    lists = {key: list(value) for key, value in vars(body).items() if isinstance(value, list)}
    exec(change, world)
    for _ in range(2):  # and again, not half taken after the first time
        with pytest.raises(FieldError, match=f"^{CHANGES[change]}"):
            sim.step()
    for holder, own in kept.items():
        vars(holder).update(own)
    for holder, own in ((scene, shown), (body, lists)):
        for key, items in own.items():
            getattr(holder, key)[:] = items
    assert state(world) == before
    sim.step()
    sim.set_state(world["X"], 0 * world["X"])


def test_another_frame_rate_goes_on_from_the_present_time(world, tmp_path):
    scene, sim = world["scene"], world["sim"]
    frame, begun = sim.frame, sim.time
    scene.frame_rate = 240.0
    sim.step()
    sim.run(0.05)
    assert sim.frame == frame + 13
    assert sim.time == pytest.approx(begun + 13 / 240, rel=1e-12)
    sim.save(tmp_path / "on.npz")
    other = ts.Simulation.load(tmp_path / "on.npz")
    for one in (sim, other):
        one.step()
    assert sim.time == other.time and (sim.positions() == other.positions()).all()
    scene.frame_rate = 60.0
    sim.step()
    assert sim.time == pytest.approx(begun + 14 / 240 + 1 / 60, rel=1e-12)


def test_the_table_calls_all_public_names():
    """Every function, and every method that takes anything, is called wrongly."""
    calls = " ".join(WRONG)
    for name in set(ts.__all__) - {"where", *RETURNED}:
        thing = getattr(ts, name)
        if inspect.isclass(thing) and issubclass(thing, Exception):
            continue
        assert f"ts.{name}(" in calls, name
    assert len(WRONG) > 250
