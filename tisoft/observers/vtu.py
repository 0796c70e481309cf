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

In a scene of tets and springs each kind of cell has NaN for what only the other kind has.  Skins
are triangles, whose points come after all nodes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry.files import write_vtu
from tisoft.measures.elements import SpringMeasures, TetMeasures
from tisoft.simulation import Simulation

TENSORS = ("strain", "second_piola", "cauchy")
SCALARS = ("von_mises", "volume_ratio")


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
        tets, lines = [np.empty((0, 4), np.int64)], [np.empty((0, 2), np.int64)]
        triangles = [np.empty((0, 3), np.int64)]
        owners: tuple[list[Any], list[Any]] = ([], [])
        skin_owners, first = [np.empty(0, np.int32)], int(starts[-1])
        for index, body in enumerate(bodies):
            if body.skin:
                triangles.append(body.skin.triangles.astype(np.int64) + first)
                skin_owners.append(np.full(len(body.skin.triangles), index, np.int32))
                first += len(body.skin.corners)
        for part in sim.parts:
            cells = part.body.springs() if part.is_springs else part.body.mesh.tets
            (lines if part.is_springs else tets).append(cells + starts[part.index])
            owners[part.is_springs].append(np.full(len(cells), part.index, np.int32))
        kinds = {
            "tets": np.concatenate(tets),
            "triangles": np.concatenate(triangles),
            "lines": np.concatenate(lines),
        }
        self._cells = {kind: rows for kind, rows in kinds.items() if len(rows)}
        self._counts = [len(rows) for rows in kinds.values()]
        self._owner = np.concatenate([*owners[0], *skin_owners, *owners[1]])

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
        """Values of all cells, tets first, f32: the files are large."""
        measured = [self.sim.measures.elements(part.body) for part in self.sim.parts]
        tets = [m for m in measured if isinstance(m, TetMeasures)]
        springs = [m for m in measured if isinstance(m, SpringMeasures)]
        data: dict[str, NDArray[Any]] = {"body": self._owner}
        if tets:
            for name in TENSORS:
                rows = [getattr(m, name).reshape(-1, 9) for m in tets]
                data[name] = self._filled(np.concatenate(rows), 0)
            for name in SCALARS:
                data[name] = self._filled(np.concatenate([getattr(m, name) for m in tets]), 0)
        if springs:
            strain = np.concatenate([m.strain for m in springs])
            data["spring_strain"] = self._filled(strain, 2)
            data["tension"] = self._filled(np.concatenate([m.tension for m in springs]), 2)
        return data

    def _filled(self, values: NDArray[np.float64], kind: int) -> NDArray[np.float32]:
        """Values of one kind of cell among NaN for the others."""
        out = np.full((sum(self._counts), *values.shape[1:]), np.nan, np.float32)
        start = sum(self._counts[:kind])
        out[start : start + len(values)] = values
        return out
