"""Ctrl-C, SIGTERM, SIGHUP, and worse: every stop keeps what was done."""

import csv
import json
import os
import signal
import subprocess
import sys
import time

import imageio_ffmpeg
import numpy as np
import pytest
from stopping import environment, heeds_signals, press_at, wait_for

from tisoft import stops
from tisoft.cli import main

SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGXCPU]
LONG = ("--set", "duration=2000")


def rows_of(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.reader(file))


def assert_kept(out):
    """Tables and summary are whole and of the same frame, and say that the run was stopped."""
    result = json.loads((out / "summary.json").read_text())
    assert result["status"] == "interrupted"
    assert json.loads((out / "tisoft.json").read_text())["state"] == "interrupted"
    for name in ("probes.csv", "energy.csv"):
        rows = rows_of(out / name)
        assert len(rows) == result["frames"] + 2
        assert {len(row) for row in rows} == {len(rows[0])}
        np.testing.assert_allclose([float(r[0]) for r in rows[1:]], np.arange(len(rows) - 1) / 50)
    assert not [path for path in out.iterdir() if path.name.startswith(".")]


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_ends_a_run_between_frames(number, scene, tmp_path, monkeypatch, capsys):
    press_at(monkeypatch, 3, number)
    before = signal.getsignal(number)
    out = tmp_path / "out"
    assert main(["run", scene, "-o", str(out), "--json"]) == 128 + number
    assert signal.getsignal(number) is before
    told, error = capsys.readouterr()
    assert json.loads(told)["frames"] == 3
    assert error.count("\n") == 1 and "what was written is whole; go on with --resume" in error
    assert_kept(out)
    monkeypatch.undo()
    assert main(["run", scene, "-o", str(out), "--quiet", "--resume"]) == 0


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_twice_in_succession_is_the_same_wish(number, scene, tmp_path, monkeypatch):
    press_at(monkeypatch, 3, number, number, number)
    assert main(["run", scene, "-o", str(tmp_path / "out"), "--quiet"]) == 128 + number
    assert_kept(tmp_path / "out")


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_keeps_the_film_as_far_as_drawn(number, scene, tmp_path, monkeypatch):
    def press(self, frame):
        if self.label == "drawing" and frame.index == 4:
            signal.raise_signal(number)

    monkeypatch.setattr("tisoft.observers.progress.Progress.on_frame", press)
    film = tmp_path / "film.mp4"
    assert main(["render", scene, "-o", str(film), "--quiet"]) == 128 + number
    assert imageio_ffmpeg.count_frames_and_secs(film)[0] == 5
    assert main(["render", scene, "-o", str(tmp_path / "film"), "--quiet"]) == 128 + number
    names = sorted(path.name for path in (tmp_path / "film").iterdir())
    assert names == [*(f"frame_{k:05d}.png" for k in range(5)), "tisoft.json"]


def test_a_process_ends_with_128_and_the_number(scene, tmp_path, start):
    for number in SIGNALS:
        child = start("run", scene, "-o", f"out{number}", "--quiet", *LONG)
        table = tmp_path / f"out{number}" / "probes.csv"
        wait_for(lambda t=table: t.exists() and t.stat().st_size > 300, child)
        child.send_signal(number)
        _, error = child.communicate(timeout=300)
        assert child.returncode == 128 + number and error.count("\n") == 1
        assert_kept(tmp_path / f"out{number}")


@pytest.mark.skipif(sys.platform == "win32", reason="a shell closes the streams")
def test_closed_streams_change_nothing(tmp_path):
    for closed, code in ((">&-", 0), ("2>&- >&- <&-", 0), ("2>&-", 2)):
        words = "--version" if code == 0 else "check nowhere.toml"
        line = f"{sys.executable} -m tisoft {words} {closed}"
        assert subprocess.run(line, shell=True, env=environment()).returncode == code


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("delay", [0.0, 0.1, 0.2, 0.3, 0.5, 0.8])
def test_ctrl_c_in_the_first_second_is_told_in_a_sentence(delay, scene, tmp_path, start):
    child = start("run", scene, "-o", "out", *LONG)
    wait_for(lambda: heeds_signals(child), child)
    time.sleep(delay)
    child.send_signal(signal.SIGINT)
    child.send_signal(signal.SIGINT)
    _, error = child.communicate(timeout=300)
    assert child.returncode == 130
    # The scene's warnings may have been told by then; the stop is told once, after them.
    *before, last = error.splitlines()
    assert last.startswith("tisoft: error: interrupted")
    assert all(line.startswith("tisoft: warning: ") for line in before)


