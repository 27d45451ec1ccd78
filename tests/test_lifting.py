"""A hand that goes up from a thing that was not seen to move: by its own way, or by another."""

from dataclasses import replace

import numpy as np
import pytest
from toy_pushes import SCENE

from lbw_minimal.clips.lifting import LEAP, UP, check_lifted, gone_up
from lbw_minimal.clips.paths import Tracks, Unusable
from lbw_minimal.clips.retarget import lay

SIDE, N = 200, 61
COMES = (20, 40), (90, 150)  # from above and aside, down to a thing at rest


def path(*points):
    """A path (N, 2) through points, of which the last frame shows the last."""
    x, y = np.array(points, float).T
    at = np.linspace(0, len(points) - 1, N)
    along = np.arange(len(points))
    return np.stack([np.interp(at, along, x), np.interp(at, along, y)], 1)


def tracks(tip, thing=(130, 150)):
    """What was found: a tip (N, 2), and an object at one place, or at places (N, 2)."""
    there, ones = np.broadcast_to(np.array(thing, float), (N, 2)), np.ones(N)
    return Tracks(np.arange(N) / 20, tip, there, ones, ones, SIDE, width=SIDE)


@pytest.mark.parametrize(
    ("then", "up"),
    [((150, 50), 100), ((20, 40), 0), ((90, 150), 0), ((60, 50), 28)],
    ids=["by another way", "as it came", "stays", "beside it"],
)
def test_a_hand_goes_up_where_it_leaves_the_way_by_which_it_came(then, up):
    """By as much as it goes up, or as it is off that way: 28 pixels of 100."""
    assert gone_up(path(*COMES, then)) == pytest.approx(up, abs=0.5)


def test_one_that_comes_down_only_has_not_gone_up():
    assert gone_up(path((20, 40), (90, 150), (150, 180))) == 0
    assert gone_up(path((90, 150), (95, 130), (90, 165))) == pytest.approx(20, abs=1.0)


def lifts(share):
    """A hand on a thing from the first frame, which goes up by that share of the picture."""
    return path((90, 150), (90, 150), (90, 150 - share * SIDE))


def unsure_in(found, name, share):
    """Found, with the tip or object unsure in that share of the frames."""
    sure = np.where(np.arange(N) % 20 < share * 20, 0.0, 1.0)
    return replace(found, **{f"{name}_sure": sure})


def test_a_hand_that_goes_up_from_an_object_at_rest_lifts():
    with pytest.raises(Unusable, match="goes up by 40% of the picture, as one that lifts, and"):
        check_lifted(tracks(lifts(0.4)))
    with pytest.raises(Unusable, match="lift nothing, and push the object"):
        check_lifted(tracks(lifts(UP + 0.01)))
    check_lifted(tracks(lifts(UP - 0.01)))
    check_lifted(tracks(path(*COMES, COMES[0])))


def test_where_the_object_is_seen_to_move_its_own_way_counts():
    """A twentieth of the picture is none; what is seen in less than half of the frames is not seen
    to move."""
    up = lifts(0.4)
    goes = path((130, 150), (130, 150), (150, 150))
    check_lifted(tracks(up, goes))
    for one in (tracks(up, (goes - 130) / 2 + 130), unsure_in(tracks(up, goes), "object", 0.55)):
        with pytest.raises(Unusable, match="as one that lifts"):
            check_lifted(one)
    check_lifted(unsure_in(tracks(up, goes), "object", 0.45))


@pytest.mark.parametrize(("share", "said"), [(LEAP + 0.01, False), (LEAP - 0.01, True)])
def test_a_dot_that_leaps_from_one_thing_to_another_does_not_go_up(share, said):
    """Upwards in two leaps, or in two steps that a hand may have made."""
    at = np.repeat([150, 150 - share * SIDE, 150 - 2 * share * SIDE], [20, 20, N - 40])
    tip = np.stack([np.full(N, 90.0), at], 1)
    if said:
        with pytest.raises(Unusable, match="goes up by 28%"):
            check_lifted(tracks(tip))
    else:
        check_lifted(tracks(tip))


@pytest.mark.parametrize(("unsure", "said"), [(0.45, True), (0.55, False)])
def test_a_hand_that_is_rarely_seen_says_nothing(unsure, said):
    found = unsure_in(tracks(lifts(0.4)), "tip", unsure)
    if said:
        with pytest.raises(Unusable, match="as one that lifts"):
            check_lifted(found)
    else:
        check_lifted(found)


def test_a_clip_of_a_lifted_thing_is_told_so_where_something_at_rest_was_taken_for_it():
    with pytest.raises(Unusable, match="as one that lifts"):
        lay(tracks(lifts(0.4)), SCENE)
    with pytest.raises(Unusable, match="never moves"):
        lay(tracks(path((20, 80), COMES[1], (20, 80))), SCENE)
