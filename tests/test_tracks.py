"""Object tracks: where a point goes, what is lost, whose the points are, and where the arm is."""

import cv2
import numpy as np
import pytest
from toy_square import HERE, SIDE, scene, texture, ways

import tasks
from lbw_minimal import tracks, video
from lbw_minimal.training import InputError
from tasks.world import film, load_recordings


def test_a_square_moved_by_known_fractions_of_a_pixel_is_tracked_to_a_tenth():
    frames, d = ways()
    shown = tracks.watch(frames)
    assert len(shown.points) >= 4
    assert np.abs(shown.path - d).max() < 0.1


def test_corners_are_found_in_any_colour():
    """Red on a green as bright has no corner in grey."""
    frame = np.full((84, 84, 3), (0, 76, 0), np.uint8)
    frame[40:50, 30:40] = (149, 0, 0)
    assert cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY).std() < 1
    found = tracks.corners(frame)
    for corner in ((30, 40), (39, 40), (30, 49), (39, 49)):
        assert np.abs(found - corner).max(axis=1).min() <= 1


def test_a_point_that_is_covered_is_dropped_and_the_others_are_kept():
    frame, following = (scene(HERE + x, texture()) for x in ((0, 0), (1, 0)))
    following[46:54, 37:45] = 40  # a hand covers a corner
    points = np.float32([[31, 41], [31, 48], [38, 41], [39, 49]])
    to, kept = tracks.flow(frame, following, points)
    assert kept.tolist() == [True, True, True, False]
    np.testing.assert_allclose(to[kept] - points[kept], [(1, 0)] * 3, atol=0.15)


def test_a_point_is_found_from_a_guess_that_is_farther_than_flow_looks():
    frame, following = (scene(HERE + x, texture()) for x in ((0, 0), (24, 0)))
    points = np.float32([[34, 44], [36, 46]])
    to, kept = tracks.flow(frame, following, points, points + (24, 0))
    assert kept.all()
    np.testing.assert_allclose(to - points, [(24, 0)] * 2, atol=0.1)
    assert not tracks.flow(frame, following, points)[1].all()


def test_no_points_are_nowhere():
    frame = scene(HERE, texture())
    to, kept = tracks.flow(frame, frame, np.zeros((0, 2), np.float32))
    assert to.shape == (0, 2) and kept.shape == (0,)


def paths_of(*ends, rest=5, T=20):
    """Paths (T, n, 2) of points that rest and then go straight to these displacements."""
    share = np.clip((np.arange(T) - rest) / (T - 1 - rest), 0, 1)[:, None, None]
    start = np.arange(2.0 * len(ends)).reshape(-1, 2)
    return start + share * np.array(ends, float)


def test_the_object_is_what_rests_first_moves_later_and_was_kept():
    paths = paths_of((9, 0), (9, 0.2), (0, 0), (9, 0), (9, 0), *[(40, 0)] * 3)
    paths[1:, 3] = paths[-1, 3]  # moves from the start, as a hand does
    paths[-1, 5:] = paths[0, 5:]  # goes farthest and comes back, as a lamp does
    kept = np.array([True, True, True, True, False, True, True, True])
    assert tracks.object_points(paths, kept).tolist() == [True, True, *[False] * 6]


def test_of_two_groups_the_one_that_has_come_farther_is_the_object():
    """Three corners of tiles that an arm drags along for 4 pixels, and two of a mug: 12 to 40."""
    paths = paths_of((4, 0), (4, 0.1), (4, 0.2), (20, 0), (20, 0.1))
    found = tracks.object_points(paths, np.ones(5, bool))
    assert found.tolist() == [False, False, False, True, True]


def test_one_point_alone_is_no_object():
    wall = texture()
    frames = np.stack([scene(HERE, wall)] * 12)
    with pytest.raises(InputError, match="no object"):
        tracks.watch(frames)


def test_the_objects_pixels_are_found():
    shown = tracks.watch(ways(pace=(2.0, 0.0))[0])
    x, y = shown.corner
    assert abs(x - 30) <= 1 and abs(y - 40) <= 1
    assert shown.mask.sum() > 0.8 * SIDE * SIDE


