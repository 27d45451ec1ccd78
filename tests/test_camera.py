"""Whether the camera moves: told by the room, and never by the arm."""

import cv2
import numpy as np
import pytest

from lbw_minimal.clips import camera
from tests.toy_clips import arm, room

H, W, T = 180, 240, 20


def through(views, height=2 * H, width=2 * W):
    """What a camera sees of a large room: views (T, 2, 3) from its pixels to the room's."""
    picture = cv2.GaussianBlur(room(height, width), (0, 0), 1)
    how = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.stack([cv2.warpAffine(picture, view, (W, H), flags=how) for view in views])


def shifted(x):
    """Views of a camera that looks so many pixels (T,) to the right."""
    return np.array([[[1, 0, 60 + s], [0, 1, 60]] for s in x], float)


def zoomed(scales):
    return np.array([[[s, 0, 60], [0, s, 60]] for s in scales], float)


@pytest.mark.parametrize("pace", [0.3, 3.0])
def test_a_pan_is_followed_be_it_slow_or_fast(pace):
    x = pace * np.arange(T)
    sways = camera.sway(through(shifted(x)))
    np.testing.assert_allclose(sways[-1], [[1, 0, x[-1]], [0, 1, 0]], atol=1.2)
    assert camera.extent(sways, H, W) == pytest.approx(x[-1] / W, abs=0.01)


def test_a_zoom_moves_the_pictures_corners():
    sways = camera.sway(through(zoomed(np.linspace(1, 1.2, T))))
    assert camera.extent(sways, H, W) == pytest.approx(0.2, abs=0.02)


def test_what_trembles_stands_still_when_it_is_steadied():
    x = 4 * np.sin(np.arange(T))
    frames = through(shifted(x - x[0]))
    steady = camera.steadied(frames, camera.sway(frames))
    inside = np.s_[:, 10:-10, 10:-10]
    off = np.abs(steady[inside].astype(float) - frames[0][10:-10, 10:-10]).mean()
    assert off < 0.2 * np.abs(frames[inside].astype(float) - frames[0][10:-10, 10:-10]).mean()


@pytest.mark.parametrize("furnished", [True, False])
def test_an_arm_is_no_camera_even_where_the_room_has_nothing_else(furnished):
    """In a bare room all edges are the arm's: nothing tells that the camera moves."""
    picture = room(H, W) if furnished else np.full((H, W, 3), 120, np.uint8)
    frames = arm(np.linspace(0.1, 0.7, T), picture)
    frames[:, H // 2 : 2 * H // 3 : 6] //= 2  # a striped sleeve
    assert camera.extent(camera.sway(frames), H, W) == 0


def test_a_pan_is_followed_behind_a_large_thing_that_goes_another_way():
    """A quarter of the picture does not fit, and so weighs little."""
    x = 1.5 * np.arange(T)
    frames = through(shifted(x))
    thing = cv2.GaussianBlur(room(90, 120, seed=7), (0, 0), 1)
    for t, frame in enumerate(frames):
        frame[50:140, 20 + 4 * t : 140 + 4 * t] = thing
    sways = camera.sway(frames)
    np.testing.assert_allclose(sways[-1], [[1, 0, x[-1]], [0, 1, 0]], atol=1.2)


def test_light_that_flickers_moves_nothing():
    light = 1 + 0.1 * np.sin(np.arange(T))[:, None, None, None]
    frames = np.clip(through(shifted(np.zeros(T))) * light, 0, 255).astype(np.uint8)
    assert camera.extent(camera.sway(frames), H, W) == 0


def test_in_a_room_without_anything_nothing_moves():
    sways = camera.sway(np.full((6, H, W, 3), 128, np.uint8))
    np.testing.assert_allclose(sways, np.eye(3)[None, :2].repeat(6, 0))
    assert camera.extent(sways, H, W) == 0


@pytest.mark.parametrize(
    ("fixed", "angle"), [((0, 0), -0.1), ((W, 0), 0.1), ((0, H), 0.1), ((W, H), -0.1)]
)
def test_the_extent_is_the_way_of_the_corner_opposite_to_one_that_stays(fixed, angle):
    """A turn about a corner of the picture; the other two go less far."""
    c, s = np.cos(angle), np.sin(angle)
    turn, fixed = np.array([[c, -s], [s, c]]), np.array(fixed, float)
    view = np.column_stack([turn, fixed - turn @ fixed])
    way = (turn - np.eye(2)) @ ((W, H) - 2 * fixed)
    sways = np.stack([np.eye(3)[:2], view])
    assert camera.extent(sways, H, W) == pytest.approx(np.abs(way).max() / W)
