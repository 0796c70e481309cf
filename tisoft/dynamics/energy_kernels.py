# mypy: ignore-errors
"""Kernels of energies: one number per tet or spring, in the precision of their rest data."""

import taichi as ti

from tisoft.models.laws import energy_density

A = ti.types.ndarray


@ti.kernel
def tet_energies(
    law: ti.template(),
    tets: A(),
    gradient: A(),
    volume: A(),
    numbers: A(),
    u: A(),
    energy: A(),
):
    """Elastic energy of each tet [J]; `numbers` holds λ' and μ' of its law."""
    for e in range(tets.shape[0]):
        N = ti.Matrix([[gradient[e, c, d] for d in range(3)] for c in range(3)])
        i = tets[e, 0]
        # The small difference is exact enough in f32; what follows is f64 as N is.
        du = ti.Matrix([[u[tets[e, c + 1], d] - u[i, d] for c in range(3)] for d in range(3)])
        H = du @ N
        energy[e] = volume[e] * energy_density(law, H, numbers[0], numbers[1])


@ti.kernel
def spring_energies(ends: A(), vectors: A(), numbers: A(), u: A(), energy: A()):
    """Elastic energy k (L − L₀)²/2 of each spring [J]; `numbers` holds k and L₀."""
    for s in range(ends.shape[0]):
        i, j = ends[s, 0], ends[s, 1]
        d = ti.Vector([vectors[s, 0], vectors[s, 1], vectors[s, 2]])
        change = ti.Vector([u[j, 0] - u[i, 0], u[j, 1] - u[i, 1], u[j, 2] - u[i, 2]])
        y = d + change
        rest = d.norm()
        stretch = (2.0 * d.dot(change) + change.dot(change)) / (y.norm() + rest)
        e = stretch + (rest - numbers[s, 1])
        energy[s] = 0.5 * numbers[s, 0] * e * e
