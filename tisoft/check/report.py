"""What `tisoft check` tells: meshes, springs' rigidity, the stable step, the cost, warnings."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.body import Body
from tisoft.check.contact import contact_lines, contact_report
from tisoft.check.lengths import metres
from tisoft.check.limiting import damping_cost, limiting_element
from tisoft.check.meshes import mesh_notes, used
from tisoft.check.warnings import warnings_of
from tisoft.geometry.bracing import mechanism, missing_springs, moving_nodes
from tisoft.geometry.groups import Region
from tisoft.geometry.mesh import SpringNet, TetMesh
from tisoft.geometry.quality import altitudes, quality
from tisoft.geometry.rigidity import Rigidity, rigidity
from tisoft.models.materials import MassSpring
from tisoft.rows_in_time import coarse_rows
from tisoft.simulation import Simulation

TRIALS, LEAST_TRIALS = 15, 5
"""Trials to measure how fast the scene runs, and their number where each is long."""
TRIAL_SECONDS, MOST_TRIAL_SECONDS = 0.3, 1.5
"""Time spent on them [s], where a substep is short and where it is long."""
BUSY = 1.5
"""Ratio of fast trials to slow ones from which on the machine has other work."""


@dataclass
class Report:
    """The result of a check, and the worst mechanism of its springs for a picture."""

    result: dict[str, Any]
    mechanisms: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    """By body: displacements of its worst mechanism, shape (nodes, 3)."""


def check(sim: Simulation) -> Report:
    """Look at a simulation that has not run yet; it has run a little afterwards."""
    scene = sim.scene
    report = Report({})
    step = sim.substeps_of(1.0 / scene.frame_rate)[1]
    report.result = {
        "status": "done",
        "step": step,
        "stable_step": sim.limit.sharp(),
        "element_bound": sim.limit.bound(),
        "limiting_element": limiting_element(sim),
        "damping_cost": damping_cost(sim),
        "zero_energy_modes": {},
        "in_plane": {},
        "mesh": {body.name: mesh_report(body) for body in scene.bodies},
        "contact": contact_report(sim),
        "nodes": sim.system.count,
        "elements": sim.system.elements,
        "springs": sim.system.springs,
        "warnings": [*warnings_of(scene), *sim.watch.pushed(), *coarse_rows(scene, step)],
    }
    for body in scene.bodies:
        report.result["warnings"] += mesh_notes(body)
        if isinstance(body.model, MassSpring):
            _count_modes(body, report)
    report.result |= estimated_speed(sim)
    return report


PLURALS = {"tet4": "tets", "tet10": "quadratic tets", "hex8": "hexes"}


def mesh_report(body: Body) -> dict[str, Any]:
    """Numbers of a body's mesh; None for what springs do not have."""
    mesh = body.mesh
    found = {
        "nodes": len(mesh.points),
        "elements": mesh.elements or len(body.springs()),
        "volume": None,
        "flipped": mesh.flipped,
        "dropped_nodes": mesh.dropped_nodes,
        "pieces": mesh.pieces,
        "worst_quality": None,
        "worst_element": None,
        "size": np.ptp(mesh.points, axis=0).tolist(),
        "notes": list(mesh.notes),
        "regions": [],
        "sets": [
            {
                "name": group.name,
                "tag": group.tag,
                "nodes": len(group.nodes),
                "faces": len(group.faces),
                "used": used(body, group),
            }
            for group in mesh.sets
        ],
    }
    if not isinstance(mesh, SpringNet):
        shape = quality(mesh)
        worst = int(np.argmin(shape))
        found |= {
            "volume": float(mesh.volumes.sum()),
            "regions": [_region(body, region) for region in mesh.regions],
            "worst_quality": float(shape[worst]),
            "worst_element": worst,
            "kinds": " and ".join(PLURALS[word] for word in mesh.cells),
        }
        if isinstance(mesh, TetMesh):
            found["median_altitude"] = float(np.median(altitudes(mesh)))
    if isinstance(body.model, MassSpring):
        found["springs"] = len(body.springs())
    return found


def _count_modes(body: Body, report: Report) -> None:
    points, springs = body.mesh.points, body.springs()
    counted: Rigidity = rigidity(points, springs)
    report.result["zero_energy_modes"][body.name] = counted.zero_energy_modes
    if counted.in_plane is not None:
        report.result["in_plane"][body.name] = counted.in_plane
    if not counted.mechanisms:
        return
    motion = mechanism(points, springs, counted)
    report.mechanisms[body.name] = motion
    more = missing_springs(points, springs)
    after = rigidity(points, np.concatenate([springs, more]))
    moving = body.mesh.kept_nodes[moving_nodes(motion)]
    told = counted.warning(body.name, moving=moving, missing=more, after=after)
    if told is not None:
        report.result["warnings"].append(told)


