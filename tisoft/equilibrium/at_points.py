# mypy: ignore-errors
"""Kernels that look at a law alone: P, Ψ, ∂P/∂F and ∂P_v/∂Ḣ at many H."""

import taichi as ti

A = ti.types.ndarray()


@ti.func
def read(H: ti.template(), k):
    """H of point k."""
    return ti.Matrix([[H[k, 3 * r + c] for c in range(3)] for r in range(3)])


def law_kernel(law, what: str, columns: int):
    """The kernel (H, material, out) of "stress", "energy", "tangent" or "rate" of a law.  (ndarrays
    tell no kernel how many columns they have.)

    H has shape (points, 9), the material (points, constants), of a rate (points, 2); `out`
    (points, 9), (points, 1) or (points, 81), row by row.
    """

    @ti.kernel
    def stress(H: A, material: A, out: A):
        for k in range(H.shape[0]):
            m = ti.Vector([material[k, c] for c in range(columns)])
            P = law.stress(read(H, k), m)
            for r in ti.static(range(3)):
                for c in ti.static(range(3)):
                    out[k, 3 * r + c] = P[r, c]

    @ti.kernel
    def energy(H: A, material: A, out: A):
        for k in range(H.shape[0]):
            m = ti.Vector([material[k, c] for c in range(columns)])
            out[k, 0] = law.energy(read(H, k), m)

    @ti.kernel
    def derivative(H: A, material: A, out: A):
        for k in range(H.shape[0]):
            m = ti.Vector([material[k, c] for c in range(columns)])
            own = read(H, k)
            for column in range(9):
                G = 0.0 * own
                for r in ti.static(range(3)):
                    for c in ti.static(range(3)):
                        G[r, c] = ti.select(column == 3 * r + c, m[0] * 0.0 + 1.0, m[0] * 0.0)
                P = 0.0 * own
                if ti.static(what == "rate"):
                    P = law.viscosity.stress(own, G, m[0], m[1])
                else:
                    P = law.tangent(own, G, m)
                for r in ti.static(range(3)):
                    for c in ti.static(range(3)):
                        out[k, 9 * (3 * r + c) + column] = P[r, c]

    return {"stress": stress, "energy": energy, "tangent": derivative, "rate": derivative}[what]
