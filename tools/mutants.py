"""Mutation run: which one-line changes of the source would no test notice?

    python tools/mutants.py laws stable               # folders of tisoft/
    python tools/mutants.py models/laws.py --tests tests/models tests/physics -o laws-mutants

Cosmic Ray finds the places and makes the mutants.  Each is written to disk, in a copy of the source
(Taichi compiles kernels from their files), and meets a fresh pytest process that stops at the first
failure.  The copy has a kernel cache of its own; a kernel's key there is made from its code, so a
mutant is never answered with the original's.

A run that was stopped goes on when it is started again with the same -o; with --again, mutants that
survived meet the tests once more.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from tempfile import mkdtemp

ROOT = Path(__file__).resolve().parents[1]

TESTS = {
    "laws": ["laws", "models", "behaviour/test_followed_step.py", "physics/test_one_tet.py",
             "physics/test_neo_hookean.py", "dynamics/test_forces.py", "physics"],
    "elements": ["dynamics/test_forces.py", "models", "physics/test_one_tet.py",
                 "physics/test_springs.py", "behaviour", "physics", "dynamics"],
    "step": ["behaviour", "physics/test_contact.py", "physics/test_changes.py", "dynamics",
             "physics"],
    "step/account.py": ["dynamics/test_ledger.py", "behaviour/test_times_and_work.py"],
    "step/consistent_mass.py": ["physics/test_consistent_mass.py"],
    "step/contact.py": ["physics/test_contact.py"],
    "step/driving.py": ["behaviour/test_times_and_work.py", "dynamics/test_loading.py",
                        "physics/test_contact.py"],
    "step/explicit_euler.py": ["physics/test_time_orders.py", "dynamics/test_ledger.py"],
    "step/external.py": ["behaviour/test_grab.py", "dynamics/test_loading.py",
                         "physics/test_drop.py"],
    "step/fixed.py": ["behaviour/test_times_and_work.py", "physics/test_contact.py"],
    "step/forces.py": ["dynamics/test_forces.py", "behaviour/test_laws.py",
                       "physics/test_determinism.py"],
    "step/grab.py": ["behaviour/test_grab.py"],
    "step/launches.py": ["dynamics/test_gpu.py"],
    "step/ledger.py": ["dynamics/test_ledger.py", "behaviour/test_times_and_work.py",
                       "physics/test_contact.py", "touch"],
    "step/loading.py": ["dynamics/test_loading.py", "behaviour/test_times_and_work.py"],
    "step/means.py": ["physics/test_cage.py"],
    "step/meeting.py": ["touch"],
    "step/observe.py": ["dynamics/test_forces.py", "behaviour/test_results.py"],
    "step/pace.py": ["dynamics/test_pace.py", "physics/test_determinism.py"],
    "step/passes.py": ["physics/test_time_orders.py", "physics/test_determinism.py",
                       "physics/test_consistent_mass.py", "dynamics/test_ledger.py",
                       "behaviour/test_grab.py", "physics/test_touch.py",
                       "physics/test_cage.py"],
    "step/patches.py": ["physics/test_cage.py"],
    "step/pins.py": ["behaviour/test_times_and_work.py", "physics/test_changes.py"],
    "step/record.py": ["behaviour/test_results.py", "dynamics/test_ledger.py",
                       "behaviour/test_guard.py"],
    "step/schedule.py": ["behaviour/test_times_and_work.py", "dynamics/test_loading.py",
                         "physics/test_contact.py"],
    "step/stepper.py": ["dynamics/test_forces.py", "behaviour/test_guard.py",
                        "physics/test_determinism.py", "behaviour/test_resumed.py",
                        "dynamics/test_pace.py"],
    "step/substep.py": ["physics/test_time_orders.py", "dynamics/test_forces.py",
                        "physics/test_consistent_mass.py", "behaviour/test_followed_step.py"],
    "step/symplectic_euler.py": ["physics/test_time_orders.py", "dynamics/test_ledger.py",
                                 "physics/test_contact.py"],
    "step/touch.py": ["physics/test_touch.py", "physics/test_cage.py"],
    "step/velocity_verlet.py": ["physics/test_time_orders.py", "dynamics/test_ledger.py",
                                "physics/test_contact.py"],
    "stable": ["behaviour/test_followed_step.py", "behaviour/test_guard.py", "test_warnings.py",
               "dynamics/test_sharp_step.py", "dynamics/test_twins.py",
               "physics/test_stable_step.py", "behaviour", "guard"],
    "observers": ["behaviour/test_results.py", "behaviour/test_drawn_scenes.py", "observers",
                  "test_observers.py", "test_films.py"],
    "observers/checkpoints.py": ["observers/test_on_disk.py", "lost/test_folders.py",
                                 "test_nothing_lost.py", "test_resume.py"],
    "observers/film.py": ["test_films.py", "test_observers.py"],
    "observers/framing.py": ["test_films.py", "test_observers.py",
                             "behaviour/test_drawn_scenes.py"],
    "observers/progress.py": ["lost/test_folders.py", "lost/test_stops.py",
                              "test_nothing_lost.py", "test_cli.py"],
    "observers/quantities.py": ["test_observers.py", "behaviour/test_drawn_scenes.py"],
    "observers/region_colors.py": ["test_observers.py"],
    "observers/saved.py": ["test_films.py", "observers/test_vtu.py"],
    "observers/scenery.py": ["test_films.py", "behaviour/test_drawn_scenes.py",
                             "test_observers.py"],
    "observers/summary.py": ["behaviour/test_results.py", "test_cli.py"],
    "observers/tables.py": ["observers/test_on_disk.py", "behaviour/test_results.py",
                            "lost/test_folders.py", "dynamics/test_told.py",
                            "test_nothing_lost.py"],
    "observers/track.py": ["test_films.py", "test_observers.py"],
    "observers/vtu.py": ["observers/test_vtu.py", "test_films.py", "behaviour/test_results.py"],
}  # fmt: skip
"""Tests of a folder, or of one of its files, in the order in which they run: those that kill
soonest first."""

KEPT = re.compile(
    r"core/(NumberReplacer|ReplaceTrueWithFalse|ReplaceFalseWithTrue|ReplaceAndWithOr"
    r"|ReplaceOrWithAnd|ReplaceBreakWithContinue|ReplaceContinueWithBreak|ZeroIterationForLoop"
    r"|AddNot|ReplaceUnaryOperator_(USub_UAdd|Delete_USub|Delete_Not)"
    r"|ReplaceBinaryOperator_(Add_Sub|Sub_Add|Mul_Div|Div_Mul|FloorDiv_Mul|Mod_Mul|Pow_Mul)"
    r"|ReplaceComparisonOperator_(Lt_LtE|LtE_Lt|Gt_GtE|GtE_Gt|Lt_Gt|Gt_Lt|Eq_NotEq|NotEq_Eq"
    r"|Is_IsNot|IsNot_Is))$"
)
"""One or two mutants a place.  Left out: others of the same operator, which the same tests kill,
and those that change annotations or do not compile."""


def main() -> int:
    options = _options()
    try:
        from cosmic_ray.work_db import use_db
    except ImportError:
        return _refused("Cosmic Ray is missing; install it with: pip install -e '.[dev]'")
    modules = _modules(options.places)
    if isinstance(modules, str):
        return _refused(modules)
    tests = {module: options.tests or _tests_of(module) for module in modules}
    if not all(tests.values()):
        return _refused("no tests are known for these places; name them with --tests")
    missing = [test for test in options.tests or [] if not (ROOT / test).exists()]
    if missing:
        return _refused(f"{missing[0]} does not exist; --tests takes files and folders")
    folder = Path(options.output or mkdtemp(prefix="tisoft-mutants-"))
    folder.mkdir(parents=True, exist_ok=True)
    with use_db(folder / "session.sqlite") as database:
        if not database.num_work_items:
            _fill(database, modules, options)
        try:
            _run(database, folder, tests, options)
        except BrokenProcessPool:  # its process has said why
            return 2
        finally:
            for copy in folder.glob("copy-*"):
                shutil.rmtree(copy)
        return _report(database, folder)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("places", nargs="+", help="folders or files, seen from tisoft/")
    parser.add_argument("--tests", nargs="+", help="tests that must kill; those that do so first")
    parser.add_argument("-o", dest="output", help="folder to work in, and to go on from")
    parser.add_argument("--sample", type=int, help="so many mutants, drawn evenly")
    parser.add_argument("--seed", type=int, default=1, help="of the draw")
    parser.add_argument("--jobs", type=int, default=1, help="processes, each with its own copy")
    parser.add_argument("--again", action="store_true", help="try those again that survived")
    parser.add_argument("--minutes", type=float, default=1e9, help="stop after so long")
    return parser.parse_args()


def _refused(sentence: str) -> int:
    print(f"mutants: {sentence}", file=sys.stderr)
    return 2


def _modules(places: list[str]) -> list[Path] | str:
    """Paths seen from the root, or what is wrong with a place."""
    found: list[Path] = []
    for place in places:
        path = ROOT / "tisoft" / place
        if not path.exists():
            return f"{place} is not in tisoft/; give folders or files there, as stable or cli.py"
        files = [path] if path.is_file() else sorted(path.rglob("*.py"))
        found += [file.relative_to(ROOT) for file in files]
    return found


def _tests_of(module: Path) -> list[str]:
    """The tests that belong to a file, or else to its folder."""
    place = module.relative_to("tisoft")
    known = TESTS.get(place.as_posix()) or TESTS.get(place.parts[0], [])
    return [f"tests/{test}" for test in known if (ROOT / "tests" / test).exists()]


def _fill(database, modules: list[Path], options: argparse.Namespace) -> None:
    """Make the list of mutants, fewer where a sample is asked for."""
    from cosmic_ray.commands.init import init
    from cosmic_ray.work_item import WorkerOutcome, WorkResult

    os.chdir(ROOT)
    init(modules, database, {})
    items = sorted(database.work_items, key=lambda item: _key(item.mutations[0]))
    kept = [item for item in items if KEPT.match(item.mutations[0].operator_name)]
    if options.sample is not None and options.sample < len(kept):
        kept = random.Random(options.seed).sample(kept, options.sample)
    left_out = {item.job_id for item in items} - {item.job_id for item in kept}
    skipped = WorkResult(worker_outcome=WorkerOutcome.SKIPPED)
    database.set_multiple_results(left_out, skipped)


def _key(mutation):
    return (
        str(mutation.module_path),
        mutation.start_pos,
        mutation.operator_name,
        mutation.occurrence,
    )


def _run(database, folder: Path, tests: dict[Path, list[str]], options) -> None:
    pending = list(database.pending_work_items)
    if options.again:
        pending += [item for item, result in _tried(database) if not result.is_killed]
    pending.sort(key=lambda item: item.job_id)
    if not pending:
        return
    end = time.monotonic() + 60.0 * options.minutes
    lists = [tests[Path(item.mutations[0].module_path)] for item in pending]
    every = list(dict.fromkeys(test for each in lists for test in each))
    print(f"{len(pending)} mutants; {' '.join(every)}", flush=True)
    with ProcessPoolExecutor(options.jobs, initializer=_begin, initargs=(folder, every)) as pool:
        jobs = pool.map(_try, pending, lists, [end] * len(pending))
        try:
            for number, (item, result) in enumerate(zip(pending, jobs, strict=True), 1):
                if result is None:
                    continue
                database.set_result(item.job_id, result)
                if not result.is_killed:
                    print(f"[{number}/{len(pending)}] survived {_shown(item, result)}", flush=True)
        except KeyboardInterrupt:
            print("ending after the mutants at work", file=sys.stderr)
            pool.shutdown(cancel_futures=True)


def _begin(folder: Path, tests: list[str]) -> None:
    """Make this process's copy of the source, fill its kernel cache, and time the tests."""
    global _limit
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the first process's to answer
    copy = folder / f"copy-{os.getpid()}"
    copy.mkdir()
    for name in ("tisoft", "tests", "assets", "demos", "docs"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, copy / name, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", copy)
    os.chdir(copy)
    os.environ["PYTHONPATH"] = str(copy)
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
    os.environ["TI_OFFLINE_CACHE_FILE_PATH"] = str(copy / "kernels")
    seen = subprocess.check_output([sys.executable, "-c", "import tisoft; print(tisoft.__file__)"])
    if not seen.decode().startswith(str(copy)):
        _stop(f"Python imports tisoft from {seen.decode().strip()}, not from the copy in {copy}")
    for _ in range(2):  # the second time with compiled kernels
        begun = time.monotonic()
        if subprocess.run(_command(tests), capture_output=True).returncode:
            _stop(f"without any mutant these tests fail: {' '.join(tests)}; mend them first")
    _limit = 30.0 + 5.0 * (time.monotonic() - begun)


def _command(tests: list[str]) -> list[str]:
    command = [sys.executable, "-m", "pytest", "-n", "0", "-x", "-q", "--tb=no"]
    return [*command, "-p", "no:cacheprovider", *tests]


def _stop(sentence: str) -> None:
    """End this process, and with it the run."""
    print(f"mutants: {sentence}", file=sys.stderr, flush=True)
    os._exit(2)  # an exception here would be logged with its traceback


def _try(item, tests: list[str], end: float):
    """The result of one mutant; None where the time is up."""
    from cosmic_ray.mutating import mutate_and_test

    if time.monotonic() > end:
        return None
    command = " ".join(f"'{word}'" for word in _command(tests))
    return mutate_and_test(item.mutations, command, _limit)


def _shown(item, result) -> str:
    """Where a mutant is, and its changed lines."""
    mutation = item.mutations[0]
    lines = [
        f"    {line}"
        for line in (result.diff or "").splitlines()
        if line[:1] in "+-" and line[:3] not in ("+++", "---")
    ]
    return "\n".join([f"{mutation.module_path}:{mutation.start_pos[0]}", *lines])


def _tried(database) -> list:
    """Mutants that were tried, and what came of each."""
    from cosmic_ray.work_item import WorkerOutcome

    return [
        (item, result)
        for item, result in database.completed_work_items
        if result.worker_outcome != WorkerOutcome.SKIPPED
    ]


def _report(database, folder: Path) -> int:
    done = _tried(database)
    alive = sorted((i for i in done if not i[1].is_killed), key=lambda i: _key(i[0].mutations[0]))
    left = len(database.pending_work_items)
    print(f"\n{len(done)} mutants, {len(done) - len(alive)} killed, {len(alive)} survived", end="")
    print(f" ({left} not tried; go on with -o {folder})" if left else "")
    for item, result in alive:
        print(_shown(item, result))
    return 0


if __name__ == "__main__":
    sys.exit(main())
