"""Advice, and model = "auto": what is chosen, how it is told, and that a run keeps it."""

import json
import tomllib

import numpy as np
import pytest
from sheets import sheet

from tisoft import cli
from tisoft.charting import advice, runs, written
from tisoft.charting.costs import Kind, Timing, predicted
from tisoft.charting.doubting import doubts
from tisoft.charting.estimate import Ruler
from tisoft.charting.paths import Paths
from tisoft.charting.patience import Patience
from tisoft.charting.records import Bench, step_of
from tisoft.charting.runs import timing_of
from tisoft.charting.steps import step_error
from tisoft.charting.survey import Survey
from tisoft.charting.variants import Variant
from tisoft.errors import SceneError
from tisoft.scene_file import load_scene
from tisoft.simulation import Simulation

BAR = """
gravity = [0, 0, -1.0]
duration = 0.05
[[body]]
name = "bar"
model = "auto"
tolerance = 0.9
young = 1.0e6
poisson = 0.3
density = 1000.0
[body.mesh]
box = { size = [1, 0.2, 0.2], cells = [4, 1, 1] }
[[body.pin]]
where = { box = [[-1e-6, -1, -1], [1e-6, 1, 1]] }
[[probe]]
name = "end"
body = "bar"
point = [1.0, 0.2, 0.2]
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "bar.toml"
    path.write_text(BAR)
    return path


def test_a_body_that_chooses_for_itself_is_refused_where_nobody_chooses(scene):
    with pytest.raises(SceneError, match=r"body\[0\].model = \"auto\" is settled by commands"):
        load_scene(scene)
    with pytest.raises(SceneError, match="tolerance"):
        load_scene(scene, ['body.0.model="linear"', "body.0.tolerance=2"])


def test_advice_does_not_write_over_the_scene_that_it_is_about(scene, capsys):
    assert cli.main(["advise", str(scene), "-o", str(scene)]) == 2
    assert "is the scene itself; name another file" in capsys.readouterr().err
    assert scene.read_text() == BAR


def test_a_run_chooses_tells_and_keeps_what_it_chose(scene, capsys, monkeypatch):
    monkeypatch.setattr(advice, "SECONDS", 2.0)  # of looking for something still better
    assert cli.main(["run", str(scene), "--json"]) == 0
    out, err = capsys.readouterr()
    result = json.loads(out)
    advised = result["advised"]
    assert advised["predicted_error"] + advised["bar"] <= 0.9
    assert advised["current"]["predicted_error"] > 0.3  # one cell through the thickness
    assert 'model = "auto"' in err and advised["reasons"][0] in err
    # Its probe is where it was: coarser or finer meshes without that node stay out.
    end = result["probes"]["end"]
    rest = [p - u for p, u in zip(end["position"], end["displacement"], strict=True)]
    assert rest == pytest.approx([1.0, 0.2, 0.2], abs=1e-6)


def test_a_scene_that_is_written_with_changes_is_the_scene_with_them(scene, tmp_path):
    folder = tmp_path / "else"
    folder.mkdir()
    changes = ['body.0.model="linear"', "body.0.mesh.box.cells=[2, 1, 1]", "gravity=[0, 0, 0.5]"]
    document = written.moved_document(scene, changes, folder / "new.toml")
    text = written.as_toml(document)
    assert tomllib.loads(text) == document
    (folder / "new.toml").write_text(text)
    (body,) = load_scene(folder / "new.toml").bodies
    assert len(body.mesh.tets) == 10 and len(body.pins) == 1
    moved = {"body": [{"mesh": {"file": "a/b.vtu"}}]}
    written._rename(moved, tmp_path, folder)
    assert moved["body"][0]["mesh"]["file"] == "../a/b.vtu"


def test_the_step_is_known_before_anything_runs(scene):
    plain = load_scene(scene, ['body.0.model="viscoelastic"', "body.0.damping_ratio=0.05"])
    told = step_of(plain, [])
    sim = Simulation(plain, threads=1)
    substeps, step = sim.substeps_of(1.0 / plain.frame_rate)
    assert told == {
        "step": pytest.approx(step, rel=1e-3), "substeps": substeps,
        "stable_step": pytest.approx(sim.limit.sharp(), rel=1e-6),
    }  # fmt: skip


def test_the_steps_own_error_is_that_of_theory():
    """Frequencies of symplectic Euler and Verlet are off by (ωh)²/24; the former's path by ωh/2."""
    omega, h = np.array([2.0 * np.pi]), 0.01
    late = step_error("velocity-verlet", omega, h, 10.0)
    shift = (omega[0] * h) ** 2 / 24.0 * omega[0] * 10.0  # phase after ten seconds
    assert late == pytest.approx(shift / np.sqrt(6.0), rel=0.02)  # rms of t sin ωt
    wobble = step_error("symplectic-euler", omega, h, 1.0)
    assert wobble == pytest.approx(omega[0] * h / 2.0 / np.sqrt(2.0), rel=0.1)
    assert step_error("explicit-euler", omega, h, 10.0) > 1.5  # it grows by e^(ω²h t/2)


