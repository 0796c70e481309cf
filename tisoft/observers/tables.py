"""Tables: probes.csv, energy.csv, and the saved states in frames/."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path
from typing import Any, Self
from xml.sax.saxutils import quoteattr

import numpy as np

from tisoft.geometry.files import write_vtu
from tisoft.models.materials import MassSpring
from tisoft.simulation import Frame, Simulation
from tisoft.whole_files import WholeFile, ends_well, make_folder, write_text

ENERGIES = ("kinetic", "elastic", "gravity", "dissipated", "external_work", "error")


def energies(sim: Simulation) -> dict[str, float | None]:
    """The ledger [J]; None for what is not measured."""
    known = sim.energy()
    return {key: known[key] for key in ENERGIES}


class Table:
    """A CSV file with a row per frame, whole at the end of a `with` block.

    `header` and `row` say what is in it.
    """

    name = ""

    def __init__(self, folder: Path) -> None:
        self._file = WholeFile(folder / self.name)

    def header(self, sim: Simulation) -> list[str]:
        """Names of the columns after the time."""
        raise NotImplementedError

    def row(self, sim: Simulation) -> list[float | None]:
        """Values of the columns after the time."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        self._file.__enter__()
        return self

    def on_start(self, sim: Simulation) -> None:
        self._write(["time", *self.header(sim)])

    def on_frame(self, frame: Frame) -> None:
        self._write([frame.time, *self.row(frame.simulation)])

    def __exit__(self, kind: type[BaseException] | None, *rest: object) -> None:
        self._file.__exit__(kind, *rest)

    def _write(self, cells: list[Any]) -> None:
        line = io.StringIO()
        csv.writer(line, lineterminator="\n").writerow(cells)
        self._file.write(line.getvalue())


class ProbeTable(Table):
    """Positions of the probes [m]."""

    name = "probes.csv"

    def header(self, sim: Simulation) -> list[str]:
        return [f"{probe.name}.{axis}" for probe in sim.scene.probes for axis in "xyz"]

    def row(self, sim: Simulation) -> list[float | None]:
        cells: list[float | None] = []
        for probe in sim.scene.probes:
            body, node = sim.scene.probed_node(probe)
            cells += [float(x) for x in sim.positions(body)[node]]
        return cells


class EnergyTable(Table):
    """The energy ledger [J]."""

    name = "energy.csv"

    def header(self, sim: Simulation) -> list[str]:
        return list(ENERGIES)

    def row(self, sim: Simulation) -> list[float | None]:
        return list(energies(sim).values())


class States:
    """Every n-th frame as frames/frame_00000.vtu and so on, and frames.pvd that lists them.

    Used in a `with` block: the list is written at its end.
    """

    def __init__(self, folder: Path, every: int) -> None:
        self.folder = folder
        self.every = every
        self._saved: list[tuple[float, str]] = []
        self._cells: dict[str, Any] = {}

    def __enter__(self) -> Self:
        make_folder(self.folder / "frames")
        return self

    def on_start(self, sim: Simulation) -> None:
        start, tets, lines = 0, [np.empty((0, 4), int)], [np.empty((0, 2), int)]
        for body in sim.scene.bodies:
            if isinstance(body.model, MassSpring):
                lines.append(body.springs() + start)
            else:
                tets.append(body.mesh.tets + start)
            start += len(body.mesh.points)
        both = {"tets": np.concatenate(tets), "lines": np.concatenate(lines)}
        self._cells = {kind: rows for kind, rows in both.items() if len(rows)}

    def on_frame(self, frame: Frame) -> None:
        if frame.index % self.every:
            return
        name = f"frame_{frame.index:05d}.vtu"
        data = {"velocity": frame.velocities()}
        path = self.folder / "frames" / name
        write_vtu(path, frame.positions(), point_data=data, **self._cells)
        self._saved.append((frame.time, name))

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Write the list, and remove what an older run left in the folder."""
        if not ends_well(kind):
            return
        rows = [
            f'    <DataSet timestep="{time!r}" file={quoteattr("frames/" + name)}/>'
            for time, name in self._saved
        ]
        head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>'
        text = "\n".join([head, *rows, "  </Collection>\n</VTKFile>\n"])
        write_text(self.folder / "frames.pvd", text)
        names = {name for _, name in self._saved}
        for old in (self.folder / "frames").iterdir():
            if re.fullmatch(r"frame_\d{5,}\.vtu", old.name) and old.name not in names:
                old.unlink()
