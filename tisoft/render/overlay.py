"""Text on a picture: the colour bar with its ticks, and a caption.

Drawn with Pillow and the font that matplotlib carries, so it looks the same everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from tisoft.render.colormap import table

Picture = NDArray[np.uint8]

INK = (38, 44, 52)
PAPER = (236, 239, 242)
"""Round the letters of labels, which may lie on anything."""
PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}


@dataclass(frozen=True)
class ColorBar:
    """What the colours mean: a quantity's label and unit, over values from lo to hi (SI)."""

    label: str
    unit: str
    lo: float
    hi: float
    name: str = "viridis"


@cache
def font(size: int) -> ImageFont.FreeTypeFont:
    """DejaVu Sans of a height in pixels."""
    import matplotlib

    path = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
    return ImageFont.truetype(str(path), size)


def ticks(lo: float, hi: float, about: int = 5) -> NDArray[np.float64]:
    """Round values from lo to hi: multiples of 1, 2 or 5 times a power of ten."""
    if not hi > lo:
        return np.array([lo])
    raw = (hi - lo) / about
    power = 10.0 ** np.floor(np.log10(raw))
    step = power * min((1.0, 2.0, 5.0, 10.0), key=lambda m: abs(np.log(m * power / raw)))
    return step * np.arange(np.ceil(lo / step - 1e-9), np.floor(hi / step + 1e-9) + 1)


def _scale(bar: ColorBar) -> tuple[float, str]:
    """Divisor and unit with its prefix that bring the numbers between 1 and 1000."""
    largest = max(abs(bar.lo), abs(bar.hi))
    if largest == 0.0 or not np.isfinite(largest):
        return 1.0, bar.unit
    power = int(np.floor(np.log10(largest) / 3.0 + 1e-9)) * 3
    if not bar.unit or bar.unit == "%":
        return 1.0, bar.unit
    if power not in PREFIXES:
        return 10.0**power, f"1e{power} {bar.unit}"
    if PREFIXES[power] and not bar.unit[0].isalpha():
        return 1.0, bar.unit
    return 10.0**power, PREFIXES[power] + bar.unit


def draw_color_bar(picture: Picture, bar: ColorBar) -> Picture:
    """The picture with the bar at its right edge, its numbers to the left of it."""
    height, width = picture.shape[:2]
    unit = max(height / 36.0, 14.0)  # height of a line of text
    face = font(round(0.72 * unit))
    small = font(round(0.66 * unit))
    right, top = width - round(1.1 * unit), round(3.2 * unit)
    left, bottom = right - round(0.75 * unit), round(height * 0.5 + top * 0.5)
    strip = table(bar.name)[::-1][np.linspace(0, 255, bottom - top).astype(int)]
    out = picture.copy()
    out[top:bottom, left:right, :3] = np.round(255.0 * strip[:, None, :]).astype(np.uint8)
    out[top:bottom, left:right, 3:] = 255
    image = Image.fromarray(out)
    draw = ImageDraw.Draw(image)
    draw.rectangle((left, top, right - 1, bottom - 1), outline=INK)
    divisor, shown_unit = _scale(bar)
    lo, hi = bar.lo / divisor, bar.hi / divisor
    values = ticks(lo, hi)
    digits = _digits(values)
    for value in values:
        y = bottom - 1 - (value - lo) / ((hi - lo) or 1.0) * (bottom - top - 1)
        draw.line((left - 0.3 * unit, y, left - 1, y), fill=INK)
        text = f"{value + 0.0:.{digits}f}".replace("-", "−")
        draw.text((left - 0.45 * unit, y), text, fill=INK, font=small, anchor="rm")
    title = bar.label + (f" [{shown_unit}]" if shown_unit else "")
    draw.text((right, top - 0.7 * unit), title, fill=INK, font=face, anchor="rb")
    return np.asarray(image)


def _digits(values: NDArray[np.float64]) -> int:
    """Decimals that tell neighbouring ticks apart."""
    if len(values) < 2:
        return 3
    return int(np.clip(np.ceil(-np.log10(abs(values[1] - values[0])) - 1e-9), 0, 9))


def draw_caption(picture: Picture, text: str) -> Picture:
    """The picture with a line of text at its lower left."""
    height = picture.shape[0]
    unit = max(height / 36.0, 14.0)
    image = Image.fromarray(picture)
    ImageDraw.Draw(image).text(
        (unit, height - unit), text, fill=INK, font=font(round(0.72 * unit)), anchor="ls"
    )
    return np.asarray(image)


def draw_labels(picture: Picture, texts: Sequence[str], places: NDArray[np.float64]) -> Picture:
    """The picture with texts below places [pixels], shape (texts, 2), a line for each part that a
    comma ends.
    """
    height = picture.shape[0]
    unit = max(height / 36.0, 14.0)
    face = font(round(0.85 * unit))
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    for text, (x, y) in zip(texts, places, strict=True):
        lines = text.replace(", ", "\n")
        shape: Any = {"font": face, "anchor": "ma", "align": "center", "spacing": 0.1 * unit}
        shape["stroke_width"] = round(0.1 * unit)
        high = draw.multiline_textbbox((0, 0), lines, **shape)[3]
        top = min(y + 0.5 * unit, height - high - 0.3 * unit)
        draw.multiline_text((x, top), lines, INK, stroke_fill=PAPER, **shape)
    return np.asarray(image)
