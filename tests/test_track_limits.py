"""On either side of each of the tracks' limits: grey levels, pixels, shares, by hand."""

import numpy as np
import pytest
from toy_square import HERE, scene, texture, ways

from lbw_minimal import tracks
from lbw_minimal.training import InputError

WALL = np.full((84, 84, 3), 100, np.uint8)
NOTHING = np.zeros((84, 84), np.uint8)


@pytest.mark.parametrize(("levels", "arm"), [(8, False), (9, True)])
def test_an_arm_stands_out_by_more_than_eight_grey_levels_in_some_colour(levels, arm):
    frame = WALL.copy()
    frame[0:30, 40:44, 2] += levels
    assert (tracks.arm_near(frame, WALL, NOTHING, np.array([42.0, 60])) is not None) == arm


def test_the_arms_pixels_count_by_their_nearness_and_by_how_clearly_they_stand_out():
    """Two columns at the picture's edge, one pixel apart in their distance, of 3."""
    frame = WALL.copy()
    frame[0, 40], frame[0, 41] = 180, 140  # 40 levels are as clear as can be
    place = np.array([38.0, 0])  # 2 and 3 pixels off
    share = np.exp(-1 / 3)
    x, y = tracks.arm_near(frame, WALL, NOTHING, place)
    assert (x, y) == pytest.approx(((40 + 41 * share) / (1 + share), 0))
    frame[0, 40] = 120  # half as clear
    x, _ = tracks.arm_near(frame, WALL, NOTHING, place)
    assert x == pytest.approx((40 * 0.5 + 41 * share) / (0.5 + share))


@pytest.mark.parametrize("levels", [30, 31])
def test_an_object_has_left_where_more_than_thirty_grey_levels_changed(levels):
    """A square goes 20 pixels to the right; its points are where it began."""
    first, last = WALL.copy(), WALL.copy()
    first[40:50, 30:40] += np.uint8(levels)
    last[40:50, 50:60] += np.uint8(levels)
    points = np.array([[31.0, 41], [38, 48]])
    mask = tracks.silhouette(first, last, np.array([20.0, 0]), points)
    assert mask.sum() == (100 if levels > 30 else 50)  # else five pixels about each of its points


def test_what_comes_back_looks_as_it_did_to_within_thirty_grey_levels():
    first, last = WALL.copy(), WALL.copy()
    first[40:50, 30:40] += np.uint8(90)
    last[40:50, 50:60] += np.uint8(90)
    last[40:50, 50:55] -= np.uint8(29)
    last[40:50, 57:60] -= np.uint8(30)
    mask = tracks.silhouette(first, last, np.array([20.0, 0]), np.array([[32.0, 45]]))
    assert mask[40:50, 30:37].all() and mask.sum() == 70


@pytest.mark.parametrize(("contrast", "is_one"), [(9, False), (20, True)])
def test_a_corner_is_a_hundredth_as_strong_as_the_best(contrast, is_one):
    """Strength goes with the square of the contrast: a tenth of 130 levels is 13."""
    frame = np.full((84, 84, 3), 60, np.uint8)
    frame[20:40, 20:40], frame[50:70, 50:70] = 190, 60 + contrast
    found = tracks.corners(frame)
    assert (found > 45).all(1).any() == is_one and (found < 45).all(1).any()


@pytest.mark.parametrize(("contrast", "is_one"), [(12, False), (14, True)])
def test_a_corner_in_one_colour_alone_counts_as_much_as_one_in_three(contrast, is_one):
    frame = np.full((84, 84, 3), 60, np.uint8)
    frame[20:40, 20:40], frame[50:70, 50:70, 0] = 190, 60 + contrast
    assert (tracks.corners(frame) > 45).all(1).any() == is_one


@pytest.mark.parametrize("colour", [0, 1, 2])
def test_what_has_left_or_looks_otherwise_does_so_in_any_one_colour(colour):
    """Blue on grey has left where blue alone changed; what comes back less blue is another."""
    first, last = WALL.copy(), WALL.copy()
    first[40:50, 30:40, colour] += 90
    last[40:50, 50:60, colour] += 90
    points = np.array([[32.0, 45]])
    assert tracks.silhouette(first, last, np.array([20.0, 0]), points).sum() == 100
    last[40:50, 57:60, colour - 1] += 40
    assert tracks.silhouette(first, last, np.array([20.0, 0]), points).sum() == 70


