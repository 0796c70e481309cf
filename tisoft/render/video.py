"""Pictures to files: MP4, GIF and WebP through ffmpeg, PNG, and folders of PNGs.

Pictures are written as they come. A file appears under its own name only when it is whole: until
then it has a temporary name in the same folder, which is removed when anything goes wrong, by the
next film of that name where the program was killed. A signal ends the film early: what was drawn so
far is kept, whole.
"""

from __future__ import annotations

import contextlib
import errno
import os
import subprocess
import tempfile
from pathlib import Path
from types import TracebackType
from typing import IO, Self

import imageio.v3 as iio
import numpy as np
from numpy.typing import NDArray

from tisoft import stops
from tisoft.errors import SceneError
from tisoft.folders import Owner, ResultFolder, check_free
from tisoft.whole_files import ends_well, lock, part_name, refusal, sweep, unlock, written

Picture = NDArray[np.uint8]

PICTURE = "frame_%05d.png"
GIF_RATE = 50.0  # browsers slow down what is faster; GIF counts in steps of 10 ms

# Arguments for ffmpeg by suffix, between the input and the output.
CODECS = {
    ".mp4": (
        *("-c:v", "libx264", "-preset", "veryfast", "-crf", "17", "-pix_fmt", "yuv420p"),
        *("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"),
        *("-vf", "scale=out_color_matrix=bt709:out_range=tv", "-movflags", "+faststart"),
        *("-f", "mp4"),
    ),
    ".gif": (
        "-filter_complex",
        "{rate}split[a][b];[a]palettegen=stats_mode=single[p];"
        "[b][p]paletteuse=new=1:dither=sierra2_4a",
        *("-loop", "0", "-f", "gif"),
    ),
    ".webp": (
        *("-c:v", "libwebp_anim", "-quality", "88", "-compression_level", "3"),
        *("-loop", "0", "-f", "webp"),
    ),
}


def open_sink(
    path: str | Path,
    size: tuple[int, int],
    frame_rate: float,
    owner: Owner | None = None,
    *,
    alpha: bool = False,
) -> Sink:
    """A context into which pictures of one size (pixels) are written at a rate (1/s).

    With `alpha` they have a fourth channel.

    The suffix chooses: .mp4, .gif, .webp, .png (the last picture only); without a suffix, or with
    a slash at the end, a folder of frame_00000.png and so on; `owner` says whose it is. Raises
    SceneError for another suffix, alpha in an MP4, a folder that cannot be written or is another's,
    and, while writing, a full disk.
    """
    folder = str(path).endswith(("/", os.sep)) or Path(path).is_dir()
    path = Path(path)
    suffix = path.suffix.lower()
    if not np.isfinite(frame_rate) or frame_rate <= 0.0:
        raise SceneError(
            f"The frame rate is {frame_rate}: give a positive number (frames a second)."
        )
    if folder or not suffix:
        return FolderSink(path, owner or Owner())
    if suffix == ".png":
        return PngSink(path)
    if suffix == ".mp4" and alpha:
        raise SceneError(f"{path} cannot be transparent: write a .webp, .png, .gif or a folder.")
    if suffix in CODECS:
        return FilmSink(path, size, frame_rate, alpha)
    raise SceneError(
        f"{path} cannot be written: {suffix} is none of .mp4, .gif, .webp, .png or a folder's name"
        " without a suffix."
    )


