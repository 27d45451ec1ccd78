"""Paths in a clip: what counts as seen, as a cut, as a rest, and what the low-pass lets through."""

from dataclasses import replace

import numpy as np
import pytest

from lbw_minimal.clips.paths import (
    Tracks,
    Unusable,
    busiest_piece,
    ends,
    low_pass,
    median3,
    progress,
    trusted,
    unsure,
)


def tracks(tip, thing=None, sure=None, cuts=(), side=100, rate=25):
    """Tracks of n frames, `rate` a second, whose tip (and object) go along x as given."""
    n = len(tip)
    tip, thing = (np.stack([np.array(x, float), np.full(n, 50.0)], 1)
                  for x in (tip, tip if thing is None else thing))  # fmt: skip
    sure = np.ones(n) if sure is None else np.array(sure, float)
    return Tracks(np.arange(n) / rate, tip, thing, sure, sure, side, tuple(cuts))


def test_a_part_has_its_own_cuts_and_all_that_belongs_to_its_frames():
    whole = tracks(
        np.arange(20), thing=np.arange(20) + 3, sure=np.linspace(0, 1, 20), cuts=(4, 9, 12)
    )
    part = whole.part(4, 12)
    assert part.cuts == (5,) and part.times[0] == 4 / 25 and len(part.times) == 8
    assert part.tip[0, 0] == 4 and part.object[0, 0] == 7 and part.object_sure[0] == 4 / 19


def test_the_piece_is_taken_in_which_most_happens_to_what_matters():
    """First the tip goes far and the object rests, then the other way round."""
    tip = np.concatenate([np.linspace(0, 60, 20), np.linspace(20, 22, 20)])
    thing = np.concatenate([np.full(20, 70.0), np.linspace(20, 50, 20)])
    cut = tracks(tip, thing, cuts=(20,))
    warnings = []
    assert busiest_piece(cut, True, warnings).times[0] == 20 / 25
    assert warnings == [
        "The clip jumps once, at 0.8 s: 0.8 to 1.6 s is used; --from and --to choose another piece."
    ]
    assert busiest_piece(cut, False, []).times[-1] == 19 / 25


def test_all_jumps_of_a_clip_are_said():
    tip = np.concatenate([np.linspace(0, 9, 10), np.linspace(50, 90, 10), np.linspace(0, 9, 10)])
    for cuts, wanted in (((10, 20), "twice, at 1.0 and 2.0 s"), ((), None)):
        warnings = []
        busiest_piece(tracks(tip, cuts=cuts, rate=10), True, warnings)
        assert not (warnings or wanted) or wanted in warnings[0]
    tip, warnings = np.repeat([0.0, 50, 0, 50], 10) + np.arange(40), []
    busiest_piece(tracks(tip, cuts=(10, 20, 30), rate=10), True, warnings)
    assert "3 times, at 1.0, 2.0 and 3.0 s" in warnings[0]


@pytest.mark.parametrize(
    ("lost", "spans"),
    [
        ([(8, 13)], []),  # 0.5 s, and not longer
        ([(8, 14)], ["0.8 to 1.4"]),
        ([(0, 8), (20, 30)], ["0.0 to 0.8", "2.0 to 2.6"]),
        ([(27, 40)], []),  # after the end
    ],
)
def test_what_was_not_surely_found_for_longer_than_half_a_second_is_said(lost, spans):
    sure = np.ones(40)
    for a, b in lost:
        sure[a:b] = 0.4
    seen = replace(tracks(np.arange(40), rate=10), tip_sure=sure)
    said = [f"The tip was not surely found from {s} s: look at these pictures." for s in spans]
    assert unsure(seen, "tip", 1.0, 1.0, 2.6) == said
    assert unsure(seen, "object", 1.0, 1.0, 2.6) == []


@pytest.mark.parametrize(("touch", "said"), [(1.05, True), (1.15, False)])
def test_a_hand_that_is_found_well_before_the_touch_may_not_have_come_yet(touch, said):
    """It is found from 0.8 s on. A thing is there all along, and a hand that is lost again."""
    sure = np.ones(40)
    sure[:8] = 0.4
    seen = replace(tracks(np.arange(40), rate=10), tip_sure=sure, object_sure=sure)
    assert bool(unsure(seen, "tip", 0.8, touch, 2.6)) == said
    assert unsure(seen, "object", 0.8, touch, 2.6)
    later = replace(seen, tip_sure=np.roll(sure, 2))  # it was there, and was lost
    assert unsure(later, "tip", 0.0, 2.0, 2.6)


