"""Room for rows in Taichi fields, lent in ranges, so that scenes share fields and kernels.

Kernels close over the fields they touch, and Taichi compiles them once per set of fields.  So a
field is made with more rows than the first scene needs, the next scene gets other rows of it, and
what a dead scene leaves is given to the next: the second scene of a structure compiles nothing.
"""

from __future__ import annotations

import bisect
import gc
import os
from collections.abc import Callable
from typing import Any

from tisoft import runtime
from tisoft.errors import SceneError

MOST_TREES = 480
"""Taichi stops at 512 trees of fields."""
SPARE = 2.0
"""Rows that a new arena has, as a multiple of what its first tenant needs, while that is little."""
LARGE = 64 << 20
"""Bytes above which an arena is made no larger than needed."""


class Shelf:
    """Free ranges of one kind of rows; the first that fits is taken.

    The garbage collector ends simulations that nobody holds whenever it runs, within `take` as
    well: what is given back waits until the ranges are looked at next.
    """

    def __init__(self, rows: int) -> None:
        self.rows = rows
        self._free = [(0, rows)]
        self._returned: list[tuple[int, int]] = []

    @property
    def is_empty(self) -> bool:
        """Whether nothing is lent."""
        self._settle()
        return self._free == [(0, self.rows)]

    def place(self, count: int) -> int | None:
        """Where `count` rows would go, or None."""
        self._settle()
        if not count:
            return 0
        return next((start for start, end in self._free if end - start >= count), None)

    def take(self, count: int) -> int:
        """Lend `count` rows; returns the first."""
        if not count:
            return 0
        start = self.place(count)
        assert start is not None
        k = next(k for k, (low, _) in enumerate(self._free) if low == start)
        low, end = self._free[k]
        self._free[k : k + 1] = [(low + count, end)] if low + count < end else []
        return start

    def give_back(self, start: int, count: int) -> None:
        """Rows start .. start + count − 1 are free again."""
        if count:
            self._returned.append((start, start + count))

    def _settle(self) -> None:
        """Join what was given back to what is free."""
        if not self._returned:
            return
        while self._returned:
            bisect.insort(self._free, self._returned.pop())
        joined: list[tuple[int, int]] = []
        for low, end in self._free:
            if joined and joined[-1][1] == low:
                joined[-1] = (joined[-1][0], end)
            else:
                joined.append((low, end))
        self._free = joined


class Arena:
    """One set of fields; `rows` says how many of each kind it has."""

    def __init__(self, fields: Any, rows: dict[str, int]) -> None:
        self.fields = fields
        self.shelves = {kind: Shelf(count) for kind, count in rows.items()}
        self.kernels: dict[Any, Any] = {}
        """What was compiled for these fields, by what else it closes over."""

    def kernel(self, key: tuple[Any, ...], make: Callable[[], Any]) -> Any:
        """The kernel of a key; `make` makes it the first time."""
        if key not in self.kernels:
            self.kernels[key] = runtime.timed(make())
        return self.kernels[key]

    def fits(self, needs: dict[str, int]) -> bool:
        """Whether all that is needed is free."""
        return all(self.shelves[kind].place(count) is not None for kind, count in needs.items())

    @property
    def is_empty(self) -> bool:
        """Whether nobody uses it."""
        return all(shelf.is_empty for shelf in self.shelves.values())


class Lease:
    """Rows of an arena, until it is ended."""

    def __init__(self, arena: Arena, needs: dict[str, int]) -> None:
        self.arena = arena
        self.counts = dict(needs)
        self.starts = {kind: arena.shelves[kind].take(count) for kind, count in needs.items()}
        self._is_over = False

    @property
    def fields(self) -> Any:
        """The arena's fields."""
        return self.arena.fields

    def end(self) -> None:
        """Give all rows back."""
        if not self._is_over:
            self._is_over = True
            for kind, start in self.starts.items():
                self.arena.shelves[kind].give_back(start, self.counts[kind])


class Pool:
    """All arenas of this start of Taichi, by the structure of their fields."""

    def __init__(self) -> None:
        self.arenas: dict[Any, list[Arena]] = {}
        self.made = 0
        """Sets of fields made so far."""

    def lend(self, kind: Any, structure: Any, needs: dict[str, int]) -> Lease:
        """Rows of fields `kind(structure, rows)` for a scene; made where none are free.

        Raises:
            SceneError: fields that would not fit into memory.
        """
        key = (kind, structure)
        arena = self._free(key, needs)
        if arena is None and key in self.arenas:
            gc.collect()  # a simulation that nobody holds may still wait for it
            arena = self._free(key, needs)
        if arena is not None:
            return Lease(arena, needs)
        self._sweep()
        rows = _rows(kind, structure, needs)
        fields = kind(structure, rows)
        self.made += 1
        arena = Arena(fields, rows)
        self.arenas.setdefault(key, []).append(arena)
        return Lease(arena, needs)

    def _free(self, key: Any, needs: dict[str, int]) -> Arena | None:
        return next((a for a in self.arenas.get(key, []) if a.fits(needs)), None)

    def _sweep(self) -> None:
        """Free the fields that nobody uses, but for the largest of each structure."""
        trees = sum(len(known) for known in self.arenas.values())
        for structure, known in list(self.arenas.items()):
            largest = max((_size(arena) for arena in known), default=0)
            for arena in [a for a in known if a.is_empty]:
                if _size(arena) < largest or trees >= MOST_TREES:
                    known.remove(arena)
                    self._forget(arena)
                    trees -= 1
            if not known:
                del self.arenas[structure]
        if trees >= MOST_TREES:
            raise SceneError(
                f"{trees} sets of fields are in use by as many running scenes, and Taichi has room "
                "for no more; let go of simulations that are no longer needed"
            )

    def _forget(self, arena: Arena) -> None:
        for known in self.arenas.values():
            for other in known:
                for key in [key for key in other.kernels if arena.fields in key]:
                    del other.kernels[key]
        arena.kernels.clear()
        arena.fields.destroy()


def _size(arena: Arena) -> int:
    return sum(shelf.rows for shelf in arena.shelves.values())


def _rows(kind: Any, structure: Any, needs: dict[str, int]) -> dict[str, int]:
    """Rows of a new arena: some to spare where that costs little memory."""
    least = kind.LEAST
    rows = {k: max(int(SPARE * needs.get(k, 0)), least[k]) for k in least}
    if kind.bytes_of(structure, rows) > LARGE:
        rows = {k: needs.get(k, 0) + min(least[k], 64) for k in least}
    check_memory(kind.bytes_of(structure, rows))
    return rows


def check_memory(size: int) -> None:
    """Raise SceneError where `size` bytes are more than the machine has free now."""
    free = _free_memory()
    if free is not None and size > free:
        raise SceneError(
            f"the scene needs {size / 2**30:.2g} GiB of memory for its fields, and "
            f'{free / 2**30:.2g} GiB are free; use a coarser mesh, or precision = "f32"'
        )


def _free_memory() -> int | None:
    """Bytes that may still be used, where the system tells."""
    try:
        with open("/proc/meminfo") as table:
            rows = dict(line.split(":", 1) for line in table)
        return int(rows["MemAvailable"].split()[0]) * 1024
    except (OSError, KeyError, ValueError):
        pass
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return None
