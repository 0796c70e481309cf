"""Sweeps: `sweep(scene, over={"young": [1e4, 1e5]})`, each combination a row with its summary."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tisoft import checks
from tisoft.changes import scene_with
from tisoft.checks import FieldError, shown
from tisoft.errors import SceneError
from tisoft.scene import Scene
from tisoft.scene_keys import toml_value
from tisoft.sweeping import cluster, table
from tisoft.sweeping.plan import Plan, axes_of, plan_of
from tisoft.sweeping.work import Job, compute

__all__ = ["Sweep", "jobs_of", "run_jobs", "sweep"]

TABLE_EVERY = 5.0
"""Seconds between two tables while rows come in."""


@dataclass(frozen=True)
class Sweep:
    """The rows of a sweep, in the order of its plan."""

    rows: list[dict[str, Any]]
    """Keys and numbers of each row, by column."""

    def table(self) -> Any:
        """The rows as a pandas DataFrame; raises SceneError where pandas is missing."""
        try:
            import pandas
        except ImportError:
            raise SceneError("table() needs pandas; install it, or use .rows") from None
        return pandas.DataFrame(self.rows, columns=table.columns_of(self.rows))


def sweep(
    scene: str | Path | Scene,
    over: Mapping[str, Any],
    *,
    random: int | None = None,
    seed: int = 0,
    output: str | Path | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
) -> Sweep:
    """Run a scene with every combination of values of its keys.

    Args:
        scene: a scene file, or a Scene.
        over: key → list of values, or a range as "1e4..1e6" (with `random`).
        random: draw so many rows instead of all combinations.
        seed: of the draws.
        output: a folder for sweep.csv, from where a second call goes on.
        workers: processes of this machine (needs Dask).
        scheduler: the address of a Dask scheduler.

    Raises:
        SceneError: an unknown key, a scene that cannot be read, Dask missing.
    """
    if not isinstance(scene, Scene):
        checks.path("scene", scene, "a scene file")
    if not isinstance(over, Mapping):
        raise FieldError("over", 'must be a table, as {"young": [1e4, 1e5]}', over)
    if random is not None:
        checks.integer("random", random, least=1)
    checks.integer("seed", seed, least=0)
    if workers is not None:
        checks.integer("workers", workers, least=1)
    if scheduler is not None:
        checks.name("scheduler", scheduler.replace("/", "") if isinstance(scheduler, str) else 0)
    cluster.prepare(workers)
    plan = plan_of(axes_of(over), random=random, seed=seed)
    jobs = jobs_of(scene, plan, threads=cluster.threads_for(workers))
    folder = None if output is None else checks.path("output", output, "a folder")
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    return Sweep(run_jobs(plan, jobs, folder, workers=workers, scheduler=scheduler))


def jobs_of(
    source: str | Path | Scene,
    plan: Plan,
    *,
    settings: Sequence[str] = (),
    arch: str = "cpu",
    precision: str | None = None,
    threads: int | None = None,
) -> list[Job]:
    """The jobs of a plan, whose keys are known to the scene; raises SceneError."""
    own = source if isinstance(source, Scene) else str(source)
    bodies = len(scene_with(own, settings).bodies)
    for k in range(len(plan.axes)):
        _check_key(own, plan, k, [*settings], bodies)
    return [
        Job(own, (*settings, *plan.settings(row, bodies)), arch, precision, threads)
        for row in plan.rows
    ]


def _check_key(source: str | Scene, plan: Plan, k: int, settings: list[str], bodies: int) -> None:
    """Refuse a key that no scene has; a wrong value is a row's own failure."""
    alone = Plan((plan.axes[k],), ())
    try:
        scene_with(source, settings + alone.settings([plan.rows[0][k]], bodies))
    except SceneError as error:
        words = ("is not a key that tisoft knows", "is out of range", "it must be KEY=VALUE",
                 "is a single value and has no key", "is a list: write")  # fmt: skip
        if any(word in str(error) for word in words):
            raise SceneError(f"--over {shown(plan.axes[k].key)}: {error}") from None


def run_jobs(
    plan: Plan,
    jobs: Sequence[Job],
    folder: Path | None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    tick: Callable[[int], Any] = lambda done: None,
) -> list[dict[str, Any]]:
    """All rows in the order of the plan; those in the folder's journal are not computed again."""
    keys = [job.key() for job in jobs]
    journal = table.Journal(folder / table.JOURNAL) if folder is not None else None
    rows: dict[str, dict[str, Any]] = journal.rows if journal is not None else {}
    numbers = {key: n for n, key in reversed(list(enumerate(keys))) if key not in rows}
    todo = sorted(numbers.values())
    tick(len(jobs) - len(todo))

    def whole() -> list[dict[str, Any]]:
        return [
            _row(n, plan, rows[key]) for n, key in enumerate(keys) if key in rows
        ]  # fmt: skip

    written = time.monotonic()
    try:
        results = cluster.each(
            compute, [jobs[n] for n in todo], workers=workers, scheduler=scheduler
        )
        for place, row in results:
            key = keys[todo[place]]
            if journal is not None:
                journal.add(key, row)
            else:
                rows[key] = row
            tick(1)
            if folder is not None and time.monotonic() - written > TABLE_EVERY:
                table.write_csv(folder / table.CSV, whole())
                written = time.monotonic()
    finally:
        if folder is not None and journal is not None:
            journal.close()
            table.write_csv(folder / table.CSV, whole())
    if folder is not None and not table.write_parquet(folder / table.PARQUET, whole()):
        table.remove_if_there(folder / table.PARQUET)
    return whole()


def _row(number: int, plan: Plan, row: dict[str, Any]) -> dict[str, Any]:
    """A row with its number and its values in front."""
    values = [toml_value(value) for value in plan.rows[number]]
    shown = [v if isinstance(v, int | float | str | bool) else str(v) for v in values]
    return {"row": number} | dict(zip((a.key for a in plan.axes), shown, strict=True)) | row
