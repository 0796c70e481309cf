"""A cube of 0.1 m in 5 tets and a brick beside it, as the texts of mesh files."""

import numpy as np

from tisoft.geometry.shapes import box

CUBE = box((0.1, 0.1, 0.1), (1, 1, 1))
BRICK = box((0.2, 0.1, 0.1), (1, 1, 1), split="six")


def inp_nodes(points, first=1):
    return "".join(f"{k}, {x}, {y}, {z}\n" for k, (x, y, z) in enumerate(points, first))


def inp_tets(tets, first=1, number=1):
    rows = [", ".join(str(n + first) for n in row) for row in tets]
    return "".join(f"{k}, {row}\n" for k, row in enumerate(rows, number))


def inp_part(name, mesh):
    nodes, tets = inp_nodes(mesh.points), inp_tets(mesh.tets)
    return f"*Part, name={name}\n*Node\n{nodes}*Element, type=C3D4\n{tets}*End Part\n"


def inp_assembly(*instances):
    placed = [
        f"*Instance, name={name}, part={part}\n{rows}*End Instance\n"
        for name, part, rows in instances
    ]
    return "*Assembly, name=A\n" + "".join(placed) + "*End Assembly\n"


def second_order(mesh):
    """Points and 10-node tets, shape (tets, 10), with the middles of edges."""
    pairs = mesh.tets[:, [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]]]
    ends, numbers = np.unique(np.sort(pairs.reshape(-1, 2), axis=1), axis=0, return_inverse=True)
    points = np.concatenate([mesh.points, mesh.points[ends].mean(axis=1)])
    return points, np.column_stack([mesh.tets, numbers.reshape(-1, 6) + len(mesh.points)])


def tetgen(
    folder, name, points, tets, *, first=1, node_head="0 0", nodes="", ele_head="0", more=""
):
    """A pair of files; `nodes` and `more` follow each row."""
    rows = [f"{k + first} {x} {y} {z} {nodes}" for k, (x, y, z) in enumerate(points)]
    (folder / f"{name}.node").write_text("\n".join([f"{len(points)} 3 {node_head}", *rows]) + "\n")
    rows = [f"{k + first} {' '.join(map(str, row + first))} {more}" for k, row in enumerate(tets)]
    head = f"{len(tets)} {tets.shape[1]} {ele_head}"
    (folder / f"{name}.ele").write_text("\n".join([head, *rows]) + "\n")
    return folder / f"{name}.ele"
