"""The wrappers: what Gymnasium asks of them, and that only frames reach observation and reward."""

import warnings

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env
from toy_film import Film, play
from toy_push import ToyPush, demonstration, detect, random_frames

from lbw_minimal.classifier import ClassifierReward, GoalClassifier
from lbw_minimal.reward import LiteralReward, MendedReward
from lbw_minimal.sac import train
from lbw_minimal.wrappers import (
    ClassifierRewardWrapper,
    KeypointObservation,
    KeypointRewardWrapper,
)

K = 4


@pytest.fixture(scope="module", params=["mended", "literal"])
def reward(request):
    return LiteralReward(z_E()) if request.param == "literal" else timed()


def z_E():
    return detect(demonstration())


def timed():
    return MendedReward(z_E(), detect(random_frames(300)), horizon=50)


def wrap(env, reward):
    return KeypointRewardWrapper(KeypointObservation(env, detect), reward)


def test_gymnasium_has_nothing_to_complain_about(reward):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings(
            "ignore", "(?s).*is different from the unwrapped version"
        )  # they are wrappers
        check_env(wrap(ToyPush(), reward), skip_render_check=True)
        check_env(KeypointObservation(ToyPush(), detect), skip_render_check=True)


def test_observation_is_x_y_of_one_keypoint_after_the_other():
    z, _ = KeypointObservation(ToyPush(), detect).reset(seed=0)
    assert (
        z.dtype == np.float32
        and (z.reshape(K, 2) == detect(ToyPush().reset(seed=0)[0][None])[0]).all()
    )


def test_a_keypoint_off_the_image_is_put_on_its_edge():
    env = KeypointObservation(ToyPush(), lambda frames: np.full((len(frames), K, 2), 1.5))
    assert (env.reset()[0] == 1).all()


def test_the_wrapper_pays_what_the_reward_says_of_the_two_frames(reward):
    frames = demonstration()
    _, paid = play(wrap(Film(frames), reward))
    z = detect(frames)
    assert paid.tolist() == pytest.approx(
        [reward(z[t], z[t + 1], t)[0] for t in range(20)], abs=1e-5
    )


def test_observation_and_reward_are_functions_of_the_frames(reward):
    """Another world with the same pictures, closed and paying 1,000 a step: no difference."""
    frames = demonstration()
    poor, rich = play(wrap(Film(frames), reward)), play(wrap(Film(frames, reward=1000.0), reward))
    assert (poor[0] == rich[0]).all() and (poor[1] == rich[1]).all()


def test_a_difference_in_the_frames_changes_observation_and_reward(reward):
    frames = demonstration()
    puckless = np.where(frames == 240, 0, frames)
    one, other = (play(wrap(Film(f), reward)) for f in (frames, puckless))
    assert not (one[0] == other[0]).all() and not (one[1] == other[1]).all()


def test_literal_policy_sees_keypoints_alone(reward):
    size = wrap(ToyPush(), reward).observation_space.shape
    assert size == ((8 * K + 1,) if reward.timed else (2 * K,))


def test_timed_observation_tells_the_way_to_the_demonstration_and_the_clock():
    reward = timed()
    env = wrap(Film(demonstration()), reward)
    observations, _ = play(env, 12)
    for t in (2, 11):  # at first all rests
        z, moved, before, way, clock = np.split(observations[t], [2 * K, 4 * K, 6 * K, 8 * K])
        np.testing.assert_array_equal(moved, z - observations[t - 1][: 2 * K])
        np.testing.assert_array_equal(before, observations[t - 1][2 * K : 4 * K])
        assert (z + way).reshape(K, 2) == pytest.approx(reward.z_E[t + 1], abs=1e-6)
        assert clock[0] == pytest.approx(t / (len(reward.z_E) - 1))
    assert np.abs(moved).max() > 1e-3
    assert not observations[0][2 * K : 6 * K].any()  # nothing has moved at the start


def test_the_clock_starts_again_with_every_episode():
    env = wrap(ToyPush(), timed())
    first, second = play(env)[1], play(env)[1]
    assert (first == second).all()


def test_reward_parts_are_told_beside_the_environments_own_info(reward):
    env = wrap(ToyPush(), reward)
    env.reset(seed=0)
    _, r, _, _, info = env.step(np.zeros(3, np.float32))
    assert (
        r == pytest.approx(info["reward_parts"]["r1"] + info["reward_parts"]["r2"])
        and "is_success" in info
    )


