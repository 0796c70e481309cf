"""tisoft.json: whose result lies in a folder, how far it is, and which files are its own."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tisoft.errors import SceneError
from tisoft.version import version
from tisoft.whole_files import as_json

MANIFEST = "tisoft.json"
FORMAT = 1
STATES = ("running", "done", "interrupted", "failed")
CHECKPOINT = "checkpoint.npz"

_NAME = re.compile(r"(?!\.\.?(/|$))[^/\\:\0]+(/(?!\.\.?$)[^/\\:\0]+)?")
_TEMPLATE = re.compile(r"([\w-]+/)?[\w-]+%05d\.\w+")
_MOST_NAMES = 10_000_000


@dataclass
class Manifest:
    """What tisoft.json holds."""

    command: str
    scene: str | None
    state: str = "running"
    progress: float = 0.0
    """Share of the simulated time that the checkpoint in the folder has."""
    files: list[str] = field(default_factory=list)
    series: dict[str, list[int]] = field(default_factory=dict)
    """By template, as frames/frame_%05d.vtu: the step between numbers, and the last one."""

    def names(self) -> Iterator[str]:
        """Every file, relative to the folder."""
        yield from self.files
        for template, (every, last) in self.series.items():
            yield from (template % number for number in range(0, last + 1, every))

    def as_text(self) -> str:
        """The file's text."""
        head = {"made_by": "tisoft", "version": version(), "format": FORMAT}
        return as_json(head | vars(self)) + "\n"

    @property
    def title(self) -> str:
        """The result, for a sentence."""
        scene = f" {Path(self.scene).name}" if self.scene else ""
        return f"tisoft {self.command}{scene}"


def is_unfinished(folder: Path, manifest: Manifest) -> bool:
    """Whether a run ended before its time and left a checkpoint to go on from."""
    begun = manifest.state in ("running", "interrupted") and manifest.progress > 0.0
    return begun and (folder / CHECKPOINT).is_file()


def read_manifest(folder: Path, *, lenient: bool = False) -> Manifest | None:
    """The manifest in a folder; None where there is none, or where `lenient` and it is damaged.

    Raises:
        SceneError: a file of that name which is no manifest.
    """
    path = folder / MANIFEST
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        return _manifest_of(data)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        if lenient:
            return None
        raise SceneError(
            f"{path} is damaged, or of another program or a later tisoft; name another folder "
            "with -o, or replace it with --overwrite"
        ) from None


def _manifest_of(data: Any) -> Manifest:
    """Raises ValueError, TypeError or KeyError for what is no manifest of this format."""
    if (data["made_by"], data["format"]) != ("tisoft", FORMAT):
        raise ValueError
    known = ("command", "scene", "state", "progress", "files", "series")
    found = Manifest(**{key: data[key] for key in known})
    for name in found.files:
        if not _NAME.fullmatch(name):
            raise ValueError  # nothing outside the folder is touched
    for template, (every, last) in found.series.items():
        whole = isinstance(every, int) and isinstance(last, int)
        if not _TEMPLATE.fullmatch(template) or not whole or not 0 < every <= _MOST_NAMES:
            raise ValueError
        if not -1 <= last <= _MOST_NAMES:
            raise ValueError
    if found.state not in STATES or not isinstance(found.command, str):
        raise ValueError
    found.progress = float(found.progress)
    return found