def test_what_was_not_sure_in_another_piece_is_not_said():
    sure = np.ones(40)
    sure[2:12], sure[20:28] = 0.4, 0.4
    tip = np.where(np.arange(40) < 20, 10.0, 60.0)
    cut = tracks(tip, sure=sure, cuts=(20,), rate=10)
    (said,) = unsure(cut, "object", 2.8, 2.8, 3.9)
    assert "from 2.0 to 2.8 s: look at these pictures." in said


@pytest.mark.parametrize(("touched", "first", "last"), [(False, 5, 25), (True, 3, 27)])
def test_a_piece_is_that_in_which_the_hand_or_what_it_touched_is_seen(touched, first, last):
    sure = np.ones(30)
    sure[:5], sure[10:12], sure[-4:] = 0.4, 0.4, 0.4
    t = np.arange(30)
    hit = np.where((t >= 3) & (t < 28), 1.0, 0.4)  # it is there before, and goes on by itself
    piece = busiest_piece(replace(tracks(np.arange(30), sure=sure), object_sure=hit), touched, [])
    assert (piece.times[0], piece.times[-1]) == (first / 25, last / 25)


@pytest.mark.parametrize(("touched", "said"), [
    (False, "the hand is in sight for 7 frames in one go, too few: 8 are needed"),
    (True, "hand or object is in sight for 6 frames in one go, too few: 8 are needed"),
])  # fmt: skip
def test_a_clip_long_enough_in_which_too_little_is_seen_is_not_called_too_short(touched, said):
    """A hand in 7 of 18 frames; and a thing and a hand, both in 12, of which 6 come after a cut."""
    sure = np.full(18, 0.4)
    sure[3 : 15 if touched else 10] = 1.0
    cut = tracks(np.where(np.arange(18) < 9, 10.0, 60.0), sure=sure, cuts=(9,) * touched)
    with pytest.raises(Unusable, match=f"^{said}"):
        busiest_piece(cut, touched, [])


@pytest.mark.parametrize(("jump", "is_cut"), [(3, False), (5, True)])
def test_a_change_of_the_picture_is_a_cut_where_something_jumps_by_a_25th_of_the_side(jump, is_cut):
    tip = np.concatenate([np.full(10, 30.0), np.full(10, 30.0 + jump)])
    notes = []
    busiest_piece(tracks(tip, cuts=(10,)), False, notes)
    assert bool(notes) == is_cut


def test_what_goes_on_as_fast_as_before_and_after_is_no_cut():
    notes = []
    busiest_piece(tracks(6.0 * np.arange(20), cuts=(10,)), False, notes)
    assert not notes
    busiest_piece(
        tracks(np.r_[6.0 * np.arange(10), 6.0 * np.arange(10) + 70], cuts=(10,)), False, notes
    )
    assert notes


@pytest.mark.parametrize(("jump", "is_cut"), [(11, False), (13, True)])
def test_a_jump_is_twice_as_far_as_the_steps_about_it(jump, is_cut):
    notes, x = [], 6.0 * np.arange(20)
    x[10:] += jump - 6
    busiest_piece(tracks(x, cuts=(10,)), False, notes)
    assert bool(notes) == is_cut


def test_the_steps_about_a_jump_are_the_one_before_and_the_one_after():
    """Of 5, 9 and 5 pixels, and of 5, 12 and 5; farther off it goes by 12 at a time."""
    for jump, is_cut in ((9, False), (12, True)):
        steps, notes = np.full(19, 12.0), []
        steps[8:11] = 5, jump, 5
        x = np.r_[0, np.cumsum(steps)]
        busiest_piece(tracks(x, cuts=(10,)), False, notes)
        assert bool(notes) == is_cut


