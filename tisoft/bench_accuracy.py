"""What an error costs: beams of each element against references, and seconds of computing.

Beams of 1 x 0.2 x 0.2 m, E = 1e6 Pa, ν = 0.3, 1000 kg/m³, clamped at x = 0:

    bending   work of 1 N of shear at the end, 2.544e-3 J; with ν = 0.49 2.497e-3 J
    torsion   stiffness against a turn of the end, 87.077 N·m

(converged quadratic hexahedra).  Deflections are those of linear elasticity, K u = f at rest; cost
is that of St. Venant-Kirchhoff bodies on one thread: seconds a substep over the stable step.  The
cost of an error lies between two meshes on a straight line in logarithms, or beyond the finest at
its slope; a mesh whose error is small by luck, while a finer one's is not, does not count.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import runtime, where
from tisoft.geometry.mesh import Mesh
from tisoft.geometry.shapes import box
from tisoft.geometry.solid import quadratic
from tisoft.models.materials import ViscoElastic
from tisoft.scene import Scene

Floats = NDArray[np.float64]

SHAPE = (1.0, 0.2, 0.2)
CELLS: dict[str, list[tuple[int, int, int]]] = {
    "tet4": [(10, 2, 2), (20, 4, 4), (40, 8, 8)],
    "tet10": [(5, 1, 1), (10, 2, 2), (20, 4, 4)],
    "hex8": [(5, 1, 1), (10, 2, 2), (20, 4, 4)],
}
"""Meshes by element; tets are five to a cell."""
BENDING = {0.3: 2.544e-3, 0.49: 2.497e-3}
"""Work of the end shear [J] by Poisson's ratio."""
TORSION = 87.077
"""[N·m]"""
GOAL = 0.02
"""The error whose cost is told."""
ROUNDS = 3
QUANTITIES = {"bending": "bending", "torsion": "torsion", "locking": "bending, ν = 0.49"}


def mesh_of(element: str, cells: tuple[int, int, int]) -> Mesh:
    """The beam's mesh."""
    if element == "hex8":
        return box(SHAPE, cells, split="hex")
    linear = box(SHAPE, cells)
    return quadratic(linear) if element == "tet10" else linear


def beam(mesh: Mesh, poisson: float) -> Scene:
    """The clamped beam."""
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    body = scene.add_body(mesh, ViscoElastic(1e6, poisson, 1000.0), "beam")
    body.pin(where.box((-1e-6, -1.0, -1.0), (1e-6, 1.0, 1.0)))
    return scene


def measure(element: str, cells: tuple[int, int, int], *, arch: str = "cpu") -> dict[str, Any]:
    """Errors (relative), step [s] and seconds of computing a simulated second of one mesh."""
    mesh = mesh_of(element, cells)
    row: dict[str, Any] = {"element": element, "cells": list(cells), "elements": mesh.elements}
    bending, step = {}, {}
    for poisson, reference in BENDING.items():
        work, stiffness, step[poisson] = _at_rest(mesh, poisson)
        bending[poisson] = work / reference - 1.0
        if poisson == 0.3:
            row["torsion"] = stiffness / TORSION - 1.0
    substep = _substep(mesh, step[0.3], arch)
    row |= {
        "bending": bending[0.3],
        "locking": bending[0.49],
        "step": step[0.3],
        "cost": {
            "bending": substep / step[0.3],
            "torsion": substep / step[0.3],
            "locking": substep / step[0.49],
        },
    }
    return row


