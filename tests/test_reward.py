"""What Eq. 8-10 pay, computed by hand, and what the mended form pays for on a toy push task."""

from itertools import pairwise

import numpy as np
import pytest
from toy_push import HALF_GRIPPER, HALF_PUCK, ToyPush, demonstration, detect, follow, random_frames

from lbw_minimal.reward import (
    LAMBDA,
    MENDS,
    LiteralReward,
    MendedReward,
    prepare,
    resample,
    trim_pauses,
)
from lbw_minimal.training import InputError

HORIZON = ToyPush.horizon


def line(*x):
    """A trajectory of one keypoint along y = 0: (N, 1, 2)."""
    return np.stack([np.array(x, float), np.zeros(len(x))], -1)[:, None]


def random_walk(K, n=400, step=0.1, seed=0):
    return np.cumsum(
        np.random.default_rng(seed).normal(size=(n, K, 2)) * step / (2 * K) ** 0.5, axis=0
    )


def total(reward, z):
    """What an episode through the keypoints z (T + 1, K, 2) earns."""
    return sum(reward(a, b, t)[0] for t, (a, b) in enumerate(pairwise(z)))


@pytest.fixture(scope="module")
def toy():
    return detect(demonstration()), detect(random_frames(500))


def mended(toy, **switches):
    return MendedReward(*toy, horizon=HORIZON, **switches)


def episode(z):
    """The keypoints z, then rest in the last ones until the horizon."""
    return np.concatenate([z, np.repeat(z[-1:], HORIZON + 1 - len(z), axis=0)])


def acted(*waypoints):
    """Keypoints of an episode in which the toy's arm visits `waypoints`."""
    return episode(detect(follow(ToyPush(), waypoints)))[: HORIZON + 1]


def replay(toy):
    """The demonstration acted out at its own pace, without the pauses."""
    return acted(
        (-0.3, 0.3, 0.35, 0), (-0.26, 0.5, 0.35, 0), (0.55 - HALF_PUCK - HALF_GRIPPER, 0.5, 0.5, 0)
    )


# The paper's form ---------------------------------------------------------------------------------


def test_eq_9_is_the_distance_to_the_nearest_frame_and_looks_at_z_t():
    reward = LiteralReward(line(0, 1, 3))
    assert reward(line(0.8)[0], line(5)[0])[1]["r1"] == pytest.approx(-0.2)


def test_eq_9_leaves_the_goal_frame_out():
    reward = LiteralReward(line(0, 1, 3))
    # p <= N - 1: nearest is x = 1
    assert reward(line(3)[0], line(3)[0])[1]["r1"] == pytest.approx(-2)


def test_eq_10_is_the_distance_to_the_nearest_step_wherever_it_was_made():
    reward = LiteralReward(line(0, 1, 3))  # steps 1 and 2
    assert reward(line(0)[0], line(1.7)[0])[1]["r2"] == pytest.approx(-0.3)


def test_norms_run_over_all_keypoints_at_once():
    reward = LiteralReward(np.zeros((3, 2, 2)))
    z = np.array([[3.0, 0.0], [0.0, 4.0]])
    assert reward(z, z)[1] == {"r1": pytest.approx(-5), "r2": 0}


def test_eq_8_weighs_the_parts_by_lambda():
    reward = LiteralReward(line(0, 1, 3), lam=(2, 10))
    r, parts = reward(line(0.8)[0], line(2.5)[0])
    assert r == pytest.approx(2 * parts["r1"] + 10 * parts["r2"]) == pytest.approx(-0.4 - 3)


def test_literal_reward_knows_no_time():
    reward = LiteralReward(line(0, 1, 3))
    assert reward(line(0.8)[0], line(2)[0], 0) == reward(line(0.8)[0], line(2)[0], 99)


def test_idle_agent_wins_under_the_literal_reward(toy):
    """The trap: the demonstration starts at the robot's pose and pauses, so standing still is
    perfect."""
    literal = LiteralReward(toy[0])
    idle = np.repeat(toy[0][:1], HORIZON + 1, axis=0)
    assert total(literal, idle) == 0 >= total(literal, episode(toy[0]))


# The mended form ----------------------------------------------------------------------------------


