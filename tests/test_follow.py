"""The track reward by hand, what its wrapper tells an agent, and the method from video to page."""

import json
import warnings
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
import toy_film
from gymnasium.utils.env_checker import check_env
from toy_film import Film
from toy_square import HERE, scene, texture, ways

import tasks
from lbw_minimal import follow, sac, tracks, video
from lbw_minimal.follow import TrackReward, TrackWrapper
from lbw_minimal.imitate import Run
from lbw_minimal.reward import LAMBDA
from lbw_minimal.training import InputError
from tasks.__main__ import main
from tasks.push import RECIPE
from tasks.world import expert_actions

pytestmark = pytest.mark.usefixtures("one_trial")
PATH = np.array([[0, 0], [0, 0], [4, 0], [8, 0]], float)  # L = 8
still = np.zeros(2)


def test_the_reward_of_three_steps_by_hand():
    """lam = (1, 3, 2). Rest, with the arm 4 away: only r3. Then 4 are asked for and 3 done: r1 =
    r2 = -1/8, half of the way is left and the arm is 2 away. Then all is as it should be."""
    reward = TrackReward(PATH, lam=(1, 3, 2))
    d = [np.array([x, 0.0]) for x in (0, 0, 3, 8)]
    g = [np.array([0.0, y]) for y in (4, 2, 5)]
    found = [reward(d[t], d[t + 1], g[t], t) for t in range(3)]
    assert found[0] == (pytest.approx(-1), {"r1": 0, "r2": 0, "r3": pytest.approx(-0.5)})
    assert found[1][1] == pytest.approx({"r1": -1 / 8, "r2": -1 / 8, "r3": -1 / 8})
    assert found[1][0] == pytest.approx(-1 / 8 - 3 / 8 - 2 / 8)
    # 8 - 3 = 5 where the demonstration moves by 4: r2 = -1/8; no way is left, so no approach
    assert found[2][1] == pytest.approx({"r1": 0, "r2": -1 / 8, "r3": 0})


def test_unless_asked_the_weights_are_one_three_and_one():
    """The first two are those of the keypoints' reward."""
    d, d_next, g = np.array([0.5, 0]), np.array([1.0, 1]), np.array([2.0, 3])
    r, parts = TrackReward(PATH)(d, d_next, g, 1)
    assert min(abs(part) for part in parts.values()) > 0.1
    assert r == pytest.approx(parts["r1"] + 3 * parts["r2"] + parts["r3"])
    assert follow.LAMBDA[:2] == LAMBDA


def test_the_longest_displacement_is_the_measure_and_not_the_last():
    """A thing that goes 8 pixels on and comes 3 back, with the arm 4 away at its farthest."""
    reward = TrackReward([[0, 0], [4, 0], [8, 0], [5, 0]])
    assert reward.L == 8 and reward.last == 3
    _, parts = reward(np.array([4.0, 0]), np.array([8.0, 0]), np.array([0, 4.0]), 1)
    assert parts == {"r1": 0, "r2": 0, "r3": 0}
    _, parts = reward(np.array([8.0, 0]), np.array([5.0, 0]), np.array([0, 4.0]), 2)
    assert parts["r3"] == pytest.approx(-(1 - 5 / 8) * 4 / 8)
    # a way counts along where the demonstration ends, in its whole length
    assert reward.stretch(np.array([2.0, 0])) == pytest.approx(8 / 6)


def test_the_demonstrations_clock_goes_evenly_and_its_motion_in_its_own_time():
    """A hit is faster than the approach to it, and stays so."""
    path = np.array([[0, 0]] * 9 + [[20, 0]] * 2, float)
    reward = TrackReward(path, horizon=50)
    np.testing.assert_array_equal(reward.d_E, path)
    assert [reward.clock(t) for t in (0, 5, 10, 11)] == [0, 0.5, 1, 1]
    assert reward.episode == round(11 / 0.8)


@pytest.mark.parametrize(("way", "moves"), [(2.9, False), (3.1, True)])
def test_a_demonstration_moves_its_object_by_three_pixels(way, moves):
    path = np.linspace((0, 0), (way, 0), 9)
    if moves:
        TrackReward(path)
    else:
        with pytest.raises(InputError, match=r"by 2\.9 pixels; it takes 3"):
            TrackReward(path)


