"""How many arms come into a clip, and where: by masks drawn by hand and by the detector's."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from toy_clips import arm, room

from lbw_minimal.clips import arms
from lbw_minimal.clips.detector import Detector
from lbw_minimal.clips.footage import Footage
from lbw_minimal.clips.motion import some
from lbw_minimal.clips.sight import Sight
from tasks.commands.prepare import EYES

H, W = 32, 42  # cells


def mask(*pieces):
    """A mask in which rectangles (left, top, width, height, sureness) show an arm."""
    out = np.zeros((H, W), np.float32)
    for left, top, width, height, sure in pieces:
        out[top : top + height, left : left + width] = sure
    return out


ARM = 20, 0, 4, 12, 0.9  # from above


ROOM = np.zeros((5, 84, 84))  # in which nothing moves


def count(*masks):
    return arms.count(np.stack(masks), ROOM)


def told(*pieces):
    return count(*[mask(*pieces)] * 4)


@pytest.mark.parametrize(
    ("piece", "enters"),
    [(ARM, 22 / W), ((0, 10, 12, 4, 0.9), 2 / W), ((30, 10, 12, 4, 0.9), 40 / W)],
    ids=["from above", "from the left", "from the right"],
)
def test_an_arm_is_told_by_where_its_first_four_cells_are(piece, enters):
    found = told(piece)
    assert (found.seen, found.several, found.doubt) == (1, 0, None)
    assert found.enters == pytest.approx(enters)


@pytest.mark.parametrize(
    ("piece", "seen"),
    [
        ((20, 0, 4, 5, 0.9), True), ((20, 0, 19, 1, 0.9), False),  # 20 cells; 19
        ((20, 0, 4, 12, 0.81), True), ((20, 0, 4, 12, 0.79), False),  # sure somewhere
        ((20, 3, 4, 12, 0.9), True), ((20, 4, 4, 12, 0.9), False),  # so far from the edge
        ((20, 20, 4, 12, 0.9), False),  # over the lower edge
        ((10, 0, 10, 6, 0.9), True), ((10, 0, 10, 5, 0.9), False),  # half as far in as wide
        ((0, 8, 4, 16, 0.9), False),  # a body that stands at the left edge
    ],
)  # fmt: skip
def test_an_arm_is_large_sure_and_reaches_in_over_an_edge(piece, seen):
    assert told(piece).seen == seen


@pytest.mark.parametrize(
    ("piece", "inside"),
    [
        ((20, 10, 4, 5, 0.8), 1), ((20, 10, 19, 1, 0.9), 0), ((20, 10, 4, 5, 0.79), 0),
        ((20, 4, 4, 5, 0.9), 1), ((20, 3, 4, 5, 0.9), 0), ((0, 8, 4, 16, 0.9), 0),
    ],
)  # fmt: skip
def test_a_large_sure_hand_inside_is_an_arm_whose_sleeve_is_not_seen(piece, inside):
    found = told(piece)
    assert found.inside == inside
    if not found.seen:
        assert (found.doubt is None) == bool(inside)


def test_a_hand_inside_is_seen_in_a_tenth_of_the_frames():
    hand = mask((20, 10, 4, 5, 0.9))
    assert count(*[hand] * 10, *[mask()] * 90).doubt is None
    assert "no arm" in count(*[hand] * 9, *[mask()] * 91).doubt[0]


BELOW = 20, 20, 4, 12, 0.9


@pytest.mark.parametrize(
    ("piece", "below"),
    [
        (BELOW, 1), ((20, 17, 4, 12, 0.9), 1), ((20, 16, 4, 12, 0.9), 0),  # so far from the edge
        ((4, 20, 4, 12, 0.9), 1), ((3, 20, 4, 12, 0.9), 0),  # over the left edge as well
        ((20, 26, 10, 6, 0.9), 1), ((20, 27, 10, 5, 0.9), 0),  # half as far in as wide
        ((20, 27, 4, 5, 0.9), 1), ((20, 31, 19, 1, 0.9), 0),  # 20 cells; 19
    ],
)  # fmt: skip
def test_an_arm_from_below_comes_in_over_no_other_edge(piece, below):
    found = told(piece)
    assert found.below == below and ("lower edge" in (found.doubt or [""])[0]) == (below == 1)


@pytest.mark.parametrize(("frames", "said"), [(9, "no arm"), (10, "the arm comes in over the low")])
def test_an_arm_from_below_is_seen_in_a_tenth_of_the_frames(frames, said):
    assert count(*[mask(BELOW)] * frames, *[mask()] * (100 - frames)).doubt[0].startswith(said)


@pytest.mark.parametrize(("frames", "below"), [(9, True), (10, False)])
def test_an_arm_that_is_seen_from_elsewhere_counts_before_one_from_below(frames, below):
    doubt = count(*[mask(ARM)] * frames, *[mask(BELOW)] * (100 - frames)).doubt
    assert doubt is None if not below else "lower edge" in doubt[0]


def test_an_arm_may_be_seen_in_pieces_if_it_is_large_once():
    small = mask((20, 0, 3, 4, 0.9))
    assert count(*[small] * 4).seen == 0
    assert count(small, small, small, mask(ARM)).seen == 1
    assert count(mask((20, 0, 3, 3, 0.9)), mask(ARM)).seen == 0.5  # nine cells


@pytest.mark.parametrize(("gap", "two"), [(4, 1), (3, 0)])
def test_two_arms_are_four_cells_apart(gap, two):
    assert told((4, 0, 4, 12, 0.9), (8 + gap, 0, 4, 12, 0.9)).several == two
    assert told((8 + gap, 0, 4, 12, 0.9), (4, 0, 4, 12, 0.9), (2, 20, 6, 6, 0.9)).several == two


def test_the_largest_of_two_arms_says_where_they_come_in():
    assert told(ARM, (0, 10, 14, 4, 0.9)).enters == pytest.approx(2 / W)
    assert told(ARM, (0, 10, 11, 4, 0.9)).enters == pytest.approx(22 / W)


@pytest.mark.parametrize(
    ("frames", "said"), [(9, "no arm is seen"), (10, ""), (100, "")], ids=["9", "10", "100"]
)
def test_an_arm_is_seen_in_a_tenth_of_the_frames(frames, said):
    doubt = count(*[mask(ARM)] * frames, *[mask()] * (100 - frames)).doubt
    assert doubt is None if not said else said in doubt[0] and doubt[1].startswith("film ")


@pytest.mark.parametrize(("frames", "two"), [(21, False), (22, True)])
def test_several_people_are_seen_in_two_frames_of_nine(frames, two):
    both = mask(ARM, (0, 10, 12, 4, 0.9))
    doubt = count(*[both] * frames, *[mask(ARM)] * (100 - frames)).doubt
    assert doubt is None if not two else "several people" in doubt[0]


def test_without_an_arm_there_is_no_place_where_it_comes_in():
    found = told()
    assert found[:2] == (0, 0) and np.isnan(found.enters) and "no arm" in found.doubt[0]


# As what moves tells


def moving(*boxes):
    """A mask (84, 84) in which rectangles (x, y, width, height) move."""
    mask = np.zeros((84, 84), bool)
    for x, y, width, height in boxes:
        mask[y : y + height, x : x + width] = True
    return mask


LEFT = (0, 30, 20, 12)


@pytest.mark.parametrize(
    ("boxes", "doors"),
    [
        ([LEFT], (0, 0)),
        ([(64, 30, 20, 12)], (83, 83)),
        ([(30, 0, 20, 30)], (30, 49)),  # from above
        ([LEFT, (64, 30, 20, 12)], (0, 83)),
        ([(0, 30, 84, 12)], (0, 83)),  # two whose hands meet
        ([LEFT, (79, 10, 5, 20)], (0, 0)),  # 100 pixels, less than 0.015 of the picture
        ([LEFT, (58, 30, 20, 12)], (0, 0)),  # an object in the picture
        ([LEFT, (40, 72, 20, 12)], (0, 0)),  # over the lower edge: a table that is moved
        ([(0, 30, 10, 10), (13, 30, 10, 10)], (0, 0)),  # an arm in pieces, 100 pixels each
        ([(0, 30, 10, 10), (19, 30, 10, 10)], (np.nan, np.nan)),  # a gap of nine
    ],
)
def test_a_door_is_where_something_large_comes_in(boxes, doors):
    np.testing.assert_allclose(arms._doors(moving(*boxes)[None])[0], np.array(doors) / 83)


@pytest.mark.parametrize(("often", "two"), [(2, False), (3, True)])
def test_things_at_both_sides_in_a_twentieth_of_the_frames_are_two_people(often, two):
    """Edge to edge, in so many of sixty frames; elsewhere the other one is a pixel off the edge."""
    off = np.zeros((60, 84, 84))
    off[:, 30:45, :20] = off[:often, 30:45, 64:] = 17
    found = arms.count(np.zeros((4, H, W), np.float32), off)
    assert found.across == often / 60 and ("several" in (found.doubt or [""])[0]) == two
    off[:, 30:45, 64:] = 16  # grey levels: too few
    assert arms.count(np.zeros((4, H, W), np.float32), off).across == 0


def test_what_moves_says_where_an_arm_comes_in_that_the_masks_do_not_show():
    off = np.zeros((4, 84, 84))
    off[:, 30:42, 64:] = 17
    found = arms.count(np.zeros((4, H, W), np.float32), off)
    assert (found.seen, found.enters, found.moves) == (0, 1, False) and "no arm" in found.doubt[0]
    off[:, 20:42, 64:] = 11  # faint, and large enough
    found = arms.count(np.zeros((4, H, W), np.float32), off)
    assert np.isnan(found.enters) and found.moves and found.doubt is None
    assert arms.count(np.stack([mask(ARM)] * 4), off).enters == pytest.approx(22 / W)


@pytest.mark.parametrize(
    ("box", "frames", "arm"),
    [
        ((0, 20, 17, 17), 2, True),  # 289 pixels; 0.04 of the picture are 282
        ((0, 20, 17, 16), 2, False),
        ((0, 20, 17, 17), 1, False),  # noise moves a pixel once
        ((4, 20, 17, 17), 2, True),  # a gap of four pixels to the edge is closed
        ((5, 20, 17, 17), 2, False),
        ((63, 20, 17, 17), 2, True),
        ((62, 20, 17, 17), 2, False),
        ((20, 4, 17, 17), 2, True),
        ((20, 63, 17, 17), 2, True),
    ],
)
def test_an_arm_is_a_twenty_fifth_of_the_picture_that_reaches_over_an_edge(box, frames, arm):
    moves = np.stack([moving(box)] * frames + [moving()] * 5)
    assert arms._comes_in(moves) == arm


def test_an_arm_comes_in_beside_something_larger_that_does_not():
    arm, toy, lamp = (0, 0, 17, 17), (40, 40, 20, 20), (0, 0, 16, 16)
    assert arms._comes_in(np.stack([moving(arm, toy)] * 2))
    assert not arms._comes_in(np.stack([moving(lamp, toy)] * 2))
    assert not arms._comes_in(np.stack([moving()] * 2))


@pytest.mark.parametrize(("rows", "across"), [(2, 0), (3, 1)])
def test_a_door_at_a_side_edge_is_three_pixels_wide(rows, across):
    """A hand that reaches to the other edge touches it with less."""
    off = np.zeros((4, 84, 84))
    off[:, 30:45, :20] = off[:, 30 : 30 + rows, 60:] = off[:, 30:45, 60:75] = 17
    assert arms.count(np.zeros((4, H, W), np.float32), off).across == across


# An arm that moves beside the one that has the tip


FIRST, SECOND, HAND = (4, 0, 4, 12, 0.9), (20, 0, 4, 12, 0.7), (20, 10, 4, 12, 0.9)


def beside(*pieces, still=(), tip=(6.0, 11.0), sure=0.5, frames=1):
    """`arms.beside` for one of so many frames: tip in cells; still: where nothing moves."""
    shown, moved = mask(*pieces), mask(*pieces) > 0
    for left, top, width, height, _ in still:
        moved[top : top + height, left : left + width] = False
    off = 17.0 * cv2.resize(moved.astype(np.float32), (84, 84), interpolation=cv2.INTER_NEAREST)
    others = frames - 1
    return arms.beside(
        np.stack([shown, *[mask()] * others]),
        np.stack([off, *[0 * off] * others]),
        np.array([tip] * frames) / (W, H),
        np.full(frames, sure),
    )


def test_a_faint_arm_that_moves_beside_one_with_the_tip_is_another():
    assert beside(FIRST, SECOND) == 1
    assert beside(FIRST, SECOND, frames=4) == 0.25
    assert beside(FIRST) == 0
    assert beside(FIRST, SECOND, still=[SECOND]) == beside(FIRST, SECOND, still=[FIRST]) == 0
    assert beside(FIRST, HAND, still=[FIRST]) == 1


@pytest.mark.parametrize(
    ("pieces", "tip", "sure", "seen"),
    [
        ((FIRST, SECOND), (6, 13.9), 0.5, True), ((FIRST, SECOND), (6, 14.1), 0.5, False),
        ((FIRST, SECOND), (6, 11), 0.49, False),  # no tip is found
        ((FIRST, SECOND), (22, 11), 0.5, False),  # it is the faint one's
        ((FIRST, (20, 0, 4, 12, 0.9)), (22, 11), 0.5, True),
        ((FIRST, (12, 0, 4, 12, 0.7)), (6, 11), 0.5, True),
        ((FIRST, (11, 0, 4, 12, 0.7)), (6, 11), 0.5, False),  # three cells between them
        ((FIRST, (20, 0, 4, 5, 0.7)), (6, 11), 0.5, True),  # 20 cells
        ((FIRST, (20, 0, 19, 1, 0.7)), (6, 11), 0.5, False),  # 19
        (((4, 0, 4, 5, 0.9), SECOND), (6, 4), 0.5, True),  # 20 cells
        (((4, 0, 19, 1, 0.9), (30, 0, 4, 12, 0.7)), (6, 1), 0.5, False),  # 19
        (((4, 4, 4, 12, 0.9), SECOND), (6, 11), 0.5, False),  # it comes from nowhere
    ],
)  # fmt: skip
def test_the_arm_that_is_whole_reaches_from_an_edge_to_the_tip(pieces, tip, sure, seen):
    assert beside(*pieces, tip=tip, sure=sure) == seen


@pytest.mark.parametrize(("rows", "seen"), [(6, 0), (5, 0.5)])
def test_what_moves_where_the_arm_stood_first_may_be_the_room(rows, seen):
    """Six of twelve rows of the other piece were the arm's."""
    stood, goes = mask((20, 0, 4, rows, 0.9), (20, 0, 6, 4, 0.9)), mask(FIRST, SECOND)
    off = 17.0 * np.stack([cv2.resize(np.ceil(one), (84, 84)) > 0 for one in (stood, goes)])
    tips = np.array([(22, rows), (6, 11)]) / (W, H)
    assert arms.beside(np.stack([stood, goes]), off, tips, np.ones(2)) == seen


