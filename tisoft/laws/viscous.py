# mypy: ignore-errors
"""Viscous stress: Hooke's sum of the strain rate, with constants φ and η [Pa·s].

    SmallRate   P_v = φ tr(ė) I + 2η ė,   ė = (Ḣ + Ḣᵀ)/2                 (linear bodies)
    GreenRate   P_v = F S_v,  S_v = φ tr(Ė) I + 2η Ė,  Ė = (FᵀḢ + ḢᵀF)/2
                                          (O'Brien and Hodgins 1999, eq. 8, 22; their ν = 2Ė)

GreenRate does not see rotations: a body that spins as a whole feels no viscosity.

| symbol | name   | unit |
| ------ | ------ | ---- |
| H, Ḣ   | `H`, `D` | 1, 1/s |
| φ, η   | `phi`, `eta` | Pa·s |
"""

import taichi as ti

from tisoft.laws.base import hooke, symmetric, times, transposed_times


class SmallRate:
    """Of the rate of small strain."""

    @staticmethod
    @ti.func
    def stress(H, D, phi, eta):
        """P_v [Pa] of the displacement gradient H and its rate D."""
        return hooke(symmetric(D), phi, eta)


class GreenRate:
    """Of the rate of Green's strain."""

    @staticmethod
    @ti.func
    def stress(H, D, phi, eta):
        """P_v [Pa] of the displacement gradient H and its rate D."""
        S = hooke(symmetric(D + transposed_times(H, D)), phi, eta)
        return S + times(H, S)
