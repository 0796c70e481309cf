"""Principal values of symmetric matrices, which bounds of the step are made of, against LAPACK."""

import numpy as np
import pytest
import taichi as ti

from tisoft import runtime
from tisoft.laws import base
from tisoft.laws.neo_hookean import NeoHookean


@pytest.fixture(scope="module")
def found():
    """Matrices, shape (n, 3, 3), and what the laws make of each."""
    runtime.start("cpu")
    rng = np.random.default_rng(4)
    matrices = rng.normal(size=(300, 3, 3)) * 10.0 ** rng.uniform(-3, 3, (300, 1, 1))
    matrices = 0.5 * (matrices + matrices.transpose(0, 2, 1))
    matrices[:100] *= 1e-3 / np.abs(matrices[:100]).max(axis=(1, 2), keepdims=True)
    matrices[-4] = np.diag([2.0, -1.0, -1.0])  # uniaxial
    matrices[-3] = 3.0 * np.eye(3)
    matrices[-2] = 0.0
    matrices[-1] = np.diag([1.0, 1.0, -2.0])
    out = np.zeros((len(matrices), 6))

    @ti.kernel
    def compute(given: ti.types.ndarray(), out: ti.types.ndarray()):
        for n in range(given.shape[0]):
            A = ti.Matrix.zero(ti.f64, 3, 3)
            for r in range(3):
                for c in range(3):
                    A[r, c] = given[n, r, c]
            values = base.eigenvalues(A)
            for k in range(3):
                out[n, k] = values[k]
            out[n, 3] = base.largest_eigenvalue(A)
            out[n, 4] = base.stretch_square(A)
            out[n, 5] = base.least_square(A)

    compute(matrices, out)
    return matrices, out


def test_eigenvalues_are_those_of_lapack(found):
    matrices, out = found
    size = np.abs(matrices).max(axis=(1, 2))[:, None] + 1e-300
    exact = np.linalg.eigvalsh(matrices)[:, ::-1]
    # 1.2e-7: numbers written in kernels, as 2π/3, have the digits of f32.
    assert out[:, :3] / size == pytest.approx(exact / size, abs=1.2e-7)


def test_the_largest_is_bounded_and_exact_where_two_are_alike(found):
    matrices, out = found
    most = np.linalg.eigvalsh(matrices)[:, 2]
    size = np.abs(matrices).max(axis=(1, 2))
    assert (out[:, 3] >= most - 1e-12 * size).all()
    assert (out[:, 3] <= most + 0.5 * np.ptp(np.linalg.eigvalsh(matrices), axis=1)).all()
    assert out[-4:-1, 3] == pytest.approx([2.0, 3.0, 0.0], abs=1e-12)


def test_squares_of_stretches_enclose_those_of_the_strain(found):
    strains, out = found
    squares = 1.0 + 2.0 * np.linalg.eigvalsh(strains)  # of FᵀF = 1 + 2E
    sound = squares[:, 0] > 0.0
    assert sound.sum() > 100
    assert (out[sound, 4] >= squares[sound, 2] - 1e-9).all()
    assert (out[sound, 5] <= np.maximum(squares[sound, 0], 0.01) + 1e-9).all()
    near = np.abs(strains[:100]).max(axis=(1, 2)) <= 1.001e-3
    assert near.all() and np.abs(out[:100, 4:] - 1.0).max() < 0.01


def test_the_neo_hookean_bound_encloses_the_tangent_and_is_near_it():
    """Growth b ≥ λ_max(A(U) − A(I)) for stretches U in any directions, and little above it."""
    rng = np.random.default_rng(5)
    turned = np.linalg.qr(rng.normal(size=(200, 3, 3)))[0]
    stretches = rng.uniform(0.5, 1.8, (200, 3))
    given = np.einsum("nij,nj,nkj->nik", turned, stretches, turned) - np.eye(3)
    given[0] = 0.0
    tangents, growth = np.zeros((200, 9, 9)), np.zeros(200)
    constants = NeoHookean.constants(3e4, 2e4)

    @ti.kernel
    def compute(given: ti.types.ndarray(), tangents: ti.types.ndarray(), out: ti.types.ndarray()):
        m = ti.Vector([ti.cast(c, ti.f64) for c in ti.static(constants)])
        for n in range(given.shape[0]):
            H = ti.Matrix.zero(ti.f64, 3, 3)
            for r in range(3):
                for c in range(3):
                    H[r, c] = given[n, r, c]
            out[n] = NeoHookean.stiffening(H, m)[1]
            for k in range(9):
                G = ti.Matrix.zero(ti.f64, 3, 3)
                G[k // 3, k % 3] = 1.0
                A = NeoHookean.tangent(H, G, m)
                for r in range(3):
                    for c in range(3):
                        tangents[n, 3 * r + c, k] = A[r, c]

    compute(given, tangents, growth)
    exact = np.linalg.eigvalsh(tangents - tangents[0])[:, -1]
    stiffer = exact > 1e3
    assert stiffer.sum() > 50
    assert (growth >= exact - 1e-3).all()
    ratio = growth[stiffer] / exact[stiffer]
    assert np.median(ratio) < 1.01
