"""Closed surfaces that tests put cages around."""

import numpy as np

SIDES = np.array(
    [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
     [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]]
)  # fmt: skip


def block(size, corner=(0, 0, 0)):
    """A box: 8 points, 12 triangles."""
    at = np.array([[c & 1, c >> 1 & 1, c >> 2] for c in range(8)], float)
    return at * size + np.array(corner, float), SIDES


def sphere(radius, fine):
    """A ball of 8 fine² triangles, an octahedron blown up."""
    points, triangles = [], []
    for signs in np.array([[(-1) ** (k >> d & 1) for d in range(3)] for k in range(8)]):
        start = {}
        for i in range(fine + 1):
            for j in range(fine + 1 - i):
                start[i, j] = len(points)
                p = np.array([i, j, fine - i - j], float) * signs
                points.append(radius * p / np.linalg.norm(p))
        for i in range(fine):
            for j in range(fine - i):
                up = [[start[i, j], start[i + 1, j], start[i, j + 1]]]
                if i + j < fine - 1:
                    up.append([start[i + 1, j], start[i + 1, j + 1], start[i, j + 1]])
                triangles += [t if signs.prod() > 0 else t[::-1] for t in up]
    return np.round(np.array(points), 14), np.array(triangles)


def turn(axis, degrees):
    """The matrix of a turn (Rodrigues)."""
    x, y, z = np.array(axis, float) / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    t = np.radians(degrees)
    return np.eye(3) + np.sin(t) * K + (1 - np.cos(t)) * K @ K
