"""Paths in a clip laid into a scene: a push whose truth is known, and clips that cannot be laid."""

from dataclasses import replace

import numpy as np
import pytest
from toy_pushes import CAMERA, HIT, SCENE, SIDE, at, clip, hit, jerk, push, seen

from lbw_minimal.clips.paths import LEAST_FRAMES, Unusable, low_pass, progress
from lbw_minimal.clips.retarget import APPROACH, FPS, HURRY, apply, lay

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


def test_a_loop_that_begins_in_its_middle_is_cut_where_it_jumps():
    t = np.arange(0, 2.6, 1 / 30)
    turned = np.roll(np.arange(len(t)), 10)  # the last ten frames come first
    tracks = seen(tuple(x[turned] for x in push(t)), t, cuts=(10,))
    motion = lay(tracks, SCENE)
    assert motion.times[0] >= t[10] and "cut 1 times" in motion.notes[0]
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


def test_an_object_that_is_hidden_for_a_while_is_said():
    tracks = clip()
    hidden = (tracks.times > 1.2) & (tracks.times < 1.8)
    motion = lay(replace(tracks, object_sure=np.where(hidden, 0.2, 1.0)), SCENE)
    assert motion.warnings == ["The object is not seen for 0.6 s; an even way was assumed."]


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
    motion = lay(seen((x, x), t, camera=np.eye(2, 3)), scene)
    np.testing.assert_allclose(motion.tip[[0, -1]], [scene.tip, scene.goal], atol=0.006)
    assert abs(motion.arrival / FPS - 1.3) < 0.2 and motion.object is None


@pytest.mark.parametrize("speed", [0.4, 0.8])
def test_a_hit_is_as_fast_as_it_was(speed):
    t = np.arange(0, 2.5, 1 / 120)
    motion = lay(seen(hit(t, speed), t), HIT)
    fastest = np.diff(motion.tip[:, 0]).max() * FPS
    assert 0.8 < fastest / (speed * np.pi / 2) < 1.1 or speed == 0.8  # pace slows the faster one
    assert fastest <= HURRY * HIT.step * FPS + 1e-9


def test_marks_move_a_path_and_between_them_the_correction_is_interpolated():
    tracks = clip()
    one = tracks.marked("tip", [(10.0, 20.0, tracks.times[30])])
    np.testing.assert_allclose(one.tip[30], [10, 20])
    np.testing.assert_allclose(one.tip - one.tip[30], tracks.tip - tracks.tip[30])
    x, y = tracks.object[20]
    two = tracks.marked(
        "object", [(*(tracks.object[40] + 8), tracks.times[40]), (x, y, tracks.times[20])]
    )
    off = (two.object - tracks.object)[[10, 20, 30, 40, 50], 0]
    np.testing.assert_allclose(off, [0, 0, 4, 8, 8], atol=1e-9)


def test_marks_alone_make_a_path_where_nothing_was_found():
    tracks = clip()
    blind = replace(tracks, object=tracks.object * 0, object_sure=tracks.object_sure * 0)
    marks = [(*tracks.object[i], tracks.times[i]) for i in range(0, 78, 4)]
    motion = lay(blind.marked("object", marks), SCENE)
    assert at(motion, push, PUSHING)[:, 0].max() < 0.012


def nothing_is_pushed():
    tracks = clip()
    return replace(tracks, object=tracks.object[:1] + 0 * tracks.object), "the object never moves"


def no_arm():
    tracks = clip()
    return replace(tracks, tip_sure=0 * tracks.tip_sure), "no arm is seen"


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
    return replace(tracks, tip=tracks.tip + jumps[:, None], cuts=cuts), "frames are too few"


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


def lifted():
    tracks = clip()
    up = 90 * np.sin(np.pi * jerk(tracks.times - 1))
    return replace(tracks, object=tracks.object - np.stack([0 * up, up], 1)), "leaves its straight"


NOT_USABLE = (nothing_is_pushed, no_arm, a_hidden_object, too_few_frames, short_pieces, from_above,
              pulled, held_from_the_front, lifted)  # fmt: skip


@pytest.mark.parametrize("fault", NOT_USABLE, ids=lambda f: f.__name__)
def test_a_clip_that_cannot_be_laid_is_refused_with_the_reason_and_a_remedy(fault):
    tracks, reason = fault()
    with pytest.raises(Unusable) as error:
        lay(tracks, SCENE)
    assert reason in str(error.value)
    assert str(error.value).count("; ") == 1 and str(error.value).endswith(".")


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
