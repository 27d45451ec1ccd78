"""What happens in drawings, before a camera sees it: who moves what, and when."""

import numpy as np
import pytest

from lbw_minimal.clips import drawings
from lbw_minimal.clips.drawings import SIZE

T = 60
SEEDS = range(40)


def story(kind, seed, frames=T):
    return drawings._story(np.random.default_rng(seed), kind, frames)


def ways(told):
    """The object's way (2,), its length, and the share of it that is gone in each frame (T,)."""
    way = told.object[-1] - told.object[0]
    length = np.linalg.norm(way)
    return way, length, (told.object - told.object[0]) @ way / length**2


def under_way(told):
    """The frames in which the object moves, without the ends of that."""
    share = ways(told)[2]
    return np.flatnonzero((share > 0.03) & (share < 0.97))


def test_a_hand_moves_as_hands_do_and_rests_before_and_after():
    t = np.array([-1.0, 0, 0.25, 0.5, 0.75, 1, 2])
    half = 0.25**3 * (10 - 15 * 0.25 + 6 * 0.25**2)
    np.testing.assert_allclose(drawings._ease(t), [0, 0, half, 0.5, 1 - half, 1, 1])


def test_the_move_begins_when_the_hand_is_there_and_the_hand_leaves_when_it_is_over():
    time, rests = np.linspace(0, 1, 400)[:, None], []
    for seed in SEEDS:
        begin, approach, move, retreat = drawings.phases(np.random.default_rng(seed), time)
        assert (approach[move > 0] == 1).all() and (move[time <= begin] == 0).all()
        assert (move[retreat > 0] == 1).all() and move[-1] == 1
        for part in (approach, move, retreat):
            assert (np.diff(part[:, 0]) >= 0).all()
        rests.append((begin == pytest.approx(0, abs=0.05), retreat[-1, 0] < 0.5))
    touched, stayed = np.mean(rests, axis=0)
    # A quarter of the clips begins with the touch; a retreat of an instant is over at the end.
    assert 0.1 < touched < 0.5 and stayed == 0


class Longest:
    """Chance that lets all last as long as it may, and does without what is seldom."""

    def uniform(self, low, high, size):
        return np.full(size, high)

    def random(self):
        return 0.99


def test_rests_and_moves_last_as_long_as_in_real_clips_at_most():
    """Rest 0.25 s, approach 0.9, rest 0.25, move 1.7, rest 0.4, retreat 0.8, rest 0.3: 4.6 in all.

    A tenth of a second of approach and retreat, and three of the move, are the least.
    """
    seconds = np.array([0.25, 0.7, 1.15, 1.4, 2.25, 3.1, 3.5, 3.9, 4.3])[:, None]
    begin, approach, move, retreat = drawings.phases(Longest(), seconds / 4.6)
    assert begin == pytest.approx(1.4 / 4.6)
    np.testing.assert_allclose(approach[:3, 0], [0, 0.5, 1], atol=1e-9)
    np.testing.assert_allclose(move[3:6, 0], [0, 0.5, 1], atol=1e-9)
    np.testing.assert_allclose(retreat[6:, 0], [0, 0.5, 1], atol=1e-9)


class Patient:
    """Chance that lets all last an instant but the rest of the given number, which is long."""

    def __init__(self, rest):
        self.chances = iter([0.99, 0.99, *(0.0 if i == rest else 0.99 for i in range(4))])

    def uniform(self, low, high, size=None):
        return high if size is None else np.full(size, low)

    def random(self):
        return next(self.chances)


@pytest.mark.parametrize("rest", range(4))
def test_people_wait_before_they_come_at_the_object_and_after_the_push_and_the_retreat(rest):
    """Eight seconds, and half a second in which the hand comes, moves for 0.3 s, and goes."""
    time = (np.arange(8500) / 8500)[:, None]
    _, *steps = drawings.phases(Patient(rest), time)
    moves = np.abs(np.gradient(np.concatenate(steps, 1), axis=0)).max(1) > 0
    waits = np.flatnonzero(np.diff(moves))
    before = (0, 0.1, 0.4, 0.5)[rest]  # s
    rests = [a for a, b in zip([0, *waits], [*waits, 8500], strict=True) if b - a > 7900]
    assert len(rests) == 1 and abs(rests[0] / 1000 - before) < 0.06


@pytest.mark.parametrize("kind", ["push", "hit", "alone"])
def test_an_object_goes_straight_and_never_back_from_and_to_a_place_in_the_picture(kind):
    for seed in SEEDS:
        told = story(kind, seed)
        way, length, share = ways(told)
        assert 7 <= length <= 45.01 and (np.diff(share) > -1e-9).all()
        assert (told.object[[0, -1], 0] >= 10).all()
        assert (told.object[[0, -1], 0] <= SIZE - 6).all()
        aside = (told.object - told.object[0]) @ (-way[1], way[0]) / length
        assert np.abs(aside).max() < 1e-6


