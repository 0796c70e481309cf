"""Makes creature.vtu and creature.obj, a jelly bear: coarse tets, and the fine skin they carry.

    pip install scikit-image && python assets/make_creature.py

The shape is a smooth union of ellipsoids and tapered capsules.  Its skin comes from marching cubes
(Lorensen and Cline 1987), evened out.  For the tets, a body-centred cubic lattice is warped onto
the shape, a little inflated, and cut along it (isosurface stuffing, after Labelle and Shewchuk
2007), then nodes are moved to where the worst of their tets improves.  The same tisoft, NumPy and
scikit-image give the same files.  y is up, z is where it looks; the feet stand on y = 0; metres.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tisoft.geometry import topology
from tisoft.geometry.files import write_vtu
from tisoft.geometry.mesh import TetMesh, tet_mesh
from tisoft.geometry.quality import quality

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Distance = Callable[[Floats], Floats]

SPACING = 0.088
"""Side of the lattice's cubes [m]."""
INFLATED = 0.01
"""How far the tets reach beyond the shape [m], so that they hold all of the skin."""
FINE = 0.0178
"""Side of the cubes that the skin is cut from [m]."""
SOLES = 0.035
"""Height at which the feet are cut flat [m]: the bear stands there."""
TARGET = Path(__file__).with_name("creature")


def bear(points: Floats) -> Floats:
    """Signed distance to the bear, roughly [m]: negative inside."""
    p = np.concatenate([np.abs(points[:, :1]), points[:, 1:]], axis=1)  # mirrored in x
    solid = _ellipsoid(p, (0, 0.285, 0), (0.165, 0.215, 0.145))
    solid = _blend(solid, _ellipsoid(p, (0, 0.235, 0.055), (0.125, 0.14, 0.125)), 0.04)  # belly
    solid = _blend(solid, _ellipsoid(p, (0, 0.57, 0.01), (0.165, 0.145, 0.14)), 0.05)  # head
    leg = _chain(p, [(0.10, 0.15, -0.01), (0.12, 0.08, -0.01)], [0.1, 0.088])
    foot = _ellipsoid(p, (0.125, 0.08, 0.06), (0.09, 0.09, 0.115))
    arm = _chain(
        p, [(0.14, 0.395, 0.0), (0.19, 0.325, 0.06), (0.15, 0.29, 0.145)], [0.07, 0.06, 0.055]
    )
    for limb, fillet in ((leg, 0.03), (foot, 0.03), (arm, 0.045)):
        solid = _blend(solid, limb, fillet)
    ear = _ellipsoid(p, (0.125, 0.69, -0.01), (0.072, 0.072, 0.048))
    ear = _blend_cut(ear, -_ellipsoid(p, (0.128, 0.694, 0.045), (0.044, 0.044, 0.028)), 0.02)
    solid = _blend(solid, ear, 0.022)
    solid = _blend(solid, _ellipsoid(p, (0, 0.535, 0.13), (0.08, 0.062, 0.065)), 0.025)  # snout
    return _blend_cut(solid, SOLES - p[:, 1], 0.02)


def face(points: Floats) -> Floats:
    """The bear with its nose, eyes and tail, which are too small for tets."""
    p = np.concatenate([np.abs(points[:, :1]), points[:, 1:]], axis=1)
    solid = bear(points)
    solid = _blend(solid, _ellipsoid(p, (0, 0.565, 0.19), (0.032, 0.023, 0.022)), 0.006)
    solid = _blend(solid, _ellipsoid(p, (0.062, 0.61, 0.128), (0.023, 0.026, 0.022)), 0.006)
    return _blend(solid, _ellipsoid(p, (0, 0.16, -0.14), (0.05, 0.05, 0.045)), 0.02)


def _ellipsoid(p: Floats, centre: tuple[float, ...], radii: tuple[float, ...]) -> Floats:
    q = p - np.array(centre)
    k = np.linalg.norm(q / np.array(radii), axis=1)
    slope = np.linalg.norm(q / np.array(radii) ** 2, axis=1)
    return k * (k - 1.0) / np.maximum(slope, 1e-12)


