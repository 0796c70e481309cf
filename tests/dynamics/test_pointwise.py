"""Statics of tets looks at the law alone: the same operators as kernels of the whole element."""

import numpy as np
import pytest

import tisoft as ts
from tisoft.equilibrium.at_rest import AtRest
from tisoft.equilibrium.operators import Elastic
from tisoft.equilibrium.pointwise import Pointwise
from tisoft.geometry.solid import quadratic
from tisoft.model.part import parts_of

MESH = ts.box((1.0, 0.3, 0.2), (3, 1, 1))
LAW = ts.ViscoElastic(1e6, 0.4, 1000.0, phi=70.0, eta=30.0)


def part_of(mesh):
    scene = ts.Scene()
    scene.add_body(mesh, LAW)
    return parts_of(scene.bodies)[0]


def same(ours, theirs):
    return ours == pytest.approx(theirs, rel=1e-12, abs=1e-12 * np.abs(theirs).max())


def test_operators_are_those_of_the_elements_to_rounding():
    part = part_of(MESH)
    whole, apart = Elastic(part), Pointwise(part)
    u, w = 0.02 * np.random.default_rng(0).standard_normal((2, whole.nodes, 3))
    assert same(apart.force(u), whole.force(u))
    assert same(apart.energy(u), whole.energy(u))
    assert same(apart.stiffness_times(w, u), whole.stiffness_times(w, u))
    assert same(apart.stiffness(u).toarray(), whole.stiffness(u).toarray())
    assert same(apart.stiffness_blocks(u), whole.stiffness_blocks(u))
    assert same(apart.viscosity_times(w, u), whole.viscosity_times(w, u))


def test_quadratic_tets_derive_from_one_energy_and_start_from_hookes_law():
    part = part_of(quadratic(MESH))
    apart = Pointwise(part)
    u, w = 0.02 * np.random.default_rng(1).standard_normal((2, apart.nodes, 3))
    h = 1e-5
    slope = (apart.energy(u + h * w) - apart.energy(u - h * w)) / (2.0 * h)
    assert slope == pytest.approx(-(apart.force(u) * w).sum(), rel=1e-7)
    bend = (apart.force(u - h * w) - apart.force(u + h * w)) / (2.0 * h)
    product = apart.stiffness_times(w, u)
    assert bend == pytest.approx(product, abs=1e-7 * np.abs(product).max())
    assert same((apart.stiffness(u) @ w.ravel()).reshape(-1, 3), product)
    assert same(apart.stiffness(0.0 * u).toarray(), AtRest(part).stiffness().toarray())
