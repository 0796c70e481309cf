"""Static equilibrium K(x) + f = 0 of a scene, always in f64, each body on its own.

Newton's method with preconditioned conjugate gradients (`newton`, `linear_solve`) along the branch
that leads from rest to the full load (`follow`); bodies that are loose at rest go to the lowest
potential instead (`settle`).  Gravity, loads and pins are those of t = duration; nodes feel no
obstacles.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tisoft import checks, runtime
from tisoft.energies import Energies
from tisoft.equilibrium.balance import ACCEPTED, TARGET, Balance
from tisoft.equilibrium.follow import Answer, balance_body
from tisoft.equilibrium.one_thread import one_thread
from tisoft.errors import SceneError
from tisoft.gravity import gravity_at
from tisoft.model.part import parts_of
from tisoft.scene import Scene

Floats = NDArray[np.float64]
PLACES = "a displacement (x, y, z) in m for each node"


class HasScene(Protocol):
    """A simulation, for one."""

    scene: Scene


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A scene at rest under its loads; nodes in the order of bodies and of each mesh."""

    positions: Floats
    """World positions [m], shape (nodes, 3)."""
    residual: float
    """Largest nodal force out of balance [N]."""
    load_factor: float
    """1: the whole load."""
    iterations: int
    """Linear systems solved."""
    energy: Energies
    """[J]"""
    reactions: Floats
    """Forces of the pins on the nodes they hold [N], shape (nodes, 3)."""
    warnings: list[str] = field(default_factory=list)
    """What a user should know of it, a sentence each."""


def scene_of(scene: Scene | HasScene) -> Scene:
    """The scene of a simulation, or the scene itself; Taichi is running afterwards.

    Raises:
        SceneError: where the arch in use does not compute in f64.
    """
    found = scene if isinstance(scene, Scene) else scene.scene
    if not runtime.generation:
        runtime.start()
    if not runtime.has_f64():
        raise SceneError("statics and modes compute in f64, which this arch lacks; use --arch cpu")
    return found


@one_thread()
def equilibrium(
    scene: Scene | HasScene, *, external: Any = None, near: Any = None, accuracy: float = TARGET
) -> Equilibrium:
    """The static equilibrium that leads from rest to the loads at t = duration.

    Args:
        scene: or a simulation of it, whose present state is not looked at.
        external: further dead forces [N], shape (nodes, 3), in the scene's node order.
        near: displacements [m], shape (nodes, 3), that it lies near, as those of a coarser mesh;
            where it does not, it is sought from rest all the same.
        accuracy: forces out of balance that are small enough, as a share of the load.

    Raises:
        NoEquilibrium: when the branch from rest ends before the full load; its `load_factor` is the
            last one that had an equilibrium.
        SceneError: a scene that cannot be simulated.
    """
    scene = scene_of(scene)
    scene.validate()
    parts = parts_of(scene.bodies)
    count = sum(len(part.order) for part in parts)
    extra = _external(external, count)
    guess = None if near is None else checks.floats("near", near, (count, 3), PLACES)
    positions, reactions = np.zeros((count, 3)), np.zeros((count, 3))
    residual, iterations = 0.0, 0
    elastic, gravity, work = 0.0, 0.0, 0.0
    follows = False
    warnings = []
    if scene.obstacles:
        warnings.append("static equilibrium leaves obstacles out: nodes may lie inside them")
    for part in parts:
        own = extra[part.nodes][part.order]
        weight = part.mass[:, None] * gravity_at(scene.gravity, scene.duration)
        balance = Balance(part, scene.duration, weight + own, accuracy)
        first = None if guess is None else guess[part.nodes][part.order]
        with np.errstate(over="ignore", invalid="ignore"):  # trials that fail may overflow
            answer = balance_body(balance, first)
        u = answer.state.u
        positions[part.nodes][part.order] = part.body.mesh.points[part.order] + u
        reactions[part.nodes][part.order] = answer.state.reactions
        residual = max(residual, answer.state.residual)
        iterations += answer.iterations
        elastic += balance.elastic.energy(u)
        gravity -= float((weight * u).sum())
        work += float(((balance.dead - weight) * u).sum())
        follows |= bool(balance.followers)
        warnings += _warn(balance, answer)
    energy: Energies = {
        "kinetic": 0.0,
        "elastic": elastic,
        "gravity": gravity,
        "dissipated": None,
        "external_work": None if follows else work,  # theirs depends on the way
        "error": None,
    }
    return Equilibrium(positions, residual, 1.0, iterations, energy, reactions, warnings)


def _external(external: Any, count: int) -> Floats:
    if external is None:
        return np.zeros((count, 3))
    return checks.floats("external", external, (count, 3), "a force (x, y, z) in N for each node")


def _warn(balance: Balance, answer: Answer) -> list[str]:
    name, state = balance.part.body.name, answer.state
    found = []
    if not answer.stable:
        found.append(
            f"the equilibrium of {name!r} is unstable: it has buckled or would at the least push"
        )
    if balance.linear and balance.elastic.least_volume_change(state.u) <= 0.0:
        found.append(
            f"{name!r} is turned inside out somewhere: its displacements are far too large for a "
            "linear body; use viscoelastic or neo-hookean"
        )
    loads = np.linalg.norm(balance.external(state.u, 1.0), axis=1).sum()
    whole = max(float(loads), balance.scale(state.u, 1.0, state.reactions))
    if state.residual > ACCEPTED * whole:
        found.append(
            f"rounding leaves {state.residual:.3g} N on a node of {name!r}: its stiffness is too "
            "large beside its load for more digits"
        )
    return found
