import signal
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # for the helpers beside the tests

import stopping


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "beam.toml"
    path.write_text(stopping.SCENE, encoding="utf-8")
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
    """Starts `tisoft` with arguments in the test's folder; its processes end with the test."""
    children = []

    def begin(*arguments, **options):
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        child = subprocess.Popen(
            [sys.executable, "-m", "tisoft", *arguments],
            cwd=tmp_path,
            env=stopping.environment(),
            text=True,
            **pipes | options,
        )
        children.append(child)
        return child

    yield begin
    for child in children:
        child.kill()
        child.wait()
        for pipe in (child.stdout, child.stderr):
            if pipe is not None:
                pipe.close()
