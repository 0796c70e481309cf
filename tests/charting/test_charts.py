"""Charts: the predicted error of a scene against the true one, and what is told of it."""

import xml.etree.ElementTree as ElementTree
from itertools import combinations

import numpy as np
import pytest
from matplotlib.figure import Figure
from sheets import sheet

import tisoft as ts
from tisoft import cli
from tisoft.charting import advice, estimate
from tisoft.charting.advice import advise
from tisoft.charting.carried import carried
from tisoft.charting.carriers import carrier
from tisoft.charting.chart import Chart
from tisoft.charting.curves import FREE, HELD, range_of
from tisoft.charting.estimate import Error, Ruler
from tisoft.charting.judged import Judged, with_pareto
from tisoft.charting.linearly import is_near, linear_ruler
from tisoft.charting.page import page
from tisoft.charting.picture import files
from tisoft.charting.places import Place
from tisoft.charting.records import Bench, linear_static_of, modes_of, static_of
from tisoft.charting.rulers import Pair, agreed, ratios_of_family, ruler_of, ruler_of_family
from tisoft.charting.ruling import Ruling
from tisoft.charting.survey import Survey
from tisoft.charting.thumbnails import picture
from tisoft.charting.variants import Catalogue, Variant
from tisoft.equilibrium.statics import equilibrium
from tisoft.errors import SceneError
from tisoft.geometry.shapes import box
from tisoft.geometry.solid import quadratic
from tisoft.scene_file import load_scene

BEAM = """
gravity = [0, 0, -9.81]
[[body]]
name = "beam"
young = 1.0e6
poisson = 0.3
density = 1000.0
[body.mesh]
box = { size = [1, 0.2, 0.2], cells = [10, 2, 2] }
[[body.pin]]
where = { box = [[-1e-6, -1, -1], [1e-6, 1, 1]] }
[[probe]]
name = "tip"
body = "beam"
point = [1.0, 0.1, 0.1]
"""
QUADRATIC = 'body.0.mesh.element="tet10"'
SAG = np.array([-0.0697, 0.0, -0.3457])
FREQUENCIES = np.array([0.9995, 0.9995, 4.5176])
"""Of the continuum (27-node hexahedra, extrapolated): m, Hz."""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "beam.toml"
    path.write_text(BEAM)
    return path


@pytest.mark.parametrize("kind", ["tet4", "tet10", "hex8"])
def test_a_point_is_carried_by_the_shape_functions_of_its_cell(kind):
    mesh = box((1.0, 0.5, 0.4), (2, 1, 1), split="hex" if kind == "hex8" else "five")
    mesh = quadratic(mesh) if kind == "tet10" else mesh

    def field(x):  # in the space of each element
        quadratic_part = x[..., 0] ** 2 if kind == "tet10" else x[..., 0] * (kind == "hex8")
        return 1.0 + x @ np.array([0.3, -0.7, 0.2]) + quadratic_part

    for point in np.random.default_rng(0).uniform(0.0, [1.0, 0.5, 0.4], (20, 3)):
        nodes, weights = carrier(mesh, point)
        assert weights @ field(mesh.points[nodes]) == pytest.approx(field(point), abs=1e-12)


def test_predicted_errors_are_those_of_the_continuum_within_their_bars(scene):
    """33 % of sag and 20 % of frequencies with linear tets; quadratic ones lie below the bar."""
    survey = Survey(scene, 1e6)
    survey.judging.static = True
    make = survey.catalogue.mesh
    linear, better = survey.catalogue.current, make("tet10", 1.0)
    for what, truth in (("sag", [SAG]), ("frequency", FREQUENCIES)):
        worse, fine = (survey.asking.quantity(v, what, 1.0, exact=True) for v in (linear, better))
        pair = Pair(linear, better, estimate.SAME_MESH[0])
        survey.judging.rulers = {what: ruler_of(what, [worse, fine], pair)}
        exact = estimate.Ruler(np.asarray(truth), 0.0)
        measure = estimate.frequency_error if what == "frequency" else error_of
        predicted, true = (
            measure(survey.asking.quantity(linear, what, 1.0), ruler)
            for ruler in (survey.judging.rulers[what], exact)
        )
        assert 0.9 < predicted.value / true.value < 1.1
        assert abs(predicted.value - true.value) < predicted.bar
        assert measure(fine, exact).value < measure(fine, survey.judging.rulers[what]).most