def test_idle_agent_scores_far_below_the_replayed_demonstration(toy):
    reward = mended(toy)
    assert total(reward, acted()) < 3 * total(reward, replay(toy))


def test_arm_that_never_touches_the_object_scores_below_the_replay(toy):
    """The arm goes where it should but its puck stays: from the demonstration's end on, each step
    costs the puck's share of the path."""
    reward, touchless = mended(toy), replay(toy).copy()
    touchless[:, 3] = touchless[0, 3]
    share = np.linalg.norm(reward.z_E[-1, 3] - reward.z_E[0, 3]) / 4 / reward.path
    lost = share * (HORIZON - len(reward.z_E))
    earned = total(reward, replay(toy))
    assert lost > -0.3 * earned  # or the next line would say little
    assert total(reward, touchless) < earned - lost


def test_the_further_the_object_gets_the_more_it_earns(toy):
    way = (-0.3, 0.3, 0.5, 0), (-0.26, 0.5, 0.5, 0)  # at about the demonstration's pace
    scores = [total(mended(toy), acted(*way, (x, 0.5, 0.6, 0))) for x in (-0.2, 0.0, 0.2, 0.38)]
    assert scores == sorted(scores)


def test_following_exactly_earns_nothing_less_than_zero(toy):
    reward = mended(toy)
    assert total(reward, episode(reward.z_E)) == pytest.approx(0, abs=1e-9)


def test_idle_agent_seen_at_the_end_is_the_unit_of_r1():
    z = line(0, 0.1, 0.2, 0.3, 0.4, 0.5)
    reward = MendedReward(z, random_walk(1))
    assert reward(z[0], z[0], t=100)[1]["r1"] == pytest.approx(-1)


def test_reward_is_bounded_whatever_the_keypoints_do(toy):
    wild = np.random.default_rng(0).uniform(-1e6, 1e6, (200, 4, 2))
    reward = mended(toy)
    assert all(
        -2 * sum(LAMBDA) <= reward(a, b, t)[0] <= 0 for t, (a, b) in enumerate(pairwise(wild))
    )


def test_one_lost_keypoint_costs_no_more_than_its_share(toy):
    reward = mended(toy)
    z = reward.z_E[5].copy()
    z[1] = 1e6
    assert reward(reward.z_E[4], z, 4)[1]["r1"] == pytest.approx(-2 / len(z))


def test_one_lost_keypoint_in_the_demonstration_changes_little(toy):
    z, robot = toy
    glitched = z.copy()
    glitched[12, 3] = (-1, -1)
    assert np.abs(mended((glitched, robot)).z_E - mended(toy).z_E).max() < 0.05


def test_staying_behind_costs_only_if_the_reward_is_timed(toy):
    idle = acted()
    assert total(mended(toy), idle) < 5 * total(mended(toy, timed=False), idle)


def test_without_the_goal_frame_the_frame_before_it_is_the_target(toy):
    with_goal, without = mended(toy), mended(toy, include_goal=False)
    assert (with_goal.target(99) == with_goal.z_E[-1]).all() and (
        without.target(99) == without.z_E[-2]
    ).all()


@pytest.mark.parametrize("mend", MENDS)
def test_every_mend_can_be_switched_off_alone(toy, mend):
    z = replay(toy)
    assert total(mended(toy, **{mend: False}), z) != pytest.approx(total(mended(toy), z), abs=1e-6)


def test_the_mended_reward_by_hand():
    """Frame and step of the same time, the mean over keypoints, in units of the mean path.

    Two keypoints go 1 and 3 to the right, so the path is 2. The robot's pace is that of the
    demonstration, so that nothing is stretched.
    """
    t = np.linspace(0, 1, 5)
    z_E = np.zeros((5, 2, 2))
    z_E[:, 0, 0], z_E[:, 1, 0] = t, 3 * t
    reward = MendedReward(z_E, z_E)
    np.testing.assert_allclose(reward.z_E, z_E)
    z, z_next = z_E[1] + (0.1, 0), z_E[2] + (0, 0.2)
    r, parts = reward(z, z_next, 1)
    assert parts["r1"] == pytest.approx(-0.2 / 2)
    assert parts["r2"] == pytest.approx(-np.hypot(0.1, 0.2) / 2)
    assert r == pytest.approx(parts["r1"] + 3 * parts["r2"])
    stay, parts = reward(z_E[4], z_E[4] + (0, 0.4), 9)  # after the end: the goal, at rest
    assert parts == {"r1": pytest.approx(-0.2), "r2": pytest.approx(-0.2)}
    assert stay == pytest.approx(-0.8)


