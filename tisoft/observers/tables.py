"""Tables: probes.csv, energy.csv, and the saved states in frames/."""

from __future__ import annotations

import csv
import io
import itertools
import re
from pathlib import Path
from typing import Any, Self
from xml.sax.saxutils import quoteattr

from tisoft.errors import SceneError
from tisoft.observers.vtu import StateFiles
from tisoft.simulation import Frame, Simulation
from tisoft.whole_files import WholeFile, ends_well, make_folder, write_text

ENERGIES = ("kinetic", "elastic", "gravity", "dissipated", "external_work", "error")


def energies(sim: Simulation) -> dict[str, float | None]:
    """The ledger [J]; None for what is not measured."""
    known = sim.energy()
    return {key: known[key] for key in ENERGIES}


class Table:
    """A CSV file with a row per frame, whole at the end of a `with` block.

    `header` and `row` say what is in it.  With `goes_on` it starts with the rows of the file that
    lies there, up to the simulation's present frame.
    """

    name = ""
    looks_every = 0

    def __init__(self, folder: Path, *, goes_on: bool = False) -> None:
        self._file = WholeFile(folder / self.name)
        self._goes_on = goes_on

    def header(self, sim: Simulation) -> list[str]:
        """Names of the columns after the time."""
        raise NotImplementedError

    def row(self, frame: Frame) -> list[float | None]:
        """Values of the columns after the time."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        self._file.__enter__()
        return self

    def on_start(self, sim: Simulation) -> None:
        if self._goes_on:
            for line in self._earlier(sim.frame):
                self._file.write(line)
        else:
            self._write(["time", *self.header(sim)])

    def _earlier(self, frame: int) -> list[str]:
        """The header and the rows of the frames before `frame`."""
        path = self._file.path
        try:
            with path.open(encoding="utf-8", newline="") as file:
                lines = list(itertools.islice(file, 1 + frame))
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "it is no text"
            raise SceneError(f"{path} cannot be read: {reason}; run the scene anew") from None
        if len(lines) <= frame or not lines[-1].endswith("\n"):
            problem = f"{path} ends before frame {frame}, where the checkpoint is"
            raise SceneError(f"{problem}; run the scene anew")
        return lines

    def publish(self) -> None:
        """Put the rows so far into the file."""
        self._file.publish()

    def on_frame(self, frame: Frame) -> None:
        self._write([frame.time, *self.row(frame)])

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

    def row(self, frame: Frame) -> list[float | None]:
        return [float(x) for x in frame.probes().ravel()]


class EnergyTable(Table):
    """The energy ledger [J]."""

    name = "energy.csv"

    def header(self, sim: Simulation) -> list[str]:
        return list(ENERGIES)

    def row(self, frame: Frame) -> list[float | None]:
        known = frame.energy()
        return [known[key] for key in ENERGIES]


class States:
    """Every n-th frame as frames/frame_00000.vtu and so on, and frames.pvd that lists them.

    Used in a `with` block: the list is written at its end.  With `goes_on`, the frames before the
    simulation's present one lie there already.
    """

    def __init__(self, folder: Path, every: int, *, goes_on: bool = False) -> None:
        self.folder = folder
        self.every = self.looks_every = every
        self._goes_on = goes_on
        self._saved: list[tuple[float, str]] = []
        self._files: StateFiles | None = None

    def __enter__(self) -> Self:
        make_folder(self.folder / "frames")
        return self

    def on_start(self, sim: Simulation) -> None:
        self._files = StateFiles(sim)
        if self._goes_on:
            for index in range(0, sim.frame, self.every):
                path = self.folder / "frames" / frame_name(index)
                if not path.is_file():
                    raise SceneError(f"{path} is missing; run the scene anew")
                self._saved.append((index / sim.scene.frame_rate, path.name))

    def on_frame(self, frame: Frame) -> None:
        if frame.index % self.every:
            return
        name = frame_name(frame.index)
        assert self._files is not None
        self._files.write(self.folder / "frames" / name)
        self._saved.append((frame.time, name))

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Write the list, and remove what an older run left in the folder."""
        if not ends_well(kind):
            return
        self.publish()
        names = {name for _, name in self._saved}
        for old in (self.folder / "frames").iterdir():
            if re.fullmatch(r"frame_\d{5,}\.vtu", old.name) and old.name not in names:
                old.unlink()

    def publish(self) -> None:
        """Write the list of the frames so far."""
        rows = [
            f'    <DataSet timestep="{time!r}" file={quoteattr("frames/" + name)}/>'
            for time, name in self._saved
        ]
        head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>'
        text = "\n".join([head, *rows, "  </Collection>\n</VTKFile>\n"])
        write_text(self.folder / "frames.pvd", text)


def frame_name(index: int) -> str:
    """The file of a frame."""
    return f"frame_{index:05d}.vtu"