@pytest.mark.parametrize(
    ("hand", "seen"),
    [(HAND, 1), ((20, 10, 4, 12, 0.79), 0), ((20, 10, 3, 3, 0.9), 0), ((20, 10, 5, 2, 0.9), 1)],
)
def test_a_hand_inside_whose_sleeve_is_not_seen_is_another_if_it_is_sure(hand, seen):
    assert beside(FIRST, hand) == seen


@pytest.mark.parametrize(
    ("hand", "seen"),
    [((39, 10, 3, 8, 0.9), 1), ((39, 10, 3, 8, 0.79), 0), ((39, 3, 3, 8, 0.9), 0),
     ((39, 4, 3, 8, 0.9), 1)],
)  # fmt: skip
def test_a_sure_hand_at_a_side_edge_is_another_and_what_hangs_from_above_is_not(hand, seen):
    """Three cells of it are seen, so it does not reach in far. The first arm itself rests."""
    assert beside(FIRST, hand, still=[FIRST]) == seen


@pytest.mark.parametrize(
    ("other", "share", "seen"),
    [(SECOND, 4 / 12, 1), (SECOND, 3 / 12, 0), (HAND, 4 / 12, 1), (HAND, 3 / 12, 0)],
)
def test_more_than_a_quarter_of_an_arm_and_of_a_hand_alone_moves(other, share, seen):
    left, top, width, height, sure = other
    rests = left, top, width, round((1 - share) * height), sure
    assert beside(FIRST, other, still=[rests]) == seen