def test_some_carried_objects_are_lifted_and_put_down_again():
    lifted = 0
    for seed in SEEDS:
        told = story("carry", seed)
        way, *_ = ways(told)
        if abs(way[0]) < 3:
            continue
        share = (told.object[:, 0] - told.object[0, 0]) / way[0]
        above = told.object[0, 1] + share * way[1] - told.object[:, 1]
        assert above.min() > -1e-6 and abs(above[-1]) < 1e-6
        lifted += above.max() > 1
    assert 4 <= lifted <= 20  # 30 % of 40


@pytest.mark.parametrize("kind", ["push", "carry"])
def test_who_pushes_or_carries_stays_where_it_touches(kind):
    for seed in SEEDS:
        told = story(kind, seed)
        beside = (told.tip - told.object)[under_way(told)]
        assert np.ptp(beside, axis=0).max() < 1e-6 and np.abs(beside).max() > 0.1


def test_who_pushes_or_hits_is_behind_the_object_when_it_goes():
    for kind in ("push", "hit"):
        for seed in SEEDS:
            told = story(kind, seed, frames=2000)
            way, length, _ = ways(told)
            first = under_way(told)[0]
            behind = (told.object - told.tip)[first] @ way / length
            assert behind > 0 and behind < np.abs(told.half).sum() + 3


def test_most_hit_objects_have_come_to_rest_when_the_clip_ends():
    ends = [ways(story("hit", seed))[2] for seed in range(100)]
    at_rest = np.array([(share[-T // 10 :] > 1 - 1e-9).all() for share in ends])
    assert 0.5 < at_rest.mean() < 0.9  # the others still glide in the last tenth of it


def test_a_hit_object_goes_on_ever_slower_and_the_hand_four_pixels_at_most():
    hand = []
    for seed in SEEDS:
        told = story("hit", seed)
        steps = np.linalg.norm(np.diff(told.object, axis=0), axis=1)
        moving = steps[steps > 1e-9]
        assert (np.diff(moving[1:]) < -1e-9).all()  # the first may have begun between frames
        hand.append(np.linalg.norm(told.tip[-2] - told.tip[under_way(told)[0]]))
    assert np.median(hand) < 4  # three in five stay there to the end


def test_a_hand_comes_from_elsewhere_and_what_it_leans_on_comes_along():
    """At the start it is away from where it touches; shoulders stand out of the picture."""
    away = [np.linalg.norm(story("push", s).tip[0] - story("push", s).tip[T // 2]) for s in SEEDS]
    assert np.median(away) > 8
    outside = 0
    for seed in SEEDS:
        told = story("push", seed)
        shoulder = told.shoulder[under_way(told)[0]]
        outside += ((shoulder < 8) | (shoulder > SIZE)).any()
        comes, leans = (p[under_way(told)[0]] - p[0] for p in (told.tip, told.shoulder))
        assert 0 <= leans @ comes <= 1.001 * comes @ comes  # by a part of the hand's way, or all
    assert outside > 36


def test_a_drawer_is_shut_where_its_way_ends_if_it_is_pushed_and_begins_if_it_is_pulled():
    for seed in SEEDS:
        told = story("drawer", seed)
        right = told.object[-1, 0] > told.object[0, 0]
        np.testing.assert_allclose(told.closed, told.object[-1 if right else 0], atol=1e-9)
        assert 1 <= told.half[0] <= 8 and 2 <= told.half[1] <= 12  # high rather than wide


def test_a_shadow_is_where_the_arm_is_moved_by_its_fall():
    layer = np.zeros((SIZE, SIZE, 4), np.uint8)
    layer[20:40, 20:40] = 255
    lit = drawings._lit(layer, 0.4, np.array([10.0, 5.0]), 0.5)
    assert lit.shape == (SIZE, SIZE, 1)
    assert lit[30, 47, 0] == pytest.approx(0.6, abs=1e-3)
    assert lit[47, 30, 0] == 1 and lit[22, 25, 0] == 1 and lit[70, 70, 0] == 1
    assert drawings._lit(layer, 0.0, np.zeros(2), 1.0) == 1


def test_walls_and_most_tables_have_clutter_and_the_ground_is_what_the_object_stands_before(
    monkeypatch,
):
    asked, counts = [], []
    monkeypatch.setattr(
        drawings, "_clutter", lambda rng, layer, n, low, high: asked.append((n, low, high))
    )
    for seed in SEEDS:
        told, before = story("push", seed), len(asked)
        picture, ground = drawings.a_room(np.random.default_rng(seed), told)
        x, y = told.object[0].clip(0, SIZE - 1).astype(int)
        np.testing.assert_array_equal(ground, picture[y, x])
        (n, low, high), *table = asked[before:]
        assert low == (0, 0) and high == (SIZE, 50) and n >= 0
        assert all(high == (SIZE, SIZE) and low[0] == 0 for _, low, high in table)
        counts.append(len(table))
    assert 28 <= sum(counts) <= 39  # 85 % of 40
    assert {n for n, *_ in asked} >= {0, 1, 3}
