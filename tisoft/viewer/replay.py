"""A recording as one HTML file: the viewer's page, three.js and the frames inside.

A frame is f32 time, f32 top, u32 colour, f32 extra numbers, then of each drawn row three u16 of
where it is between the least and the greatest coordinates of all frames (each the difference from
the frame before, modulo 2¹⁶), then its u8 value; low bytes first, all frames one after another,
deflated, in base64.
"""

from __future__ import annotations

import base64
import json
import struct
import tempfile
import weakref
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tisoft.errors import SceneError
from tisoft.viewer.orders import COLORS
from tisoft.viewer.picture import Snapshot
from tisoft.whole_files import written

PAGE = Path(__file__).parent / "page"
IN_MEMORY = 64 * 2**20
"""Bytes of frames beyond which they wait in a temporary file."""
BASE64_BYTES = 3 * 2**16
"""Written at a time: a multiple of three."""


class Replay:
    """Frames on their way into a page; `hello` is what the server tells its own."""

    def __init__(self, hello: dict[str, Any], rate: float) -> None:
        self._hello, self._rate = hello, rate
        self._rows = int(hello["rows"])
        self._lo, self._hi = np.full(3, np.inf), np.full(3, -np.inf)
        self._file = tempfile.SpooledTemporaryFile(max_size=IN_MEMORY)
        weakref.finalize(self, self._file.close)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def keep(self, shot: Snapshot) -> None:
        """Append a frame.  Raises SceneError where there is no room for it."""
        self._lo = np.minimum(self._lo, shot.positions.min(axis=0))
        self._hi = np.maximum(self._hi, shot.positions.max(axis=0))
        head = struct.pack("<ffI", shot.time, shot.top, COLORS.index(shot.color))
        try:
            self._file.write(head + shot.extra.tobytes())
            self._file.write(shot.positions.tobytes() + shot.values.tobytes())
        except OSError as error:
            place = tempfile.gettempdir()
            problem = f"the recording does not fit into {place}: {error.strerror or error}"
            raise SceneError(f"{problem}; make room there, or set TMPDIR") from None
        self._count += 1

    def _frames(self) -> Iterator[bytes]:
        """The frames as they are packed."""
        extra = 12 + 4 * int(self._hello["extra"])
        span = np.maximum(self._hi - self._lo, 1e-30)
        before = np.zeros((self._rows, 3), np.uint16)
        self._file.seek(0)
        for _ in range(self._count):
            yield self._file.read(extra)
            x = np.frombuffer(self._file.read(12 * self._rows), np.float32).reshape(-1, 3)
            share = np.clip((x - self._lo) / span, 0.0, 1.0)
            now = np.round(65535.0 * share).astype(np.uint16)
            yield (now - before).astype("<u2").tobytes()
            before = now
            yield self._file.read(self._rows)
        self._file.seek(0, 2)

    def write(self, path: Path) -> None:
        """Write the page, whole or not at all.  Raises SceneError."""
        span = np.maximum(self._hi - self._lo, 1e-30)
        told = {
            **self._hello, "frames": self._count, "rate": self._rate,
            "least": self._lo.tolist(), "span": span.tolist(),
        }  # fmt: skip
        three = base64.b64encode((PAGE / "three.min.js").read_bytes()).decode()
        script = (PAGE / "page.js").read_text(encoding="utf-8")
        script = script.replace("'./three.min.js'", f"'data:text/javascript;base64,{three}'", 1)
        begin, end = (
            (PAGE / "page.html")
            .read_text(encoding="utf-8")
            .split('<script type="module" src="page.js"></script>')
        )
        notice = (PAGE / "three.LICENSE").read_text(encoding="utf-8").replace("--", "- -")
        with written(path) as file:
            file.write(f"{begin}<!-- three.js:\n{notice}-->\n".encode())
            file.write(b'<script id="tisoft-frames" type="text/plain">')
            for text in _base64(self._frames()):
                file.write(text)
            file.write(b"</script>\n<script>window.tisoftRecording = ")
            file.write(json.dumps(told).replace("<", "\\u003c").encode())
            file.write(f';</script>\n<script type="module">\n{script}</script>{end}'.encode())


def _base64(pieces: Iterator[bytes]) -> Iterator[bytes]:
    """Deflated, in base64."""
    pack, left = zlib.compressobj(6), b""
    for piece in pieces:
        left += pack.compress(piece)
        while len(left) >= BASE64_BYTES:
            yield base64.b64encode(left[:BASE64_BYTES])
            left = left[BASE64_BYTES:]
    yield base64.b64encode(left + pack.flush())
