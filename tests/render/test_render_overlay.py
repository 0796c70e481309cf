"""Colours of quantities, and the bar that explains them."""

import numpy as np
import pytest

from tisoft.errors import SceneError
from tisoft.render.colormap import PALETTE, body_color, colors_of, table
from tisoft.render.items import to_linear
from tisoft.render.overlay import ColorBar, draw_caption, draw_color_bar, draw_labels, ticks


def test_values_run_through_the_map_and_stop_at_its_ends():
    colors = colors_of([-1.0, 0.0, 5.0, 10.0, 99.0, np.nan], 0.0, 10.0)
    assert (colors[0] == colors[1]).all() and (colors[3] == colors[4]).all()
    assert (colors[1] == table()[0]).all() and (colors[3] == table()[255]).all()
    assert np.allclose(colors[2], table()[127:129].mean(axis=0))


def test_lightness_rises_with_the_value():
    luminance = to_linear(table("viridis")) @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(luminance) > 0).all()


def test_a_constant_quantity_and_a_wrong_map():
    assert np.isfinite(colors_of([3.0, 3.0], 3.0, 3.0)).all()
    with pytest.raises(SceneError, match="no colour map"):
        table("rainbows")


def test_bodies_are_told_apart():
    palette = np.array(PALETTE)
    gaps = np.linalg.norm(palette[:, None] - palette[None], axis=2)
    assert gaps[gaps > 0].min() > 0.2
    assert body_color(len(PALETTE)) == body_color(0)


@pytest.mark.parametrize("lo, hi", [(0.0, 1.0), (-3e5, 7.1e6), (1e-7, 1.3e-7), (5.0, 5.0)])
def test_ticks_are_round_and_within(lo, hi):
    values = ticks(lo, hi)
    assert (values >= lo - 1e-12 * abs(hi)).all() and (values <= hi * (1 + 1e-12)).all()
    assert 1 <= len(values) <= 9


@pytest.mark.parametrize("size", [(90, 160), (360, 640), (720, 1280)])
def test_the_bar_shows_the_map_from_bottom_to_top(size):
    white = np.full((*size, 3), 255, dtype=np.uint8)
    picture = draw_color_bar(white, ColorBar("von Mises stress", "Pa", 0.0, 2.5e6))
    assert (white == 255).all()
    hue = picture.max(axis=2).astype(int) - picture.min(axis=2)
    column = np.argmax((hue > 60).sum(axis=0))
    rows = np.nonzero(hue[:, column] > 30)[0]
    assert np.ptp(rows) > size[0] / 6
    expected = 255 * table()[::-1][np.linspace(0, 255, len(rows)).astype(int)]
    assert np.abs(picture[rows, column] - expected).mean() < 10


def test_a_caption_darkens_the_lower_left_only():
    white = np.full((180, 320, 3), 255, dtype=np.uint8)
    changed = (draw_caption(white, "t = 0.25 s") < 255).any(axis=2)
    assert changed[90:, :160].any() and not changed[:90].any() and not changed[:, 160:].any()


def test_labels_stay_inside_the_picture():
    blank = np.full((120, 160, 3), 200, np.uint8)
    marked = draw_labels(blank, ["soft, 200 tets, 13 ms"], np.array([[80.0, 118.0]])) != blank
    rows = marked.any(axis=(1, 2)).nonzero()[0]
    assert 120 - 4 * 20 < rows[0] < 80 and rows[-1] < 119
