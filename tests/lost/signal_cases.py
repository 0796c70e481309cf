"""Signals at random moments of every command that writes: many cases in one warm process.

    python signal_cases.py FOLDER COUNT SEED [COMMANDS]

prints a line of JSON for each case: what was done, the exit code, and what was wrong, if anything.
"""

import contextlib
import csv
import io
import json
import os
import random
import signal
import sys
import threading
import time
import traceback
from pathlib import Path
from xml.etree import ElementTree

import imageio_ffmpeg
from PIL import Image
from stopping import SCENE

from tisoft import checkpoint
from tisoft.cli import main

SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
RUN = ["run", "beam.toml", "-o", "out", "--save-every", "7", "--set", "duration=2"]
COMMANDS = {
    "run": RUN,
    "frequent": [*RUN, "--set", "checkpoint_every=1"],
    "mp4": ["render", "beam.toml", "-o", "film.mp4"],
    "gif": ["render", "beam.toml", "-o", "film.gif"],
    "pictures": ["render", "beam.toml", "-o", "out"],
    "picture": ["render", "beam.toml", "-o", "end.png"],
    "static": ["static", "beam.toml", "-o", "out"],
    "modes": ["modes", "beam.toml", "-o", "out"],
    "swing": ["modes", "beam.toml", "-n", "1", "-o", "swing.gif"],
    "check": ["check", "beam.toml", "--picture", "check.png"],
    "stability": ["stability", "beam.toml", "-o", "out", "--only", "step-damping,poisson"],
    "demo": ["demo", "nets", "--set", "duration=0.1", "--size", "32x32", "-o", "."],
}
SHARE = {"run": 10, "frequent": 10, "stability": 1, "swing": 1}
"""How often a command is taken; the others three times."""


def call(arguments, plan=()):
    """Exit code and what was told, with signals sent after the plan's times [s]."""
    out, error = io.StringIO(), io.StringIO()
    timers = [threading.Timer(t, os.kill, (os.getpid(), number)) for t, number in plan]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        for timer in timers:
            timer.start()
        code = main(arguments)
    for timer in timers:
        timer.cancel()
        timer.join()
    return code, out.getvalue(), error.getvalue()


def empty(folder):
    """Leave the scene alone in the folder."""
    for path in sorted(folder.rglob("*"), reverse=True):
        if path.name != "beam.toml":
            path.rmdir() if path.is_dir() else path.unlink()


def assert_whole(path):
    """A file under its own name is whole."""
    if path.suffix == ".csv":
        text = path.read_text(encoding="utf-8")
        assert not text or text.endswith("\n")
        assert len({len(row) for row in csv.reader(text.splitlines())}) <= 1
    elif path.suffix in (".vtu", ".pvd", ".svg"):
        ElementTree.parse(path)
    elif path.suffix == ".npz":
        checkpoint.read(path)
    elif path.suffix == ".json":
        json.loads(path.read_text(encoding="utf-8"))
    elif path.suffix == ".mp4":
        assert imageio_ffmpeg.count_frames_and_secs(path)[0] > 0
    elif path.suffix in (".png", ".gif"):
        with Image.open(path) as picture:
            picture.load()
    else:
        assert path.name in ("beam.toml", "stability.md"), path


def assert_ended_well(code, error, number, folder):
    """What holds after every case."""
    assert code in (0, 128 + number), (code, error)
    lines = [line for line in error.splitlines() if "tisoft: warning" not in line]
    assert len(lines) == (code != 0), error
    assert "Traceback" not in error and "Exception ignored" not in error, error
    for path in folder.rglob("*"):
        if path.is_file():
            assert not path.name.startswith("."), path
            assert_whole(path)
    manifest = folder / "out" / "tisoft.json"
    if manifest.exists():
        state = json.loads(manifest.read_text(encoding="utf-8"))["state"]
        assert state in (("done",) if code == 0 else ("interrupted", "done")), state


def run_goes_on(folder, whole):
    """A run that was stopped goes on to the tables of one that was not."""
    unfinished = call(RUN)[0] == 2
    assert call([*RUN, "--resume" if unfinished else "--overwrite"])[0] == 0
    assert tables(folder) == whole
    return unfinished


def tables(folder):
    return [(folder / "out" / name).read_bytes() for name in ("probes.csv", "energy.csv")]


def planned(chance, seconds, count):
    """Commands by their shares, in any order, and moments spread over the time that each takes, in
    shares of that.
    """
    names = [name for name in seconds for _ in range(SHARE.get(name, 3))]
    begin = chance.random()
    taken = [names[int((k + begin) * len(names) / count)] for k in range(count)]
    moments = {name: spread(chance, taken.count(name)) for name in taken}
    plan = [(name, 1.1 * moments[name].pop()) for name in taken]
    chance.shuffle(plan)
    return plan


def spread(chance, count):
    """So many numbers from 0 to 1, one in each of as many equal parts."""
    return [(k + chance.random()) / count for k in range(count)]


def case(chance, folder, command, seconds, whole):
    """One case: a command and a moment, and a signal or two.

    What ends sooner than it took before, beside others' load, is known to take that: else all
    moments after would come when it has ended.
    """
    name, share = command
    moment = share * seconds[name]
    number = chance.choice(SIGNALS)
    plan = [(moment, number)]
    if chance.random() < 0.4:
        plan.append((moment + chance.choice([0.0, 0.001, 0.05]), number))
    empty(folder)
    done = {"command": name, "signal": int(number), "moment": moment, "problem": None}
    try:
        begun = time.perf_counter()
        done["code"], _, error = call(COMMANDS[name], plan)
        if done["code"] == 0:
            seconds[name] = min(seconds[name], time.perf_counter() - begun)
        assert_ended_well(done["code"], error, number, folder)
        if name in ("run", "frequent"):
            done["resumed"] = run_goes_on(folder, whole)
    except Exception:
        done["problem"] = traceback.format_exc()
    return done


def warm(folder, names):
    """Compile what the commands need; returns how long each takes, and a whole run's tables."""
    seconds, whole = {}, None
    for name in names:
        for _ in range(2):
            empty(folder)
            begun = time.perf_counter()
            assert call(COMMANDS[name])[0] == 0
            took = time.perf_counter() - begun
            seconds[name] = min(took, seconds.get(name, took))
        if name == "run":
            whole = tables(folder)
    return seconds, whole


def main_of_cases(folder, count, seed, names):
    folder = Path(folder)
    os.chdir(folder)
    (folder / "beam.toml").write_text(SCENE, encoding="utf-8")
    for number in SIGNALS:
        signal.signal(number, lambda *_: None)  # one that comes late meets no one
    seconds, whole = warm(folder, names)
    chance = random.Random(seed)
    for command in planned(chance, seconds, count):
        print(json.dumps(case(chance, folder, command, seconds, whole)), flush=True)


if __name__ == "__main__":
    names = "".join(sys.argv[4:]).split(",")
    main_of_cases(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), names if names[0] else COMMANDS)
