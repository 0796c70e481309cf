"""What a run came to: the object of `run --json` and of summary.json."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from tisoft.checks import shown
from tisoft.observers.tables import energies
from tisoft.simulation import Simulation


def summary(
    sim: Simulation,
    *,
    status: str,
    stable_step: float,
    limiting: Any,
    wall_seconds: float,
    warnings: list[str],
) -> dict[str, Any]:
    """The result of a run; `wall_seconds` is stepping with what watched it, without compiling."""
    elements = sim.system.elements or sim.system.springs
    steps = sim.steps or [sim.substeps_of(1.0 / sim.scene.frame_rate)[1]]
    solve = sim.mass_solve()
    more = {} if solve is None else {"mass_solve": solve}
    return more | {
        "status": status,
        "time": sim.time,
        "frames": sim.frame,
        "substeps": sim.substeps,
        "step": steps[0],
        "step_range": [min(steps), max(steps)],
        "stable_step": stable_step,
        "limiting_element": limiting,
        "nodes": sim.system.count,
        "elements": sim.system.elements,
        "springs": sim.system.springs,
        "wall_seconds": wall_seconds,
        "compile_seconds": sim.compile_seconds,
        "start_seconds": sim.start_seconds,
        "setup_seconds": sim.setup_seconds,
        "element_substeps_per_second": elements * sim.substeps / max(wall_seconds, 1e-9),
        "real_time_factor": sim.time / max(wall_seconds, 1e-9),
        "arch": sim.arch,
        "precision": sim.precision,
        "energy": energies(sim),
        "probes": probes(sim),
        "recoveries": [asdict(recovery) for recovery in sim.recoveries],
        "warnings": [*warnings, *getattr(sim, "warnings", [])],
    }  # fmt: skip


def probes(sim: Simulation) -> dict[str, dict[str, Any]]:
    """Where each probe is: the file's number of its node, position, displacement, velocity."""
    found: dict[str, dict[str, Any]] = {}
    for probe in sim.scene.probes:
        own = sim.scene.probed(probe)
        position = own.at(sim.positions(own.body))
        found[probe.name] = {
            "node": own.number,
            "position": position.tolist(),
            "displacement": (position - own.at(own.body.mesh.points)).tolist(),
            "velocity": own.at(sim.velocities(own.body)).tolist(),
        }
    return found


def as_text(result: dict[str, Any]) -> str:
    """The result in a few lines."""
    low, high = (1e3 * step for step in result["step_range"])
    steps = f"{low:.3g}" if f"{low:.3g}" == f"{high:.3g}" else f"{low:.3g} to {high:.3g}"
    lines = [
        f"{result['time']:g} s in {result['frames']} frames, {result['substeps']} substeps of "
        f"{steps} ms: {_seconds(result['wall_seconds'])} s, "
        f"{result['real_time_factor']:.3g} x real time"
    ]
    for name, probe in result["probes"].items():
        at, moved = (_vector(probe[key]) for key in ("position", "displacement"))
        lines.append(f"probe {shown(name)} is at {at} m, {moved} m from rest")
    return "\n".join(lines)


def _seconds(seconds: float) -> str:
    return f"{seconds:.2f}" if seconds >= 1.0 else f"{seconds:.3g}"


def _vector(values: list[float]) -> str:
    return "(" + ", ".join(f"{value:.5g}" for value in values) + ")"
