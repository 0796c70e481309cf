"""Colours of quantities and of bodies, as sRGB in 0..1.

The maps of quantities are matplotlib's perceptually uniform ones (viridis and its kin; Smith and
van der Walt 2015).
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tisoft.errors import SceneError

Colors = NDArray[np.float32]

# Clay, sea, honey, leaf, plum, lagoon, coral, moss: far apart in hue, alike in lightness.
PALETTE = (
    (0.90, 0.36, 0.27),
    (0.22, 0.55, 0.82),
    (0.96, 0.72, 0.22),
    (0.33, 0.70, 0.45),
    (0.63, 0.41, 0.75),
    (0.20, 0.72, 0.64),
    (0.93, 0.50, 0.61),
    (0.60, 0.66, 0.28),
)


def body_color(number: int) -> tuple[float, float, float]:
    """Colour of the body with that number; they repeat after the palette's last."""
    return PALETTE[number % len(PALETTE)]


@cache
def table(name: str = "viridis") -> Colors:
    """The 256 colours of a map, shape (256, 3). Raises SceneError for a name unknown."""
    import matplotlib

    try:
        colormap = matplotlib.colormaps[name]
    except KeyError:
        message = f"There is no colour map named {name!r}: viridis, inferno and turbo are some."
        raise SceneError(message) from None
    colors = np.asarray(colormap(np.linspace(0.0, 1.0, 256))[:, :3], dtype=np.float32)
    colors.setflags(write=False)
    return colors


def colors_of(values: ArrayLike, lo: float, hi: float, *, name: str = "viridis") -> Colors:
    """Colours of values between lo and hi, shape (n, 3); values outside get the end's colour."""
    v = np.asarray(values, dtype=np.float64)
    share = (v - lo) / (hi - lo) if hi > lo else np.zeros_like(v)
    position = 255.0 * np.clip(np.nan_to_num(share), 0.0, 1.0)
    low = np.minimum(position.astype(np.int64), 254)
    part = (position - low).astype(np.float32)[:, None]
    colors = table(name)
    return colors[low] * (1.0 - part) + colors[low + 1] * part
