"""Poisson → 0.5: the step shrinks like 1/c_P, and linear tets lock.

    c_P = √((λ + 2μ)/ρ) = √(E (1 − ν)/(ρ (1 + ν)(1 − 2ν)))

Locking is told by the compliance under the body's own weight, f·u = fᵀK⁻¹f at small strain, beside
that of 10-node tets on the same mesh, which bend and keep their volume with ease.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import where
from tisoft.body import Body
from tisoft.gravity import mainly
from tisoft.model.part import parts_of
from tisoft.models.materials import Linear, lame_constants
from tisoft.pins import Pin
from tisoft.stable.sharp import sharp_limit
from tisoft.study import pictures
from tisoft.study.axis import Axis, Tick
from tisoft.study.compliance import Compliance, free_axes
from tisoft.study.own import Own
from tisoft.study.subject import Subject

Floats = NDArray[np.float64]

RATIOS = (0.0, 0.15, 0.3, 0.4, 0.45, 0.48, 0.49, 0.495, 0.499, 0.4999)
REFERENCE = 0.3
YARDSTICKS = (0.0, 0.3, 0.4, 0.45, 0.49, 0.4999)
"""Ratios at which the 10-node tets are solved; between these they change little."""
USABLE = 0.1
"""Loss of compliance that still counts as usable."""


@dataclass(frozen=True)
class Row:
    """One Poisson's ratio."""

    poisson: float
    step: float
    """Stable step [s]."""
    compliance: float
    """Of the linear tets [J]."""
    unlocked: float
    """Of the same nodes without locking [J]."""


def work(subject: Subject) -> int:
    """Number of ticks that `measure` makes."""
    return len(YARDSTICKS) + len(RATIOS)


def _depth(poisson: float) -> float:
    """How far towards 0.5, in powers of ten."""
    return float(-np.log10(1.0 - 2.0 * poisson))


def speed(poisson: float) -> float:
    """c_P over √(E/ρ)."""
    return float(np.sqrt((1.0 - poisson) / ((1.0 + poisson) * (1.0 - 2.0 * poisson))))


def held_body(subject: Subject) -> tuple[Body, str]:
    """A linear body that gravity can load: with the scene's pins where they hold it, else clamped
    at one end; and what it is, in words.
    """
    mesh = subject.solid
    body = Body("body", mesh, Linear(**vars(subject.material)))
    name = subject.solid_name
    if mesh is subject.body.mesh:
        body.pins = [p for p in subject.body.pins if p.release is None]
        if _is_held(body):
            return body, f"{name} in its pins"
    axis = int(np.argmax(np.ptp(mesh.points, axis=0)))
    along = mesh.points[:, axis] - mesh.points[:, axis].min()
    for share in (0.02, 0.05, 0.1, 0.2, 0.5):
        end = np.flatnonzero(along <= share * along.max())
        body.pins = [Pin(where.nodes([int(mesh.kept_nodes[n]) for n in end]))]
        if _is_held(body):
            break
    return body, f"{name}, clamped at one end"


def _is_held(body: Body) -> bool:
    """Whether the pins leave no rigid motion."""
    x = body.mesh.points - body.mesh.points.mean(axis=0)
    x = x / np.abs(x).max()
    moves = [np.tile(e, (len(x), 1)) for e in np.eye(3)] + [np.cross(e, x) for e in np.eye(3)]
    held = np.array([m[~free_axes(body)] for m in moves])
    return bool(np.linalg.matrix_rank(held, tol=1e-3) == 6)


def measure(subject: Subject, own: Own, tick: Tick) -> Axis:
    """Step and compliance for each Poisson's ratio."""
    body, name = held_body(subject)
    gravity = mainly(subject.scene.gravity)
    direction = gravity if gravity.any() else np.array([0.0, -9.81, 0.0])
    linear, quadratic = (Compliance(body, direction, order) for order in (1, 2))
    density, young = subject.material.density, subject.material.young
    yardsticks = []
    for nu in YARDSTICKS:
        yardsticks.append(quadratic.of(*lame_constants(young, nu)))
        tick()
    rows = []
    for nu in RATIOS:
        body.model = Linear(young, nu, density)
        step = sharp_limit(parts_of([body])[0], integrator=subject.integrator_name).step
        unlocked = np.interp(_depth(nu), [_depth(known) for known in YARDSTICKS], yardsticks)
        rows.append(Row(nu, step, linear.of(*lame_constants(young, nu)), float(unlocked)))
        tick()
    too_stiff = _at(rows, REFERENCE).unlocked / _at(rows, REFERENCE).compliance - 1.0
    return Axis(
        name="poisson",
        title="Nearly incompressible",
        sentence=_sentence(subject, rows),
        columns=(
            "Poisson's ratio", "stable step [s]", "predicted step [s]",
            "compliance f·u, linear tets [J]", "compliance f·u, 10-node tets [J]",
        ),
        rows=[
            (r.poisson, r.step, predicted, r.compliance, r.unlocked)
            for r, predicted in zip(rows, _steps(rows), strict=True)
        ],
        draw=lambda figure: _draw(figure, subject, rows),
        numbers={
            "usable_below": usable_below(rows),
            "stiffening_at_0.49": stiffening(rows, 0.49),
            "step_at_0.49": float(np.interp(0.49, RATIOS, [r.step for r in rows])),
        },
        notes=[
            f"Measured on {name}, at small strain, undamped, under its own weight.  At "
            f"{REFERENCE:g} its linear tets are {100.0 * too_stiff:.0f} % stiffer than 10-node "
            "tets on it, which serve as the yardstick: they bend stiffly whatever the ratio."
        ],
    )  # fmt: skip


