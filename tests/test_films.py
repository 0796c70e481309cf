"""Films: one run each, framed by all of it; cameras that turn and follow; saved runs."""

import errno
import json
import os
import tempfile

import numpy as np
import pytest
from PIL import Image

import tisoft as ts
from tisoft.cli import main
from tisoft.observers import track as tracks
from tisoft.observers.film import is_framed
from tisoft.observers.framing import Survey, View, round_up
from tisoft.observers.saved import SavedRun
from tisoft.observers.scenery import actors_of, followed_by
from tisoft.observers.track import Snapshot, Track
from tisoft.simulation import Simulation

SMALL = ["--set", "render.size=[160, 96]", "--set", "render.samples=1"]
FALL = """
duration = 0.2
frame_rate = 20
[[body]]
name = "block"
young = 1e5
poisson = 0.3
density = 1000
velocity = [3, 0, 0]
[body.mesh]
box = { size = [0.4, 0.2, 0.2], cells = [4, 2, 2] }
translate = [0, 0.3, 0]
[body.skin]
file = "skin.obj"
[[obstacle]]
plane = { point = [0, 0, 0], normal = [0, 1, 0] }
"""


@pytest.fixture
def fall(tmp_path):
    corners = [[x, y, z] for x in (0.05, 0.35) for y in (0.05, 0.15) for z in (0.05, 0.15)]
    faces = [[1, 2, 4, 3], [5, 7, 8, 6], [1, 5, 6, 2], [3, 4, 8, 7], [1, 3, 7, 5], [2, 6, 8, 4]]
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    lines += ["f " + " ".join(map(str, face)) for face in faces]
    (tmp_path / "skin.obj").write_text("\n".join(lines))
    (tmp_path / "fall.toml").write_text(FALL)
    return tmp_path / "fall.toml"


def place_in(camera, points, aspect):
    """Places in the picture, from -1 to 1 each way."""
    x, y, z = np.stack(camera.axes()) @ (points - np.array(camera.eye)).T
    tan = np.tan(np.radians(camera.fov) / 2)
    return np.stack([x / (z * tan * aspect), y / (z * tan)])


def test_a_film_steps_every_frame_once(fall, tmp_path, monkeypatch, capsys):
    steps = []
    make = Simulation.make_frame
    monkeypatch.setattr(
        Simulation, "make_frame", lambda sim, **asked: steps.append(1) or make(sim, **asked)
    )
    film = str(tmp_path / "film.gif")
    assert main(["render", str(fall), "-o", film, "--json", "--color", "speed", *SMALL]) == 0
    assert json.loads(capsys.readouterr().out)["pictures"] == 5
    assert len(steps) == 4


@pytest.mark.parametrize("most", [tracks.IN_MEMORY, 1])
def test_a_track_gives_back_what_it_was_given(most, monkeypatch):
    monkeypatch.setattr(tracks, "IN_MEMORY", most)  # 1 byte: all goes through the file
    rng = np.random.default_rng(0)
    given = [Snapshot(k / 10, 1e6 + rng.random((7, 3)), rng.random(7)) for k in range(5)]
    track = Track("speed")
    for snapshot in given:
        track.keep(snapshot)
    for _ in range(2):
        for one, other in zip(given, track, strict=True):
            assert other.time == one.time
            assert other.positions == pytest.approx(one.positions, abs=1e-6)
            assert other.values == pytest.approx(one.values, abs=1e-6)


def test_a_short_film_needs_no_room_on_the_disk_and_a_long_one_says_what_is_missing(monkeypatch):
    def full():
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(tempfile, "TemporaryFile", full)
    track = Track("body")
    for k in range(10):
        track.keep(Snapshot(k / 10, np.zeros((50_000, 3))))  # 6 MB in all
    assert len(list(track)) == 10
    monkeypatch.setattr(tracks, "IN_MEMORY", 6_000_000)
    with pytest.raises(ts.SceneError, match=r": No space left on device; make room there"):
        track.keep(Snapshot(1.0, np.zeros((50_000, 3))))


def test_all_motion_is_in_the_picture_and_fills_it(fall):
    scene = ts.load_scene(fall)
    track = Track("body")
    ts.Simulation(scene).run(observers=[track])
    view = View(scene, Survey.of(track))
    reach = 0.0
    for snapshot in track:
        place = place_in(view.at(snapshot), snapshot.positions, 1280 / 720)
        reach = max(reach, np.abs(place).max())
    assert 0.8 < reach < 0.9


def test_a_camera_that_follows_holds_its_body_in_place(fall):
    scene = ts.load_scene(fall, ['camera.follow="block"'])
    track = Track("body")
    ts.Simulation(scene).run(observers=[track])
    view = View(scene, Survey.of(track, followed_by(scene, actors_of(scene))))
    middles = [
        place_in(view.at(s), s.positions.mean(axis=0, keepdims=True), 16 / 9)[:, 0] for s in track
    ]
    assert np.ptp(middles, axis=0).max() < 1e-3


def test_a_camera_that_turns_keeps_its_height_and_distance_and_all_motion_in_view(fall):
    scene = ts.load_scene(fall, ["camera.turn=90", "duration=1"])
    snapshots = [Snapshot(t, ts.load_scene(fall).bodies[0].mesh.points) for t in (0.0, 0.5, 1.0)]
    view = View(scene, Survey.of(snapshots))
    first, second, third = (view.at(s) for s in snapshots)
    offsets = [np.subtract(c.eye, c.target) for c in (first, second, third)]
    assert offsets[0] @ offsets[2] - offsets[0][1] ** 2 == pytest.approx(0.0, abs=1e-9)
    assert [o[1] for o in offsets] == pytest.approx([offsets[0][1]] * 3)
    for snapshot in snapshots:
        assert np.abs(place_in(view.at(snapshot), snapshot.positions, 16 / 9)).max() < 0.9


