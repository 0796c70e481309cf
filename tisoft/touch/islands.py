# mypy: ignore-errors
"""Islands: rows of a substep that share points, directly or by others, and so must be solved
together; what shares none is another island, and may be another thread's.

    root of p:  p = root[p], else that of root[p]          (a forest: Galler and Fischer 1964)

Islands are counted, and their rows stand in `queue`, in the order of the rows: with any number of
threads the same.
"""

import taichi as ti

from tisoft.touch import fields as f


@ti.func
def find_root(touch: ti.template(), p):
    """Root of point p; paths are halved on the way."""
    while touch.root[p] != p:
        touch.root[p] = touch.root[touch.root[p]]
        p = touch.root[p]
    return p


@ti.func
def unite(touch: ti.template(), row):
    """Let the points of a row have one root, and return that: the least of theirs."""
    root = -1
    for k in range(4):
        p = touch.corner[row, k]
        if touch.met[p]:
            other = find_root(touch, p)
            if root < 0:
                root = other
            least, most = ti.min(root, other), ti.max(root, other)
            touch.root[most] = least
            root = least
    return root


@ti.func
def find_islands(touch: ti.template(), q, threads):
    """Sort the rows that `threads` threads have found by islands."""
    thread, base = touch.order[q, f.THREAD], touch.order[q, f.PAIR]
    for kind in range(2):
        for t in range(thread, thread + threads):
            first = touch.segment[t, 2 * kind]
            for row in range(first, first + touch.segment[t, f.FACES_NEAR + kind]):
                touch.island[row] = unite(touch, row)
    count = 0
    for kind in range(2):
        for t in range(thread, thread + threads):
            first = touch.segment[t, 2 * kind]
            for row in range(first, first + touch.segment[t, f.FACES_NEAR + kind]):
                root = find_root(touch, touch.island[row])
                if touch.number_of[root] < 0:
                    touch.number_of[root] = count
                    touch.island_end[base + count] = 0
                    count += 1
                number = base + touch.number_of[root]
                touch.island[row] = number
                touch.island_end[number] = touch.island_end[number] + 1
    end = base
    for number in range(base, base + count):
        begin = end
        end += touch.island_end[number]
        touch.island_end[number] = begin
    for kind in range(2):
        for t in range(thread, thread + threads):
            first = touch.segment[t, 2 * kind]
            for row in range(first, first + touch.segment[t, f.FACES_NEAR + kind]):
                number = touch.island[row]
                touch.queue[touch.island_end[number]] = row
                touch.island_end[number] = touch.island_end[number] + 1
    touch.order[q, f.ISLANDS] = count