# A room that moves


def stirs(*boxes, arm=(), grey=17):
    off = np.stack([grey * moving(*boxes), np.zeros((84, 84))]).astype(float)
    return arms.room(np.stack([mask(*arm)] * 2), off)


def test_a_room_moves_over_a_share_of_the_width_the_mean_of_all_frames():
    assert stirs() == 0
    assert stirs((0, 10, 84, 1)) == 0.5
    assert stirs((0, 10, 84, 1), grey=16) == 0
    assert stirs((0, 10, 7, 1)) == stirs((0, 10, 7, 40)) == pytest.approx(1 / 24)
    assert stirs((0, 10, 3, 1)) == pytest.approx(1 / 24)  # 3 of 49 pixels
    assert stirs((0, 10, 2, 1)) == 0
    assert stirs((0, 76, 84, 1)) == 0.5
    assert stirs((0, 77, 84, 7)) == 0  # the lowest


def test_what_is_near_an_arm_is_not_asked():
    """Cells 8 to 11 of 42 are pixels 16 to 23, and those up to four away are near it: the pieces
    from the second to the fourth."""
    assert stirs((0, 10, 84, 1), arm=[(8, 0, 4, 32, 0.9)]) == pytest.approx(9 / 24)
    assert stirs((0, 10, 84, 1), arm=[(8, 0, 4, 32, 0.4)]) == 0.5


