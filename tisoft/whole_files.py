"""Files that appear under their name when they are whole, or not at all."""

from __future__ import annotations

import errno
import json
import math
import os
import shutil
import uuid
from pathlib import Path
from typing import IO, Any, Self

from tisoft.errors import Diverged, SceneError


def refusal(path: Path, error: OSError) -> SceneError:
    """What to tell a user whose file could not be written."""
    if error.errno == errno.ENOSPC:
        return SceneError(f"{path} was not written: the disk is full; make room and run it again")
    reason = error.strerror or str(error)
    return SceneError(f"{path} cannot be written: {reason}; choose another place with -o")


def make_folder(path: str | Path) -> Path:
    """The folder, made with its parents where it is missing; raises SceneError."""
    folder = Path(path)
    if folder.exists() and not folder.is_dir():
        raise SceneError(f"-o {path} is a file, and results need a folder; name another place")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise refusal(folder, error) from None
    return folder


def ends_well(kind: type[BaseException] | None) -> bool:
    """Whether results up to an exception of this kind are worth keeping: they are whole so far."""
    return kind is None or issubclass(kind, KeyboardInterrupt | Diverged)


class WholeFile:
    """A text file that grows under a temporary name beside its own and gets that at the end.

    Used in a `with` block; Ctrl-C and a simulation that fails end it early, other errors remove it.
    Raises SceneError where it cannot be written, at once when the folder cannot.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._part = path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}.part")

    def __enter__(self) -> Self:
        try:
            self._file: IO[str] = self._part.open("w", encoding="utf-8", newline="")
        except OSError as error:
            raise refusal(self.path, error) from None
        return self

    def write(self, text: str) -> None:
        """Append text."""
        try:
            self._file.write(text)
        except OSError as error:
            raise refusal(self.path, error) from None

    def publish(self) -> None:
        """Give what was written so far the file's name, whole; writing goes on."""
        copy = self._part.with_suffix(".so_far.part")
        try:
            self._file.flush()
            with self._part.open("rb") as source, copy.open("wb") as target:
                shutil.copyfileobj(source, target)
                target.flush()
                os.fsync(target.fileno())
            os.replace(copy, self.path)
        except OSError as error:
            raise refusal(self.path, error) from None
        finally:
            copy.unlink(missing_ok=True)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            self._file.close()
            if ends_well(kind):
                os.replace(self._part, self.path)
        except OSError as error:
            if ends_well(kind):  # else what happened first is told
                raise refusal(self.path, error) from None
        finally:
            self._part.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a whole file."""
    with WholeFile(path) as file:
        file.write(text)


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
