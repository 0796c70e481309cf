"""The lines of an Abaqus input file: keywords with their options, and the rows below each."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tisoft.errors import MeshError
from tisoft.geometry.files.text import BYTE_ORDER_MARK, numbers

Ints = NDArray[np.int64]

_IN_BULK = ("NODE", "ELEMENT")
"""Keywords whose many rows are kept as text and read at once."""
MOST_INCLUDED = 20
"""Files that may include each other."""


@dataclass
class Card:
    """A keyword, its options and its rows."""

    word: str
    options: dict[str, str]
    rows: list[list[str]] = field(default_factory=list)
    line: int = 0
    """Of the keyword, from 1."""
    labels: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    """Members of a set that another keyword (NSET=, ELSET=) makes."""
    text: bytes = b""
    """Rows of nodes and elements, as they stand."""


def cards(path: Path, depth: int = 0) -> Iterator[Card]:
    """The keywords of a file, those of included files in their places."""
    try:
        data = path.read_bytes().removeprefix(BYTE_ORDER_MARK)
    except OSError as error:
        raise MeshError(
            f"it includes {path.name}, which cannot be read: {error.strerror}"
        ) from None
    for card in _cards(data):
        source = card.options.get("INPUT")
        if source is None:
            yield card
            continue
        if depth >= MOST_INCLUDED:
            raise MeshError(f"line {card.line}: files include each other {depth} deep")
        other = path.parent / source.strip('"')
        if card.word == "INCLUDE":
            yield from cards(other, depth + 1)
        else:  # rows of this keyword in a file of their own
            try:
                card.text = re.sub(rb"(?m)^\s*\*\*.*$", b"", other.read_bytes())
            except OSError as error:
                raise MeshError(
                    f"line {card.line}: *{card.word} is in {source}, which cannot be read: "
                    f"{error.strerror}"
                ) from None
            card.rows = [] if card.word in _IN_BULK else _rows(card.text)
            yield card


def _cards(data: bytes) -> Iterator[Card]:
    heads = [found.start() for found in re.finditer(rb"(?m)^[ \t]*\*(?!\*)", data)]
    lines, counted = 1, 0
    for k, start in enumerate(heads):
        end = heads[k + 1] if k + 1 < len(heads) else len(data)
        lines += data.count(b"\n", counted, start)
        counted = start
        head, _, body = data[start:end].partition(b"\n")
        while head.rstrip().endswith(b","):
            more, newline, body = body.partition(b"\n")
            head = head.rstrip() + more
            if not newline:
                break
        if b"**" in body:
            body = re.sub(rb"(?m)^[ \t]*\*\*.*$", b"", body)
        word, options = _head(head)
        card = Card(word, options, line=lines, text=body)
        if word not in _IN_BULK:
            card.rows = _rows(body)
        yield card


def _head(text: bytes) -> tuple[str, dict[str, str]]:
    word, *given = text.decode("latin-1").strip().lstrip("*").split(",")
    options = {}
    for part in given:
        name, _, value = part.partition("=")
        options[re.sub(r"\s+", "", name).upper()] = value.strip()
    return " ".join(word.split()).upper(), options


def _rows(text: bytes) -> list[list[str]]:
    lines = text.decode("latin-1").splitlines()
    return [[word.strip() for word in line.split(",")] for line in lines if line.strip()]


def table(card: Card, width: int, *, filled: bool = False) -> NDArray[np.float64]:
    """Rows of numbers, shape (rows, width); `filled`: fewer are filled up by 0, more left out.

    Otherwise a row may go on in the next lines, until it has `width` numbers.
    """
    where = f"*{card.word} in line {card.line}"
    lines = card.text.strip().count(b"\n") + 1 if card.text.strip() else 0
    if filled and card.text.count(b",") != (width - 1) * lines:
        padded = []
        for line in card.text.splitlines():
            if not line.strip():
                continue
            words = [word.strip() or b"0" for word in line.split(b",")]
            padded.append(b" ".join((words + [b"0"] * width)[:width]))
        text = b"\n".join(padded)
    else:
        text = card.text.replace(b",", b" ")
    try:
        values = numbers(text, where)
    except MeshError:  # Fortran's exponents, perhaps
        values = numbers(re.sub(rb"([\d.])[dD]([-+\d])", rb"\1e\2", text), where)
    if len(values) % width:
        raise MeshError(
            f"{where} holds {len(values)} numbers, which are no rows of {width}; "
            "the file is cut short or damaged"
        )
    rows = values.reshape(-1, width)
    labels = rows[:, :1] if filled else rows
    if not (
        np.isfinite(labels).all() and (labels == np.rint(labels)).all() and (labels < 2**53).all()
    ):
        raise MeshError(f"{where} holds a number with a point where a whole one should stand")
    return rows


def names_and_numbers(card: Card) -> tuple[Ints, list[str]]:
    """Members of a set: numbers (also first, last, step of GENERATE), and names of other sets."""
    numbered, names = [], []
    words = [word for row in card.rows for word in row if word]
    if "GENERATE" in card.options:
        for row in card.rows:
            given = [int(word) for word in row if word]
            if not given:
                continue
            first = given[0]
            last, step = (
                (given[1] if len(given) > 1 else first),
                (given[2] if len(given) > 2 else 1),
            )
            if step == 0 or (last - first) // step > 10_000_000:
                raise MeshError(f"*{card.word} in line {card.line} generates too many numbers")
            numbered += list(range(first, last + 1, step))
    else:
        for word in words:
            if word.isdecimal():
                numbered.append(int(word))
            else:
                names.append(word)
    return np.concatenate([card.labels, np.array(numbered, dtype=np.int64)]), names
