# mypy: ignore-errors
"""Hooke's law: linear elasticity, for small displacements and rotations.

    Ψ = λ/2 tr(e)² + μ e:e,   P = λ tr(e) I + 2μ e,   e = (H + Hᵀ)/2

| symbol | name      | unit |
| ------ | --------- | ---- |
| λ, μ   | m[0], m[1] | Pa  |
"""

import taichi as ti

from tisoft.laws.base import hooke, hooke_energy, symmetric
from tisoft.laws.viscous import SmallRate


class Linear:
    """Linear elasticity."""

    is_finite = False
    viscosity = SmallRate

    @staticmethod
    def constants(lame_lambda: float, lame_mu: float) -> tuple[float, ...]:
        """λ and μ [Pa]."""
        return lame_lambda, lame_mu

    @staticmethod
    @ti.func
    def stress(H, m):
        """P [Pa]."""
        return hooke(symmetric(H), m[0], m[1])

    @staticmethod
    @ti.func
    def energy(H, m):
        """Ψ [J/m³]."""
        return hooke_energy(symmetric(H), m[0], m[1])

    @staticmethod
    @ti.func
    def tangent(H, G, m):
        """∂P/∂F : G [Pa]."""
        return hooke(symmetric(G), m[0], m[1])

    @staticmethod
    @ti.func
    def stiffening(H, m):
        """It never stiffens."""
        z = 0.0 * m[0]
        return ti.Vector([1.0 + z, z, 1.0 + z])
