"""Tables: probes.csv, energy.csv, and the saved states in frames/."""

from __future__ import annotations

import contextlib
import csv
import io
import itertools
from pathlib import Path
from typing import Any, Self
from xml.sax.saxutils import quoteattr

from tisoft.errors import SceneError
from tisoft.folders import ResultFolder
from tisoft.growing_file import GrowingFile
from tisoft.observers.vtu import StateFiles
from tisoft.simulation import Frame, Simulation
from tisoft.whole_files import Unwritable, ends_well, make_folder, write_text

STATE, STATE_LIST = "frames/frame_%05d.vtu", "frames.pvd"
ENERGIES = ("kinetic", "elastic", "gravity", "dissipated", "external_work", "error")


TOUCHED = ("contact", "friction")
"""Of the dissipated energy, where surfaces may touch."""


def energies(sim: Simulation) -> dict[str, float | None]:
    """The ledger [J]; None for what is not measured."""
    known: Any = sim.energy()
    return {key: known[key] for key in (*ENERGIES, *TOUCHED) if key in known}


class Table:
    """A CSV file with a row per frame, whole rows at any moment, in a `with` block.

    `header` and `row` say what is in it.  With `goes_on` it starts with the rows of the file that
    lies there, up to the simulation's present frame.
    """

    name = ""
    looks_every = 0

    def __init__(self, folder: Path, *, goes_on: bool = False) -> None:
        self.path = folder / self.name
        self._goes_on = goes_on
        self._file: GrowingFile | None = None

    def header(self, sim: Simulation) -> list[str]:
        """Names of the columns after the time."""
        raise NotImplementedError

    def row(self, frame: Frame) -> list[float | None]:
        """Values of the columns after the time."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        if not self._goes_on:
            self._file = GrowingFile(self.path)
        return self

    def on_start(self, sim: Simulation) -> None:
        if self._goes_on:
            earlier = sum(len(line) for line in self._earlier(sim.frame))
            self._file = GrowingFile(self.path, keep=earlier)
        else:
            self._write(["time", *self.header(sim)])

    def _earlier(self, frame: int) -> list[bytes]:
        """The header and the rows of the frames before `frame`."""
        try:
            with self.path.open("rb") as file:
                lines = list(itertools.islice(file, 1 + frame))
        except OSError as error:
            reason = error.strerror or str(error)
            raise SceneError(f"{self.path} cannot be read: {reason}; run the scene anew") from None
        if len(lines) <= frame or not lines[-1].endswith(b"\n"):
            problem = f"{self.path} ends before frame {frame}, where the checkpoint is"
            raise SceneError(f"{problem}; run the scene anew")
        return lines

    def publish(self) -> None:
        """Have the rows so far on the disk."""
        if self._file is not None:
            self._file.sync()

    def on_frame(self, frame: Frame) -> None:
        self._write([frame.time, *self.row(frame)])

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.close()

    def _write(self, cells: list[Any]) -> None:
        line = io.StringIO()
        csv.writer(line, lineterminator="\n").writerow(cells)
        assert self._file is not None
        self._file.append(line.getvalue())


class ProbeTable(Table):
    """Positions of the probes [m]."""

    name = "probes.csv"

    def header(self, sim: Simulation) -> list[str]:
        return [f"{probe.name}.{axis}" for probe in sim.scene.probes for axis in "xyz"]

    def row(self, frame: Frame) -> list[float | None]:
        return [float(x) for x in frame.probes().ravel()]


class EnergyTable(Table):
    """The energy ledger [J]."""

    name = "energy.csv"

    def header(self, sim: Simulation) -> list[str]:
        return list(energies(sim))

    def row(self, frame: Frame) -> list[float | None]:
        known: Any = frame.energy()
        return [known[key] for key in (*ENERGIES, *TOUCHED) if key in known]


class States:
    """Every n-th frame as frames/frame_00000.vtu and so on, and frames.pvd that lists them.

    Used in a `with` block: the list is written at its end.  With `goes_on`, the frames before the
    simulation's present one lie there already.
    """

    def __init__(self, folder: ResultFolder, every: int, *, goes_on: bool = False) -> None:
        self.folder = folder
        self.every = self.looks_every = every
        self._goes_on = goes_on
        self._saved: list[tuple[float, str]] = []
        self._files: StateFiles | None = None

    def __enter__(self) -> Self:
        make_folder(self.folder.path / "frames")
        return self

    def on_start(self, sim: Simulation) -> None:
        self._files = StateFiles(sim)
        if self._goes_on:
            for index in range(0, sim.frame, self.every):
                name = STATE % index
                if not (self.folder.path / name).is_file():
                    problem = f"{self.folder.path / name} is missing"
                    raise SceneError(f"{problem}; run the scene anew")
                self._saved.append((index / sim.scene.frame_rate, name))

    def on_frame(self, frame: Frame) -> None:
        if frame.index % self.every:
            return
        assert self._files is not None
        self._files.write(self.folder.claim(STATE, frame.index, self.every))
        self._saved.append((frame.time, STATE % frame.index))

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.publish()
        elif ends_well(kind):
            with contextlib.suppress(Unwritable):  # what happened first is told
                self.publish()

    def publish(self) -> None:
        """Write the list of the frames so far."""
        rows = [
            f'    <DataSet timestep="{time!r}" file={quoteattr(name)}/>'
            for time, name in self._saved
        ]
        head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>'
        text = "\n".join([head, *rows, "  </Collection>\n</VTKFile>\n"])
        write_text(self.folder.path / STATE_LIST, text)