def estimated_speed(sim: Simulation) -> dict[str, Any]:
    """Simulated seconds per second of stepping: the median of short trials, and their range.

    The range leaves out the slowest and the fastest tenth.
    """
    step = sim.substeps_of(1.0 / sim.scene.frame_rate)[1]

    def seconds_of(count: int) -> float:
        begun = time.perf_counter()
        sim.stepper.advance(count, step, sim.gravity_now)
        return time.perf_counter() - begun

    count = 4
    while seconds_of(count) < TRIAL_SECONDS / TRIALS:  # the first calls also settle the threads
        count *= 2
    speeds: list[float] = []
    begun = time.perf_counter()
    while len(speeds) < LEAST_TRIALS or (
        len(speeds) < TRIALS and time.perf_counter() - begun < MOST_TRIAL_SECONDS
    ):
        speeds.append(count * step / seconds_of(count))
    speeds.sort()
    cut = len(speeds) // 10
    return {
        "estimated_real_time_factor": speeds[len(speeds) // 2],
        "estimated_real_time_range": [speeds[cut], speeds[-1 - cut]],
    }


def as_text(result: dict[str, Any]) -> str:
    """The report, laid out to be read."""
    lines = []
    for name, mesh in result["mesh"].items():
        lines += _mesh_lines(name, mesh, result)
    lines += contact_lines(result)
    lines.append("step")
    lines.append(f"  stable limit   {seconds(result['stable_step'])}, at rest, damping included")
    lines.append(f"  element bound  {seconds(result['element_bound'])}, never above the limit")
    lines.append(f"  taken          {seconds(result['step'])}")
    limiting = result["limiting_element"]
    if limiting is not None:
        lines.append(
            f'  set by         {limiting["kind"]} {limiting["element"]} of "{limiting["body"]}":'
        )
        lines.append(f"                 {limiting['reason']}")
    cost = result["damping_cost"]
    if cost > 1.005:
        lines.append(f"  damping        makes the step {cost:.3g} times smaller")
    lines += ["speed", *_speed_lines(result)]
    if result["warnings"]:
        lines += ["warnings", *(f"  - {warning}" for warning in result["warnings"])]
    return "\n".join(lines)


def _speed_lines(result: dict[str, Any]) -> list[str]:
    factor, (low, high) = (result[f"estimated_real_time_{key}"] for key in ("factor", "range"))
    lines = [f"  estimated      {factor:.3g} x real time on this machine ({low:.3g} to {high:.3g})"]
    if high > BUSY * low:
        lines.append(
            "  note           the machine has other work now: alone, the scene runs faster"
        )
    return lines


def _mesh_lines(name: str, mesh: dict[str, Any], result: dict[str, Any]) -> list[str]:
    kind = "springs" if mesh["volume"] is None else mesh["kinds"]
    size = " x ".join(metres(length) if length else "0" for length in mesh["size"])
    lines = [f'body "{name}"', f"  mesh           {mesh['nodes']} nodes, {mesh['elements']} {kind}"]
    if mesh["volume"] is not None and "springs" in mesh:
        lines[-1] += f", {mesh['springs']} springs"
    lines[-1] += f", {size}"
    if mesh["volume"] is not None:
        lines[-1] += f", {mesh['volume']:.4g} m³"
        worst = f"worst {mesh['worst_quality']:.2g} (element {mesh['worst_element']})"
        lines.append(f"  quality        {worst}")
        if "median_altitude" in mesh:
            lines[-1] += f", median altitude {metres(mesh['median_altitude'])}"
    lines += _group_lines(mesh)
    for key, told in (
        ("flipped", "elements turned round: the file orients them the other way"),
        ("dropped_nodes", "nodes dropped: no element has them as a corner"),
    ):
        if mesh[key]:
            lines.append(f"  note           {mesh[key]} {told}")
    if mesh["pieces"] > 1:
        lines.append(f"  note           {mesh['pieces']} pieces that nothing joins")
    if name in result["zero_energy_modes"]:
        told = f"{result['zero_energy_modes'][name]} in space beyond rigid motion"
        if name in result["in_plane"]:
            told += f", {result['in_plane'][name]} of them in plane"
        lines.append(f"  mechanisms     {told}")
    return lines


def _region(body: Body, region: Region) -> dict[str, Any]:
    mesh = body.mesh
    assert not isinstance(mesh, SpringNet)
    own = [
        r.words() for r in body.regions if any(mesh.regions[k] is region for k in r.places(mesh))
    ]
    return {
        "name": region.name,
        "tag": region.tag,
        "elements": len(region.tets),
        "volume": float(mesh.volumes[region.tets].sum()),
        "material": own[0] if own else None,
    }


def _group_lines(mesh: dict[str, Any]) -> list[str]:
    """Regions, sets and notes of the file."""
    lines = [
        f"  region         {_title(group)}: {group['elements']} elements, {group['volume']:.4g} m³"
        + (f", {group['material']}" if group["material"] else "")
        for group in mesh["regions"]
    ]
    for group in mesh["sets"]:
        faces = f", {group['faces']} faces" if group["faces"] else ""
        unused = "" if group["used"] else ", not used"
        nodes = f"{group['nodes']} node{'s' * (group['nodes'] != 1)}"
        lines.append(f"  set            {_title(group)}: {nodes}{faces}{unused}")
    return lines + [f"  note           {note}" for note in mesh["notes"]]


def _title(group: dict[str, Any]) -> str:
    number = "" if str(group["tag"]) == group["name"] else f" ({group['tag']})"
    return group["name"] + ("" if group["tag"] is None else number)


def seconds(time: float) -> str:
    """A time with a handy unit."""
    if not np.isfinite(time):
        return "none: nothing oscillates"
    for factor, unit in ((1.0, "s"), (1e3, "ms"), (1e6, "µs")):
        if time * factor >= 0.1:
            return f"{time * factor:.4g} {unit}"
    return f"{time:.3g} s"
