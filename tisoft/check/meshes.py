"""What a body's mesh may surprise its user with, as sentences.

`mesh_warnings` changes what is computed and is told by every command; `mesh_notes` is for `check`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from tisoft.body import Body
from tisoft.check.cages import cage_notes
from tisoft.geometry import topology
from tisoft.geometry.groups import NodeSet, Region, listed, title
from tisoft.geometry.joints import Joints, coincident_nodes, enclosed_volume
from tisoft.geometry.mesh import Mesh, TetMesh
from tisoft.models.materials import MassSpring
from tisoft.scene import Scene
from tisoft.where import InRegion, InSet

Ints = NDArray[np.int64]


def mesh_warnings(scene: Scene) -> list[str]:
    """Sentences about meshes that are not what they look like; none where nothing is to be said."""
    found = []
    for body in scene.bodies:
        name = f'body "{body.name}"'
        found += [f"{name} {told}" for told in _of_body(body)]
    return found


def _of_body(body: Body) -> Iterator[str]:
    mesh = body.mesh
    for told in mesh.warnings:
        yield f"was changed as it was read: {told}"
    if isinstance(mesh, TetMesh):
        yield from _of_joints(mesh, mesh.joints)
        yield from _of_regions(body)
    elif apart := _coincident(mesh, coincident_nodes(mesh.points, mesh.edges)):
        yield apart
    yield from _of_pieces(body)


def _of_joints(mesh: TetMesh, joints: Joints) -> Iterator[str]:
    if told := _coincident(mesh, joints.coincident):
        yield told
    if len(joints.hanging) or joints.lying:
        node = f", as node {_numbered(mesh, joints.hanging[0])}" if len(joints.hanging) else ""
        yield (
            f"has faces that lie on each other and are not joined: {len(joints.hanging)} nodes lie "
            f"on faces or edges of other tets{node}, and {joints.lying} faces on others of another "
            "triangulation; the body comes apart there, so mesh both sides alike"
        )
    elif len(joints.hinges):
        yield (
            f"hangs together by an edge or a node alone at {_count(len(joints.hinges), 'node')}, "
            f"as node {_numbered(mesh, joints.hinges[0])}: it turns there as on a hinge; "
            "join the tets by faces"
        )
    if len(joints.folded):
        yield _folded(mesh, joints.folded)
    if len(joints.doubled):
        yield (
            f"fills the same space twice: {_count(len(joints.doubled), 'tet')} (as tet "
            f"{joints.doubled[0]}) hold nodes or centres of others, or share a face with two, and "
            "mass and stiffness count double there; cut the parts free of each other, or take one "
            "out"
        )


def _coincident(mesh: Mesh, pairs: Ints) -> str | None:
    if not len(pairs):
        return None
    a, b = (int(mesh.kept_nodes[node]) for node in pairs[0])
    place = ", ".join(f"{x:.6g}" for x in mesh.points[pairs[0, 0]])
    verb = "pair of nodes lies" if len(pairs) == 1 else "pairs of nodes lie"
    return (
        f"may come apart: {len(pairs)} {verb} in the same place (as nodes {a} and {b} at "
        f"({place})) and nothing joins them; merge = true in [body.mesh] makes one node of each"
    )


def _numbered(mesh: TetMesh, node: int) -> str:
    place = ", ".join(f"{x:.6g}" for x in mesh.points[node])
    return f"{int(mesh.kept_nodes[node])} at ({place})"


def _folded(mesh: TetMesh, folded: Ints) -> str:
    total = float(mesh.volumes.sum())
    enclosed = enclosed_volume(mesh.points, mesh.tets, folded)
    shown = ", ".join(str(tet) for tet in folded[:5]) + (", …" if len(folded) > 5 else "")
    many = f"tet {shown} is" if len(folded) == 1 else f"tets {shown} ({len(folded)}) are"
    return (
        f"overlaps itself: {many} folded over their neighbours; the tets add up to {total:.6g} m³, "
        f"the surface encloses {enclosed:.6g} m³, and mass and stiffness are wrong there; "
        "mend the mesh"
    )


def _of_regions(body: Body) -> Iterator[str]:
    mesh = body.mesh
    parts = [region for region in mesh.regions if len(region.tets) < mesh.elements]
    number = body.materials()[1]
    if body.regions:  # what the others are made of is said by leaving them out, where it is one
        parts = [region for region in parts if not number[region.tets].any()]
    if len(parts) < 1 + bool(body.regions):
        return
    counted = ", ".join(
        f"{title(region)}: {_count(len(region.tets), 'tet')}" for region in parts[:6]
    )
    more = ", …" if len(parts) > 6 else ""
    yield (
        f"has {_count(len(parts), 'region')} in its file ({counted}{more}), "
        "and one material is used for all of it"
        + (" but for the regions that have their own" if body.regions else "")
    )


def _of_pieces(body: Body) -> Iterator[str]:
    """Pieces that no pin holds, where others are held."""
    mesh = body.mesh
    springs = isinstance(body.model, MassSpring)
    if not body.pins or (mesh.pieces < 2 and not springs):
        return
    labels = topology.piece_of(body.springs() if springs else mesh.edges, len(mesh.points))
    held = np.unique(labels[np.concatenate([body.nodes(pin.where) for pin in body.pins])])
    free = np.setdiff1d(labels, held)
    if len(free):
        first = int(np.flatnonzero(labels == free[0])[0])
        pieces = "a piece" if len(free) == 1 else f"{len(free)} pieces"
        yield (
            f"has {pieces} of {int(labels.max()) + 1} that no pin holds, as that of node "
            f"{int(mesh.kept_nodes[first])}: nothing joins it to the others"
        )


def mesh_notes(body: Body) -> list[str]:
    """What `check` asks and tells of a body's mesh beyond warnings."""
    mesh, name = body.mesh, f'body "{body.name}"'
    found = [f"{name} {told}" for told in (*mesh.questions, *cage_notes(body))]
    if isinstance(mesh, TetMesh) and len(mesh.joints.pinched):
        nodes = mesh.joints.pinched
        found.append(
            f"{name} touches itself by an edge or a node alone at {_count(len(nodes), 'node')}, as "
            f"node {_numbered(mesh, nodes[0])}; it holds together elsewhere"
        )
    unused = [group for group in mesh.sets if not used(body, group)]
    if unused:
        found.append(
            f"{name} has {_count(len(unused), 'set')} in its file that no pin or load uses: "
            f"{listed(unused, 6)}; where = {{ set = … }} selects one"
        )
    return found


def used(body: Body, group: Region | NodeSet) -> bool:
    """Whether a pin or a load names a region or a set."""
    rules = [pin.where for pin in body.pins] + [load.where for load in body.loads]
    mesh = body.mesh
    chosen: list[Region | NodeSet] = []
    for own in body.regions:
        chosen += [mesh.regions[k] for k in own.places(mesh)]
    for rule in rules:
        if isinstance(rule, InRegion):
            chosen += [mesh.regions[k] for k in rule.found(mesh)]
        elif isinstance(rule, InSet):
            chosen += [mesh.sets[k] for k in rule.found(mesh)]
    return group in chosen


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"