def test_a_body_to_follow_that_is_not_there_is_told(fall):
    with pytest.raises(ts.SceneError, match=r'camera.follow = "blok" names no body'):
        ts.load_scene(fall, ['camera.follow="blok"'])


def test_only_a_film_that_depends_on_the_whole_waits_for_it(fall):
    given = ["camera.eye=[1, 1, 3]", "camera.target=[0, 0, 0]"]
    assert is_framed(ts.load_scene(fall, given))
    assert not is_framed(ts.load_scene(fall, given[:1]))
    assert not is_framed(ts.load_scene(fall, [*given, 'render.color="stress"']))


@pytest.mark.parametrize("height, told", [(240, True), (190, False)])
def test_the_width_of_a_tile_is_told_where_it_is_asked_for_and_has_room(
    fall, tmp_path, height, told
):
    look = ["--set", f"render.size=[320, {height}]", "--set", "render.samples=1"]
    shots = []
    for scale in ("false", "true"):
        out = tmp_path / f"{scale}.png"
        asked = ["--set", f"render.scale={scale}", "--set", "duration=0.01", "--quiet"]
        assert main(["render", str(fall), "-o", str(out), *look, *asked]) == 0
        shots.append(np.asarray(Image.open(out)).astype(int))
    rows, columns = np.nonzero(np.abs(shots[0] - shots[1]).max(axis=2) > 60)
    assert (len(rows) > 50) == told
    assert (rows > height - 40).all() and (columns < 240).all()


@pytest.mark.parametrize(
    "value, above", [(0.0, 0.0), (1.0, 1.0), (1.01, 1.5), (0.0213, 0.025), (8.4e7, 1e8)]
)
def test_a_colour_bar_ends_at_a_round_number(value, above):
    assert round_up(value) == pytest.approx(above)


@pytest.mark.parametrize("color", ["body", "stress", "strain", "speed"])
def test_a_saved_run_is_drawn_as_the_run_was(fall, tmp_path, color, capsys):
    out = tmp_path / "out"
    assert main(["run", str(fall), "-o", str(out), "--save-every", "1"]) == 0
    look = ["--color", color, *SMALL]
    assert main(["render", str(fall), "-o", str(tmp_path / "one.png"), *look]) == 0
    saved = ["render", str(out / "frames.pvd"), "--scene", str(fall)]
    assert main([*saved, "-o", str(tmp_path / "two.png"), *look]) == 0
    one, two = (np.asarray(Image.open(tmp_path / n)).astype(int) for n in ("one.png", "two.png"))
    assert np.abs(one - two).mean() < 1.5


def test_a_saved_run_needs_no_scene(fall, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["run", str(fall), "-o", str(out), "--save-every", "2"]) == 0
    capsys.readouterr()
    saved = str(out / "frames.pvd")
    small = ["--size", "64x48", "--json"]
    assert main(["render", saved, "-o", str(tmp_path / "film.mp4"), *small]) == 0
    assert json.loads(capsys.readouterr().out)["pictures"] == 3
    assert SavedRun(out / "frames.pvd", "body").rate() == pytest.approx(10.0)


def test_a_saved_run_of_one_frame_is_a_film_of_one_picture(fall, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["run", str(fall), "-o", str(out), "--save-every", "9", "--quiet"]) == 0
    saved = ["render", str(out / "frames.pvd"), "--size", "64x48", "--json"]
    assert main([*saved, "-o", str(tmp_path / "film.gif")]) == 0
    assert json.loads(capsys.readouterr().out)["pictures"] == 1


@pytest.mark.parametrize(
    "text, told",
    [
        (None, "cannot be read"),
        ("nonsense", "no list of frames"),
        ("<VTKFile><Collection/></VTKFile>", "lists no frames"),
        ('<V><DataSet timestep="0" file="none.vtu"/></V>', "none.vtu is missing"),
    ],
)
def test_a_broken_list_of_frames_is_told_in_a_sentence(tmp_path, text, told, capsys):
    path = tmp_path / "frames.pvd"
    if text is not None:
        path.write_text(text)
    assert main(["render", str(path), "-o", str(tmp_path / "a.mp4")]) == 2
    assert told in capsys.readouterr().err
    assert not (tmp_path / "a.mp4").exists()


@pytest.mark.parametrize("name", ["film.webp", "film.gif", "film.png", "frames"])
def test_a_transparent_film_is_transparent(fall, tmp_path, name):
    target = tmp_path / name
    assert main(["render", str(fall), "-o", str(target), "--alpha", *SMALL]) == 0
    picture = target / "frame_00004.png" if name == "frames" else target
    with Image.open(picture) as image:
        alpha = np.asarray(image.convert("RGBA"))[..., 3]
    assert (alpha[:10, :40] == 0).all() and (alpha == 255).sum() > 100


def test_an_mp4_cannot_be_transparent_and_says_what_can(fall, tmp_path, capsys):
    assert main(["render", str(fall), "-o", str(tmp_path / "a.mp4"), "--alpha"]) == 2
    assert "write a .webp" in capsys.readouterr().err


def test_scene_goes_with_a_saved_run_only(fall, tmp_path, capsys):
    wrong = ["render", str(fall), "--scene", str(fall), "-o", str(tmp_path / "a.png")]
    assert main(wrong) == 2
    assert "goes with a saved run" in capsys.readouterr().err
