"""The viewer without a browser: picking, the hand, pacing, orders, and a real socket."""

import asyncio
import base64
import json
import re
import struct
import urllib.error
import urllib.request
import zlib

import numpy as np
import pytest
from PIL import Image
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

import tisoft as ts
from tisoft.viewer import carrying
from tisoft.viewer.controller import Controller
from tisoft.viewer.orders import BadOrder, checked
from tisoft.viewer.picking import patch, pick
from tisoft.viewer.server import FILES, Server


class Clock:
    """A clock that moves by what is slept, and by `cost` at each reading."""

    def __init__(self):
        self.now, self.cost, self.slept = 0.0, 0.0, 0.0

    def __call__(self):
        self.now += self.cost
        return self.now

    def wait(self, seconds):
        self.now += seconds
        self.slept += seconds


class Hand:
    def __init__(self, body, nodes, weights, point):
        self.body, self.nodes, self.weights, self.target = body, nodes, weights, point
        self.force, self.released = np.zeros(3), False

    def release(self):
        self.released = True


def beam():
    scene = ts.Scene()
    body = scene.add_body(ts.box((0.4, 0.1, 0.1), (4, 1, 1)), ts.ViscoElastic(2e4, 0.3, 1000.0))
    body.pin(ts.where.box((-1, -1, -1), (0.001, 1, 1)))
    scene.add_obstacle(ts.Sphere((0.3, -0.6, 0.05), 0.1))
    scene.add_probe("tip", body, point=(0.4, 0.1, 0.1))
    scene.render = ts.Render(size=(64, 48), samples=1)
    return scene


@pytest.fixture
def control():
    clock = Clock()
    made = Controller(beam(), clock=clock, wait=clock.wait, color="speed")
    made.sim.grab = Hand
    return made


def order(control, viewer=1, **words):
    control.post(checked(words), viewer)


def test_a_ray_finds_the_nearest_triangle_and_a_patch_carries_the_point():
    rng = np.random.default_rng(0)
    mesh = ts.box((0.4, 0.1, 0.1), (4, 1, 1))
    towards = np.array([0.17, 0.06, 0.1])
    eye = np.array([0.3, 0.4, 2.0])
    ray = (towards - eye) / np.linalg.norm(towards - eye)
    far, triangle, weights = pick(eye, ray, mesh.points, mesh.surface)
    point = weights @ mesh.points[mesh.surface[triangle]]
    assert np.allclose(point, towards) and np.isclose(far, np.linalg.norm(towards - eye))
    assert pick(eye, -ray, mesh.points, mesh.surface) is None
    rows, shares = patch(mesh.points, np.ones(len(mesh.points)), point)
    affine, shift = rng.normal(size=(3, 3)), rng.normal(size=3)
    moved = mesh.points @ affine.T + shift
    assert np.isclose(shares.sum(), 1.0)
    assert np.allclose(shares @ moved[rows], affine @ point + shift)


def test_the_hand_follows_drops_and_refuses(control):
    shown = control.painter.drawn.bodies[0]
    rows = shown.triangles[0].tolist()
    point = shown.rest_point(np.array(rows), np.array([0.2, 0.3, 0.5]))
    order(control, do="grab", rows=rows, weights=[0.2, 0.3, 0.5], point=[*point], number=3)
    control.tick()
    hand = control.hands.held[1]
    mesh = control.scene.bodies[0].mesh
    assert hand.body is control.scene.bodies[0]
    assert np.allclose(hand.weights @ mesh.points[hand.nodes], point)
    order(control, do="drag", point=[1.0, 2.0, 3.0], number=4)
    order(control, viewer=2, do="drag", point=[9.0, 9.0, 9.0], number=5)  # holds nothing
    control.tick()
    assert hand.target == [1.0, 2.0, 3.0] and control.hands.drag == 4
    order(control, do="drop")
    control.tick()
    assert hand.released and not control.hands.held
    order(control, do="grab", rows=[10**6], weights=[1.0], point=[0, 0, 0], number=6)
    control.tick()
    assert "hand" in control.error and not control.hands.held


