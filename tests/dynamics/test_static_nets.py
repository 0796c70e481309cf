"""Chains, trusses and cloth at rest under their loads."""

import numpy as np
import pytest
from static_cases import string

import tisoft as ts
from tisoft import where
from tisoft.equilibrium.statics import equilibrium


def test_chain_hangs_longer_towards_its_top():
    """REFERENCES S3."""
    points = np.zeros((11, 3))
    points[:, 1] = -0.1 * np.arange(11)
    found = equilibrium(string(points, 100.0, 0.01, [0]))
    stretches = -np.diff(found.positions[:, 1]) - 0.1
    assert stretches == pytest.approx(0.00981 - 0.000981 * np.arange(10), abs=1e-12)
    assert stretches.sum() == pytest.approx(0.053955, abs=1e-12)
    assert found.reactions[0] == pytest.approx([0, 0.01 * 10 * 9.81 + 0.01 * 9.81, 0], abs=1e-9)


def test_flat_pair_of_springs_sinks_to_a_v():
    """REFERENCES S4: no stiffness at all against its load at rest."""
    found = equilibrium(string([[-1, 0, 0], [0, 0, 0], [1, 0, 0]], 200.0, 2.0, [0, 2]))
    assert found.positions[1] == pytest.approx([0, -0.4865936028, 0], abs=1e-10)


@pytest.mark.parametrize(
    ("links", "axial", "sag"),
    [(10, 1e5, 0.2668974), (20, 1e5, 0.2658244), (40, 1e5, 0.2655587), (20, 1e3, 0.2690408)],
)
@pytest.mark.parametrize("slack", [0.0, 0.3])
def test_slack_chain_hangs_in_a_catenary(links, axial, sag, slack):
    """REFERENCES S7, from a straight line of springs too long for it, and from a slack arc."""
    t = np.linspace(0, 1, links + 1)
    points = np.stack([0.8 * t, -slack * np.sin(np.pi * t), 0 * t], axis=1)
    scene = string(points, links * axial, 1 / links, [0, links], length=1 / links)
    assert equilibrium(scene).positions[:, 1].min() == pytest.approx(-sag, abs=5e-8)


def test_very_stiff_chain_hangs_in_the_polygon_of_its_links():
    """Links that do not stretch: REFERENCES S7's catenary from below, and no load on the way."""
    t = np.linspace(0, 1, 21)
    points = np.stack([0.8 * t, 0 * t, 0 * t], axis=1)
    found = equilibrium(string(points, 20 * 1e8, 1 / 20, [0, 20], length=1 / 20))
    links = np.linalg.norm(np.diff(found.positions, axis=0), axis=1)
    assert links == pytest.approx(np.full(20, 0.05), rel=1e-6)
    slopes = np.diff(found.positions[:, 1]) / np.diff(found.positions[:, 0])
    assert np.diff(slopes) == pytest.approx(np.full(19, np.diff(slopes)[0]), rel=1e-6)


LIMIT = 2 * 1000 * (np.hypot(1, 0.3) ** (2 / 3) - 1) ** 1.5


def truss(load):
    """Von Mises truss (REFERENCES S5): height of its top under a dead load [N]."""
    scene = string([[-1, 0, 0], [0, 0.3, 0], [1, 0, 0]], 1000.0, 1.0, [0, 2], gravity=(0, 0, 0))
    forces = np.zeros((3, 3))
    forces[1, 1] = -load
    return equilibrium(scene, external=forces).positions[1, 1]


def test_truss_bears_half_its_limit():
    assert LIMIT == pytest.approx(9.9499170, abs=1e-7)
    assert truss(0.5 * LIMIT) == pytest.approx(0.2641108, abs=1e-7)
    assert truss(0.9999 * LIMIT) == pytest.approx(0.1707116, abs=2e-3)


@pytest.mark.parametrize("beyond", [1.001, 1.5, 10.0, 100.0])
def test_truss_does_not_snap_through_unsaid(beyond):
    """Newton's method alone would answer with the state on the other side."""
    with pytest.raises(ts.NoEquilibrium) as caught:
        truss(beyond * LIMIT)
    assert beyond * caught.value.load_factor == pytest.approx(1.0, rel=2e-3)


@pytest.mark.parametrize("corners", [[(0, 0, 0), (1, 0, 0)], [(0, 0, 0), (1, 0, 0), (1, 0, 1)]])
def test_cloth_held_at_corners_hangs(corners):
    mesh = ts.cloth((1, 1), (8, 8))
    scene = ts.Scene()
    body = scene.add_body(mesh, ts.MassSpring(stiffness=500.0, density=200.0, thickness=0.001))
    for corner in corners:
        body.pin(where.nearest(corner))
    found = equilibrium(scene)
    assert found.residual < 1e-8 * 9.81 * 0.2 / 81
    assert found.positions[:, 1].min() < -0.4
    assert found.reactions[:, 1].sum() == pytest.approx(9.81 * 0.2, rel=1e-8)
