"""Helpers of the tests where methods fail."""

import numpy as np

import tisoft as ts
from tisoft.simulation import Simulation

CLAMP = ts.where.box((-1e-6, -9, -9), (1e-6, 9, 9))
ROUND = np.random.default_rng(5)


def scene_of(mesh, model, *, pinned=None, gravity=(0, 0, 0), **settings):
    scene = ts.Scene(gravity=gravity, **settings)
    body = scene.add_body(mesh, model)
    if pinned is not None:
        body.pin(pinned)
    return scene


def beam(cells=(6, 2, 2), size=(1, 0.2, 0.2)):
    return ts.box(size=size, cells=cells)


def raw(scene, step, substeps, *, x=None, v=None, nudge=1e-9, chunk=20):
    """Run uncertified; the largest displacement [m] after each chunk, inf where not finite."""
    scene.step, scene.frame_rate = step, 1.0 / (chunk * step)
    sim = Simulation(scene, certify=False, precision="f64", threads=1)
    start = sim.positions() if x is None else x
    rest = sim.positions()
    random = np.random.default_rng(1).standard_normal(rest.shape)
    moving = sim.holder.held[_ranks(sim)] == 0
    start = start + nudge * random * moving[:, None]
    sim.set_state(start, np.zeros_like(rest) if v is None else v)
    seen = []
    with np.errstate(all="ignore"):
        for _ in range(-(-substeps // chunk)):
            sim.step()
            far = np.abs(sim.positions() - start).max()
            seen.append(far if np.isfinite(far) else np.inf)
            if not seen[-1] < 1e6:
                break
    return np.array(seen)


def _ranks(sim):
    return np.concatenate([part.start + part.rank for part in sim.parts])


def certified(scene, seconds, **options):
    """Run as users do; the simulation at its end, every frame seen finite."""
    sim = Simulation(scene, **options)
    for frame in sim.frames(seconds):
        assert np.isfinite(frame.positions()).all()
        assert np.isfinite(frame.velocities()).all()
    return sim


def inverted(sim):
    """Number of tets turned inside out."""
    count = 0
    for part in sim.parts:
        x = sim.positions(part.body)
        corners = x[part.body.mesh.tets]
        count += int((np.linalg.det(corners[:, 1:] - corners[:, :1]) <= 0.0).sum())
    return count
