"""Answers about variants from other processes or machines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from tisoft import runtime
from tisoft.charting.places import Place
from tisoft.charting.records import Bench
from tisoft.charting.variants import Variant
from tisoft.scene import Scene
from tisoft.sweeping.cluster import each, threads_for


@dataclass(frozen=True)
class Question:
    """What a worker is asked."""

    source: str | Scene
    places: list[Place]
    variant: Variant
    what: str
    threads: int | None


def answer(question: Question) -> dict[str, Any]:
    """What the worker says."""
    runtime.import_taichi()
    runtime.start("cpu", threads=question.threads)
    return Bench(question.source, question.places, {}).ask(question.what, question.variant)


def spread(
    bench: Bench,
    jobs: Sequence[tuple[Variant, str]],
    workers: dict[str, Any],
    goes_on: Callable[[], bool],
    tick: Callable[[str], Any],
) -> None:
    """Keep the workers' answers, in the order in which they come, while `goes_on` says so."""
    threads = threads_for(workers.get("workers"))
    asked = [Question(bench.source, bench.places, v, what, threads) for v, what in jobs]
    for number, found in each(answer, asked, **workers):
        variant, what = jobs[number]
        if found.get("status") != "failed":
            bench.record(variant)[what] = found
            tick(variant.name)
        if not goes_on():
            break
