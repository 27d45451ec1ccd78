"""Paths in a clip laid into a scene: a push whose truth is known, and clips that cannot be laid."""

from dataclasses import replace

import numpy as np
import pytest
from toy_pushes import CAMERA, HIT, SCENE, SIDE, at, clip, hit, jerk, push, seen

from lbw_minimal.clips import retarget
from lbw_minimal.clips.paths import (
    LEAST_FRAMES,
    Tracks,
    Unusable,
    low_pass,
    of_a_hand,
    progress,
)
from lbw_minimal.clips.retarget import APPROACH, FPS, HURRY, Motion, apply, fit, lay, pace

PUSHING = np.linspace(1.35, 1.9, 20)  # s, after 12 % of the way and before it is done
TILTED = np.array([[900.0, 120.0, -300.0], [90.0, -900.0, 300.0]])  # by 6 and 8 degrees
MIRROR = np.diag([-1.0, 1.0])


def mirrored(camera):
    return np.column_stack([MIRROR @ camera[:, :2], MIRROR @ camera[:, 2] + [SIDE, 0]])


def test_the_cameras_map_is_found_again():
    """Start and goal of the toy push are the scene's, so the fit has to undo the camera."""
    A = lay(clip(), SCENE).affine
    pixels = np.random.default_rng(0).uniform(100, 400, (20, 2))
    there = (pixels - CAMERA[:, 2]) @ np.linalg.inv(CAMERA[:, :2]).T
    np.testing.assert_allclose(apply(A, pixels), there, atol=1e-3)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"camera": mirrored(CAMERA)},
        {"camera": TILTED},
        {"camera": 0.3 * CAMERA, "noise": 0.3},
        {"noise": 2.0},
        {"fps": 60.0, "noise": 2.0},
        {"fps": 240.0, "noise": 3.0},
        {"fps": 10.0},
    ],
    ids=["plain", "mirrored", "tilted", "small", "noisy", "60 fps", "240 fps", "10 fps"],
)
def test_the_tip_pushes_where_and_when_it_did(options):
    motion = lay(clip(**options), SCENE)
    assert at(motion, push, PUSHING)[:, 0].max() < 0.012  # m
    np.testing.assert_allclose(motion.tip[-1], [0.61, 0.02], atol=0.003)
    np.testing.assert_allclose(motion.object[-1], SCENE.goal, atol=0.003)
    assert motion.mirrored == (options.get("camera") is not None and options["camera"][0, 0] < 0)


@pytest.mark.parametrize("fps", [10, 30, 60, 240])
def test_time_comes_from_the_time_stamps(fps):
    """From 12 to 99 % of its way the object takes 0.64 s, however often it is filmed."""
    motion = lay(clip(fps=fps), SCENE)
    assert abs((motion.arrival - motion.contact) / FPS - 0.64) < 0.09


def test_uneven_time_stamps_are_believed():
    t = np.sort(np.random.default_rng(1).uniform(0, 2.6, 70))
    assert at(lay(seen(push(t), t), SCENE), push, PUSHING)[:, 0].max() < 0.012


def test_a_clip_at_half_its_speed_takes_twice_as_long():
    t = np.arange(0, 5.2, 1 / 30)
    slow, fast = lay(seen(push(t / 2), t), SCENE), lay(clip(), SCENE)
    ratio = (slow.arrival - slow.contact) / (fast.arrival - fast.contact)
    assert abs(ratio - 2) < 0.15


@pytest.mark.parametrize("noise", [0, 3])
def test_the_tip_never_passes_the_object_which_never_goes_back(noise):
    motion = lay(clip(noise=noise), SCENE)
    assert (motion.tip[:, 0] <= motion.object[:, 0] - SCENE.contact + 1e-6).all()
    assert (np.diff(motion.object[:, 0]) >= 0).all()


def test_tip_and_object_touch_even_where_a_knuckle_was_taken_for_the_tip():
    tracks = clip()
    moved = replace(tracks, tip=tracks.tip + (-30, -50))
    np.testing.assert_allclose(lay(moved, SCENE).tip[-1], [0.61, 0.02], atol=0.003)
    assert at(lay(moved, SCENE), push, PUSHING).max() < 0.012


def test_the_motion_begins_at_the_arms_start_and_gets_to_the_clip_in_time():
    motion = lay(clip(), SCENE)
    np.testing.assert_allclose(motion.tip[0], SCENE.tip, atol=1e-6)
    n = round(APPROACH * FPS)
    first = motion.tip[n]
    assert motion.times[n] == motion.times[0] < motion.times[n + 1]
    np.testing.assert_allclose(
        motion.tip[:n], SCENE.tip + jerk(np.arange(n) / n)[:, None] * (first - SCENE.tip), atol=1e-6
    )


def test_no_step_is_longer_than_the_arm_can_go():
    t = np.arange(0, 0.6, 1 / 60)
    motion = lay(seen(push(5 * t), t), SCENE)
    assert np.abs(np.diff(motion.tip, axis=0)).max() <= HURRY * SCENE.step + 1e-9
    assert "as fast as the scene's arm" in motion.warnings[0]
    assert not lay(clip(), SCENE).warnings


def test_a_pause_on_the_way_is_kept_and_said():
    t = np.arange(0, 4.6, 1 / 30)
    paused, plain = lay(seen(push(t, rest=2.0), t), SCENE), lay(clip(), SCENE)
    assert abs((paused.arrival - plain.arrival) / FPS - 2.0) < 0.1
    assert any("rests for 2.0 s" in note or "rests for 2.1 s" in note for note in paused.notes)


