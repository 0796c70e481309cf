"""What an open page costs the simulation: boxes of 1,920 and 15,360 tets (those of `bench`), in one
thread, coloured by stress, stepped as fast as they go.

A scripted client in a process of its own takes the pictures as a page does, 60 a second at the
most, in every second slice of time; in the others it does not answer, and none are made.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from typing import Any

from tisoft import runtime
from tisoft.bench import beam

SIZES = ("S", "M")
ROUNDS = 8
"""Pairs of slices, with and without pictures."""
PACE = 1e6
"""Simulated seconds a second that are asked for: more than there will be."""
CLIENT = """
import json, struct, sys, threading, time
from websockets.sync.client import connect
draws, due = threading.Event(), 0.0
def listen():
    for line in sys.stdin:
        draws.set() if line == "on\\n" else draws.clear()
threading.Thread(target=listen, daemon=True).start()
with connect(sys.argv[1], max_size=None) as page:
    for message in page:
        if isinstance(message, str):
            continue
        draws.wait()
        now = time.perf_counter()
        time.sleep(max(0.0, due - now))
        due = max(now, due) + 1.0 / 60.0
        page.send(json.dumps({"ack": struct.unpack("<I", message[:4])[0]}))
"""


def measure(size: str, *, seconds: float = 1.0, arch: str = "cpu") -> dict[str, Any]:
    """Cost of an open page at one size; takes about 2 × ROUNDS × `seconds`.

    `cost` is the share of frames that are lost to it, `cpu_cost` the processor time that the
    simulation's thread spends more on a frame, `pictures` how many a second were sent.
    """
    runtime.import_taichi()
    from tisoft.simulation import Simulation
    from tisoft.viewer.controller import Controller
    from tisoft.viewer.server import Server

    scene = beam(size, "viscoelastic")
    sim = Simulation(scene, arch=arch, threads=1, interactive=True)
    control = Controller(scene, sim=sim, speed=PACE)
    server = Server(control, port=0)
    address = server.url.replace("http", "ws", 1)
    client = subprocess.Popen([sys.executable, "-c", CLIENT, address], stdin=subprocess.PIPE)
    try:
        while server.sent < 1:
            control.tick()
        lost, more, pictures = [], [], []
        for _ in range(ROUNDS):
            (alone, bare, _), (watched, dear, sent) = (
                _slice(control, server, client, draws, seconds) for draws in (False, True)
            )
            lost.append(1.0 - watched / alone)
            more.append(dear / bare - 1.0)
            pictures.append(sent)
    finally:
        client.kill()
        client.wait()
        if client.stdin is not None:
            client.stdin.close()
        server.close()
    return {
        "size": size,
        "elements": control.sim.system.elements,
        "cost": statistics.median(lost),
        "cost_range": [min(lost), max(lost)],
        "cpu_cost": statistics.median(more),
        "pictures": statistics.median(pictures),
        "frames_per_second": alone,
    }


def _slice(
    control: Any, server: Any, client: Any, draws: bool, seconds: float
) -> tuple[float, float, float]:
    """Frames a second, processor seconds a frame and pictures a second of a slice of time."""
    client.stdin.write(b"on\n" if draws else b"off\n")
    client.stdin.flush()
    settled = time.perf_counter() + 0.2
    while time.perf_counter() < settled:
        control.tick()
    frame, sent, cpu, begun = (
        control.sim.frame,
        server.sent,
        time.thread_time(),
        time.perf_counter(),
    )
    while (spent := time.perf_counter() - begun) < seconds:
        control.tick()
    made = control.sim.frame - frame
    return made / spent, (time.thread_time() - cpu) / made, (server.sent - sent) / spent


def as_text(rows: list[dict[str, Any]]) -> str:
    """A table of the rows."""
    lines = [
        f"{'elements':>9}{'frames/s':>10}{'pictures/s':>12}{'frames lost':>13}{'cpu a frame':>13}"
    ]
    lines += [
        f"{row['elements']:>9}{row['frames_per_second']:>10.0f}{row['pictures']:>12.0f}"
        f"{100.0 * row['cost']:>11.1f} %{100.0 * row['cpu_cost']:>+11.1f} %"
        for row in rows
    ]
    return "\n".join(lines)