@pytest.mark.parametrize(("hand", "place"), [(20.0, 25.5), (2.0, 28.0)])
def test_an_arm_is_to_stand_half_an_object_behind_it_and_no_more_than_a_hand(
    hand, place, monkeypatch
):
    """The square's left side is at 30 and its middle at 34.5; it goes to the right."""
    monkeypatch.setattr(tracks, "HAND", hand)
    shown = tracks.watch(ways(pace=(2.0, 0.0))[0])
    np.testing.assert_allclose(shown.corner + shown.behind, (place, 44.5), atol=0.8)


def test_an_object_of_the_backgrounds_colour_is_as_large_as_flow_looks_about_its_points():
    """Nothing seems to have left, as where a hand covers it at the end."""
    frame = np.full((84, 84, 3), 90, np.uint8)
    mask = tracks.silhouette(frame, frame, np.array([20.0, 0]), np.array([[30.0, 40], [31.6, 40]]))
    y, x = np.nonzero(mask)
    assert (x.min(), x.max(), y.min(), y.max()) == (28, 34, 38, 42)
    # and so where what left has none of the points
    left = frame.copy()
    left[10:16, 50:56], frame[10:16, 30:36] = 200, 200
    elsewhere = tracks.silhouette(frame, left, np.array([20.0, 0]), np.array([[30.0, 60]]))
    assert elsewhere.sum() == 25 and elsewhere[60, 30]


@pytest.mark.parametrize(
    ("beside", "counts"),
    [
        ((-2, 0), True),
        ((9, 0), True),
        ((0, -2), True),
        ((0, 8), True),
        ((-3, 0), False),
        ((0, 9), False),
    ],
)
def test_a_point_is_the_objects_that_is_two_pixels_beside_it(beside, counts):
    """The object has left 8 x 7 pixels; else a square about the point stands in for it."""
    first = np.full((84, 84, 3), 100, np.uint8)
    last = first.copy()
    first[40:47, 30:38] = last[40:47, 50:58] = 200
    point = np.array([[30.0, 40]]) + beside
    found = tracks.silhouette(first, last, np.array([20.0, 0]), point)
    assert (found.sum() == 56) == counts


@pytest.mark.parametrize("d", [(20, 0), (0, 15), (20, -12), (-9, 9)])
def test_the_objects_pixels_are_found_whichever_way_it_goes(d):
    first = np.full((84, 84, 3), 100, np.uint8)
    last = first.copy()
    first[40:47, 30:39] = last[40 + d[1] : 47 + d[1], 30 + d[0] : 39 + d[0]] = 200
    found = tracks.silhouette(first, last, np.array(d, float), np.array([[34.0, 43]]))
    assert (found == (first[..., 0] == 200)).all()


def test_a_background_is_seen_through_what_stands_before_it_for_most_of_a_film():
    """For 65 of 100 frames an arm covers the wall, with many colours; the median shows the arm."""
    rng = np.random.default_rng(0)
    film_ = np.full((100, 84, 84, 3), 150, np.uint8)
    film_[:65, 20:40] = rng.integers(180, 255, (65, 1, 1, 1))
    assert np.median(film_, axis=0)[30, 30, 0] > 180
    assert (tracks.background(film_) == 150).all()


def arm_scene(tip):
    """An arm 6 pixels wide that comes in from above and ends at row `tip`, and a speck."""
    frame = np.full((84, 84, 3), 150, np.uint8)
    frame[:tip, 20:26] = 230
    frame[60:63, 30:33] = 230
    return frame


def test_the_nearest_of_the_arm_is_found_and_what_does_not_come_from_outside_is_none():
    wall, thing = np.full((84, 84, 3), 150, np.uint8), np.zeros((84, 84), np.uint8)
    near = tracks.arm_near(arm_scene(40), wall, thing, np.array([22.5, 62.0]))
    # rows 39, 38, ... count by e^(-1/3) less each: on average 2.5 above the lowest
    np.testing.assert_allclose(near, (22.5, 36.5), atol=0.3)
    assert tracks.arm_near(wall, wall, thing, np.array([22.5, 62.0])) is None
    thing[30:45, 15:30] = 1  # what belongs to the object is no arm
    _, y = tracks.arm_near(arm_scene(40), wall, thing, np.array([22.5, 62.0]))
    assert y < 30


def tracker(frames):
    return tracks.Tracker(tracks.watch(frames), texture().astype(np.uint8))


