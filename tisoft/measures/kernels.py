# mypy: ignore-errors
"""Strain and stress of cells, in the precision of their fields."""

from typing import Any

import taichi as ti

from tisoft.laws.base import (
    cofactor,
    cofactor_change,
    contracted,
    diagonal,
    green_strain,
    symmetric,
    times,
    transposed_times,
    volume_change,
)
from tisoft.step import forces

A = ti.types.ndarray()


def make_measures(state: Any, block: Any) -> Any:
    """The kernel measure(first, place, …): strain, stresses [Pa] and J of cells, in the order of
    `place` (batch · lanes + lane, counted from batch `first`), means over the points of each; of J
    also the least.
    """

    Measured = ti.types.struct(
        strain=ti.types.matrix(3, 3, block.real),
        second=ti.types.matrix(3, 3, block.real),
        cauchy=ti.types.matrix(3, 3, block.real),
        J=block.real,
    )

    @ti.func
    def at_point(block: ti.template(), H, m):
        P = block.law.stress(H, m)
        K = cofactor(H)
        J = 1.0 + volume_change(H, K)
        E, S, T = symmetric(H), P, P
        if ti.static(block.law.is_finite):
            E = green_strain(H)
            T = 0.0 * P
            S = 0.0 * P
            if J != 0.0:
                T = (P + times(P, H.transpose())) / J  # P Fᵀ/J
                F_cof = diagonal(0.0 * J + 1.0) + cofactor_change(H, K)
                S = transposed_times(F_cof, P) / J  # F⁻¹P
        return Measured(strain=E, second=S, cauchy=T, J=J)

    @ti.kernel
    def measure(
        first: int, place: A, strain: A, second_piola: A, cauchy: A, von_mises: A, volume_ratio: A,
        least_ratio: A,
    ):  # fmt: skip
        for e in range(place.shape[0]):
            b = first + place[e] // block.lanes
            lane = place[e] % block.lanes
            rest = ti.Matrix.zero(block.real, block.element.numbers, block.lanes)
            u = ti.Matrix.zero(block.real, 3 * block.corners, block.lanes)
            forces.load_rest(block, b, rest)
            forces.gather(block, state.displacement, b, u)
            m = forces.material(block, b)
            z = 0.0 * m[0]
            E = ti.Matrix([[z, z, z], [z, z, z], [z, z, z]])
            S, T, size, least = E, E, z, z + 1e30
            for q in range(block.points):
                weight = block.element.weight(rest, q, lane)
                one = at_point(block, block.element.gradient(rest, u, q, lane), m)
                E, S, T = E + weight * one.strain, S + weight * one.second, T + weight * one.cauchy
                size += weight * one.J
                least = ti.min(least, one.J)
            dev = T - diagonal(T.trace() / 3.0)
            von_mises[e] = ti.sqrt(1.5 * contracted(dev, dev))
            volume_ratio[e] = size
            least_ratio[e] = least
            for r, c in ti.static(ti.ndrange(3, 3)):
                strain[e, r, c] = E[r, c]
                second_piola[e, r, c] = S[r, c]
                cauchy[e, r, c] = T[r, c]

    return measure
