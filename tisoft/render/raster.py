# mypy: ignore-errors
"""What every sample of the picture sees: an i64 key (1/depth, primitive), the largest one wins.

Triangles are rasterised in homogeneous coordinates (Olano and Greer 1997): with the corners
p_i = (x w, y w, w), the edge functions e_i = p_j × p_k give e_i·(x, y, 1) ≥ 0 inside and
Σ e_i·(x, y, 1) = det/w, also for a triangle that reaches behind the eye, so nothing is clipped.
In f64 an edge shared by two triangles leaves no gap. The maximum does not depend on the order of
the triangles, so the picture does not depend on the number of threads.
"""

import taichi as ti

from tisoft.render.geometry import (
    NEAR,
    Keys,
    Scalars,
    Triples,
    Vectors,
    View,
    ray,
    to_samples,
    vec3d,
    vector,
)

vec4i = ti.types.vector(4, ti.i32)


@ti.func
def edge_functions(p0, p1, p2):
    """e_0, e_1, e_2, turned so that they are positive inside, and |det|."""
    e0, e1, e2 = p1.cross(p2), p2.cross(p0), p0.cross(p1)
    det = p0.dot(e0)
    if det < 0.0:
        e0, e1, e2, det = -e0, -e1, -e2, -det
    return e0, e1, e2, det


@ti.func
def bounds(p0, p1, p2, width, height):
    """Samples x0, y0, x1, y1 (exclusive) to visit: all of them when a corner is not in front."""
    box = vec4i(0, 0, width, height)
    if ti.min(p0[2], p1[2], p2[2]) > NEAR:
        x0, x1, x2 = p0[0] / p0[2], p1[0] / p1[2], p2[0] / p2[2]
        y0, y1, y2 = p0[1] / p0[2], p1[1] / p1[2], p2[1] / p2[2]
        box = clamped(
            ti.min(x0, x1, x2), ti.min(y0, y1, y2), ti.max(x0, x1, x2), ti.max(y0, y1, y2),
            width, height,
        )  # fmt: skip
    elif ti.max(p0[2], p1[2], p2[2]) <= NEAR:
        box = vec4i(0, 0, 0, 0)
    return box


@ti.func
def clamped(x0, y0, x1, y1, width, height):
    """Whole samples whose centres may lie in a rectangle, within the picture."""
    return vec4i(
        ti.cast(ti.min(ti.max(ti.floor(x0 - 0.5), 0.0), width), ti.i32),
        ti.cast(ti.min(ti.max(ti.floor(y0 - 0.5), 0.0), height), ti.i32),
        ti.cast(ti.min(ti.max(ti.ceil(x1 + 0.5), 0.0), width), ti.i32),
        ti.cast(ti.min(ti.max(ti.ceil(y1 + 0.5), 0.0), height), ti.i32),
    )


@ti.func
def claim(keys: ti.template(), sample, inverse_depth, primitive):
    bits = ti.cast(ti.bit_cast(ti.cast(inverse_depth, ti.f32), ti.i32), ti.i64)
    ti.atomic_max(keys[sample], (bits << 32) | ti.cast(primitive, ti.i64))


@ti.kernel
def see_triangles(points: Vectors, triangles: Triples, count: ti.i32, view: View, keys: Keys):
    ti.loop_config(block_dim=64)
    for t in range(count):
        p0 = to_samples(view, vector(points, triangles[t, 0]))
        p1 = to_samples(view, vector(points, triangles[t, 1]))
        p2 = to_samples(view, vector(points, triangles[t, 2]))
        e0, e1, e2, det = edge_functions(p0, p1, p2)
        box = vec4i(0, 0, 0, 0)
        if det > 0.0:  # false for a triangle seen edge-on, and for one that is not finite
            box = bounds(p0, p1, p2, view.width, view.height)
        slope = (e0 + e1 + e2) / det
        for y in range(box[1], box[3]):
            sy = ti.cast(y, ti.f64) + 0.5
            for x in range(box[0], box[2]):
                s = vec3d(ti.cast(x, ti.f64) + 0.5, sy, 1.0)
                if e0.dot(s) >= 0.0 and e1.dot(s) >= 0.0 and e2.dot(s) >= 0.0:
                    inverse_depth = slope.dot(s)
                    if 0.0 < inverse_depth < 1.0 / NEAR:
                        claim(keys, y * view.width + x, inverse_depth, t)


