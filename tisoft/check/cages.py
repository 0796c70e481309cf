"""What `check` tells of a cage: its lattice, how well it bends, which moments it has."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tisoft.body import Body
from tisoft.geometry.cage.build import Cage
from tisoft.geometry.cage.carried import MOST_MEANS, Carried
from tisoft.geometry.cage.thickness import thinnest

FEW, VERY_FEW = 3.0, 1.5
"""Cells through the thinnest part below which bending is told, and told strongly."""
BENDING = 48.0
"""Per cent · t², t cells through: too stiff in bending where the lattice does not fit."""
INERTIA = 0.01
"""Error of the moments of inertia from which on it is told."""


def cells_through(carried: Carried) -> float | None:
    """Cells through the thinnest part; None where the surface has no two sides that face apart."""
    cage, skin = carried.cage, carried.skin
    lattice = cage.lattice
    places = lattice.world(skin.carried(carried.places))
    thickness = thinnest(places, skin.triangles.astype(np.int64), lattice)
    return None if thickness is None else thickness / float(lattice.size.mean())


def is_whole(cage: Cage) -> bool:
    """Whether all cells are full: the lattice fits."""
    return bool((np.abs(cage.moments[:, 0] - 1.0) < 1e-9).all())


def cage_warnings(body: Body) -> Iterator[str]:
    """What makes the cage's answers wrong by more than a few per cent, each after the body's
    name.
    """
    if body.carried is None:
        return
    cage = body.carried.cage
    through = cells_through(body.carried)
    if through is not None and through < FEW and not is_whole(cage):
        error = f"about {BENDING / through**2:.0f} %" if through >= 1.0 else "more than 40 %"
        edge = float(cage.lattice.size.mean()) * through / FEW
        strongly = "only " if through < VERY_FEW else ""
        yield (
            f"has {strongly}{through:.2g} cells through its thinnest part: that bends {error} too "
            f"stiffly; cells of {edge:.3g} m (as it was built) make it {FEW:g}"
        )
    if cage.inertia_error > INERTIA:
        yield (
            f"has moments of inertia that are {100 * cage.inertia_error:.0f} % off at the most: "
            "its few cells across cannot carry them; mass and centre are right"
        )


def pin_warnings(body: Body) -> Iterator[str]:
    """Pins that hold nodes near the pinned patch instead of the patch, each after the body's
    name.
    """
    if body.carried is None:
        return
    for number, pin in enumerate(body.pins):
        points = body.points(pin.where)
        if len(points) and len(points) < len(body.carried.skin.corners):
            if not body.carried.is_on_plane(points) and body.grip(pin.where)[1] is None:
                yield (
                    f"is held by pin[{number}] within half a cell of where it is pinned: points "
                    f"alone, or more than {MOST_MEANS} cells; the clamp is off by up to half a cell"
                )


def cage_notes(body: Body) -> Iterator[str]:
    """The lattice in a sentence, after the body's name."""
    if body.carried is None:
        return
    cage = body.carried.cage
    lattice = cage.lattice
    size = " x ".join(f"{x:.3g}" for x in lattice.size)
    axes = "axes of its own" if lattice.is_turned else "the world's axes"
    part = float((cage.moments[:, 0] < 1.0 - 1e-9).mean())
    fit = "which it fits exactly" if part == 0.0 else f"{100 * part:.0f} % of them filled in part"
    shared = _shared(cage)
    several = f", {shared} of which hold parts that do not touch, each for itself" if shared else ""
    yield (
        f"is carried by {len(cage.cells)} cells of {size} m along {axes}, {fit}{several}; "
        f"its surface has {len(cage.skin.triangles)} triangles"
    )


def _shared(cage: Cage) -> int:
    """Places of the lattice with several hexahedra."""
    uses = np.unique(cage.cells, axis=0, return_counts=True)[1]
    return int((uses > 1).sum())
