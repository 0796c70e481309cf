"""How many threads the next launch takes, found by timing: the count changes speed, never a bit."""

from __future__ import annotations

import numpy as np

CELLS_PER_THREAD = 150
TRIAL, TRIAL_WORK = 4, 40_000
"""Substeps, or cell-substeps, of the launch that tries several threads again: so many that calling
them does not count, so few that waiting for a busy core does not hurt."""
LONGEST_WAIT = 4096
"""Launches with one thread at the most before several are tried again."""


class Pace:
    """Chooses between one thread and several.

    Threads meet at barriers, so on a busy machine one that must wait for a core makes all wait.
    Where several threads turn out slower than one, one takes over for a while, twice as long each
    time.
    """

    def __init__(self, most: int) -> None:
        self.most = most
        self.alone = np.inf  # seconds per substep with one thread
        self.penalty = 1
        self.trial = True
        self.wait = 0 if most == 1 else 1  # the first launch runs alone: what others must beat

    def threads(self) -> int:
        """Threads for the next launch."""
        return 1 if self.wait > 0 else self.most

    def is_trial(self) -> bool:
        """Whether the next launch tries several threads again; it should be a short one."""
        return self.wait == 0 and self.trial

    def took(self, threads: int, seconds: float) -> None:
        """Note the seconds per substep of a launch."""
        if threads == 1:
            self.alone = min(seconds, 1.02 * self.alone)
            self.wait -= 1
        elif seconds > 1.2 * self.alone:
            self.wait, self.penalty = self.penalty, min(4 * self.penalty, LONGEST_WAIT)
            self.trial = True
        else:
            self.penalty, self.trial = 1, False