def test_an_end_of_the_task_is_no_end_worth_reaching(reward):
    """Rewards are negative: if nothing came after it, losing the object early would pay best."""

    class Lost(Film):
        def step(self, action):
            frame, paid, _, truncated, info = super().step(action)
            return frame, paid, self.t == 3, truncated, info

    env = wrap(Lost(demonstration()), reward)
    env.reset(seed=0)
    ends = [env.step(np.zeros(3, np.float32))[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]


def goal_reward():
    torch.manual_seed(0)
    return ClassifierReward(GoalClassifier())


def test_gymnasium_has_nothing_to_complain_about_in_the_classifiers_wrapper():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", "(?s).*is different from the unwrapped version")
        check_env(ClassifierRewardWrapper(ToyPush(), goal_reward()), skip_render_check=True)


def test_the_classifier_pays_for_the_frame_a_step_led_to_and_for_nothing_else():
    frames, reward = demonstration(), goal_reward()
    seen, paid = play(ClassifierRewardWrapper(Film(frames, reward=1000.0), reward))
    assert (seen == frames[:21]).all()
    expected = [reward(frame)[0] for frame in frames[1:21]]
    assert paid.tolist() == expected and len(set(expected)) > 10


def test_the_classifiers_wrapper_cuts_an_episode_and_tells_the_logit():
    class Lost(Film):
        def step(self, action):
            frame, paid, _, truncated, _ = super().step(action)
            return frame, paid, self.t == 2, truncated, {"is_success": True}

    env = ClassifierRewardWrapper(Lost(demonstration()), goal_reward())
    env.reset(seed=0)
    assert env.step(np.zeros(3, np.float32))[2:4] == (False, False)
    _, paid, terminated, truncated, info = env.step(np.zeros(3, np.float32))
    assert (terminated, truncated) == (False, True) and info["is_success"]
    assert info["reward_parts"]["logit"] == pytest.approx(10 * paid)  # too near 0 to be clipped


def test_our_agent_trains_on_it(reward):
    _, log = train(wrap(ToyPush(), reward), steps=100, seed=0, random_steps=50, width=8, batch=8)
    assert np.isfinite(log[-1]["critic_loss"]) and log[-1]["r1"] < 0


@pytest.mark.peers
def test_stable_baselines_trains_on_it(reward):
    """Any agent that speaks Gymnasium can train on the kit; this one from outside."""
    sb3 = pytest.importorskip("stable_baselines3", reason="needs stable-baselines3: make peers")
    env = wrap(gym.wrappers.TimeLimit(ToyPush(), 50), reward)
    agent = sb3.SAC(
        "MlpPolicy", env, learning_starts=50, policy_kwargs={"net_arch": [16, 16]}, seed=0
    )
    agent.learn(100)
    action, _ = agent.predict(env.reset(seed=0)[0], deterministic=True)
    assert env.action_space.contains(action)


class Tells(gym.Env):
    """Tells what is asked of it, and ends as it is told to. A reset does not look like a step."""

    observation_space = gym.spaces.Box(0, 255, (84, 84, 3), np.uint8)
    action_space = gym.spaces.Box(-1, 1, (3,), np.float32)

    def __init__(self, ends=(False, False)):
        self.ends, self.asked = ends, []

    def reset(self, *, seed=None, options=None):
        self.asked.append((seed, options))
        self.t = 0
        return self.frame(), {"started": True}

    def step(self, action):
        self.asked.append(np.asarray(action).tolist())
        self.t += 1
        return self.frame(), 99.0, *self.ends, {"is_success": self.t == 2, "t": self.t}

    def frame(self):
        return np.full((84, 84, 3), 9 * self.t, np.uint8)


def eye(frames):
    """Keypoints (B, 3, 2) that go their own ways as a frame gets lighter, one out of it."""
    t = frames[:, 0, 0, 0].astype(float)[:, None, None] / 9
    return np.array([[0.1, -0.2], [0.6, 0.3], [-0.5, 0.05]]) + t * [
        [0.02, 0.01], [0.15, -0.03], [-0.07, 0.04],
    ]  # fmt: skip


def demonstrated(n=9):
    t = np.arange(n)[:, None, None]
    return np.array([[0.1, -0.2], [0.5, 0.3], [-0.4, 0.1]]) + t * 0.03 * np.array(
        [[1, 0.5], [2, -1], [-1, 3]]
    )


@pytest.mark.parametrize("form", ["mended", "untimed", "literal"])
def test_an_episode_is_told_and_paid_as_it_was(form, golden):
    z = demonstrated(25)
    switches = {"trim": False, "timed": form == "mended"}
    reward = LiteralReward(z) if form == "literal" else MendedReward(z, z, **switches)
    env = KeypointRewardWrapper(KeypointObservation(Tells(), eye), reward)
    rows, paid, infos = [env.reset(seed=3, options={"scatter": True})[0]], [], []
    for t in range(26):
        obs, r, *ends, info = env.step(np.full(3, t / 25))
        assert ends == [False, False] and env.observation_space.contains(obs)
        rows.append(obs)
        paid.append(r)
        infos.append(info)
    again, info = env.reset()
    assert info == {"started": True} and env.unwrapped.asked[0] == (3, {"scatter": True})
    np.testing.assert_array_equal(again, rows[0])
    space = env.observation_space
    golden(
        {
            "told": np.array(rows)[[0, 1, 2, 3, 7, 26]].round(5),
            "paid": paid[::3],
            "parts": [info["reward_parts"]["r1"] for info in infos][::3],
            "beside": [str(sorted(infos[1])), str(infos[1]["is_success"]), str(infos[2]["t"])],
            "bounds": [space.low, space.high],
            "type": str(space.dtype),
            "asked": str(env.unwrapped.asked[2]),
        }
    )


@pytest.mark.parametrize("ends", [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize("kind", ["keypoints", "classifier"])
def test_however_a_task_ends_the_episode_is_cut(kind, ends):
    class Goal:
        def __call__(self, frame):
            return frame.mean() / 10, {"logit": float(frame.mean())}

    env = Tells(ends)
    if kind == "keypoints":
        env = KeypointRewardWrapper(KeypointObservation(env, eye), LiteralReward(demonstrated()))
    else:
        env = ClassifierRewardWrapper(env, Goal())
    env.reset()
    obs, r, terminated, truncated, info = env.step(np.zeros(3))
    assert (terminated, truncated) == (False, True)
    if kind == "classifier":
        assert r == 0.9 and obs.mean() == 9  # of the frame that the step led to
        assert info == {"is_success": False, "t": 1, "reward_parts": {"logit": 9.0}}