def test_an_untimed_mended_reward_takes_the_nearest_frame_and_the_nearest_step():
    z_E = line(0, 1, 3, 6)
    reward = MendedReward(z_E, 10 * random_walk(1), timed=False, trim=False, speed=False)
    _, parts = reward(line(0)[0], line(2.9)[0], 0)
    far = reward.path
    assert parts == {"r1": pytest.approx(-0.1 / far), "r2": pytest.approx(-0.1 / far)}
    assert reward(line(5)[0], line(6)[0])[1]["r1"] == 0
    without = MendedReward(
        z_E, 10 * random_walk(1), timed=False, trim=False, speed=False, include_goal=False
    )
    assert without(line(5)[0], line(6)[0])[1]["r1"] == pytest.approx(-min(3, 2 * far) / far)


def test_an_episode_gives_the_demonstration_eighty_percent():
    assert LiteralReward(np.zeros((40, 1, 2))).episode == 50
    assert LiteralReward(np.zeros((43, 1, 2))).episode == 54  # 53.75
    z = line(*np.linspace(0, 1, 40))
    assert MendedReward(z, z).episode == 50 and MendedReward(z, z, horizon=30).episode == 30


def test_the_clock_goes_from_0_to_1_and_stays():
    reward = MendedReward(line(*np.linspace(0, 1, 40)), line(*np.linspace(0, 1, 40)))
    last = len(reward.z_E) - 1
    assert [reward.clock(t) for t in (0, last, 10 * last)] == [0, 1, 1]


def test_what_moves_less_than_a_tenth_of_the_robots_median_step_is_at_rest():
    """The robot's median step is 1: a crawl of 0.019 a frame is at rest, and a rest keeps five.

    0.019 times five is just below a tenth, so that in each group of frames only the rest stays.
    """
    robot = line(*np.cumsum(50 * [1, 1, 1, 3, 3]))
    walk = [0, 1, 2, 3]
    crawl = [3 + 0.004 * i for i in range(1, 21)]
    z = prepare(line(*walk, *crawl, 4, 5), robot, speed=False)
    assert z[:, 0, 0].tolist() == pytest.approx([*walk, *crawl[:5], 4, 5])
    faster = [3 + 0.045 * i for i in range(1, 21)]  # a tenth within three frames
    z = prepare(line(*walk, *faster, 4, 5), robot, speed=False)
    assert len(z) == 26


def test_one_glitch_is_gone_before_anything_is_measured():
    robot = line(*np.arange(50.0))
    x = np.arange(8.0)
    x[4] = 100
    z = prepare(line(*x), robot, trim=False, speed=False)
    assert z[:, 0, 0].tolist() == [0, 1, 2, 3, 5, 6, 6, 7]  # medians of three


def test_the_robots_top_step_is_its_ninth_decile():
    """Of thirty steps two are 5, the resets of episodes, the others 0.1: that is the pace."""
    robot = line(*np.cumsum([0.0, *(14 * [0.1]), 5.0, *(14 * [0.1]), 5.0]))
    z = prepare(line(0, 0.3, 0.6, 0.9), robot, trim=False)
    assert np.diff(z[:, 0, 0]) == pytest.approx(9 * [0.1])


# Its preparation ----------------------------------------------------------------------------------


def test_trimming_cuts_pauses_and_keeps_start_and_goal():
    z = line(0, 0, 0.01, 1, 1, 1.01, 2, 2.02)
    assert trim_pauses(z, 0.5)[:, 0, 0].tolist() == [0, 1, 2, 2.02]


