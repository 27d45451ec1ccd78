"""How a stored picture is turned, squared, shrunk and freed of its borders, by numbers."""

from types import SimpleNamespace

import numpy as np
import pytest

from lbw_minimal.clips import hdr
from lbw_minimal.clips.decoding import Stream
from lbw_minimal.clips.upright import SIDE, WHOLE, Upright, _inner, borders


def stream(width, height, pixel=1.0):
    return Stream(0, width, height, pixel, 25.0, 1.0)


@pytest.mark.parametrize(
    ("width", "height", "pixel", "lies", "size"),
    [
        (1920, 1080, 1.0, False, (320, 180)),  # a sixth
        (1080, 1920, 1.0, False, (180, 320)),
        (1920, 1080, 1.0, True, (320, 180)),  # is turned after it is shrunk
        (300, 200, 1.0, False, (300, 200)),  # never enlarged
        (720, 576, 16 / 15, False, (320, 240)),  # a DVD: 768 by 576
        (200, 100, 0.5, False, (200, 200)),
        (100, 200, 2.0, False, (200, 200)),
    ],
)
def test_the_longer_side_is_320_pixels_and_pixels_are_square(width, height, pixel, lies, size):
    assert Upright(stream(width, height, pixel))._size(lies) == size
    assert SIDE == 320
    if not lies:
        assert Upright(stream(width, height, pixel)).bytes == 3 * size[0] * size[1]


def test_what_is_kept_of_a_boxed_picture_has_320_pixels():
    """The middle half of 1280 x 720, 640 wide: a half of it all."""
    up = Upright(stream(1280, 720), window=(0.0, 1.0, 0.25, 0.75))
    w, h = up._size(lies=False)
    assert h == 320 and w == round(1280 * 320 / 720)
    assert up._inside(np.zeros((h, w, 3))).shape[0] == 320
    assert up._inside(np.zeros((h, w, 3))).shape[1] == pytest.approx(w / 2, abs=2)


@pytest.mark.parametrize(
    ("turn", "corner"), [(0, (0, 0)), (90, (0, -1)), (180, (-1, -1)), (270, (-1, 0))]
)
def test_a_turn_is_clockwise(turn, corner):
    """Where the stored picture's upper left corner comes to lie."""
    stored = np.zeros((4, 6, 3), np.uint8)
    stored[0, 0] = 255
    up = Upright(stream(6, 4), turn=turn)
    up._scaler = SimpleNamespace(
        reformat=lambda frame, **how: SimpleNamespace(to_ndarray=lambda: stored)
    )
    frame = SimpleNamespace(width=6, height=4, colorspace=1, color_trc=1, side_data={})
    seen = up(frame)
    assert seen.shape[:2] == ((4, 6) if turn % 180 == 0 else (6, 4))
    assert seen[corner].min() == 255 and (seen > 0).sum() == 3
    said = f"It was turned by {turn} degrees clockwise, as was asked."
    assert up.notes == ([said] if turn else [])


