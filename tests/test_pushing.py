"""Whether an object is pushed, by hand: a way of 100 pixels, touched at step 20, done at 40."""

import numpy as np
import pytest

from lbw_minimal.clips.paths import Tracks, Unusable
from lbw_minimal.clips.pushing import (
    check_apart,
    check_hand,
    check_steps,
    check_view,
    check_way,
    gets_faster,
)

TOUCH, THERE, N = 20, 40, 50
WAY = np.clip((np.arange(N) - TOUCH) / (THERE - TOUCH), 0, 1)


def tracks(enters=np.nan, width=600, yours=()):
    none = np.zeros(0)
    return Tracks(none, none, none, none, none, 400, enters=enters, width=width, yours=yours)


def pushed(along=(100.0, 0.0), tip=0.0, aside=0.0, enters=np.nan, width=600, yours=()):
    """Check a way `along`, pixels, from 200 on; tip, aside (N,): how far the tip is ahead of the
    object, and the object to the right of its straight way, in parts of the way."""
    along = np.array(along)
    thing = np.array([200.0, 100.0]) + WAY[:, None] * along
    thing += np.multiply.outer(np.broadcast_to(aside, N), [-along[1], along[0]])
    hand = thing[0] + (WAY + tip)[:, None] * along
    ends = thing[0].copy(), thing[0] + along
    return check_way(tracks(enters, width, yours), hand, thing, WAY, (TOUCH, THERE), ends)


COMES = -0.1 - 2 * np.clip(1 - np.arange(N) / TOUCH, 0, 1)  # from behind, to a tenth of the way


@pytest.mark.parametrize(
    ("door", "along", "pulls"),
    [(263, 100, True), (261, 100, False), (263, -100, False), (137, -100, True),
     (139, -100, False), (137, 100, False), (np.nan, 100, False)],
)  # fmt: skip
def test_an_arm_that_comes_in_ahead_of_its_hand_pulls(door, along, pulls):
    """By an eighth of the width: 72 pixels of 600, of a hand that is at 190 or 210 when it touches
    the object."""
    pushed((along, 0), COMES, enters=door / 600, width=0)  # unknown
    if pulls:
        with pytest.raises(Unusable, match="which so pulls it"):
            pushed((along, 0), COMES, enters=door / 600, yours=(("object", 0, 1),))
    else:
        assert pushed((along, 0), COMES, enters=door / 600) == []
    (warning,) = pushed((along, 0), COMES, enters=door / 600, yours=(("tip", 0, 1),)) or [""]
    assert warning == pulls * (
        "The object comes towards the arm, which so pulls it: it is pushed all the same, because "
        "you placed the tip."
    )


def test_an_object_that_moves_with_the_last_picture_is_not_done():
    way = np.r_[np.zeros(9), 1.0]
    thing = way[:, None] * (100, 0)
    with pytest.raises(Unusable, match="ends as the object begins to move"):
        check_way(tracks(), thing - (30, 0), thing, way, (9, 9), (thing[0], thing[-1]))


@pytest.mark.parametrize(
    ("nearer", "down", "hand"), [(24, 0.3, True), (26, 0.3, False), (0, 0.3, True), (0, 0.2, False)]
)
def test_what_goes_with_the_hand_from_the_start_and_comes_down_with_it_is_the_hand(
    nearer, down, hand
):
    """A hand that comes to an object comes nearer by a quarter of its way; a table, or a camera,
    is not so far out of level."""
    along = 100 * np.array([np.sqrt(1 - down**2), down])
    apart = (-0.1 - nearer / 100 * np.clip(1 - np.arange(N) / TOUCH, 0, 1))[:, None] * along
    if hand:
        with pytest.raises(Unusable, match="is the hand"):
            check_apart(apart, along, 100)
    else:
        check_apart(apart, along, 100)


@pytest.mark.parametrize(
    ("far", "along", "hand"),
    [
        (9.9, (10, 25), True),
        (10.1, (10, 25), False),
        (9.9, (25, 25), False),
        (9.9, (10, -25), False),
    ],
)
def test_what_goes_down_steeply_and_is_at_the_tip_all_along_is_the_hand(far, along, hand):
    """However much the dots tremble: a hand comes to an object from a tenth of the picture away."""
    apart = np.array([(far, 0.0), (-far, 0.0)] * 10)
    if hand:
        with pytest.raises(Unusable, match="is the hand"):
            check_apart(apart, np.array(along, float), 100)
    else:
        check_apart(apart, np.array(along, float), 100)