def test_trimming_keeps_slow_motion_that_adds_up():
    z = line(0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
    assert trim_pauses(z, 0.25)[:, 0, 0].tolist() == [0, 0.3, 0.6, 0.7]


def test_a_short_rest_stays_and_a_long_one_is_cut():
    z = line(0, 1, 1, 1, 1, 1, 1, 2, 2, 3)
    assert trim_pauses(z, 0.5, rest=2)[:, 0, 0].tolist() == [0, 1, 1, 1, 2, 2, 3]


def test_resampling_slows_down_what_is_too_fast():
    z = resample(line(*np.linspace(0, 1, 11)), 0.05, 1000)
    assert np.diff(z[:, 0, 0]) == pytest.approx(np.full(20, 0.05))


def test_resampling_never_hurries_as_what_slides_has_a_time_of_its_own():
    z = line(*np.linspace(0, 1, 21))
    np.testing.assert_allclose(resample(z, 0.1, 1000), z)


def test_resampling_keeps_a_strike_faster_than_its_approach():
    x = resample(line(0, 0.1, 0.2, 0.3, 0.4, 0.8, 1.2), 0.2, 1000)[:, 0, 0]
    assert x[-1] - x[-2] == pytest.approx(4 * (x[1] - x[0]))


def test_a_long_demonstration_leaves_time_to_reach_its_goal(toy):
    slow = np.repeat(toy[0], 10, axis=0) + np.linspace(0, 0.5, 10 * len(toy[0]))[:, None, None]
    assert len(mended((slow, toy[1]), trim=False).z_E) <= 0.8 * HORIZON


# Wrong input --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros((5, 2)), random_walk(1)), "shape"),
        ((np.zeros((2, 1, 2)), random_walk(1)), "shape"),
        ((line(0, 1, 2), random_walk(3)), "robot keypoints"),
        ((line(0, 1, 2), None), "robot keypoints"),
        ((line(1, 1, 1, 1), random_walk(1)), "nothing moves"),
    ],
)
def test_wrong_input_of_the_mended_reward_is_refused_in_a_sentence(arguments, message):
    with pytest.raises(InputError, match=message):
        MendedReward(*arguments)


@pytest.mark.parametrize("z_E", [np.zeros((5, 2)), np.zeros((2, 1, 2)), np.zeros((5, 1, 3))])
def test_a_trajectory_of_another_shape_is_refused_by_the_literal_reward(z_E):
    with pytest.raises(InputError, match="shape"):
        LiteralReward(z_E)


# What it computed when the results were made ------------------------------------------------------


def shown(K=3, n=46, seed=1):
    """A demonstration that rests, creeps, strikes and rests again, with glitches: (n, K, 2)."""
    rng = np.random.default_rng(seed)
    pace = np.r_[[0.0] * 9, np.linspace(0.2, 1, 14), [0.02] * 8, [2.5, 1.5], [0.0] * (n - 33)]
    way = np.cumsum(pace)[:, None, None] * rng.normal(size=(K, 2)) * 0.02
    z = rng.uniform(-0.5, 0.5, (K, 2)) + way + 1e-4 * rng.normal(size=(n, K, 2))
    z[[5, 20]] += 0.3
    return z


FORMS = {
    "mended": {},
    "of 30 steps": {"horizon": 30},
    "of 300 steps": {"horizon": 300},
    **{f"without {mend}": {mend: False} for mend in MENDS},
    "as a whole, in 30": {"horizon": 30, "timed": False, "include_goal": False},
    "with other weights": {"lam": (2.0, 0.5)},
}


@pytest.mark.parametrize("form", ["literal", *FORMS])
def test_a_walk_beside_the_demonstration_earns_what_it_earned(form, golden):
    """Near it, far beyond where distances are capped, and after the demonstration's end."""
    z, robot = shown(), random_walk(3, 90, 0.02)
    reward = LiteralReward(z) if form == "literal" else MendedReward(z, robot, **FORMS[form])
    rng = np.random.default_rng(2)
    ends = reward.z_E[np.linspace(0, len(reward.z_E) - 1, 13).astype(int)]
    walk = ends + rng.normal(size=ends.shape) * np.geomspace(0.003, 3, 13)[:, None, None]
    steps = [0, 1, 2, 5, 9, 17, 22, 23, 24, 40, 90, 400]
    paid = [reward(a, b, t) for (a, b), t in zip(pairwise(walk), steps, strict=True)]
    figures = {
        "paid": [r for r, _ in paid],
        "r1": [parts["r1"] for _, parts in paid],
        "r2": [parts["r2"] for _, parts in paid],
        "lam": reward.lam,
        "frames": [len(reward.z_E), len(reward.v_E), reward.episode],
        "way": reward.z_E[::7, 1, 0],
        "timed": reward.timed,
    }
    if form != "literal":
        figures |= {
            "path": reward.path,
            "clock": [reward.clock(t) for t in steps],
            "target": [reward.target(t)[0, 1] for t in steps],
        }
    golden(figures)