def test_the_object_is_found_at_another_place_and_before_another_wall():
    frames, _ = ways()
    seen = tracker(frames)
    wall = np.full((84, 84, 3), (120.0, 130.0, 150.0))
    seen.reset(scene(HERE + (7, -3), wall))
    assert seen.ahead.tolist() == [7, -3]
    seen.step(scene(HERE + (8.5, -3.5), wall))
    np.testing.assert_allclose(seen.d, (1.5, -0.5), atol=0.15)


def test_the_way_to_the_arm_is_told_from_behind_the_object_wherever_that_is(monkeypatch):
    """The arm stands still while the object goes on by (1.5, -0.5): the way grows by as much."""
    monkeypatch.setattr(tracks, "arm_near", lambda frame, wall, thing, place: np.array([9.0, 8]))
    frames, d = ways(pace=(1.5, -0.5))
    seen = tracker(frames)
    seen.reset(frames[0])
    np.testing.assert_allclose(seen.g, (9, 8) - seen.behind)
    for frame in frames[1:]:
        seen.step(frame)
    np.testing.assert_allclose(seen.behind + seen.g + d[-1], (9, 8), atol=0.3)


def test_a_lost_point_waits_where_the_others_are_and_is_found_again():
    frames, d = ways(steps=26, pace=(1.5, 0.0))
    seen = tracker(frames)
    seen.reset(frames[0])
    fewest = len(seen.p)
    for t, frame in enumerate(frames[1:], 1):
        frame = frame.copy()
        if 10 <= t < 16:  # a gripper before its left half
            left = int(HERE[0] + d[t, 0])
            frame[30:, left - 2 : left + 4] = 40
        seen.step(frame)
        np.testing.assert_allclose(seen.d, d[t], atol=0.5)
        fewest = min(fewest, seen.kept.sum())
    assert fewest < len(seen.p) and seen.kept.sum() > fewest


def test_a_dragged_point_has_no_say_and_waits_with_the_lost_ones(monkeypatch):
    """Five points: three go by (4, 0), one is dragged by (9, 9), one is lost. Next time each is
    looked for where it would be after as much again."""
    seen = tracker(ways()[0])
    seen.reset(ways()[0][0])
    seen.p_0 = seen.p = np.array([[10.0 * k, 20.0] for k in range(5)])
    moves, asked = np.array([[4.0, 0], [4, 0], [4, 0], [9, 9], [70, 0]]), []

    def flow(frame, following, points, guess):
        asked.append((points, guess))
        return points + moves, np.array([True] * 4 + [False])

    monkeypatch.setattr(tracks, "flow", flow)
    seen.step(ways()[0][1])
    assert seen.d.tolist() == [4, 0] and seen.kept.tolist() == [True] * 3 + [False] * 2
    np.testing.assert_array_equal(seen.p, seen.p_0 + (4, 0))
    seen.step(ways()[0][1])
    np.testing.assert_array_equal(asked[1][1], seen.p_0 + (8, 0))


def test_an_object_that_is_wholly_hidden_rests_where_it_was_seen_last():
    frames, _ = ways(pace=(1.0, 0.0))
    seen = tracker(frames)
    seen.reset(frames[0])
    for frame in frames[1:15]:
        seen.step(frame)
    before = seen.d
    seen.step(np.full_like(frames[0], 90))
    np.testing.assert_array_equal(seen.d, before)


@pytest.mark.parametrize("task", [t for t in tasks.TASKS if t != "reach"])
def test_the_object_of_the_human_video_is_tracked_to_a_third_of_a_pixel(task):
    """The simulator's truth, for this check alone: 0.03 to 0.28 in the mean."""
    frames, _ = video.read(tasks.VIDEOS / task / "expert_01.mp4")
    take = load_recordings(tasks.VIDEOS / task / "experts.npz")[0]
    env = tasks.bare(task, embodiment="human")
    _, truth, _ = film(env, take.seed, take.actions)
    env.close()
    off = np.abs(tracks.watch(frames).path - (truth[:, 2:] - truth[0, 2:]))
    assert off.mean(axis=0).max() < 0.33 and off.max() < 1


def test_reachs_video_moves_no_object():
    frames, _ = video.read(tasks.VIDEOS / "reach" / "expert_01.mp4")
    with pytest.raises(InputError, match="no object"):
        tracks.watch(frames)


