"""The rows of a sweep on disk: a journal that grows by whole rows, and tables made of it.

rows.jsonl holds one JSON object a line, in the order in which rows were done, each on the disk
before the next is begun: whatever ends the program loses at most the row it was computing.
"""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from tisoft.growing_file import GrowingFile
from tisoft.whole_files import as_json, write_bytes, write_text

JOURNAL, CSV, PARQUET = "rows.jsonl", "sweep.csv", "sweep.parquet"


class Journal:
    """Rows that were computed, by their jobs' keys."""

    def __init__(self, path: Path) -> None:
        self.rows: dict[str, dict[str, Any]] = {}
        keep = 0
        if path.exists():
            data = path.read_bytes()
            keep = data.rfind(b"\n") + 1
            for line in data[:keep].splitlines():
                entry = json.loads(line)
                self.rows[entry["key"]] = entry["row"]
        self._file = GrowingFile(path, keep=keep)

    def add(self, key: str, row: Mapping[str, Any]) -> None:
        """Keep a row; it is on the disk afterwards."""
        text = as_json({"key": key, "row": dict(row)})
        self._file.append(text + "\n")
        self._file.sync()
        self.rows[key] = json.loads(text)["row"]

    def close(self) -> None:
        """End the file."""
        self._file.close()


def columns_of(rows: Iterable[Mapping[str, Any]]) -> list[str]:
    """Every column of the rows, in the order in which they come up; errors last."""
    names = dict.fromkeys(name for row in rows for name in row)
    return [name for name in names if name != "error"] + (["error"] if "error" in names else [])


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """The rows as CSV; empty cells for what a row has not."""
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    names = columns_of(rows)
    table.writerow(names)
    for row in rows:
        table.writerow(["" if row.get(name) is None else row[name] for name in names])
    write_text(path, out.getvalue())


def write_parquet(path: Path, rows: Sequence[Mapping[str, Any]]) -> bool:
    """The rows as Parquet where pandas can write it; returns whether."""
    try:
        import pandas
        import pyarrow  # noqa: F401
    except ImportError:
        return False
    out = io.BytesIO()
    frame = pandas.DataFrame([dict(row) for row in rows], columns=columns_of(rows))
    for name in frame.columns:  # a column of one kind each: Parquet wants that
        kinds = {type(v) for v in frame[name] if v is not None and v == v}
        if len(kinds - {int, float}) > 0 and kinds != {str} and kinds != {bool}:
            frame[name] = frame[name].map(lambda v: None if v is None else str(v))
    frame.to_parquet(out, index=False)
    write_bytes(path, out.getvalue())
    return True


def remove_if_there(path: Path) -> None:
    """Remove a file that an older result may have left."""
    if path.exists():
        os.unlink(path)
