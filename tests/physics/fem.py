"""Linear finite elements in plain NumPy, written apart from tisoft: K and M by the B-matrix."""

import numpy as np
import scipy.linalg


def gradients(points, tets):
    """∇N of the four corners [1/m] (tets, 4, 3) and volumes [m³]: the inverse of [1 X]."""
    ones = np.concatenate([np.ones((*tets.shape, 1)), points[tets]], axis=2)
    return np.linalg.inv(ones)[:, 1:, :].transpose(0, 2, 1), np.linalg.det(ones) / 6.0


def lame(young, poisson):
    return young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)


def stiffness(points, tets, lam, mu):
    """K, dense, (3 nodes, 3 nodes), from strains in Voigt's order xx yy zz xy yz zx."""
    g, volume = gradients(points, tets)
    law = np.diag([2 * mu] * 3 + [mu] * 3)
    law[:3, :3] += lam
    n = 3 * len(points)
    K = np.zeros((n, n))
    for tet, (corners, size) in enumerate(zip(tets, volume, strict=True)):
        B = np.zeros((6, 12))
        for a in range(4):
            x, y, z = g[tet, a]
            B[:, 3 * a : 3 * a + 3] = [
                [x, 0, 0], [0, y, 0], [0, 0, z], [y, x, 0], [0, z, y], [z, 0, x],
            ]  # fmt: skip
        rows = (3 * corners[:, None] + np.arange(3)).ravel()
        K[np.ix_(rows, rows)] += size * B.T @ law @ B
    return K


def mass(points, tets, density, *, consistent=False):
    """M, dense, (3 nodes, 3 nodes)."""
    _, volume = gradients(points, tets)
    M = np.zeros((len(points), len(points)))
    for corners, size in zip(tets, density * volume, strict=True):
        part = np.ones((4, 4)) + np.eye(4) if consistent else 5.0 * np.eye(4)
        M[np.ix_(corners, corners)] += size / 20.0 * part
    return np.kron(M, np.eye(3))


def modes(K, M, free, *, count=6):
    """The lowest frequencies [Hz] and shapes (count, nodes, 3); `free` is a mask (nodes, 3)."""
    rows = np.flatnonzero(np.asarray(free).ravel())
    last = len(rows) - 1
    values, vectors = scipy.linalg.eigh(
        K[np.ix_(rows, rows)], M[np.ix_(rows, rows)], subset_by_index=[0, min(count - 1, last)]
    )
    shapes = np.zeros((len(values), len(K)))
    shapes[:, rows] = vectors.T
    return np.sqrt(np.maximum(values, 0)) / (2 * np.pi), shapes.reshape(len(values), -1, 3)


def largest_frequency(K, M, free):
    """ω_max [rad/s]."""
    rows = np.flatnonzero(np.asarray(free).ravel())
    last = len(rows) - 1
    value = scipy.linalg.eigh(
        K[np.ix_(rows, rows)],
        M[np.ix_(rows, rows)],
        subset_by_index=[last, last],
        eigvals_only=True,
    )
    return float(np.sqrt(value[0]))


def mode_of_motion(q, h):
    """ω [rad/s] and ζ of a mode from its amplitude at successive substeps of symplectic Euler.

    q_{n+1} − (2 − 2ζωh − ω²h²) q_n + (1 − 2ζωh) q_{n−1} = 0 (A7), solved for the two numbers.
    """
    q = np.asarray(q)
    rows = np.stack([q[1:-1], -q[:-2]], axis=1)
    (trace, det), *_ = np.linalg.lstsq(rows, q[2:], rcond=None)
    omega = np.sqrt(1.0 - trace + det) / h
    return omega, (1.0 - det) / (2.0 * omega * h)
