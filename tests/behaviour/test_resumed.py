"""A run that goes on from a checkpoint takes the steps, and the frames back, that it would have.

In these scenes the step changes and the guard has work to do, so what they remember counts: the
last sharp limit, the steps that served, the energy that the scene began with.
"""

import numpy as np

import tisoft as ts


def swinging_bar():
    """A bar that swings so far that its step falls, and comes to rest, so that it rises again."""
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64", frame_rate=8.0)
    mesh = ts.box(size=(1.0, 0.1, 0.1), cells=(40, 1, 1))
    body = scene.add_body(mesh, ts.ViscoElastic(1e4, 0.0, 1000.0, point_damping=0.6))
    body.pin(ts.where.everything(), axes="yz")
    body.pin(ts.where.box((-1e-6, -9, -9), (1e-6, 9, 9)), axes="x")
    end = ts.where.box((1 - 1e-6, -9, -9), (9, 9, 9))
    body.pin(end, axes="x", path=[(0, 0, 0, 0), (2, 0.4, 0, 0)], release=2.0)
    return scene


def unstable_star():
    """A node thrown out between four springs, 1.8 % above the limit of that state: the guard takes
    back what grew too far beyond the start.
    """
    step = 0.72 * 2.0 / np.sqrt(200.0 / 0.01)
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64", step=step, frame_rate=1.0 / (3 * step))
    ends = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]
    net = ts.net([[0, 0, 0], *ends], [[0, k] for k in range(1, 5)])
    model = ts.MassSpring(stiffness=100.0, node_mass=0.01)
    scene.add_body(net, model, velocity=(0, 0, 2000.0)).pin(ts.where.nodes([1, 2, 3, 4]))
    return scene


def assert_goes_on_alike(scene, cuts, frames, folder):
    """Cut at each of these frames and resumed, the run is the uninterrupted one, bit by bit."""
    whole = ts.Simulation(scene(), threads=1)
    saved = {}
    for frame in range(1, frames + 1):
        whole.step()
        if frame in cuts:
            saved[frame] = folder / f"{frame}.npz"
            whole.save(saved[frame])
    for frame, path in saved.items():
        resumed = ts.Simulation.load(path)
        assert resumed.frame == frame
        for _ in range(frames - frame):
            resumed.step()
        assert resumed.steps == whole.steps
        assert resumed.recoveries == whole.recoveries
        assert resumed.substeps == whole.substeps
        np.testing.assert_array_equal(resumed.positions(), whole.positions())
        np.testing.assert_array_equal(resumed.velocities(), whole.velocities())
    return whole


def test_a_step_that_falls_and_rises_again(tmp_path):
    whole = assert_goes_on_alike(swinging_bar, (10, 200), 420, tmp_path)
    steps = np.array(whole.steps)
    assert (steps[1:] < 0.95 * steps[:-1]).any() and (steps[1:] > 1.02 * steps[:-1]).any()


def test_a_guard_that_remembers_how_the_scene_began(tmp_path):
    whole = assert_goes_on_alike(unstable_star, (3, 9), 40, tmp_path)
    assert len(whole.recoveries) > 10
