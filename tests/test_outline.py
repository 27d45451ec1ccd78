"""The far end of an arm that comes into a picture: a bar whose end is known."""

import numpy as np
import pytest
from toy_clips import room

from lbw_minimal.clips.outline import far_end

H, W = 168, 252  # two and three pixels for one of the 84 by 84 in which it is looked for
DEPTHS = np.concatenate([np.zeros(10), np.linspace(10, 160, 30)]).round().astype(int)
TURNS = {"left": 0, "upper": -1, "right": 2}  # of a picture into which it comes from the left


def comes_in(side, depths=DEPTHS, body=0):
    """A bar as deep (T,) in pixels, 30 wide, at half of the edge; `body` pixels behind its end it
    widens to half of the picture."""
    frames = np.repeat(room(H, W)[None], len(depths), axis=0)
    for frame, depth in zip(frames, depths, strict=True):
        frame[H // 2 - 15 : H // 2 + 15, :depth] = (220, 170, 140)
        if body:
            frame[H // 4 : 3 * H // 4, : max(0, depth - body)] = (40, 40, 90)
    return np.ascontiguousarray(np.rot90(frames, TURNS[side], axes=(1, 2)))


def along_and_across(side, points):
    """Points (T, 2), seen from the edge: how deep in the picture, and where along the edge."""
    x, y = points.T
    return {"left": (x, y), "right": (W - x, H - y), "upper": (y, H - x)}[side]


@pytest.mark.parametrize("body", [0, 60], ids=["arm", "body"])
@pytest.mark.parametrize("side", ["left", "right", "upper"])
def test_the_tip_is_the_end_that_is_farthest_from_the_edge(side, body):
    tip, seen = far_end(comes_in(side, body=body))
    inside = DEPTHS > 50
    assert seen[inside].all() and not seen[DEPTHS == 0].any()
    deep, across = along_and_across(side, tip[inside])
    assert np.abs(deep - DEPTHS[inside]).max() <= 9 and np.abs(across - H / 2).max() <= 15


@pytest.mark.parametrize(("deep", "ends"), [(225, True), (252, False)])
def test_what_reaches_across_all_the_picture_has_no_end_in_it(deep, ends):
    for side in ("left", "right"):
        _, seen = far_end(comes_in(side, np.minimum(2 * DEPTHS, deep)))
        assert seen[-1] == ends


def test_what_moves_and_does_not_come_in_over_an_edge_is_no_arm():
    """A thing as large as an arm, which leaves 25 pixels on each side; then it comes to the lower
    edge, over which none of the scenes' arms comes."""
    frames = np.repeat(room(H, W)[None], 30, axis=0)
    for t in range(10, 30):
        frames[t, 60 + 2 * t : 110 + 2 * t, 60 : 120 + 2 * t] = (220, 170, 140)
    assert not far_end(frames)[1].any()
