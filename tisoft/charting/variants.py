"""What a user may vary of a scene: element, mesh, model, precision, integrator, step.

A variant is a list of settings as --set takes them, so whoever likes it can have it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tisoft.body import Body
from tisoft.changes import MODEL_WORDS
from tisoft.models.materials import Linear, MassSpring, MassTensor, ViscoElastic
from tisoft.scene import Scene
from tisoft.scene_file import document_of
from tisoft.where import Nodes

CURRENT = "as it is"
FACTORS = (0.5, 0.75, 1.5, 2.0, 3.0, 4.0)
"""By which cells along each axis are multiplied; those of files, whose tets are cut 1:8, by powers
of two."""
ALWAYS, LARGEST_CUT = 3.0, 50_000
"""The largest of them for bodies of any size, and the most cells that finer ones may have."""
COUNTS = {"box": "cells", "cloth": "cells", "grid": "cells", "ball": "resolution",
          "cylinder": "resolution"}  # fmt: skip
"""The key of each shape that says how fine it is."""
TETS = {"box": "five", "ball": "tets", "cylinder": "tets"}
"""How shapes that are had of hexahedra too are cut in tets."""
CURVED = ("ball", "cylinder")
"""Shapes whose meshes have corners where the shape has none."""
SPRINGS_POISSON = 0.25
"""What networks of springs come to, whose central forces leave them no choice (Cauchy 1828)."""
MODELS = ("viscoelastic", "neo-hookean", "linear", "mass-spring")


@dataclass(frozen=True)
class Variant:
    """A scene with settings."""

    name: str
    settings: tuple[str, ...]
    kind: str = "mesh"
    """What it changes: "mesh" (mesh and element), "model", "step", "precision", "integrator"."""


class Catalogue:
    """The variants of a scene.

    Args:
        source: the scene file, or a Scene.
        scene: what it holds.
        settings: --set of the command line, which every variant has.
        bodies: numbers of those that may vary; left out, all.
    """

    def __init__(
        self,
        source: str | Path | Scene,
        scene: Scene,
        settings: Sequence[str],
        bodies: Sequence[int] | None = None,
    ) -> None:
        self.scene = scene
        self.given = tuple(settings)
        nets = [i for i, b in enumerate(scene.bodies) if isinstance(b.model, MassSpring)]
        varied = range(len(scene.bodies)) if bodies is None else bodies
        solids = [i for i in varied if i not in nets]
        self.varied = solids or list(varied)
        """Bodies that vary: nets only where there is nothing else."""
        self.springs = not solids
        table: Any = {} if isinstance(source, Scene) else document_of(source, settings)
        self._bodies = table.get("body", [{} for _ in scene.bodies])
        self._meshes = [body.get("mesh", {}) for body in self._bodies]

    @property
    def current(self) -> Variant:
        """The scene itself."""
        return Variant(CURRENT, self.given)

    def mesh(self, element: str, factor: float) -> Variant | None:
        """All bodies with an element ("tet4", "tet10", "hex8", "spring") and finer or coarser by a
        factor along each axis; None where that cannot be had, or is the scene itself.
        """
        solid = self.springs and element != "spring"
        if solid and not self.has_solid_twin:
            return None
        settings: list[str] = []
        for i in self.varied:
            own = self._of_body(i, element, factor)
            if own is None:
                return None
            settings += own
        if not settings and not solid:
            return None
        size = "" if factor == 1.0 else f", {factor:g} x as fine"
        made = Variant(f"{element}{size}", (*self.given, *settings))
        return Variant(made.name, self.as_solid(made).settings) if solid else made

    def _of_body(self, i: int, element: str, factor: float) -> list[str] | None:
        body, table = self.scene.bodies[i], self._meshes[i]
        has = next(iter(body.mesh.cells), "spring")
        if len(body.mesh.cells) > 1:
            return None
        if factor > ALWAYS and body.mesh.elements * factor**3 > LARGEST_CUT:
            return None
        key, made = f"body.{i}.mesh", []
        shape = _shape_of(table)
        springs = isinstance(body.model, MassSpring)
        if element == "spring" and not springs:
            return None
        if "cage" in table:
            shape = "cage"
            if element != "hex8":
                return None
        if factor != 1.0 and (
            (springs and not _scales(body.model))
            or (shape in COUNTS and has_numbers(body))  # other nodes would have these numbers
        ):
            return None
        if factor != 1.0:
            finer = self._finer(key, table, shape, has, factor)
            if finer is None:
                return None
            made += finer
        if element not in (has, "spring") and "hex8" in (element, has):
            if shape not in TETS:
                return None
            split = "hex" if element == "hex8" else TETS[shape]
            made.append(f'{key}.{shape}.split="{split}"')
        if element == "tet4" and has == "tet10" and "element" not in table:
            return None  # a file's own
        if element not in (has, "spring") and ("element" in table or element == "tet10"):
            made.append(f'{key}.element="{element}"')
        return made

    def _finer(
        self, key: str, table: Any, shape: str | None, has: str, factor: float
    ) -> list[str] | None:
        if shape is None:
            linear = has == "tet4" or table.get("element") == "tet10"
            now = table.get("refine", 0)
            times = now + math.log2(factor)
            is_had = linear and times in range(now + 3)  # a file's own cells are the coarsest
            return [f"{key}.refine={times:.0f}"] if is_had else None
        if shape == "cage":
            return _finer_cage(f"{key}.cage", table["cage"], factor)
        count = COUNTS[shape]
        now = table[shape][count]
        cells, new = _cells(now, 1.0), _cells(now, factor)
        if new == cells or any(n * factor < 0.75 for n in cells if n > 1):
            return None
        return [f"{key}.{shape}.{count}={new[0] if isinstance(now, int) else new}"]

    def ratio(self, coarse: float, fine: float) -> float:
        """By how much cells of one factor are larger than those of a finer one, along the axis
        where it is the least; axes with one cell do not count where that is the shortest side of
        the finer ones.
        """
        return self.ratios(coarse, fine)[0]

    def ratios(self, coarse: float, fine: float) -> tuple[float, float]:
        """The same along the axes where it is the least and the most."""
        found = [np.array([fine / coarse])]
        for i in self.varied:
            table = self._meshes[i]
            shape = _shape_of(table)
            if shape is not None and "cage" not in table:
                now = table[shape][COUNTS[shape]]
                a, b = (np.array(_cells(now, factor)) for factor in (coarse, fine))
                edges = np.array(table[shape].get("size", np.ones(len(b)))) / b
                counts = (b > 1) | (edges > edges.min())
                found.append((b / a)[counts])
        every = np.concatenate(found)
        return float(every.min()), float(every.max())

    def elements(self) -> list[str]:
        """Elements that the bodies may have, the present one first."""
        if self.springs:
            return ["spring"]
        has = next(iter(self.scene.bodies[self.varied[0]].mesh.cells), "spring")
        return [has, *(e for e in ("tet10", "hex8", "tet4") if e != has)]

    def meshes(self) -> Iterator[Variant]:
        """All elements on coarser and finer meshes, promising ones first."""
        solid = ("tet10", "hex8") if self.springs and self.has_solid_twin else ()
        seen = {self.given}  # few cells are as many by one factor as by the next
        for factor in (1.0, *FACTORS):
            for element in (*self.elements(), *solid):
                found = self.mesh(element, factor)
                if found is not None and found.settings not in seen:
                    seen.add(found.settings)
                    yield found

    def others(self) -> Iterator[Variant]:
        """The scene's mesh with other models, precision, integrator and step."""
        own = [self.scene.bodies[i] for i in self.varied]
        words = {MODEL_WORDS.get(type(body.model)) for body in own}
        bodies = self.varied
        solid = all(body.mesh.elements for body in own)
        for word in MODELS if solid and words <= {*MODELS, "mass-tensor"} else ():
            if words != {word}:
                changes = [f'body.{i}.model="{word}"' for i in bodies]
                if "mass-spring" in words:
                    changes += [
                        f"body.{i}.poisson={SPRINGS_POISSON}" for i in bodies
                        if "poisson" not in self._bodies[i]
                    ]  # fmt: skip
                yield Variant(word, (*self.given, *changes), "model")
        other = "f64" if self.scene.precision == "f32" else "f32"
        yield Variant(f"in {other}", (*self.given, f'precision="{other}"'), "precision")
        if self.scene.integrator == "symplectic-euler" and self.scene.start == "plain":
            changes = ['integrator="velocity-verlet"']
            yield Variant("velocity-verlet", (*self.given, *changes), "integrator")

    @property
    def poisson(self) -> float:
        """The largest Poisson's ratio of what varies."""
        return max((poisson_of(self.scene.bodies[i]) for i in self.varied), default=0.0)

    @property
    def is_itself(self) -> bool:
        """Whether its springs stand for nothing but themselves, so that no mesh has an error."""
        return self.springs and not self.has_solid_twin and not any(
            self.mesh("spring", factor) for factor in FACTORS
        )  # fmt: skip

    @property
    def is_curved(self) -> bool:
        """Whether finer meshes follow a curved surface better, which elements cannot."""
        return any(word in self._meshes[i] for i in self.varied for word in CURVED)

    @property
    def is_round(self) -> bool:
        """Whether that is so of every body that varies."""
        return all(any(word in self._meshes[i] for word in CURVED) for i in self.varied)

    @property
    def has_solid_twin(self) -> bool:
        """Whether its springs stand for a solid: tets, with stiffnesses from Young's modulus."""
        return self.springs and all(
            list(b.mesh.cells) == ["tet4"]
            and b.model.needs_young  # type: ignore[union-attr]
            and b.model.density
            for b in (self.scene.bodies[i] for i in self.varied)
        )

    def tets(self, factor: float) -> tuple[Variant, Variant] | None:
        """The ruler's linear and quadratic tets on a mesh, or None where it has no such tets."""
        if self.springs and factor != 1.0:
            linear, fine = (self.mesh(element, factor) for element in ("tet4", "tet10"))
            return None if linear is None or fine is None else (linear, fine)
        if self.springs:
            changes = [f'body.{i}.mesh.element="tet10"' for i in self.varied]
            linear, fine = self.current, Variant("tet10", (*self.given, *changes))
        else:
            own = {kind for i in self.varied for kind in self.scene.bodies[i].mesh.cells}
            a, b = (
                self.current if factor == 1.0 and own == {e} else self.mesh(e, factor)
                for e in ("tet4", "tet10")
            )
            if a is None or b is None:
                return None
            linear, fine = a, b
        return self.as_solid(linear), self.as_solid(fine)

    def as_solid(self, variant: Variant) -> Variant:
        """The variant with St. Venant-Kirchhoff bodies in place of springs and linear ones."""
        words = []
        for i in self.varied:
            model = self.scene.bodies[i].model
            if isinstance(model, MassSpring | Linear | MassTensor):
                words.append(f'body.{i}.model="viscoelastic"')
            if isinstance(model, MassSpring) and "poisson" not in self._bodies[i]:
                words.append(f"body.{i}.poisson={SPRINGS_POISSON}")
        if not words:
            return variant
        return Variant(variant.name, (*variant.settings, *words), "model")

    def as_linear(self, variant: Variant) -> Variant | None:
        """The variant with linear bodies in place of St. Venant-Kirchhoff ones, where all are."""
        if any(type(self.scene.bodies[i].model) is not ViscoElastic for i in self.varied):
            return None
        words = [f'body.{i}.model="linear"' for i in self.varied]
        return Variant(f"{variant.name}, linear", (*variant.settings, *words), "model")

    def steps(self, seconds: float) -> Iterator[Variant]:
        """The scene with halves and quarters of its step [s], which its own integrator and the
        better one take."""
        finer = "velocity-verlet"
        words = dict.fromkeys([self.scene.integrator, finer])
        for parts in (2, 4):
            for word in words if self.scene.start == "plain" else [self.scene.integrator]:
                changes = [f"step={seconds / parts!r}"]
                name = f"1/{parts} of the step"
                if word != self.scene.integrator:
                    changes.append(f'integrator="{word}"')
                    name = f"{word}, {name}"
                yield Variant(name, (*self.given, *changes), "step")