def test_the_idle_beginning_and_end_are_left_out_and_said():
    t = np.arange(0, 12.6, 1 / 30)
    motion = lay(seen(push(t - 4), t), SCENE)
    assert abs(len(motion.tip) - len(lay(clip(), SCENE).tip)) < 15
    assert [note.split(" s,")[0] for note in motion.notes[:2]] == ["The first 3.7", "The last 6.3"]


@pytest.mark.parametrize("late", [0, 1, 5])
def test_three_tenths_of_a_second_are_kept_before_the_hand_starts(late):
    """It starts with the step of contact, or some steps before."""
    x = np.tile((0.46, 0.02), (30, 1))
    x[20 - late :, 0] += 0.01
    starts = 20 - late - 1 - round(0.3 * FPS)
    assert retarget._first_step(x, 20, SCENE) == starts


def test_a_loop_that_begins_in_its_middle_is_cut_where_it_jumps():
    t = np.arange(0, 2.6, 1 / 30)
    turned = np.roll(np.arange(len(t)), 10)  # the last ten frames come first
    tracks = seen(tuple(x[turned] for x in push(t)), t, cuts=(10,))
    motion = lay(tracks, SCENE)
    assert motion.times[0] >= t[10] and "jumps once, at 0.3 s" in motion.warnings[0]
    world = lambda seconds: push(seconds - 10 / 30)  # noqa: E731
    assert at(motion, world, PUSHING + 10 / 30)[:, 0].max() < 0.012


def test_a_flash_is_no_cut():
    motion = lay(clip(cuts=(40,)), SCENE)
    assert not any("cut" in note for note in motion.notes)
    assert at(motion, push, PUSHING)[:, 0].max() < 0.012


def test_what_is_not_sure_is_not_believed():
    tracks = clip()
    lost = np.arange(len(tracks.times)) % 4 == 1
    wild = replace(
        tracks,
        tip=np.where(lost[:, None], 0, tracks.tip), tip_sure=np.where(lost, 0.1, 1),
        object=np.where(lost[:, None], 470, tracks.object), object_sure=np.where(lost, 0.1, 1),
    )  # fmt: skip
    assert at(lay(wild, SCENE), push, PUSHING)[:, 0].max() < 0.012


def hidden(first, last):
    """The push, its object hidden between two moments."""
    tracks = clip()
    away = (tracks.times > first) & (tracks.times < last)
    return replace(tracks, object_sure=np.where(away, 0.2, 1.0))


def test_an_object_that_is_hidden_for_a_while_is_said():
    """It is pushed from 1 to 2 s, so half of its way is seen."""
    assert lay(hidden(0.9, 1.5), SCENE).warnings == [
        "The object was not surely found from 0.9 to 1.5 s: look at these pictures."
    ]


def test_what_is_hidden_on_most_of_its_way_may_be_another_thing_when_it_is_seen_again():
    with pytest.raises(Unusable, match="may be two things"):
        lay(hidden(1.2, 1.8), SCENE)
    t = np.arange(0, 2.5, 1 / 6)
    lay(seen(hit(t, 2.0), t), HIT)  # few frames show a hit


def test_a_tip_that_is_lost_on_its_way_is_said_and_one_lost_after_it_is_not():
    tracks = clip()
    for first, last, said in ((1.2, 1.9, ["The tip was"]), (2.0, 3.0, [])):
        lost = (tracks.times > first) & (tracks.times < last)
        motion = lay(replace(tracks, tip_sure=np.where(lost, 0.2, 1.0)), SCENE)
        assert [warning[:11] for warning in motion.warnings] == said


def test_a_hand_that_leaves_after_a_hit_is_not_missed():
    t = np.arange(0, 2.5, 1 / 30)
    tracks = seen(hit(t, 0.4), t)
    motion = lay(tracks, HIT)
    gone = tracks.times > motion.times[motion.contact] + 0.1
    assert gone.mean() > 0.2
    left = lay(replace(tracks, tip_sure=np.where(gone, 0.2, 1.0)), HIT)
    assert not [said for said in left.warnings if "surely" in said]


def test_a_single_glitch_is_taken_out():
    tracks = clip()
    tracks.object[45] += 200
    assert at(lay(tracks, SCENE), push, PUSHING)[:, 0].max() < 0.012


def test_a_straight_line_passes_the_low_pass_as_it_is():
    s = np.sort(np.random.default_rng(0).uniform(0, 2, 60))
    t = np.arange(s[0], s[-1], 0.04)
    line = np.stack([3 * s - 1, 5 - s], 1)
    np.testing.assert_allclose(low_pass(s, line, t), np.stack([3 * t - 1, 5 - t], 1), atol=1e-9)


def test_progress_by_hand():
    path = np.array([[0, 0], [2, 5], [1, 0], [11, 0], [4, 0]])
    way = progress(path, np.array([0, 0]), np.array([10, 0]))
    np.testing.assert_allclose(way, [0, 0.2, 0.2, 1, 1])


def test_a_reach_goes_from_the_arms_start_to_the_mark():
    scene = replace(SCENE, start=(0.46, 0.12), goal=(0.68, 0.06), tip=(0.46, 0.12), contact=None)
    t = np.arange(0, 2, 1 / 30)
    x = np.array([100.0, 300.0]) + jerk(t / 1.5)[:, None] * [200.0, 90.0]
    tracks = seen((x, x), t, camera=np.eye(2, 3))
    motion = lay(replace(tracks, object_sure=0 * tracks.object_sure), scene)
    np.testing.assert_allclose(motion.tip[[0, -1]], [scene.tip, scene.goal], atol=0.006)
    assert abs(motion.arrival / FPS - 1.3) < 0.2 and motion.object is None
    assert motion.warnings == []  # there is no object to miss


