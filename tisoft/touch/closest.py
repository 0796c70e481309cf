# mypy: ignore-errors
"""Nearest points of triangles and edges (Ericson 2005, 5.1.5 and 5.1.9), as Taichi functions.

triangle abc:  x = w_a a + w_b b + w_c c,  Σ w = 1, w ≥ 0
lines ab, cd:  (a + s (b − a)) − (c + t (d − c))  normal to both
"""

import taichi as ti

PARALLEL = 1e-4
"""Square of the sine below which two edges count as parallel: nodes and faces see to those."""


@ti.func
def on_triangle(p, a, b, c):
    """Weights of the point of triangle abc nearest to p."""
    ab, ac, ap, bp, cp = b - a, c - a, p - a, p - b, p - c
    d1, d2 = ab.dot(ap), ac.dot(ap)
    d3, d4 = ab.dot(bp), ac.dot(bp)
    d5, d6 = ab.dot(cp), ac.dot(cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    wa, wb, wc = 0.0 * d1, 0.0 * d1, 0.0 * d1
    if d1 <= 0 and d2 <= 0:
        wa = 0.0 * d1 + 1.0
    elif d3 >= 0 and d4 <= d3:
        wb = 0.0 * d1 + 1.0
    elif d6 >= 0 and d5 <= d6:
        wc = 0.0 * d1 + 1.0
    elif vc <= 0 and d1 >= 0 and d3 <= 0:
        wb = d1 / (d1 - d3)
        wa = 1.0 - wb
    elif vb <= 0 and d2 >= 0 and d6 <= 0:
        wc = d2 / (d2 - d6)
        wa = 1.0 - wc
    elif va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        wc = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        wb = 1.0 - wc
    else:
        share = 1.0 / (va + vb + vc)
        wb, wc = vb * share, vc * share
        wa = 1.0 - wb - wc
    return ti.Vector([wa, wb, wc])


@ti.func
def from_triangle(p, a, b, c):
    """Square of the distance [m²] of p from triangle abc: from its plane where p is above it, else
    from the nearest edge; without branches, which lists of many would often guess wrong, and
    divided by nothing of p, so that the quotients are made once a triangle.
    """
    u, v, r = b - a, c - a, p - a
    uu, vv, uv, ru, rv, rr = u.dot(u), v.dot(v), u.dot(v), r.dot(u), r.dot(v), r.dot(r)
    along = rv - ru - uv + uu  # (p − b)·(c − b)
    first = from_line(rr, ru, uu)
    second = from_line(rr, rv, vv)
    third = from_line(rr - 2.0 * ru + uu, along, uu + vv - 2.0 * uv)
    square = ti.min(first, second, third)
    det, height = uu * vv - uv * uv, r.dot(u.cross(v))
    wb, wc = vv * ru - uv * rv, uu * rv - uv * ru
    above = (wb >= 0.0) & (wc >= 0.0) & (wb + wc <= det) & (det > 0.0)
    square = ti.select(above, height * height * (1.0 / ti.max(det, 1e-30)), square)
    return ti.max(square, 0.0 * square)


@ti.func
def from_line(square, along, long):
    """Square of the distance from a line of length² `long`, of a point at distance² `square` from
    its start and with product `along` with it.
    """
    t = clamped(along * (1.0 / ti.max(long, 1e-30)))
    return square - t * (2.0 * along - t * long)


@ti.func
def between_lines(u, v, r):
    """s and t of lines a + s u and c + t v nearest to each other, r = a − c; −1 where parallel."""
    uu, vv, uv, ur, vr = u.dot(u), v.dot(v), u.dot(v), u.dot(r), v.dot(r)
    det = uu * vv - uv * uv
    s, t = 0.0 * det - 1.0, 0.0 * det - 1.0
    if det > PARALLEL * uu * vv:
        s = (uv * vr - vv * ur) / det
        t = (uu * vr - uv * ur) / det
    return s, t


@ti.func
def clamped(value):
    """Into 0 .. 1."""
    return ti.min(ti.max(value, 0.0 * value), 0.0 * value + 1.0)


@ti.func
def along_edges(a, b, c, d):
    """s and t of the points a + s (b − a) and c + t (d − c) of two edges nearest to each other;
    without branches, which lists of many would often guess wrong.
    """
    u, v, r = b - a, d - c, a - c
    uu, vv, uv, ur, vr = u.dot(u), v.dot(v), u.dot(v), u.dot(r), v.dot(r)
    det = uu * vv - uv * uv
    s = clamped(ti.select(det > 0.0, (uv * vr - vv * ur) / det, 0.0 * det))
    t = clamped((uv * s + vr) / ti.max(vv, 1e-30))
    s = clamped((uv * t - ur) / ti.max(uu, 1e-30))
    return s, t


@ti.func
def between_edges(a, b, c, d):
    """Square of the distance [m²] of two edges, ends included."""
    s, t = along_edges(a, b, c, d)
    return (a + s * (b - a) - c - t * (d - c)).norm_sqr()


@ti.func
def nearest_on_line(p, q, a, b, c, blur):
    """The point of line pq nearest to triangle abc: where several are, up to `blur` [m], amid them.

    A line along a face has none of its own; picked at random, it would rock.
    """
    nearest = 0.0 * p
    least, total = 0.0 * blur + 1e30, 0.0 * blur
    for twice in range(2):
        for k in range(5):
            x = p if k == 0 else q
            d = 0.0 * blur
            if k < 2:
                w = on_triangle(x, a, b, c)
                d = (x - w[0] * a - w[1] * b - w[2] * c).norm()
            else:
                e, f = a, b
                if k == 3:
                    e, f = b, c
                if k == 4:
                    e, f = c, a
                s, t = along_edges(p, q, e, f)
                x = p + s * (q - p)
                d = (x - e - t * (f - e)).norm()
            if twice == 0:
                least = ti.min(least, d)
            else:
                weight = ti.max(least + blur - d, 0.0 * blur)
                nearest += weight * x
                total += weight
    return nearest / total