class Sink:
    """Base of what pictures are written into: write(picture) within a `with` block."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.count = 0
        self._part: Path | None = None
        self._lock: int | None = None

    @property
    def kept(self) -> int:
        """Number of pictures that stay."""
        return self.count

    def write(self, picture: Picture) -> None:
        """Append a picture, shape (height, width, 3 or 4), sRGB bytes. Raises SceneError."""
        try:
            self._append(picture)
        except OSError as error:
            raise refusal(self.path, error) from error
        self.count += 1

    def __enter__(self) -> Self:
        try:
            with stops.held():
                self.path.parent.mkdir(parents=True, exist_ok=True)
                check_free(self.path)
                sweep(self.path.parent, self.path)
                self._begin()
        except BaseException as error:
            self._discard()
            if isinstance(error, OSError):
                raise refusal(self.path, error) from error
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with stops.held():
            try:
                if self.count and (kind is None or issubclass(kind, KeyboardInterrupt)):
                    self._finish()
            except OSError as problem:
                raise refusal(self.path, problem) from problem
            finally:
                self._discard()

    def _begin(self) -> None:
        """Open the temporary file; an unwritable folder is told now, not after the simulation."""
        raise NotImplementedError

    def _append(self, picture: Picture) -> None:
        raise NotImplementedError

    def _finish(self) -> None:
        """Complete the temporary file and give it its name."""
        raise NotImplementedError

    def _open_part(self) -> Path:
        """Make the temporary file, and lock it: nobody takes it for litter."""
        self._part = _partial_name(self.path)
        self._part.touch()
        self._lock = lock(self._part)
        return self._part

    def _discard(self) -> None:
        """Remove what is temporary, if it is still there."""
        unlock(self._lock)
        self._lock = None
        if self._part is not None:
            with contextlib.suppress(OSError):
                self._part.unlink()


class PngSink(Sink):
    """The last picture only."""

    _last: Picture | None = None

    @property
    def kept(self) -> int:
        return min(1, self.count)

    def _begin(self) -> None:
        self._open_part()

    def _append(self, picture: Picture) -> None:
        self._last = picture

    def _finish(self) -> None:
        assert self._last is not None
        assert self._part is not None
        self._part.write_bytes(_png(self._last))
        os.replace(self._part, self.path)


class FolderSink(Sink):
    """Every picture, numbered; each appears whole. Those of an older film in the folder go."""

    def __init__(self, path: Path, owner: Owner) -> None:
        super().__init__(path)
        self._folder = ResultFolder(path, owner)
        self._expected = owner.pictures

    def __enter__(self) -> Self:
        self._folder.__enter__()
        try:
            self._folder.foresee((), {PICTURE: (1, self._expected - 1)})
        except BaseException as error:
            self._folder.__exit__(type(error), error, None)
            raise
        return self

    def _append(self, picture: Picture) -> None:
        if not self.count:
            self._folder.begin(())
        with written(self._folder.claim(PICTURE, self.count)) as file:
            file.write(_png(picture, compress_level=3))

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if not self.count or not ends_well(kind):
            self._folder.discard()
        self._folder.__exit__(kind, error, trace)


class FilmSink(Sink):
    """A film, encoded by ffmpeg while it is drawn; sides are made even for MP4."""

    def __init__(self, path: Path, size: tuple[int, int], frame_rate: float, alpha: bool) -> None:
        super().__init__(path)
        self._format = "rgba" if alpha else "rgb24"
        self._suffix = path.suffix.lower()
        self._pad = tuple(n % 2 if self._suffix == ".mp4" else 0 for n in size)
        self._size = size
        self._rate = frame_rate
        self._encoder: subprocess.Popen[bytes] | None = None
        self._log: IO[bytes] | None = None

    def _begin(self) -> None:
        import imageio_ffmpeg

        part = self._open_part()
        width, height = (n + p for n, p in zip(self._size, self._pad, strict=True))
        rate = f"fps={GIF_RATE:g}," if self._rate > GIF_RATE else ""
        codec = [argument.replace("{rate}", rate) for argument in CODECS[self._suffix]]
        command = [
            *(imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-loglevel", "error", "-nostdin"),
            *("-f", "rawvideo", "-pix_fmt", self._format, "-s", f"{width}x{height}"),
            *("-r", f"{self._rate:.9g}", "-i", "pipe:0", *codec, str(part)),
        ]
        self._log = tempfile.TemporaryFile()
        # Its own session, and deaf: signals are for the simulation, which then ends the film.
        with stops.kept_back():
            self._encoder = subprocess.Popen(
                command, stdin=subprocess.PIPE, stderr=self._log, start_new_session=True
            )

    def _append(self, picture: Picture) -> None:
        assert self._encoder is not None and self._encoder.stdin is not None
        if any(self._pad):
            picture = np.pad(picture, ((0, self._pad[1]), (0, self._pad[0]), (0, 0)), mode="edge")
        try:
            self._encoder.stdin.write(np.ascontiguousarray(picture).data)
        except BrokenPipeError:
            self._raise_complaint()

    def _finish(self) -> None:
        assert self._encoder is not None and self._encoder.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # the exit status tells
            self._encoder.stdin.close()
        # ffmpeg ends with 0 even when the last bytes did not fit on the disk, but complains.
        if self._encoder.wait() != 0 or self._complaint():
            self._raise_complaint()
        assert self._part is not None
        os.replace(self._part, self.path)

    def _complaint(self) -> str:
        assert self._log is not None
        self._log.seek(0)
        return self._log.read().decode(errors="replace").strip()

    def _raise_complaint(self) -> None:
        assert self._encoder is not None
        self._encoder.wait()
        text = self._complaint()
        if os.strerror(errno.ENOSPC) in text:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        last = text.splitlines()[-1] if text else f"it ended with {self._encoder.returncode}"
        raise SceneError(f"{self.path} could not be written; the encoder says: {last}")

    def _discard(self) -> None:
        if self._encoder is not None:
            if self._encoder.poll() is None:
                self._encoder.kill()
            self._encoder.wait()
            if self._encoder.stdin is not None:
                with contextlib.suppress(BrokenPipeError):
                    self._encoder.stdin.close()
        if self._log is not None:
            self._log.close()
        super()._discard()


def _png(picture: Picture, compress_level: int = 6) -> bytes:
    return iio.imwrite(
        "<bytes>", picture, plugin="pillow", extension=".png", compress_level=compress_level
    )


def _partial_name(path: Path) -> Path:
    """A name in the same folder that nobody else uses."""
    return part_name(path)
