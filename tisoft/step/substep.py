# mypy: ignore-errors
"""One substep, in the order of the lectures: forces, f/m, Δv = h a, Δx = h (v + Δv).

    M ẍ + C ẋ + f_int(x) = f_ext      (mass-spring systems; finite elements with lumped mass)

    1. elements add their forces to the nodes' copies            forces.batch, external.press
    2. a node sums them:          f = f_int + f_ext              forces.total, external.force
    3. its acceleration:          a = f/m + g − γ v              external.acceleration
       with consistent mass:      M a = f                        consistent_mass
    4. it moves:                  Δv = h a,  Δx = h (v + Δv)     symplectic_euler (or another file)
       past obstacles and pins                                   contact, fixed
       as do surfaces that bodies carry                          touch, means
    5. what that did to its energy                               ledger

All functions of this folder take the Structure `s`, or its State, and say which fields they read
and write.  `passes` runs substeps on the CPU, `launches` on a GPU: both call what stands here.
"""

from dataclasses import dataclass
from typing import Any

import taichi as ti

from tisoft.model.state import GRAVITY, KICK, LOADED, MOVE, SHOVED, STEP, TASK
from tisoft.step import consistent_mass, external, forces, ledger


@dataclass(frozen=True, eq=False)
class Structure:
    """What kernels are compiled for: fields, and what a substep has to do."""

    state: Any
    blocks: tuple[Any, ...]
    integrator: Any
    contact: bool
    ledger: bool
    mass: Any
    """Fields of the consistent mass matrix, or None where all masses are lumped."""
    inputs: Any = None
    """Fields of what acts in time, or None where nothing does."""
    touch: Any = None
    """Fields of points of carried surfaces that meet obstacles, or None where none do."""
    surfaces: Any = None
    """Fields of contact of surfaces, or None where none may touch."""

    means: Any = None
    """Fields of patches that pins hold by means of cells, or None where none are."""

    @property
    def holds_means(self) -> bool:
        """Whether pins hold means of cells."""
        return self.means is not None

    @property
    def meets(self) -> bool:
        """Whether surfaces may touch."""
        return self.surfaces is not None

    @property
    def consistent(self) -> bool:
        """Whether M a = f is solved."""
        return self.mass is not None

    @property
    def driven(self) -> bool:
        """Whether something acts in time."""
        return self.inputs is not None

    @property
    def touches(self) -> bool:
        """Whether carried surfaces meet obstacles."""
        return self.touch is not None


@ti.func
def node(s: ti.template(), i, now):
    """Steps 2 to 5 at node i, with lumped mass."""
    f = forces.total(s.state, i)
    a = external.acceleration(s.state, i, f + external.force(s.state, i, now), now)
    move(s, i, a, f, now, 0.0 * a, 0.0 * a)


@ti.func
def move(s: ti.template(), i, a, f, now, pushed, rubbed):
    """Steps 4 and 5 at node i, with acceleration a [m/s²]; f is the elements' force [N], pushed and
    rubbed what other surfaces add to its velocity [m/s].
    """
    old = s.state.velocity[i]
    moved = s.integrator.move(s.state, s.contact, i, a, now, pushed + rubbed)
    if ti.static(s.ledger and (s.touches or s.holds_means)):
        s.state.pull[i] = a
    if ti.static(s.ledger):
        ledger.note(s, i, f, moved, old, now)
        if ti.static(s.contact):
            s.state.shove[i] = moved.push / s.integrator.kick(now)
            if (moved.push != 0.0).any():
                s.state.orders[now.scene, SHOVED] = now.number + 1
        if ti.static(s.meets):
            ledger.note_touch(s.state, i, moved, pushed, rubbed)


@ti.func
def begin_solve(s: ti.template(), i, row, now):
    """Step 2 at node i, and the start of M a = f; `row` is its row of the mass matrix."""
    f = forces.total(s.state, i)
    s.mass.force[row] = f
    a = external.acceleration(s.state, i, f + external.force(s.state, i, now), now)
    consistent_mass.begin_solve(s.mass, s.state, i, row, a / s.state.inverse_mass[i])


@ti.func
def move_solved(s: ti.template(), i, row, now):
    """Steps 4 and 5 at node i, with the acceleration that the solve has found."""
    a = s.mass.solution[row]
    move(s, i, a, s.mass.force[row], now, 0.0 * a, 0.0 * a)


@ti.func
def now_of(s: ti.template(), scene, number, passes):
    """The `State.Now` of pass `number` of a stretch of `passes`.  Reads settings, orders."""
    h = ti.cast(s.state.settings[scene, STEP], s.state.real)
    kick = h
    if number == 0:
        kick = ti.cast(s.state.settings[scene, KICK], s.state.real)
    gravity = ti.Vector(
        [ti.cast(s.state.settings[scene, GRAVITY + d], s.state.real) for d in range(3)]
    )
    return s.state.Now(
        scene=scene,
        number=number,
        h=h,
        kick=kick,
        gravity=gravity,
        loaded=s.state.orders[scene, LOADED],
        counts=s.state.orders[scene, TASK] == MOVE,
        opens=number < passes - s.integrator.closing_passes,
        closes=number > 0,
    )
