"""A damping ratio turned into viscosity: φ and η of a solid, the dampers of a net of springs.

Viscosity in proportion to the stiffness, C = τ K, damps a mode of angular frequency ω by

    ζ = τ ω/2     so     τ = 2ζ/ω,  φ = τ λ,  η = τ μ

A net has one damper c for all its springs; with C₁ its viscosity for c = 1 N·s/m and φ₁ its first
shape, c = τ φ₁ᵀKφ₁ / φ₁ᵀC₁φ₁ (for equal springs c = τ k).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from tisoft.body import Body
from tisoft.checks import FieldError, inside
from tisoft.equilibrium.held import Held
from tisoft.equilibrium.modes import body_modes
from tisoft.equilibrium.operators import Elastic, Floats, operators_at_rest
from tisoft.model.part import Part, parts_of
from tisoft.models.materials import MassSpring, Model, SolidModel
from tisoft.scene import Scene

LOOKED_AT = 12
"""Modes among which the first that costs energy is sought: a free body's seventh, for one."""


def resolve_damping(scene: Scene) -> list[Model]:
    """The bodies' models in the scene's order, damping ratios turned into phi and eta [Pa·s], or
    spring_damping [N·s/m].

    Raises:
        FieldError: a body without a natural frequency among its first modes, and no `damping_at`.
    """
    models = []
    for i, body in enumerate(scene.bodies):
        with inside(f"body[{i}]"):
            models.append(damped_model(body))
    return models


def damped_body(body: Body) -> Body:
    """The body itself, or where it has a damping ratio a copy with viscosity in its place; pins and
    loads stay the body's own.
    """
    if body.model.damping_ratio is None:
        return body
    model = damped_model(body)
    regions = body.regions
    if isinstance(model, SolidModel) and model.eta:
        time = model.eta / model.lame_mu  # τ, the same in every region
        own = [region.model(body.model) for region in regions]
        viscous = [(time * m.lame_lambda, time * m.lame_mu) for m in own]  # type: ignore[union-attr]
        regions = [
            replace(region, phi=phi, eta=eta)
            for region, (phi, eta) in zip(regions, viscous, strict=True)
        ]
    return replace(body, model=model, regions=regions)


def damped_model(body: Body) -> Model:
    """The body's model with its damping ratio turned into viscosity."""
    model = body.model
    if model.damping_ratio is None:
        return model
    plain: dict[str, Any] = {"damping_ratio": None, "damping_at": None}
    if model.damping_ratio == 0.0:
        return replace(model, **plain)
    springs = isinstance(model, MassSpring)
    frequency, shape, part = None, None, None
    if springs or model.damping_at is None:
        part = parts_of([replace_model(body, replace(model, **plain))])[0]
        frequency, shape = first_mode(part)
    at = model.damping_at or frequency
    if at is None:
        raise FieldError(
            "damping_ratio",
            "needs the first natural frequency, but the first modes are all motions that cost no "
            "energy; give damping_at in Hz",
            model.damping_ratio,
        )
    time = 2.0 * model.damping_ratio / (2.0 * np.pi * at)  # τ
    if isinstance(model, MassSpring):
        assert part is not None
        return replace(model, spring_damping=time * _stiffness_per_damper(part, shape), **plain)
    return replace(model, phi=time * model.lame_lambda, eta=time * model.lame_mu, **plain)


def replace_model(body: Body, model: Model) -> Body:
    """The same body with another model."""
    return replace(body, model=model)


def first_mode(part: Part) -> tuple[float | None, Floats | None]:
    """The lowest frequency above 0 [Hz] and its shape (nodes, 3), or None among LOOKED_AT modes."""
    frequencies, shapes = body_modes(
        operators_at_rest(part),
        LOOKED_AT,
        held=Held(part, 0.0),
        mass="consistent" if part.is_consistent else "lumped",
    )
    above = np.flatnonzero(frequencies > 0.0)
    if not len(above):
        return None, None
    return float(frequencies[above[0]]), shapes[above[0]]


def body_first_frequency(body: Body) -> float | None:
    """The body's lowest natural frequency above 0 [Hz] with the pins of t = 0, or None."""
    return first_mode(parts_of([body])[0])[0]


def _stiffness_per_damper(part: Part, shape: Floats | None) -> float:
    """φ₁ᵀKφ₁ / φ₁ᵀC₁φ₁ [1/s · N/m / (N·s/m)], or the mean stiffness of a net without modes."""
    if shape is None:
        return float(part.spring_numbers[:, 0].mean())
    assert isinstance(part.body.model, MassSpring)
    body = replace_model(part.body, replace(part.body.model, spring_damping=1.0))
    elastic = Elastic(parts_of([body])[0])
    rest = np.zeros_like(shape)
    stiff = (shape * elastic.stiffness_times(shape, rest)).sum()
    return float(stiff / (shape * elastic.viscosity_times(shape, rest)).sum())
