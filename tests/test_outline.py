"""The far end of an arm that comes into a picture: a bar whose end is known."""

import numpy as np
import pytest
from toy_clips import room

from lbw_minimal.clips.detector import Found
from lbw_minimal.clips.outline import far_end, reaching

H, W = 168, 252  # two and three pixels for one of the 84 by 84 in which it is looked for
DEPTHS = np.concatenate([np.zeros(10), np.linspace(10, 160, 30)]).round().astype(int)
TURNS = {
    "left": 0,
    "upper": -1,
    "right": 2,
    "lower": 1,
}  # of a picture into which it comes from the left


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
    turned = {"left": (x, y), "right": (W - x, H - y), "upper": (y, H - x), "lower": (W - y, x)}
    return turned[side]


@pytest.mark.parametrize("body", [0, 60], ids=["arm", "body"])
@pytest.mark.parametrize("side", ["left", "right", "upper", "lower"])
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
    """A thing as large as an arm, which leaves 20 pixels and more on each side."""
    frames = np.repeat(room(H, W)[None], 30, axis=0)
    for t in range(10, 30):
        frames[t, 20 + 2 * t : 90 + 2 * t, 60 : 120 + 2 * t] = (220, 170, 140)
    assert not far_end(frames)[1].any()


@pytest.mark.parametrize(("wide", "arm"), [(4, False), (12, True)])
def test_a_stick_that_covers_less_than_a_sixtieth_of_the_picture_is_no_arm(wide, arm):
    """60 pixels deep, of which some more differ than it covers."""
    frames = np.repeat(room(H, W)[None], len(DEPTHS), axis=0)
    for frame, depth in zip(frames, DEPTHS, strict=True):
        frame[H // 2 - wide // 2 : H // 2 + wide // 2, : min(depth, 60)] = (220, 170, 140)
    assert far_end(frames)[1].any() == arm


@pytest.mark.parametrize(
    ("share", "way", "outline"),
    [(0.45, 80, True), (0.55, 80, False), (1, 16, True), (1, 18, False)],
    ids=["rarely", "often", "rests", "goes"],
)
def test_a_tip_that_is_rarely_sure_or_rests_while_an_arm_comes_in_is_not_believed(
    share, way, outline
):
    """From when the arm is inside, at a share of the frames; a way from its first to its last
    quarter, of which a tenth of the picture's shorter side, 168 pixels, is enough."""
    frames = comes_in("left")
    tip, inside = far_end(frames)
    sure = np.zeros(len(frames))
    sure[np.flatnonzero(inside)[: round(share * inside.sum())]] = 1
    along = np.flatnonzero(sure)
    path = np.zeros((len(frames), 2))
    path[along, 0] = np.where(np.arange(len(along)) < len(along) / 2, 0, way)
    found = reaching(frames, Found(path, path + 1, sure, sure))
    assert np.array_equal(found.tip, tip if outline else path)
    assert np.array_equal(found.tip_sure, inside if outline else sure)
    assert np.array_equal(found.object, path + 1)


def test_where_no_arm_comes_in_the_tip_is_as_it_was_found():
    frames = np.repeat(room(H, W)[None], 30, axis=0)
    found = Found(*[np.ones((30, 2))] * 2, *[np.zeros(30)] * 2)
    assert reaching(frames, found) is found
    stirs = comes_in("left", np.where(np.arange(40) < 30, 0, 100))  # in a quarter of the frames
    found = Found(*[np.ones((40, 2))] * 2, *[np.zeros(40)] * 2)
    assert reaching(stirs, found) is found


def found_at(sure):
    """A tip that rests, as sure as that in each frame."""
    return Found(*[np.ones((len(sure), 2))] * 2, sure.astype(float), np.zeros(len(sure)))


def test_a_hand_that_stirs_at_one_place_does_not_say_that_the_tip_rests_elsewhere():
    stays = found_at(np.ones(40))
    assert reaching(comes_in("left", np.where(np.arange(40) < 10, 0, 100)), stays).tip is stays.tip
    goes = comes_in("left")
    assert reaching(goes, stays) is not stays


def test_a_tip_that_is_sure_before_an_arm_is_inside_says_nothing():
    """Twenty frames of an empty room, and then a hand that stirs at one place, without a tip."""
    waits = np.arange(40) < 20
    found = reaching(comes_in("left", np.where(waits, 0, 100)), found_at(waits))
    assert found.tip_sure.tolist() == (~waits).tolist()


def test_a_tip_that_is_found_late_came_by_the_way_of_its_outline():
    """It is found from half of the way on, eight pixels beside the outline's, and once before the
    arm is inside, where nothing is."""
    frames = comes_in("left")
    tip, inside = far_end(frames)
    came, late = int(inside.argmax()), 20
    sure = np.where(np.arange(40) < late, 0.2, 0.9)
    sure[2] = 0.9
    path = np.where(np.arange(40)[:, None] < late, 0, tip + (0, 8))
    found = reaching(frames, Found(path, path, sure, sure))
    assert found.tip_sure.tolist() == [0] * came + [1] * (late - came) + [0.9] * (40 - late)
    off = np.stack([np.zeros(late - came), np.linspace(0, 8, late - came, endpoint=False)], axis=1)
    np.testing.assert_allclose(found.tip[came:late] - tip[came:late], off, atol=1e-9)
    assert np.array_equal(found.tip[late:], path[late:])


LIES = np.array([200.0, 40.0])  # where nothing ever is but the room


def then_at_the_hand(frames, first):
    """A tip that is sure in every frame: at a place until the arm is inside, and then its end."""
    tip, inside = far_end(frames)
    path = np.where(inside[:, None], tip, first)
    return Found(path, path, np.ones(len(frames)), np.zeros(len(frames))), inside


def test_what_lies_where_nothing_differs_is_no_tip_before_an_arm_is_inside():
    frames = comes_in("left")
    found, inside = then_at_the_hand(frames, LIES)
    assert np.array_equal(reaching(frames, found).tip_sure, inside)
    assert (reaching(frames[15:], Found(*(v[15:] for v in vars(found).values()))).tip_sure).all()


@pytest.mark.parametrize("off", [4, 6])
def test_a_hand_that_is_seen_before_its_arm_is_large_is_a_tip(off):
    """A fingertip at one place, so many of 84 pixels beside the tip: in the first frames, and then
    gone; or not in the first two, and from then on."""
    frames = comes_in("left")
    found, inside = then_at_the_hand(frames, LIES)
    early = np.arange(40) < inside.argmax()
    x, y = LIES.astype(int) + (3 * off, 0)  # of a picture three times as wide
    for shown in (np.arange(40) < 10, np.arange(40) > 1):
        stirs = frames.copy()
        stirs[shown, y - 2 : y + 2, x : x + 6] = (220, 170, 140)
        sure = reaching(stirs, found).tip_sure
        assert (sure[early & shown] == (off <= 4)).all() and sure[inside].all()