def test_a_stop_that_a_library_swallows_comes_all_the_same(scene, capsys, monkeypatch):
    from tisoft.commands import common

    prepare = common.simulation_of

    def swallow(*arguments, **options):
        try:
            signal.raise_signal(signal.SIGTERM)
        except BaseException:
            return prepare(*arguments, **options)

    monkeypatch.setattr(common, "simulation_of", swallow)
    assert main(["run", scene, "--quiet"]) == 143
    assert "ended by SIGTERM" in capsys.readouterr().err


def test_a_stop_that_a_library_turns_into_an_error_is_a_stop(scene, tmp_path, monkeypatch, capsys):
    from tisoft.study import pictures

    save = pictures.save

    def turn(axis, place):
        if axis.name == "poisson":
            try:
                signal.raise_signal(signal.SIGTERM)
            except BaseException:
                raise ValueError("the backend has no figure") from None
        save(axis, place)

    monkeypatch.setattr(pictures, "save", turn)
    out = tmp_path / "map"
    asked = ["stability", scene, "-o", str(out), "--only", "step-damping,poisson", "--quiet"]
    assert main(asked) == 143
    assert capsys.readouterr().err == "tisoft: error: ended by SIGTERM\n"
    assert json.loads((out / "tisoft.json").read_text())["state"] == "interrupted"
    result = json.loads((out / "summary.json").read_text())
    assert result["status"] == "interrupted" and list(result["axes"]) == ["step-damping"]


def test_a_frame_that_takes_too_long_is_cut(scene, tmp_path, monkeypatch):
    from tisoft.simulation import Simulation

    make = Simulation.make_frame

    def slow(self, **asked):
        if self.frame == 3:
            signal.raise_signal(signal.SIGTERM)
            time.sleep(30.0)
        return make(self, **asked)

    monkeypatch.setattr(stops, "PATIENCE", 0.05)
    monkeypatch.setattr(Simulation, "make_frame", slow)
    begun = time.monotonic()
    assert main(["run", scene, "-o", str(tmp_path / "out"), "--quiet"]) == 143
    assert time.monotonic() - begun < 20.0
    assert_kept(tmp_path / "out")


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_that_the_parent_ignores_stays_ignored(number, scene, tmp_path, monkeypatch):
    press_at(monkeypatch, 3, number)
    before = signal.signal(number, signal.SIG_IGN)
    try:
        assert main(["run", scene, "-o", str(tmp_path / "out"), "--quiet"]) == 0
        assert signal.getsignal(number) is signal.SIG_IGN
    finally:
        signal.signal(number, before)
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["frames"] == 10


@pytest.mark.skipif(sys.platform == "win32", reason="needs a terminal")
def test_a_closed_terminal_keeps_everything(scene, tmp_path, start):
    import fcntl
    import pty
    import termios

    master, slave = pty.openpty()

    def take_terminal():
        os.setsid()
        fcntl.ioctl(slave, termios.TIOCSCTTY, 0)

    ends = {"stdin": slave, "stdout": slave, "stderr": slave}
    child = start("run", scene, "-o", "out", *LONG, preexec_fn=take_terminal, **ends)
    os.close(slave)
    table = tmp_path / "out" / "probes.csv"
    wait_for(lambda: table.exists() and table.stat().st_size > 300, child)
    os.close(master)
    assert child.wait(timeout=300) == 129
    assert_kept(tmp_path / "out")


def test_after_sigkill_the_tables_are_there_and_the_run_goes_on(scene, tmp_path, start):
    whole, out = tmp_path / "whole", tmp_path / "out"
    often = "from tisoft.observers import checkpoints as c; c.INTERVAL = c.MOST_SHARE = 0.0; "
    program = f"{often} from tisoft.cli import program; program()"
    run = [sys.executable, "-c", program, "run", scene, "--quiet", "--set", "duration=20", "-o"]
    child = subprocess.Popen([*run, str(out)], env=environment())
    wait_for(
        lambda: (out / "checkpoint.npz").exists() and len(rows_of(out / "probes.csv")) > 8, child
    )
    child.kill()
    child.wait()
    rows = rows_of(out / "probes.csv")
    assert len(rows) > 8 and {len(row) for row in rows} == {4}
    assert json.loads((out / "tisoft.json").read_text())["state"] == "running"
    same = ["--quiet", "--set", "duration=20"]
    assert main(["run", scene, "-o", str(out), *same]) == 2  # unfinished
    assert main(["run", scene, "-o", str(out), *same, "--resume"]) == 0
    assert main(["run", scene, "-o", str(whole), *same]) == 0
    for name in ("probes.csv", "energy.csv"):
        assert (out / name).read_bytes() == (whole / name).read_bytes()


def test_a_signal_waits_for_the_outermost_file():
    seen = []

    def work():
        with stops.held():
            with stops.held():
                signal.raise_signal(signal.SIGTERM)
            seen.append("inner")
        seen.append("outer")
        return 0

    assert stops.heeding(work, lambda told, code: code) == 143
    assert seen == ["inner"]