@pytest.mark.parametrize(("share", "usable"), [(0.05, False), (0.07, True)])
def test_an_object_that_goes_by_less_than_a_sixteenth_of_the_picture_never_moves(share, usable):
    """A hand that comes to rest over a thing, and hides half of it, makes it seem to do so."""
    small = clip(camera=CAMERA * share * SIDE / (0.15 * 900))
    if usable:
        lay(small, SCENE)
    else:
        with pytest.raises(Unusable, match="the object never moves, or by 24 pixels only"):
            lay(small, SCENE)


@pytest.mark.parametrize(("share", "usable"), [(0.09, False), (0.12, True)])
def test_a_hand_that_stirs_by_less_than_a_tenth_of_the_picture_does_not_reach(share, usable):
    scene = replace(SCENE, start=(0.46, 0.12), goal=(0.68, 0.06), tip=(0.46, 0.12), contact=None)
    t = np.arange(0, 2, 1 / 30)
    x = np.array([100.0, 300.0]) + jerk(t / 1.5)[:, None] * [share * SIDE, 0.0]
    tracks = seen((x, x), t, camera=np.eye(2, 3))
    if usable:
        lay(tracks, scene)
    else:
        with pytest.raises(Unusable, match="the hand never moves"):
            lay(tracks, scene)


@pytest.mark.parametrize(
    ("tip", "thing", "way", "stands_in"),
    [
        (0.25, 0.6, 9, 1),
        (0.25, 0.5, 9, 1),
        (0.35, 0.6, 9, 1),
        (0.35, 0.6, 7, 0),
        (0.25, 0.4, 9, 0),
        (0.25, 0.6, 7, 0),
    ],
)
def test_in_a_reach_what_moves_is_the_hand_if_no_tip_is_found(tip, thing, way, stands_in):
    """A tip that rests, in three frames of ten, is enough; what stands in for it has to be seen in
    half of them, and to go by 8 pixels of a picture with 200: what rests is a thing at the mark."""
    n = 100
    sure = [np.where(np.arange(n) < n * share, 1.0, 0.0) for share in (tip, thing)]
    path = 1 + np.linspace(0, way / thing, n)[:, None] * [1, 0]
    tracks = Tracks(np.arange(n) / 25, np.zeros((n, 2)), path, *sure, side=200)
    notes = []
    hand = of_a_hand(tracks, notes)
    assert hand.tip[0, 0] == stands_in and len(notes) == stands_in
    assert hand.tip_sure.mean() == (thing if stands_in else tip)


@pytest.mark.parametrize(("way", "stands_in"), [(19.0, 0), (21.0, 1)])
def test_in_a_reach_what_goes_twice_as_far_as_the_tip_is_the_hand(way, stands_in):
    n = 100
    tip, thing = (np.linspace((0, 0), (far, 0), n) for far in (10.0, way))
    tracks = Tracks(np.arange(n) / 25, tip, thing + 1, np.ones(n), np.ones(n), side=200)
    assert of_a_hand(tracks, []).tip[0, 0] == stands_in


@pytest.mark.parametrize(("frames", "usable"), [(29, False), (30, True)])
def test_a_hand_that_reaches_is_seen_in_three_tenths_of_the_frames(frames, usable):
    scene = replace(SCENE, start=(0.46, 0.12), goal=(0.68, 0.06), tip=(0.46, 0.12), contact=None)
    t, sure = np.arange(100) / 30, np.zeros(100)
    sure[np.linspace(0, 99, frames).round().astype(int)] = 1
    x = np.array([100.0, 300.0]) + jerk(t / 3)[:, None] * [200.0, 90.0]
    tracks = replace(seen((x, x), t, camera=np.eye(2, 3)), tip_sure=sure, object_sure=0 * sure)
    if usable:
        lay(tracks, scene)
    else:
        with pytest.raises(Unusable, match="tip of the hand is seen in 29%"):
            lay(tracks, scene)


def test_a_hand_that_goes_back_after_a_reach_has_stayed_at_the_mark():
    """Half a second there, then home again, which the motion does not do."""
    scene = replace(SCENE, start=(0.46, 0.12), goal=(0.68, 0.06), tip=(0.46, 0.12), contact=None)
    t = np.arange(0, 3, 1 / 30)
    way = jerk(t / 1.2) - 0.5 * jerk((t - 1.3) / 1.2)
    x = np.array([100.0, 300.0]) + way[:, None] * [200.0, 90.0]
    motion = lay(seen((x, x), t, camera=np.eye(2, 3)), scene)
    np.testing.assert_allclose(motion.tip[motion.arrival :] - motion.tip[-1], 0, atol=1e-9)
    np.testing.assert_allclose(motion.tip[-1], scene.goal, atol=0.006)
    assert len(motion.tip) - motion.arrival == pytest.approx(0.3 * FPS, abs=1.5)


@pytest.mark.parametrize("speed", [0.4, 0.8])
def test_a_hit_is_as_fast_as_it_was(speed):
    t = np.arange(0, 2.5, 1 / 120)
    motion = lay(seen(hit(t, speed), t), HIT)
    fastest = np.diff(motion.tip[:, 0]).max() * FPS
    assert 0.8 < fastest / (speed * np.pi / 2) < 1.1 or speed == 0.8  # pace slows the faster one
    assert fastest <= HURRY * HIT.step * FPS + 1e-9


