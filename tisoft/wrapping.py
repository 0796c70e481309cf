"""Lines that Python's textwrap has wrapped, kept.

For each node of the syntax tree that Taichi reads, it wraps the node's line twice, for a message
that most programs never see; a line has a dozen nodes, and the wrapping took a third of what
Taichi's reading of a scene's kernels takes.  Whatever else is wrapped comes out as ever.
"""

from __future__ import annotations

import textwrap
from typing import Any

MOST = 20_000
"""Lines kept at the most."""

_wrap = textwrap.TextWrapper.wrap
_kept: dict[tuple[Any, ...], list[str]] = {}


def keep_wrapped_lines() -> None:
    """Have `textwrap` remember from now on."""
    if textwrap.TextWrapper.wrap is _wrap:
        textwrap.TextWrapper.wrap = _remembered  # type: ignore[assignment, method-assign]


def _remembered(wrapper: textwrap.TextWrapper, text: str) -> list[str]:
    key = (text, *vars(wrapper).values())
    lines = _kept.get(key)
    if lines is None:
        if len(_kept) >= MOST:
            _kept.clear()
        lines = _kept[key] = _wrap(wrapper, text)
    return list(lines)