@pytest.mark.parametrize(
    ("height", "when", "lifted"),
    [(0.19, 30, False), (0.21, 30, True), (-0.21, 30, True), (0.5, 10, False), (0.5, 45, False)],
)
def test_what_leaves_its_straight_way_by_a_fifth_between_touch_and_arrival_is_lifted(
    height, when, lifted
):
    aside = height * (np.arange(N) == when)
    if lifted:
        with pytest.raises(Unusable, match="leaves its straight way by 21%"):
            pushed(tip=COMES, aside=aside)
    else:
        pushed(tip=COMES, aside=aside)


@pytest.mark.parametrize("enters", [0.3, np.nan])
@pytest.mark.parametrize(("ahead", "usable"), [(0.24, True), (0.26, False)])
def test_a_tip_a_quarter_of_the_way_ahead_does_not_push(ahead, usable, enters):
    tip = np.where(np.arange(N) < TOUCH, -0.5, ahead)
    if usable:
        pushed(tip=tip, enters=enters)
    else:
        with pytest.raises(Unusable, match="in front of it"):
            pushed(tip=tip, enters=enters)


@pytest.mark.parametrize(
    ("enters", "usable"), [(0.1, True), (0.24, True), (0.26, False), (0.5, False)]
)
@pytest.mark.parametrize("way", [100, -100])
def test_what_goes_away_from_an_arm_at_the_side_is_pushed_wherever_the_tip_was_seen(
    enters, usable, way
):
    """An arm comes from a side if it comes in over the outer quarter of the picture."""
    told = dict(along=(way, 0), tip=np.full(N, 0.5), enters=enters if way > 0 else 1 - enters)
    if usable:
        pushed(**told)
    else:
        with pytest.raises(Unusable, match="in front of it"):
            pushed(**told, width=0)


def hand(ahead, sure, alike=None):
    """Check a tip that is so much ahead, in parts of the way, at the 21 steps of a push, and so
    surely seen."""
    t, thing = 0.04 * np.arange(21), np.stack([5.0 * np.arange(21), np.full(21, 50.0)], 1)
    ahead, sure = np.broadcast_to(ahead, 21), np.broadcast_to(sure, 21)
    tip = thing + 100 * np.stack([ahead, 0 * ahead], 1)
    check_hand(Tracks(t, tip, thing, sure, sure, 100), t, thing, np.array([100.0, 0.0]), alike)


@pytest.mark.parametrize(("surest", "usable"), [(0.49, False), (0.5, True)])
def test_a_tip_is_surely_seen_at_least_once_while_the_object_moves(surest, usable):
    sure = np.where(np.arange(21) == 7, surest, 0.2)
    if usable:
        hand(-0.1, sure)
    else:
        with pytest.raises(Unusable, match="not surely seen while the object moves"):
            hand(-0.1, sure)


@pytest.mark.parametrize(("sure_ahead", "usable"), [(0.39, True), (0.41, False)])
def test_an_arm_hides_what_its_tip_is_in_front_of_as_far_as_its_places_are_sure(sure_ahead, usable):
    """Ahead at 15 steps of 21, with 0.4 for sure, that is 6 in all; behind at six, with 1.0."""
    behind = np.arange(21) < 6
    told = np.where(behind, -0.1, 0.3), np.where(behind, 1.0, sure_ahead)
    if usable:
        hand(*told)
    else:
        with pytest.raises(Unusable, match="and hides it"):
            hand(*told)
    hand(0.17, 1.0)
    with pytest.raises(Unusable, match="and hides it"):
        hand(0.19, 1.0)


def test_nothing_hides_what_looks_like_itself_all_along():
    """Fingers are about a thing that they push, and their tip may be found in front of it."""
    asked = []
    hand(0.19, 1.0, lambda *when: asked.append(when) or 0.7)
    assert np.allclose(asked, [(0, 0.8)])  # s, from the touch until it is there
    with pytest.raises(Unusable, match="and hides it"):
        hand(0.19, 1.0, lambda *when: 0.69)
    with pytest.raises(Unusable, match="not surely seen"):
        hand(0.19, 0.4, lambda *when: 1.0)
    hand(0.17, 1.0, pytest.fail)