def test_demonstrations_are_made_the_robots_own_as_they_were(golden):
    """Slow and fast robots, pauses cut to several lengths, and few frames or many."""
    z, figures = shown(), {}
    for pace in (0.005, 0.02, 0.2):
        for horizon in (None, 22, 90):
            own = prepare(z, random_walk(3, 60, pace, 4), horizon=horizon)
            figures[f"{pace}, {horizon}"] = [
                len(own),
                own.mean(),
                own.std(),
                *own[len(own) // 2, 0],
            ]
    for least, rest in ((0.01, 0), (0.01, 3), (0.05, 1), (0.2, 2)):
        cut = trim_pauses(z, least, rest)
        figures[f"pauses {least}, {rest}"] = [len(cut), cut.mean(), cut[1, 0, 0], cut[-2, 0, 0]]
    for step, longest in ((0.01, 400), (0.01, 40), (0.5, 400), (0.5, 12), (0.03, 1000)):
        some = resample(z, step, longest)
        figures[f"{step} in {longest}"] = [len(some), some.mean(), *some[3, 1], *some[-2, 1]]
    golden(figures)


@pytest.mark.parametrize(("way", "moves"), [(3e-6, True), (3e-7, False)])
def test_a_demonstration_moves_by_a_millionth_or_does_not(way, moves):
    z = line(0, way / 2, way, way, way)
    if moves:
        assert MendedReward(z, z, trim=False, speed=False).path == pytest.approx(way)
    else:
        with pytest.raises(InputError) as told:
            MendedReward(z, z, trim=False, speed=False)
        assert str(told.value) == (
            "nothing moves in the demonstration; give a video that shows the skill."
        )


def test_what_is_no_trajectory_is_named_with_what_to_give():
    messages = []
    for z, robot in (
        (np.zeros((2, 4, 2)), None), (np.zeros((5, 4, 3)), None), (np.zeros((5, 2)), None),
        (shown(2), np.zeros((2, 2, 2))), (shown(2), np.zeros((9, 3, 2))),
        (shown(2), np.zeros((9, 4))),
    ):  # fmt: skip
        with pytest.raises(InputError) as told:
            LiteralReward(z) if robot is None else MendedReward(z, robot)
        messages.append(str(told.value))
    shapes = "(2, 4, 2)", "(5, 4, 3)", "(5, 2)"
    assert messages[:3] == [
        f"keypoint trajectory of shape {shape}: give (N, K, 2) with N of 3 or more."
        for shape in shapes
    ]
    shapes = "(2, 2, 2)", "(9, 3, 2)", "(9, 4)"
    assert messages[3:] == [
        f"robot keypoints of shape {shape}: give (M, 2, 2), M >= 3." for shape in shapes
    ]
    np.testing.assert_array_equal(LiteralReward(np.zeros((3, 1, 2)))(*np.zeros((2, 1, 2)))[0], 0)


def test_two_frames_stay_two_and_never_become_one():
    """What is left of a demonstration in which only the first frame and the last one differ."""
    z = line(0, 1)
    np.testing.assert_array_equal(resample(z, 9.0, 40), z)
    np.testing.assert_array_equal(resample(line(0, 0, 1), np.inf, 2), z)
    assert len(prepare(line(0, 0, 0, 0, 0, 1), line(*range(9)), trim=True)) >= 2


def test_the_last_step_is_one_of_the_demonstrations_even_where_its_goal_is_left_out():
    """Steps of 1, 1 and 3: one of 3 is the demonstration's own, wherever it is made."""
    z = line(0, 1, 2, 5)
    switches = dict.fromkeys(("trim", "speed", "include_goal", "timed"), False)
    _, parts = MendedReward(z, z, **switches)(line(0)[0], line(3)[0])
    assert parts["r2"] == 0