def test_marks_alone_make_a_path_where_nothing_was_found():
    tracks = clip()
    blind = replace(tracks, object=tracks.object * 0, object_sure=tracks.object_sure * 0)
    marks = [(*tracks.object[i], tracks.times[i]) for i in range(0, 78, 4)]
    motion = lay(blind.marked("object", marks), SCENE)
    assert at(motion, push, PUSHING)[:, 0].max() < 0.012


def nothing_is_pushed():
    tracks = clip()
    return replace(tracks, object=tracks.object[:1] + 0 * tracks.object), "the object never moves"


def no_hand():
    tracks = clip()
    return replace(tracks, tip_sure=0 * tracks.tip_sure), "the tip of the hand is seen in 0%"


def an_unseen_hand_that_pushes():
    tracks = clip()
    moves = (tracks.times > 0.9) & (tracks.times < 2.1)
    return replace(tracks, tip_sure=np.where(moves, 0.4, 1.0)), "not surely seen while the object"


def a_hidden_object():
    tracks = clip()
    sure = np.where(np.arange(len(tracks.times)) > 20, 0.0, 1.0)
    return replace(tracks, object_sure=sure), "the object is seen in"


def too_few_frames():
    return clip(fps=2), "6 frames are too few"


def short_pieces():
    tracks = clip()
    cuts = tuple(range(5, 78, 5))
    jumps = 100 * (np.searchsorted(cuts, np.arange(len(tracks.times)), side="right") % 2)
    return replace(
        tracks, tip=tracks.tip + jumps[:, None], cuts=cuts
    ), "5 frames in one go, too few"


def from_above():
    return clip(camera=np.array([[100.0, 0, 0], [900.0, -100.0, 0]])), "up or down"


def pulled():
    """The arm comes from the right and draws the object to the right, towards itself."""
    tracks = clip()
    flipped = 2 * tracks.object[0, 0] - tracks.tip[:, 0]
    pull = tracks.object[:, 0] + 2 * np.maximum(0, flipped - tracks.object[0, 0] - 36)
    come = np.where(tracks.times < 1, pull, tracks.object[:, 0] + 5)
    return replace(tracks, tip=np.stack([come, tracks.tip[:, 1]], 1)), "comes towards the arm"


def held_from_the_front():
    tracks = clip()
    return replace(tracks, tip=tracks.object + (80, 0)), "the hand is in front of it"


def hidden_by_the_arm():
    """The same, of an arm that comes from behind the object."""
    return replace(held_from_the_front()[0], enters=0.2), "hides it"


def drawn_to_the_arm():
    """The tip is where it ought to be, and the arm comes in from the other side."""
    return replace(clip(), enters=0.8, width=480), "which so pulls it"


def hooked():
    """A hand that is behind the object, of an arm that comes from above and ahead of it."""
    return replace(clip(), enters=0.74, width=1000), "which so pulls it"


def broken_off():
    """27 pixels from its start, which are less than a tenth of the picture."""
    return clip(last=1.4), "while the object still gets faster"


def lifted_by_a_hand_in_front():
    """The detector takes a wheel of the toy for the tip; what is lifted is lifted all the same."""
    tracks = lifted()[0]
    return replace(tracks, tip=tracks.object + (80, 0), enters=0.2), "leaves its straight"


def nothing_stands_elsewhere_in_the_end():
    return replace(a_hidden_object()[0], unmoved=True), "the object never moves"


def the_hand_taken_for_the_object():
    tracks = clip()
    slope = tracks.tip + np.stack([0 * tracks.times, 0.5 * tracks.object[:, 0]], 1)
    return replace(tracks, tip=slope, object=slope + (10, 0)), "is the hand"


def lifted():
    tracks = clip()
    up = 90 * np.sin(np.pi * jerk(tracks.times - 1))
    return replace(tracks, object=tracks.object - np.stack([0 * up, up], 1)), "leaves its straight"


NOT_USABLE = (nothing_is_pushed, no_hand, an_unseen_hand_that_pushes, a_hidden_object,
              too_few_frames, short_pieces, from_above,
              pulled, held_from_the_front, hidden_by_the_arm, drawn_to_the_arm, hooked,
              the_hand_taken_for_the_object, broken_off, lifted,
              lifted_by_a_hand_in_front, nothing_stands_elsewhere_in_the_end)  # fmt: skip


@pytest.mark.parametrize("fault", NOT_USABLE, ids=lambda f: f.__name__)
def test_a_clip_that_cannot_be_laid_is_refused_with_the_reason_and_a_remedy(fault):
    tracks, reason = fault()
    with pytest.raises(Unusable) as error:
        lay(tracks, SCENE)
    assert reason in str(error.value)
    assert str(error.value).count("; ") == 1 and str(error.value).endswith(".")


def hand_in_hand():
    """The hand is at the object from the first picture on, and both come down in the picture."""
    tracks = clip()
    slope = tracks.object + np.stack(
        [0 * tracks.times, 0.4 * (tracks.object[:, 0] - tracks.object[0, 0])], 1
    )
    return replace(tracks, tip=slope - (20, 0), object=slope), "is the hand"


def a_hand_that_goes_up():
    """And what was taken for the object lies still."""
    tracks = nothing_is_pushed()[0]
    up = 300 * np.clip(tracks.times / tracks.times[-1], 0, 1)
    return replace(tracks, tip=tracks.tip * (0.1, 1) - np.stack([0 * up, up], 1)), "as one that"


