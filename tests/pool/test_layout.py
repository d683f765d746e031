"""Where samples stand in textures of the frame's size."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from deferred_ir.pool.layout import NONE, Layout


@st.composite
def layouts(draw):
    size = draw(st.tuples(st.integers(1, 40), st.integers(1, 40)))
    scale = draw(st.integers(1, 8))
    offset = draw(st.tuples(st.integers(0, scale - 1), st.integers(0, scale - 1)))
    columns, rows = Layout(size, scale).grid
    return Layout(size, scale, offset, draw(st.integers(0, size[0] * size[1] - columns * rows)))


@given(layouts())
def test_there_is_room_for_every_pixel_and_no_texel_is_taken_twice(layout):
    (width, height), (columns, rows) = layout.size, layout.grid
    grid = (np.arange(rows)[:, None] * width + np.arange(columns)).ravel()
    places = np.concatenate([grid, layout.find_list_places()])
    assert len(np.unique(places)) == columns * rows + layout.listed
    assert places.max() < width * height


@given(layouts())
def test_what_is_drawn_holds_all_samples_and_no_texel_twice(layout):
    drawn = np.zeros(layout.size[::-1], int)
    for x, y, width, height in layout.list_rectangles():
        assert width > 0 < height
        drawn[y : y + height, x : x + width] += 1
    assert drawn.max() == 1
    assert drawn.ravel()[layout.find_list_places()].all()
    assert drawn[: layout.grid[1], : layout.grid[0]].all()


@given(layouts())
def test_a_texel_tells_its_pixel(layout):
    pixels = np.arange(layout.listed) * 7 % (layout.size[0] * layout.size[1])
    placed = layout.place(pixels)
    assert (placed.ravel()[layout.find_list_places()] == pixels).all()
    assert (placed[: layout.grid[1], : layout.grid[0]] == layout.find_grid_pixels()).all()
    assert (placed != NONE).sum() == layout.grid[0] * layout.grid[1] + layout.listed


@given(layouts())
def test_no_pixel_is_farther_than_a_step_from_the_grid(layout):
    y, x = np.divmod(layout.find_grid_pixels(), layout.size[0])
    for found, size in ((x[0], layout.size[0]), (y[:, 0], layout.size[1])):
        assert found[0] < layout.scale
        assert size - 1 - found[-1] < layout.scale
        assert (np.diff(found) <= layout.scale).all()


def test_every_seed_has_a_grid_of_its_own_and_all_pixels_take_turns():
    offsets = {Layout.of_frame((8, 8), 2, seed).offset for seed in range(32)}
    assert offsets == {(0, 0), (0, 1), (1, 0), (1, 1)}
    assert Layout.of_frame((8, 8), 2, 5) == Layout.of_frame((8, 8), 2, 5)