def test_after_its_end_the_demonstration_rests_at_its_goal():
    reward = TrackReward(PATH)
    goal = PATH[-1]
    assert reward(goal, goal, still, 9) == (0, {"r1": 0, "r2": 0, "r3": 0})
    assert reward.clock(9) == 1 and reward.clock(0) == 0


def test_an_object_that_was_thrown_away_costs_a_bounded_share():
    reward = TrackReward(PATH, lam=(1, 1, 1))
    far = np.array([0.0, 1e6])
    _, parts = reward(still, far, far, 0)
    assert parts == {"r1": -2, "r2": -2, "r3": -2}


def test_an_object_that_starts_ahead_has_its_way_stretched_to_the_same_goal():
    """8 pixels in the demonstration; 2 ahead there are 6 to go, so each counts 8 / 6."""
    reward = TrackReward(PATH)
    assert reward.stretch(np.array([2.0, 5.0])) == pytest.approx(8 / 6)  # aside is no way
    assert reward.stretch(np.array([-8.0, 0.0])) == pytest.approx(0.5)
    assert reward.stretch(np.array([8.0, 0.0])) == pytest.approx(5)  # it is there: no division by 0


def test_a_demonstration_that_is_too_long_is_hurried_and_a_short_one_keeps_its_time():
    slow = np.linspace((0, 0), (20, 0), 101)
    assert len(TrackReward(slow, horizon=50).d_E) == 40
    np.testing.assert_array_equal(TrackReward(slow, horizon=300).d_E, slow)
    assert TrackReward(slow, horizon=50).episode == 50


@pytest.mark.parametrize(
    ("path", "why"),
    [
        (np.zeros((9, 2)), "moves by 0.0 pixels"),
        (PATH[::3], r"of shape \(2, 2\)"),
        (np.outer(np.arange(9), (1, 1, 1)), r"of shape \(9, 3\)"),
        (np.arange(9), r"of shape \(9,\)"),
    ],
)
def test_a_path_that_shows_nothing_or_is_none_is_refused(path, why):
    with pytest.raises(InputError, match=why):
        TrackReward(path)


WALL = texture().astype(np.uint8)


def wrapped(frames, **options):
    shown = tracks.watch(ways()[0])
    tracker = tracks.Tracker(shown, WALL)
    return TrackWrapper(Film(frames, **options), tracker, TrackReward(shown.path))


play = partial(toy_film.play, steps=18)


def test_gymnasium_has_nothing_to_complain_about(monkeypatch):
    monkeypatch.setattr(Film, "Info", dict)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", "(?s).*is different from the unwrapped version")
        check_env(wrapped(ways()[0]), skip_render_check=True)


def test_an_agent_sees_displacement_arm_motion_and_the_way_ahead():
    frames, d = ways()
    shown = tracks.watch(frames)
    seen, paid = play(wrapped(frames))
    np.testing.assert_allclose(42 * seen[:, 0:2], d[:19], atol=0.2)
    np.testing.assert_allclose(seen[1:, 4:8], np.diff(seen[:, :4], axis=0), atol=1e-6)
    np.testing.assert_allclose(seen[2:, 8:12], seen[1:-1, 4:8], atol=1e-6)
    ahead = shown.path[1:20] - 42 * seen[:, :2]
    np.testing.assert_allclose(42 * seen[:, 12:14], ahead, atol=1e-4)
    np.testing.assert_allclose(seen[:, 14], np.arange(19) / 19, atol=1e-6)
    # It follows the demonstration, and there is no arm in sight: nothing is to pay.
    np.testing.assert_allclose(paid, 0, atol=0.1)


def test_observation_and_reward_are_functions_of_the_frames():
    """Another world with the same pictures, closed and paying 1,000 a step: no difference."""
    frames, _ = ways()
    poor, rich = play(wrapped(frames)), play(wrapped(frames, reward=1000.0))
    assert (poor[0] == rich[0]).all() and (poor[1] == rich[1]).all()


def test_an_object_that_stays_earns_less_than_one_that_goes_the_demonstrations_way():
    frames, _ = ways()
    _, paid = play(wrapped(frames))
    _, idle = play(wrapped(frames[:1]))
    assert idle.sum() < paid.sum() - 5


