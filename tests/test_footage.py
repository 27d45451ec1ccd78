"""Footage that cannot be searched for an arm: nothing moves, or the camera does."""

import cv2
import numpy as np
import pytest

from lbw_minimal import video
from lbw_minimal.clips import footage
from lbw_minimal.clips.paths import Unusable
from tasks import TASKS, VIDEOS

SIZE = 120, 160  # pixels, height and width


@pytest.fixture(scope="module")
def room():
    """A room with clutter, wider than the camera sees of it."""
    rng = np.random.default_rng(0)
    rough = rng.integers(60, 200, (24, 50, 3), np.uint8)
    return cv2.resize(rough, (300, 160), interpolation=cv2.INTER_CUBIC)


def arms(room, *sides, frames=30):
    """Arms that come in from those sides, before a camera that stands still."""
    film = np.repeat(room[None, : SIZE[0], : SIZE[1]], frames, axis=0).copy()
    skin = room[::-1, : SIZE[1]] // 2 + 90
    for i, frame in enumerate(film):
        reach = max(1, 3 * i - 20)
        for side in sides:
            span = slice(0, reach) if side == "left" else slice(SIZE[1] - reach, SIZE[1])
            moved = skin[:22, -reach:] if side == "left" else skin[:22, :reach]  # with the arm
            frame[40:62, span] = moved
    return film


@pytest.mark.parametrize("side", ["left", "right"])
def test_one_arm_before_a_camera_that_stands_still_is_fine(room, side):
    film = arms(room, side)
    seen = footage.check(film)
    assert seen.warnings == [] and seen.frames is film and seen.still is None
    assert seen.shot == slice(0, 30)


@pytest.mark.parametrize("name", TASKS)
def test_our_own_human_videos_are_fine(name):
    frames, _ = video.read(VIDEOS / name / "expert_01.mp4")
    assert footage.check(frames).warnings == []


def panned(room):
    x = np.linspace(0, 60, 30).astype(int)
    return np.stack([room[: SIZE[0], i : i + SIZE[1]] for i in x]), "the camera moves"


def hand_held(room):
    sway = 10 * np.sin(np.arange(30) / 4) + 10  # an eighth of the width
    film = arms(cv2.resize(room, None, fx=1.2, fy=1.2), "left")
    views = [np.float32([[1, 0, -s], [0, 1, -s]]) for s in sway]
    return np.stack(
        [cv2.warpAffine(f, v, SIZE[::-1], borderMode=cv2.BORDER_REFLECT)
         for f, v in zip(film, views, strict=True)]
    ), "the camera moves"  # fmt: skip


def few_frames(room):
    return arms(room, "left")[10:15], "5 frames in one go are too few"


def one_frame(room):
    return arms(room, "left")[10:11], "1 frame in one go is too few"


@pytest.mark.parametrize(
    "fault", [panned, hand_held, few_frames, one_frame], ids=lambda f: f.__name__
)
def test_other_footage_is_refused_with_the_reason(room, fault):
    frames, reason = fault(room)
    with pytest.raises(Unusable, match=reason):
        footage.check(frames)


def test_a_camera_that_trembles_is_steadied_with_a_warning(room):
    film = arms(room, "left")
    film = np.stack([np.roll(f, s, 1) for f, s in zip(film, [0, 3, 5, 3, 0, 5] * 5, strict=True)])
    frames, warnings, *_ = footage.check(film)
    assert len(warnings) == 1 and "steadied" in warnings[0]
    right = np.s_[:, :, 100:150]  # where no arm comes
    assert frames[right].std(0).mean() < 0.5 * film[right].std(0).mean()


def test_a_cut_to_another_place_is_no_moving_camera(room):
    film = arms(room, "left")
    title = np.repeat(room[None, 30 : 30 + SIZE[0], 90 : 90 + SIZE[1]], 12, axis=0)
    seen = footage.check(np.concatenate([title, film]), cuts=(12,))
    assert seen.warnings == [] and seen.shot == slice(12, 42)


@pytest.mark.parametrize("way", [0, 40])
def test_what_an_arm_left_elsewhere_is_told_when_it_has_gone(room, way):
    """It comes and goes almost; a cube of 16 pixels stands where it stood, or 40 pixels on."""
    film = np.concatenate([arms(room, "left")[5:], arms(room, "left")[:12:-1]])
    for i, frame in enumerate(film):
        x = 60 + way * (i > 25)
        frame[70:86, x : x + 16] = (200, 40, 30)
    assert footage.check(film).unmoved == (way == 0)


