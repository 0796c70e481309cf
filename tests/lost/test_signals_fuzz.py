"""Signals at random moments: whatever a command was doing, what lies there is whole.

The seed is fixed; TISOFT_SEED chooses another.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from stopping import environment

CASES = Path(__file__).with_name("signal_cases.py")


def cases(folder, count, commands):
    """What became of so many cases in a process of their own."""
    seed = os.environ.get("TISOFT_SEED", "1")
    done = subprocess.run(
        [sys.executable, str(CASES), str(folder), str(count), seed, commands],
        env=environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(found) == count
    return found


def assert_nothing_was_lost(found):
    problems = [case for case in found if case["problem"]]
    assert not problems, "\n".join(f"{case}\n{case['problem']}" for case in problems)
    stopped = [case for case in found if case["code"]]
    assert len(stopped) > len(found) / 4  # the others had come to their end


def resumed(found):
    return sum(case.get("resumed", False) for case in found)


@pytest.mark.slow
def test_signals_at_random_moments_of_every_command_that_writes(tmp_path):
    found = cases(tmp_path, 22 * int(os.environ.get("TISOFT_THOROUGH", "1")), "")
    for more in range(3):  # beside others' load moments fall otherwise, and few runs may go on
        if resumed(found) > 2:
            break
        (tmp_path / str(more)).mkdir()
        found += cases(tmp_path / str(more), 8, "run")
    assert_nothing_was_lost(found)
    assert resumed(found) > 2
