"""Step × damping: which steps are stable, measured over the predicted curve.

h = (2/ω)(√(1 + ζ²) − ζ)      symplectic Euler, one mode with damping ratio ζ
h = (2/ω)(√(1 + 4ζ²) − 2ζ)    velocity Verlet, which sees damping twice as much
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.equilibrium.operators import Elastic
from tisoft.model.part import Part, parts_of
from tisoft.stable.bound import longest_step
from tisoft.stable.sharp import SharpLimit, sharp_limit
from tisoft.step.stepper import INTEGRATORS
from tisoft.study import pictures
from tisoft.study.axis import Axis, Tick
from tisoft.study.growth import Growth, GrowthBench, without_damping
from tisoft.study.own import Own
from tisoft.study.subject import Subject, alone

Floats = NDArray[np.float64]

RATIOS = (0.8, 0.9, 0.95, 0.97, 0.99, 1.01, 1.03, 1.05, 1.1, 1.2)
LEVELS = (0.0, 0.05, 0.2, 0.5, 1.0, 2.0)
"""Damping ratios ζ of the mode that sets the step."""
FEW_RATIOS, FEW_LEVELS = (0.9, 0.99, 1.01, 1.1), (0.0, 0.2, 1.0)
MANY = 20_000
"""Elements above which the grid is a coarse one."""


@dataclass(frozen=True)
class Point:
    """One run of the grid."""

    damping: float
    """ζ of the stiffest mode."""
    limit: float
    """Predicted for this damping [s]."""
    ratio: float
    """Step over limit."""
    growth: Growth


def work(subject: Subject) -> int:
    """Number of ticks that `measure` makes."""
    ratios, levels = _grid(subject)
    return len(ratios) * len(levels)


def _grid(subject: Subject) -> tuple[tuple[float, ...], tuple[float, ...]]:
    mesh = subject.body.mesh
    if max(len(mesh.tets), len(mesh.edges) // 3) > MANY:
        return FEW_RATIOS, FEW_LEVELS
    return RATIOS, LEVELS


class Damping:
    """Damping levels of a body's model: ζ of the undamped stiffest mode ↔ its parameters."""

    def __init__(self, subject: Subject) -> None:
        self.body = alone(subject.body).bodies[0]
        self.is_springs = subject.is_springs
        self.integrator = subject.integrator_name
        self._bare = without_damping(subject.body.model)
        undamped = self.limit(self._bare)
        self.mode = undamped.mode
        self.omega = 2.0 / undamped.step
        """ω of the stiffest mode [rad/s]."""
        self._unit = 2.0 / self.omega  # τ [s] of ζ = 1
        if self.is_springs:
            viscous = Elastic(self._part(without_damping(self._bare, spring_damping=1.0)))
            rate = np.vdot(self.mode, viscous.viscosity_times(self.mode, 0.0 * self.mode))
            self._unit = 2.0 * self.omega / float(rate)  # N·s/m of ζ = 1

    def _part(self, model: Any) -> Part:
        return parts_of([dataclasses.replace(self.body, model=model)])[0]

    def limit(self, model: Any) -> SharpLimit:
        """The body's sharp limit with another model."""
        return sharp_limit(self._part(model), integrator=self.integrator)

    def model(self, zeta: float) -> Any:
        """The body's model with damping ratio `zeta` in its stiffest mode."""
        if self.is_springs:
            return without_damping(self._bare, spring_damping=zeta * self._unit)
        phi, eta = (zeta * self._unit * c for c in (self._bare.lame_lambda, self._bare.lame_mu))
        return without_damping(self._bare, phi=phi, eta=eta)

    def words(self, zeta: float) -> str:
        """The parameters of a level."""
        model = self.model(zeta)
        if self.is_springs:
            return f"spring_damping = {model.spring_damping:.3g} N·s/m"
        return f"phi = {model.phi:.3g} and eta = {model.eta:.3g} Pa·s"


def curve(omega: float, zeta: Floats, factor: int) -> Floats:
    """The predicted limit [s] of a mode."""
    return longest_step(np.full(zeta.shape, omega**2), 2.0 * factor * zeta * omega)


def measure(subject: Subject, own: Own, tick: Tick) -> Axis:
    """Run the grid."""
    levels = Damping(subject)
    ratios, zetas = _grid(subject)
    points = []
    bench = GrowthBench(subject.body, levels.model(1.0), integrator=subject.integrator_name)
    for zeta in zetas:
        model = levels.model(zeta)
        limit = levels.limit(model)
        for ratio in ratios:
            growth = bench.run(model, limit.mode, ratio * limit.step)
            points.append(Point(zeta, limit.step, ratio, growth))
            tick()
    wrong = [p for p in points if p.growth.stable != (p.ratio < 1.0)]
    return Axis(
        name="step-damping",
        title="Step and damping",
        sentence=_sentence(subject, own, levels),
        columns=(
            "damping ratio of the stiffest mode", "step [s]", "predicted limit [s]", "step/limit",
            "stable", "growth per substep", "substeps",
        ),
        rows=[
            (p.damping, p.ratio * p.limit, p.limit, p.ratio, p.growth.stable,
             p.growth.per_substep, p.growth.substeps)
            for p in points
        ],
        draw=lambda figure: _draw(figure, points, subject, own, levels),
        numbers={
            "stable_step": own.limit,
            "step": own.step,
            "frequency": levels.omega / (2.0 * np.pi),
            "damping_ratio": own.damping(levels.mode, levels.omega),
            "runs": len(points),
            "grown_below_the_limit": sum(not p.growth.stable for p in wrong),
            "bounded_above_the_limit": sum(p.growth.stable for p in wrong),
        },
        notes=[_agreement(points, wrong)],
    )  # fmt: skip


