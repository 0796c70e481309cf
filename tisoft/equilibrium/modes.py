"""Natural frequencies and shapes: K φ = ω² M φ on the axes that no pin holds, always in f64.

SciPy's ARPACK (Lehoucq, Sorensen and Yang 1998) finds the lowest by shift and invert,
(K + s M)⁻¹ M, with a small s that makes bodies without pins solvable.  Lanczos iterations can miss
copies of equal frequencies (a square beam has every bending mode twice; a free body has six of 0),
so the signs of a factorisation's pivots count how many lie below the highest one found, and the
search is repeated until none is missing.  Bodies do not touch, so each has its own modes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse
from scipy.sparse.linalg import ArpackNoConvergence, eigsh

from tisoft import checks
from tisoft.checks import FieldError
from tisoft.equilibrium.at_rest import AtRest
from tisoft.equilibrium.frontal import factorised
from tisoft.equilibrium.held import Held
from tisoft.equilibrium.one_thread import one_thread
from tisoft.equilibrium.operators import Elastic, operators_at_rest, operators_of
from tisoft.equilibrium.pointwise import Pointwise
from tisoft.equilibrium.statics import HasScene, equilibrium, scene_of
from tisoft.errors import Diverged
from tisoft.model.part import parts_of
from tisoft.scene import Scene

Floats = NDArray[np.float64]
Mass = Literal["lumped", "consistent"]

SHIFT = 1e-7
"""s as a share of the largest K_ii/M_ii."""
ZERO = 1e-13
"""ω² below this share of the largest K_ii/M_ii is rounding: a motion that costs no energy."""
DENSE = 150
"""Unknowns up to which LAPACK takes over."""
ROUNDS = 6


@dataclass(frozen=True, eq=False)
class Modes:
    """The lowest natural modes of a scene; nodes in the order of bodies and of each mesh."""

    frequencies: Floats
    """[Hz], ascending, shape (n,): 0 for motions that cost no energy; of an unstable state
    −√(−ω²)/2π, its rate of growth over 2π."""
    shapes: Floats
    """φ with φᵀ M φ = 1 [1/√kg], shape (n, nodes, 3)."""
    positions: Floats
    """World positions of the state that they swing about [m], shape (nodes, 3)."""

    def shape(self, k: int) -> Floats:
        """Shape of mode k, shape (nodes, 3), with a largest nodal displacement of 1."""
        shape: Floats = self.shapes[k] / np.linalg.norm(self.shapes[k], axis=1).max()
        return shape


@one_thread()
def natural_modes(
    scene: Scene | HasScene, n: int = 6, *, about: Any = "rest", mass: Mass | None = None
) -> Modes:
    """The n lowest natural frequencies and shapes; fewer where the scene has fewer unknowns.

    Args:
        scene: or a simulation of it.
        n: how many, rigid motions counted.
        about: "rest" (with the pins of t = 0), "equilibrium" (under the loads at t = duration), or
            world positions [m], shape (nodes, 3), in the scene's order (pins of t = duration).
        mass: "lumped" or "consistent" for all bodies with tets; left out, each body's own kind.

    Raises:
        FieldError: a wrong argument.
        NoEquilibrium: from "equilibrium".
        Diverged: the eigensolver did not converge.
    """
    scene = scene_of(scene)
    scene.validate()
    n = checks.integer("n", n, least=1)
    if mass not in (None, "lumped", "consistent"):
        raise FieldError("mass", 'must be "lumped" or "consistent"', mass)
    parts = parts_of(scene.bodies)
    count = sum(len(part.order) for part in parts)
    u = _displacements(scene, about, count)
    at_rest = isinstance(about, str) and about == "rest"
    time = 0.0 if at_rest else scene.duration
    frequencies, shapes = [np.empty(0)], [np.empty((0, count, 3))]
    for part in parts:
        elastic = operators_at_rest(part) if at_rest else operators_of(part)
        kind = mass or ("consistent" if part.is_consistent else "lumped")
        held = Held(part, time)
        own, inside = body_modes(elastic, n, held=held, mass=kind, u=u[part.nodes][part.order])
        outside = np.zeros((len(own), count, 3))
        outside[:, part.nodes][:, part.order] = inside
        frequencies.append(own)
        shapes.append(outside)
    found = np.concatenate(frequencies)
    lowest = np.argsort(found, kind="stable")[:n]
    rest = np.concatenate([body.mesh.points for body in scene.bodies])
    return Modes(found[lowest], np.concatenate(shapes)[lowest], rest + u)


def _displacements(scene: Scene, about: Any, count: int) -> Floats:
    rest = np.concatenate([body.mesh.points for body in scene.bodies])
    if isinstance(about, str):
        if about == "rest":
            return np.zeros((count, 3))
        if about == "equilibrium":
            return equilibrium(scene).positions - rest
        raise FieldError("about", 'must be "rest", "equilibrium" or positions', about)
    return checks.floats("about", about, (count, 3), "a position (x, y, z) for each node") - rest


def body_modes(
    elastic: Elastic | Pointwise | AtRest,
    n: int,
    *,
    held: Held,
    mass: Mass,
    u: Floats | None = None,
) -> tuple[Floats, Floats]:
    """Frequencies [Hz] and shapes (modes, nodes, 3) of one body, inside order.

    Args:
        elastic: the body's operators.
        n: how many, at the most.
        held: what pins hold.
        mass: "lumped" or "consistent".
        u: displacements about which it vibrates [m]; left out, none.
    """
    state = np.zeros((elastic.nodes, 3)) if u is None else u
    stiffness = held.on_unknowns(elastic.stiffness(state))
    if mass == "consistent":
        whole = sparse.kron(elastic.consistent_mass(), np.eye(3), format="csc")
    else:
        whole = sparse.diags(np.repeat(elastic.mass, 3), format="csc")
    inertia = held.on_unknowns(whole)
    unknowns = inertia.shape[0]
    n = min(n, unknowns)
    top = float((np.abs(stiffness.diagonal()) / inertia.diagonal()).max(initial=0.0)) or 1.0
    if unknowns <= max(DENSE, 3 * n):
        values, vectors = linalg.eigh(stiffness.toarray(), inertia.toarray())
        values, vectors = values[:n], vectors[:, :n]
    else:
        values, vectors = _lowest(stiffness, inertia, n, top, held)
    values = np.where(np.abs(values) < ZERO * top, 0.0, values)
    frequencies = np.sign(values) * np.sqrt(np.abs(values)) / (2.0 * np.pi)
    return frequencies, (held.basis @ vectors).T.reshape(-1, elastic.nodes, 3)


def _lowest(
    stiffness: sparse.csc_matrix, inertia: sparse.csc_matrix, n: int, top: float, held: Held
) -> tuple[Floats, Floats]:
    """The n lowest ω² [1/s²] and M-normalised vectors, shape (unknowns, n)."""
    shift = SHIFT * top
    factor, negative = factorised(stiffness + shift * inertia, held)
    while negative:  # an unstable state: search from below its lowest
        shift *= 4.0
        factor, negative = factorised(stiffness + shift * inertia, held)
    size = stiffness.shape[0]
    inverse = sparse.linalg.LinearOperator((size, size), matvec=factor.solve, dtype=np.float64)
    rng = np.random.default_rng(0)
    wanted = n
    for _ in range(ROUNDS):
        room = min(size - 1, max(2 * wanted + 20, 40))
        try:
            values, vectors = eigsh(
                stiffness, wanted, inertia, sigma=-shift, which="LM", OPinv=inverse,
                v0=rng.standard_normal(size), ncv=room,
            )  # fmt: skip
        except ArpackNoConvergence as late:
            values, vectors = late.eigenvalues, late.eigenvectors
        order = np.argsort(values)
        values, vectors = values[order], vectors[:, order]
        if len(values) >= n:
            if abs(values[n - 1]) < ZERO * top:  # all cost no energy: any such shapes will do
                return values[:n], vectors[:, :n]
            # A little above the n-th, where no rounding can decide; how many lie below it?
            bound = values[n - 1] + 1e-6 * (abs(values[n - 1]) + shift)
            below = factorised(stiffness - bound * inertia, held)[1]
            if np.sum(values < bound) >= min(below, size - 1):
                return values[:n], vectors[:, :n]
        wanted = min(size - 2, max(wanted + 8, n + 8))
    raise Diverged(f"the {n} lowest modes did not converge; ask for a few more or fewer")
