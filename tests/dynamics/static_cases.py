"""Bodies and loads that several tests of statics share."""

import numpy as np

import tisoft as ts
from tisoft import where

CLAMP = where.plane((0, 0, 0), (1, 0, 0))


def bar(split, n, model, **scene):
    """Cantilever 1 x .2 x .2 with 10n x 2n x 2n cells, clamped at x = 0."""
    mesh = ts.box((1, 0.2, 0.2), (10 * n, 2 * n, 2 * n), split=split)
    scene = ts.Scene(**{"gravity": (0, 0, -9.81), **scene})
    scene.add_body(mesh, model).pin(CLAMP)
    return scene


def row(mesh, point):
    away = np.linalg.norm(mesh.points - point, axis=1)
    assert away.min() < 1e-9
    return int(away.argmin())


def tip(scene, found):
    mesh = scene.bodies[0].mesh
    k = row(mesh, (1, 0.1, 0.1))
    return found.positions[k] - mesh.points[k]


def face_load(mesh, on_face, traction):
    """Consistent nodal forces of a dead traction [Pa] on the boundary triangles in on_face."""
    forces = np.zeros_like(mesh.points)
    for triangle in mesh.surface[on_face[mesh.surface].all(axis=1)]:
        a, b, c = mesh.points[triangle]
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a))
        forces[triangle] += area / 3.0 * np.asarray(traction)
    return forces


def string(points, stiffness, mass, pins, *, length=None, **scene):
    """Points joined in a row."""
    springs = [[i, i + 1] for i in range(len(points) - 1)]
    rows = springs if length is None else [[i, j, stiffness, length] for i, j in springs]
    model = ts.MassSpring(stiffness=stiffness, node_mass=mass, springs=rows)
    if length is not None:
        model = ts.MassSpring(node_mass=mass, springs=rows)
    scene = ts.Scene(**scene)
    scene.add_body(ts.net(points, springs), model).pin(where.nodes(pins))
    return scene
