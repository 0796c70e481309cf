# mypy: ignore-errors
"""St. Venant-Kirchhoff: Hooke's law in Green's strain, for large displacements.

    Ψ = λ/2 tr(E)² + μ E:E,   P = F S,   S = λ tr(E) I + 2μ E,   E = (FᵀF − I)/2
                                                         (O'Brien and Hodgins 1999, eq. 7, 21)

They write ε = FᵀF − I = 2E and σ = 2S, with half the volume in front of the force: the same force.

    ∂P/∂F : G = G S + F (λ tr(dE) I + 2μ dE),   dE = (FᵀG + GᵀF)/2
    stiffening: |F|² of the tangent at rest, and λ_max(S) where S pulls

It softens in compression and turns inside out at 58 % of its length.

| symbol | name      | unit |
| ------ | --------- | ---- |
| λ, μ   | m[0], m[1] | Pa  |
"""

import taichi as ti

from tisoft.laws.base import (
    green_strain,
    hooke,
    hooke_energy,
    largest_eigenvalue,
    stretch_square,
    symmetric,
    times,
    transposed_times,
)
from tisoft.laws.viscous import GreenRate


class StVenant:
    """The law of `ViscoElastic` bodies."""

    is_finite = True
    viscosity = GreenRate

    @staticmethod
    def constants(lame_lambda: float, lame_mu: float) -> tuple[float, ...]:
        """λ and μ [Pa]."""
        return lame_lambda, lame_mu

    @staticmethod
    @ti.func
    def stress(H, m):
        """P [Pa]."""
        S = hooke(green_strain(H), m[0], m[1])
        return S + times(H, S)

    @staticmethod
    @ti.func
    def energy(H, m):
        """Ψ [J/m³]."""
        return hooke_energy(green_strain(H), m[0], m[1])

    @staticmethod
    @ti.func
    def tangent(H, G, m):
        """∂P/∂F : G [Pa]."""
        dS = hooke(symmetric(G + transposed_times(H, G)), m[0], m[1])
        return times(G, hooke(green_strain(H), m[0], m[1])) + dS + times(H, dS)

    @staticmethod
    @ti.func
    def stiffening(H, m):
        """λ_max(FᵀF) of the tangent at rest, and the tension λ_max(S) where there is one."""
        E = green_strain(H)
        square = stretch_square(E)
        tension = largest_eigenvalue(hooke(E, m[0], m[1]))
        return ti.Vector([square, ti.max(tension, 0.0 * tension), square])