def _agreement(points: list[Point], wrong: list[Point]) -> str:
    worse = [p for p in wrong if not p.growth.stable]
    if worse:
        least = min(worse, key=lambda p: p.ratio)
        return (
            f"{len(worse)} of {len(points)} runs grew below the predicted limit, the earliest at "
            f"{least.ratio:g} of it and damping ratio {least.damping:g}."
        )
    if wrong:
        first = min(p.damping for p in wrong)
        return (
            f"No run grew below the predicted limit; {len(wrong)} of {len(points)} stayed bounded "
            f"above it, from damping ratio {first:g} on: there the limit is on the safe side."
        )
    below = max(p.ratio for p in points if p.ratio < 1.0)
    above = min(p.ratio for p in points if p.ratio > 1.0)
    return (
        f"All {len(points)} runs went as predicted: at {below:g} of the limit nothing grows, at "
        f"{above:g} the stiffest mode does, whatever the damping."
    )


def _sentence(subject: Subject, own: Own, levels: Damping) -> str:
    limit = own.limit
    half = levels.words(0.75 / INTEGRATORS[subject.integrator_name].damping_factor)
    text = f"A step above {limit * 1e3:.4g} ms blows {subject.body.name!r} up"
    if own.step > limit:
        text += f"; the scene asks for {own.step * 1e3:.4g} ms, which tisoft refuses"
    else:
        text += f"; the scene runs at {own.step * 1e3:.4g} ms, {own.step / limit:.2f} of that"
    text += f", and damping of {half} would halve the limit"
    if subject.is_explicit:
        text += "; explicit Euler, which the scene asks for, grows at any step"
    return text + "."


def _draw(figure: Any, points: list[Point], subject: Subject, own: Own, levels: Damping) -> None:
    left, right = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
    factor = INTEGRATORS[subject.integrator_name].damping_factor
    top = max(p.damping for p in points)
    fine = np.linspace(0.0, np.sqrt(1.1 * top), 200) ** 2
    predicted = 1e3 * curve(levels.omega, fine, factor)
    if subject.is_springs:  # C is not in proportion to K: the curve goes through the sharp limits
        known = sorted({(p.damping, p.limit) for p in points})
        fine, predicted = np.array(known).T * np.array([[1.0], [1e3]])
    left.fill_between(fine, predicted, color=pictures.BLUE, alpha=0.07, lw=0)
    left.plot(fine, predicted, color=pictures.BLACK, label="predicted limit", zorder=3)
    for stable, marker, color, label in (
        (True, "o", pictures.BLUE, "run: stable"),
        (False, "x", pictures.RED, "run: grows without end"),
    ):
        some = [p for p in points if p.growth.stable == stable]
        x = [p.damping for p in some]
        left.plot(x, [1e3 * p.ratio * p.limit for p in some], marker, color=color, label=label)
        right.plot(x, [p.ratio for p in some], marker, color=color, label=label)
    zeta = own.damping(levels.mode, levels.omega)
    if zeta <= fine[-1]:
        for ax, y in ((left, 1e3 * own.step), (right, own.step / own.limit)):
            ax.plot(zeta, y, "*", ms=15, color=pictures.ORANGE, mec=pictures.BLACK, mew=0.7,
                    label="this scene", zorder=5, clip_on=False)  # fmt: skip
    right.axhline(1.0, color=pictures.BLACK)
    right.axhspan(0.0, 1.0, color=pictures.BLUE, alpha=0.07, lw=0)
    low = min(0.78, own.step / own.limit - 0.04)
    high = max(1.22, min(2.0, own.step / own.limit + 0.04))
    right.set_ylim(low, high)
    for ax in (left, right):
        ax.set_xscale("function", functions=(_root, _square))
        ax.set_xlim(-0.003, 1.1 * top)
        marks = [t for t in LEVELS if t <= 1.1 * top]
        ax.set_xticks(marks, [f"{t:g}" for t in marks])
        ax.set_xlabel("damping ratio of the stiffest mode [1]")
    left.set_ylim(0.0, None)
    left.set_ylabel("substep [ms]")
    right.set_ylabel("substep / predicted limit [1]")
    left.set_title(f"Which substeps {subject.body.name} survives, and what damping costs")
    right.set_title("One percent decides")
    left.legend(loc="upper right")


def _root(x: Floats) -> Floats:
    return np.sign(x) * np.sqrt(np.abs(x))


def _square(x: Floats) -> Floats:
    return np.sign(x) * x * x