def _at_rest(mesh: Mesh, poisson: float) -> tuple[float, float, float]:
    """Work of the end shear [J], torsional stiffness [N·m] and step [s]."""
    from scipy.sparse.linalg import splu

    from tisoft.equilibrium.at_rest import AtRest
    from tisoft.model.part import parts_of
    from tisoft.stable.limit import SHARE
    from tisoft.stable.sharp import sharp_limit

    (part,) = parts_of(beam(mesh, poisson).bodies)
    elastic: Any = AtRest(part)
    stiffness = elastic.stiffness()
    points = mesh.points[part.order]
    held = np.repeat(points[:, 0] < 1e-9, 3)
    end = points[:, 0] > SHAPE[0] - 1e-9
    factor = splu(stiffness[~held][:, ~held].tocsc())
    load = np.zeros_like(points)
    faces = mesh.boundary.within(mesh.points[:, 0] > SHAPE[0] - 1e-9)
    load[:, 2] = -mesh.boundary.area_shares(mesh.points, faces)[part.order] / (0.2 * 0.2)
    pushed = load.ravel()[~held]
    work = float(pushed @ factor.solve(pushed))
    turned = np.zeros_like(points)
    arm = points[end] - [SHAPE[0], 0.1, 0.1]
    turned[end] = np.stack([0.0 * arm[:, 0], -arm[:, 2], arm[:, 1]], axis=1)
    moved = held | np.repeat(end, 3)
    free = splu(stiffness[~moved][:, ~moved].tocsc())
    u = turned.ravel()
    u[~moved] = -free.solve((stiffness @ u)[~moved])
    step = SHARE * sharp_limit(part, integrator="symplectic-euler", elastic=elastic).step
    return work, float(u @ (stiffness @ u)), step


def _substep(mesh: Mesh, step: float, arch: str) -> float:
    """Seconds that a substep takes."""
    runtime.import_taichi()
    from tisoft.simulation import Simulation

    sim = Simulation(beam(mesh, 0.3), arch=arch, threads=1)
    count = max(16, 400_000 // mesh.elements)
    spent = []
    for _ in range(1 + ROUNDS):
        begun = time.perf_counter()
        sim.stepper.advance(count, step, sim.gravity_now)
        spent.append((time.perf_counter() - begun) / count)
    return min(spent[1:])


def cost_of(rows: list[dict[str, Any]], quantity: str) -> tuple[float, str]:
    """Seconds of computing a simulated second at an error of GOAL, and how they were found: "",
    "at the most" (the coarsest mesh is better) or "extrapolated".
    """
    errors = [abs(row[quantity]) for row in rows]
    costs = [row["cost"][quantity] for row in rows]
    # The first mesh from which on all are good enough.
    good = next((k for k in range(len(rows)) if max(errors[k:]) <= GOAL), len(rows))
    if good == 0:
        return costs[0], "at the most"
    k = min(good, len(rows) - 1)
    slope = math.log(costs[k] / costs[k - 1]) / math.log(errors[k - 1] / errors[k])
    found = costs[k] * (errors[k] / GOAL) ** slope
    return found, "" if good < len(rows) else "extrapolated"


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Cost of GOAL by quantity and element, and how many times less than linear tets'."""
    found = []
    for quantity in QUANTITIES:
        costs = {
            element: cost_of([row for row in rows if row["element"] == element], quantity)
            for element in CELLS
        }
        for element, (cost, how) in costs.items():
            gain = costs["tet4"][0] / cost
            found.append(
                {"quantity": quantity, "element": element, "cost": cost, "how": how, "gain": gain}
            )
    return found


def as_text(rows: list[dict[str, Any]]) -> str:
    """The table, and what 2 % costs."""
    lines = [
        f"{'element':9}{'cells':>10}{'elements':>10}{'bending':>10}{'torsion':>10}{'ν = 0.49':>10}"
        f"{'step':>11}{'s of computing a simulated second':>36}"
    ]
    for row in rows:
        cells = "x".join(str(n) for n in row["cells"])
        errors = "".join(f"{100.0 * row[key]:>+9.1f}%" for key in QUANTITIES)
        lines.append(
            f"{row['element']:9}{cells:>10}{row['elements']:>10}{errors}"
            f"{1e3 * row['step']:>8.3f} ms{row['cost']['bending']:>36.3g}"
        )
    lines += ["", f"seconds of computing a simulated second with {100 * GOAL:.0f} % of error"]
    for row in summary(rows):
        how = f" ({row['how']})" if row["how"] else ""
        gain = "" if row["element"] == "tet4" else f", {row['gain']:.3g} times less than tet4"
        name = QUANTITIES[row["quantity"]]
        lines.append(f"  {name:20}{row['element']:7}{row['cost']:>9.3g}{how}{gain}")
    return "\n".join(lines)
