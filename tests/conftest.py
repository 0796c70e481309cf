"""Ctrl-C as in a terminal, also where the parent ignores it: nohup, a job in the background; tests
of a device only where they are asked for: -m gpu; and files with slow tests before all others, so
that in the end no process works on a long one while the others have nothing left.
"""

import signal
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # for the helpers beside the tests

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(config, items):
    if "gpu" not in config.option.markexpr:
        asked = [item for item in items if item.get_closest_marker("gpu") is None]
        config.hook.pytest_deselected(items=[item for item in items if item not in asked])
        items[:] = asked
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)