def marked(tracks, truth, *names):
    """The tracks with the places of tip or object in `truth` as the user's marks."""
    for name in names:
        path = getattr(truth, name)
        tracks = tracks.marked(name, [(*path[i], truth.times[i]) for i in range(0, 78, 4)])
    return tracks


def test_what_the_user_placed_as_the_object_is_not_the_hand():
    tracks, reason = hand_in_hand()
    with pytest.raises(Unusable, match=reason):
        lay(tracks, SCENE)
    lay(marked(tracks, tracks, "object"), SCENE)


def test_what_the_user_placed_as_the_object_lies_still_however_the_hand_goes():
    tracks, reason = a_hand_that_goes_up()
    with pytest.raises(Unusable, match=reason):
        lay(tracks, SCENE)
    still = marked(tracks, tracks, "object")
    with pytest.raises(Unusable, match="never moves"):
        lay(still, SCENE)


def test_an_arm_may_come_in_ahead_of_a_hand_that_the_user_placed():
    tracks, reason = hooked()
    lay(marked(tracks, tracks, "tip"), SCENE)
    with pytest.raises(Unusable, match=reason):
        lay(marked(tracks, tracks, "object"), SCENE)


@pytest.mark.parametrize(
    ("enters", "mirror"), [(0.2, False), (0.8, True), (0.5, False), (0.5, True), (np.nan, False)]
)
def test_an_arm_may_come_from_behind_the_object_or_from_above(enters, mirror):
    lay(replace(clip(camera=mirrored(CAMERA) if mirror else CAMERA), enters=enters), SCENE)


def test_a_hand_and_an_object_that_go_along_a_level_table_together_are_both_there():
    """As in a loop that begins in the middle of the push."""
    t = np.arange(1, 2.6, 1 / 30)
    lay(seen(push(t), t), SCENE)


def test_a_way_that_comes_down_is_laid_where_the_hand_came_to_the_object():
    """The camera leans by 20 degrees."""
    lay(clip(camera=CAMERA + np.array([[0, 0, 0], [320.0, 0, 0]])), SCENE)


@pytest.mark.parametrize(("last", "faster"), [(1.5, True), (1.8, False), (2.3, False)])
def test_a_clip_that_breaks_off_while_the_object_gets_faster_is_warned_of(last, faster):
    """Half of the way is gone at 1.5 s, where the object is fastest."""
    warnings = lay(clip(last=last), SCENE).warnings
    assert any("still gets faster" in warning for warning in warnings) == faster


def test_a_puck_that_is_pushed_to_the_end_is_no_hit():
    t = np.arange(0, 3, 1 / 30)
    along = 0.41 * jerk(t / 2 - 0.5)
    tip = np.stack([0.49 + along, np.full(len(t), 0.02)], 1)
    thing = np.stack([0.53 + along, np.full(len(t), 0.02)], 1)
    with pytest.raises(Unusable, match="pushed and not hit"):
        lay(seen((tip, thing), t), HIT)


def test_a_hand_that_reaches_far_out_of_the_scene_is_refused():
    scene = replace(SCENE, start=(0.46, 0.12), goal=(0.68, 0.06), tip=(0.46, 0.12), contact=None)
    t = np.arange(0, 1.5, 1 / 30)
    x = np.stack([100 + 66 * t, 300 - 75 * np.sin(np.pi * t / 1.5)], 1)
    with pytest.raises(Unusable, match="out of the scene's reach"):
        lay(seen((x, x), t, camera=np.eye(2, 3)), scene)


def test_the_user_may_mirror_and_is_told_when_that_is_wrong():
    assert not lay(clip(), SCENE, mirror=False).mirrored
    with pytest.raises(Unusable, match="leave out --mirror or --no-mirror"):
        lay(clip(), SCENE, mirror=True)


def test_the_shortest_piece_that_is_enough_is_enough():
    t = np.linspace(0.9, 2.1, LEAST_FRAMES)
    assert lay(seen(push(t), t), SCENE).arrival > 0


# Numbers of the recipe, a little on either side of each -------------------------------------------


@pytest.mark.parametrize(("steep", "usable"), [(0.9, True), (-0.9, True), (1.1, False)])
def test_a_way_of_up_to_45_degrees_is_laid_down(steep, usable):
    start, end = np.array([100.0, 200]), np.array([300.0, 200 + 200 * steep])
    if not usable:
        with pytest.raises(Unusable, match="up or down"):
            fit(start, end, SCENE, False)
        return
    for mirror in (False, True):
        flip = [-1, 1] if mirror else [1, 1]
        A = fit(start * flip, end * flip, SCENE, mirror)
        np.testing.assert_allclose(
            apply(A, np.stack([start, end]) * flip), [SCENE.start, SCENE.goal], atol=1e-12
        )
        # What is upright stays so, as high as what is as wide, and up stays up.
        np.testing.assert_allclose(A @ (0, -200, 0), [0, 0.15], atol=1e-12)


@pytest.mark.parametrize("mirror", [False, True])
def test_a_hand_that_comes_down_to_a_mark_is_turned_with_its_way(mirror):
    """3 across and 4 down, of length 5, become 5 across: what was 5 below the way's start is now 4
    ahead of it and 3 below."""
    scene = replace(SCENE, start=(0.0, 0.0), goal=(5.0, 0.0), contact=None)
    sign = -1 if mirror else 1
    A = fit(np.array([10.0 * sign, 20]), np.array([13.0 * sign, 24]), scene, mirror)
    there = apply(A, np.array([[10.0 * sign, 20], [13 * sign, 24], [10 * sign, 25]]))
    np.testing.assert_allclose(there, [(0, 0), (5, 0), (4, -3)], atol=1e-12)


