"""Bodies that differ in place only are looked at once."""

from dataclasses import replace

import numpy as np
import pytest

import tisoft as ts
from tisoft.model.part import parts_of
from tisoft.stable import limit
from tisoft.stable.sharp import sharp_limit
from tisoft.stable.twins import first_twins

SOFT = ts.ViscoElastic(1e5, 0.3, 1000.0, phi=10.0, eta=10.0)
BOX = ts.box((0.3, 0.2, 0.1), (3, 2, 1))


def twins(*bodies):
    scene = ts.Scene()
    for mesh, model in bodies:
        scene.add_body(mesh, model)
    return [part.index for part in first_twins(parts_of(scene.bodies))]


def turned(mesh, k):
    return mesh.transformed(rotate=(31 * k, 17 * k, 45 * k), translate=(k, 2 * k, -k))


def test_turned_and_moved_bodies_are_twins_and_others_are_not():
    stiffer = ts.ViscoElastic(2e5, 0.3, 1000.0, phi=10.0, eta=10.0)
    bent = replace(BOX, points=BOX.points + 1e-6 * np.sin(9 * BOX.points))
    other = ts.box((0.3, 0.2, 0.1), (3, 1, 2))
    assert twins(
        (BOX, SOFT), (turned(BOX, 1), SOFT), (BOX, stiffer), (bent, SOFT), (other, SOFT),
        (turned(BOX, 2), stiffer), (turned(bent, 3), SOFT),
    ) == [0, 0, 2, 3, 4, 2, 3]  # fmt: skip


def test_a_net_out_of_its_plane_is_no_twin_of_a_flat_one():
    """Springs' lengths alone do not tell: one square folded up is joined as before."""
    model = ts.MassSpring(stiffness=100.0, node_mass=0.01)
    corners = np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    joined = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2)]
    net, folded = ts.net(corners, joined), corners + 0.0
    folded[3] = 0.5, 0.5, np.sqrt(0.5)  # as far from 2 and 0 as before
    bent = ts.net(folded, joined)
    assert twins((net, model), (turned(net, 1), model), (bent, model)) == [0, 0, 2]


def test_a_pinned_body_is_nobodys_twin():
    scene = ts.Scene()
    for k in range(2):
        scene.add_body(turned(BOX, k), SOFT).pin(ts.where.nodes([0]))
    assert [part.index for part in first_twins(parts_of(scene.bodies))] == [0, 1]


def test_twins_have_the_limit_of_the_first_which_is_their_own(monkeypatch):
    asked = []

    def noted(part, **options):
        asked.append(part.index)
        return sharp_limit(part, **options)

    monkeypatch.setattr(limit, "sharp_limit", noted)
    scene = ts.Scene()
    for k in range(3):
        scene.add_body(turned(BOX, k), SOFT)
    sim = ts.Simulation(scene, threads=1)
    together = sim.limit.sharp()
    assert asked == [0]
    own = [sharp_limit(part, integrator="symplectic-euler").step for part in sim.parts]
    assert [together] * 3 == pytest.approx(own, rel=2e-3)
