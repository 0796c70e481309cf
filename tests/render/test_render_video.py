"""Films have the right length and size, and appear whole or not at all."""

import os
import subprocess
import sys

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from tisoft.errors import SceneError
from tisoft.render import video
from tisoft.render.video import open_sink

SIZE = (64, 48)


def pictures(count, size=SIZE):
    x, y = np.meshgrid(np.linspace(0, 1, size[0]), np.linspace(0, 1, size[1]))
    for k in range(count):
        yield np.stack([255 * x, 255 * y, 0 * x + 255 * k / count], axis=2).astype(np.uint8)


def film(path, count=12, rate=24.0, size=SIZE):
    with open_sink(path, size, rate) as sink:
        for picture in pictures(count, size):
            sink.write(picture)


def decoded(path, size):
    """Frames of a film, shape (n, height, width, 3); an error if their size is another."""
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", str(path)]
    command += ["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    data = subprocess.run(command, capture_output=True, check=True).stdout
    return np.frombuffer(data, dtype=np.uint8).reshape(-1, size[1], size[0], 3)


def durations(path):
    with Image.open(path) as image:
        times = []
        for k in range(image.n_frames):
            image.seek(k)
            image.load()
            times.append(image.info["duration"])
    return times


@pytest.mark.parametrize("size", [SIZE, (65, 49)])
def test_mp4_has_every_frame_and_even_sides(tmp_path, size):
    film(tmp_path / "a.mp4", size=size)
    count, seconds = imageio_ffmpeg.count_frames_and_secs(tmp_path / "a.mp4")
    assert count == 12 and seconds == pytest.approx(0.5, abs=0.02)
    frames = decoded(tmp_path / "a.mp4", (size[0] + size[0] % 2, size[1] + size[1] % 2))
    assert len(frames) == 12
    expected = list(pictures(12, size))[6].astype(int)
    assert np.abs(frames[6][: size[1], : size[0]] - expected).mean() < 8
    assert os.listdir(tmp_path) == ["a.mp4"]


@pytest.mark.parametrize("rate", [24.0, 30.0, 60.0, 7.0])
def test_gif_takes_as_long_as_the_simulation(tmp_path, rate):
    film(tmp_path / "a.gif", count=30, rate=rate)
    times = durations(tmp_path / "a.gif")
    assert sum(times) == pytest.approx(1000 * 30 / rate, abs=1000 / min(rate, 50.0) + 10)
    assert min(times) >= 20


def test_webp_takes_as_long_as_the_simulation(tmp_path):
    film(tmp_path / "a.webp", count=30, rate=60.0)
    times = durations(tmp_path / "a.webp")
    assert len(times) == 30 and sum(times) == pytest.approx(500, abs=20)


def test_png_is_the_last_picture(tmp_path):
    film(tmp_path / "new" / "a.png")
    with Image.open(tmp_path / "new" / "a.png") as image:
        assert (np.asarray(image) == list(pictures(12))[-1]).all()


def test_a_folder_gets_every_picture_and_loses_older_ones(tmp_path):
    film(f"{tmp_path}/frames/", count=5)
    (tmp_path / "frames" / "notes.txt").write_text("kept")
    film(tmp_path / "frames", count=3)
    names = sorted(os.listdir(tmp_path / "frames"))
    assert names == [
        *(f"frame_{k:05d}.png" for k in range(3)),
        "notes.txt",
        "tisoft.json",
    ]
    assert os.listdir(tmp_path) == ["frames"]


@pytest.mark.parametrize("name", ["a.mp4", "a.gif", "a.webp", "a.png", "a"])
def test_an_error_leaves_nothing_and_keeps_the_older_film(tmp_path, name):
    with pytest.raises(RuntimeError), open_sink(tmp_path / name, SIZE, 24.0) as sink:
        for picture in pictures(3):
            sink.write(picture)
        raise RuntimeError
    assert os.listdir(tmp_path) == []


def test_an_interruption_keeps_what_was_drawn(tmp_path):
    with pytest.raises(KeyboardInterrupt), open_sink(tmp_path / "a.mp4", SIZE, 24.0) as sink:
        for picture in pictures(7):
            sink.write(picture)
        raise KeyboardInterrupt
    assert imageio_ffmpeg.count_frames_and_secs(tmp_path / "a.mp4")[0] == 7


@pytest.mark.skipif(sys.platform != "linux", reason="needs /dev/full")
@pytest.mark.parametrize("name", ["a.mp4", "a.gif", "a.webp", "a.png"])
def test_a_full_disk_is_told_in_a_sentence(tmp_path, name, monkeypatch):
    # A link to the device that is always full stands for the temporary file.
    def full(path):
        link = path.with_name("full")
        link.symlink_to("/dev/full")
        return link

    monkeypatch.setattr(video, "_partial_name", full)
    with pytest.raises(SceneError, match="disk is full"):
        film(tmp_path / name, count=100, size=(320, 240))
    assert os.listdir(tmp_path) == []


def test_a_full_disk_while_a_folder_is_filled(tmp_path, monkeypatch):
    def fails(self, *args, **options):
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(Image.Image, "save", fails)
    with pytest.raises(SceneError, match="disk is full"):
        film(tmp_path / "frames")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("name", ["a.mp4", "a.png", "frames"])
def test_a_folder_that_cannot_be_written_is_told_before_the_work(tmp_path, name):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(SceneError, match="cannot be written"):
        open_sink(tmp_path / "file" / name, SIZE, 24.0).__enter__()


def test_unknown_suffixes_and_rates_are_refused(tmp_path):
    with pytest.raises(SceneError, match=r"\.avi"):
        open_sink(tmp_path / "a.avi", SIZE, 24.0)
    with pytest.raises(SceneError, match="frame rate"):
        open_sink(tmp_path / "a.mp4", SIZE, 0.0)
