"""Small pictures of variants: the mesh's surface under its loads, a painter's drawing."""

from __future__ import annotations

import base64
import io
import time
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tisoft.observers.framing import up_of
from tisoft.scene import Scene
from tisoft.study import pictures

if TYPE_CHECKING:
    from tisoft.charting.survey import Survey

Floats = NDArray[np.float64]

MOST_FACES = 12_000
SIZE = (3.4, 2.3)
"""Inches."""


def pictures_of(survey: Survey, seconds: float) -> dict[str, str]:
    """Pictures of a survey's judged variants as data addresses, the front first, for some seconds;
    the first one always."""
    begun = time.perf_counter()
    made: dict[str, str] = {}
    for one in sorted(survey.judged(), key=lambda v: (not v.current, not v.pareto, v.cost)):
        if made and time.perf_counter() - begun > seconds:
            break
        variant = survey.judging.named(one.name)
        static = survey.asking.known("static", survey.judging.shares_errors(variant))
        drawn = picture(survey.asking.bench.scene(variant), static and static.get("shape"))
        if drawn is not None:
            made[one.name] = drawn
    return made


def picture(scene: Scene, shape: Any) -> str | None:
    """A PNG as a data address; None where there is too much to draw.

    Args:
        scene: the variant.
        shape: displacements [m], shape (nodes, 3), or None for the rest shape.
    """
    faces, tones, lines = _drawn(scene, shape)
    if (not len(faces) and not len(lines)) or len(faces) > MOST_FACES:
        return None
    from matplotlib.collections import LineCollection, PolyCollection

    with pictures.matplotlib_style() as figure_class:
        figure = figure_class(figsize=SIZE, layout="none")
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        if len(faces):
            colors = np.clip(tones, 0.0, 1.0)[:, None] * np.array([0.62, 0.78, 0.93])
            width = 0.5 if len(faces) < 3000 else 0.15
            axes.add_collection(
                PolyCollection(list(faces), facecolors=colors, edgecolors="#223", linewidths=width)
            )
        if len(lines):
            axes.add_collection(LineCollection(list(lines), colors="#2b5f8f", linewidths=0.6))
        flat = np.concatenate([np.reshape(part, (-1, 2)) for part in (*faces, *lines)])
        low, high = flat.min(axis=0), flat.max(axis=0)
        room = 0.06 * float((high - low).max() or 1.0)
        axes.set_xlim(low[0] - room, high[0] + room)
        axes.set_ylim(low[1] - room, high[1] + room)
        axes.set_aspect("equal")
        axes.axis("off")
        png = io.BytesIO()
        figure.savefig(png, format="png", dpi=100, metadata={"Software": None})
    return "data:image/png;base64," + base64.b64encode(png.getvalue()).decode()


def _drawn(scene: Scene, shape: Any) -> tuple[list[Floats], Floats, list[Floats]]:
    """Faces of the surface from behind to before, their brightness, and lines of nets."""
    right, up, toward = _view(scene)
    u = None if shape is None else np.asarray(shape, np.float64)
    faces, depths, tones, lines, begun = [], [], [], [], 0
    for body in scene.bodies:
        x = body.mesh.points.copy()
        if u is not None:
            x = x + u[begun : begun + len(x)]
        begun += len(x)
        flat = np.stack([x @ right, x @ up], axis=1)
        if not body.mesh.elements:
            lines += list(flat[body.springs()])
            continue
        for own in body.mesh.boundary.faces:
            ring = own[:, _around(own.shape[1])]
            corners = x[own[:, :3]]
            normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
            front = normal @ toward > 0.0
            faces += list(flat[ring[front]])
            depths.append((x[ring].mean(axis=1) @ toward)[front])
            light = normal[front] @ (0.75 * toward + 0.6 * up + 0.25 * right)
            tones.append(0.45 + 0.5 * light)
    if not faces:
        return [], np.empty(0), lines
    order = np.argsort(np.concatenate(depths), kind="stable")
    return [faces[k] for k in order], np.concatenate(tones)[order], lines


def _around(nodes: int) -> list[int]:
    """Nodes of a face in the order of its rim: corners, and middles of edges between them."""
    return [0, 3, 1, 4, 2, 5] if nodes == 6 else list(range(nodes))


def _view(scene: Scene) -> tuple[Floats, Floats, Floats]:
    """Right, up and toward the eye."""
    up = up_of(scene)
    points = np.concatenate([body.mesh.points for body in scene.bodies])
    extent = np.ptp(points, axis=0) * (1.0 - np.abs(up))
    along = np.zeros(3)
    along[int(np.argmax(extent))] = 1.0
    along = along - (along @ up) * up
    along /= max(float(np.linalg.norm(along)), 1e-300)
    side = np.cross(along, up)
    toward = 0.86 * side + 0.35 * up + 0.36 * along
    toward /= np.linalg.norm(toward)
    right = np.cross(up, toward)
    right /= np.linalg.norm(right)
    return right, np.cross(toward, right), toward
