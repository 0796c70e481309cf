"""The page in a real Chromium, driven as a user would: skipped, with the reason, where none is."""

import contextlib
import functools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import tisoft as ts
from tisoft.viewer.controller import Controller
from tisoft.viewer.server import Server

CHROMIUM = "/usr/bin/chromium"
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
HERE = ("http://127.0.0.1:", "file:///", "data:text/javascript;", "blob:")
SPOT = """point => {
  const v = tisoft.camera.position.clone().set(...point).project(tisoft.camera);
  return [(v.x + 1) / 2 * innerWidth, (1 - v.y) / 2 * innerHeight];
}"""
WHERE = """held => {
  const W = tisoft, c = W.camera; c.updateMatrixWorld();
  const sum = k => held.rows.reduce((s, j, i) => s + held.weights[i] * W.positions[3 * j + k], 0);
  const x = [0, 1, 2].map(sum);
  const v = c.position.clone().set(...x).project(c);
  return [(v.x + 1) / 2 * innerWidth, (1 - v.y) / 2 * innerHeight];
}"""


@pytest.fixture(scope="module")
def control():
    scene = ts.Scene()
    model = ts.ViscoElastic(1e6, 0.3, 1000.0, 200.0, 200.0, 8.0)
    body = scene.add_body(ts.box((1.0, 0.3, 0.3), (6, 2, 2)), model)
    body.pin(ts.where.box((-1, -1, -1), (0.001, 1, 1)))
    scene.add_obstacle(ts.Sphere((0.5, -0.4, 0.15), 0.2))
    turn = ts.Turn((0, -3, 0), (0, 0, 1), 1.0)
    scene.add_obstacle(ts.Box((0, -3, 0), (0.4, 0.2, 0.2), rotate=(0, 0, 30), turn=turn))
    scene.add_obstacle(ts.Capsule((-0.5, -3, 0), (-0.5, -2.5, 0), 0.1))
    scene.add_probe("tip", body, point=(1.0, 0.3, 0.3))
    return Controller(scene)


@pytest.fixture(scope="module")
def page(control):
    api = pytest.importorskip("playwright.sync_api", reason="the package playwright is missing")
    server, hands = Server(control, port=0), ThreadPoolExecutor(1)

    def drive(work):
        """Let another thread do the browser's work: Taichi's kernels stay in this one."""
        future = hands.submit(work)
        while not future.done():
            control.tick()
        return future.result()

    driver = drive(lambda: api.sync_playwright().start())
    try:
        opened = drive(lambda: opened_page(driver, server.url))
        opened.drive = drive
        yield opened
        drive(opened.context.browser.close)
    except api.Error as error:
        if "launch" not in str(error):
            raise
        pytest.skip(f"no {CHROMIUM} to drive: {str(error).splitlines()[0]}")
    finally:
        drive(driver.stop)
        hands.shutdown()
        server.close()


def opened_page(driver, url):
    browser = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
    opened = browser.new_page(viewport={"width": 800, "height": 500})
    opened.asked, opened.wrong = [], []
    opened.on("request", lambda request: opened.asked.append(request.url))
    opened.on("pageerror", lambda error: opened.wrong.append(str(error)))
    opened.goto(f"{url}&plain")
    opened.wait_for_function("window.tisoft && tisoft.drawn > 3", timeout=60_000)
    return opened


def driven(test):
    """A test whose body drives the browser while this thread simulates."""

    @functools.wraps(test)
    def run(**fixtures):
        fixtures["page"].drive(functools.partial(test, **fixtures))

    return run


def until(page, condition):
    """Wait for it; where it does not come, tell what the page knew."""
    try:
        page.wait_for_function(condition, timeout=40_000)
    except Exception as error:
        known = page.evaluate(
            "[tisoft.status, tisoft.time, tisoft.connected, tisoft.received, tisoft.number,"
            " document.getElementById('words').textContent, document.activeElement.id]"
        )
        raise AssertionError(f"{condition} did not come: {known}, {page.wrong}") from error


def brought(page, ask, condition):
    """Ask for what may be asked again, until it is there: a loaded machine may lose a click."""
    for _ in range(3):
        ask()
        with contextlib.suppress(Exception):
            page.wait_for_function(condition, timeout=10_000)
            return
    until(page, condition)


