"""0.4: every model for a second in f32 against f64."""

import numpy as np
import pytest
from beams import cantilever, rubber

import tisoft as ts

CASES = {
    "linear": (ts.Linear, {}),
    "linear, consistent": (ts.Linear, {"mass": "consistent"}),
    "mass-tensor": (ts.MassTensor, {}),
    "viscoelastic": (ts.ViscoElastic, {}),
    "viscous": (ts.ViscoElastic, {"phi": 50.0, "eta": 50.0}),
    "viscoelastic, consistent": (ts.ViscoElastic, {"mass": "consistent"}),
    "neo-hookean": (ts.NeoHookean, {}),
    "mass-spring": (ts.MassSpring, {}),
}


def _run(name, precision):
    kind, keys = CASES[name]
    if kind is ts.MassSpring:
        model = ts.MassSpring(young=1e6, density=1000.0, **keys)
    else:
        model = rubber(kind, **keys)
    sim = cantilever(model, h=5e-4, substeps=100, gravity=(0, 0, -9.81), precision=precision)
    return np.array([sim.step().positions() for _ in range(20)])


@pytest.mark.parametrize("name", CASES)
def test_a_second_of_swinging_in_f32(name):
    """1e-4 of the swing (0.4: f32 keeps identities to 1e-4)."""
    wide, narrow = _run(name, "f64"), _run(name, "f32")
    swing = np.abs(wide - wide[0]).max()
    assert swing > 0.1
    assert np.abs(narrow - wide).max() < 1e-4 * swing


@pytest.mark.parametrize("kind", [ts.ViscoElastic, ts.NeoHookean])
def test_turned_body_feels_little_in_f32(kind):
    """A pure turn leaves nodal forces of ~1e-6 E h² in f32 (0.4): 1e-2 N on the beam of A3."""
    from beams import displaced, rotation, simulate

    mesh = ts.box(size=(1.0, 0.2, 0.2), cells=(10, 2, 2))
    sim = simulate((mesh, rubber(kind)), precision="f32")
    middle = mesh.points.mean(axis=0)
    turned = (mesh.points - middle) @ rotation((1, 1, 0), 2.0).T + middle
    displaced(sim, turned - mesh.points)
    assert np.abs(sim.forces()).max() < 5e-2
