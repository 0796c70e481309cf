"""What may touch what in a scene, and bodies that may fold over themselves, in words."""

from __future__ import annotations

from typing import Any

import numpy as np

from tisoft.body import Body
from tisoft.check.lengths import metres
from tisoft.geometry.mesh import TetMesh
from tisoft.geometry.topology import unique_edges
from tisoft.gravity import strongest
from tisoft.model.network import triangle_areas
from tisoft.models.materials import SolidModel
from tisoft.scene import Scene
from tisoft.touch.keeping import THICKEST, THINNEST, kept_distance

FOLDS = 100.0
"""ρ g L³/(E t²/12) from which a strip of length L and thickness t hangs down and lies in folds."""
NAMED = 4
"""Others of a body that are told by name."""


def contact_report(sim: Any) -> dict[str, dict[str, Any]]:
    """By body: the distance that it keeps [m], its friction, and what its surface touches; nothing
    of a body whose nodes alone meet obstacles.
    """
    if sim.touching is None:
        return {}
    found = {}
    for toucher, names, faces in sim.touching.meetings.partners():
        found[toucher.name] = {
            "thickness": toucher.thickness,
            "edge": toucher.surface.edge,
            "friction": toucher.friction,
            "itself": toucher.self_contact,
            "bodies": names,
            "faces_meet": faces,
            "nodes_meet": [k for k in range(len(sim.scene.obstacles)) if k not in faces],
        }
    return found


def contact_lines(result: dict[str, Any]) -> list[str]:
    """The same, laid out to be read."""
    lines = []
    for name, told in result["contact"].items():
        others = [f'"{other}"' for other in told["bodies"]]
        if len(others) > NAMED:
            others = [f"{len(others)} bodies"]
        others += [f"obstacle[{number}]" for number in told["faces_meet"]]
        others += [f"obstacle[{number}] (its nodes)" for number in told["nodes_meet"]]
        meets = ["itself"] * told["itself"] + others
        keeps = f"keeps {metres(told['thickness'])}, a {told['thickness'] / told['edge']:.2g} edge"
        lines.append(f"  {name:14} {keeps}, from {', '.join(meets) or 'nothing'}")
    return ["contact", *lines] if lines else []


def keeping(body: Body) -> str | None:
    """That a body keeps another distance than its thickness: more, of a solid (a sheet's is also
    what it is made of), or less, where it touches itself.
    """
    if body.thickness is None or not len(body.mesh.surface) or not body.contact:
        return None
    sides = unique_edges(body.mesh.surface[:, [[0, 1], [1, 2], [2, 0]]])
    a, b = body.mesh.points[sides.T]
    edge = float(np.median(np.linalg.norm(b - a, axis=1)))
    kept = kept_distance(body, edge)
    if kept > body.thickness and body.mesh.elements:
        others, why = "others", f"contact needs {THINNEST:g} of the median edge"
    elif kept < body.thickness:
        others = "itself and others"
        why = (
            f"within more than {THICKEST:g} of the median edge what touches itself would meet its "
            "own neighbours (self_contact = false: it keeps all of it)"
        )
    else:
        return None
    thick = metres(body.thickness)
    return f"keeps {metres(kept)} from {others}, not the {thick} of its thickness: {why}"


def folding(body: Body, scene: Scene) -> str | None:
    """The question whether a solid that its weight can fold is to touch itself."""
    model = body.model
    asked = isinstance(model, SolidModel) and isinstance(body.mesh, TetMesh)
    if not asked or body.self_contact is not None or not body.contact:
        return None
    assert isinstance(model, SolidModel) and isinstance(body.mesh, TetMesh)
    thickness = (
        4.0
        * float(body.mesh.volumes.sum())
        / float(triangle_areas(body.mesh.points, body.mesh.surface).sum())
    )
    length = float(np.ptp(body.mesh.points, axis=0).max())
    weight = model.density * strongest(scene.gravity)
    if 12.0 * weight * length**3 < FOLDS * model.young * thickness**2:
        return None
    return (
        "is so long and soft that it may fold over itself, and then passes through itself: "
        "self_contact = true keeps it from that (self_contact = false: this is not asked)"
    )