@pytest.mark.parametrize(
    ("several", "seen", "said"),
    [(0.21, 1.0, "the camera moves"), (0.22, 1.0, "arms, or"), (0.0, 0.0, "no arm is seen")],
)
def test_two_arms_that_are_seen_and_none_are_told_before_a_room_that_moves(several, seen, said):
    found = arms.Arms(seen, several, 0.5, False, 1.0, room=0.4)
    assert found.doubt[0].startswith(said) and found._replace(room=0.39).doubt[0][:3] != "the"


def test_a_shot_is_asked_by_its_pixels_and_its_room_only_if_it_was_steadied():
    """Sixty of a hundred frames, 420 wide and 160 high: a cell is 10 by 5 pixels."""
    shown = np.stack([mask(FIRST, SECOND)] * 100)
    sight = Sight(
        SimpleNamespace(look=lambda frames: SimpleNamespace(arms=shown)),
        np.zeros((100, 160, 420, 3), np.uint8),
    )
    off = np.full((60, 84, 84), 17.0)
    assert sight.beside(off, np.array([(60.0, 55.0)] * 100), np.ones(100)) == 1
    assert sight.beside(off, np.array([(60.0, 75.0)] * 100), np.ones(100)) == 0
    steadied = Footage(sight.frames, ["It trembles."], slice(0, 100), off, True)
    assert sight.room(steadied) == arms.room(shown[:60], off) > 0
    assert sight.room(steadied._replace(warnings=[])) == 0


