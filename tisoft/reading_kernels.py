"""What Taichi asks Python again and again while it reads kernels, kept.

For each node of the syntax tree it wraps the node's line twice, for a message that most programs
never see; a line has a dozen nodes.  For each call of a `ti.func` it looks up where the function
stands, and reads and tokenises its lines anew.  Together that took half of what Taichi's reading of
a scene's kernels takes.  Whatever else is asked comes out as ever.
"""

from __future__ import annotations

import inspect
import textwrap
from types import FunctionType
from typing import Any

MOST = 20_000
"""Lines, or functions, kept at the most."""

_wrap = textwrap.TextWrapper.wrap
_source_lines = inspect.getsourcelines
_source_file = inspect.getsourcefile
_kept: dict[str, tuple[dict[str, Any], list[str]]] = {}
_lines: dict[Any, tuple[list[str], int]] = {}
_files: dict[Any, str | None] = {}


def keep_what_is_read() -> None:
    """Have `textwrap` and `inspect` remember from now on."""
    if textwrap.TextWrapper.wrap is _wrap:
        textwrap.TextWrapper.wrap = _wrapped  # type: ignore[assignment, method-assign]
        inspect.getsourcelines = _lines_of  # type: ignore[assignment]
        inspect.getsourcefile = _file_of  # type: ignore[assignment]


def _room(kept: dict[Any, Any]) -> dict[Any, Any]:
    if len(kept) >= MOST:
        kept.clear()
    return kept


def _wrapped(wrapper: textwrap.TextWrapper, text: str) -> list[str]:
    known = _kept.get(text)
    if known is None or known[0] != vars(wrapper):
        known = _room(_kept)[text] = dict(vars(wrapper)), _wrap(wrapper, text)
    return list(known[1])


def _lines_of(thing: Any) -> tuple[list[str], int]:
    if not isinstance(thing, FunctionType):
        return _source_lines(thing)
    found = _lines.get(thing.__code__)
    if found is None:
        found = _room(_lines)[thing.__code__] = _source_lines(thing)
    return list(found[0]), found[1]


def _file_of(thing: Any) -> str | None:
    if not isinstance(thing, FunctionType):
        return _source_file(thing)
    key = thing.__code__
    if key not in _files:
        _room(_files)[key] = _source_file(thing)
    return _files[key]