def test_real_time_is_kept_debt_is_dropped_and_a_pause_stops(control):
    clock = control.clock
    while clock.now < 1.0:
        control.tick()
    assert abs(control.sim.time - 1.0) < 0.05 and control.dropped == 0.0
    assert control.real_time_factor() == pytest.approx(1.0, rel=0.02)
    clock.cost = 0.1  # each reading of the clock now costs more than a frame lasts
    before = control.sim.frame
    for _ in range(10):
        control.tick()
    assert control.sim.frame - before == 10 and control.dropped > 0.5
    clock.cost = 0.0
    order(control, do="pause", on=True)
    control.tick()
    still = control.sim.frame
    for _ in range(5):
        control.tick()
    assert control.sim.frame == still
    order(control, do="step")
    control.tick()
    control.tick()
    assert control.sim.frame == still + 1
    order(control, do="step")  # while no page has time for a picture
    control.wants, before = False, control.snapshot.number
    control.tick()
    assert control.snapshot.number == before
    control.want()
    control.tick()
    assert control.snapshot.time == control.sim.time == pytest.approx((still + 2) / 60.0)


def test_panel_orders_change_the_scene_and_reset_begins_anew(control):
    order(control, do="material", body=0, name="young", value=5e4)
    order(control, do="gravity", value=3.0)
    order(control, do="color", name="strain")
    order(control, do="speed", value=0.5)
    control.tick()
    assert control.scene.bodies[0].model.young == 5e4 and control.scene.gravity == (0, -3, 0)
    assert control.snapshot.color == "strain" and control.speed == 0.5 and not control.error
    order(control, do="material", body=0, name="poisson", value=0.7)
    control.tick()
    assert "poisson" in control.error and control.scene.bodies[0].model.poisson == 0.3
    order(control, do="reset")
    control.tick()
    assert control.sim.frame <= 1 and control.scene.bodies[0].model.young == 5e4


def test_a_failure_is_a_sentence_and_the_last_good_state_stays(control):
    order(control, do="material", body=0, name="young", value=5e4)
    control.tick()

    def fail():
        raise ts.Diverged("the bodies left the world")

    control.sim.step, control.clock.now = fail, control.clock.now + 1.0
    control.tick()
    assert control.paused and "young" in control.error and "reset" in control.error
    assert np.isfinite(control.snapshot.positions).all() and "young" in control.status()["undo"]
    del control.sim.step
    order(control, do="undo")
    control.clock.now += 1.0
    frame = control.sim.frame
    control.tick()
    assert not control.paused and not control.error and control.scene.bodies[0].model.young == 2e4
    assert control.sim.frame == frame + 1
    order(control, do="undo")
    control.tick()
    assert "no change" in control.error


def test_a_slider_on_its_way_is_one_change(control):
    for value in (1e4, 2e4, 3e4):
        order(control, do="material", body=0, name="young", value=value)
        control.tick()
    order(control, do="material", body=0, name="poisson", value=0.2)
    order(control, do="material", body=0, name="poisson", value=0.25)
    control.tick()
    assert control.scene.bodies[0].model.poisson == 0.25
    order(control, do="undo")
    order(control, do="undo")
    control.tick()
    model = control.scene.bodies[0].model
    assert (model.young, model.poisson) == (2e4, 0.3) and not control.changes.made


def test_pins_and_obstacles_go_where_the_hand_leads(control):
    """As fast as bodies bear, however the hand jumps; a reset puts them back."""
    body, scene = control.scene.bodies[0], control.scene
    pins, obstacle = list(body.pins), scene.obstacles[0]
    shown = control.painter.drawn.bodies[0]
    clamp = shown.picked.tolist().index(0)
    order(control, do="pin", rows=[clamp], weights=[1.0], point=[0, 0, 0], number=1)
    order(control, do="drag", point=[0.0, 0.05, 0.0], number=2)
    order(control, viewer=2, do="obstacle", obstacle=0, point=[0.3, -0.5, 0.05], number=3)
    order(control, viewer=2, do="drag", point=[0.3, -0.2, 0.05], number=4)
    most = carrying.speed_of(body) / 60.0
    height = 0.0
    for _ in range(40):
        control.clock.now += 0.02
        control.tick()
        before, height = height, control.sim.positions()[0, 1]
        assert height - before < 1.001 * most
    assert control.status()["carries"] == ['the pin of "body0"', "the sphere"]
    assert height == pytest.approx(0.05) and not control.sim.recoveries
    control.want()
    control.tick()
    assert np.allclose(control.snapshot.extra[:3], (0, 0.3, 0))  # as a page is told
    order(control, do="reset")
    control.tick()
    assert body.pins == pins and scene.obstacles == [obstacle] and control.sim.frame <= 1