def test_costs_are_predicted_from_what_is_most_alike():
    """Twice the elements at twice the substeps: four times as dear, less what frames take."""

    def kind(element, elements, substeps, frame_rate=1.0):
        names = (element, "viscoelastic", "f32", "symplectic-euler")
        return Kind(*names, elements, substeps, frame_rate)

    tets, twice = kind("tet4", 1000, 6000.0), kind("tet4", 2000, 12000.0)
    hexes = kind("hex8", 1000, 6000.0)
    cost = predicted(tets, [])
    own = (tets, Timing(1.5 * cost))
    assert predicted(twice, [own]) == pytest.approx(6.0 * cost, rel=0.05)
    # A hexahedron that is as slow tells the same, and most of it where nothing else is timed.
    slow = (hexes, Timing(1.5 * predicted(hexes, [])))
    assert predicted(twice, [own, slow]) == pytest.approx(6.0 * cost, rel=0.05)
    assert 1.3 * cost < predicted(tets, [slow]) < 1.5 * cost
    watched = [predicted(kind("tet4", n, 6.0 * n, 60.0), []) for n in (1000, 2000)]
    assert 2.5 < watched[1] / watched[0] < 3.99


def test_what_a_scene_takes_besides_and_stiffens_by_is_foretold_of_its_other_variants():
    """Frames of .4 ms, whatever the mesh; and limits that fall, those of quadratic tets thrice as
    far, of springs not at all."""

    def kind(element, elements, substeps):
        model = "mass-spring" if element == "spring" else "viscoelastic"
        return Kind(element, model, "f32", "symplectic-euler", elements, substeps, 60.0)

    tets = kind("tet4", 200, 780.0)
    frame = tets.looks() + 4e-4
    for growth in (1.0, 1.2):
        timing = Timing(1.0, tets.substep(), frame, growth)
        for other, times in (("tet4", 1.0), ("tet10", 3.0), ("spring", 0.0)):
            fine = kind(other, 400, 1000.0)
            substeps = 1000.0 * (1.0 + times * (growth - 1.0)) * fine.substep()
            expected = substeps + 60.0 * (fine.looks() + 4e-4)
            assert predicted(fine, [(tets, timing)]) == pytest.approx(expected, rel=0.06)


def test_a_cost_is_timed_of_the_scenes_duration_and_no_more(tmp_path, monkeypatch):
    """A bar that is turned on and on would be wrung out: its substeps are those of its second."""
    path = tmp_path / "turned.toml"
    turn = "turn = { point = [0, 0.1, 0.1], axis = [1, 0, 0], rate = 3.0 }\n"
    end = "[[body.pin]]\nwhere = { box = [[0.999, -1, -1], [1.001, 1, 1]] }\n"
    text = BAR.replace('model = "auto"\ntolerance = 0.9\n', "").replace(
        "[[probe]]", end + turn + "[[probe]]"
    )
    path.write_text(text.replace("0.05", "0.5"))
    scene = load_scene(path, ["body.0.damping_ratio=0.05"])  # whose kernels are compiled already
    monkeypatch.setattr(runs, "TIMED", 0.03)
    timing = timing_of(scene, [])
    sim = Simulation(scene)
    sim.run()
    at_rest = step_of(scene, [])["substeps"] * scene.frame_rate * scene.duration
    assert timing["growth"] == pytest.approx(sim.substeps / at_rest, rel=1e-6)
    assert timing["growth"] < 2.0


def test_paths_that_part_are_noticed():
    bench = Bench.__new__(Bench)
    bench.kept, bench._mark, bench.places = {}, b"", []
    one, other = Variant("a", ("a=1",)), Variant("b", ("b=1",))
    swing = [[[0.0, 0.0, (-1.0) ** k]] for k in range(20)]
    bench.record(one)["path"] = {"path": swing}
    bench.record(other)["path"] = {"path": [*swing[:10], *[[[0.0, 0.0, 3.0]]] * 10]}
    paths = Paths(bench)
    assert paths.parting(other, one, 10.0) == 1.0
    assert paths.error(one, one) == 0.0 and paths.error(other, one) > 1.0


def test_patience_learns_how_slow_the_machine_is():
    patience, size = Patience(), {"nodes": 2000, "front": 1e7}
    kind = ("tet4", "viscoelastic")
    before = patience.needs("static", kind, size)
    for _ in range(3):
        patience.took("static", kind, size, 4.0 * before)
    assert patience.needs("static", kind, size) == pytest.approx(4.0 * before, rel=0.01)


def test_a_sheet_that_falls_and_touches_itself_is_told_to_be_charted_before_anything_runs(tmp_path):
    path = tmp_path / "sheet.toml"
    path.write_text(sheet(4))
    survey = advice.survey_for(path, 0.02)
    advice.measure(survey, 0.02)
    found = advice.advice_of(survey, 0.02)
    assert not found.certain and found.choice.current and advice.NO_RUNS in found.warnings
    assert not any({"timing", "path"} & record.keys() for record in survey.kept.values())


def test_what_contact_may_decide_is_not_certain(scene):
    path = scene.parent / "on_the_floor.toml"
    path.write_text(BAR + "[[obstacle]]\nplane = { point = [0, 0, -1], normal = [0, 0, 1] }\n")
    survey = Survey(path, 1e6, ['body.0.model="viscoelastic"'])
    survey.judging.rulers["frequency"] = Ruler(np.ones(3), 0.0)
    assert any("contact may decide" in doubt for doubt in doubts(survey))
