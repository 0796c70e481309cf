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


def prongs(gap, base=0.1, length=0.4, wide=0.1, thick=0.08):
    """Two prongs along x on a base, side by side in y: 16 points, 28 triangles."""
    far, top = base + length, 2 * wide + gap
    outline = [(0, 0), (far, 0), (far, wide), (base, wide)]
    outline += [(base, wide + gap), (far, wide + gap), (far, top), (0, top)]
    points = np.array([(x, y, z) for z in (0, thick) for x, y in outline], float)
    cap = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 7], [4, 5, 6], [4, 6, 7]])
    i = np.arange(8)
    j = (i + 1) % 8
    walls = [np.stack([i, j, j + 8], axis=1), np.stack([i, j + 8, i + 8], axis=1)]
    return points, np.concatenate([cap[:, ::-1], cap + 8, *walls])