def poisson_of(body: Body) -> float:
    """The largest Poisson's ratio of a body's materials; 0 of springs, which have none, and .5 of
    laws that do not tell it.
    """
    unknown = 0.0 if isinstance(body.model, MassSpring) else 0.5
    return max(float(getattr(model, "poisson", unknown)) for model in body.materials()[0])


def _shape_of(mesh: dict[str, Any]) -> str | None:
    """The shape of a mesh's table whose cells are counted, or None."""
    return next((shape for shape in COUNTS if shape in mesh), None)


def _cells(now: int | Sequence[int], factor: float) -> list[int]:
    """Cells along each axis of a shape, finer by a factor."""
    cells = [now] if isinstance(now, int) else list(now)
    return [max(1, round(factor * n)) for n in cells]


def has_numbers(body: Body) -> bool:
    """Whether pins or loads select nodes by their numbers."""
    chosen: list[Any] = [p.where for p in body.pins] + [load.where for load in body.loads]
    return any(isinstance(where, Nodes) for where in chosen)


def _scales(springs: Any) -> bool:
    """Whether a net of other cells is of the same material, as it is not with N/m or kg a node."""
    return springs.needs_young and springs.node_mass is None


def _finer_cage(key: str, table: Any, factor: float) -> list[str] | None:
    if "size" in table:
        size = float(f"{table['size'] / factor:.6g}")
        return [f"{key}.size={size!r}"]
    now = table.get("cells_across", 0)
    new = max(1, round(factor * now))
    return [f"{key}.cells_across={new}"] if new != now else None
