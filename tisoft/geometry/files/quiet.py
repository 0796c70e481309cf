"""Keeps foreign readers from ending the process, printing, hanging or filling the memory."""

from __future__ import annotations

import contextlib
import io
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from tisoft.errors import MeshError


@contextlib.contextmanager
def no_surprises(path: Path) -> Iterator[None]:
    """Turns whatever a reader does (sys.exit included) into a MeshError, silently."""
    printed = io.StringIO()
    try:
        with (
            contextlib.redirect_stdout(printed),
            contextlib.redirect_stderr(printed),
            warnings.catch_warnings(),
            np.errstate(all="ignore"),
            _limited_memory(path.stat().st_size),
        ):
            warnings.simplefilter("ignore")
            # NumPy's way to say that text ended, or went wrong, before the announced count.
            warnings.filterwarnings("error", message=".*could not be read to its end.*")
            yield
    except MeshError:
        raise
    except ImportError as error:
        raise MeshError(
            f"reading it needs the package {error.name}: pip install {error.name}"
        ) from error
    except MemoryError as error:
        raise MeshError("it announces more than its size can hold; the file is damaged") from error
    except (SystemExit, Exception) as error:
        reason = _first_sentence(printed.getvalue(), error)
        raise MeshError(
            f"meshio, which reads this format, cannot read it ({reason}): it is damaged, or holds "
            "what meshio does not know; try it as Gmsh, VTU or Abaqus file"
        ) from error


class _EofError(Exception):
    """A reader asked for lines beyond the end, again and again."""


class _Bounded:
    """An open file that refuses to be read at its end for ever, as some readers of meshio do."""

    def __init__(self, file: IO[Any]) -> None:
        self._file = file
        self._beyond = 0

    def readline(self, *args: int) -> Any:
        return self._counted(self._file.readline(*args))

    def read(self, *args: int) -> Any:
        return self._counted(self._file.read(*args))

    def _counted(self, text: Any) -> Any:
        self._beyond = 0 if text else self._beyond + 1
        if self._beyond > 3:
            raise _EofError("the file ends too early")
        return text

    def __iter__(self) -> Iterator[Any]:
        return iter(self.readline, type(self._file.readline(0))())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


@contextlib.contextmanager
def guarded(path: Path, *, binary: bool) -> Iterator[Any]:
    """The open file, for readers that would wait at its end for ever."""
    with path.open("rb") if binary else path.open(errors="replace") as file:
        yield _Bounded(file)


@contextlib.contextmanager
def _limited_memory(size: int) -> Iterator[None]:
    """Bounds what a damaged count can allocate; where the system cannot, nothing happens."""
    try:
        import resource

        pages = int(Path("/proc/self/statm").read_text().split()[0])
    except (ImportError, OSError):
        yield
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    limit = pages * resource.getpagesize() + 2**27 + 200 * size
    limit = min([limit, *(bound for bound in (soft, hard) if bound != resource.RLIM_INFINITY)])
    resource.setrlimit(resource.RLIMIT_AS, (limit, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def _first_sentence(printed: str, error: BaseException) -> str:
    """What the reader said: its exception, or else what it printed before it left."""
    told = "" if isinstance(error, SystemExit) else str(error)
    if not told:
        lines = [line for line in printed.splitlines() if line.strip()]
        told = lines[0] if lines else type(error).__name__
    told = re.sub(r"\s+", " ", told).strip().rstrip(".")
    return told if len(told) <= 160 else told[:157] + "…"