def _chain(p: Floats, joints: list[tuple[float, ...]], radii: list[float]) -> Floats:
    """Tapered capsules from joint to joint."""
    nearest = np.full(len(p), np.inf)
    for a, b, start, end in zip(joints, joints[1:], radii, radii[1:], strict=False):
        origin, along = np.array(a), np.array(b) - np.array(a)
        t = np.clip((p - origin) @ along / (along @ along), 0.0, 1.0)
        gap = np.linalg.norm(p - origin - t[:, None] * along, axis=1) - (start + t * (end - start))
        nearest = np.minimum(nearest, gap)
    return nearest


def _blend(a: Floats, b: Floats, radius: float) -> Floats:
    """Union with a fillet of about `radius` [m].  Source: Quilez, polynomial smooth minimum."""
    h = np.maximum(radius - np.abs(a - b), 0.0) / radius
    return np.minimum(a, b) - h * h * radius / 4.0


def _blend_cut(a: Floats, b: Floats, radius: float) -> Floats:
    return -_blend(-a, -b, radius)


def stuffed(distance: Distance, low: Floats, high: Floats, spacing: float) -> TetMesh:
    """Tets that fill distance < 0 between the corners `low` and `high` [m]."""
    points, tets = _lattice(low, high, spacing)
    values = distance(points)
    near = (np.abs(values[tets]) < 2.0 * spacing).any(axis=1) | (values[tets] < 0).any(axis=1)
    tets = tets[near]
    _warp(points, values, topology.edges_of(tets), distance)
    points, tets = _cut(points, values, tets[(values[tets] < 0).any(axis=1)], distance)
    mesh = tet_mesh(points, tets)
    return tet_mesh(_smoothed(mesh, distance), mesh.tets)


def _lattice(low: Floats, high: Floats, spacing: float) -> tuple[Floats, NDArray[np.int64]]:
    """Body-centred cubic lattice: tets join two neighbouring centres and an edge of their face."""
    n = np.ceil((high - low) / spacing).astype(int)
    corner = np.stack(np.meshgrid(*(np.arange(m + 1) for m in n), indexing="ij"), -1).reshape(-1, 3)
    centre = np.stack(np.meshgrid(*(np.arange(m) for m in n), indexing="ij"), -1).reshape(-1, 3)
    points = np.concatenate([low + spacing * corner, low + spacing * (centre + 0.5)])
    tets = []
    for axis in range(3):
        u, v = np.eye(3, dtype=int)[[(axis + 1) % 3, (axis + 2) % 3]]
        first = centre[centre[:, axis] < n[axis] - 1]
        second = first + np.eye(3, dtype=int)[axis]
        ring = [second, second + u, second + u + v, second + v]
        for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
            ends = [_number(first, n) + np.prod(n + 1), _number(second, n) + np.prod(n + 1)]
            tets.append(np.stack([*ends, _number(a, n + 1), _number(b, n + 1)], axis=1))
    return points, np.concatenate(tets)