def test_hexahedra_are_judged_by_linear_elasticity_where_their_kernels_would_take_too_long(scene):
    linear = load_scene(scene, ['body.0.model="linear"'])
    tip = [Place("tip", 0, (1.0, 0.1, 0.1))]
    balanced, solved = static_of(linear, tip)[0], linear_static_of(linear, tip)
    assert solved["places"][0] == pytest.approx(balanced["places"][0], rel=1e-6, abs=1e-12)
    assert solved["energy"] == pytest.approx(balanced["energy"], rel=1e-6)
    hexes = linear_static_of(load_scene(scene, ['body.0.mesh.box.split="hex"']), tip)
    assert 0.92 < hexes["places"][0][2] / -0.3767 < 1.0  # the continuum's, linear

    truth = estimate.Ruler(np.array([1.0]), 0.01)
    judge = linear_ruler(truth, Error(0.3, 0.01), [0.6])  # e = .3 where e_lin = .4
    assert judge.error([0.8]).value == pytest.approx(0.75 * 0.2)
    unsure = 0.01 / 0.3 + 0.006 / 0.4  # of the two errors, of which the share is
    assert judge.error([0.8]).bar == pytest.approx(0.008 + (0.25 + 0.75 * unsure) * 0.2)
    assert is_near([0.6], [0.5]) and not is_near([0.6], [0.3])  # of bodies that are turned
    assert linear_ruler(truth, Error(0.1, 0.01), [0.6]) is None  # linear elasticity tells nothing


