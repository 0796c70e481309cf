"""Files that appear under their name when they are whole, or not at all."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import math
import os
import re
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from tisoft import stops
from tisoft.errors import Diverged, SceneError

_PART = re.compile(r"\.tisoft-[0-9a-f]{8}-[0-9a-f]{8}\.part")


class Unwritable(SceneError):
    """A file that could not be written."""


def refusal(path: Path, error: OSError) -> Unwritable:
    """What to tell a user whose file could not be written."""
    if error.errno == errno.ENOSPC:
        return Unwritable(f"{path} was not written: the disk is full; make room and run it again")
    if error.errno == errno.EFBIG:
        return Unwritable(
            f"{path} was not written: it grew beyond what this machine allows (ulimit -f)"
        )
    if error.errno in (errno.ENOTDIR, errno.EEXIST) and (file := _file_above(path)) is not None:
        return Unwritable(f"{path} cannot be written: {file} is a file, not a folder")
    reason = error.strerror or str(error)
    return Unwritable(f"{path} cannot be written: {reason}; choose another place with -o")


def _file_above(path: Path) -> Path | None:
    """The part of a path that should be a folder and is a file."""
    return next((above for above in path.parents if above.exists() and not above.is_dir()), None)


def make_folder(path: str | Path) -> Path:
    """The folder, made with its parents where it is missing; raises SceneError."""
    folder = Path(path)
    try:
        if folder.exists() and not folder.is_dir():
            raise Unwritable(f"-o {path} is a file, and results need a folder; name another place")
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise refusal(folder, error) from None
    return folder


def ends_well(kind: type[BaseException] | None) -> bool:
    """Whether results up to an exception of this kind are worth keeping: they are whole so far."""
    return kind is None or issubclass(kind, Diverged | Unwritable) or stops.ended_by(kind)


def part_name(path: Path) -> Path:
    """A hidden name in the same folder that nobody else uses, short however long the path's is."""
    return path.with_name(f".tisoft-{_mark(path)}-{uuid.uuid4().hex[:8]}.part")


def _mark(path: Path) -> str:
    return hashlib.sha256(path.name.encode(errors="surrogateescape")).hexdigest()[:8]


def sweep(folder: Path, path: Path | None = None) -> int:
    """Remove what killed programs left half written in a folder, of `path` alone or of all.

    Files and folders that a living process writes are locked, and stay.  Returns their number.
    """
    swept = 0
    with contextlib.suppress(OSError):  # litter is no reason to fail
        for part in folder.iterdir():
            mine = path is None or part.name.startswith(f".tisoft-{_mark(path)}-")
            if mine and _PART.fullmatch(part.name) and _is_orphan(part):
                shutil.rmtree(part) if part.is_dir() else part.unlink(missing_ok=True)
                swept += 1
    return swept


def lock(path: Path) -> int | None:
    """Lock a file or folder until the returned handle is closed; None where it is locked already.

    The system frees it when the process ends, however it ends.  Where a file system or Windows
    offers no such lock, -1.  Raises OSError.
    """
    try:
        import fcntl
    except ImportError:
        return -1
    handle = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in (errno.EWOULDBLOCK, errno.EACCES):
            return handle  # a file system without locks
        os.close(handle)
        return None
    return handle


def unlock(handle: int | None) -> None:
    """End a lock."""
    if handle is not None and handle >= 0:
        os.close(handle)


def _is_orphan(part: Path) -> bool:
    handle = lock(part)
    unlock(handle)
    return handle is not None and handle >= 0


@contextmanager
def written(path: Path, *, durable: bool = False) -> Iterator[IO[bytes]]:
    """A file under a temporary name, which gets the name `path` when the block ends well.

    Signals wait for its end.  A durable file is on the disk before it gets its name, in case the
    machine loses power; that takes time.  Raises SceneError where it cannot be written.
    """
    part = part_name(path)
    handle: int | None = None
    try:
        with stops.held(), part.open("xb") as file:
            handle = lock(part)
            yield file
            file.flush()
            if durable:
                os.fsync(file.fileno())
            os.replace(part, path)
    except OSError as error:
        raise refusal(path, error) from None
    finally:
        unlock(handle)
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)


def write_bytes(path: Path, data: bytes) -> None:
    """Write a whole file; raises SceneError."""
    with written(path) as file:
        file.write(data)


def write_text(path: Path, text: str) -> None:
    """Write a whole file; raises SceneError."""
    write_bytes(path, text.encode())


def as_json(value: Any) -> str:
    """The value as strict JSON: what is not finite becomes null."""
    return json.dumps(_finite(value), allow_nan=False, ensure_ascii=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if hasattr(value, "tolist"):  # NumPy's
        return _finite(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