def test_where_the_object_starts_makes_no_difference_to_what_is_seen_of_its_way():
    """Moved down, aside of its way: the same displacements, the same reward."""
    path, _ = ways(pace=(1.5, 0.0))
    wall = np.full((84, 84, 3), (120.0, 130.0, 150.0))
    _, d = ways(pace=(1.5, 0.0))
    shown = tracks.watch(path)
    tracker = tracks.Tracker(shown, wall.astype(np.uint8))
    seen = []
    for start in (HERE, HERE + (0, 6)):
        frames = np.stack([scene(start + x, wall) for x in d])
        seen.append(play(TrackWrapper(Film(frames), tracker, TrackReward(shown.path))))
    np.testing.assert_allclose(seen[0][0], seen[1][0], atol=0.01)
    np.testing.assert_allclose(seen[0][1], seen[1][1], atol=0.05)


def test_an_object_that_starts_ahead_is_seen_to_go_as_much_of_its_shorter_way():
    """16.5 pixels in the demonstration. 3 ahead there are 13.5, so a step counts 16.5 / 13.5."""
    wall = np.full((84, 84, 3), (120.0, 130.0, 150.0))
    path, d = ways(pace=(1.5, 0.0))
    shown = tracks.watch(path)
    tracker = tracks.Tracker(shown, wall.astype(np.uint8))
    frames = np.stack([scene(HERE + (3, 0) + x, wall) for x in d])
    seen, _ = play(TrackWrapper(Film(frames), tracker, TrackReward(shown.path)))
    np.testing.assert_allclose(42 * seen[:, 0], 16.5 / 13.5 * d[:19, 0], atol=0.3)
    assert 42 * seen[-1, 0] > d[18, 0] + 1


class Scripted:
    """A tracker that says what it is told to: displacement and way to the arm, frame by frame."""

    ahead = np.array([2.0, 0])

    def __init__(self, d, g):
        self.said, self.t = list(zip(np.array(d, float), np.array(g, float), strict=True)), 0

    def reset(self, frame):
        self.t = 0
        self.d, self.g = self.said[0]

    def step(self, frame):
        self.t += 1
        self.d, self.g = self.said[self.t]


def test_what_an_agent_sees_and_earns_is_the_reward_of_the_step_by_hand():
    """s = 8 / 6. The reward is asked for s d_t, s d_{t+1}, g_{t+1} and t, from 0 every time."""
    d = [[0, 0], [0, 1], [3, 1], [6, 0], [6, 0]]
    g = [[5, 5], [4, 4], [3, 3], [2, 2], [1, 1]]
    frames, reward, asked = np.zeros((5, 84, 84, 3), np.uint8), TrackReward(PATH), []
    pay = type(reward).__call__

    class Noted(TrackReward):
        def __call__(self, *of):
            asked.append([np.asarray(x).tolist() for x in of])
            return pay(self, *of)

    env = TrackWrapper(Film(frames), Scripted(d, g), Noted(PATH))
    s = 8 / 6
    x = np.concatenate([s * np.array(d), np.array(g)], axis=1)
    target = PATH[[1, 2, 3, 3, 3]]
    for _ in range(2):
        asked.clear()
        seen = [env.reset(seed=0)[0]]
        for t in range(4):
            obs, r, _, _, info = env.step(np.zeros(3, np.float32))
            seen.append(obs)
            assert (r, dict.__getitem__(info, "reward_parts")) == reward(
                s * np.array(d[t]), *x[t + 1].reshape(2, 2), t
            )
        for t, obs in enumerate(seen):
            now, one, two = x[t], x[max(t - 1, 0)], x[max(t - 2, 0)]
            wanted = np.concatenate([now, now - one, one - two, target[t] - now[:2]]) / 42
            np.testing.assert_allclose(obs, [*wanted, min(t, 3) / 3], atol=1e-6)
        assert [of[3] for of in asked] == [0, 1, 2, 3]


def test_what_an_agent_sees_is_never_beyond_eight_half_pictures():
    frames = np.zeros((3, 84, 84, 3), np.uint8)
    tracker = Scripted([[0, 0], [900, -900], [0, 0]], [[0, 0]] * 3)
    env = TrackWrapper(Film(frames), tracker, TrackReward(PATH))
    env.reset(seed=0)
    obs, *_ = env.step(np.zeros(3, np.float32))
    assert obs[:2].tolist() == [8, -8] and env.observation_space.contains(obs)


