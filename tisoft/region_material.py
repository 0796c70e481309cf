"""A material of its own in a region of the mesh's file: what differs there from the body's."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from tisoft import checks
from tisoft.checks import FieldError
from tisoft.geometry.groups import listed, named
from tisoft.geometry.mesh import Mesh
from tisoft.models.materials import Model, SolidModel

NOT_YET = (
    "regions of their own material are not simulated yet; leave it out, and one material is used "
    "for the whole body"
)


@dataclass(frozen=True)
class RegionMaterial:
    """Numbers of the material in one region; what is left out is as in the rest of the body.

    Args:
        name: the region's name in the mesh file, or
        tag: its number there.
        young, poisson, density, phi, eta: as in the model [Pa, 1, kg/m³, Pa·s, Pa·s].
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
        if not self._numbers():
            raise FieldError("", "changes nothing; give young, poisson, density, phi or eta")

    def tets(self, mesh: Mesh) -> np.ndarray:
        """Rows of `mesh.tets` in the region; raises FieldError where there is no such region."""
        field = "name" if self.tag is None else "tag"
        wanted = self.tag if self.name is None else self.name
        assert wanted is not None
        places = named(mesh.regions, wanted)
        if not places:
            there = f"it has {listed(mesh.regions)}" if mesh.regions else "it has no regions"
            raise FieldError(field, f"is no region of the mesh: {there}", wanted)
        return np.unique(np.concatenate([mesh.regions[k].tets for k in places]))

    def model(self, body: Model) -> SolidModel:
        """The body's model with the region's numbers; raises FieldError where one is impossible."""
        if not isinstance(body, SolidModel):
            raise FieldError("", "needs a model of tets; springs take their stiffness by rows")
        return replace(body, **self._numbers())

    def _numbers(self) -> dict[str, Any]:
        given = {
            f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("name", "tag")
        }
        return {name: value for name, value in given.items() if value is not None}
