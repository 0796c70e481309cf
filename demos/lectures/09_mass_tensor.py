"""Mass-tensor systems are linear finite elements: f_i = −Σ_j K_ij u_j, a 3x3 tensor an edge.

K_ij is summed once over the tets that share the edge, V (λ g_i⊗g_j + μ g_j⊗g_i + μ g_i·g_j I), g_i
the gradient of node i's hat function.  A substep then visits edges instead of tets.
"""

import numpy as np
import page

import tisoft as ts

MESH, MATERIAL = ts.box(size=(1, 0.5, 0.5), cells=(4, 2, 2)), (1e5, 0.3, 1000.0)


def tensors() -> np.ndarray:
    """K in NumPy, shape (nodes, nodes, 3, 3)."""
    lam, mu = ts.Linear(*MATERIAL).lame_lambda, ts.Linear(*MATERIAL).lame_mu
    whole = np.zeros((len(MESH.points), len(MESH.points), 3, 3))
    for tet in MESH.tets:
        corners = np.column_stack([np.ones(4), MESH.points[tet]])
        g, volume = np.linalg.inv(corners)[1:].T, np.linalg.det(corners) / 6
        outer = np.einsum("ia,jb->ijab", g, g)
        along = np.einsum("ij,ab->ijab", g @ g.T, np.eye(3))
        local = lam * outer + mu * outer.transpose(0, 1, 3, 2) + mu * along
        whole[np.ix_(tet, tet)] += volume * local
    return whole


def forces(model: type, u: np.ndarray) -> np.ndarray:
    scene = ts.Scene(gravity=(0, 0, 0), precision="f64")
    scene.add_body(MESH, model(*MATERIAL))
    sim = ts.Simulation(scene)
    sim.set_state(MESH.points + u, 0 * u)
    return sim.forces()


page.begin(__doc__)
K = tensors()
u = 0.01 * np.random.default_rng(2).standard_normal(MESH.points.shape)
theory = -np.einsum("ijab,jb->ia", K, u)
for name, model in (("mass-tensor", ts.MassTensor), ("linear tets", ts.Linear)):
    found = forces(model, u)
    off = abs(found - theory).max() / abs(theory).max()
    page.check(f"x-force on node 7, {name} [N]", theory[7, 0], found[7, 0], within=1e-12)
    page.check("  largest difference over all nodes, relative", 0, off, within=1e-12)
kept = (abs(K).max(axis=(2, 3)) > 0).sum()
page.check("tensors: one a node, two an edge", 45 + 2 * len(MESH.edges), kept, within=0)
(axis,) = page.axes(xlabel="node j", ylabel="node i", title="where K_ij is not zero")
axis.spy(abs(K).max(axis=(2, 3)), markersize=3)
page.save(__file__, axis)