def _steps(rows: list[Row]) -> list[float]:
    """Predicted steps [s]: the one of the reference scaled by the wave speed."""
    base = _at(rows, REFERENCE).step
    return [base * speed(REFERENCE) / speed(r.poisson) for r in rows]


def _at(rows: list[Row], poisson: float) -> Row:
    return next(r for r in rows if r.poisson == poisson)


def _losses(rows: list[Row]) -> Floats:
    """Share of its compliance at ν = 0.3 that locking takes, beyond what the reference loses."""
    base = _at(rows, REFERENCE)
    kept = [(r.compliance / base.compliance) / (r.unlocked / base.unlocked) for r in rows]
    return 1.0 - np.array(kept)


def usable_below(rows: list[Row]) -> float:
    """Poisson's ratio at which locking takes USABLE of the compliance; 0.5 where it never does."""
    losses = _losses(rows)
    above = [i for i, r in enumerate(rows) if r.poisson > REFERENCE and losses[i] > USABLE]
    if not above:
        return 0.5
    i = above[0]
    return float(np.interp(USABLE, losses[i - 1 : i + 1], [rows[i - 1].poisson, rows[i].poisson]))


def stiffening(rows: list[Row], poisson: float) -> float:
    """How many times too stiff the mesh is by locking at a Poisson's ratio."""
    return float(1.0 / (1.0 - np.interp(poisson, [r.poisson for r in rows], _losses(rows))))


def _sentence(subject: Subject, rows: list[Row]) -> str:
    limit = usable_below(rows)
    base, far = _at(rows, REFERENCE), _at(rows, 0.49)
    own = subject.material.poisson
    what = "this mesh" if subject.solid is subject.body.mesh else subject.solid_name
    text = (
        f"Above Poisson's ratio {limit:.3f} locking makes {what} more than 10 % too stiff"
        if limit < 0.5
        else f"Locking makes {what} nowhere more than 10 % too stiff"
    ) + (
        f" (at 0.49 {stiffening(rows, 0.49):.2f} times), and the stable step at 0.49 is "
        f"{base.step / far.step:.1f} times shorter than at 0.3"
    )
    if subject.is_springs:
        return text + "; springs have 0.25 whatever is asked."
    place = "inside" if own <= limit else "beyond it"
    return text + f"; this body's {own:g} is {place}."


def _draw(figure: Any, subject: Subject, rows: list[Row]) -> None:
    left, right = figure.subplots(1, 2)
    x = 0.5 - np.array([r.poisson for r in rows])
    fine = np.geomspace(x.min(), 0.5, 200)
    base = _at(rows, REFERENCE)
    left.plot(fine, [1e3 * base.step * speed(REFERENCE) / speed(0.5 - d) for d in fine],
              color=pictures.BLACK, lw=1.4, label="predicted: like 1/c_P")  # fmt: skip
    left.plot(
        x, [1e3 * r.step for r in rows], "o", color=pictures.BLUE, label="measured, sharp limit"
    )
    right.plot(x, [base.compliance / r.compliance for r in rows], "o-", color=pictures.RED,
               lw=1.2, label="linear tets")  # fmt: skip
    right.plot(x, [base.unlocked / r.unlocked for r in rows], color=pictures.BLACK, lw=1.4,
               label="10-node tets on the same mesh")  # fmt: skip
    limit = usable_below(rows)
    if limit < 0.5:
        right.axvline(
            0.5 - limit, color=pictures.GREY, ls="--", label=f"10 % too stiff: {limit:.3f}"
        )
    for ax in (left, right):
        if not subject.is_springs:
            ax.axvline(
                0.5 - subject.material.poisson, color=pictures.BLACK, ls=":", label="this scene"
            )
        ax.set_xscale("log")
        ax.set_xlim(0.6, 0.8 * x.min())
        ticks = [0.0, 0.3, 0.45, 0.49, 0.499, 0.4999]
        ax.set_xticks([0.5 - t for t in ticks], [f"{t:g}" for t in ticks])
        ax.minorticks_off()
        ax.set_xlabel("Poisson's ratio [1]")
    left.set_ylim(0.0, None)
    right.set_yscale("log")
    top = max(base.compliance / r.compliance for r in rows)
    marks = [t for t in (1, 1.1, 1.2, 1.5, 2, 3, 5, 10, 20, 50, 100, 1000) if t <= 1.5 * top]
    right.set_yticks(marks, [f"{t:g}" for t in marks])
    right.set_ylim(0.95, max(1.25, 1.1 * top))
    right.minorticks_off()
    left.set_ylabel("stable substep [ms]")
    right.set_ylabel("stiffness / stiffness at 0.3 [1]")
    left.set_title("Towards 0.5 the stable step goes to nothing")
    right.set_title("… and linear tets lock")
    left.legend(loc="lower left")
    right.legend(loc="upper left")
