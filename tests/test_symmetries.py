"""What has to stay when a clip is mirrored, shifted, enlarged, turned or played backwards.

No threshold matters here: whatever the rules are, they are the same for both sides.
"""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from lbw_minimal.clips import camera, footage, motion, paths, retarget
from lbw_minimal.clips.detector import Detector
from lbw_minimal.clips.paths import Tracks, interpolate, low_pass
from lbw_minimal.clips.retarget import Scene, lay
from lbw_minimal.clips.sight import Sight
from tasks.commands import prepare
from tests import toy_pushes
from tests.toy_clips import arm, room
from tests.toy_pushes import HIT, SCENE

REACH = Scene(start=(0.45, 0.12), goal=(0.60, 0.03), tip=(0.45, 0.12), low=(0.42, 0.015),
              high=(0.74, 0.17), step=0.03)  # fmt: skip


def tracks(world, noise=0.6):
    t = np.arange(0, 2.6, 1 / 24)
    seen = toy_pushes.seen(world(t), t, noise=noise)
    return replace(seen, enters=0.1, tip_sure=np.where((t > 0.2) & (t < 0.4), 0.3, 1.0))


def mirrored(clip, width=700):
    left = {name: (width, 0) + (-1, 1) * getattr(clip, name) for name in ("tip", "object")}
    return replace(clip, enters=1 - clip.enters, **left)


def enlarged(clip, by=2.5, shift=(37.0, -12.0)):
    places = {name: by * getattr(clip, name) + shift for name in ("tip", "object")}
    return replace(clip, side=by * clip.side, **places)


def laid(world, scene, change):
    """The motion of a clip, and of the same clip changed."""
    clip = tracks(world)
    return lay(clip, scene), lay(change(clip), scene)


def same(one, other, later=0.0):
    # A tenth of a millimetre: a rounded time may fall in or out of a window.
    exact = 3e-4 if later else 1e-6
    np.testing.assert_allclose(other.tip, one.tip, atol=exact)
    np.testing.assert_allclose(other.times, one.times + later, atol=1e-6)
    assert (other.contact, other.arrival) == (one.contact, one.arrival)
    if one.object is not None:
        np.testing.assert_allclose(other.object, one.object, atol=exact)


WORLDS = {"push": (toy_pushes.push, SCENE), "hit": (toy_pushes.hit, HIT),
          "reach": (lambda t: (toy_pushes.push(t)[0],) * 2, REACH)}  # fmt: skip


@pytest.mark.parametrize("name", WORLDS)
def test_a_clip_in_the_mirror_is_laid_the_same_way(name):
    one, other = laid(*WORLDS[name], mirrored)
    same(one, other)
    assert (one.mirrored, other.mirrored) == (False, True)
    point = np.array([[123.0, 45.0]])
    np.testing.assert_allclose(
        retarget.apply(other.affine, (700, 0) + (-1, 1) * point), retarget.apply(one.affine, point)
    )
    assert len(other.notes) == len(one.notes) + 1 and other.warnings == one.warnings


@pytest.mark.parametrize("name", WORLDS)
def test_a_clip_of_more_pixels_from_another_place_is_laid_the_same_way(name):
    one, other = laid(*WORLDS[name], enlarged)
    same(one, other)
    assert (other.notes, other.warnings) == (one.notes, one.warnings)


@pytest.mark.parametrize("name", WORLDS)
def test_a_clip_that_begins_later_is_laid_the_same_way_later(name):
    same(*laid(*WORLDS[name], lambda clip: replace(clip, times=clip.times + 7)), later=7)


@pytest.mark.parametrize("name", WORLDS)
def test_a_scene_elsewhere_gets_the_same_motion_elsewhere(name):
    """All of it 5 cm to the right and 2 cm higher."""
    world, scene = WORLDS[name]
    by = np.array([0.05, 0.02])
    places = {of: tuple(by + getattr(scene, of)) for of in ("start", "goal", "tip", "low", "high")}
    one = lay(tracks(world), scene)
    other = lay(tracks(world), replace(scene, height=scene.height + 0.02, **places))
    np.testing.assert_allclose(other.tip, one.tip + by, atol=1e-6)
    assert (other.contact, other.arrival) == (one.contact, one.arrival)


