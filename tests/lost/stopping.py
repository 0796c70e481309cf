"""A small scene, and processes that are stopped from outside."""

import os
import signal
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
SCENE = """
duration = 0.2
frame_rate = 50

[[body]]
name = "beam"
young = 1e5
poisson = 0.3
density = 1000.0

[body.mesh]
box = { size = [0.5, 0.2, 0.2], cells = [3, 1, 1] }

[[body.pin]]
where = { box = [[-1e-6, -1, -1], [1e-6, 1, 1]] }

[[probe]]
name = "tip"
body = "beam"
point = [0.5, 0.2, 0.2]

[render]
size = [48, 32]
samples = 1
"""


def environment():
    """The environment of a process that imports this tree's tisoft."""
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    return os.environ | {"PYTHONPATH": paths}


def wait_for(condition, child, seconds=300.0):
    """Wait until a condition holds or the process has ended."""
    end = time.monotonic() + seconds
    while not condition() and child.poll() is None:
        assert time.monotonic() < end
        time.sleep(0.002)


def heeds_signals(child):
    """Whether the process has its handlers in place (Linux)."""
    status = Path(f"/proc/{child.pid}/status").read_text()
    caught = int(status.split("SigCgt:")[1].split()[0], 16)
    return bool(caught >> (signal.SIGTERM - 1) & 1)


def press_at(monkeypatch, index, *numbers):
    """Let signals arrive while frame `index` is watched."""

    def press(self, frame):
        if frame.index == index:
            for number in numbers:
                signal.raise_signal(number)

    monkeypatch.setattr("tisoft.observers.progress.Progress.on_frame", press)