@pytest.mark.parametrize(
    ("rows", "matrix", "asked"),
    [(480, 2, None), (720, 2, "ITU709"), (1080, 2, "ITU709"), (1080, 1, None)],
)
def test_an_hd_film_that_names_no_matrix_has_bt_709s(rows, matrix, asked):
    given = {}

    def reformat(frame, **how):
        given.update(how)
        return SimpleNamespace(to_ndarray=lambda: np.zeros((9, 16, 3), np.uint8))

    up = Upright(stream(16 * rows // 9, rows))
    up._scaler = SimpleNamespace(reformat=reformat)
    up(
        SimpleNamespace(
            width=16 * rows // 9, height=rows, colorspace=matrix, color_trc=1, side_data={}
        )
    )
    assert given.get("src_colorspace") == asked
    assert (given["width"], given["interpolation"]) == (320, "AREA")


@pytest.mark.parametrize(
    ("width", "height", "pixel", "how"),
    [
        (1280, 720, 1.0, "AREA"),
        (310, 200, 1.5, "BICUBIC"),  # 465 by 200 pixels become 320 by 138: wider, and less high
        (200, 310, 1 / 1.5, "BICUBIC"),
        (600, 400, 1.5, "AREA"),
    ],
)
def test_areas_are_averaged_only_where_both_sides_get_shorter(width, height, pixel, how):
    given = {}

    def reformat(frame, **asked):
        given.update(asked)
        return SimpleNamespace(to_ndarray=lambda: np.zeros((9, 16, 3), np.uint8))

    up = Upright(stream(width, height, pixel))
    up._scaler = SimpleNamespace(reformat=reformat)
    up(SimpleNamespace(width=width, height=height, colorspace=1, color_trc=1, side_data={}))
    assert given["interpolation"] == how


def boxed(top=0, bottom=0, left=0, right=0, level=0, inside=120):
    frames = np.full((9, 100, 200, 3), level, np.uint8)
    frames[:, top : 100 - bottom, left : 200 - right] = inside
    return frames


def test_borders_are_shares_of_the_picture():
    assert borders(boxed(top=10, bottom=20)) == (0.1, 0.8, 0, 1)
    assert borders(boxed(left=30, right=10)) == (0, 1, 0.15, 0.95)
    assert borders(boxed(top=10, bottom=10, left=20, right=20)) == (0.1, 0.9, 0.1, 0.9)
    assert borders(boxed()) is None and WHOLE == (0, 1, 0, 1)


def test_black_is_up_to_24_grey_levels_and_a_border_two_lines_wide_or_more():
    assert borders(boxed(top=10, level=24)) == (0.1, 1, 0, 1)
    assert borders(boxed(top=10, level=25)) is None
    assert borders(boxed(top=1)) is None and borders(boxed(top=2)) is not None


def test_a_border_is_black_throughout_and_ends_where_half_is_bright():
    lit = boxed(top=10)
    lit[4, 3, :10] = 200  # a twentieth of a line, once
    assert borders(lit) is None
    speck = boxed(top=10)
    speck[4, 3, :2] = 200  # a hundredth: noise
    assert borders(speck) == (0.1, 1, 0, 1)
    dark = boxed(top=10)
    dark[:, 10:, 90:] = 0  # of the lines below less than half is bright
    assert borders(dark) is None


def test_what_is_black_for_almost_half_of_the_picture_is_a_border_and_more_is_none():
    share = np.ones((3, 100))
    share[:, :44] = 0
    assert _inner(share) == (44, 100)
    share[:, :45] = 0
    assert _inner(share) == (0, 100)
    share[:] = 1
    share[:, -20:] = 0
    assert _inner(share) == (0, 80)


def test_a_soft_edge_is_part_of_the_border():
    share = np.ones((3, 100))
    share[:, :10], share[:, 10:12] = 0, 0.3
    assert _inner(share) == (12, 100)


def test_white_is_that_of_the_first_frame_that_is_not_black(monkeypatch):
    """Exposure that followed each frame would flicker; a film may fade in from black."""
    lights = iter([0.05, 1.0, 9.0, 9.0])
    monkeypatch.setattr(hdr, "screen_light", lambda signal, transfer: np.full(3, next(lights)))
    monkeypatch.setattr(hdr, "white_of", lambda light: 2 * light.max())
    monkeypatch.setattr(hdr, "tone_map", lambda light, white: white)
    up = Upright(stream(6, 4))
    up._scaler = SimpleNamespace(
        reformat=lambda frame, **how: SimpleNamespace(to_ndarray=lambda: how["format"])
    )
    whites = [up._tone_mapped(SimpleNamespace(color_trc=t), {}) for t in (18, 18, 18, 16)]
    assert whites == pytest.approx([0.1, 2.0, 2.0, 2.0])
    assert [note[:9] for note in up.notes] == ["HDR (HLG)", "HDR (PQ) "]
