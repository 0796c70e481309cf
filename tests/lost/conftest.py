"""A small scene, and processes that are stopped from outside."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

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


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "beam.toml"
    path.write_text(SCENE, encoding="utf-8")
    return str(path)


@pytest.fixture(autouse=True)
def deaf_to_nothing():
    """Signals as in a terminal, also where the parent of the tests ignores some (nohup)."""
    numbers = [getattr(signal, n) for n in ("SIGTERM", "SIGHUP") if hasattr(signal, n)]
    before = {number: signal.signal(number, signal.SIG_DFL) for number in numbers}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture
def start(tmp_path):
    """Starts `tisoft` with arguments in a folder; its processes end with the test."""
    children = []
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])

    def begin(*arguments, **options):
        child = subprocess.Popen(
            [sys.executable, "-m", "tisoft", *arguments],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": paths},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            **options,
        )
        children.append(child)
        return child

    yield begin
    for child in children:
        child.kill()
        child.communicate()


def wait_for(condition, child, seconds=60.0):
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