def test_every_simulated_frame_is_recorded(control, tmp_path):
    begun = control.sim.frame
    for name in ("beam.html", "beam.webp"):
        control.record_to(tmp_path / name)
        control.wants = False  # no page looks
        shots = [control.painter.snapshot(control.sim, 0)]
        while len(shots) < 6:
            control.clock.now += 0.02
            control.tick()
            if control.sim.frame - begun == len(shots):
                shots.append(control.painter.snapshot(control.sim, 0))
        control.recorder.stop()
        while control.recorder.recording is not None:
            control.tick()
        assert control.said.endswith("holds 6 frames") and not control.error
        begun = control.sim.frame
        if name.endswith("html"):
            check_page((tmp_path / name).read_text(encoding="utf-8"), shots)
    with Image.open(tmp_path / "beam.webp") as film:
        assert film.n_frames == 6
        film.seek(1)
        film.load()
        assert film.info["duration"] in (16, 17)
    with pytest.raises(ts.SceneError, match=r"\.mp4, \.gif, \.webp"):
        control.record_to(tmp_path / "beam.avi")


def check_page(text, shots):
    """The frames of a page that plays by itself, decoded as it does."""
    told = json.loads(re.search(r"tisoftRecording = (\{.*?\});</script>", text)[1])
    frames = re.search(r'id="tisoft-frames" type="text/plain">(.*?)</script>', text)[1]
    raw = zlib.decompress(base64.b64decode(frames))
    rows, extra = told["rows"], 12 + 4 * told["extra"]
    assert told["frames"] == len(shots) and len(raw) == len(shots) * (extra + 7 * rows)
    last = np.zeros((rows, 3), np.uint16)
    for k, shot in enumerate(shots):
        begin = k * (extra + 7 * rows)
        assert struct.unpack("<f", raw[begin : begin + 4])[0] == np.float32(shot.time)
        moved = raw[begin + extra : begin + extra + 6 * rows]
        last = last + np.frombuffer(moved, "<u2").reshape(rows, 3)
        x = np.array(told["least"]) + np.array(told["span"]) * last / 65535.0
        assert np.allclose(x, shot.positions, atol=1e-5)
    assert "import * as T from 'data:" in text and "src=" not in text


def test_a_script_owns_the_loop_and_a_run_can_be_watched():
    scene = beam()
    with ts.view(scene, speed=10.0) as view:
        assert view.url in view._repr_html_() and "iframe" in view._repr_html_()
        times = [frame.time for frame in view.frames(0.1)]
        assert np.allclose(times, np.arange(7) / 60.0)
        sim = ts.Simulation(scene, interactive=True, threads=1)
        view.control.post(checked({"do": "gravity", "value": 1.0}))
        sim.run(0.1, observers=[view])
        assert view.sim is sim and scene.gravity[1] == -1.0 and len(view.control._meter) == 7
        with pytest.raises(ts.SceneError, match="other bodies"):
            ts.Simulation(beam(), interactive=True, threads=1).run(0.1, observers=[view])


