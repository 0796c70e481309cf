"""Makes docs/gallery/view.png: the page of `tisoft view` with the bear in the hand.

python tools/picture_of_view.py        (needs Playwright, of the dev extra, and /usr/bin/chromium)
"""

import threading
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

import tisoft as ts
from tisoft.commands.demo import demos
from tisoft.viewer.controller import Controller
from tisoft.viewer.server import Server

TARGET = Path(__file__).parents[1] / "docs" / "gallery" / "view.png"
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
MIDDLE = """() => {
  const n = tisoft.positions.length / 3, m = [0, 0, 0];
  for (let i = 0; i < 3 * n; i++) m[i % 3] += tisoft.positions[i] / n;
  const v = tisoft.camera.position.clone().set(...m).project(tisoft.camera);
  return [(v.x + 1) / 2 * innerWidth, (1 - v.y) / 2 * innerHeight];
}"""


def pull(page: Page) -> None:
    """Drag the middle of the body up and aside."""
    x, y = page.evaluate(MIDDLE)
    page.mouse.move(x, y)
    page.mouse.down()
    for k in range(1, 9):
        page.mouse.move(x + 14 * k, y - 9 * k)
        page.wait_for_timeout(120)
    page.wait_for_timeout(800)


def main() -> None:
    """Serve, drive, take the picture."""
    control = Controller(ts.load_scene(demos()["creature"]))
    server, end = Server(control, port=0), threading.Event()

    def simulate() -> None:
        while not end.is_set():
            control.tick()

    thread = threading.Thread(target=simulate)
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path="/usr/bin/chromium", args=FLAGS)
        page = browser.new_page(viewport={"width": 1200, "height": 760})
        thread.start()
        page.goto(server.url)
        page.wait_for_function("window.tisoft && tisoft.drawn > 3", timeout=60_000)
        page.wait_for_timeout(2500)
        pull(page)
        page.screenshot(path=TARGET)
        end.set()
        thread.join()
        server.close()
        browser.close()


if __name__ == "__main__":
    main()
