"""How fast this machine is: substeps of boxes from 240 to 240,000 tets, and compile times.

Boxes of 1 x 0.2 x 0.2 m in 6 tets a cell, clamped at x = 0; E = 1e6 Pa, ν = 0.3, 1000 kg/m³,
φ = 20, η = 10 Pa·s; mass-spring on their edges, undamped; hex8: a hexahedron a cell; tet10:
quadratic tets, 6 to a cell of twice the size.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Any

from tisoft import runtime, where
from tisoft.errors import SceneError
from tisoft.geometry.mesh import Mesh
from tisoft.geometry.shapes import box
from tisoft.geometry.solid import quadratic
from tisoft.models.materials import MassSpring, Model, ViscoElastic
from tisoft.scene import Scene

SIZES = {
    "XS": (10, 2, 2),
    "S": (20, 4, 4),
    "M": (40, 8, 8),
    "L": (60, 12, 12),
    "XL": (100, 20, 20),
}
SOLID = ViscoElastic(1e6, 0.3, 1000.0, phi=20.0, eta=10.0)
MODELS: dict[str, Model] = {
    "viscoelastic": SOLID,
    "hex8": SOLID,
    "tet10": SOLID,
    "mass-spring": MassSpring(young=1e6, density=1000.0),
}
ROUNDS = 3
SUBSTEPS = 64
"""Substeps per call where the step is fixed."""
FRAMES = 30
"""Frames per call where it is followed."""


class _Recorded:
    """An observer that reads the probes of each frame, and no state."""

    looks_every = 0

    def on_frame(self, frame: Any) -> None:
        frame.probes()


def beam(size: str, model: str, *, precision: str = "f32") -> Scene:
    """The scene that is timed."""
    scene = Scene(precision=precision, frame_rate=60.0)
    body = scene.add_body(_mesh(size, model), MODELS[model], "beam")
    body.pin(where.box((-1e-6, -1.0, -1.0), (1e-6, 1.0, 1.0)))
    scene.add_probe("tip", body, point=(1.0, 0.1, 0.1))
    return scene


def _mesh(size: str, model: str) -> Mesh:
    shape, cells = (1.0, 0.2, 0.2), SIZES[size]
    if model == "hex8":
        return box(shape, cells, split="hex")
    if model == "tet10":
        return quadratic(box(shape, [n // 2 for n in cells], split="six"))
    return box(shape, cells, split="six")


def measure(
    size: str,
    model: str,
    *,
    arch: str = "cpu",
    precision: str = "f32",
    seconds: float = 1.0,
    threads: int | None = None,
) -> dict[str, Any]:
    """Speed of one model at one size; takes about 2 × `seconds`.

    `element_substeps_per_second` is of substeps of a fixed step, `followed` of frames at 60 per
    second as `tisoft run` makes them, with the step followed and a probe recorded; `share` is their
    quotient, `frame_microseconds` what a frame costs beyond its substeps, and `bytes_per_element`
    the memory of the scene's fields.
    """  # fmt: skip
    runtime.import_taichi()
    from tisoft.simulation import Simulation

    scene = beam(size, model, precision=precision)
    sim = Simulation(scene, arch=arch, threads=threads)
    elements = sim.system.elements or sim.system.springs
    step = 0.5 * sim.limit.bound()

    def substeps(count: int) -> int:
        sim.stepper.advance(count, step, sim.gravity_now)
        return count

    made = [0, 0]

    def frames(count: int) -> int:
        before, first = sim.substeps, sim.frame
        sim.run(count / scene.frame_rate, observers=[_Recorded()])
        made[0] += sim.frame - first
        made[1] += sim.substeps - before
        return sim.substeps - before

    fixed = _rate(substeps, SUBSTEPS, seconds)
    followed = _rate(frames, FRAMES, seconds)
    each = made[1] / max(1, made[0])
    return {
        "model": model,
        "size": size,
        "cells": list(SIZES[size]),
        "elements": elements,
        "element_substeps_per_second": elements * fixed,
        "followed": elements * followed,
        "share": followed / fixed,
        "frame_microseconds": 1e6 * each * (1.0 / followed - 1.0 / fixed),
        "bytes_per_element": sim.system.bytes_used() / max(1, elements),
        "microseconds_per_substep": 1e6 / fixed,
        "threads": sim.stepper.pace.threads(),
        "arch": sim.arch,
        "precision": precision,
    }


def _rate(advance: Callable[[int], int], chunk: int, seconds: float) -> float:
    """Substeps per second of wall time: the median of some rounds of calls advance(chunk)."""
    advance(chunk)
    rates = []
    for _ in range(ROUNDS):
        made, spent, begun = 0, 0.0, time.perf_counter()
        while spent < seconds / ROUNDS:
            made += advance(chunk)
            spent = time.perf_counter() - begun
        rates.append(made / spent)
    return statistics.median(rates)


def compile_seconds(model: str, *, arch: str = "cpu", precision: str = "f32") -> dict[str, float]:
    """Seconds that the kernels take to compile: cold, and warm from the cache on disk."""
    program = (
        "from tisoft.bench import beam, SIZES; from tisoft import runtime; "
        "runtime.import_taichi(); from tisoft.simulation import Simulation; "
        f"sim = Simulation(beam('XS', {model!r}, precision={precision!r}), arch={arch!r}); "
        "print(sim.compile_seconds)"
    )
    found = {}
    with tempfile.TemporaryDirectory() as cache:
        environment = os.environ | {"TI_OFFLINE_CACHE_FILE_PATH": cache}
        for kind in ("cold", "warm"):
            done = subprocess.run(
                [sys.executable, "-c", program],
                env=environment,
                capture_output=True,
                text=True,
                check=False,
            )
            if done.returncode != 0:
                last = (done.stderr.strip().splitlines() or ["no message"])[-1]
                raise SceneError(f"compiling {model} failed: {last}")
            found[kind] = float(json.loads(done.stdout.split()[-1]))
    return found


def as_text(rows: list[dict[str, Any]]) -> str:
    """A table of the rows."""
    lines = [
        f"{'model':13}{'size':>5}{'elements':>10}{'M elements x substeps/s':>26}{'followed':>10}"
        f"{'share':>7}{'µs/frame':>10}{'B/element':>11}"
        f"{'µs/substep':>12}{'threads':>9}{'compile cold':>14}{'warm':>7}"
    ]
    for row in rows:
        speed, followed = (row[key] / 1e6 for key in ("element_substeps_per_second", "followed"))
        compiled = row.get("compile_seconds", {})
        cold, warm = (f"{compiled[k]:.2f} s" if k in compiled else "-" for k in ("cold", "warm"))
        lines.append(
            f"{row['model']:13}{row['size']:>5}{row['elements']:>10}{speed:>26.1f}"
            f"{followed:>10.1f}{row['share']:>7.2f}{row['frame_microseconds']:>10.0f}"
            f"{row['bytes_per_element']:>11.0f}"
            f"{row['microseconds_per_substep']:>12.1f}{row['threads']:>9}"
            f"{cold:>14}{warm:>7}"
        )
    return "\n".join(lines)