@pytest.mark.parametrize("name", ["push", "hit"])
def test_where_on_the_hand_the_tip_is_seen_matters_to_nothing(name):
    """A knuckle, 30 pixels higher and 11 behind."""
    same(*laid(*WORLDS[name], lambda clip: replace(clip, tip=clip.tip + (-11, -30))))


def a_motion(n, goes=0.01):
    x = np.arange(n) * goes
    return retarget.Motion(np.stack([x, 0 * x], 1), np.stack([2 * x, 0 * x], 1), np.arange(n) / 25,
                           2, n - 1, np.eye(3)[:2], False)  # fmt: skip


def test_a_motion_is_stretched_step_by_step_and_its_marks_are_rounded():
    """Its first two steps take 1.7 of the arm's, and so on: the touch is at 1.7, the end at 5.7."""
    slow = retarget.stretched(a_motion(5), np.array([0.7, 1.0, 1.0, 3.0]))
    assert (slow.contact, slow.arrival, len(slow.tip)) == (2, 6, 7)
    at = np.array([0, 1.3, 2.3, 3 + 0.3 / 3, 3 + 1.3 / 3, 3 + 2.3 / 3, 4])
    np.testing.assert_allclose(slow.tip[:, 0], 0.01 * at)
    np.testing.assert_allclose(slow.object[:, 0], 0.02 * at)
    np.testing.assert_allclose(slow.times, at / 25)


def test_a_motion_that_is_hurried_keeps_the_proportions_of_its_steps(monkeypatch):
    """Of 1,000 small steps and one for which the arm takes several."""
    steps, motion = [], a_motion(1001, 1e-5)
    motion.tip[500:] += 10 * SCENE.step
    monkeypatch.setattr(retarget, "stretched", lambda motion, slow: steps.append(slow))
    retarget.pace(motion, SCENE)
    (slow,) = steps
    assert slow[499] / slow[0] == pytest.approx(10 / retarget.HURRY, rel=0.01)
    assert np.ptp(np.delete(slow, 499)) < 1e-9
    assert slow.sum() == pytest.approx(retarget.LONGEST * retarget.FPS, abs=1)


@pytest.mark.parametrize("seed", range(5))
def test_the_map_takes_the_ways_ends_to_the_scenes_and_scales_both_axes_alike(seed):
    rng = np.random.default_rng(seed)
    start, end = rng.uniform(50, 100, 2), rng.uniform((200, 50), (400, 100))
    scene = replace(SCENE, goal=(0.8, 0.07))
    A = retarget.fit(start, end, scene, False)
    np.testing.assert_allclose(
        retarget.apply(A, np.stack([start, end])), [scene.start, scene.goal], atol=1e-9
    )
    assert A[0, 0] == pytest.approx(-A[1, 1]) and A[0, 1] == 0  # what is upright stays so
    B = retarget.fit((500, 0) + (-1, 1) * start, (500, 0) + (-1, 1) * end, scene, True)
    np.testing.assert_allclose(B, A @ [[-1, 0, 500], [0, 1, 0], [0, 0, 1]], atol=1e-9)


# Paths


def wandering(seed=0):
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.02, 0.07, 60))
    t = np.r_[t, 2 * t[-1] - t[-2::-1]]  # as uneven forwards as backwards
    places = [np.cumsum(rng.normal(0, 3, (len(t), 2)), axis=0) + 200 for _ in range(2)]
    sure = np.where(rng.random((2, len(t))) < 0.4, 0.2, 0.9)
    return Tracks(t, *places, *sure, 300)


def backwards(clip):
    names = ("tip", "object", "tip_sure", "object_sure")
    turned = {name: getattr(clip, name)[::-1] for name in names}
    return replace(clip, times=clip.times[-1] + clip.times[0] - clip.times[::-1], **turned)