@pytest.mark.parametrize("way", [(100, 160), (3, 200), (0, 200), (0, -200), (-2, 150)])
def test_a_hand_may_come_to_a_mark_from_anywhere(way):
    """From straight above or below: two examiners call such reaches usable, see the results."""
    scene = replace(SCENE, start=(0.0, 0.0), goal=(0.5, 0.0), contact=None)
    start, mirror = np.array([100.0, 300]), way[0] < 0
    A = fit(start, start + way, scene, mirror)
    there = apply(A, np.stack([start, start + np.multiply(way, 0.5), start + way]))
    np.testing.assert_allclose(there, [(0, 0), (0.25, 0), (0.5, 0)], atol=1e-12)
    # its sides are as long as they were, to scale
    across = np.linalg.norm(A[:, :2] @ [-way[1], way[0]])
    assert across == pytest.approx(0.5)


@pytest.mark.parametrize("down", [-300, 300])
def test_what_goes_steeply_may_have_been_lifted(down):
    """Up the picture, or over the table towards the camera."""
    start = np.array([100.0, 400])
    with pytest.raises(Unusable, match="lift nothing, and film from the side"):
        fit(start, start + (100, down), SCENE, False)


def test_a_goal_that_is_higher_is_got_to_without_leaning():
    scene = replace(SCENE, start=(0.46, 0.12), goal=(0.68, 0.06))
    A = fit(np.array([10.0, 50]), np.array([120.0, 90]), scene, False)
    np.testing.assert_allclose(
        apply(A, np.array([[10.0, 50], [120, 90]])), [scene.start, scene.goal]
    )
    np.testing.assert_allclose(A @ (0, -110, 0), [0, 0.22], atol=1e-12)


@pytest.mark.parametrize(("share", "usable"), [(0.16, True), (0.24, False)])
def test_a_fifth_of_its_way_is_as_high_as_an_object_may_rise(share, usable):
    tracks = clip()
    up = 0.15 * 900 * share * np.sin(np.pi * jerk(tracks.times - 1))
    raised = replace(tracks, object=tracks.object - np.stack([0 * up, up], 1))
    if usable:
        lay(raised, SCENE)
    else:
        with pytest.raises(Unusable, match="leaves its straight way"):
            lay(raised, SCENE)


def test_what_is_seen_elsewhere_before_the_hand_comes_was_not_lifted():
    tracks = clip()
    passes = (tracks.times > 0.3) & (tracks.times < 0.5)
    lay(replace(tracks, object=tracks.object - passes[:, None] * (0, 0.3 * 0.15 * 900)), SCENE)


@pytest.mark.parametrize(("ahead", "usable"), [(0.15, True), (0.35, False)])
def test_a_hand_a_quarter_of_the_way_before_the_object_does_not_push_it(ahead, usable):
    tracks = clip()
    front = replace(tracks, tip=tracks.object + (0.15 * 900 * ahead, 0))
    if usable:
        lay(front, SCENE)
    else:
        with pytest.raises(Unusable, match="the hand is in front of it"):
            lay(front, SCENE)


@pytest.mark.parametrize(("share", "usable"), [(0.93, True), (0.99, False)])
def test_a_hit_goes_along_for_less_than_most_of_the_way(share, usable):
    t = np.arange(0, 3, 1 / 30)
    along = 0.41 * jerk(t / 2 - 0.5)
    tip = np.stack([0.49 + share * along, np.full(len(t), 0.02)], 1)
    thing = np.stack([0.53 + along, np.full(len(t), 0.02)], 1)
    tracks = seen((tip, thing), t)
    if not usable:
        with pytest.raises(Unusable, match="pushed and not hit"):
            lay(tracks, HIT)
        return
    motion = lay(tracks, HIT)
    assert motion.tip[:, 0].max() <= HIT.high[0] + 1e-9  # as far as the arm can go
    assert motion.tip[:, 0].max() > HIT.high[0] - 0.005
    assert any("the hit was shortened" in warning for warning in motion.warnings)


def test_an_object_is_in_contact_after_12_percent_of_its_way_and_there_at_99():
    """In the clip that is 1.31 s and 1.92 s: 0.12 and 0.99 of the minimum-jerk profile from 1 s."""
    motion = lay(clip(fps=120), SCENE)
    assert motion.times[motion.contact] == pytest.approx(1.31, abs=0.05)
    assert motion.times[motion.arrival] == pytest.approx(1.92, abs=0.05)
    assert motion.times[-1] - motion.times[motion.arrival] == pytest.approx(0.3, abs=0.05)


def test_before_contact_and_after_arrival_the_tip_is_at_the_height_of_the_push_or_comes_down():
    motion = lay(clip(), SCENE)
    np.testing.assert_allclose(motion.tip[motion.contact :, 1], SCENE.height, atol=1e-6)
    assert motion.tip[: motion.contact, 1].max() > 0.08
    # From contact to arrival it touches, and then it stays.
    touching = slice(motion.contact + 1, motion.arrival)
    gap = motion.object[touching, 0] - motion.tip[touching, 0]
    np.testing.assert_allclose(gap, SCENE.contact, atol=0.002)
    np.testing.assert_allclose(np.diff(motion.tip[motion.arrival + 1 :, 0]), 0, atol=1e-9)


