"""A folder belongs to one result: its manifest says whose, and a lock keeps others out of it.

The manifest, tisoft.json, names every file that was written, before it is.  So what an older result
left can be removed by name, and a user's own files never are.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from tisoft import stops
from tisoft.errors import SceneError
from tisoft.manifest import MANIFEST, Manifest, is_unfinished, read_manifest
from tisoft.whole_files import (
    Unwritable,
    lock,
    make_folder,
    refusal,
    sweep,
    unlock,
    write_text,
)


@dataclass(frozen=True)
class Owner:
    """Whose result a folder is to hold.

    `overwrite` replaces whatever result lies there; `resume` goes on with it.
    """

    command: str = "film"
    scene: str | None = None
    """The scene file, absolute."""
    overwrite: bool = False
    resume: bool = False
    pictures: int = 0
    """How many will be written, where that is known: a name that is taken is told before."""


class ResultFolder:
    """A folder for the result of one command, in a `with` block.

    `begin` removes what an older result left, and must come before anything is written.  At the
    end of the block the manifest tells how it ended.

    Raises:
        SceneError: another command is at work in it; it holds another result, or an unfinished one;
            it cannot be written.
    """

    def __init__(self, path: str | Path, owner: Owner) -> None:
        self.path = Path(path)
        self.owner = owner
        self.state = ""
        """Set by who knows better than the kind of an exception how the result ended."""
        self._manifest: Manifest | None = None
        self._older: Manifest | None = None
        self._made: list[Path] = []
        self._lock: int | None = None

    def __enter__(self) -> Self:
        try:
            self._made = [p for p in (self.path, *self.path.parents) if not p.exists()]
            make_folder(self.path)
            self._lock = self._locked()
            sweep(self.path)
            sweep(self.path / "frames")
            self._older = read_manifest(self.path, lenient=self.owner.overwrite)
            if not self.owner.overwrite and self._older is not None:
                self._judge(self._older)
        except BaseException:
            self._leave()
            raise
        return self

    def _locked(self) -> int:
        try:
            handle = lock(self.path)
        except OSError as error:
            raise refusal(self.path, error) from None
        if handle is None:
            raise SceneError(
                f"another run is writing into {self.path}; wait for its end, or name another folder"
            )
        return handle

    def _judge(self, older: Manifest) -> None:
        """Raise SceneError where the older result must not be replaced without a word."""
        mine = (older.command, older.scene) == (self.owner.command, self.owner.scene)
        if self.owner.resume and older.command == self.owner.command:
            return  # whether it is the same scene is seen from the checkpoint
        if not mine or self.owner.resume:
            raise SceneError(
                f"{self.path} holds the result of {older.title}; name another folder with -o, "
                "or replace it with --overwrite"
            )
        if is_unfinished(self.path, older):
            raise SceneError(
                f"{self.path} holds an unfinished run, {100.0 * older.progress:.0f} % done: "
                "--resume goes on, --overwrite begins anew"
            )

    def begin(self, files: Iterable[str], series: dict[str, tuple[int, int]] | None = None) -> None:
        """Take over the folder for these files, and for series that lie there already.

        Raises:
            SceneError: one of them lies there and is none of tisoft's.
        """
        kept = {template: list(numbers) for template, numbers in (series or {}).items()}
        new = Manifest(self.owner.command, self.owner.scene, files=list(files), series=kept)
        self.foresee(new.files)
        older = set(self._older.names()) if self._older else set()
        stale = older - set(new.names()) if self.owner.resume else older
        if self.owner.overwrite:
            stale |= set(new.files)
        if self.owner.resume and self._older is not None:
            new.progress = self._older.progress
        # Until the old files are gone both results' are named.
        both = Manifest(**vars(new) | {"files": [*new.files, *sorted(stale - set(new.files))]})
        with stops.held():
            self._write(both)
            self._remove(stale)
            self._manifest = new
            self._write(new)

    def foresee(
        self, files: Iterable[str], series: dict[str, tuple[int, int]] | None = None
    ) -> None:
        """Raise SceneError where a name that will be written is taken; changes nothing."""
        planned = Manifest("", None, files=list(files))
        planned.series = {template: list(numbers) for template, numbers in (series or {}).items()}
        older = set(self._older.names()) if self._older else set()
        for name in planned.names():
            self._check(name, older)

    def _check(self, name: str, older: set[str]) -> None:
        path = self.path / name
        if not os.path.lexists(path):
            return
        if path.is_dir():
            raise SceneError(
                f"{path} is a folder, and a result needs that name; name another folder with -o"
            )
        mine = name in older or self.owner.overwrite or self.owner.resume
        if not mine:
            raise SceneError(
                f"{path} lies there and is of no result that tisoft knows; name another folder "
                "with -o, or replace it with --overwrite"
            )

    def claim(self, template: str, number: int, every: int = 1) -> Path:
        """Name the next file of a series in the manifest; returns its path.

        Raises:
            SceneError: a file of that name lies there and is none of tisoft's.
        """
        assert self._manifest is not None
        name = template % number
        self._check(name, set())
        self._manifest.series[template] = [every, number]
        self._write(self._manifest)
        return self.path / name

    def tell(self, progress: float) -> None:
        """Note the share of the work that the checkpoint holds."""
        if self._manifest is not None:
            self._manifest.progress = progress
            self._write(self._manifest)

    def discard(self) -> None:
        """Remove all that was written."""
        if self._manifest is not None:
            self._remove([*self._manifest.names(), MANIFEST])
            self._manifest = None

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with stops.held():
            if self._manifest is not None:
                self._manifest.state = self.state or _state(kind)
                with contextlib.suppress(SceneError):  # "running" without a lock tells as much
                    self._write(self._manifest)
            self._leave()

    def _leave(self) -> None:
        mine = self._lock is not None and self._manifest is None
        for folder in self._made if mine else ():
            with contextlib.suppress(OSError):  # somebody has put something into it
                folder.rmdir()
        unlock(self._lock)
        self._lock = None

    def _write(self, manifest: Manifest) -> None:
        write_text(self.path / MANIFEST, manifest.as_text())

    def _remove(self, names: Iterable[str]) -> None:
        folders = set()
        try:
            for name in names:
                path = self.path / name
                if not path.is_dir():
                    path.unlink(missing_ok=True)
                folders.add(path.parent)
        except OSError as error:
            raise refusal(self.path, error) from None
        for folder in folders - {self.path}:
            with contextlib.suppress(OSError):  # holds something of the user
                folder.rmdir()


def check_free(path: Path) -> None:
    """Refuse a single file whose name is one of the result that its folder belongs to.

    Raises:
        SceneError: it is.
    """
    older = read_manifest(path.parent, lenient=True)
    if older is not None and path.name in older.names():
        raise SceneError(
            f"{path} belongs to the result of {older.title} in that folder; name another file"
        )


def _state(kind: type[BaseException] | None) -> str:
    """How a command ended that an exception of this kind ended, or none."""
    if kind is None:
        return "done"
    stopped = issubclass(kind, Unwritable) or stops.ended_by(kind)
    return "interrupted" if stopped else "failed"