@pytest.mark.parametrize("seed", range(4))
def test_marks_correct_a_clip_that_runs_backwards_alike(seed):
    clip = wandering(seed)
    whole = clip.times[0] + clip.times[-1]
    marks = [(30.0 * i, 90.0 - i, float(clip.times[k])) for i, k in enumerate((20, 41, 80))]
    one = clip.marked("tip", marks)
    other = backwards(clip).marked("tip", [(x, y, whole - s) for x, y, s in marks])
    np.testing.assert_allclose(other.tip[::-1], one.tip, atol=1e-6)
    np.testing.assert_allclose(other.tip_sure[::-1], one.tip_sure, atol=1e-6)
    for x, y, s in marks:
        assert one.tip[np.abs(one.times - s).argmin()] == pytest.approx((x, y))
    np.testing.assert_array_equal(one.object, clip.object)
    assert one.yours == (("tip", marks[0][2], marks[-1][2]),)
    moved = replace(clip, tip=clip.tip + (5, -3)).marked(
        "tip", [(x + 5, y - 3, s) for x, y, s in marks]
    )
    np.testing.assert_allclose(moved.tip, one.tip + (5, -3), atol=1e-6)


def test_a_path_is_smoothed_alike_forwards_and_backwards_and_each_axis_by_itself():
    clip = wandering()
    t, at = clip.times, np.arange(clip.times[0] - 0.1, clip.times[-1] + 0.1, 0.04)
    there = low_pass(t, clip.tip, at)
    turned = low_pass(-t[::-1], clip.tip[::-1], -at[::-1])
    np.testing.assert_allclose(turned[::-1], there, atol=0.02)
    np.testing.assert_allclose(low_pass(t, clip.tip[:, ::-1], at), there[:, ::-1])
    np.testing.assert_allclose(low_pass(t, 3 * clip.tip - 8, at), 3 * there - 8)
    assert np.abs(there[5:-5] - interpolate(t, clip.tip, at)[5:-5]).max() < 8


@pytest.mark.parametrize("way", [1, -1])
def test_a_way_has_its_ends_and_its_progress_in_any_direction(way):
    path = np.outer(np.r_[np.zeros(9), np.linspace(0, 1, 30), np.ones(12)], (90.0, 40.0))
    for turn in (1, -1), (-1, 1), (1, 1):
        start, end = paths.ends(way * path * turn, 5, "cup")
        np.testing.assert_allclose((start, end), [(0, 0), way * np.array((90, 40)) * turn], atol=3)
        gone = paths.progress(way * path * turn, start, end)
        assert gone[0] == 0 and gone[-1] == pytest.approx(1, abs=0.02)
        assert gone[23] == pytest.approx(14 / 29, abs=0.03)


# Pictures


FLIPS = {"left and right": np.s_[:, :, ::-1], "up and down": np.s_[:, ::-1]}


@pytest.mark.parametrize("flip", FLIPS.values(), ids=FLIPS)
def test_what_moves_and_jumps_is_the_same_in_a_mirror(flip):
    frames = arm(np.r_[np.linspace(0.1, 0.4, 12), np.linspace(0.75, 0.9, 10)])
    frames = np.stack([cv2.GaussianBlur(frame, (0, 0), 1) for frame in frames])
    times = np.arange(22) / 12.5
    assert motion.jumps(frames, times) == motion.jumps(frames[flip], times) == [12]
    assert motion.jumps(frames[::-1], times) == [10]
    one, background, moves = motion.before_background(frames)
    other, behind, too = motion.before_background(frames[flip])
    np.testing.assert_allclose(other, one[flip], atol=1.1)
    np.testing.assert_allclose(behind, background[None][flip][0], atol=1.1)
    assert moves and too


@pytest.mark.parametrize(("share", "found"), [(0.9, []), (1.2, [21])])
def test_what_more_than_half_of_the_frames_do_is_motion_and_no_noise(share, found, monkeypatch):
    residual = np.where(np.arange(30) < 12, 0, 1.0)
    residual[20] = share * motion.JUMP
    monkeypatch.setattr(motion, "_unexplained", lambda frames, size: (residual, residual))
    monkeypatch.setattr(motion, "_at_once", lambda frames, t: True)
    assert motion.jumps(np.zeros((31, 8, 8, 3), np.uint8), np.arange(31) / 25) == found