def test_a_change_of_the_picture_is_a_cut_where_the_hand_is_not_seen():
    """On either side of it: nobody knows where it went meanwhile."""
    for unseen, is_cut in ((9, True), (10, True), (8, False), (11, False)):
        sure, notes = np.ones(20), []
        sure[unseen] = 0.4
        busiest_piece(tracks(np.arange(20.0), sure=sure, cuts=(10,)), False, notes)
        assert bool(notes) == is_cut


def test_enough_frames_have_to_be_sure_and_only_those_count():
    """Half of them of the object, which a hand hides for a while; of the tip one."""
    sure = np.tile([0.6, 0.3], 10)
    x = np.where(sure > 0.5, 2.0 * np.arange(20), 500)
    times, points = trusted(tracks(x, sure=sure), "tip")
    np.testing.assert_array_equal(times, np.arange(0, 20, 2) / 25)
    np.testing.assert_array_equal(points[:, 0], 2.0 * np.arange(0, 20, 2))
    sure[0] = 0.3
    with pytest.raises(Unusable, match="seen in 45% of the frames"):
        trusted(tracks(x, sure=sure), "object")
    sure[:18] = 0.3
    assert len(trusted(tracks(x, sure=sure), "tip")[0]) == 1
    sure[18] = 0.3
    with pytest.raises(Unusable, match="tip of the hand is seen in 0%"):
        trusted(tracks(x, sure=sure), "tip")


@pytest.mark.parametrize(
    ("hand", "reason"), [(5, "the tip of the hand"), (6, "the object is seen")]
)
def test_where_neither_hand_nor_object_is_seen_it_is_the_hand_that_hides_both(hand, reason):
    sure = np.where(np.arange(20) < hand, 1.0, 0.0)
    hidden = replace(tracks(10.0 * np.arange(20), sure=sure), object_sure=np.zeros(20))
    with pytest.raises(Unusable, match=reason):
        trusted(hidden, "object")


@pytest.mark.parametrize(
    ("rests", "reason"), [(12, "never moves"), (8, "seen in 0% of the frames")]
)
def test_an_object_that_is_suspected_at_one_place_never_moves(rests, reason):
    """In more than half of 20 frames it is within 4 of 100 pixels of where it mostly is."""
    x = np.r_[50 + 3.0 * (np.arange(rests) % 2), 90 - 5 * np.arange(20 - rests)]
    unsure = replace(tracks(x), object_sure=np.full(20, 0.2))
    with pytest.raises(Unusable, match=reason):
        trusted(unsure, "object")
    seen = replace(unsure, object_sure=np.r_[np.full(18, 0.2), 0.9, 0.9])  # surely elsewhere
    with pytest.raises(Unusable, match="seen in 10% of the frames"):
        trusted(seen, "object")


def test_the_median_of_three_takes_out_a_glitch_and_keeps_a_step_and_the_ends():
    x = np.array([5.0, 0, 0, 9, 0, 4, 4, 4, 7])
    points = np.stack([x, -x], 1)
    assert median3(points)[:, 0].tolist() == [5, 0, 0, 0, 4, 4, 4, 4, 7]
    np.testing.assert_array_equal(median3(points)[:, 1], -median3(points)[:, 0])
    assert median3(points[:2])[:, 0].tolist() == [5, 0]


@pytest.mark.parametrize("hertz", [2, 4])
def test_the_low_pass_is_a_gaussian_of_a_twentieth_of_a_second(hertz):
    """A wave loses exp(-(2 pi f sigma)^2 / 2) of its height: 0.82 at 2 Hz, 0.45 at 4."""
    s = np.arange(0, 4, 1 / 240)
    t = np.arange(1, 3, 1 / 25)
    wave = np.stack([np.sin(2 * np.pi * hertz * s), np.cos(2 * np.pi * hertz * s)], 1)
    left = low_pass(s, wave, t)
    height = np.exp(-((2 * np.pi * hertz * 0.05) ** 2) / 2)
    wanted = height * np.stack([np.sin(2 * np.pi * hertz * t), np.cos(2 * np.pi * hertz * t)], 1)
    np.testing.assert_allclose(left, wanted, atol=0.02)


