"""A text file that grows under its own name, by whole rows."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Self

from tisoft import stops
from tisoft.whole_files import refusal


class GrowingFile:
    """Rows in a file that anyone may read meanwhile: whenever its program ends, they are whole.

    Where a row does not fit on the disk, what is there of it is taken back.

    Raises:
        SceneError: it cannot be written.
    """

    def __init__(self, path: Path, *, keep: int = 0) -> None:
        """Open `path`, with its first `keep` bytes only."""
        self.path = path
        self._size = keep
        try:
            flags = os.O_WRONLY | os.O_CREAT | getattr(os, "O_BINARY", 0)
            self._file = os.open(path, flags, 0o666)
            os.ftruncate(self._file, keep)
            os.lseek(self._file, keep, os.SEEK_SET)
        except OSError as error:
            raise refusal(path, error) from None

    def append(self, text: str) -> None:
        """Append whole rows."""
        data = text.encode()
        with stops.held():
            try:
                written = 0
                while written < len(data):
                    written += os.write(self._file, data[written:])
            except OSError as error:
                os.ftruncate(self._file, self._size)
                os.lseek(self._file, self._size, os.SEEK_SET)
                raise refusal(self.path, error) from None
            self._size += len(data)

    def sync(self) -> None:
        """Wait until the rows are on the disk."""
        try:
            os.fsync(self._file)
        except OSError as error:
            raise refusal(self.path, error) from None

    def close(self) -> None:
        """End it."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
