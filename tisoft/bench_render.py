"""How fast pictures are: milliseconds a frame by size and triangles, stage by stage.

A bumpy ball that moves over a ground, with its shadow, seen by a camera that stands still.
"""

from __future__ import annotations

import statistics
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime

SIZES = ((640, 360), (1280, 720))
CELLS = {1_000: 9, 10_000: 29, 50_000: 65}
"""Cells along each side of the cube that is blown up, by the triangles that come of it."""
FRAMES = 9


def measure(size: tuple[int, int], triangles: int, *, arch: str = "cpu") -> dict[str, Any]:
    """Medians over some frames, in milliseconds: of all, and of every stage."""
    runtime.import_taichi()
    runtime.start(arch)
    from tisoft.render.camera import auto_camera
    from tisoft.render.items import Surface
    from tisoft.render.obstacles import cube
    from tisoft.render.renderer import Renderer

    points, faces = cube(CELLS[triangles])
    rest = _bumpy(points)
    body = Surface(rest, faces, (0.9, 0.36, 0.27), translucent=0.8)
    camera = auto_camera((-1.4, 0.0, -1.2), (1.4, 2.1, 1.2), aspect=size[0] / size[1])
    renderer = Renderer(size, ground=0.0)
    renderer.draw([body], camera)  # compiles
    laps: dict[str, list[float]] = {}
    last = 0.0

    def lap(stage: str) -> None:
        nonlocal last
        now = time.perf_counter()
        laps.setdefault(stage, []).append(1e3 * (now - last))
        last = now

    renderer.lap = lap
    whole = []
    for k in range(FRAMES):
        body.positions = rest + 0.1 * np.sin(0.2 * k) * np.eye(3)[1]
        begun = last = time.perf_counter()
        renderer.draw([body], camera)
        whole.append(1e3 * (time.perf_counter() - begun))
    return {
        "size": list(size),
        "triangles": len(faces),
        "milliseconds": statistics.median(whole),
        "stages": {stage: statistics.median(times) for stage, times in laps.items()},
        "arch": arch,
    }


def _bumpy(points: NDArray[np.float64]) -> NDArray[np.float64]:
    ball = np.tan(points * np.pi / 4)
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    x, y, _ = ball.T
    radius = 1.0 + 0.15 * np.sin(5 * x + 1) * np.sin(4 * y)
    return ball * radius[:, None] * [1.2, 0.8, 0.8] + [0.0, 1.1, 0.0]


def as_text(rows: list[dict[str, Any]]) -> str:
    """A table of the rows."""
    stages = list(rows[0]["stages"])
    head = f"{'size':>11}{'triangles':>11}{'ms':>8}" + "".join(f"{s:>12}" for s in stages)
    lines = [head]
    for row in rows:
        width, height = row["size"]
        cells = "".join(f"{row['stages'][s]:>12.1f}" for s in stages)
        name = f"{width}x{height}"
        lines.append(f"{name:>11}{row['triangles']:>11,}{row['milliseconds']:>8.1f}" + cells)
    return "\n".join(lines)