def test_an_episode_ends_a_quarter_after_the_demonstration_and_never_after_the_tasks_own_end(
    monkeypatch,
):
    """What a film of the robot shows behind it is the wall that the tracker is given."""
    demo, robot = ways()[0], np.full((5, 84, 84, 3), 77, np.uint8)
    for horizon, longest, episode in ((300, 20, 25), (20, 16, 20)):
        stage = gym.make(tasks.id_of("push"), max_episode_steps=horizon, observation="rgb")
        env, reward = follow.watched(stage, demo, robot)
        assert len(reward.d_E) == longest and reward.episode == episode
        assert (env.get_wrapper_attr("tracker").wall == 77).all()
        monkeypatch.setattr(tracks.Tracker, "_look", lambda tracker, frame: None)
        env.reset(seed=0)
        ends = [env.step(np.zeros(3, np.float32))[2:4] for _ in range(episode)]
        assert ends == [(False, False)] * (episode - 1) + [(False, True)]
        env.close()


def test_the_options_of_a_reset_reach_the_task():
    asked = []

    class Asked(Film):
        def reset(self, *, seed=None, options=None):
            asked.append((seed, options))
            return super().reset(seed=seed)

    frames = np.zeros((3, 84, 84, 3), np.uint8)
    env = TrackWrapper(Asked(frames), Scripted([[0, 0]], [[0, 0]]), TrackReward(PATH))
    env.reset(seed=3, options={"scatter": True})
    assert asked == [(3, {"scatter": True})]


