"""What a user may vary of a scene: element, mesh, model, precision, integrator, step.

A variant is a list of settings as --set takes them, so whoever likes it can have it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tisoft.changes import MODEL_WORDS
from tisoft.models.materials import MassSpring
from tisoft.scene import Scene
from tisoft.scene_file import document_of

CURRENT = "as it is"
FACTORS = (0.5, 0.75, 1.5, 2.0)
"""By which cells along each axis of a shape are multiplied."""
COUNTS = {"box": "cells", "cloth": "cells", "grid": "cells", "ball": "resolution",
          "cylinder": "resolution"}  # fmt: skip
"""The key of each shape that says how fine it is."""
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
    """

    def __init__(self, source: str | Path | Scene, scene: Scene, settings: Sequence[str]) -> None:
        self.scene = scene
        self.given = tuple(settings)
        table: Any = {} if isinstance(source, Scene) else document_of(source, settings)
        bodies = table.get("body", [{} for _ in scene.bodies])
        self._meshes = [body.get("mesh", {}) for body in bodies]

    @property
    def current(self) -> Variant:
        """The scene itself."""
        return Variant(CURRENT, self.given)

    def mesh(self, element: str, factor: float) -> Variant | None:
        """All bodies with an element ("tet4", "tet10", "hex8", "spring") and finer or coarser by a
        factor along each axis; None where that cannot be had, or is the scene itself.
        """
        settings: list[str] = []
        for i in range(len(self.scene.bodies)):
            own = self._of_body(i, element, factor)
            if own is None:
                return None
            settings += own
        if not settings:
            return None
        size = "" if factor == 1.0 else f", {factor:g} x as fine"
        return Variant(f"{element}{size}", (*self.given, *settings))

    def _of_body(self, i: int, element: str, factor: float) -> list[str] | None:
        body, table = self.scene.bodies[i], self._meshes[i]
        has = next(iter(body.mesh.cells), "spring")
        if len(body.mesh.cells) > 1:
            return None
        key, made = f"body.{i}.mesh", []
        shape = next((s for s in COUNTS if s in table), None)
        springs = isinstance(body.model, MassSpring)
        if (element == "spring") != springs:
            return None
        if springs and factor != 1.0 and not body.model.needs_young:  # type: ignore[union-attr]
            return None  # N/m of other springs would be another material
        if factor != 1.0:
            finer = self._finer(key, table, shape, has, factor)
            if finer is None:
                return None
            made += finer
        split = table.get("box", {}).get("split", "five") if shape == "box" else None
        if element == "hex8" and has != "hex8":
            if split is None:
                return None
            made.append(f'{key}.box.split="hex"')
        elif element in ("tet4", "tet10") and has == "hex8":
            if split is None:
                return None
            made.append(f'{key}.box.split="five"')
        if element == "tet10" and has != "tet10":
            made.append(f'{key}.element="tet10"')
        if element == "tet4" and has == "tet10":
            if table.get("element") != "tet10":
                return None
            made.append(f'{key}.element="tet4"')
        return made

    def _finer(
        self, key: str, table: Any, shape: str | None, has: str, factor: float
    ) -> list[str] | None:
        if shape is None:
            linear = has == "tet4" or table.get("element") == "tet10"
            times = math.log2(factor)
            return [f"{key}.refine={times:.0f}"] if linear and times in (1.0, 2.0) else None
        count = COUNTS[shape]
        now = table[shape][count]
        cells = [now] if isinstance(now, int) else list(now)
        new = [max(1, round(factor * n)) for n in cells]
        if new == cells or any(n * factor < 0.75 for n in cells if n > 1):
            return None
        return [f"{key}.{shape}.{count}={new[0] if isinstance(now, int) else new}"]

    def elements(self) -> list[str]:
        """Elements that the bodies may have, the present one first."""
        if all(isinstance(body.model, MassSpring) for body in self.scene.bodies):
            return ["spring"]
        has = next(iter(self.scene.bodies[0].mesh.cells), "spring")
        return [has, *(e for e in ("tet10", "hex8", "tet4") if e != has)]

    def meshes(self) -> Iterator[Variant]:
        """All elements on coarser and finer meshes, promising ones first."""
        for factor in (1.0, *FACTORS):
            for element in self.elements():
                found = self.mesh(element, factor)
                if found is not None and found.settings != self.given:
                    yield found

    def others(self) -> Iterator[Variant]:
        """The scene's mesh with other models, precision, integrator and step."""
        words = {MODEL_WORDS.get(type(body.model)) for body in self.scene.bodies}
        bodies = range(len(self.scene.bodies))
        solid = all(body.mesh.elements for body in self.scene.bodies)
        for word in MODELS if solid and words <= {*MODELS, "mass-tensor"} else ():
            if words != {word}:
                changes = tuple(f'body.{i}.model="{word}"' for i in bodies)
                yield Variant(word, self.given + changes, "model")
        other = "f64" if self.scene.precision == "f32" else "f32"
        yield Variant(f"in {other}", (*self.given, f'precision="{other}"'), "precision")
        if self.scene.integrator == "symplectic-euler" and self.scene.start == "plain":
            changes = ('integrator="velocity-verlet"',)
            yield Variant("velocity-verlet", self.given + changes, "integrator")

    def step(self, seconds: float) -> Variant:
        """The scene with a step [s]."""
        settings = (*self.given, f"step={seconds!r}")
        return Variant(f"step {seconds * 1e3:.3g} ms", settings, "step")