@pytest.mark.parametrize(
    ("ahead_for", "at_touch", "usable"),
    [(6, 0.0, False), (6, -0.04, False), (6, -0.06, True), (4, 0.0, True)],
)
def test_a_hand_that_comes_from_the_front_pushes_if_it_has_gone_behind(ahead_for, at_touch, usable):
    """Where it was in most of the first half of the time before the touch: the first ten steps."""
    tip = np.where(np.arange(N) < ahead_for, 0.5, at_touch)
    if usable:
        pushed(tip=tip)
    else:
        with pytest.raises(Unusable, match="in front of it"):
            pushed(tip=tip)


@pytest.mark.parametrize(("last", "faster"), [(0.94, False), (0.96, True), (1.0, True)])
def test_a_path_is_broken_off_if_it_ends_at_nearly_its_highest_speed(last, faster):
    x = np.cumsum(np.r_[np.linspace(0, 1, 10), np.ones(8), np.full(4, last)])
    assert gets_faster(np.stack([x, 0 * x], 1)) == faster


def test_a_speed_is_taken_over_four_steps():
    """A single step by twice as far is noise: five pixels instead of four, over four steps."""
    x = np.cumsum(np.r_[np.ones(10), 2, np.ones(10)])
    path = np.stack([x, 0 * x], 1)
    assert not gets_faster(path) and gets_faster(path[:14])
    assert not gets_faster(path[:4])


@pytest.mark.parametrize(
    ("leap", "back", "two"), [(0.59, 1.0, False), (0.61, 1.0, True), (0.59, 0.1, False)]
)
def test_what_leaps_three_fifths_of_its_way_may_be_two_things(leap, back, two):
    """From 0.2 of the way by a leap, then in small steps to the end; what it does then is free."""
    gone = np.concatenate([[0, 0.1, 0.2], np.linspace(0.2 + leap, 1, 5), [back]])
    start, end = np.array([200.0, 100.0]), np.array([100.0, 120.0])
    seen = start + gone[:, None] * (end - start)
    if two:
        with pytest.raises(Unusable, match="the object leaps 61% of its way"):
            check_steps(seen, start, end)
    else:
        check_steps(seen, start, end)


def viewed(hand, thing=0.0, sure=1.0, unseen=()):
    """`check_view` of a hand that goes by `hand` pixels and back, in a picture of 100, and a thing
    that goes by so many, surely found in that share of 20 frames; unseen: frames without the hand.
    """
    there = np.concatenate([np.linspace(0, 1, 10), np.linspace(1, 0, 10)])[:, None]
    found, tip_found = (np.arange(20) < 20 * sure).astype(float), np.ones(20)
    tip_found[list(unseen)] = 0.4
    places = there * np.array(hand, float), there * (0.0, thing)
    check_view(Tracks(np.zeros(0), *places, tip_found, found, 100))


@pytest.mark.parametrize(
    ("hand", "steep"),
    [((0, 31), True), ((0, -31), True), ((0, 29), False), ((20, 31), True), ((-21, 31), False)],
)
def test_a_hand_that_goes_far_and_steeply_where_nothing_moves_is_not_seen_from_the_side(
    hand, steep
):
    if steep:
        with pytest.raises(Unusable, match=f"^the hand goes 31 pixels up or down and {hand[0]} "):
            viewed(hand)
    else:
        viewed(hand)


def test_how_the_hand_goes_is_not_asked_where_a_thing_is_seen_to_move():
    viewed((0, 50), thing=7)
    viewed((0, 50), thing=7, sure=0.5)
    for seen in (dict(thing=5), dict(thing=7, sure=0.45), dict(thing=50, sure=0)):
        with pytest.raises(Unusable, match="lift nothing, and film from the side"):
            viewed((0, 50), **seen)


def test_a_tip_that_leaps_is_no_hand_that_goes_steeply():
    """From a third of its way to all of it, which is 0.67, or from four ninths, 0.56."""
    viewed((0, 50), unseen=range(4, 9))
    with pytest.raises(Unusable, match="the hand goes 50 pixels"):
        viewed((0, 50), unseen=range(5, 9))
