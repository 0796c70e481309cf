"""Topologies: a net holds its shape only where springs resist every motion but the rigid ones.

N nodes in a plane have 2N − 3 ways to change shape.  A square of 4 sides has one left over; one
diagonal takes it.  A grid of n x m squares needs n + m − 1 braces, well placed (Bolker and Crapo
1979): each joins a row to a column, and all rows and columns have to hang together.
"""

import numpy as np
import page

import tisoft as ts
from tisoft.geometry.rigidity import rigidity

N, M = 4, 3
GRID = ts.cloth(size=(N, M), cells=(N, M), diagonals=False)


def brace(cells: list[tuple[int, int]]) -> np.ndarray:
    """Springs of the grid and one diagonal in each of these cells."""
    corner = np.array([i + (N + 1) * k for i, k in cells])
    return np.concatenate([GRID.edges, np.stack([corner, corner + N + 2], axis=1)])


def sheared_energy(springs: list[list[int]]) -> float:
    """Energy [J] of a unit square with its top moved sideways, along a circle, by 0.1 rad."""
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64")
    square = ts.net([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], springs)
    scene.add_body(square, ts.MassSpring(stiffness=100.0, node_mass=1.0))
    sim = ts.Simulation(scene)
    top = [np.sin(0.1), np.cos(0.1) - 1, 0]
    sim.set_state(square.points + np.outer([0, 0, 1, 1], top), np.zeros((4, 3)))
    return sim.energy()["elastic"]


page.begin(__doc__)
sides = [[0, 1], [2, 3], [0, 2], [1, 3]]
stretch = np.hypot(1 + np.sin(0.1), np.cos(0.1)) - np.sqrt(2)
page.check("energy of a sheared square [J]", 0, sheared_energy(sides), within=1e-15)
braced = sheared_energy([*sides, [0, 3]])
page.check("with a diagonal: k (L − l)²/2 [J]", 50 * stretch**2, braced, within=1e-12)
good = [(0, 0), (1, 0), (2, 0), (3, 0), (0, 1), (0, 2)]  # a row and a column: all hang together
poor = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)]  # neither column 3 nor row 2
for axis, cells, left in zip(page.axes(3), ([], good, poor), (N + M - 1, 0, 2), strict=True):
    springs = brace(cells) if cells else GRID.edges
    count = rigidity(GRID.points, springs).in_plane
    page.check(f"motions left in a {N} x {M} grid with {len(cells)} braces", left, count, within=0)
    axis.plot(*GRID.points[springs][:, :, [0, 2]].T, "C0o-", ms=3)
    axis.set(title=f"{len(cells)} braces: {count} motions left", aspect="equal")
    axis.axis("off")
page.save(__file__, axis)