def test_a_frame_counts_for_as_long_as_it_is_shown():
    """Of 240 a second one lasts 1 / 240 s, and has so much of a Gaussian of a twentieth."""
    s = np.arange(0, 1, 1 / 240)
    glitch = np.zeros((len(s), 2))
    glitch[120] = 1
    left = low_pass(s, glitch, np.array([0.5]))
    np.testing.assert_allclose(left, 1 / 240 / (0.05 * np.sqrt(2 * np.pi)), rtol=0.02)


def test_the_low_pass_stays_where_the_path_begins_and_ends():
    s = np.arange(0, 1, 0.04)
    path = np.stack([3 * s, 7 - s], 1)
    np.testing.assert_allclose(low_pass(s, path, np.array([-0.5, 1.5])), path[[0, -1]], atol=1e-9)


def test_start_and_end_of_a_way_are_medians_of_its_rests():
    """It rests at 10, goes to 110 and rests there, and drifts back a little in the end."""
    rng = np.random.default_rng(0)
    x = np.r_[np.full(10, 10.0), np.linspace(10, 110, 30), np.full(20, 110.0), np.full(5, 60.0)]
    path = np.stack([x, np.full(len(x), 40.0)], 1) + rng.normal(0, 0.3, (len(x), 2))
    start, end = ends(path, 4.0, "object")
    np.testing.assert_allclose(start, [10, 40], atol=4)
    np.testing.assert_allclose(end, [110, 40], atol=0.2)
    assert start[0] < 16
    path[0] += 2  # where it is found first is no better than the next
    np.testing.assert_allclose(ends(path, 4.0, "object")[0], [10, 40], atol=0.5)


def test_a_rest_ends_where_a_tenth_of_the_way_is_gone():
    """By 1 in four frames, to 100; what is nearer than 5 to the farthest place is the end."""
    x = np.r_[np.arange(0.0, 5), np.arange(9.0, 13), 40, 94, 96, 98, 100]
    start, end = ends(np.stack([x, 0 * x], 1), 4.0, "object")
    assert (start[0], end[0]) == (3, 98)  # of 0, 1, 2, 3, 4, 9 and 10; of 96, 98 and 100


def test_what_goes_less_than_asked_never_moves():
    path = np.stack([np.linspace(0, 3, 9), np.zeros(9)], 1)
    ends(path, 2.9, "hand")
    with pytest.raises(Unusable, match="the hand never moves, or by 3 pixels only"):
        ends(path, 3.1, "hand")


def test_progress_is_along_the_way_within_it_and_never_back():
    path = np.array([[-4.0, 0], [0, 9], [3, 3], [2, 2], [5, 15], [1, 0]])
    way = progress(path, np.zeros(2), np.array([6.0, 8.0]))  # 10 long; (x 6 + y 8) / 100
    np.testing.assert_allclose(way, [0, 0.72, 0.72, 0.72, 1, 1])


def test_between_marks_a_correction_is_interpolated_and_beyond_them_it_fades_in_half_a_second():
    """At 10 frames a second: 4 pixels at 1.0 s and 8 at 1.4 s, of a tip that rests at 50."""
    sure = np.full(30, 0.8)
    sure[[11, 12]] = 0.3  # between two marks
    whole = tracks(np.full(30, 50.0), sure=sure, rate=10)
    marked = whole.marked("tip", [(58.0, 50.0, 1.4), (54.0, 50.0, 1.0)])
    moved = [0.8, 1.6, 2.4, 3.2, 4, 5, 6, 7, 8, 6.4, 4.8, 3.2, 1.6]  # from 0.6 to 1.8 s
    off = np.zeros(30)
    off[6:19] = moved
    np.testing.assert_allclose(marked.tip[:, 0] - 50, off, atol=1e-9)
    assert (marked.tip[:, 1] == 50).all() and marked.object is whole.object
    own = np.full(30, 0.8)
    own[10:15] = 1
    np.testing.assert_allclose(marked.tip_sure, own, atol=1e-9)