@ti.func
def capsule_hit(eye, d, a, b, r):
    """Depth along the ray eye + t d of its first point on a capsule, and whether it is hit.

    Rays that pass by get the depth of their closest approach, which shading wants at silhouettes.
    """
    dd = d.norm_sqr()
    near = (0.5 * (a + b) - eye).dot(d) / dd  # start near the capsule: keeps the digits
    o = eye + near * d
    ab, oa, ob = b - a, o - a, o - b
    length, along, reach = ab.norm_sqr(), ab.dot(d), ab.dot(oa)
    qa = length * dd - along * along
    qb = length * d.dot(oa) - reach * along
    qc = length * oa.norm_sqr() - reach * reach - r * r * length
    root = qb * qb - qa * qc
    t = 0.0
    if qa > 0.0:
        t = (-qb - ti.sqrt(ti.max(root, 0.0))) / qa
    u = reach + t * along
    if not 0.0 < u < length:
        oc = oa
        if u >= length:
            oc = ob
        root = oc.dot(d) ** 2 - dd * (oc.norm_sqr() - r * r)
        t = (-oc.dot(d) - ti.sqrt(ti.max(root, 0.0))) / dd
    return near + t, root >= 0.0


@ti.func
def ball_span(x, w, r):
    """Least and greatest x/w of a ball about (x, w), all in front of the eye."""
    root = ti.sqrt(ti.max(x * x + w * w - r * r, 0.0))
    return (x * w - r * root) / (w * w - r * r), (x * w + r * root) / (w * w - r * r)


@ti.func
def ball_bounds(view: ti.template(), q, r):
    """Rectangle x0, y0, x1, y1 in samples around a ball; x0 > x1 when it is not in front."""
    v = q - view.eye
    w = v.dot(view.forward)
    box = ti.Vector([1.0, 0.0, 0.0, 0.0])
    if w > r + NEAR:
        x0, x1 = ball_span(v.dot(view.right.normalized()), w, r)
        y0, y1 = ball_span(v.dot(view.up.normalized()), w, r)
        half_w, half_h = 0.5 * view.width, 0.5 * view.height
        box[0] = (x0 / view.right.norm() + 1.0) * half_w
        box[1] = (1.0 - y1 / view.up.norm()) * half_h
        box[2] = (x1 / view.right.norm() + 1.0) * half_w
        box[3] = (1.0 - y0 / view.up.norm()) * half_h
    return box


@ti.func
def slab(y, ba, bb):
    """Interval of x in row y within reach of the line between two boxes' centres."""
    dx = 0.5 * (bb[0] + bb[2] - ba[0] - ba[2])
    dy = 0.5 * (bb[1] + bb[3] - ba[1] - ba[3])
    reach = 0.75 * ti.max(ba[2] - ba[0], ba[3] - ba[1], bb[2] - bb[0], bb[3] - bb[1]) + 1.0
    lo, hi = -1e9, 1e9
    if ti.abs(dy) > reach:
        middle = 0.5 * (ba[0] + ba[2]) + (y - 0.5 * (ba[1] + ba[3])) * dx / dy
        half = reach * ti.sqrt(dx * dx + dy * dy) / ti.abs(dy)
        lo, hi = middle - half, middle + half
    return lo, hi


@ti.kernel
def see_capsules(
    points: Vectors,
    first_end: ti.i32,
    radii: Scalars,
    count: ti.i32,
    first: ti.i32,
    view: View,
    keys: Keys,
):
    """Capsule i has its ends at points first_end + 2i and + 2i + 1; it is primitive first + i."""
    ti.loop_config(block_dim=64)
    for i in range(count):
        a, b = vector(points, first_end + 2 * i), vector(points, first_end + 2 * i + 1)
        r = radii[i]
        ba, bb = ball_bounds(view, a, r), ball_bounds(view, b, r)
        box = vec4i(0, 0, 0, 0)
        if ba[0] <= ba[2] and bb[0] <= bb[2]:
            box = clamped(
                ti.min(ba[0], bb[0]), ti.min(ba[1], bb[1]),
                ti.max(ba[2], bb[2]), ti.max(ba[3], bb[3]),
                view.width, view.height,
            )  # fmt: skip
        for y in range(box[1], box[3]):
            sy = ti.cast(y, ti.f32) + 0.5
            lo, hi = slab(sy, ba, bb)
            x0 = ti.max(box[0], ti.cast(ti.max(lo, 0.0), ti.i32))
            x1 = ti.min(box[2], ti.cast(ti.min(hi + 1.0, view.width), ti.i32))
            for x in range(x0, x1):
                d = ray(view, ti.cast(x, ti.f32) + 0.5, sy)
                depth, hit = capsule_hit(view.eye, d, a, b, r)
                if hit and depth > NEAR:
                    claim(keys, y * view.width + x, 1.0 / depth, first + i)
