"""Whether the camera moves: told by the room, and never by the arm."""

import cv2
import numpy as np
import pytest

from lbw_minimal.clips import camera
from tests.strange_cameras import ease
from tests.toy_clips import arm, room

H, W, T = 180, 240, 20


def through(views, picture=None):
    """What a camera sees of a large room, or picture: views (T, 2, 3) from its pixels to that."""
    if picture is None:
        picture = cv2.GaussianBlur(room(2 * H, 2 * W), (0, 0), 1)
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


def test_a_pan_along_tiles_is_followed_where_an_arm_covers_half_of_them():
    """A tile is a fifteenth of the width, and each has its own shade; the arm goes the other way.
    Laid over the first frame alone, one in the middle of the pan slips by some tiles."""
    rng = np.random.default_rng(0)
    tiles = 130 + np.kron(rng.normal(0, 12, (23, 30)), np.ones((16, 16)))[: 2 * H]
    y, x = np.mgrid[: 2 * H, : 2 * W] % 16
    tiles[(y < 3) | (x < 3)] = 70
    picture = np.repeat(np.clip(tiles, 0, 255).astype(np.uint8)[..., None], 3, axis=2)
    x = W / 4 * ease(np.linspace(0, 1, 14))
    frames = through(shifted(x), cv2.GaussianBlur(picture, (0, 0), 1))
    frames = np.clip(frames + rng.normal(0, 10, frames.shape), 0, 255).astype(np.uint8)
    for frame, share in zip(frames, np.linspace(0.1, 0.8, len(x)), strict=True):
        frame[: H // 2, : round(W * share)] = (220, 170, 140)
    alone, _ = camera._followed(frames, np.inf)
    assert camera.extent(alone[:, :2], H, W) < 0.15
    assert camera.extent(camera.sway(frames), H, W) == pytest.approx(0.25, abs=0.02)


@pytest.mark.parametrize(("right", "said"), [(0, False), (1, True)])
def test_of_two_ways_the_first_frame_bears_out_the_one_that_is_right(right, said):
    frames = through(shifted(np.arange(8.0)))
    ways = [np.stack([np.eye(3)] * 8) for _ in range(2)]
    ways[right][:, 0, 2] = -np.arange(8.0)
    assert camera._bears_out(frames, *ways) == said


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


@pytest.mark.parametrize("x", [2.5, 9.3, 15.0])
def test_a_shift_is_found_to_a_tenth_of_a_pixel_be_it_small_or_a_sixteenth_of_the_width(x):
    sways = camera.sway(through(shifted([0, x])))
    np.testing.assert_allclose(sways[-1], [[1, 0, x], [0, 1, 0]], atol=0.1)


def test_each_frame_of_a_clip_is_looked_at_if_they_are_few():
    """A hundred frames, to and fro: what lies between two of them is not interpolated."""
    x = 3.0 * (np.arange(100) % 2)
    small = np.stack([cv2.resize(f, (120, 90)) for f in through(shifted(x))])
    np.testing.assert_allclose(camera.sway(small)[:, 0, 2], x / 2, atol=0.3)


def test_along_stripes_nothing_tells_and_so_nothing_moves():
    """Upright stripes tell how far they go across, and neither a zoom nor what is up and down."""
    x = np.arange(W + 60)
    wave = (120 + 40 * np.sin(x / 9) + 30 * np.sin(x / 23)).astype(np.uint8)
    frames = np.stack([np.broadcast_to(wave[s : s + W, None], (H, W, 3)) for s in range(0, 20, 2)])
    np.testing.assert_allclose(camera.sway(frames)[-1], [[1, 0, 18], [0, 1, 0]], atol=0.3)


def test_what_a_steadied_camera_sees_no_more_stays_as_it_was_last_seen():
    """It goes by two pixels a frame; each frame is of one level of grey."""
    frames = np.stack([np.full((6, 10, 3), 50 * t, np.uint8) for t in (1, 2, 3)])
    sways = np.stack([[[1, 0, 2.0 * t], [0, 1, 0]] for t in range(3)])
    steady = camera.steadied(frames, sways)[:, 3, :, 0]
    assert steady.tolist() == [10 * [50], 2 * [50] + 8 * [100], 2 * [50] + 2 * [100] + 6 * [150]]


@pytest.mark.parametrize(
    ("moving", "standing", "stands"),
    [(60, 0, False), (60, 49, False), (60, 50, True), (0, 0, True), (0, 60, True)],
)
def test_a_camera_moves_if_more_than_six_cells_say_so_to_five_that_it_stands(
    moving, standing, stands
):
    """Of two frames of 9 x 12 cells, in the first and in the second."""
    votes = np.zeros((2, 108))
    votes[0, :moving], votes[1, 108 - standing :] = 1, -1
    assert camera._stands(votes.reshape(2, 9, 12)) == stands


@pytest.mark.parametrize(("rows", "stands"), [(3, True), (4, False)])
def test_cells_that_say_the_camera_moves_lie_about_a_fifth_of_the_picture(rows, stands):
    """Their middles span (rows - 1) x 9 cells of 108: a sixth, or a quarter."""
    votes = np.zeros((1, 9, 12))
    votes[0, :rows, :10] = 1
    assert camera._stands(votes) == stands


def test_a_pixel_that_is_off_by_the_noise_is_half_unlike_and_one_not_shown_is_neither():
    off, inside = np.array([[0.0, 2.0, -6.0, 50.0]]), np.array([[True, True, True, False]])
    np.testing.assert_allclose(camera._unlike(off, inside, 2.0), [[0, 0.5, 0.9, 0.5]])


def test_the_noise_is_what_most_pixels_are_off_and_at_least_two_levels():
    """1.4826 medians of the size are a normal deviation; a few pixels that moved change nothing."""
    off = np.random.default_rng(0).normal(0, 5, (100, 100))
    off[:20] = 200
    everywhere = np.ones(off.shape, bool)
    assert camera._noise(off[20:], everywhere[20:]) == pytest.approx(5, rel=0.05)
    assert camera._noise(off, everywhere) < 7
    off[:20] = 0
    shown = everywhere.copy()
    shown[:20] = False
    assert camera._noise(off, shown) == pytest.approx(5, rel=0.05)
    assert camera._noise(off / 50, everywhere) == camera._noise(off, ~everywhere) == 2


def test_a_cell_of_a_twelfth_votes_where_a_tenth_speaks_for_one_side():
    """Half of the picture as the moved camera sees it, half as the one that stands does."""
    moved, still = through(shifted([8, 0]))
    picture = camera._Picture(still, 200)
    both = np.where(np.arange(W)[None, :, None] < W // 2, moved, still)
    there = np.array([[1, 0, -8], [0, 1, 0], [0, 0, 1.0]])
    votes = picture.votes(camera._plain(both, picture.size), there, np.eye(3))
    assert votes.shape == (9, 12)
    assert (votes[:, 1:5] >= 0).mean() > 0.9 and (votes[:, 1:5] > 0).mean() > 0.2
    assert (votes[:, 7:] == 0).mean() < 0.8 and (votes[:, 7:] <= 0).all()


@pytest.mark.parametrize(("unlike", "vote"), [(0.08, 0), (0.12, 1)])
def test_a_tenth_more_unlike_is_a_vote(unlike, vote, monkeypatch):
    """The noise is two levels, so a pixel that is off by 2 q^1/2 is unlike by q / (1 + q)."""
    picture = camera._Picture(np.zeros((H, W, 3), np.uint8), 200)
    off = np.full((150, 200), 2 * np.sqrt(unlike / (1 - unlike)))
    offs = [(0 * off, off >= 0), (off, off >= 0)]
    for given, said in ((offs, vote), (offs[::-1], -vote)):
        given = iter(given)
        monkeypatch.setattr(camera._Picture, "_off", lambda *_, g=given: next(g))
        assert (picture.votes(picture.plain, np.eye(3), np.eye(3)) == said).all()


def test_the_extent_is_that_of_all_frames_and_not_of_the_last():
    sways = np.stack([[[1, 0, x], [0, 1, 0]] for x in (0.0, 12, -12, 0)])
    assert camera.extent(sways, H, W) == pytest.approx(24 / W)


@pytest.mark.parametrize(("height", "found"), [(2.0, 1.0), (0.05, 0.0)])
def test_a_step_is_as_long_as_the_evidence_is_strong(height, found, monkeypatch):
    """A hump that goes by a pixel: two levels high it is followed, a twentieth of one it is not,
    which is far below the noise of two levels that a pixel is taken to have."""
    monkeypatch.setattr(camera, "_plain", lambda frame, size: frame)
    y, x = np.mgrid[:90, :120].astype(np.float32)
    hump, moved = (
        height * np.exp(-((x - 60 - s) ** 2 + (y - 45) ** 2) / 50).astype(np.float32)
        for s in (0, 1)
    )
    there = camera._Picture(hump, 120).laid(moved, np.eye(3))
    np.testing.assert_allclose(there[:2, 2] + there[:2, :2] @ (60, 45) - (60, 45), (found, 0),
                               atol=0.1)  # fmt: skip


def test_a_pixel_that_is_shown_in_part_is_not_compared():
    picture = camera._Picture(np.zeros((90, 120, 3), np.uint8), 120)
    half = np.array([[1, 0, 0.5], [0, 1, 0], [0, 0, 1.0]])
    _, inside = picture._off(picture.plain, half)
    assert inside[:, :-1].all() and not inside[:, -1].any()
