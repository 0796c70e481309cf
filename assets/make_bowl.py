"""Makes bowl.stl, the obstacle of the demo "bowl"; it stands at y = 0.

python assets/make_bowl.py
"""

from pathlib import Path

import numpy as np

RADIUS, THICK = 0.45, 0.03
"""Of the inside, and of the wall [m]."""
OPEN = 80.0
"""Degrees from the bottom to the rim."""
AROUND, UP = 40, 9
"""Pieces of a circle, and of the profile from the bottom to the rim."""


def bowl() -> np.ndarray:
    """Corners of its triangles [m], counter-clockwise from outside, shape (triangles, 3, 3)."""
    angle = np.linspace(0.0, np.radians(OPEN), UP + 1)
    arc = np.stack([np.sin(angle), -np.cos(angle)], axis=1)
    profile = np.concatenate([(RADIUS + THICK) * arc, RADIUS * arc[::-1]])
    turn = 2.0 * np.pi * np.arange(AROUND + 1) / AROUND
    turn[-1] = 0.0  # closed to the last bit
    r, y = profile[:, :1], profile[:, 1:] + RADIUS + THICK
    x = np.stack([r * np.cos(turn), y + 0.0 * turn, r * np.sin(turn)], axis=2)
    a, b, c, d = x[:-1, :-1], x[:-1, 1:], x[1:, 1:], x[1:, :-1]
    sides = np.concatenate([np.stack([a, c, b], axis=2), np.stack([a, d, c], axis=2)])
    triangles = sides.reshape(-1, 3, 3)
    area = np.linalg.norm(
        np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1
    )
    return triangles[area > 1e-9]


def write_stl(file: Path, triangles: np.ndarray) -> None:
    """Write triangles as binary STL."""
    rows = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("x", "<f4", (3, 3)), ("", "<u2")])
    rows["x"] = triangles
    head = np.uint32(len(triangles)).tobytes()
    file.write_bytes(b"bowl".ljust(80) + head + rows.tobytes())


if __name__ == "__main__":
    write_stl(Path(__file__).with_name("bowl.stl"), bowl())
