"""How many threads the next launch takes, found by timing: the count changes speed, never a bit."""

from __future__ import annotations

import numpy as np

CELLS_PER_THREAD = 150
TOUCHING = 5
"""Times as many cells that a thread must have where surfaces may touch: sweeps of contact meet at
many barriers, so a thread must have much to do between two.
"""
SPRINGS_PER_TET = 3
"""Springs that cost about as much as one tet."""
TRIAL, TRIAL_WORK = 4, 10_000
"""Substeps, or cell-substeps, of the launch that tries several threads again: so many that calling
them does not count, so few that waiting for a busy core does not hurt."""
LONGEST_WAIT = 64
"""Launches with one thread at the most before several are tried again: a trial is so short beside
them that even a hundredfold wait for a core costs little."""
RARER = 4
"""How many times as long the next one waits after each trial that was too slow."""
RENEWED = 256
"""Launches with several threads, after which one runs alone to tell what alone costs by then."""
SLOWER = 1.2
"""Several threads give way to one when a substep takes so many times as long."""


def work_of(cells: int, springs: int) -> int:
    """What so many cost, in cells."""
    return cells + springs // SPRINGS_PER_TET


def most_threads(work: int, parts: int, pool: int, *, touches: bool = False) -> int:
    """Threads that are worth it at the most.

    Args:
        work: of a substep, in cells.
        parts: pieces that threads share; another thread would only wait.
        pool: threads that there are.
        touches: whether surfaces may touch.
    """
    least = CELLS_PER_THREAD * (TOUCHING if touches else 1)
    return max(1, min(pool, work // least, parts))


class Pace:
    """Chooses between one thread and several.

    Threads meet at barriers, so on a busy machine one that must wait for a core makes all wait.
    Where several threads turn out slower than one was a moment ago, one takes over for a while,
    each time for longer.  A neighbour that slows both is no reason: after each launch that was too
    slow, the next one runs alone and says what alone costs *now*.
    """

    def __init__(self, most: int) -> None:
        self.most = most
        self.alone = np.inf  # seconds per substep of the last launch with one thread
        self.penalty = 1
        self.trial = most > 1
        self.together = 0  # launches with several threads since one ran alone
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
            self.alone = seconds
            self.wait, self.together = self.wait - 1, 0
        elif seconds <= SLOWER * self.alone:
            self.penalty, self.trial = 1, False
            self.together += 1
            self.wait = int(self.together == RENEWED)
        else:
            self.wait, self.trial = self.penalty, True
            self.penalty = min(RARER * self.penalty, LONGEST_WAIT)