@pytest.mark.parametrize("gone", [False, True])
@pytest.mark.parametrize("same", [False, True])
def test_a_shot_is_unmoved_where_its_ends_are_the_same_or_nothing_has_left(gone, same):
    """A hand may stay, in pieces that reach over no edge: the ends differ, and nothing went."""
    sight = Sight(None, np.zeros((9, 84, 84, 3), np.uint8))
    sight.vanished = "a thing" if gone else None
    ends = Footage(sight.frames, [], slice(0, 9), np.zeros((9, 84, 84)), same)
    assert sight.unmoved(ends) == (same or not gone)


# As the shipped detector sees them


@pytest.fixture(scope="module")
def shown():
    detector = Detector.load(EYES)
    return lambda frames: arms.count(some(detector.look(frames).arms), ROOM)


FROM_LEFT = arm(np.clip(np.linspace(0, 0.6, 24), 0, 0.45))
FROM_RIGHT = FROM_LEFT[:, :, ::-1]


def test_the_detector_sees_an_arm_and_from_where(shown):
    for film, enters in ((FROM_LEFT, 0.05), (FROM_RIGHT, 0.95)):
        found = shown(film)
        assert found.doubt is None and found.seen > 0.7
        assert found.enters == pytest.approx(enters, abs=0.03)


def test_the_detector_sees_two_people_and_one_of_them_may_rest(shown):
    half = FROM_LEFT.shape[2] // 2
    both = np.concatenate([FROM_LEFT[:, :, :half], FROM_RIGHT[:, :, half:]], 2)
    assert "several people" in shown(both).doubt[0]


def test_what_moves_alone_is_no_arm_to_the_detector(shown):
    toy, lamp = (np.repeat(room()[None], 24, 0) for _ in range(2))
    for i in range(24):
        toy[i, 40:56, 40 + i : 60 + i] = (200, 40, 30)
        x = round(70 + 8 * np.sin(i / 3))
        lamp[i, :9, x : x + 9] = (250, 240, 90)  # hangs in from the upper edge, and swings
    for film in (toy, lamp, np.repeat(room()[None], 24, 0)):
        assert "no arm" in shown(film).doubt[0]


def test_masks_are_those_of_the_picture_without_the_black_bars_around_it():
    detector = Detector.load(EYES)
    wide = detector.look(np.repeat(FROM_LEFT, 3, 0)).arms
    assert wide.shape == (
        72,
        *(round(42 * side / max(FROM_LEFT.shape[1:3])) for side in FROM_LEFT.shape[1:3]),
    )
    upright = detector.look(np.rot90(FROM_LEFT, axes=(1, 2)).copy()).arms
    assert upright.shape == (24, *wide.shape[:0:-1])
    assert wide.min() >= 0 and 0.9 < wide.max() <= 1
