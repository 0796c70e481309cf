"""Numbers in text, read at once."""

from __future__ import annotations

import re
import warnings

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError

BYTE_ORDER_MARK = b"\xef\xbb\xbf"
"""What some editors put before text in UTF-8."""


def numbers(text: bytes, where: str) -> NDArray[np.float64]:
    """All numbers of a text, separated by blanks or line ends.  Raises MeshError at other words."""
    if not text.strip():
        return np.empty(0)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)
            return np.fromstring(text, sep=" ")
    except (DeprecationWarning, ValueError):
        pass
    words = text.split()
    try:
        return np.array([float(word) for word in words])
    except ValueError:
        wrong = next((word for word in words if not _is_number(word)), words[0])
        shown = wrong[:40].decode(errors="replace")
        raise MeshError(f"{where} holds {shown!r} where a number should stand") from None


def whole(values: NDArray[np.float64], where: str) -> NDArray[np.int64]:
    """The values as whole numbers."""
    with np.errstate(invalid="ignore"):
        result = values.astype(np.int64)
    wrong = (result != values) | (np.abs(values) > 2**53)
    if wrong.any():
        raise MeshError(
            f"{where} holds {values[wrong].flat[0]:g} where a whole number should stand"
        )
    return result


def _is_number(word: bytes) -> bool:
    return (
        re.fullmatch(
            rb"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|[-+]?(nan|inf|infinity)", word.lower()
        )
        is not None
    )
