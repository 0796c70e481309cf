"""VTU files of states hold what the simulation says, for readers other than ours."""

import meshio
import numpy as np
import pytest

import tisoft as ts
from tisoft.observers.quantities import node_values
from tisoft.observers.saved import SavedRun
from tisoft.observers.vtu import StateFiles
from tisoft.simulation import Simulation


def _sim(*, springs):
    scene = ts.Scene(frame_rate=50)
    mesh = ts.box(size=(1, 0.2, 0.2), cells=(5, 1, 1))
    beam = scene.add_body(mesh, ts.ViscoElastic(1e5, 0.3, 1000.0))
    beam.pin(ts.where.box((-1, -1, -1), (1e-6, 1, 1)))
    if springs:
        cloth = ts.cloth(size=(1, 1), cells=(2, 2)).transformed(translate=(0, 1, 0))
        scene.add_body(cloth, ts.MassSpring(stiffness=50.0, node_mass=0.01))
    sim = Simulation(scene, threads=1)
    for _ in range(5):
        sim.step()
    return sim, beam


def test_a_state_of_tets_is_read_back(tmp_path):
    sim, beam = _sim(springs=False)
    StateFiles(sim).write(tmp_path / "state.vtu")
    read = meshio.read(tmp_path / "state.vtu")
    assert read.points == pytest.approx(sim.positions())
    assert np.array_equal(read.cells_dict["tetra"], beam.mesh.tets)
    assert read.point_data["displacement"] == pytest.approx(sim.positions() - beam.mesh.points)
    assert read.point_data["velocity"] == pytest.approx(sim.velocities())
    assert read.point_data["reaction"].sum(axis=0)[1] > 0.0
    measured = sim.measures.elements(beam)
    cells = {name: blocks[0] for name, blocks in read.cell_data.items()}
    count = len(beam.mesh.tets)
    for name in ("strain", "second_piola", "cauchy"):
        expected = getattr(measured, name).reshape(count, 9)
        assert cells[name] == pytest.approx(expected, rel=1e-6)
    assert cells["von_mises"] == pytest.approx(measured.von_mises, rel=1e-6)
    assert cells["volume_ratio"] == pytest.approx(measured.volume_ratio, rel=1e-6)
    assert not cells["body"].any()


def test_tets_and_springs_share_a_file(tmp_path):
    sim, beam = _sim(springs=True)
    StateFiles(sim).write(tmp_path / "state.vtu")
    read = meshio.read(tmp_path / "state.vtu")
    cloth = sim.scene.bodies[1]
    start = len(beam.mesh.points)
    assert np.array_equal(read.cells_dict["line"], cloth.springs() + start)
    tension, strain = read.cell_data["tension"], read.cell_data["von_mises"]
    assert np.isnan(tension[0]).all()
    assert np.isnan(strain[1]).all()
    assert tension[1] == pytest.approx(sim.measures.elements(cloth).tension, rel=1e-6, abs=1e-9)
    assert [set(block) for block in read.cell_data["body"]] == [{0}, {1}]


def test_colours_of_a_saved_state_are_those_of_the_simulation(tmp_path):
    """Far from rest: tets of one node weigh as they do at rest; springs show their elongation."""
    sim, _ = _sim(springs=True)
    rest = np.concatenate([body.mesh.points for body in sim.scene.bodies])
    bent = rest[:, :1] * rest @ [[0.3, 0, 0.3], [0, 2.0, 0], [0.3, 0, 1.0]]  # not where it is held
    sim.set_state(rest + bent, np.zeros_like(rest))
    StateFiles(sim).write(tmp_path / "state.vtu")
    listed = '<V><DataSet timestep="0" file="state.vtu"/></V>'
    (tmp_path / "frames.pvd").write_text(listed, encoding="utf-8")
    (shown,) = SavedRun(tmp_path / "frames.pvd", "strain")
    assert shown.values == pytest.approx(node_values(sim, "strain"), rel=1e-5)


def test_a_folder_that_is_missing_is_named(tmp_path):
    sim, _ = _sim(springs=False)
    with pytest.raises(ts.SceneError, match="nowhere"):
        StateFiles(sim).write(tmp_path / "nowhere" / "state.vtu")
    assert not list(tmp_path.iterdir())
