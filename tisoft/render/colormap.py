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

# Clay, sea, honey, jade, orchid, slate, sky, sand: told apart by those who do not see red from
# green too, as the hues of Okabe and Ito (2008), but calmer.
PALETTE = (
    (0.90, 0.36, 0.27),
    (0.20, 0.50, 0.80),
    (0.97, 0.76, 0.26),
    (0.16, 0.64, 0.52),
    (0.80, 0.52, 0.74),
    (0.36, 0.40, 0.50),
    (0.50, 0.78, 0.94),
    (0.78, 0.68, 0.52),
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
