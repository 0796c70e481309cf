# mypy: ignore-errors
"""Types of the kernels' arrays, and the projection and the normals of all vertices."""

import taichi as ti

from tisoft.render.layout import NORMAL, PLACE, SCREEN, TO_W, TO_X, TO_Y

vec2 = ti.types.vector(2, ti.f32)
vec3 = ti.types.vector(3, ti.f32)
vec4 = ti.types.vector(4, ti.f32)
vec3d = ti.types.vector(3, ti.f64)

Rows = ti.types.ndarray(dtype=vec4, ndim=1)  # `stage`
Vertices = ti.types.ndarray(dtype=vec3, ndim=2)  # rows of layout.py
Primitives = ti.types.ndarray(dtype=ti.types.vector(4, ti.i32), ndim=1)
"""Triangles (a, b, c, item) of vertices, then capsules (a, b, -1, item)."""
Tables = ti.types.ndarray(dtype=ti.f32, ndim=2)  # rows of layout.py
Integers = ti.types.ndarray(dtype=ti.i32, ndim=1)
Keys = ti.types.ndarray(dtype=ti.i64, ndim=1)


@ti.func
def affine(a, p):
    return a[0] * p[0] + a[1] * p[1] + a[2] * p[2] + a[3]


@ti.func
def on(row, x, y):
    """A row of the picture at a place of it."""
    return row[0] * x + row[1] * y + row[2]


@ti.func
def head(a):
    return vec3(a[0], a[1], a[2])


@ti.func
def safe_unit(v):
    length = v.norm()
    u = vec3(0.0, 0.0, 0.0)
    if length > 0.0:
        u = v / length
    return u


@ti.kernel
def look(
    vertices: Vertices, stage: Rows, primitives: Primitives, starts: Integers, corners: Integers
):
    """Places in the picture of all vertices, and normals of those of surfaces.

    Each vertex gathers its corners, weighted by sine/(|a| |b|): exact on spheres (Max 1999).
    """
    for i in range(vertices.shape[1]):
        p = vertices[PLACE, i]
        inverse = 1.0 / affine(stage[TO_W], p)
        x, y = affine(stage[TO_X], p), affine(stage[TO_Y], p)
        vertices[SCREEN, i] = vec3(x * inverse, y * inverse, inverse)
    for i in range(starts.shape[0] - 1):
        n = vec3(0.0, 0.0, 0.0)
        p = vertices[PLACE, i]
        for j in range(starts[i], starts[i + 1]):
            t, k = corners[j] // 3, corners[j] % 3
            abc = primitives[t]
            one, two = abc[1], abc[2]
            if k == 1:
                one, two = abc[2], abc[0]
            elif k == 2:
                one, two = abc[0], abc[1]
            a, b = vertices[PLACE, one] - p, vertices[PLACE, two] - p
            n += a.cross(b) / ti.max(a.norm_sqr() * b.norm_sqr(), 1e-30)
        vertices[NORMAL, i] = safe_unit(n)
