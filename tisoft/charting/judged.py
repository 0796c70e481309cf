"""A variant with its cost and errors, and which of several none beats in both."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

from tisoft.charting.estimate import Error


@dataclass(frozen=True)
class Judged:
    """A variant with its cost and its errors."""

    name: str
    settings: tuple[str, ...]
    """Beyond those of the command line: what --set takes."""
    model: str
    element: str
    elements: int
    nodes: int
    step: float
    """[s]"""
    stable_step: float
    """[s]"""
    cost: float
    """Seconds of computing a simulated second."""
    errors: dict[str, Error]
    """By quantity: sag, frequency, path; those that the scene has."""
    timed: bool = True
    """Whether the cost was timed, not predicted from that of others."""
    ran: bool = False
    """Whether the path was run, not predicted from sag and frequency."""
    decides: tuple[str, ...] = ("sag", "frequency")
    """Quantities whose errors count."""
    current: bool = False
    pareto: bool = False

    @property
    def worst(self) -> Error:
        """The largest of the errors that count, by its bar's end; inf where none is known."""
        own = [self.errors[k] for k in self.decides if k in self.errors]
        return max(own, key=lambda e: e.most, default=Error(math.inf, 0.0))

    @property
    def likely(self) -> float:
        """The largest of the errors that count, without bars; inf where none is known."""
        return self._largest(0.0)

    @property
    def least(self) -> float:
        """What it errs by at the least, whatever the bars hide; inf where none is known."""
        return self._largest(1.0)

    def _largest(self, bars: float) -> float:
        own = [self.errors[k] for k in self.decides if k in self.errors]
        return max((e.value - bars * e.bar for e in own), default=math.inf)

    @property
    def shown(self) -> float:
        """The error at which it is drawn: where the bar hides it, the bar's end."""
        return self.worst.most if self.worst.below else self.worst.value


def with_pareto(judged: Sequence[Judged]) -> list[Judged]:
    """The variants, marked where none is both cheaper and better."""
    return [
        dataclasses.replace(
            one,
            pareto=not any(_beats(other, one) for other in judged),
        )
        for one in judged
    ]


def _beats(other: Judged, one: Judged) -> bool:
    """Whether another is at no higher a cost no worse, and better in one of the two."""
    mine, its = (one.cost, one.worst.most), (other.cost, other.worst.most)
    return its[0] <= mine[0] and its[1] <= mine[1] and its != mine
