"""A law of one's own: a compressible Yeoh solid, which stiffens in large stretches.

    Ψ = μ/2 i + c i² − μ (J − 1) + λ'/2 (J − 1)²,   i = tr FᵀF − 3,  c = μ/20,  λ' = λ + μ − 8c
    P = (μ + 4c i) F + (λ' (J − 1) − μ) cof F
                                    (after Yeoh 1993: a polynomial in the first invariant)

Small strains see λ and μ.  Run it (`python examples/yeoh.py`) and it pulls a cube beside a
neo-Hookean one: the Yeoh cube pulls back harder, the further the more.

| symbol   | name            | unit |
| -------- | --------------- | ---- |
| λ', μ, c | m[0], m[1], m[2] | Pa  |
"""

import tisoft as ts  # before Taichi: it keeps Taichi's banner down
from tisoft.laws import LAWS
from tisoft.laws.base import (
    cofactor,
    cofactor_change,
    cofactor_rate,
    contracted,
    diagonal,
    green_strain,
    stretch_square,
    volume_change,
)
from tisoft.laws.viscous import GreenRate
from tisoft.models.materials import model_of
from tisoft.runtime import import_taichi

ti = import_taichi()


class Law:
    """The five members of a law, see `tisoft.laws.base`."""

    is_finite = True
    viscosity = GreenRate

    @staticmethod
    def constants(lame_lambda, lame_mu):
        """λ', μ and c [Pa]."""
        c = lame_mu / 20.0
        return lame_lambda + lame_mu - 8.0 * c, lame_mu, c

    @staticmethod
    @ti.func
    def stress(H, m):
        """P [Pa]."""
        K = cofactor(H)
        i, j = 2.0 * H.trace() + contracted(H, H), volume_change(H, K)
        turned = cofactor_change(H, K)  # cof F − I
        even = diagonal(4.0 * m[2] * i + m[0] * j)
        return even + (m[1] + 4.0 * m[2] * i) * H + (m[0] * j - m[1]) * turned

    @staticmethod
    @ti.func
    def energy(H, m):
        """Ψ [J/m³]."""
        i, j = 2.0 * H.trace() + contracted(H, H), volume_change(H, cofactor(H))
        return 0.5 * m[1] * i + m[2] * i * i - m[1] * j + 0.5 * m[0] * j * j

    @staticmethod
    @ti.func
    def tangent(H, G, m):
        """∂P/∂F : G [Pa]."""
        K = cofactor(H)
        cof = diagonal(0.0 * m[0] + 1.0) + cofactor_change(H, K)
        i, j = 2.0 * H.trace() + contracted(H, H), volume_change(H, K)
        grown = 2.0 * (G.trace() + contracted(H, G))
        spread = diagonal(G.trace()) - G.transpose() + cofactor_rate(H, G)
        pulled = (m[1] + 4.0 * m[2] * i) * G + 4.0 * m[2] * grown * (diagonal(1.0 + 0.0 * i) + H)
        return pulled + m[0] * contracted(cof, G) * cof + (m[0] * j - m[1]) * spread

    @staticmethod
    @ti.func
    def stiffening(H, m):
        """A bound of |∂P/∂F − that at rest| [Pa]."""
        K = cofactor(H)
        change, size = ti.sqrt(contracted(H, H)), ti.sqrt(3.0 + 2.0 * H.trace() + contracted(H, H))
        bend = cofactor_change(H, K)
        turn, root3 = ti.sqrt(contracted(bend, bend)), ti.sqrt(3.0 + 0.0 * m[0])
        i, j = 2.0 * H.trace() + contracted(H, H), volume_change(H, K)
        pulled = 4.0 * m[2] * (ti.max(i, 0.0 * i) + 2.0 * change * (size + root3))
        swell = m[0] * turn * (turn + 2.0 * root3)
        bent = 2.0 / root3 * (m[0] * ti.abs(j) * size + m[1] * change)
        return ti.Vector([1.0 + 0.0 * i, pulled + swell + bent, stretch_square(green_strain(H))])


LAWS["yeoh"] = f"{__name__}.Law"
Yeoh = model_of("yeoh")


def pull(model, stretch):
    """Force [N] that holds a cube of 1 m at a stretch."""
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64")
    body = scene.add_body(ts.box(size=(1, 1, 1), cells=(2, 2, 2)), model(1e4, 0.3, 1000.0))
    body.pin(ts.where.box((-1e-6, -9, -9), (1e-6, 9, 9)), "x")
    body.pin(ts.where.nearest((0, 0, 0)))
    body.pin(ts.where.nearest((0, 0, 1)), "xy")
    body.pin(ts.where.box((1 - 1e-6, -9, -9), (1 + 1e-6, 9, 9)), "x", velocity=(stretch - 1, 0, 0))
    scene.duration = 1.0
    return ts.Simulation(scene).equilibrium().reactions[:, 0].clip(0).sum()


if __name__ == "__main__":
    for stretch in (1.01, 1.5, 2.0):
        ours, other = (pull(model, stretch) for model in (Yeoh, ts.NeoHookean))
        print(f"stretch {stretch}: Yeoh {ours:.5g} N, neo-Hookean {other:.5g} N")
        assert ours > other