@pytest.mark.parametrize(("apart", "one"), [(1.4, True), (1.6, False)])
def test_points_of_one_object_differ_by_less_than_a_pixel_and_a_half(apart, one):
    d = np.zeros((5, 3, 2))
    d[2, 2, 0] = apart  # in a single frame
    assert tracks.together(d).tolist() == [True, True, one]


@pytest.mark.parametrize(("rest", "kept"), [(0.9, True), (1.1, False)])
def test_an_object_rests_to_within_a_pixel_for_a_quarter_of_the_time(rest, kept):
    """Of 20 frames the first five."""
    paths = np.zeros((20, 2, 2))
    paths[5:] += 10 * np.linspace(0, 1, 15)[:, None, None]
    paths[4, :, 0] = rest
    assert tracks.object_points(paths, np.ones(2, bool)).tolist() == 2 * [kept]
    paths[4, :, 0] = 0
    paths[5, :, 0] = 2  # from here on it may move
    assert tracks.object_points(paths, np.ones(2, bool)).all()


@pytest.mark.parametrize(("way", "moved"), [(2.9, False), (3.1, True)])
def test_an_object_ends_three_pixels_from_its_start(way, moved):
    paths = np.zeros((20, 2, 2))
    paths[10:, :, 0] = way
    assert tracks.object_points(paths, np.ones(2, bool)).tolist() == 2 * [moved]


@pytest.mark.parametrize(("seen", "wall"), [(29, 40), (31, 150)])
def test_the_wall_is_what_three_tenths_of_a_film_show(seen, wall):
    """Of 100 frames so many show it; an arm of all grey levels from 20 to 60 is before it else."""
    film = np.full((100, 2, 2, 3), 150, np.uint8)
    film[seen:] = np.linspace(20, 60, 100 - seen).astype(np.uint8)[:, None, None, None]
    assert np.abs(tracks.background(film).astype(int) - wall).max() <= 12


def test_a_point_is_lost_that_comes_back_more_than_half_a_pixel_off(monkeypatch):
    back = iter([np.array([[10.4, 20.0]]), np.array([[10.6, 20.0]])])
    there = np.array([[15.0, 20.0]])

    def lucas_kanade(frame, following, points, guess):
        to = there if points[0, 0] == 10 else next(back)
        return to, np.ones(1, bool)

    monkeypatch.setattr(tracks, "_lucas_kanade", lucas_kanade)
    point = np.array([[10.0, 20.0]])
    assert [tracks.flow(WALL, WALL, point)[1].tolist() for _ in range(2)] == [[True], [False]]


def test_a_point_is_followed_for_ten_pixels_in_a_frame():
    frame, following = (scene(HERE + x, texture()) for x in ((0, 0), (10, 0)))
    points = np.float32([[34, 44], [36, 46], [33, 47]])
    to, kept = tracks.flow(frame, following, points)
    assert kept.all() and np.abs(to - points - (10, 0)).max() < 0.1


def test_a_smooth_spot_is_followed_to_a_two_hundredth_of_a_pixel():
    y, x = np.mgrid[:84, :84]
    spots = [60 + 120 * np.exp(-((x - left) ** 2 + (y - 40) ** 2) / 32) for left in (40, 41)]
    frames = [np.repeat(spot.round().astype(np.uint8)[..., None], 3, axis=2) for spot in spots]
    points = np.float32([[40, 40], [42, 41], [38, 39]])
    to, kept = tracks.flow(*frames, points)
    assert kept.all() and np.abs(to - points - (1, 0)).max() < 0.005


def test_a_point_is_kept_that_is_found_there_and_back(monkeypatch):
    """Four points that come back to where they were, as far as flow found them on its two ways."""
    points, there, back = np.zeros((4, 2)), [1, 1, 0, 0], [1, 0, 1, 0]
    found = iter([there, back])
    monkeypatch.setattr(tracks, "_lucas_kanade", lambda *_: (points, np.array(next(found), bool)))
    assert tracks.flow(WALL, WALL, points)[1].tolist() == [True, False, False, False]


