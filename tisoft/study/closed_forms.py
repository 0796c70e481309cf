"""What each law answers to a uniform stretch F = diag(a, t, t), by closed forms.

St. Venant-Kirchhoff   P = E a (l² − 1)/2,  t² = 1 − ν(l² − 1);  least at a = 1/√3, −E/(3√3)
linear                 P = E (a − 1),  t = 1 − ν(a − 1)
neo-Hookean            P_i = μ' (1 − 1/(I_C + 1)) s_i + λ' (J − α) J/s_i  (Smith et al. 2018)
springs, all ways      P = 6 E ⟨(1 − 1/s) a n_x²⟩,  s = |F n|, the mean over directions n
with the sides held       W = M (a² − 1)²/8 (St. Venant-Kirchhoff), M (a − 1)²/2 (linear)
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tisoft.laws.neo_hookean import NeoHookean
from tisoft.models.materials import lame_constants
from tisoft.study.subject import Material

Stress = Callable[[float, float], tuple[float, float]]
"""(a, t) → mean nominal stress along and across [Pa]."""


def predicted_stress(name: str, m: Material) -> Stress:
    """The closed forms."""
    lam, mu = lame_constants(m.young, m.poisson)
    if name == "neo-hookean":
        lam_, mu_ = NeoHookean.constants(lam, mu)
        alpha = 1.0 + 0.75 * mu_ / lam_

        def neo_hookean(a: float, t: float) -> tuple[float, float]:
            shear = mu_ * (1.0 - 1.0 / (a * a + 2.0 * t * t + 1.0))
            push = lam_ * (a * t * t - alpha)
            return shear * a + push * t * t, shear * t + push * a * t

        return neo_hookean
    if name == "mass-spring":
        x, weight = np.polynomial.legendre.leggauss(64)
        n2 = (0.5 * (x + 1.0)) ** 2  # n_x is uniform over directions
        weight = 3.0 * m.young * weight

        def springs(a: float, t: float) -> tuple[float, float]:
            s = np.sqrt(a * a * n2 + t * t * (1.0 - n2))
            pull = weight * (1.0 - 1.0 / s)
            return float(pull @ n2) * a, 0.5 * float(pull @ (1.0 - n2)) * t

        return springs
    if name == "linear":

        def linear(a: float, t: float) -> tuple[float, float]:
            trace = a + 2.0 * t - 3.0
            return lam * trace + 2.0 * mu * (a - 1.0), lam * trace + 2.0 * mu * (t - 1.0)

        return linear

    def st_venant(a: float, t: float) -> tuple[float, float]:
        trace = 0.5 * (a * a + 2.0 * t * t - 3.0)
        along = lam * trace + mu * (a * a - 1.0)
        return along * a, (lam * trace + mu * (t * t - 1.0)) * t

    return st_venant


def predicted_energy(name: str, m: Material) -> Callable[[float], float]:
    """Energy density [J/m³] at a stretch with the sides held, by closed forms."""
    lam, mu = lame_constants(m.young, m.poisson)
    if name == "neo-hookean":
        lam_, mu_ = NeoHookean.constants(lam, mu)

        def neo_hookean(a: float) -> float:
            i, j = a * a - 1.0, a - 1.0
            log = float(np.log(1.0 + 0.25 * i))
            return 0.5 * mu_ * i + 0.5 * lam_ * j * j - 0.75 * mu_ * j - 0.5 * mu_ * log

        return neo_hookean
    if name == "mass-spring":
        x, weight = np.polynomial.legendre.leggauss(64)
        n2 = (0.5 * (x + 1.0)) ** 2

        def springs(a: float) -> float:
            s = np.sqrt(a * a * n2 + 1.0 - n2)
            return 1.5 * m.young * float(weight @ (s - 1.0) ** 2)

        return springs
    confined = lam + 2.0 * mu
    if name == "linear":
        return lambda a: 0.5 * confined * (a - 1.0) ** 2
    return lambda a: 0.125 * confined * (a * a - 1.0) ** 2
