"""States of a scene as VTU files for ParaView: shape, motion, strain and stress.

| data                    | per  | what                                                            |
| ----------------------- | ---- | --------------------------------------------------------------- |
| displacement, velocity  | node | from the mesh [m]; [m/s]                                        |
| reaction                | node | force of pins [N]; left out where nothing is pinned             |
| body                    | cell | number of its body in the scene                                 |
| strain                  | cell | Green's strain, 9 components; linear bodies: the small strain   |
| second_piola, cauchy    | cell | stress [Pa], 9 components                                       |
| von_mises, volume_ratio | cell | [Pa]; J, at or below 0 inside out                               |
| spring_strain, tension  | cell | of springs; [N]                                                 |

In a scene of solids and springs each kind of cell has NaN for what only the other kind has.  Skins
are triangles, whose points come after all nodes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.files import write_vtu
from tisoft.geometry.files.write import KINDS
from tisoft.geometry.solid import FIELDS
from tisoft.measures.elements import SpringMeasures
from tisoft.simulation import Simulation

TENSORS = ("strain", "second_piola", "cauchy")
SCALARS = ("von_mises", "volume_ratio")
WORDS = {word: name for name, word in FIELDS.items()}
"""Names of cells in files, by kind."""


class StateFiles:
    """Writes states of one simulation; what does not change between them is prepared once."""

    def __init__(self, sim: Simulation) -> None:
        self.sim = sim
        bodies = sim.scene.bodies
        self._skins = [
            (body.skin, part.nodes)
            for body, part in zip(bodies, sim.parts, strict=True)
            if body.skin
        ]
        self._rest = self._with_skins(np.concatenate([body.mesh.points for body in bodies]))
        starts = np.cumsum([0, *(len(body.mesh.points) for body in bodies)])
        cells: dict[str, list[Any]] = {kind: [] for kind in KINDS}
        owners: dict[str, list[Any]] = {kind: [] for kind in KINDS}

        def add(kind: str, rows: NDArray[Any], first: int, body: int) -> None:
            cells[kind].append(rows.astype(np.int64) + first)
            owners[kind].append(np.full(len(rows), body, np.int32))

        first = int(starts[-1])
        for index, body in enumerate(bodies):
            if body.skin:
                add("triangles", body.skin.triangles, first, index)
                first += len(body.skin.corners)
        for part in sim.parts:
            start = int(starts[part.index])
            if part.is_springs:
                add("lines", part.body.springs(), start, part.index)
                continue
            for word, rows in part.body.mesh.cells.items():
                add(WORDS[word], rows, start, part.index)
        self._cells = {kind: np.concatenate(rows) for kind, rows in cells.items() if rows}
        self._owner = np.concatenate(
            [np.empty(0, np.int32), *(o for k in KINDS for o in owners[k])]
        )

    def _with_skins(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values at nodes, and after them those at the points of all skins."""
        return np.concatenate([values, *(s.carried(values[nodes]) for s, nodes in self._skins)])

    def write(self, path: Path) -> None:
        """Write the present state, whole or not at all.

        Raises:
            SceneError: a file that cannot be written.
        """
        x = self._with_skins(self.sim.positions())
        points: dict[str, NDArray[Any]] = {
            "displacement": x - self._rest,
            "velocity": self._with_skins(self.sim.velocities()),
        }
        if any(body.pins for body in self.sim.scene.bodies):
            points["reaction"] = self._with_skins(self.sim.reactions())
        cells = self._cell_data() if len(self._owner) else None
        write_vtu(path, x, point_data=points, cell_data=cells, **self._cells)

    def _cell_data(self) -> dict[str, NDArray[Any]]:
        """Values of all cells, in the order of KINDS, f32: the files are large."""
        tables: dict[str, list[dict[str, NDArray[Any]]]] = {kind: [] for kind in self._cells}
        for part in self.sim.parts:
            measured = self.sim.measures.elements(part.body)
            if isinstance(measured, SpringMeasures):
                strain, tension = measured.strain, measured.tension
                tables["lines"].append({"spring_strain": strain, "tension": tension})
                continue
            values = {name: getattr(measured, name).reshape(-1, 9) for name in TENSORS}
            values |= {name: getattr(measured, name) for name in SCALARS}
            begun = 0
            for word, rows in part.body.mesh.cells.items():
                own = slice(begun, begun + len(rows))
                begun += len(rows)
                tables[WORDS[word]].append({name: all_[own] for name, all_ in values.items()})
        data: dict[str, NDArray[Any]] = {"body": self._owner}
        begun = 0
        for kind, rows in self._cells.items():
            known = tables[kind]
            for name in known[0] if known else ():
                joined = np.concatenate([table[name] for table in known])
                if name not in data:
                    shape = (len(self._owner), *joined.shape[1:])
                    data[name] = np.full(shape, np.nan, np.float32)
                data[name][begun : begun + len(joined)] = joined
            begun += len(rows)
        return data
