"""Materials of their own in regions of a mesh's file: what differs there from the body's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft import checks
from tisoft.checks import FieldError, inside, keep_number
from tisoft.geometry.groups import listed, named
from tisoft.geometry.mesh import Mesh
from tisoft.live import frozen
from tisoft.models.materials import LIMITS, MassSpring, Model

SPRINGS_TAKE = ("young", "density")
"""What a region of springs may change."""


@frozen
@dataclass(frozen=True)
class RegionMaterial:
    """Numbers of the material in one region; what is left out is as in the rest of the body.

    Args:
        name: the region's name in the mesh file, or
        tag: its number there.
        young, poisson, density, phi, eta: as in the model [Pa, 1, kg/m³, Pa·s, Pa·s]; springs
            take young and density alone.

    Raises:
        FieldError: neither or both of name and tag, or no number that changes anything.
    """

    name: str | None = None
    tag: int | None = None
    young: float | None = None
    poisson: float | None = None
    density: float | None = None
    phi: float | None = None
    eta: float | None = None

    def __post_init__(self) -> None:
        checks.exactly_one("", {"name": self.name, "tag": self.tag})
        if self.name is not None and not isinstance(self.name, str):
            raise FieldError("name", "must be the region's name in the mesh file", self.name)
        if self.tag is not None:
            checks.integer("tag", self.tag, least=-(2**31))
        for field in self._numbers():
            keep_number(self, field, **LIMITS[field])
        if not self._numbers():
            raise FieldError("", "changes nothing; give young, poisson, density, phi or eta")

    def places(self, mesh: Mesh) -> list[int]:
        """Places in `mesh.regions`; raises FieldError where there is no such region."""
        field = "name" if self.tag is None else "tag"
        wanted = self.tag if self.name is None else self.name
        assert wanted is not None
        places = named(mesh.regions, wanted)
        if not places:
            there = f"it has {listed(mesh.regions)}" if mesh.regions else "it has no regions"
            raise FieldError(field, f"is no region of the mesh: {there}", wanted)
        return places

    def tets(self, mesh: Mesh) -> NDArray[np.int64]:
        """Rows of the region's cells among those of the mesh."""
        cells = [mesh.regions[k].tets for k in self.places(mesh)]
        return np.unique(np.concatenate(cells)).astype(np.int64)

    def model(self, body: Model) -> Model:
        """The body's model with the region's numbers; raises FieldError where one is impossible."""
        if isinstance(body, MassSpring):
            self._check_springs(body)
        return replace(body, **self._numbers())

    def _check_springs(self, body: MassSpring) -> None:
        for name, value in self._numbers().items():
            if name not in SPRINGS_TAKE:
                problem = "is no number of mass-spring; a region of springs takes young and density"
                raise FieldError(name, problem, value)
        if self.young is not None and not body.needs_young:
            problem = 'changes nothing: stiffness is given in N/m; leave it out ("from-young")'
            raise FieldError("young", problem, self.young)
        if self.density is not None and body.node_mass is not None:
            problem = "changes nothing: node_mass is given in kg; leave it out"
            raise FieldError("density", problem, self.density)

    def words(self) -> str:
        """Its numbers, as "young = 1e+06 Pa, density = 900 kg/m³"."""
        units = {"young": " Pa", "density": " kg/m³", "phi": " Pa·s", "eta": " Pa·s"}
        told = [f"{key} = {value:g}{units.get(key, '')}" for key, value in self._numbers().items()]
        return ", ".join(told)

    def _numbers(self) -> dict[str, Any]:
        given = {
            f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("name", "tag")
        }
        return {name: value for name, value in given.items() if value is not None}


def materials_of(
    mesh: Mesh, model: Model, regions: Sequence[RegionMaterial]
) -> tuple[list[Model], NDArray[np.int64]]:
    """The body's model, then each region's, and the number among them of each cell, (cells,).

    Raises:
        FieldError: a region that is not there, an impossible number, or a cell of two materials.
    """
    models, number = [model], np.zeros(mesh.elements, np.int64)
    for i, region in enumerate(regions):
        with inside(f"region[{i}]"):
            models.append(region.model(model))
            cells = region.tets(mesh)
            taken = number[cells][number[cells] > 0]
            if len(taken):
                problem = f"has {len(taken)} cells that region[{taken[0] - 1}] gives a material too"
                raise FieldError("", f"{problem}; keep their cells apart")
            number[cells] = i + 1
    return models, number
