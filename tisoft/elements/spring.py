# mypy: ignore-errors
"""Spring between nodes i and j, with a damper along it (Choi's lecture on mass-spring systems).

    f_i = (k e + c ν) y/L,   f_j = −f_i
    y = d + Δ,   d = X_j − X_i,   Δ = u_j − u_i,   L = |y|,   e = L − L₀,   ν = (v_j − v_i)·y/L
    energy k e²/2,   (K w)_i = [k n nᵀ + T/L (1 − n nᵀ)] (w_i − w_j),   n = y/L,  T = k e

The elongation is computed as e = (2 d·Δ + |Δ|²)/(L + l) + (l − L₀) with l = |d|, which keeps its
digits at small strains.

| symbol | name        | unit  |
| ------ | ----------- | ----- |
| d      | `rest[0..2]` | m     |
| l      | `rest[3]`   | m     |
| l − L₀ | `rest[4]`   | m     |
| k, c   | `rest[5]`, `rest[6]` | N/m, N·s/m |

With masses shared out by stiffness its stiffest mode is ω² ≤ K_i/m_i + K_j/m_j, K_i the sum of the
stiffnesses at node i; neither compression nor tension makes a spring stiffer than k.
"""

import numpy as np
import taichi as ti
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Spring:
    """A spring and the damper beside it."""

    corners = 2
    points = 1
    rows = 6
    stresses = 0
    known = 4
    constants = 0
    numbers = 7
    is_relative = False
    """Whether its energy wants displacements as seen from one of its body\'s nodes."""

    @staticmethod
    def rest(points: Floats, cells: NDArray[np.integer], numbers: Floats) -> Floats:
        """`rest` of each spring, shape (springs, 7), from rest points [m] and rows k, L₀, c."""
        d = points[cells[:, 1]] - points[cells[:, 0]]
        length = np.linalg.norm(d, axis=1)
        k, natural, c = numbers.T
        return np.column_stack([d, length, length - natural, k, c])

    @staticmethod
    @ti.func
    def stretched(rest: ti.template(), u: ti.template(), lane):
        """y [m] of the spring, and Δ."""
        change = ti.Vector([u[3 + d, lane] - u[d, lane] for d in range(3)])
        return ti.Vector([rest[d, lane] for d in range(3)]) + change, change

    @staticmethod
    @ti.func
    def elongation(rest: ti.template(), change, length, lane):
        """e = L − L₀ [m]."""
        d = ti.Vector([rest[k, lane] for k in range(3)])
        grown = (2.0 * d + change).dot(change) / ti.max(length + rest[3, lane], 1e-30)
        return grown + rest[4, lane]

    @staticmethod
    @ti.func
    def inverse(length):
        """1/L [1/m]; 0 of a spring without length, which has no direction."""
        result = 0.0 * length
        if length > 0.0:
            result = 1.0 / length
        return result

    @staticmethod
    @ti.func
    def pull(f, first: ti.template(), lane, out: ti.template()):
        """f on end i and −f on end j, into rows of `out` from `first` on."""
        for d in ti.static(range(3)):
            out[first + d, lane] = f[d]
            out[first + 3 + d, lane] = -f[d]

    @staticmethod
    @ti.func
    def forces(
        law: ti.template(),
        rest: ti.template(),
        u: ti.template(),
        v: ti.template(),
        m,
        q,
        lane,
        out: ti.template(),
    ):
        """Forces on the ends [N]; rows 6..11 of `out`, where it has them, get the damper's."""
        y, change = Spring.stretched(rest, u, lane)
        length = y.norm()
        inverse = Spring.inverse(length)
        tension = rest[5, lane] * Spring.elongation(rest, change, length, lane)
        rate = ti.Vector([v[3 + d, lane] - v[d, lane] for d in range(3)]).dot(y) * inverse
        damping = rest[6, lane] * rate
        tension += damping
        if ti.static(out.n > 6):
            Spring.pull(damping * inverse * y, 6, lane, out)
        Spring.pull(tension * inverse * y, 0, lane, out)

    @staticmethod
    def of_material(lam: float, mu: float) -> tuple[float, ...]:
        """It needs no constants of its own."""
        return ()

    @staticmethod
    @ti.func
    def energy(law: ti.template(), rest: ti.template(), u: ti.template(), m, q, lane):
        """k e²/2 [J]."""
        y, change = Spring.stretched(rest, u, lane)
        e = Spring.elongation(rest, change, y.norm(), lane)
        return 0.5 * rest[5, lane] * e * e

    @staticmethod
    @ti.func
    def product(
        law: ti.template(),
        rest: ti.template(),
        u: ti.template(),
        w: ti.template(),
        m,
        q,
        lane,
        out: ti.template(),
    ):
        """K(u) w [N]."""
        y, change = Spring.stretched(rest, u, lane)
        length = y.norm()
        inverse = Spring.inverse(length)
        k = rest[5, lane]
        pull = k * Spring.elongation(rest, change, length, lane) * inverse  # T/L
        n = inverse * y
        across = ti.Vector([w[d, lane] - w[3 + d, lane] for d in range(3)])
        along = n.dot(across)
        Spring.pull(pull * (across - along * n) + k * along * n, 0, lane, out)


def frequencies(
    springs: NDArray[np.integer], numbers: Floats, inverse_mass: Floats
) -> tuple[Floats, Floats]:
    """ω² [1/s²] and damping rate [1/s] of each spring's bound; `numbers` has columns k, L₀, c."""
    nodes = len(inverse_mass)
    share = []
    for column in (0, 2):
        total = np.bincount(springs.ravel(), np.repeat(numbers[:, column], 2), minlength=nodes)
        share.append((total * inverse_mass)[springs].sum(axis=1))
    return share[0], share[1]
