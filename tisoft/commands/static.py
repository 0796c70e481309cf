"""tisoft static: the equilibrium of a scene."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tisoft import runtime
from tisoft.check.meshes import mesh_warnings
from tisoft.commands import common
from tisoft.errors import NoEquilibrium
from tisoft.folders import ResultFolder
from tisoft.scene import Scene
from tisoft.whole_files import as_json, write_text

if TYPE_CHECKING:
    from tisoft.equilibrium.statics import Equilibrium
    from tisoft.simulation import Simulation

HELP = "find the static equilibrium of a scene, followed from rest"
EXAMPLES = """examples:
  tisoft static beam.toml
  tisoft static beam.toml -o out     summary.json, probes.csv, energy.csv, equilibrium.vtu
  tisoft static beam.toml -o rest.png --color stress

Loads, gravity and moved pins act as at t = duration; obstacles are left out."""

FILES = ("summary.json", "probes.csv", "energy.csv", "equilibrium.vtu")


def add(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    common.add_scene(parser)
    common.add_place(
        parser, "OUT", "a folder for the results, made where it is missing, or a picture (.png)"
    )
    common.add_picture(parser)


def execute(options: argparse.Namespace) -> int:
    """Solve and report; exit code 4 where no equilibrium was found."""
    scene = common.scene_of(options)
    runtime.import_taichi()
    runtime.start(options.arch)
    picture = bool(options.output) and Path(options.output).suffix.lower() == ".png"
    if not options.output or picture:
        sim, result, warnings = _solve(scene, options)
        if picture:
            _draw(sim, options.output)
    else:
        with ResultFolder(options.output, common.owner_of(options, "static")) as folder:
            folder.foresee(FILES)
            sim, result, warnings = _solve(scene, options)
            folder.begin(FILES)
            _save(sim, folder.path, result)
    _tell(options, result, warnings)
    return 0


def _solve(
    scene: Scene, options: argparse.Namespace
) -> tuple[Simulation, dict[str, Any], list[str]]:
    """The scene in equilibrium, the result, and the warnings of the solution itself."""
    from tisoft.equilibrium.statics import equilibrium
    from tisoft.simulation import Simulation

    try:
        found = equilibrium(scene)
    except NoEquilibrium as error:
        if options.json:
            print(as_json(_failed(error)))
        raise
    sim = Simulation(scene, arch=options.arch, precision="f64", certify=False)
    sim.put_state(found.positions, 0.0 * found.positions)
    return sim, _result(sim, found), found.warnings


def _failed(error: NoEquilibrium) -> dict[str, Any]:
    return {"status": "no equilibrium", "load_factor": error.load_factor, "error": str(error)}


def _result(sim: Simulation, found: Equilibrium) -> dict[str, Any]:
    from tisoft.observers.summary import probes

    sim.time = sim.scene.duration
    return {
        "status": "done",
        "residual": found.residual,
        "load_factor": found.load_factor,
        "iterations": found.iterations,
        "energy": found.energy,
        "probes": probes(sim),
        "warnings": [*mesh_warnings(sim.scene), *found.warnings],
    }


def _save(sim: Simulation, folder: Path, result: dict[str, Any]) -> None:
    from tisoft.observers.tables import ProbeTable
    from tisoft.observers.vtu import StateFiles

    energy = result["energy"]
    cells = ["" if value is None else f"{value!r}" for value in energy.values()]
    rows = [",".join(["time", *energy]), ",".join([f"{sim.time!r}", *cells])]
    write_text(folder / "energy.csv", "\n".join(rows) + "\n")
    with ProbeTable(folder) as table:
        table.on_start(sim)
        table.on_frame(sim.here())
    StateFiles(sim).write(folder / "equilibrium.vtu")
    write_text(folder / "summary.json", as_json(result) + "\n")


def _draw(sim: Simulation, path: str) -> None:
    from tisoft.observers.film import film_to

    with film_to(path, sim.scene) as film:
        film.on_frame(sim.here())


def _tell(options: argparse.Namespace, result: dict[str, Any], warnings: list[str]) -> None:
    if options.json:
        print(as_json(result))
        return
    if options.quiet:
        return
    print(
        f"equilibrium under the whole load, {result['residual']:.2g} N out of balance at the most, "
        f"after {result['iterations']} linear systems"
    )
    print(f"elastic energy {result['energy']['elastic']:.6g} J")
    for name, probe in result["probes"].items():
        moved = ", ".join(f"{value:.6g}" for value in probe["displacement"])
        print(f'probe "{name}": displacement ({moved}) m')
    if options.output:
        print(f"results are in {options.output}")
    for warning in warnings:  # those of meshes have been told at the start
        print(f"tisoft: warning: {warning}", file=sys.stderr)
