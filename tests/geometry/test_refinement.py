"""Tets cut into eight fill what they filled, and keep what their file calls by name."""

import numpy as np
import pytest

from tisoft.geometry.groups import NodeSet, Region
from tisoft.geometry.mesh import TetMesh
from tisoft.geometry.refinement import refined
from tisoft.geometry.shapes import box


def test_refined_tets_join_and_fill_the_body():
    coarse = box((1.0, 0.5, 0.4), (2, 1, 1))
    left = np.flatnonzero(coarse.points[:, 0] == 0.0).astype(np.int32)
    faces = coarse.surface[np.isin(coarse.surface, left).all(axis=1)]
    named = TetMesh(
        coarse.points, coarse.tets, coarse.kept_nodes,
        regions=(Region("half", 1, np.arange(5, dtype=np.int32)),),
        sets=(NodeSet("clamp", 2, left, faces),),
    )  # fmt: skip
    fine = refined(named, 2)
    assert len(fine.tets) == 64 * len(coarse.tets)
    assert fine.volumes.min() > 0.0
    assert fine.volumes.sum() == pytest.approx(0.2)
    assert len(fine.surface) == 16 * len(coarse.surface)
    np.testing.assert_array_equal(fine.points[: len(coarse.points)], coarse.points)
    region, clamp = fine.regions[0], fine.sets[0]
    assert fine.volumes[region.tets].sum() == pytest.approx(named.volumes[:5].sum())
    np.testing.assert_array_equal(clamp.nodes, np.flatnonzero(fine.points[:, 0] == 0.0))
    assert len(clamp.faces) == 16 * len(faces)
    assert (fine.points[clamp.faces][..., 0] == 0.0).all()