@pytest.mark.parametrize(
    ("size", "frames", "small"), [(4, 20, True), (3, 20, False), (4, 1, False)]
)
def test_a_small_thing_that_moves_by_itself_is_no_arm_and_noise_is_nothing(size, frames, small):
    """Of sixteen pixels in one piece, and of nine."""
    moves = np.zeros((60, 84, 84), bool)
    moves[:frames, 40 : 40 + size, 40 : 40 + size] = True
    moves[:, ::5, ::5] = True  # noise
    assert footage._speck(moves) == small


def test_a_thing_that_moves_without_an_arm_is_told_from_a_room_in_which_nothing_does(room):
    """Either is said only where no arm is seen: one may be hard to tell from the room."""
    film = np.repeat(room[None], 30, 0).copy()
    noise = np.random.default_rng(1).normal(0, 3, film.shape)
    seen = footage.check(np.clip(film + noise, 0, 255).astype(np.uint8))
    why, remedy = seen.still
    assert why.startswith("nothing moves in the clip") and remedy.startswith(
        "record from before the hand"
    )
    for i, frame in enumerate(film):
        frame[70:78, 40 + i : 48 + i] = (200, 40, 30)
    why, remedy = footage.check(film).still
    assert why == "no arm is seen, only something small moves" and remedy.startswith("film from")


@pytest.mark.parametrize(
    ("way", "verdict"),
    [(0.0049, "stands"), (0.0051, "trembles"), (0.109, "trembles"), (0.111, "moves")],
)
def test_a_camera_trembles_from_a_two_hundredth_of_the_picture_on_and_moves_from_a_ninth_on(
    room, way, verdict, monkeypatch
):
    monkeypatch.setattr(footage.camera, "extent", lambda *_: way)
    film = arms(room, "left")
    if verdict == "moves":
        with pytest.raises(Unusable, match="the camera moves"):
            footage.check(film)
    else:
        assert ("steadied" in "".join(footage.check(film).warnings)) == (verdict == "trembles")


@pytest.mark.parametrize(("way", "moves"), [(0.109, False), (0.111, True)])
def test_an_upright_pictures_camera_moves_by_a_ninth_of_its_width(room, way, moves, monkeypatch):
    """Which is less of its longer side, as a camera has it."""
    upright = np.rot90(arms(room, "left"), axes=(1, 2))
    height, width = upright.shape[1:3]
    monkeypatch.setattr(footage.camera, "extent", lambda *_: way * width / height)
    if moves:
        with pytest.raises(Unusable, match="the camera moves"):
            footage.check(upright)
    else:
        assert "steadied" in footage.check(upright).warnings[0]


@pytest.mark.parametrize("longest", ["first", "last"])
def test_it_is_the_longest_shots_camera_that_counts_and_all_shots_are_steadied(
    room, longest, monkeypatch
):
    """What was steadied is searched for arms again: a camera that swings makes none."""
    film, title = arms(room, "left"), np.repeat(room[None, : SIZE[0], : SIZE[1]], 12, axis=0)
    shots = [film, title] if longest == "first" else [title, film]
    asked, steadied = [], []

    def sway(frames):
        return np.full((len(frames), 2, 3), float(len(frames)))

    monkeypatch.setattr(footage.camera, "sway", sway)
    monkeypatch.setattr(
        footage.camera, "extent", lambda sways, *size: asked.append((len(sways), *size)) or 0.05
    )
    monkeypatch.setattr(
        footage.camera, "steadied", lambda f, s: steadied.append((len(f), s[0, 0, 0])) or 255 - f
    )
    found = footage.check(np.concatenate(shots), cuts=(len(shots[0]),))
    assert asked == [(30, *SIZE)]
    assert steadied == [(len(shot), len(shot)) for shot in shots]
    np.testing.assert_array_equal(found.frames, 255 - np.concatenate(shots))


def test_the_ends_of_a_clip_are_a_sixteenth_each_and_what_stirs_a_little_stays():
    """Of 64 frames four: a thing that stands in the first three of them is not seen there."""
    for shown, stays in ((slice(0, 1), True), (slice(0, 3), False), (slice(4, 60), True)):
        still = np.zeros((64, 84, 84))
        still[shown, 30:40, 30:40] = 50
        assert footage._unmoved(still) == stays
    still = np.zeros((64, 84, 84))
    still[:4, 30:35, 30:37] = 50  # 35 pixels, half a hundredth of the picture, are noise
    assert footage._unmoved(still)
    still[:4, 35, 30] = 50
    assert not footage._unmoved(still)
    still = np.zeros((64, 84, 84))
    still[:4, 30:40, :40] = 50  # an arm
    assert footage._unmoved(still)
