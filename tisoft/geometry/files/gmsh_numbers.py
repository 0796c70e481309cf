"""The numbers of a section of a Gmsh file, one after the other: as text, or binary."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError
from tisoft.geometry.files.text import numbers, whole

Ints = NDArray[np.int64]
Table = NDArray[Any]


class Section:
    """What both have in common: counts that must agree, and rows of a sort."""

    name: str

    def take(self, count: int, letter: str) -> Table:
        """The next numbers: "i" int, "z" size, "d" double."""
        raise NotImplementedError

    def whole(self, count: int, letter: str) -> Ints:
        """The next whole numbers."""
        return self.integers(self.take(count, letter))

    def integers(self, values: Table) -> Ints:
        """The values as whole numbers."""
        if values.dtype.kind == "f":
            return whole(values, f"${self.name}")
        return values.astype(np.int64)

    def count(self) -> int:
        """How many rows versions 1 and 2 announce."""
        raise NotImplementedError

    def agree(self, counted: int, declared: int) -> None:
        """Refuses a total that is not the announced one."""
        if counted != declared:
            raise MeshError(
                f"${self.name} announces {declared} entries, but holds {counted}; "
                "the file is damaged, write it again"
            )

    def more(self, done: int, declared: int) -> bool:
        """Whether a further row is announced; refuses one that is announced and not there."""
        if done < declared and self._left() <= 0:
            self.agree(done, declared)
        return done < declared

    def short(self, wanted: int, rest: int) -> MeshError:
        """That the section ends too early."""
        return MeshError(
            f"${self.name} announces {wanted} further numbers, but {rest} follow; "
            "the file is cut short or damaged"
        )

    def run(self, fixed: dict[int, int], width: int, most: int) -> Ints:
        """The next rows of so many numbers that have the `fixed` ones in their columns.

        The look ahead doubles, so that many short runs and one long run both cost little.
        """
        look, found = 64, 0
        while True:
            look = min(look, most)
            rows = self._ahead(look, width)
            same = np.ones(len(rows), dtype=bool)
            for column, value in fixed.items():
                same &= rows[:, column] == value
            found = len(rows) if same.all() else int(np.argmin(same))
            if found < len(rows) or len(rows) < look or look == most:
                break
            look *= 4
        if found == 0:
            raise self.short(width, self._left())
        return self.integers(self.take(found * width, "i")).reshape(found, width)

    def _ahead(self, count: int, width: int) -> Table:
        raise NotImplementedError

    def _left(self) -> int:
        raise NotImplementedError


class Text(Section):
    """Numbers of a section of a text file."""

    def __init__(self, text: bytes, name: str) -> None:
        self.text, self.name, self._place = text, name, 0

    @cached_property
    def _numbers(self) -> NDArray[np.float64]:
        return numbers(self.text, f"${self.name}")

    def take(self, count: int, letter: str) -> Table:
        rest = self._left()
        if not 0 <= count <= rest:
            raise self.short(count, rest)
        self._place += count
        return self._numbers[self._place - count : self._place]

    def rows(self, count: int, *fields: tuple[str, int]) -> list[Table]:
        """The next `count` rows, as an array (count, width) for each field (letter, width)."""
        width = sum(columns for _, columns in fields)
        if count < 0 or count * width > self._left():
            kind = {"Nodes": "nodes", "NOD": "nodes"}.get(self.name, "elements")
            raise MeshError(
                f"${self.name} announces {count} further rows of {kind}, but its numbers end "
                f"after {self._left() / width:.4g} of them; the file is cut short or damaged"
            )
        table = self.take(count * width, "d").reshape(count, width)
        ends = np.cumsum([columns for _, columns in fields])[:-1]
        return np.split(table, ends, axis=1)

    def count(self) -> int:
        return int(self.whole(1, "z")[0])

    def peek(self, ahead: int) -> int:
        """The number so many places ahead, which must be whole."""
        if ahead >= self._left():
            raise self.short(ahead + 1, self._left())
        place = self._place + ahead
        return int(self.integers(self._numbers[place : place + 1])[0])

    def close(self) -> None:
        """Refuses numbers beyond the announced ones."""
        if rest := self._left():
            raise MeshError(
                f"${self.name} holds {rest} numbers more than it announces; "
                "the file is damaged, write it again"
            )

    def _ahead(self, count: int, width: int) -> Table:
        count = min(count, self._left() // width)
        return self._numbers[self._place : self._place + count * width].reshape(count, width)

    def _left(self) -> int:
        return len(self._numbers) - self._place


class Binary(Section):
    """Numbers of a section of a binary file, from `place` on."""

    def __init__(self, data: bytes, place: int, name: str, order: str) -> None:
        self._data, self._place, self.name = data, place, name
        self._types = {
            letter: np.dtype(order + kind)
            for letter, kind in (("i", "i4"), ("z", "u8"), ("d", "f8"))
        }

    def take(self, count: int, letter: str) -> Table:
        return self._values(count, self._types[letter])

    def _values(self, count: int, kind: np.dtype[np.generic]) -> Table:
        if not 0 <= count * kind.itemsize <= self._left():
            raise self.short(count, self._left() // kind.itemsize)
        self._place += count * kind.itemsize
        return np.frombuffer(self._data, kind, count, self._place - count * kind.itemsize)

    def rows(self, count: int, *fields: tuple[str, int]) -> list[Table]:
        """The next `count` rows, as an array (count, width) for each field (letter, width)."""
        parts = [(f"f{k}", self._types[c], (width,)) for k, (c, width) in enumerate(fields)]
        table = self._values(count, np.dtype(parts))
        return [table[name] for name, _, _ in parts]

    def count(self) -> int:
        line = self._data.find(b"\n", self._place)
        try:
            declared = int(self._data[self._place : line])
        except ValueError:
            raise MeshError(f"${self.name} does not tell its count; the file is damaged") from None
        self._place = line + 1
        return declared

    def table(self, count: int, width: int) -> Ints:
        """The next rows of ints."""
        return self.whole(count * width, "i").reshape(count, width)

    def same(self, head: tuple[int, ...], width: int, most: int) -> Ints:
        """Rows each of which comes after a head like the one just read; without their heads."""
        self._place -= 4 * len(head)
        rows = self.run(dict(enumerate(head)), len(head) + width, most)
        return rows[:, len(head) :]

    def close(self) -> None:
        """Refuses bytes beyond the announced numbers."""
        if (
            not self._data[self._place : self._place + 64]
            .lstrip()
            .startswith(b"$End" + self.name.encode())
        ):
            raise MeshError(
                f"${self.name} does not end after what it announces; the file is damaged"
            )

    def _ahead(self, count: int, width: int) -> Table:
        count = min(count, self._left() // (4 * width))
        return np.frombuffer(self._data, self._types["i"], count * width, self._place).reshape(
            count, width
        )

    def _left(self) -> int:
        return len(self._data) - self._place