def test_the_drawn_points_are_the_objects():
    frames, _ = ways()
    shown, drawn = tracks.watch(frames), tracks.draw(frames)
    for t in (0, -1):
        yellow = np.argwhere((drawn[t] == (255, 220, 0)).all(axis=-1))[:, ::-1]
        expected = np.unique((shown.points + shown.path[t]).round().astype(int), axis=0)
        assert len(yellow) == len(expected)
        assert {*map(tuple, yellow.tolist())} == {*map(tuple, expected.tolist())}


def pushed(wall, at=(0, 0), n=12, arm=True):
    """A square that rests and is then pushed right and down by an arm from the left, two tones."""
    frames = []
    for i in range(n):
        d = max(0, i - 4) * np.array([1.3, 0.4])
        frame = scene(HERE + d + at, wall)
        if arm:
            x, y = (HERE + at + (-16 + 2 * min(i, 8), 3)).round().astype(int)
            frame[y : y + 5, : max(1, x)] = (205, 180, 90)
            frame[y : y + 3, max(1, x) : x + 3] = (150, 140, 110)
        frames.append(frame)
    return np.stack(frames)


def elsewhere():
    """The push again, before another wall and behind a bar for a frame, and that wall."""
    other = texture(5) * 0.8 + 25
    film_ = pushed(other, at=(9, -4), n=14)
    film_[7, 30:48, 41:46] = 20
    return film_, tracks.background(np.concatenate([film_, pushed(other, at=(9, -30), n=9)]))


def test_an_object_that_is_pushed_is_seen_as_it_was(golden):
    demo = pushed(texture())
    shown = tracks.watch(demo)
    golden(
        {
            "path": shown.path[::2],
            "points": shown.points,
            "patch": [*shown.corner, *shown.patch.shape, shown.mask.sum(), shown.patch.mean()],
            "behind": shown.behind,
            "wall": elsewhere()[1].reshape(3, 28, 3, 28, 3).mean((1, 3)).round(2),
            "drawn": tracks.draw(demo).astype(float).mean((1, 2))[:, 0],
        },
        atol=0.02,  # pixels: flow ends where it moves by less than 0.01
    )


def test_an_object_that_is_pushed_elsewhere_is_followed_as_it_was(golden):
    """What is kept of its points, and with them the median, hangs on a pixel's hundredth."""
    (first, *film_), wall = elsewhere()
    seen = tracks.Tracker(tracks.watch(pushed(texture())), wall)
    seen.reset(first)
    rows = [[*seen.d, *seen.g, *seen.v]]
    for frame in film_:
        seen.step(frame)
        rows.append([*seen.d, *seen.g, *seen.v])
    golden({"ahead": seen.ahead, "followed": np.round(rows, 2)}, rtol=0, atol=0.1)


def test_corners_groups_and_backgrounds_are_what_they_were(golden):
    rng = np.random.default_rng(0)
    picture = scene(HERE, texture())
    where = np.zeros((84, 84))
    where[20:60, 10:70] = 1
    found = tracks.corners(picture, where)
    d = rng.normal(size=(6, 9, 2)) * 0.4 + np.array([0.0, 0, 0, 2, 2, 2, 2, 5, 5])[:, None]
    film_ = rng.integers(90, 110, (11, 84, 84, 3)).astype(np.uint8)
    film_[:6, 10:40] = rng.integers(0, 255, (6, 1, 1, 3))
    golden(
        {
            "corners": [len(found), *found[0], *found[-1], *found.mean(0)],
            "in all": len(tracks.corners(picture)),
            "kind": str(found.dtype),
            "alike": tracks.together(d),
            "by weight": tracks.together(d, np.r_[np.full(7, 1.0), 9, 9]),
            "none": tracks.together(d[:, :0]),
            "wall": [tracks.background(film_)[y, 5].mean() for y in (20, 60)],
            "wall's mean": tracks.background(film_).mean((0, 1)),
        }
    )


def test_who_moves_no_object_is_told_so():
    still = np.repeat(scene(HERE, texture())[None], 6, axis=0)
    with pytest.raises(InputError) as told:
        tracks.watch(still)
    assert str(told.value) == (
        "no object rests first and moves later in the demonstration; tracks follow one."
    )
