"""The picture of `tisoft check`: what sets the step, or the worst mechanism of springs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tisoft.check.limiting import RestLimits, rest_limits
from tisoft.check.report import Report
from tisoft.observers.framing import Survey, camera_of, ground_of, up_of
from tisoft.observers.scenery import body_items, obstacle_items, with_bar
from tisoft.render.colormap import colors_of
from tisoft.render.items import Capsules, Item, Spheres, Surface
from tisoft.render.overlay import ColorBar, draw_caption
from tisoft.render.renderer import Renderer
from tisoft.render.video import open_sink
from tisoft.simulation import Simulation

Floats = NDArray[np.float64]

SWING = 0.15
"""Length of the largest motion of a mechanism as drawn, as a share of the body's size."""
FAINT = (0.72, 0.74, 0.77)


def draw_check(path: str | Path, sim: Simulation, report: Report) -> None:
    """Draw the scene at rest into a file: mechanisms where there are any, else the stable step.

    Raises SceneError where the file cannot be written.
    """
    scene = sim.scene
    rest = np.concatenate([body.mesh.points for body in scene.bodies])
    survey = Survey(rest.min(axis=0), rest.max(axis=0))
    with open_sink(path, scene.render.size, scene.frame_rate) as sink:
        up = up_of(scene)
        camera = camera_of(scene, survey)
        renderer = Renderer(scene.render.size, samples=scene.render.samples, up=tuple(up))
        floor = ground_of(scene, up)
        items = obstacle_items(scene, floor, survey)
        if report.mechanisms:
            items += _mechanisms(sim, rest, report)
            picture = renderer.draw(items, camera)
            sink.write(
                draw_caption(picture, "grey: rest; coloured: a motion that no spring resists")
            )
            return
        bodies, bar = _limits(sim, rest)
        sink.write(with_bar(renderer.draw(items + bodies, camera), bar))


def _mechanisms(sim: Simulation, rest: Floats, report: Report) -> list[Item]:
    items: list[Item] = []
    start = 0
    for number, body in enumerate(sim.scene.bodies):
        moved = rest.copy()
        motion = report.mechanisms.get(body.name)
        nodes = slice(start, start + len(body.mesh.points))
        plain = _as_net(sim, number, rest, start)
        if motion is not None:
            moved[nodes] += motion * SWING * float(np.ptp(body.mesh.points, axis=0).max())
            items += _as_net(sim, number, moved, start)
        for item in plain:
            item.color = FAINT
            if not isinstance(item, Surface):
                item.radius *= 0.6  # inside the coloured ones, where nothing moves
        items += plain
        start = nodes.stop
    return items


def _as_net(sim: Simulation, number: int, positions: Floats, start: int) -> list[Item]:
    body = sim.scene.bodies[number]
    return body_items(body, start, positions, number, wireframe=False, net=True)


def _limits(sim: Simulation, rest: Floats) -> tuple[list[Item], ColorBar]:
    """Bodies coloured by the least bound on the step among the elements at each node."""
    steps = np.concatenate([_at_nodes(limit) for limit in rest_limits(sim)])
    known = np.isfinite(steps)
    lo = float(steps[known].min()) if known.any() else 0.0
    hi = float(np.percentile(steps[known], 95.0)) if known.any() else 1.0
    colors = colors_of(np.where(known, steps, hi), lo, max(hi, lo * (1.0 + 1e-6)))
    items: list[Item] = []
    start = 0
    for number, body in enumerate(sim.scene.bodies):
        made = body_items(body, start, rest, number, wireframe=True)
        for item in made:
            item.color = colors[item.nodes] if isinstance(item, Spheres) else colors
            if isinstance(item, Capsules) and len(item.edges) == len(colors):
                item.color = colors[item.edges[:, 0]]  # else one per edge would be understood
        items += made
        start += len(body.mesh.points)
    return items, ColorBar("stable step", "s", lo, hi)


def _at_nodes(limit: RestLimits) -> Floats:
    part, steps = limit.part, limit.steps()
    inside = np.full(len(part.order), np.inf)
    if limit.kind == "spring":
        for column in part.springs.T:
            np.minimum.at(inside, column, steps)
    else:
        used = np.concatenate([cells.nodes.ravel() for cells in part.solids])
        inside[np.unique(used)] = steps
    least = np.empty_like(inside)
    least[part.order] = inside
    return least
