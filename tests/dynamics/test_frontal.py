"""Factorising by dense fronts, against LAPACK."""

import numpy as np
import pytest
from scipy import sparse
from surfaces import block

import tisoft as ts
from tisoft.equilibrium import frontal
from tisoft.equilibrium.at_rest import AtRest
from tisoft.equilibrium.frontal import Dissection, Frontal
from tisoft.equilibrium.held import Held
from tisoft.geometry.cage.build import caged
from tisoft.geometry.cage.lattice import Lattice
from tisoft.model.part import parts_of


@pytest.mark.parametrize("shift", [1.0, -0.02, -0.3])
def test_fronts_solve_and_count_negative_eigenvalues_as_lapack_does(shift):
    """Of K + s diag K, definite and not; fronts of a few nodes, so that all kinds occur."""
    scene = ts.Scene()
    scene.add_body(ts.box(size=(3, 1, 1), cells=(6, 2, 2)), ts.ViscoElastic(1e4, 0.3, 1e3))
    (part,) = parts_of(scene.bodies)
    stiffness = AtRest(part).stiffness()
    matrix = (stiffness + shift * sparse.diags(stiffness.diagonal())).tocsc()
    nodes = np.arange(matrix.shape[0]) // 3
    whole = matrix.toarray()
    rng = np.random.default_rng(1)
    right = rng.normal(size=len(whole))
    for leaf in (3, 1000):
        dissection = Dissection(matrix, nodes, part.rest, leaf)
        assert (len(dissection.fronts) > 10) == (leaf == 3)
        found = Frontal(dissection, matrix)
        solved = np.linalg.solve(whole, right)
        assert found.solve(right) == pytest.approx(
            solved, rel=1e-8, abs=1e-8 * np.abs(solved).max()
        )
        assert found.negative == int((np.linalg.eigvalsh(whole) < 0.0).sum())
    with pytest.raises(RuntimeError):
        Frontal(dissection, matrix * np.nan)


def test_fronts_solve_for_bodies_of_which_patches_are_held(monkeypatch):
    """A cage, whose pin holds means of its nodes: unknowns are tied to one another there."""
    monkeypatch.setattr(frontal, "WORTHWHILE", 0)
    scene = ts.Scene()
    lattice = Lattice(np.eye(3), np.array([-0.03, 0, 0]), np.full(3, 0.1), np.array([11, 2, 2]))
    shifted = caged(*block((1.0, 0.2, 0.2)), lattice)
    body = scene.add_body(shifted, ts.Linear(1e6, 0.3, 1e3))
    body.pin(ts.where.box((-1e-6, -1, -1), (1e-6, 1, 1)))
    (part,) = parts_of(scene.bodies)
    held = Held(part, 0.0)
    assert held.patches
    matrix = held.on_unknowns(AtRest(part).stiffness())
    right = np.random.default_rng(1).normal(size=matrix.shape[0])
    factor, negative = frontal.factorised(matrix, held)
    assert isinstance(factor, Frontal) and len(held.dissection.fronts) > 2 and negative == 0
    assert matrix @ factor.solve(right) == pytest.approx(right, abs=1e-7)
