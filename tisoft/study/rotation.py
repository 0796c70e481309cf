"""Model × rotation: a rigid turn must cost no force and change no shape.

linear: e = (cos θ − 1) in the plane of rotation, so a turned body pushes outwards with
    2(λ + μ)(1 − cos θ);  spun freely it keeps its velocity and grows by √(1 + (ωt)²)
the others see FᵀF or lengths only: 0
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.equilibrium.operators import Elastic
from tisoft.models.materials import lame_constants
from tisoft.scene import Scene
from tisoft.simulation import Simulation
from tisoft.study import pictures
from tisoft.study.axis import Axis, Tick
from tisoft.study.own import Own
from tisoft.study.subject import NAMES, Subject, with_model

Floats = NDArray[np.float64]

ANGLES = np.radians([0.0, 1.0, 2.0, 5.0, *range(10, 95, 5)])
LAST = 3.0
"""Angle ω t [rad] at which the spin ends."""
LOOKS = 30
CENTRIFUGAL = 1e-3
"""Strain ρ ω² r²/E that the spin causes, about."""
SPEEDUP = 3.0
"""How much faster a stiff and finely meshed body may be spun to save substeps."""
MOST_SUBSTEPS = 4000


@dataclass(frozen=True)
class Turned:
    """One model, turned and spun."""

    stress: Floats
    """Largest false stress at each of ANGLES [Pa]."""
    size: Floats
    """Size over size at the start, at each of LOOKS + 1 times."""


def work(subject: Subject) -> int:
    """Number of ticks that `measure` makes."""
    return len(NAMES) * len(ANGLES) + LOOKS


def false_stress(elastic: Elastic, volume: float, angle: float) -> float:
    """Mean stress in the plane of rotation [Pa] of a body turned about z, from nodal forces."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    f = elastic.force(elastic.rest @ (turn - np.eye(3)).T)
    return float(np.abs(f.T @ elastic.rest).max() / volume)


def spin(subject: Subject, tick: Tick) -> tuple[Floats, dict[str, Floats]]:
    """Angles ω t [rad] and sizes of free bodies of each model, spun about z."""
    m = subject.material
    scene = Scene(gravity=(0.0, 0.0, 0.0), precision="f64")
    rate = float(np.sqrt(CENTRIFUGAL * m.young / m.density) / (0.5 * subject.size[:2].max()))
    for name in NAMES:
        scene.add_body(subject.solid, subject.model(name), name).contact = False
    sim = Simulation(scene, certify=False)
    step = 0.7 * sim.limit.sharp()
    most = min(SPEEDUP, max(1.0, LAST / (rate * step * MOST_SUBSTEPS)))
    rate *= most
    last = min(LAST, rate * step * MOST_SUBSTEPS)
    scene.step = step
    scene.frame_rate = LOOKS * rate / last
    arms = [b.mesh.points - _middle(b.mesh.points, sim.masses()[p.nodes]) for b, p in _pairs(sim)]
    velocity = np.concatenate([np.cross([0.0, 0.0, rate], arm) for arm in arms])
    sim.set_state(sim.positions(), velocity)
    sizes: dict[str, list[float]] = {name: [1.0] for name in NAMES}
    before = {b.name: _radius(sim, b) for b, _ in _pairs(sim)}
    for _ in range(LOOKS):
        sim.step()
        for body, _ in _pairs(sim):
            sizes[body.name].append(_radius(sim, body) / before[body.name])
        tick()
    angles = np.arange(LOOKS + 1) * last / LOOKS
    return angles, {name: np.array(size) for name, size in sizes.items()}


def _pairs(sim: Simulation) -> list[tuple[Any, Any]]:
    return [(part.body, part) for part in sim.parts]


def _middle(points: Floats, masses: Floats) -> Floats:
    middle: Floats = masses @ points / masses.sum()
    return middle


def _radius(sim: Simulation, body: Any) -> float:
    """Radius of gyration about z, up to a factor [m]."""
    part = sim.part(body)
    masses = sim.masses()[part.nodes]
    x = sim.positions(body)
    arm = (x - _middle(x, masses))[:, :2]
    return float(np.sqrt(masses @ (arm * arm).sum(axis=1)))


def measure(subject: Subject, own: Own, tick: Tick) -> Axis:
    """Turn and spin the body with each model."""
    volume = float(subject.solid.volumes.sum())
    stress = {}
    for name in NAMES:
        elastic = Elastic(with_model(subject.solid, subject.model(name)))
        found = []
        for angle in ANGLES:
            found.append(false_stress(elastic, volume, float(angle)))
            tick()
        stress[name] = np.array(found)
    turned, sizes = spin(subject, tick)
    lam, mu = lame_constants(subject.material.young, subject.material.poisson)
    predicted = 2.0 * (lam + mu) * (1.0 - np.cos(ANGLES))
    others = max(float(s.max()) for n, s in stress.items() if n != "linear")
    return Axis(
        name="rotation",
        title="Rotation",
        sentence=_sentence(subject, own),
        columns=(
            "angle [deg]",
            "predicted for linear [Pa]",
            *(f"{name}, false stress [Pa]" for name in NAMES),
            "angle of the spin [deg]",
            "predicted for linear [1]",
            *(f"{name}, size [1]" for name in NAMES),
        ),
        rows=_rows(predicted, stress, turned, sizes),
        draw=lambda figure: _draw(figure, subject, own, stress, turned, sizes),
        numbers={
            "one_percent_degrees": cost_angle(0.01),
            "ten_percent_degrees": cost_angle(0.1),
            "most_turn_degrees": float(np.degrees(own.most_turn)) if own.seconds else None,
            "false_stress_of_others": others,
            "growth_of_linear": float(sizes["linear"][-1]),
        },
        notes=[_note(subject, stress, predicted, turned, sizes)],
    )


