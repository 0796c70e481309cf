"""Factorising by dense fronts, against LAPACK."""

import numpy as np
import pytest
from scipy import sparse

import tisoft as ts
from tisoft.equilibrium.at_rest import AtRest
from tisoft.equilibrium.frontal import Dissection, Frontal
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