def _number(steps: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    return (steps[:, 0] * counts[1] + steps[:, 1]) * counts[2] + steps[:, 2]


def _crossings(a: Floats, b: Floats, distance: Distance) -> Floats:
    """Points between a (inside) and b (outside) where the distance is zero, by bisection."""
    inside, outside = np.zeros(len(a)), np.ones(len(a))
    for _ in range(30):
        middle = 0.5 * (inside + outside)
        within = distance(a + middle[:, None] * (b - a)) < 0
        inside, outside = np.where(within, middle, inside), np.where(within, outside, middle)
    return a + inside[:, None] * (b - a)


def _warp(points: Floats, values: Floats, edges: NDArray[np.int32], distance: Distance) -> None:
    """Moves nodes onto crossings of their edges that lie close; their value becomes zero."""
    ends = np.concatenate([edges, edges[:, ::-1]])
    ends = ends[values[ends[:, 0]] * values[ends[:, 1]] < 0]
    inner = values[ends[:, 0]] < 0
    a, b = np.where(inner[:, None], ends, ends[:, ::-1]).T
    crossing = _crossings(points[a], points[b], distance)
    start = points[ends[:, 0]]
    length = np.linalg.norm(points[ends[:, 1]] - start, axis=1)
    share = np.linalg.norm(crossing - start, axis=1) / length
    # The lattice has long edges (a cube's side) and short ones; the limits are the paper's.
    limit = np.where(length > 0.93 * length.max(), 0.25, 0.41)
    for k in np.argsort(share, kind="stable"):
        node, other = ends[k]
        if share[k] < limit[k] and values[node] != 0.0 and values[other] != 0.0:
            points[node], values[node] = crossing[k], 0.0


def _cut(
    points: Floats, values: Floats, tets: NDArray[np.int64], distance: Distance
) -> tuple[Floats, NDArray[np.int64]]:
    """The part of the tets with negative value."""
    edges = topology.edges_of(tets)
    edges = edges[values[edges[:, 0]] * values[edges[:, 1]] < 0]
    inner = np.where((values[edges[:, 0]] < 0)[:, None], edges, edges[:, ::-1])
    new = _crossings(points[inner[:, 0]], points[inner[:, 1]], distance)
    between = {tuple(sorted(e)): len(points) + k for k, e in enumerate(edges.tolist())}

    def mid(a: int, b: int) -> int:
        return between[(a, b) if a < b else (b, a)]

    kept: list[list[int]] = []
    for tet in tets.tolist():
        inside = [n for n in tet if values[n] < 0]
        outside = [n for n in tet if values[n] > 0]
        zero = [n for n in tet if values[n] == 0]
        if not outside:
            kept.append(tet)
        elif len(inside) == 1:
            kept.append([inside[0], *zero, *(mid(inside[0], n) for n in outside)])
        elif len(inside) == 2 and len(outside) == 1:
            a, b = inside
            kept += _pyramid([a, b, mid(b, outside[0]), mid(a, outside[0])], zero[0])
        elif len(inside) == 2:
            a, b = inside
            kept += _prism([a, *(mid(a, n) for n in outside)], [b, *(mid(b, n) for n in outside)])
        else:
            kept += _prism(inside, [mid(n, outside[0]) for n in inside])
    return np.concatenate([points, new]), np.array(kept)


def _pyramid(base: list[int], top: int) -> list[list[int]]:
    k = base.index(min(base))
    a, b, c, d = base[k:] + base[:k]
    return [[a, b, c, top], [a, c, d, top]]


def _prism(low: list[int], high: list[int]) -> list[list[int]]:
    """Three tets; every quadrilateral is cut from its lowest node, so neighbours agree."""
    nodes = low + high
    if min(nodes) in high:
        low, high = high, low
    k = low.index(min(low))
    a, b, c = low[k:] + low[:k]
    d, e, f = high[k:] + high[:k]
    return [[a, d, e, f], *_pyramid([b, c, f, e], a)]


def _smoothed(mesh: TetMesh, distance: Distance) -> Floats:
    """Moves each node towards its neighbours' mean as far as its worst tet gains by it."""
    points, tets = mesh.points.copy(), mesh.tets
    starts, slots = topology.incidence(tets, len(points))
    on_surface = np.zeros(len(points), dtype=bool)
    on_surface[mesh.surface] = True
    skin = topology.unique_edges(mesh.surface[:, [[0, 1], [1, 2], [2, 0]]])
    near = _neighbours(mesh.edges, len(points))
    near_skin = _neighbours(skin, len(points))
    for _ in range(12):
        for node in range(len(points)):
            around = near_skin[node] if on_surface[node] else near[node]
            own = tets[slots[starts[node] : starts[node + 1]] // 4]
            goal = points[around].mean(axis=0)
            best, before = _worst(points, own), points[node].copy()
            for share in (1.0, 0.5, 0.2):
                trial = before + share * (goal - before)
                points[node] = _onto(trial, distance) if on_surface[node] else trial
                if _worst(points, own) > best:
                    break
                points[node] = before
    return points


def _neighbours(edges: NDArray[np.int32], nodes: int) -> list[NDArray[np.int32]]:
    both = np.concatenate([edges, edges[:, ::-1]])
    both = both[np.lexsort((both[:, 1], both[:, 0]))]
    return np.split(both[:, 1], np.searchsorted(both[:, 0], np.arange(1, nodes)))


def _worst(points: Floats, tets: NDArray[np.int32]) -> float:
    """Least quality; below zero where a tet is turned inside out."""
    a = points[tets]
    x, y, z = a[:, 1] - a[:, 0], a[:, 2] - a[:, 0], a[:, 3] - a[:, 0]
    volume = np.einsum("ij,ij->i", x, np.cross(y, z))
    edges = sum(np.einsum("ij,ij->i", e, e) for e in (x, y, z, y - x, z - x, z - y))
    return float(np.min(volume / edges**1.5))


def _onto(point: Floats, distance: Distance) -> Floats:
    """The point moved along the gradient onto distance = 0."""
    steps = 1e-5 * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    for _ in range(3):
        values = distance(point + steps)
        gradient = (values[1:4] - values[4:7]) / 2e-5
        point = point - values[0] * gradient / max(float(gradient @ gradient), 1e-6)
    return point


def surface(distance: Distance, low: Floats, high: Floats, spacing: float) -> tuple[Floats, Ints]:
    """Points and triangles of distance = 0: marching cubes, then evened out along the surface."""
    from skimage.measure import marching_cubes

    axes = [np.arange(a, b + spacing, spacing) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    values = distance(grid.reshape(-1, 3)).reshape(grid.shape[:3])
    points, triangles, _, _ = marching_cubes(values, 0.0, spacing=(spacing,) * 3)
    points, triangles = points + low, triangles[:, ::-1].astype(np.int64)
    edges = topology.unique_edges(triangles[:, [[0, 1], [1, 2], [2, 0]]])
    ends = np.concatenate([edges, edges[:, ::-1]])
    count = np.bincount(ends[:, 0], minlength=len(points))[:, None]
    for _ in range(8):
        mean = np.zeros_like(points)
        np.add.at(mean, ends[:, 0], points[ends[:, 1]])
        points = _all_onto(0.5 * points + 0.5 * mean / count, distance)
    return points, triangles


def _all_onto(points: Floats, distance: Distance) -> Floats:
    """Points moved along the gradient onto distance = 0."""
    for _ in range(3):
        values, step = distance(points), 1e-5
        sides = [
            (distance(points + e) - distance(points - e)) / (2.0 * step) for e in step * np.eye(3)
        ]
        gradient = np.stack(sides, axis=1)
        square = np.maximum(np.einsum("ij,ij->i", gradient, gradient), 1e-3)
        points = points - (values / square)[:, None] * gradient
    return points


def main() -> None:
    """Writes the asset and says what it holds."""
    # The lattice's place decides how thin its thinnest tet is, and so the stable step.
    low, high = np.array([-0.352, -0.104, -0.344]), np.array([0.352, 0.85, 0.34])
    mesh = stuffed(lambda p: bear(p) - INFLATED, low, high, SPACING)
    points = np.round(mesh.points - [0.0, SOLES, 0.0], 5)
    write_vtu(TARGET.with_suffix(".vtu"), points, tets=mesh.tets)
    worst = quality(mesh).min()
    print(
        f"creature.vtu: {len(points)} nodes, {len(mesh.tets)} tets, worst quality {worst:.2f}, "
        f"volume {mesh.volumes.sum():.4f} m³"
    )
    places, triangles = surface(face, low, high, FINE)
    lines = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in places - [0.0, SOLES, 0.0]]
    lines += [f"f {a} {b} {c}" for a, b, c in triangles + 1]
    TARGET.with_suffix(".obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"creature.obj: {len(places)} points, {len(triangles)} triangles")


if __name__ == "__main__":
    main()