def test_a_point_that_was_lost_once_stays_where_it_was(monkeypatch):
    """Both go by (3, 0) a frame; the first is lost in the second step and found in the third."""
    kept = iter(np.array([[1, 1], [0, 1], [1, 1]], bool))
    monkeypatch.setattr(tracks, "flow", lambda frame, to, points: (points + (3, 0), next(kept)))
    paths, to_the_end = tracks.follow(np.stack(4 * [WALL]), np.zeros((2, 2)))
    assert paths[:, 0, 0].tolist() == [0, 3, 3, 3] and paths[:, 1, 0].tolist() == [0, 3, 6, 9]
    assert to_the_end.tolist() == [False, True]


def test_an_object_rests_in_two_frames_however_short_the_demonstration_is():
    paths = np.zeros((4, 2, 2))
    paths[1:, :, 0] = [[5, 5], [6, 6], [9, 9]]
    assert not tracks.object_points(paths, np.ones(2, bool)).any()
    paths[1] = 0
    assert tracks.object_points(paths, np.ones(2, bool)).all()


def moving(monkeypatch, *ends):
    """As if the corners of the first frame were so many, and went so far."""
    points = np.array([[30.0 + 3 * k, 40] for k in range(len(ends))])
    share = np.clip(np.arange(12) - 4, 0, None)[:, None, None] / 7
    paths = points + share * np.array(ends, float)
    monkeypatch.setattr(tracks, "corners", lambda frame: points)
    monkeypatch.setattr(tracks, "follow", lambda frames, at: (paths, np.ones(len(ends), bool)))
    return np.stack(12 * [WALL])


def test_the_objects_way_is_the_median_of_its_points(monkeypatch):
    film = moving(monkeypatch, (10, 0), (10, 0.2), (11.2, 1))
    np.testing.assert_allclose(tracks.watch(film).path[-1], (10, 0.2))


def test_one_point_that_moves_alone_is_no_object(monkeypatch):
    with pytest.raises(InputError, match="no object"):
        tracks.watch(moving(monkeypatch, (10, 0)))


@pytest.mark.parametrize("side", ["left", "right", "top", "bottom"])
def test_an_arm_comes_in_from_any_side_of_the_picture(side):
    frame = WALL.copy()
    {
        "left": frame[40:44, :30], "right": frame[40:44, 50:],
        "top": frame[:30, 40:44], "bottom": frame[50:, 40:44],
    }[side][:] = 200  # fmt: skip
    assert tracks.arm_near(frame, WALL, NOTHING, np.array([42.0, 42])) is not None


@pytest.mark.parametrize(("aside", "its"), [(2, True), (3, False)])
def test_an_objects_points_lie_on_it_or_two_pixels_beside_it(aside, its):
    """Two things have left, one of them with a point at its rim or beside it."""
    first, last = WALL.copy(), WALL.copy()
    for row in (20, 60):
        first[row : row + 8, 30:40], last[row : row + 8, 50:60] = 200, 200
    points = np.array([[35.0, 59 - aside + 1]])
    mask = tracks.silhouette(first, last, np.array([20.0, 0]), points)
    assert mask[60:68, 30:40].all() == its and not mask[20:28].any()


def test_an_object_that_began_at_the_pictures_edge_is_seen_whole():
    """Where it came from, beyond the edge, is taken to look like the edge."""
    first, last = WALL.copy(), WALL.copy()
    last[40:50, 0:6] = 200
    first[40:50, 20:26] = 200
    mask = tracks.silhouette(first, last, np.array([-20.4, 0]), np.array([[23.0, 45]]))
    assert mask.sum() == 60 and mask[40:50, 20:26].all()


def test_the_background_of_a_film_of_three_frames_is_one_of_its_colours():
    film = np.stack([np.full((2, 2, 3), level, np.uint8) for level in (10, 200, 14)])
    assert np.isin(tracks.background(film), (10, 14)).all()


def test_the_wall_is_the_middle_of_what_keeps_coming_back():
    """40 of 100 frames show it, brighter and darker by up to 10 levels."""
    rng = np.random.default_rng(0)
    levels = np.r_[np.linspace(140, 160, 40), rng.uniform(0, 90, 60)].round().astype(np.uint8)
    wall = tracks.background(levels[:, None, None, None] + np.zeros((1, 1, 3), np.uint8))
    assert np.abs(wall.astype(int) - 150).max() <= 4


