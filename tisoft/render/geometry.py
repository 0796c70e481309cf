# mypy: ignore-errors
"""Points and normals of a picture, gathered from the simulation's arrays.

Pictures are computed in units of the camera's distance, about its target:  q = (p - target)/D.
The difference is formed in f64, so a scene far from the origin, or of any size, loses no digits.
"""

import taichi as ti

vec3 = ti.types.vector(3, ti.f32)
mat34 = ti.types.matrix(3, 4, ti.f32)
vec3d = ti.types.vector(3, ti.f64)

Scalars = ti.types.ndarray(dtype=ti.f32, ndim=1)
Vectors = ti.types.ndarray(dtype=ti.f32, ndim=2)
Integers = ti.types.ndarray(dtype=ti.i32, ndim=1)
Triples = ti.types.ndarray(dtype=ti.i32, ndim=2)
Keys = ti.types.ndarray(dtype=ti.i64, ndim=1)

NEAR = 1e-3  # nearest depth drawn, in distances from the eye to the target

# The frustum: unit forward, and right and up as long as the tangents of the half opening angles;
# width and height in samples, `per_pixel` of them along a pixel's side. The ray through the sample
# place (x, y) is corner + x across + y down, one unit long along forward.
View = ti.types.struct(
    eye=vec3,
    right=vec3,
    up=vec3,
    forward=vec3,
    corner=vec3,
    across=vec3,
    down=vec3,
    width=ti.i32,
    height=ti.i32,
    per_pixel=ti.i32,
)


@ti.func
def vector(array: ti.template(), i):
    return vec3(array[i, 0], array[i, 1], array[i, 2])


@ti.func
def row(m: ti.template(), k: ti.template(), p):
    """Coordinate k of the affine map m at p."""
    return m[k, 0] * p[0] + m[k, 1] * p[1] + m[k, 2] * p[2] + m[k, 3]


@ti.func
def safe_unit(v):
    length = v.norm()
    u = vec3(0.0, 0.0, 0.0)
    if length > 0.0:
        u = v / length
    return u


@ti.func
def ray(view: ti.template(), x, y):
    """Direction through a point of the picture (in samples); one unit long along forward."""
    return view.corner + x * view.across + y * view.down


@ti.func
def to_samples(view: ti.template(), q):
    """Homogeneous place in the picture, f64: (x w, y w, w) with x and y in samples, w the depth."""
    v = ti.cast(q - view.eye, ti.f64)
    right, up = ti.cast(view.right, ti.f64), ti.cast(view.up, ti.f64)
    w = v.dot(ti.cast(view.forward, ti.f64))
    x = (v.dot(right) / right.norm_sqr() + w) * 0.5 * view.width
    y = (w - v.dot(up) / up.norm_sqr()) * 0.5 * view.height
    return vec3d(x, y, w)


@ti.kernel
def place(
    positions: ti.types.ndarray(ndim=2),
    nodes: Integers,
    first: ti.i32,
    target: vec3d,
    distance: ti.f64,
    points: Vectors,
):
    """points[first + i] = (positions[nodes[i]] - target)/distance."""
    for i in range(nodes.shape[0]):
        for k in ti.static(range(3)):
            p = ti.cast(positions[nodes[i], k], ti.f64)
            points[first + i, k] = ti.cast((p - target[k]) / distance, ti.f32)


@ti.kernel
def vertex_normals(
    points: Vectors, triangles: Triples, starts: Integers, corners: Integers, normals: Vectors
):
    """Angle-weighted normals (Thürmer and Wüthrich 1998), each vertex gathering its corners."""
    for i in range(normals.shape[0]):
        n = vec3(0.0, 0.0, 0.0)
        for j in range(starts[i], starts[i + 1]):
            t, k = corners[j] // 3, corners[j] % 3
            p = vector(points, triangles[t, k])
            a = vector(points, triangles[t, (k + 1) % 3]) - p
            b = vector(points, triangles[t, (k + 2) % 3]) - p
            n += ti.atan2(a.cross(b).norm(), a.dot(b)) * safe_unit(a.cross(b))
        n = safe_unit(n)
        for k in ti.static(range(3)):
            normals[i, k] = n[k]
