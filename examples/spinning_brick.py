"""A soft brick spins freely about its middle axis, flips over again and again, and loses nothing.

    python examples/spinning_brick.py

Rotation about the middle axis of a brick is unstable (Euler): it turns over, while its angular
momentum stays where it was.  The script checks that, and writes spinning_brick.mp4.
"""

import numpy as np

import tisoft as ts
from tisoft.observers.film import film_to

SIDES = (0.1, 0.5, 0.3)  # of least inertia about y, of most about x: z is the middle axis


def make_scene() -> ts.Scene:
    """A brick in empty space, with a spin that is off its middle axis by a little."""
    scene = ts.Scene(gravity=(0, 0, 0), duration=6.0, frame_rate=30.0)
    scene.render = ts.Render(size=(960, 540), color="body", wireframe=True)
    mesh = ts.box(size=SIDES, cells=(3, 15, 9)).transformed(translate=[-s / 2 for s in SIDES])
    scene.add_body(mesh, ts.ViscoElastic(3e5, 0.3, 1000.0), "brick", spin=(0.1, 0.1, 12.0))
    scene.camera = ts.Camera(eye=(0.9, 0.6, 1.4), target=(0, 0, 0), up=(0, 1, 0))
    return scene


class Watch:
    """Angular momentum about the centre of mass, and which way the brick's middle axis points."""

    def __init__(self) -> None:
        self.momentum: list[np.ndarray] = []
        self.middle_axis: list[float] = []

    def on_frame(self, frame: ts.Frame) -> None:
        mass = frame.simulation.masses()[:, None]
        x, v = frame.positions(), frame.velocities()
        x = x - (mass * x).sum(axis=0) / mass.sum()
        self.momentum.append((mass * np.cross(x, v)).sum(axis=0))
        rest = frame.simulation.scene.bodies[0].mesh.points
        turned = (mass * rest[:, 2:]).T @ x  # the rest shape's z, as the brick carries it
        self.middle_axis.append(float(turned[0, 2] / np.linalg.norm(turned)))


def main() -> None:
    scene = make_scene()
    watch = Watch()
    with film_to("spinning_brick.mp4", scene) as film:
        ts.Simulation(scene).run(observers=[watch, film])
    momentum = np.array(watch.momentum)
    drift = np.linalg.norm(momentum - momentum[0], axis=1).max() / np.linalg.norm(momentum[0])
    flips = int((np.diff(np.sign(watch.middle_axis)) != 0).sum())
    print(f"the brick flipped {flips} times; its angular momentum moved by {drift:.1e} of itself")
    assert flips >= 2, "a rotation about the middle axis must not be stable"
    assert drift < 1e-4, "nothing outside the brick may turn it"


if __name__ == "__main__":
    main()