def _note(
    subject: Subject,
    stress: dict[str, Floats],
    predicted: Floats,
    turned: Floats,
    sizes: dict[str, Floats],
) -> str:
    largest = float(predicted.max())
    far = float(np.abs(stress["linear"] - predicted).max()) / largest
    others = max(float(s.max()) for n, s in stress.items() if n != "linear") / largest
    grown = float(np.abs(sizes["linear"] / np.hypot(1.0, turned) - 1.0).max())
    return (
        f"Measured on {subject.solid_name}: linear FEM's false stress meets 2(λ+μ)(1 − cos θ) "
        f"within {max(far, 1e-16):.0e} of its largest; that of the others stays below "
        f"{max(others, 1e-16):.0e} of it.  Spun freely, linear FEM grows by √(1 + (ωt)²) within "
        f"{max(grown, 1e-16):.0e}; the others stretch by what the centrifugal force asks for."
    )


def cost_angle(strain: float) -> float:
    """The angle [degrees] at which linear FEM sees a false strain of `strain`."""
    return float(np.degrees(np.arccos(1.0 - strain)))


def _rows(
    predicted: Floats, stress: dict[str, Floats], turned: Floats, sizes: dict[str, Floats]
) -> list[list[Any]]:
    left = np.column_stack([np.degrees(ANGLES), predicted, *stress.values()]).tolist()
    grown = np.hypot(1.0, turned)
    right = np.column_stack([np.degrees(turned), grown, *sizes.values()]).tolist()
    count = max(len(left), len(right))
    blank = [[""] * len(NAMES) + ["", ""]]
    left, right = (a + blank * (count - len(a)) for a in (left, right))
    return [a + b for a, b in zip(left, right, strict=True)]


def _sentence(subject: Subject, own: Own) -> str:
    one, ten = cost_angle(0.01), cost_angle(0.1)
    text = (
        f"Linear FEM and mass-tensors stop being usable where a part turns by {one:.1f}° (false "
        f"strain of 1 %) to {ten:.1f}° (10 %)"
    )
    if own.seconds and subject.body.mesh.elements and not subject.is_springs:
        turn = float(np.degrees(own.most_turn))
        verdict = "are no choice for it" if turn > ten else "serve it"
        if one < turn <= ten:
            verdict = "are a few percent off"
        text += (
            f"; in {own.seconds:.3g} s of this scene parts turn by up to {turn:.1f}°, "
            f"so they {verdict}"
        )
    return text + "; the other models feel no rotation at all."


def _draw(
    figure: Any, subject: Subject, own: Own, stress: dict[str, Floats], turned: Floats,
    sizes: dict[str, Floats],
) -> None:  # fmt: skip
    left, right = figure.subplots(1, 2)
    m = subject.material
    lam, mu = lame_constants(m.young, m.poisson)
    fine = np.radians(np.linspace(0.0, 90.0, 181))
    share = 2.0 * (lam + mu)
    left.plot(np.degrees(fine), 100.0 * (1.0 - np.cos(fine)), color=pictures.RED, lw=1.4,
              label="predicted for linear: 1 − cos θ")  # fmt: skip
    sweep = np.linspace(0.0, turned[-1], 200)
    right.plot(np.degrees(sweep), np.hypot(1.0, sweep), color=pictures.RED, lw=1.4,
               label="predicted for linear: √(1 + (ωt)²)")  # fmt: skip
    for name, label in NAMES.items():
        look = {
            "color": pictures.COLORS[name], "mfc": "none", "mew": 1.2, "label": label,
            "ms": pictures.SIZES[name],
        }  # fmt: skip
        marker = pictures.MARKERS[name]
        left.plot(np.degrees(ANGLES), 100.0 * stress[name] / share, marker, **look)
        right.plot(np.degrees(turned), sizes[name], marker, **look)
    for strain, marker in ((0.01, "v"), (0.1, "P")):
        angle = cost_angle(strain)
        left.plot(angle, 100.0 * strain, marker, color=pictures.BLACK, ms=7, zorder=5,
                  label=f"{100 * strain:.0f} % at {angle:.1f}°")  # fmt: skip
    if own.seconds and own.most_turn > 0.0:
        turn = min(90.0, float(np.degrees(own.most_turn)))
        left.axvline(turn, color=pictures.BLACK, ls=":", label="this scene's largest turn")
    left.set_xlabel("rigid turn θ [degrees]")
    left.set_ylabel("false strain [%]")
    left.set_xlim(0.0, 92.0)
    left.set_title("Turned, linear FEM feels strain that is not there")
    right.set_xlabel("angle ωt since the start of a free spin [degrees]")
    right.set_ylabel("size / size at the start [1]")
    right.set_title("Spinning, it grows for ever")
    for ax in (left, right):
        ax.legend(loc="upper left")
