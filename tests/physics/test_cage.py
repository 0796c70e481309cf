"""Cages around a ball and a beam, beside what they stand for, digit for digit as measured.

Lamb (1882) for the ball; REFERENCES A3 for the beam.  Stiffness matrices of NumPy: that the kernels
have the same is in tests/elements.
"""

import numpy as np
import pytest
from scipy.sparse import coo_array, diags
from scipy.sparse.linalg import eigsh
from surfaces import block, sphere

import tisoft as ts
from tisoft.model.part import parts_of

TORSIONAL, SPHEROIDAL = 12.343553, 13.059571
"""Lowest two frequencies of a ball of .2 m, E = 1e5, ν = .3, ρ = 1000 [Hz], five of each."""
FIRST = 0.9995
"""Of the beam, 1 × .2 × .2 m, E = 1e6 [Hz]."""


def matrices(mesh, young):
    """Nodes, K [N/m] and masses of the components [kg], and the guaranteed bound of ω² [1/s²]."""
    scene = ts.Scene()
    model = ts.Linear(young, 0.3, 1000.0)
    scene.add_body(mesh, model)
    (part,) = parts_of(scene.bodies)
    (cells,) = part.solids
    each = cells.matrices(model.lame_lambda, model.lame_mu)
    own = (3 * cells.nodes[:, :, None] + np.arange(3)).reshape(len(each), 24)
    rows, columns = np.repeat(own, 24, axis=1).ravel(), np.tile(own, (1, 24)).ravel()
    K = coo_array((each.ravel(), (rows, columns))).tocsc()
    return mesh.points[part.order], K, np.repeat(part.mass, 3), cells.known()[:, 0].max()


def frequencies(K, mass, count):
    shift = -1e-4 * K.diagonal().max() / mass.max()
    found = eigsh(K, count, M=diags(mass).tocsc(), sigma=shift, return_eigenvectors=False)
    return np.sqrt(np.abs(np.sort(found))) / (2 * np.pi)


@pytest.mark.parametrize(
    "across, elements, torsional, spheroidal, inertia",
    [(6, 184, -6.8, -3.3, 0.037), (10, 696, -1.3, -0.6, 0.0)],
)
def test_a_caged_ball_rings_as_measured(across, elements, torsional, spheroidal, inertia):
    mesh = ts.cage(*sphere(0.2, 50), cells_across=across)
    assert mesh.elements == elements
    assert mesh.cage.inertia_error == pytest.approx(inertia, abs=5e-4)
    _, K, mass, bound = matrices(mesh, 1e5)
    found = frequencies(K, mass, 16)[6:]
    assert 100 * (found[:5].mean() / TORSIONAL - 1) == pytest.approx(torsional, abs=0.3)
    assert 100 * (found[5:].mean() / SPHEROIDAL - 1) == pytest.approx(spheroidal, abs=0.3)
    root = diags(1 / np.sqrt(mass))
    limit = eigsh(root @ K @ root, 1, return_eigenvectors=False)[0]
    assert 0.55 * np.sqrt(bound) < np.sqrt(limit) <= np.sqrt(bound)


@pytest.mark.parametrize("across, error", [(2, 0.6), (3, 0.7), (4, 0.5)])
def test_a_caged_beam_is_the_beam_of_hexes(across, error):
    x, K, mass, _ = matrices(ts.cage(*block((1.0, 0.2, 0.2)), cells_across=across), 1e6)
    free = np.repeat(x[:, 0] > 1e-9, 3)
    found = frequencies(K[free][:, free], mass[free], 1)[0]
    assert 100 * (found / FIRST - 1) == pytest.approx(error, abs=0.1)
