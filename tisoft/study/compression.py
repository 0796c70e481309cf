"""Model × compression: what each law answers to being squeezed, down to inversion.

The body is deformed uniformly, F = diag(a, t, t), with t such that the sides are free, and its
nodal forces f give the mean nominal stress, P = −(1/V) Σ f ⊗ X: the pull per area at rest.

`closed_forms` has what theory says.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from tisoft.equilibrium.operators import Elastic
from tisoft.study import pictures
from tisoft.study.axis import Axis, Tick
from tisoft.study.closed_forms import Stress, predicted_energy, predicted_stress
from tisoft.study.own import Own
from tisoft.study.subject import NAMES, Subject, with_model

Floats = NDArray[np.float64]
STRETCHES = np.linspace(0.05, 1.4, 28)
FINE = np.linspace(0.02, 1.4, 277)
CONFINED = np.linspace(-1.3, 1.5, 29)
"""Stretches with the sides held, through flat and inverted."""
MODERATE = 0.3
"""Strain up to which springs are compared with their closed form."""


@dataclass(frozen=True)
class Curve:
    """One model's answer."""

    stretch: Floats
    measured: Floats
    """Nominal stress [Pa]."""
    predicted: Floats
    """At `FINE` [Pa]."""
    predicted_there: Floats
    """At `stretch` [Pa]."""
    softest: float | None
    """Stretch of the largest push [1]: below it the body runs away; None where there is none."""
    most: float | None
    """That push [Pa]."""
    energy: Floats
    """At `CONFINED`, sides held [J/m³]."""
    predicted_energy: Floats
    """The closed form there [J/m³]."""

    @property
    def deviation(self) -> float:
        """Largest distance of measured from predicted over the largest stress, at moderate
        stretches.
        """
        near = np.abs(self.stretch - 1.0) <= MODERATE
        far = np.abs(self.measured - self.predicted_there)[near].max()
        return float(far / np.abs(self.predicted_there[near]).max())

    @property
    def mirror(self) -> float:
        """Energy at stretch −1, the mirror image, over that at 0."""
        return float(np.interp(-1.0, CONFINED, self.energy) / np.interp(0.0, CONFINED, self.energy))


def work(subject: Subject) -> int:
    """Number of ticks that `measure` makes."""
    return len(NAMES) * len(STRETCHES)


def measured_stress(elastic: Elastic, volume: float) -> Stress:
    """The stress of a body from its nodal forces."""
    rest = elastic.rest

    def stress(a: float, t: float) -> tuple[float, float]:
        f = elastic.force(rest * (np.array([a, t, t]) - 1.0))
        along, y, z = -np.einsum("ni,ni->i", f, rest) / volume
        return float(along), float(0.5 * (y + z))

    return stress


def free_sides(stress: Stress, a: float, near: float) -> tuple[float, float]:
    """(t, stress along) with no stress across, on the branch that passes `near`."""
    width = 0.01
    while width < 2.0:
        low, high = max(1e-2, near - width), near + width
        if stress(a, low)[1] * stress(a, high)[1] <= 0.0:
            t = brentq(lambda t: stress(a, t)[1], low, high, xtol=1e-13)
            return float(t), stress(a, float(t))[0]
        width *= 1.7
    return near, float("nan")


def _follow(stress: Stress, stretches: Floats, tick: Tick) -> Floats:
    """Stress at each stretch, from rest outwards both ways so that the branch is kept."""
    out = np.full(len(stretches), np.nan)
    start = int(np.argmin(np.abs(stretches - 1.0)))
    for way in (range(start, len(stretches)), range(start - 1, -1, -1)):
        near = 1.0
        for i in way:
            a = float(stretches[i])
            near, out[i] = free_sides(stress, a, near)
            tick()
    return out


def _softest(stress: Stress) -> tuple[float | None, float | None]:
    """Where the push is largest on the way from rest to flat."""

    def pull(a: float) -> float:
        near = 1.0
        for step in np.linspace(1.0, a, 12)[1:]:  # along the branch
            near, value = free_sides(stress, float(step), near)
        return value

    found = minimize_scalar(pull, bounds=(0.02, 0.98), method="bounded", options={"xatol": 1e-7})
    at = float(found.x)
    if not (0.03 < at < 0.97) or not np.isfinite(found.fun):
        return None, None
    return at, -float(found.fun)


def measure(subject: Subject, own: Own, tick: Tick) -> Axis:
    """Squeeze the body with each law."""
    m = subject.material
    curves = {}
    for name in NAMES:
        elastic = Elastic(with_model(subject.solid, subject.model(name)))
        volume = float(subject.solid.volumes.sum())
        measured = measured_stress(elastic, volume)
        along = np.array([1.0, 0.0, 0.0])
        energies = [elastic.energy((a - 1.0) * along * elastic.rest) for a in CONFINED]
        predicted = predicted_stress(name, m)
        curves[name] = Curve(
            STRETCHES,
            _follow(measured, STRETCHES, tick),
            _follow(predicted, FINE, lambda: None),
            _follow(predicted, STRETCHES, lambda: None),
            *_softest(measured),
            np.array(energies) / volume,
            np.array([predicted_energy(name, m)(float(a)) for a in CONFINED]),
        )
    return Axis(
        name="compression",
        title="Compression",
        sentence=_sentence(subject, own, curves),
        columns=(
            "stretch",
            *(f"{n}, {what} [Pa]" for n in NAMES for what in ("measured", "predicted")),
        ),
        rows=[
            (
                float(a),
                *(float(v[i]) for c in curves.values() for v in (c.measured, c.predicted_there)),
            )
            for i, a in enumerate(STRETCHES)
        ],
        draw=lambda figure: _draw(figure, subject, own, curves),
        numbers={
            "least_stretch": own.least_stretch,
            "softening": {name: c.softest for name, c in curves.items()},
            "largest_push": {name: c.most for name, c in curves.items()},
        },
        notes=_notes(subject, own, curves),
    )