@pytest.mark.parametrize(("steps", "warned"), [(0.012, False), (0.030, False), (0.042, True)])
def test_only_what_is_slowed_down_by_half_or_more_is_warned_of(steps, warned):
    """Four fifths of a step of 3 cm may be asked for: 1.25 times as slow, or 1.75 times."""
    tip = np.array([0.42, 0.1]) + np.outer(np.arange(6), [steps, 0])
    motion = Motion(tip, tip, np.arange(6) / 25, 2, 4, np.eye(2, 3), False)
    paced = pace(motion, SCENE)
    slower = max(1, steps / (0.8 * 0.03))
    assert np.abs(np.diff(paced.tip[:-1], axis=0)).max() == pytest.approx(steps / slower)
    assert paced.contact == round(2 * slower) and paced.arrival == round(4 * slower)
    assert bool(paced.warnings) == warned


@pytest.mark.parametrize("scene", [SCENE, HIT], ids=["push", "hit"])
def test_a_tip_that_is_seen_past_the_object_before_the_touch_is_laid_behind_it(scene):
    """Ten steps before the object goes the hand is 5 cm too far, as over the top of it."""
    way = np.clip((np.arange(40) - 19) / 10, 0, 1)
    x = np.stack([0.40 + 0.05 * way + 0.10 * (np.arange(40) == 10), np.full(40, 0.05)], 1)
    laid, thing = retarget._push(x, way, scene, [])
    assert (laid[:, 0] <= thing[:, 0] - scene.contact + 1e-12).all()
    assert laid[10, 0] == pytest.approx(scene.start[0] - scene.contact)


@pytest.mark.parametrize(("scene", "above"), [(SCENE, 0.03), (HIT, 0.02)], ids=["push", "hit"])
def test_a_run_up_comes_down_to_its_object_by_half_of_its_way(scene, above):
    """The hand is 4 cm behind the object and 3 cm above its middle: a fast one would hit the top.

    The touch is seen when a fifth of the way is gone."""
    way = np.clip((np.arange(40) - 19) / 10, 0, 1)
    x = np.full((40, 2), (0.4, 0.05))
    x[15] += -0.04 - 0.2 * (scene.goal[0] - scene.start[0]), 0.03
    laid, _ = retarget._push(x, way, scene, [])
    assert laid[15] == pytest.approx(
        (scene.start[0] - scene.contact - 0.04, scene.height + above), abs=1e-9
    )


def test_a_hand_that_is_a_little_out_of_the_box_is_laid_at_its_edge():
    """It begins 1.5 cm above the box, which is no reason to leave its beginning out."""
    t = np.arange(0, 2.6, 1 / 30)
    tip, thing = push(t)
    tip[:, 1] += 0.065 * (1 - jerk(t / 0.8))
    motion = lay(seen((tip, thing), t), SCENE)
    assert motion.tip[:, 1].max() == pytest.approx(SCENE.high[1])
    assert (motion.tip >= np.array(SCENE.low) - 1e-9).all()


def a_motion(x, z):
    tip = np.stack([np.array(x, float), np.array(z, float)], 1)
    return Motion(tip, tip + 1, np.arange(len(tip)) / FPS, 2, 4, np.eye(2, 3), False)


def test_an_arm_takes_six_tenths_of_a_second_to_where_the_clip_begins():
    """Fifteen steps, in which the clip waits; half of the way is gone at half of the time."""
    there = retarget.approach(a_motion([0.55] * 6, [0.06] * 6), SCENE)
    assert len(there.tip) == len(there.times) == len(there.object) == 15 + 6
    assert (there.contact, there.arrival) == (17, 19)
    assert (there.times[:16] == 0).all() and (there.object[:16] == there.object[0]).all()
    way = (there.tip[:16, 0] - 0.45) / 0.10
    np.testing.assert_allclose(way + way[::-1], 1)
    assert way[0] == 0 and way[3] == pytest.approx(0.0579, abs=1e-4)  # 0.2^3 (10 - 3 + 0.24)


@pytest.mark.parametrize(("off", "steps"), [(0.009, 0), (0.011, 15)])
def test_an_arm_that_is_there_but_for_a_centimetre_needs_no_way_to_it(off, steps):
    motion = a_motion([0.45] * 6, [0.12 - off] * 6)
    assert len(retarget.approach(motion, SCENE).tip) == 6 + steps


@pytest.mark.parametrize(("share", "usable"), [(0.5, True), (0.55, False)])
@pytest.mark.parametrize("off", [0.019, 0.021])
def test_a_hand_may_be_two_centimetres_out_of_the_scene_and_farther_for_half_of_its_way(
    share, usable, off
):
    inside = np.arange(20) >= round(20 * share)
    x = np.stack([np.full(20, 0.5), np.where(inside, 0.1, SCENE.high[1] + off)], 1)
    if usable or off < 0.02:
        retarget._check_reach(x, SCENE)
    else:
        with pytest.raises(Unusable, match="55% of the hand's way"):
            retarget._check_reach(x, SCENE)


@pytest.mark.parametrize(("share", "usable"), [(0.84, True), (0.86, False)])
def test_a_hand_that_goes_along_for_more_than_85_percent_has_not_hit(share, usable):
    x = np.stack([0.45 + np.linspace(0, share * 0.41, 9), np.zeros(9)], 1)
    if usable:
        retarget._limit_hit(x, 0, HIT, [])
        assert x[-1, 0] == pytest.approx(HIT.high[0])
    else:
        with pytest.raises(Unusable, match="pushed and not hit"):
            retarget._limit_hit(x, 0, HIT, [])