def test_frames_that_a_correction_does_not_move_stay_as_they_were_found():
    """The tip is not sure, and wrong, for a second; then it is right. Three clicks, as a person
    sets them, mend the beginning: what follows is untouched, and not surer than it was."""
    t = np.arange(40) / 10
    sure = np.where(t < 0.95, 0.2, 0.7)
    sure[30] = 0.1
    x = np.where(t < 0.95, 5.0, 40.0)
    x[30] = 90.0
    marked = tracks(x, sure=sure, rate=10).marked(
        "tip", [(10.0, 50.0, 0.0), (17.0, 50.0, 0.35), (31.0, 50.0, 0.7)]
    )
    np.testing.assert_allclose(marked.tip[10:, 0], x[10:])
    np.testing.assert_allclose(marked.tip_sure[10:], sure[10:])
    np.testing.assert_allclose(marked.tip[[0, 2, 7, 8, 9], 0], [10, 14, 31, 34, 37])
    np.testing.assert_allclose(marked.tip_sure[:10], [1] * 8 + [0.8, 0.6])


def test_a_gap_longer_than_half_a_second_is_filled_up_to_the_next_sure_frame():
    sure = np.ones(30)
    sure[5:21] = 0.0
    marked = tracks(np.full(30, 10.0), sure=sure, rate=10).marked("tip", [(40.0, 50.0, 1.0)])
    at = np.array([4, 7, 10, 15, 19, 20, 21])  # sure: 4 and 21
    wanted = np.interp(at, [4, 10, 21], [10, 40, 10])
    np.testing.assert_allclose(marked.tip[at, 0], wanted)
    np.testing.assert_allclose(marked.tip_sure[at], [1, 0.4, 1, 0, 0, 0, 1], atol=1e-9)


def test_a_correction_does_not_go_beyond_a_cut():
    """Clicks at 0.7 s and 1.3 s, each on a sure dot, and a cut at 1.0 s, with a jump by 40."""
    x = np.where(np.arange(20) < 10, 10.0, 50.0)
    whole = tracks(x, sure=np.full(20, 0.8), cuts=(10,), rate=10)
    marked = whole.marked("tip", [(20.0, 50.0, 0.7)])
    np.testing.assert_allclose(marked.tip[7:10, 0], [20, 18, 16])
    assert (marked.tip[10:] == whole.tip[10:]).all() and (marked.tip_sure[10:] == 0.8).all()
    assert [i for i in range(20) if marked.is_yours("tip", i)] == [7]
    both = whole.marked("tip", [(20.0, 50.0, 0.7), (70.0, 50.0, 1.3)])
    np.testing.assert_allclose(both.tip[7:14, 0], [20, 18, 16, 58, 62, 66, 70])
    assert [i for i in range(20) if both.is_yours("tip", i)] == [7, 13]
    assert not any(both.is_yours("object", i) for i in range(20))


@pytest.mark.parametrize(
    ("second", "path"),
    [(54.0, [50, 58, 59, 53, 54, 51.2]), (54.4, [50, 51.1, 52.2, 53.3, 54.4, 51.52])],
)
def test_marks_alone_make_the_path_between_them_where_something_else_was_found(second, path):
    """At 10 frames a second the dot rests at 40, but for two frames in which it leaps to 47.

    Clicks by 10 and 14 pixels beside it move it, leap and all. Once they differ by more than 4 of
    the picture's 100, they are not of what was found: a straight line joins them. Beyond the second
    it is left for the dot within half a second in either case.
    """
    x = np.full(30, 40.0)
    x[[11, 12]] = 47
    found = tracks(x, sure=np.full(30, 0.8), rate=10)
    marked = found.marked("tip", [(50.0, 50.0, 1.0), (second, 50.0, 1.4)])
    np.testing.assert_allclose(marked.tip[10:16, 0], path)


def test_marks_alone_make_the_path_where_nothing_was_found():
    """They count in the order of their times, and of two at one time the later."""
    lost = replace(tracks(np.full(21, 50.0), rate=20), tip_sure=np.zeros(21))
    marked = lost.marked("tip", [(30.0, 8.0, 0.4), (99.0, 9.0, 0.0), (10.0, 0.0, 0.0)])
    np.testing.assert_allclose(marked.tip[[0, 4, 8, 20]], [[10, 0], [20, 4], [30, 8], [30, 8]])
    np.testing.assert_allclose(marked.tip_sure[[0, 8, 12, 20]], [1, 1, 0.6, 0], atol=1e-9)
    assert (lost.tip_sure == 0).all() and lost.marked("tip", []) is lost