@pytest.mark.parametrize(
    "message",
    [
        None, [], {}, {"do": "__init__"}, {"do": ["drop"]}, {"do": "speed", "value": 10**400},
        {"do": "record", "on": True, "kind": "../x"}, {"do": "range", "value": 0},
        {"do": "obstacle", "obstacle": -1, "point": [0, 0, 0], "number": 1},
        {"do": "drop", "more": 1}, {"do": "speed"},
        {"do": "speed", "value": float("nan")}, {"do": "speed", "value": "1"},
        {"do": "pause", "on": 1}, {"do": "color", "name": "red"}, {"do": "gravity", "value": 1e9},
        {"do": "material", "body": 0, "name": "density", "value": 1.0},
        {"do": "grab", "rows": [0] * 4, "weights": [0.25] * 4, "point": [0, 0, 0], "number": 1},
        {"do": "grab", "rows": [-1], "weights": [1.0], "point": [0, 0, 0], "number": 1},
        {"do": "grab", "rows": [0, 1], "weights": [1.0], "point": [0, 0, 0], "number": 1},
        {"do": "grab", "rows": [0], "weights": [0.5], "point": [0, 0, 0], "number": 1},
    ],
)  # fmt: skip
def test_what_no_page_sends_is_refused(message):
    with pytest.raises(BadOrder):
        checked(message)


@pytest.fixture
def served(control):
    server = Server(control, port=0)
    yield server
    server.close()


def get(url):
    try:
        with urllib.request.urlopen(url, timeout=5) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, b""


def test_only_the_page_is_served_and_only_with_its_key(served):
    base = f"http://127.0.0.1:{served.port}"
    assert get(served.url)[0] == 200
    assert get(base + "/")[0] == 403 and get(base + "/?key=x")[0] == 403
    assert b"three" in get(base + "/page.js")[1]
    for path in ("/page.html", "/../server.py", "/%2e%2e/server.py", "/three.LICENSE"):
        assert get(base + path)[0] == 404
    assert len(FILES) == 3
    with pytest.raises(ts.SceneError, match=r"is taken; \d+ is free"):
        Server(served.control, port=served.port)


def test_a_socket_gets_two_pictures_and_waits_for_its_page(served, control):
    address = served.url.replace("http", "ws")
    shots = {control.snapshot.number: control.snapshot}
    control.listeners.append(lambda: shots.update({control.snapshot.number: control.snapshot}))

    async def talk():
        for wrong in (address[:-3], address.split("?")[0]):
            with pytest.raises(InvalidStatus):
                await connect(wrong)
        with pytest.raises(InvalidStatus):
            await connect(address, origin="http://evil.example")
        own = f"http://127.0.0.1:{served.port}"
        async with connect(address, origin=own) as ws:
            hello = json.loads(await ws.recv())
            pictures = []

            async def listen(seconds):
                try:
                    while True:
                        got = await asyncio.wait_for(ws.recv(), seconds)
                        if isinstance(got, bytes):
                            pictures.append(got)
                except TimeoutError:
                    return

            for _ in range(20):
                control.clock.now += 0.02
                control.tick()
                await listen(0.02)
            assert len(pictures) == 2, "a page that does not draw is sent two pictures"
            number, _, _, _, color = struct.unpack("<IIffI", pictures[-1][:20])
            rows, begin = hello["rows"], 20 + 4 * hello["extra"]
            assert len(pictures[-1]) == begin + 13 * rows and hello["colors"][color] == "speed"
            x = np.frombuffer(pictures[-1][begin : begin + 12 * rows], "<f4").reshape(rows, 3)
            assert np.array_equal(x, shots[number].positions)
            await ws.send(json.dumps({"ack": number}))
            await ws.send(json.dumps({"do": "pause", "on": True}))
            await listen(0.1)
            control.tick()
            await listen(0.1)
            assert control.paused and len(pictures) > 2
        for bad in ("x", "[1]", '{"do": "exit"}', '{"ack": 99999}', "{" * 3000, b"\x00\x01"):
            async with connect(address, origin=own) as ws:
                await ws.send(bad)
                with pytest.raises(ConnectionClosed) as closed:
                    while True:
                        await asyncio.wait_for(ws.recv(), 5)
                assert closed.value.rcvd.code == 1008 and closed.value.rcvd.reason

    asyncio.run(talk())
    order(control, do="step")
    control.tick()
    assert not control.error