def shaken():
    """A wall that turns by up to 2 degrees, grows by 3 % and goes by (4, -2) pixels."""
    wall = cv2.GaussianBlur(room(120, 160, 1), (0, 0), 1.2)
    s, views = np.linspace(0, 1, 6), []
    for share in s:
        view = cv2.getRotationMatrix2D((80, 60), 2 * share, 1 + 0.03 * share)
        view[:, 2] += np.array([4, -2]) * share
        views.append(view)
    moved = [cv2.warpAffine(wall, view, (160, 120), borderMode=cv2.BORDER_REFLECT)
             for view in views]  # fmt: skip
    return np.stack(moved), np.stack(views)


def test_a_camera_that_turns_zooms_and_shifts_at_once_is_followed_and_so_in_a_mirror():
    frames, views = shaken()
    corners = np.array([(0, 0, 1), (160, 0, 1), (0, 120, 1), (160, 120, 1)], float)
    undone = [cv2.invertAffineTransform(view) @ corners.T for view in views]
    found = camera.sway(frames) @ corners.T
    np.testing.assert_allclose(found, undone, atol=0.6)
    mirror = camera.sway(frames[:, :, ::-1]) @ ((160, 0, 0) + (-1, 1, 1) * corners).T
    np.testing.assert_allclose((160 - mirror[:, 0], mirror[:, 1]), (found[:, 0], found[:, 1]),
                               atol=0.6)  # fmt: skip
    steady = camera.steadied(frames, camera.sway(frames)).astype(float)[:, 20:-20, 20:-20]
    assert (
        np.abs(steady - steady[0]).mean() < 0.25 * np.abs(frames - frames[0].astype(float)).mean()
    )
    way = camera.extent(camera.sway(frames), 120, 160)
    assert way == pytest.approx(np.ptp(undone, axis=0).max() / 160, abs=0.005)
    assert way == pytest.approx(camera.extent(camera.sway(frames[:, ::-1]), 120, 160), abs=0.005)


def test_a_larger_picture_moves_by_more_pixels_and_is_asked_by_as_many_cells():
    frames, _ = shaken()
    large = np.stack([cv2.resize(frame, (480, 360)) for frame in frames])
    one, other = camera.sway(frames), camera.sway(large)
    corners = np.array([(0, 0, 1), (160, 0, 1), (0, 120, 1), (160, 120, 1)], float).T
    np.testing.assert_allclose(other @ ((3, 3, 1) * corners.T).T / 3, one @ corners, atol=0.4)
    for shape in ((120, 160), (160, 120), (90, 240)):
        wall = cv2.resize(frames[0], shape[::-1])
        picture = camera._Picture(wall, camera.FINE)
        votes = picture.votes(camera._plain(wall, picture.size), np.eye(3), np.eye(3))
        larger, smaller = max(shape), min(shape)
        cells = camera.CELLS, round(camera.CELLS * smaller / larger)
        assert votes.shape == (cells if shape[0] == larger else cells[::-1]) and not votes.any()


def test_an_arm_comes_in_from_the_other_side_in_a_mirror():
    frames, sleeve = np.repeat(room(120, 160)[None], 40, axis=0), room(25, 160, 3)
    for frame, reach in zip(frames, np.linspace(8, 96, 40).astype(int), strict=True):
        frame[55:80, :reach] = sleeve[:, -reach:] // 2 + 90
    mirrored = np.ascontiguousarray(frames[:, :, ::-1])
    one, other = footage.check(frames), footage.check(mirrored)
    assert (one.unmoved, one.warnings) == (other.unmoved, other.warnings)
    model = Detector.load(prepare.EYES)
    arms, theirs = (
        prepare.coming_in(Sight(model, f), seen.off)
        for f, seen in ((frames, one), (mirrored, other))
    )
    assert arms.enters < 0.1 and theirs.enters == pytest.approx(1 - arms.enters, abs=0.02)
    assert arms.seen == theirs.seen and arms.moves == theirs.moves
