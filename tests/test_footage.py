"""Footage that cannot be searched for an arm: nothing moves, or the camera, or two people do."""

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
    assert seen.warnings == [] and seen.frames is film and seen.doubt is None


@pytest.mark.parametrize("name", TASKS)
def test_our_own_human_videos_are_fine(name):
    frames, _ = video.read(VIDEOS / name / "expert_01.mp4")
    assert footage.check(frames).warnings == []


def still(room):
    noise = np.random.default_rng(1).normal(0, 3, (20, *SIZE, 3))
    return np.clip(room[: SIZE[0], : SIZE[1]] + noise, 0, 255).astype(np.uint8), "nothing moves"


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


def no_arm(room):
    film = np.repeat(room[None, : SIZE[0], : SIZE[1]], 30, axis=0).copy()
    for i, frame in enumerate(film):
        frame[60:80, 50 + i : 75 + i] = (200, 40, 30)  # a toy that drives alone
    return film, "no arm is seen"


def lamp(room):
    film = np.repeat(room[None, : SIZE[0], : SIZE[1]], 30, axis=0).copy()
    for i, frame in enumerate(film):
        x = round(70 + 8 * np.sin(i / 3))
        frame[:10, x : x + 10] = (250, 240, 90)  # hangs in from the upper edge, and swings
    return film, "no arm is seen"


def two_people(room):
    return arms(room, "left", "right"), "several people"


@pytest.mark.parametrize("fault", [still, panned, hand_held, few_frames], ids=lambda f: f.__name__)
def test_other_footage_is_refused_with_the_reason(room, fault):
    frames, reason = fault(room)
    with pytest.raises(Unusable, match=reason):
        footage.check(frames)


@pytest.mark.parametrize("fault", [no_arm, lamp, two_people], ids=lambda f: f.__name__)
def test_whether_one_arm_moves_is_doubted_with_the_reason_and_a_remedy(room, fault):
    """A user who sees one arm there can say so: that is no fact, as a moving camera is."""
    frames, reason = fault(room)
    why, remedy = footage.check(frames).doubt
    assert reason in why and remedy.startswith("film ")


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
    assert footage.check(np.concatenate([title, film]), cuts=(12,)).warnings == []


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
    np.testing.assert_allclose(footage._doors(moving(*boxes)[None])[0], np.array(doors) / 83)


@pytest.mark.parametrize(("side", "where"), [("left", 0), ("right", 1)])
def test_the_edge_over_which_the_arm_comes_in_is_told(room, side, where):
    film = arms(room, side)
    assert footage.check(film).enters == where
    other = arms(room, "left" if side == "right" else "right")[:12]
    assert footage.check(np.concatenate([other, film]), cuts=(12,)).enters == where
    trembles = np.stack([np.roll(f, 2 * (i % 2), 1) for i, f in enumerate(film)])
    assert footage.check(trembles).enters == where


@pytest.mark.parametrize("way", [0, 40])
def test_what_an_arm_left_elsewhere_is_told_when_it_has_gone(room, way):
    """It comes and goes almost; a cube of 16 pixels stands where it stood, or 40 pixels on."""
    film = np.concatenate([arms(room, "left")[5:], arms(room, "left")[:12:-1]])
    for i, frame in enumerate(film):
        x = 60 + way * (i > 25)
        frame[70:86, x : x + 16] = (200, 40, 30)
    assert footage.check(film).unmoved == (way == 0)


def test_a_lamp_that_swings_at_the_edge_is_no_arm(room):
    film, reason = no_arm(room)
    for i, frame in enumerate(film):
        cv2.circle(frame, (130 + int(6 * np.sin(i)), 4), 8, (250, 240, 150), -1)
    assert reason in footage.check(film).doubt[0]


@pytest.mark.parametrize(("often", "two"), [(2, False), (3, True)])
@pytest.mark.parametrize("seen", ["_doors", "_beside"])
def test_arms_at_two_places_in_a_twentieth_of_the_frames_are_two_people(
    room, seen, often, two, monkeypatch
):
    """From both sides, or beside each other, in so many of sixty frames."""
    both = np.arange(60) < often
    doors = np.stack([0 * both, np.where(both, 1.0, 0.95)], 1)
    monkeypatch.setattr(footage, seen, lambda moves: doors if seen == "_doors" else both)
    doubt = footage.check(arms(room, "left", frames=60)).doubt
    assert ("several people" in doubt[0]) if two else doubt is None


@pytest.mark.parametrize(
    ("boxes", "two"),
    [
        ([(10, 0, 12, 12), (39, 0, 12, 12)], True),  # from above, 17 pixels apart
        ([(10, 0, 12, 12), (38, 0, 12, 12)], False),  # 16: less than a fifth of the width
        ([(0, 20, 12, 12), (40, 0, 12, 12)], True),  # from the left and from above
        ([(10, 0, 12, 12), (39, 0, 10, 10)], False),  # less than 0.015 of the picture
        ([(10, 0, 12, 12), (39, 10, 12, 12)], False),  # over no edge
        ([(10, 0, 12, 12)], False),
    ],
)
def test_two_arms_beside_each_other_are_a_fifth_of_the_width_apart(boxes, two):
    assert footage._beside(moving(*boxes)[None]).tolist() == [two]


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
    film = np.repeat(room[None], 30, 0).copy()
    for i, frame in enumerate(film):
        frame[70:78, 40 + i : 48 + i] = (200, 40, 30)
    with pytest.raises(Unusable, match="no arm is seen, only something small moves; film from"):
        footage.check(film)


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


def test_doors_are_those_of_the_steadied_frames(room, monkeypatch):
    """The steadied ones show another arm, over the other edge."""
    monkeypatch.setattr(footage.camera, "extent", lambda *_: 0.05)
    monkeypatch.setattr(footage.camera, "steadied", lambda *_: arms(room, "right"))
    assert footage.check(arms(room, "left")).enters == 1


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
    assert footage._comes_in(moves) == arm


def test_an_arm_comes_in_beside_something_larger_that_does_not():
    arm, toy, lamp = (0, 0, 17, 17), (40, 40, 20, 20), (0, 0, 16, 16)
    assert footage._comes_in(np.stack([moving(arm, toy)] * 2))
    assert not footage._comes_in(np.stack([moving(lamp, toy)] * 2))
    assert not footage._comes_in(np.stack([moving()] * 2))


def test_faint_motion_is_enough_for_an_arm_and_not_for_a_door(room, monkeypatch):
    """Eleven grey levels at the shoulder: more than noise, and less than what moves for sure."""
    asked = {}
    still = np.zeros((20, 84, 84), np.float32)
    still[:, 0, 0], still[:, 0, 1], still[:, 0, 2] = 9.5, 10.5, 16.5
    background = np.zeros((84, 84), np.float32)
    monkeypatch.setattr(footage, "before_background", lambda frames: (still, background, True))
    monkeypatch.setattr(footage, "_comes_in", lambda m: asked.update(arm=m[0, 0, :3]) or True)
    nowhere = np.full((20, 2), np.nan)
    monkeypatch.setattr(footage, "_doors", lambda m: asked.update(door=m[0, 0, :3]) or nowhere)
    found = footage.check(arms(room, "left"))
    assert asked["arm"].tolist() == [False, True, True]
    assert asked["door"].tolist() == [False, False, True]
    assert np.isnan(found.enters)


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