def test_an_answer_is_found_next_to_that_of_a_coarser_mesh(scene):
    """In half as many linear systems, and the same one, also where what it lies near is wrong."""
    heavy = "gravity=[0, 0, -25.0]"
    (_, moved), fine = (
        static_of(load_scene(scene, [heavy]), []),
        load_scene(scene, [heavy, QUADRATIC]),
    )
    near = carried(*moved[0], fine.bodies[0].mesh.points)
    sought = equilibrium(fine)
    for guess, systems in ((near, sought.iterations // 2), (-near, 10**6)):
        found = equilibrium(fine, near=guess)
        assert found.positions == pytest.approx(sought.positions, abs=1e-9)
        assert found.iterations <= systems


def test_a_rough_guess_of_a_nearly_incompressible_body_is_no_reason_to_begin_at_rest(scene):
    """A bar at ν = .49 turned by 70°: next to linear tets cells of quadratic ones are pressed until
    they are unstable, and their answer is a few systems away all the same."""
    turn = "turn = { point = [0, 0.1, 0.1], axis = [1, 0, 0], rate = 1.2 }\n"
    end = "[[body.pin]]\nwhere = { box = [[0.999, -1, -1], [1.001, 1, 1]] }\n"
    scene.write_text(BEAM.replace("[[probe]]", end + turn + "[[probe]]").replace("0.3", "0.49"))
    (_, moved), fine = static_of(load_scene(scene), []), load_scene(scene, [QUADRATIC])
    sought = equilibrium(fine)
    found = equilibrium(fine, near=carried(*moved[0], fine.bodies[0].mesh.points))
    assert found.positions == pytest.approx(sought.positions, abs=1e-9)
    assert found.iterations <= sought.iterations // 2


@pytest.mark.parametrize("flat", [1.0, 0.0])
def test_displacements_are_carried_from_node_to_node(flat):
    """Those of second order to rounding, in space and in a plane; and nodes keep their own."""
    rng = np.random.default_rng(4)
    points, to = (rng.uniform(-1.0, 1.0, (n, 3)) * [1.0, 1.0, flat] for n in (300, 40))

    def field(x):
        return np.stack([x[:, 0] * x[:, 1], x[:, 2] ** 2 - x[:, 0], 1.0 + x[:, 1] ** 2], axis=1)

    assert carried(points, field(points), to) == pytest.approx(field(to), abs=1e-6)
    jumps = rng.normal(size=(300, 3))
    assert carried(points, jumps, points[:9]) == pytest.approx(jumps[:9], abs=0.02)


def test_meshes_of_a_ball_are_compared_as_curved_where_pins_hold_the_same():
    def ball(resolution, poisson, low=None):
        scene = ts.Scene()
        body = scene.add_body(ts.ball(0.1, resolution), ts.ViscoElastic(1e5, poisson, 1e3))
        if low is not None:
            body.pin(ts.where.box((-1, -1, -1), (1, low, 1)))
        return scene

    assert range_of(ball(2, 0.3), ball(4, 0.3), [0]) == FREE
    assert range_of(ball(2, 0.3, 1e-6), ball(4, 0.3, 1e-6), [0]) == HELD
    assert range_of(ball(2, 0.3, -0.03), ball(4, 0.3, 0.03), [0]) is None  # other places
    assert range_of(ball(2, 0.48), ball(4, 0.48), [0]) is None  # nearly incompressible


def test_a_third_mesh_tells_how_far_two_can_be_trusted():
    """Errors of order 1.8 leave the truth well within a bar half as wide as two meshes give."""
    truth, off = np.array([1.0, 2.0]), np.array([0.05, -0.1])
    meshes = [truth + off * h**1.8 for h in (4.0, 2.0, 1.0)]
    three, two = (
        estimate.ruler_of_three(meshes), estimate.ruler(*meshes[1:], estimate.TWO_MESHES[0])
    )  # fmt: skip
    assert three.error(truth).value < 0.3 * three.bar and three.bar < 0.5 * two.bar
    jumping = [meshes[0], 2.0 * truth - meshes[1], meshes[2]]  # from side to side
    assert estimate.ruler_of_three(jumping).bar > two.bar
    odd = estimate.ruler(truth + off * 1.5**1.8, truth + off, estimate.TWO_MESHES[0], 1.5)
    assert odd.error(truth).value < odd.bar


def test_three_meshes_tell_the_same_whatever_the_ratios_of_their_cells():
    truth, off = np.array([1.0, 2.0]), np.array([0.05, -0.1])
    for before, ratio in ((1.5, 2.0), (2.0, 1.5), (2.0, 2.0)):
        sizes = (before * ratio, ratio, 1.0)
        coarse, middle, fine = (off * h**1.8 for h in sizes)
        r = float((middle - coarse) @ (fine - middle) / ((middle - coarse) @ (middle - coarse)))
        assert estimate.halved(r, before, ratio) == pytest.approx(2.0**-1.8, rel=1e-6)
        three = estimate.ruler_of_three([truth + off * h**1.8 for h in sizes], ratio, before)
        assert three.error(truth).value < 0.3 * three.bar


def test_four_meshes_tell_far_more_sharply_than_two_where_they_converge():
    """A bar turned by 90°: its energy is 107.83 J (27-node hexahedra).  Answers that jump, or that
    meshes of another shape give, are no such ruler."""
    energies, ratios = [112.4146, 109.1988, 108.4011, 107.9790], [3.0, 2.0, 1.5, 1.0]
    found = estimate.ruler_of_many(energies, ratios)
    two = estimate.ruler(energies[1], energies[3], estimate.TWO_MESHES[0])
    assert found.error(107.83).value < found.bar < 0.3 * two.bar
    assert estimate.ruler_of_many([112.4, 109.2, 110.4, 108.0], ratios) is None
    modes = [[5.0 + 0.1 * h**2, 9.0 + 0.2 * h**2, 9.5 + 0.1 * h**3] for h in ratios]
    assert ruler_of_family("frequency", modes, ratios).value == pytest.approx([5.0, 9.0, 9.5])


def test_cells_of_one_family_are_the_finest_ones_but_for_their_size(scene):
    bar = Survey(scene, 1e6).catalogue  # cells of 0.75 are 8 x 2 x 2, where 7.5 x 1.5 were asked
    assert list(ratios_of_family(bar, [0.5, 0.75, 1.0, 1.5, 2.0])) == [0.5, 1.0, 1.5, 2.0]
    assert list(ratios_of_family(bar, [0.5, 1.0, 1.5, 3.0])) == [1.0, 1.5, 3.0]  # too coarse


def test_coarse_meshes_that_swing_tell_nothing_of_nearly_incompressible_bodies():
    """The corner of a block at ν = .49 on 3 x 2 x 2 cells, and on twice and four times as many: it
    lies at (10.23, -10.18, .03) mm, by hexahedra and tets of three meshes extrapolated."""
    answers = np.array([[9.899, -10.601, 0.828], [9.820, -9.665, 0.167], [9.998, -9.896, 0.089]])
    truth, two = np.array([10.23, -10.18, 0.03]), estimate.TWO_MESHES[1]
    found = estimate.ruler_of_three(answers, two=two)
    assert found.error(truth).value < found.bar
    assert found.bar == estimate.ruler(*answers[1:], two).bar


def test_nearly_incompressible_bodies_have_a_ruler_whose_bar_holds_the_truth(scene):
    """A block of 6 x 4 x 4 cells, ν = .49: its modes are known within .3 %."""
    block = [
        "body.0.young=2e4", "body.0.poisson=0.49", "body.0.mesh.box.size=[0.3, 0.2, 0.2]",
        "body.0.mesh.box.cells=[6, 4, 4]",
        "body.0.pin.0.where={ box = [[-1, -1, -1], [1, 1e-6, 1]] }", "probe=[]",
    ]  # fmt: skip
    survey = Survey(scene, 1e6, block)
    pair = survey.ruling.pairs()[0]
    answers = [
        survey.asking.quantity(v, "frequency", 1.0, exact=True) for v in (pair.worse, pair.better)
    ]
    found = ruler_of("frequency", answers, pair)
    off = estimate.frequency_error([2.4166, 2.7023, 2.9272], found)
    assert off.value < found.bar + 0.003 and found.bar < 0.05


def test_frequencies_of_finer_quadratic_tets_err_by_no_more_than_foretold(scene):
    survey = Survey(scene, 1e6)
    truth = estimate.Ruler(FREQUENCIES, 0.001)
    coarse, fine = survey.catalogue.mesh("tet10", 1.0), survey.catalogue.mesh("tet10", 1.5)
    survey.asking.variants.append(coarse)
    own, its = (survey.asking.quantity(v, "frequency", 1.0) for v in (coarse, fine))
    steps = [survey.asking.ask("step", v) for v in (coarse, fine)]
    assert 1.3 < steps[0]["stable_step"] / steps[1]["stable_step"] < 1.7
    told, known = (estimate.frequency_error(value, truth) for value in (own, its))
    foretold = survey.judging.foretold(fine, truth)
    assert known.value < foretold.most < told.most


def test_paths_err_in_proportion_to_what_their_variants_err_by(scene):
    """Three runs whose paths lag by c: the best tells what it errs by, and what a fourth would."""
    survey = Survey(scene, 1e6)
    judging, variants = survey.judging, list(survey.catalogue.meshes())[:4]
    survey.asking.variants[:] = variants
    coarse = dict(zip(variants, (0.1, 0.2, 0.4, 0.8), strict=True))
    judging.travel.coarseness = coarse.__getitem__
    swing = np.sin(np.linspace(0.0, 6.0, 40))[:, None, None] * np.ones(3)
    for variant in variants[:3]:
        path = {"path": ((1.0 - coarse[variant]) * swing).tolist()}
        survey.asking.bench.record(variant)["path"] = path
    errors = [judging.travel.error(v, {}) for v in variants]
    first, _, third, last = (e.value for e in errors)
    assert errors[0].bar == first and first == pytest.approx(0.5 * (third - first), rel=0.6)
    assert last == pytest.approx(8.0 * first) and errors[3].bar > 0.0


def test_nets_that_stand_for_themselves_vary_by_their_step_alone(tmp_path):
    path = tmp_path / "net.toml"
    sheet = """
    [[body]]
    model = "mass-spring"
    [body.mesh]
    cloth = { size = [1, 1], cells = [4, 4] }
    [[body.pin]]
    where = { nodes = [0] }
    """
    path.write_text(sheet)
    given = ["body.0.stiffness=10.0", "body.0.node_mass=0.01"]
    woven = ["body.0.young=1e5", "body.0.density=500.0", "body.0.thickness=0.002"]
    held = "body.0.pin.0.where={box=[[-1, -1, -1], [0, 1, 2]]}"
    for settings, alone in ((given, True), (woven, True), ([*woven, held], False)):
        catalogue = Catalogue(str(path), load_scene(path, settings), settings)
        assert catalogue.is_itself is alone and bool(list(catalogue.meshes())) is not alone
    assert len(list(catalogue.steps(1e-3))) == 4


def test_nets_swing_about_the_answer_that_is_known_already(tmp_path):
    path = tmp_path / "net.toml"
    path.write_text(sheet(8, hangs=True))
    bench, now = Bench(str(path), [], {}), Variant("as it is", ())
    anew = modes_of(load_scene(path), [])
    assert bench.ask("static", now)["energy"] > 0.0
    known = bench.ask("modes", now)
    assert anew["about"] == known["about"] == "equilibrium"
    assert known["frequencies"] == pytest.approx(anew["frequencies"], rel=1e-6)


def test_modes_of_nets_are_foretold_and_asked_after_their_equilibrium(tmp_path):
    path = tmp_path / "net.toml"
    path.write_text(sheet(8, hangs=True))
    survey = Survey(path, 0.3, patient=True)
    asking, fine = survey.asking, survey.catalogue.mesh("spring", 4.0)
    assert asking.needs("modes", fine) > 3.0 * asking.patience.needs(
        "modes", *asking._kind("modes", fine)
    )
    assert asking.ask("modes", fine, 1.0) is None
    assert not asking.has("static", fine) and not asking.has("modes", fine)
    asking.budget = 1e6
    assert asking.ask("modes", asking.variants[0])["about"] == "equilibrium"
    assert asking.has("static", asking.variants[0])


def test_what_time_did_not_suffice_for_is_not_tried_again_within_as_much(scene, monkeypatch):
    asking, given = Survey(scene, 1e6, patient=True).asking, []
    own = asking.bench.ask

    def late(what, variant, seconds=np.inf):
        if what == "size":
            return own(what, variant)
        given.append(seconds)
        return {"error": "no time", "seconds": seconds, "worked": seconds}

    monkeypatch.setattr(asking.bench, "ask", late)
    now = asking.variants[0]
    for _ in range(3):
        assert asking.ask("static", now) is None
        assert asking.needs("static", now) >= 2.0 * given[-1]
    assert given[2] > 2.0 * given[1] > 4.0 * given[0] > 0.0


def error_of(value, ruler):
    return ruler.error(value)


def test_the_prediction_of_a_path_matches_the_measured_drop():
    """10x2x2 linear tets err by −30 % and +20 %: after a tenth of a period little, later much."""
    early = estimate.path_error(Error(0.3, 0.0), Error(0.2, 0.0), 1.0, 0.1)
    late = estimate.path_error(Error(0.3, 0.0), Error(0.2, 0.0), 1.0, 2.0)
    assert early.value < 0.05 < 0.5 < late.value < 1.5


def judged(name, cost, error, bar=0.01, **more):
    errors = {"sag": Error(error, bar), "path": Error(2.0 * error, bar)}
    return Judged(name, (f"x={name}",), "viscoelastic", "tet4", 1, 4, 1e-3, 2e-3, cost, errors,
                  **more)  # fmt: skip


@pytest.fixture
def chart():
    return Chart(
        with_pareto(
            [judged("as it is", 1.0, 0.3, current=True), judged("good", 0.1, 0.05),
             judged("worse", 0.2, 0.4), judged("best", 3.0, 0.004)]
        )
    )  # fmt: skip


def test_a_chart_says_what_its_numbers_say(chart):
    assert [v.name for v in chart.pareto] == ["good", "best"]
    assert chart.least(0.07).name == "good"
    assert chart.least(0.055).name == "best"  # the bar counts
    assert chart.least(0.01) is None
    first, second = chart.sentences()
    assert "30 % (± 1 %)" in first and "1/10 with good" in second
    result = chart.result()
    assert result["current"] == "as it is" and result["best"]["0.1"] == "good"


def test_what_a_bar_hides_only_may_be_too_coarse():
    for error, word in (
        (Error(0.043, 0.041), "may be too coarse"),
        (Error(0.08, 0.04), "too coarse"),
    ):
        one = Judged("a", (), "linear", "hex8", 1, 8, 1.0, 1.0, 1.0, {"sag": error})
        assert advice._coarse(one, 0.03) == word


def test_picture_and_page_are_whole_and_hold_every_variant(chart):
    png, svg = files(chart)
    assert png[:4] == b"\x89PNG"
    ElementTree.fromstring(svg)
    text = page(chart, svg, "beam <1>")
    assert "beam &lt;1&gt;" in text
    for k, v in enumerate(chart.variants):
        assert f'id="variant-{k}"' in text and f"x={v.name}" in text


def test_names_on_a_chart_cover_neither_points_nor_one_another():
    crowd = [judged(f"variant {k}", 1.0 + 0.02 * k, 0.3 - 0.004 * k) for k in range(10)]
    crowded = Chart(with_pareto([judged("as it is", 1.0, 0.3, current=True), *crowd]))
    axes = Figure(figsize=(8, 5)).subplots()
    crowded.plot(axes)
    names = [t for t in axes.texts if t.get_visible() and t.get_text()]
    boxes = [t.get_window_extent() for t in names]
    assert len(names) > 2 and names[0].get_text() == "your scene"
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
    points = axes.transData.transform([(v.cost, v.shown) for v in crowded.variants])
    assert not any(box.contains(*point) for box in boxes for point in points)


@pytest.mark.parametrize(
    "tolerance, told", [(1e-6, "below what f32 keeps"), (0.0, "relative error"), (2.0, "relative")]
)
def test_a_tolerance_that_nothing_keeps_is_refused(scene, tolerance, told):
    with pytest.raises(SceneError, match=told):
        advise(scene, tolerance)


@pytest.mark.parametrize(
    "budget, told", [("0", "is 0;"), ("inf", "is inf;"), ("1e-9", "e-10 s for them")]
)
def test_a_budget_is_asked_for(scene, tmp_path, capsys, budget, told):
    assert cli.main(["chart", str(scene), "--budget", budget, "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert "--budget" in error and told in error and error.count("\n") == 1


def test_why_there_is_no_ruler_is_told_by_its_own_sentence(scene, monkeypatch):
    """Of quadratic tets that cannot be had: no budget makes up for that."""
    survey = Survey(scene, 1e6)
    own = survey.asking.bench.ask

    def refused(what, variant, seconds=np.inf):
        if what == "size" and "tet10" in variant.name:
            return {"error": "the skin lies elsewhere"}
        return own(what, variant, seconds)

    monkeypatch.setattr(survey.asking.bench, "ask", refused)
    with pytest.raises(SceneError, match="quadratic tets are to judge it, but the skin lies"):
        survey.measure(others=False)


def test_a_picture_of_a_variant_knows_gravity_in_rows():
    drawn = []
    for gravity in ((0.0, -9.81, 0.0), [(0.0, 0.0, -9.81, 0.0), (1.0, 0.0, -9.81, 0.0)]):
        scene = ts.Scene(gravity=gravity)
        scene.add_body(ts.box((1, 0.2, 0.2), (2, 1, 1)), ts.Linear(1e6, 0.3, 1000.0))
        drawn.append(picture(scene, None))
    assert drawn[0] == drawn[1] and drawn[0].startswith("data:image/png")


def test_rulers_that_contradict_each_other_are_as_uncertain_as_they_differ():
    old, close, far = (
        Ruler(np.array([v]), bar) for v, bar in ((1.0, 0.01), (1.01, 0.02), (2.0, 0.1))
    )
    assert agreed(old, close) is old and agreed(close, old) is old
    assert agreed(old, far).value == 2.0 and agreed(old, far).bar == pytest.approx(0.5)


def test_an_early_interrupt_keeps_and_tells_what_is_known(scene, tmp_path, capsys, monkeypatch):
    def stopped(self, tolerance):
        raise KeyboardInterrupt

    monkeypatch.setattr(Ruling, "find", stopped)
    out = tmp_path / "out"
    assert cli.main(["chart", str(scene), "-o", str(out)]) == 130
    told = capsys.readouterr()
    assert "frequencies at 1." in told.out and "goes on from there" in told.err
    assert (out / "chart.csv").read_text().count("\n") == 2
    assert cli.main(["advise", str(scene), "-o", str(tmp_path / "good.toml")]) == 130
    assert "frequencies at 1." in capsys.readouterr().out
    assert not (tmp_path / "good.toml").exists()