def test_an_episode_that_the_task_ends_is_cut_and_never_terminal():
    env = wrapped(ways()[0], ends=3)
    env.reset(seed=0)
    ends = [env.step(np.zeros(3, np.float32))[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]


@pytest.mark.parametrize("task", ["push", "slide", "coffee", "drawer"])
def test_an_idle_robot_earns_less_than_one_that_does_the_task(task):
    """The scripted expert, at its own pace, on the kit's own videos."""
    demo, _ = video.read(tasks.VIDEOS / task / "expert_01.mp4")
    film = tasks.pace_film(task, 0, 100)  # in so many the arm has been away from everywhere
    env, reward = follow.watched(gym.make(tasks.id_of(task), jitter=0.005), demo, film)
    stage, expert = tasks.bare(task, observation="state", jitter=0.005), []
    stage.reset(seed=7)
    for action in expert_actions(stage):
        expert.append(action)
        stage.step(action)
    stage.close()
    earned = []
    for actions in (expert, []):
        env.reset(seed=7)
        total, over = 0.0, False
        for t in range(reward.episode):
            action = actions[t] if t < len(actions) else np.zeros(3, np.float32)
            _, r, _, over, _ = env.step(action)
            total += r
        assert over
        earned.append(total)
    env.close()
    assert earned[1] < earned[0] - 10


def test_the_method_goes_from_a_video_to_a_policy_and_repeats_nothing(tmp_path, monkeypatch):
    demo, _ = video.read(tasks.VIDEOS / "push" / "expert_01.mp4")
    recipe = type(RECIPE)(human_frames=0, robot_frames=0, policy_steps=40)

    def learn():
        env = gym.make(tasks.id_of("push"), jitter=0.005)
        return follow.follow(env, demo, tasks.pace_film("push"), recipe, seed=0, run=Run(tmp_path))

    policy, env = learn()
    obs, _ = env.reset(seed=0)
    assert obs.shape == (15,) and policy.act(obs, deterministic=True).shape == (3,)
    monkeypatch.setattr(sac, "train", lambda *_, **__: pytest.fail("trained again"))
    again, _ = learn()
    np.testing.assert_array_equal(
        again.act(obs, deterministic=True), policy.act(obs, deterministic=True)
    )
    assert set(Run(tmp_path).metrics["stages"]) == {"policy"}


def test_a_run_ends_with_a_page_and_is_replayed(tmp_path, capfd):
    out = tmp_path / "run"
    arguments = ["push", "--method", "tracks", "--threads", "1", "--set", "policy_steps=40"]
    main([*arguments, "--episodes", "1", "--out", str(out)])
    page = (out / "report.html").read_text()
    assert "track, do not translate" in page and "r3" in page and "keypoint" not in page
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["settings"]["recipe"] == {"policy_steps": 40, "updates": 2, "entropy": -1.0}
    assert set(metrics["stages"]) == {"robot_video", "policy"}
    replay = ["push", "--method", "tracks", "--evaluate", "--weights", str(out)]
    main([*replay, "--episodes", "1", "--jitter", "0.04", "--out", str(tmp_path / "replay")])
    assert "A replay" in (tmp_path / "replay" / "report.html").read_text()
    assert capfd.readouterr().out.count("push: ") == 2


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["reach"], "no object rests first and moves later"),
        (["push", "--from-scratch"], "no keypoints"),
        (["push", "--reward", "literal"], "no keypoints"),
        (["push", "--weights", "solutions/weights/push"], "trains all of its networks anew"),
        (["push", "--evaluate"], "name a run by --weights"),
        (["push", "--videos", "3"], "watch one video"),
        (["push", "--device", "cpu"], "on the CPU"),
        (["push", "--set", "K=4"], "has no 'K'"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_does_nothing_here_is_refused_in_a_sentence(arguments, why, tmp_path, capsys):
    out = tmp_path / "run"
    assert main([*arguments, "--method", "tracks", "--out", str(out)]) == 2
    assert not out.exists()
    said = capsys.readouterr().err
    assert why in said and said.count("\n") == 1


def test_a_policy_that_sees_keypoints_is_no_policy_of_tracks(tmp_path, capsys):
    weights = str(tasks.WEIGHTS / "push")
    replay = ["push", "--method", "tracks", "--evaluate", "--weights", weights]
    assert main([*replay, "--out", str(tmp_path / "run")]) == 2
    assert "41 numbers, and 15 come with this method" in capsys.readouterr().err


def test_an_object_followed_for_an_episode_is_told_and_paid_as_it_was(golden):
    """Beside the demonstration's pace, then lost far away, and on after the end of both."""
    path = np.array([[0, 0], [0, 0.2], [1.5, 0.4], [4, 1], [7.5, 1.5], [9, 1], [8, 1]])
    rng, N = np.random.default_rng(4), 12
    d = np.r_[np.zeros((2, 2)), np.cumsum(rng.uniform(-0.5, 2, (N - 2, 2)), 0)]
    d[-3] = 40, -70
    g = np.stack([np.linspace(-12, 3, N), np.linspace(30, -4, N)], 1)
    figures = {}
    for horizon in (None, 6):
        reward = TrackReward(path, horizon=horizon)
        env = TrackWrapper(Film(np.zeros((N, 84, 84, 3), np.uint8)), Scripted(d, g), reward)
        rows, paid, parts = [env.reset(seed=0)[0]], [], []
        for _ in range(N - 1):
            obs, r, *ends, info = env.step(np.zeros(3, np.float32))
            assert ends == [False, False] and obs.dtype == np.float32
            rows.append(obs)
            paid.append(r)
            parts.append([*dict.__getitem__(info, "reward_parts").values()])
        figures[f"{horizon}: told"] = np.array(rows)[[1, 2, 5, 9, 10]].round(4)
        figures[f"{horizon}: paid"] = paid
        figures[f"{horizon}: parts"] = np.round(parts, 5)
        figures[f"{horizon}: of it"] = [
            reward.L, reward.last, reward.episode, *reward.lam, *reward.d_E[-2],
            *(reward.clock(t) for t in (0, 1, 3, 99)),
            *(reward.stretch(np.array(at)) for at in ((0, 0), (3, 1), (-4, 2), (30, 0), (7.3, 0))),
        ]  # fmt: skip
    space = env.observation_space
    figures["space"] = [*space.low[:2], *space.high[:2], *space.shape]
    golden(figures)


def test_what_is_no_path_is_named_with_what_to_give():
    messages = []
    for path in (
        np.zeros((2, 2)),
        np.zeros((5, 3)),
        np.zeros((5, 1, 2)),
        [[0, 0], [1, 0], [2.9, 0]],
    ):
        with pytest.raises(InputError) as told:
            TrackReward(path)
        messages.append(str(told.value))
    assert messages == [
        "path of shape (2, 2): give (N, 2) with N of 3 or more.",
        "path of shape (5, 3): give (N, 2) with N of 3 or more.",
        "path of shape (5, 1, 2): give (N, 2) with N of 3 or more.",
        "the object moves by 2.9 pixels; it takes 3.0.",
    ]
    assert TrackReward([[0, 0], [1, 0], [3.1, 0]]).last == 2