@pytest.mark.parametrize(("over", "warned"), [(0.9, False), (1.08, False), (1.12, True)])
def test_a_hit_that_is_shortened_by_more_than_a_tenth_is_warned_of(over, warned):
    """It has 10 cm of room from the touch on, where the way before it stays as it is."""
    x = np.stack([np.r_[0.44, 0.50, 0.54 + 0.10 * over * np.linspace(0, 1, 5)], np.zeros(7)], 1)
    warnings, before = [], x.copy()
    retarget._limit_hit(x, 2, HIT, warnings)
    np.testing.assert_allclose(x[:2], before[:2])
    np.testing.assert_allclose(x[2:, 0], 0.54 + 0.10 * min(1, over) * np.linspace(0, 1, 5))
    assert [f"for {10 * over:.0f} cm" in w for w in warnings] == [True] * warned


def test_a_hand_that_rests_at_the_clips_beginning_keeps_three_tenths_of_a_second_of_it():
    """Seven steps and a half, rounded to eight, before its first motion at step 20."""
    x = np.stack([0.45 + 0.01 * np.clip(np.arange(30) - 20, 0, None), np.full(30, 0.1)], 1)
    assert retarget._first_step(x, 28, SCENE) == 20 - 8


def test_rests_are_counted_in_seconds_and_said_from_three_tenths_on():
    def rests(steps):
        x = np.r_[np.arange(10), np.full(steps, 9.0), 9.0 + np.arange(1, 10)]
        return retarget._rests(np.stack([x, 0 * x], 1))

    assert rests(7) == []
    assert rests(8) == ["The hand rests for 0.3 s in all on its way; this is kept."]
    assert rests(25) == ["The hand rests for 1.0 s in all on its way; this is kept."]
    slow = np.r_[0, np.cumsum(np.r_[np.ones(5), np.full(25, 0.06), np.ones(5)])]
    assert retarget._rests(np.stack([slow, 0 * slow], 1)) == []  # a twentieth of the speed rests


@pytest.mark.parametrize("scene", [SCENE, HIT], ids=["push", "hit"])
def test_a_push_is_hurried_to_twelve_seconds_and_a_hit_is_not(scene):
    n = 20 * 25 + 1
    tip = np.stack([np.linspace(0.42, 0.6, n), np.full(n, 0.1)], 1)
    motion = pace(Motion(tip, tip, np.arange(n) / 25, 250, 400, np.eye(2, 3), False), scene)
    assert abs(len(motion.tip) - (300 if scene is SCENE else n)) <= 1
    assert motion.times[-1] == pytest.approx(20) and np.abs(motion.tip[-1] - tip[-1]).max() < 1e-9
    assert motion.contact == pytest.approx(250 / n * len(motion.tip), abs=1)
    assert bool(motion.warnings) == (scene is SCENE)


def test_of_the_way_before_a_hit_two_seconds_are_kept():
    """It strikes after five seconds in which the hand goes to and fro within reach."""
    t = np.arange(0, 7, 1 / 30)
    tip, thing = hit(t - 5)
    tip = tip + np.outer(0.01 * np.sin(2 * np.pi * t) * (t < 5.5), [1, 0])
    motion = lay(seen((tip, thing), t), HIT)
    begins = motion.times[0]
    strikes = motion.times[motion.contact]
    assert strikes - begins == pytest.approx(2.0, abs=0.1)


def test_a_hand_that_is_out_of_reach_at_first_is_followed_from_where_it_comes_in():
    """In from the right of the box by a metre a second; the box begins at 0.74 m."""
    t = np.arange(0, 3.6, 1 / 30)
    tip, thing = push(t - 1)
    far = np.clip(1 - t, 0, None)[:, None] * [-0.5, 0.0]
    motion = lay(seen((tip + far, thing), t), SCENE)
    came = 1 - (0.43 - SCENE.low[0] + 0.02) / 0.5  # s, when it is 2 cm out
    assert motion.times[0] == pytest.approx(came, abs=0.12)


def test_a_scene_is_a_hit_where_the_tip_cannot_get_behind_the_goal():
    near = replace(HIT, goal=(HIT.high[0] + HIT.contact - 0.001, 0.02))
    assert HIT.hit and not near.hit and not SCENE.hit
    assert replace(near, goal=(HIT.high[0] + HIT.contact + 0.001, 0.02)).hit
    assert not replace(HIT, contact=None).hit


def test_a_clip_that_begins_with_the_touch_is_followed_from_its_first_frame():
    """The hand is out of the tip's box there, and all of its way would have been left out."""
    t = np.arange(0, 2.6, 1 / 30)
    tip, thing = push(1.3 + t)  # 3 % of the way is gone, and 12 % within a tenth of a second
    motion = lay(seen((tip, thing), t), SCENE)
    before = round(APPROACH * FPS)
    assert motion.contact < before + 0.15 * FPS and motion.times[before] < 0.15


@pytest.mark.parametrize(("i", "first"), [(0, 0), (3, 3), (10, 7)])
def test_what_is_out_of_reach_is_left_out_up_to_the_touch(i, first):
    """Ten steps, of which the first seven are 3 cm above the box; the hand moves all along."""
    x = np.stack([0.45 + 0.01 * np.arange(11), np.where(np.arange(11) < 7, 0.20, 0.10)], 1)
    assert retarget._first_step(x, i, SCENE) == first