def _notes(subject: Subject, own: Own, curves: dict[str, Curve]) -> list[str]:
    solids = max(c.deviation for n, c in curves.items() if n != "mass-spring")
    stable = [NAMES[n] for n, c in curves.items() if c.mirror > 1.0]
    notes = [
        f"Measured from the nodal forces of {subject.solid_name}: the laws of solids meet their "
        f"closed forms within {max(solids, 1e-16):.0e} of the largest stress; its springs, which "
        f"do not point all ways alike, are within {100 * curves['mass-spring'].deviation:.0f} % "
        f"of theirs up to {100 * MODERATE:g} % of strain.",
        "Turned inside out, St. Venant-Kirchhoff and springs end in the mirror image, which has "
        f"no energy, and stay there; {' and '.join(stable)} find their way back.",
    ]
    if own.ended:
        notes.append(f"The scene itself: {own.ended}.")
    return notes


def _sentence(subject: Subject, own: Own, curves: dict[str, Curve]) -> str:
    name = _own_name(subject)
    curve, label = curves[name], NAMES[name]
    if curve.softest is None or curve.most is None:
        text = f"This body's {label} model answers every compression with more push"
        if name == "linear":
            text += ", and turns inside out without a sign once pushed by more than E"
    else:
        text = (
            f"Under a dead load this body's {label} model stops being usable where a part is "
            f"compressed to {curve.softest:.3f} of its length: it pushes back with at most "
            f"{_pressure(curve.most)}, then gives way"
        )
    if own.seconds:
        least = own.least_stretch
        where = f"gets to {least:.3f}" if least > 5e-4 else "is turned inside out"
        text += f"; in {own.seconds:.3g} s of this scene the worst part {where}"
    return text + "."


def _own_name(subject: Subject) -> str:
    if subject.is_springs:
        return "mass-spring"
    kind = type(subject.body.model).__name__
    return {"NeoHookean": "neo-hookean", "Linear": "linear", "MassTensor": "linear"}.get(
        kind, "viscoelastic"
    )


def _pressure(value: float) -> str:
    scale, unit = _unit(value)
    return f"{value / scale:.4g} {unit}"


def _unit(value: float) -> tuple[float, str]:
    for scale, unit in ((1e9, "GPa"), (1e6, "MPa"), (1e3, "kPa")):
        if value >= scale:
            return scale, unit
    return 1.0, "Pa"


def _draw(figure: Any, subject: Subject, own: Own, curves: dict[str, Curve]) -> None:
    left, right = figure.subplots(1, 2, width_ratios=(1.3, 1.0))
    young = subject.material.young
    scale, unit = _unit(0.3 * young)
    for name, curve in curves.items():
        look: dict[str, Any] = {
            "color": pictures.COLORS[name], "mfc": "white", "mew": 1.2, "ms": 4.5,
            "marker": pictures.MARKERS[name], "ls": "", "label": NAMES[name],
        }  # fmt: skip
        left.plot(FINE, curve.predicted / scale, color=look["color"], lw=1.3)
        left.plot(curve.stretch, curve.measured / scale, **look)
        right.plot(CONFINED, curve.predicted_energy / scale, color=look["color"], lw=1.3)
        right.plot(CONFINED, curve.energy / scale, **look)
    for ax in (left, right):
        ax.plot([], [], color=pictures.GREY, lw=1.3, label="closed forms")
    soft = curves["viscoelastic"]
    if soft.softest is not None and soft.most is not None:
        left.annotate(
            f"St. Venant-Kirchhoff gives way\nat {soft.softest:.4f} (1/√3), {_pressure(soft.most)}",
            (soft.softest, -soft.most / scale), (0.04, 0.28 * young / scale),
            arrowprops={"arrowstyle": "->", "color": pictures.BLUE}, color=pictures.BLUE,
        )  # fmt: skip
    if own.seconds:
        for ax in (left, right):
            ax.axvline(max(own.least_stretch, CONFINED[0]), color=pictures.BLACK, ls=":", lw=1.4,
                       label="this scene's worst part")  # fmt: skip
    left.axhline(0.0, color="#999999", lw=0.8)
    left.set_xlim(0.0, FINE[-1])
    left.set_ylim(-1.0 * young / scale, 0.55 * young / scale)
    left.set_ylabel(f"nominal stress: pull per area at rest [{unit}]")
    left.set_title("Squeezed hard, with free sides, models stop pushing back")
    right.axvspan(CONFINED[0], 0.0, color=pictures.RED, alpha=0.07, lw=0)
    right.set_xlim(CONFINED[0], CONFINED[-1])
    right.set_ylim(-0.04 * young / scale, 1.15 * young / scale)
    right.text(0.5 * CONFINED[0], 1.08 * young / scale, "inverted", ha="center", color=pictures.RED)
    right.set_ylabel(f"elastic energy, sides held [{unit.replace('Pa', 'J')}/m³]")
    right.set_title("Turned inside out, two of them stay so")
    for ax in (left, right):
        ax.set_xlabel("stretch: length / length at rest [1]")
    left.legend(loc="lower right")