@pytest.fixture
def seen():
    """A tracker of the toy square, and its demonstration; it has been through an episode."""
    frames, _ = ways(pace=(1.5, 0.0))
    tracker = tracks.Tracker(tracks.watch(frames), texture().astype(np.uint8))
    tracker.reset(frames[0])
    for frame in frames[1:]:
        tracker.step(frame)
    return tracker, frames


def test_a_new_episode_knows_nothing_of_the_last_one(seen, monkeypatch):
    """Neither how fast the object was, nor where the arm was, nor which points were lost."""
    tracker, frames = seen
    guesses = []
    tracker.g = np.array([7.0, 7])
    monkeypatch.setattr(tracks, "arm_near", lambda *_: None)
    tracker.reset(frames[0])
    assert not tracker.g.any() and not tracker.d.any() and tracker.kept.all()
    monkeypatch.setattr(
        tracks,
        "flow",
        lambda a, b, points, guess: guesses.append(guess - points) or (points, points[:, 0] > 0),
    )
    tracker.step(frames[0])
    assert not np.any(guesses)


def test_an_arm_that_leaves_the_picture_is_taken_to_be_where_it_was_last(seen, monkeypatch):
    tracker, frames = seen
    near = iter([np.array([9.0, 8.0]), None])
    monkeypatch.setattr(tracks, "arm_near", lambda *_: next(near))
    tracker.reset(frames[0])
    before = tracker.g.copy()
    tracker.step(frames[1])
    np.testing.assert_array_equal(tracker.g, before)
    assert before.any()


def test_object_and_place_go_along_when_the_arm_is_looked_for(seen, monkeypatch):
    """What is the object's is no arm, with a rim of two pixels, wherever the object is by now."""
    tracker, frames = seen
    asked = []
    monkeypatch.setattr(tracks, "arm_near", lambda *of: asked.append(of[2:]))
    tracker.reset(frames[0])
    for frame in frames[1:]:
        tracker.step(frame)
    (thing, place), (later, there) = asked[0], asked[-1]
    way = tracker.d.round().astype(int)
    assert way[0] > 10
    np.testing.assert_allclose(there - place, tracker.d)
    rows, columns = np.nonzero(thing)
    mask = tracker.demo.mask.shape
    assert np.ptp(rows) + 1 == mask[0] + 4 and np.ptp(columns) + 1 == mask[1] + 4
    columns_then = np.nonzero(later)[1]
    assert columns_then.min() - columns.min() == pytest.approx(tracker.d[0], abs=1)


def test_what_is_lost_has_no_say_and_one_point_alone_does_not_move_the_object(seen, monkeypatch):
    tracker, frames = seen
    tracker.reset(frames[0])
    for lost, d in ((4, 0.0), (3, 4.0)):
        tracker.p_0 = tracker.p = np.array([[10.0 * k, 20] for k in range(5)])
        kept = np.arange(5) >= lost
        moves = np.where(kept[:, None], (4, 0), (40, 9))
        ends = tracker.p + moves, kept
        monkeypatch.setattr(tracks, "flow", lambda *_, ends=ends: ends)
        tracker.step(frames[0])
        assert tracker.d.tolist() == [d, 0]


def test_only_what_is_the_objects_is_looked_for_in_another_world():
    """Its patch's corners show the first world's wall, which is not there any more."""
    frame = np.full((84, 84, 3), 90, np.uint8)
    y, x = np.mgrid[:9, :9] - 4
    mask = (x**2 + y**2 <= 4).astype(np.uint8)
    patch = np.where(mask[..., None], np.uint8([200, 30, 30]), np.uint8([255, 255, 255]))
    demo = tracks.Demonstration(
        np.zeros((3, 2)), np.zeros((1, 2)), np.array([20, 20]), patch, mask, np.zeros(2)
    )
    frame[50:59, 40:49][mask > 0] = (200, 30, 30)
    frame[10:30, 10:30] = 255  # as bright as the first world's wall
    tracker = tracks.Tracker(demo, np.full((84, 84, 3), 90, np.uint8))
    tracker.reset(frame)
    assert tracker.ahead.tolist() == [20, 30]


def test_points_beyond_the_pictures_edge_are_drawn_at_it(monkeypatch):
    film = moving(monkeypatch, (60, 0), (60, 0.2))
    drawn = tracks.draw(film)
    assert (drawn[-1][40, 83] == (255, 220, 0)).all()