@driven
def test_the_page_pauses_steps_slides_turns_and_resets(page, control):
    page.keyboard.press(" ")
    until(page, "tisoft.status.paused")
    frame = control.sim.frame
    page.keyboard.press("ArrowRight")
    until(page, f"Math.abs(tisoft.time - {(frame + 1) / 60}) < 1e-4")
    assert control.sim.frame == frame + 1
    page.fill("#young-0-value", "1.5e6")
    page.keyboard.press("Enter")
    page.select_option("#color", "speed")
    until(page, "tisoft.status.color == 'speed'")
    assert control.scene.bodies[0].model.young == 1.5e6 and control.color == "speed"
    page.fill("#poisson-0-value", "0.9")
    page.keyboard.press("Enter")
    until(page, "!document.getElementById('error').hidden")
    assert "poisson" in page.inner_text("#error")
    page.keyboard.press("u")
    until(page, "tisoft.status.said.includes('young') && !tisoft.status.undo")
    until(page, "document.getElementById('young-0-value').value == '1.00e+6'")
    page.fill("#top", "2")
    page.keyboard.press("Enter")
    until(page, "tisoft.status.hold && tisoft.top == 2")
    until(page, "tisoft.marks == 12 && tisoft.status.limit.kind == 'tet'")
    page.keyboard.press("h")
    eye = page.evaluate("tisoft.camera.position.toArray()")
    page.mouse.move(40, 420)
    page.mouse.down()
    page.mouse.move(140, 400, steps=4)
    page.mouse.up()
    page.wait_for_timeout(300)
    assert not np.allclose(eye, page.evaluate("tisoft.camera.position.toArray()"))
    brought(page, lambda: page.click("#reset"), "tisoft.time == 0")
    page.click("#pause")
    until(page, "!tisoft.status.paused && tisoft.time > 0.1")


@driven
def test_the_page_comes_back_after_a_lost_connection(page):
    page.evaluate("tisoft.socket.close()")
    until(page, "!tisoft.connected")
    until(page, "tisoft.connected")
    before = page.evaluate("tisoft.received")
    until(page, f"tisoft.received > {before} + 2")


@driven
def test_a_sphere_is_carried_while_all_is_recorded(page, control, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    page.select_option("#kind", "html")
    page.click("#record")
    until(page, "tisoft.status.recording")
    x, y = page.evaluate(SPOT, [0.5, -0.45, 0.3])
    page.keyboard.down("Shift")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y + 40, steps=3)
    until(page, "tisoft.status.carries.length && tisoft.more[1] < -0.02")
    page.mouse.up()
    page.keyboard.up("Shift")
    assert control.scene.obstacles[0].path[-1][1] > 0.0
    page.keyboard.press("v")
    until(page, "!tisoft.status.recording && tisoft.status.said.includes('recording-1.html')")
    film = page.context.browser.new_page(viewport={"width": 400, "height": 300})
    film.on("pageerror", lambda error: page.wrong.append(str(error)))
    film.on("request", lambda request: page.asked.append(request.url))
    film.goto(f"file://{tmp_path}/recording-1.html?plain")
    until(film, "window.tisoft && tisoft.frames > 10 && tisoft.playing > 5")
    film.keyboard.press(" ")
    film.keyboard.press("ArrowRight")
    until(film, "tisoft.status.paused && tisoft.plotted")
    assert film.evaluate("tisoft.positions.length") == page.evaluate("tisoft.positions.length")
    film.close()


@driven
def test_nothing_is_asked_from_the_network_and_nothing_fails(page):
    assert page.asked and all(url.startswith(HERE) for url in page.asked)
    assert not page.wrong


@driven
def test_a_dragged_point_is_where_the_mouse_is(page, control):
    page.wait_for_timeout(500)
    x, y = page.evaluate(SPOT, [0.9, 0.1, 0.3])
    page.mouse.move(x, y)
    page.mouse.down()
    until(page, "tisoft.held() && tisoft.status.pull != null")
    held = page.evaluate("tisoft.held()")
    for i in range(1, 11):
        page.mouse.move(x, y - 6 * i)
        page.wait_for_timeout(50)
    page.wait_for_timeout(1500)
    point = page.evaluate(WHERE, held)
    page.mouse.up()
    assert np.hypot(point[0] - x, point[1] - (y - 60)) < 0.03 * 60
    until(page, "tisoft.status.pull == null")
    assert not control.hands.held and not control.sim.recoveries
