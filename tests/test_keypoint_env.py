"""A task as the paper's agent sees it, made from its name, for agents from elsewhere."""

import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import tasks
from lbw_minimal.training import InputError

README = (Path(__file__).resolve().parent.parent / "tasks" / "README.md").read_text()
K = 5


@pytest.fixture(scope="module", params=["mended", "literal", None])
def made(request):
    env = tasks.keypoint_env("push", request.param, jitter=0.005)
    yield request.param, env
    env.close()


def test_gymnasium_has_nothing_to_complain_about(made):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", "(?s).*is different from the unwrapped version")
        check_env(made[1], skip_render_check=True)


def test_its_spec_builds_it_again(made):
    _, env = made
    again = env.spec.make()
    np.testing.assert_array_equal(again.reset(seed=3)[0], env.reset(seed=3)[0])
    action = env.action_space.sample()
    assert again.step(action)[1] == env.step(action)[1]
    again.close()


def test_only_the_mended_reward_adds_to_the_keypoints(made):
    reward, env = made
    assert env.observation_space.shape == ((8 * K + 1,) if reward == "mended" else (2 * K,))
    assert env.spec.kwargs["jitter"] == 0.005


def test_what_a_policy_may_see_is_bounded_by_what_differences_can_be(made):
    """Keypoints lie in -1 to 1, so the three differences of the mended reward in -2 to 2."""
    reward, env = made
    space, parts = env.observation_space, 3 if reward == "mended" else 0
    bound = np.repeat([1, 2], [2 * K, 2 * K * parts])
    np.testing.assert_array_equal(space.low[: len(bound)], -bound)
    np.testing.assert_array_equal(space.high[: len(bound)], bound)


def test_what_an_idle_robot_earns(made):
    """Nothing from the task, which it does not do; less than nothing for not following."""
    reward, env = made
    env.reset(seed=0)
    steps = [env.step(np.zeros(3, np.float32)) for _ in range(3)]
    earned = [r for _, r, *_ in steps]
    assert earned == [0, 0, 0] if reward is None else max(earned) < 0
    assert all(("reward_parts" in info) == (reward is not None) for *_, info in steps)


def test_an_episode_ends_when_nothing_is_left_to_do(made):
    _, env = made
    env.reset(seed=0)
    over, steps = False, 0
    while not over:
        *_, terminated, truncated, _ = env.step(np.zeros(3, np.float32))
        over, steps = terminated or truncated, steps + 1
    assert truncated and steps <= tasks.module("push").HORIZON


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(("pull",), "pull: there is no such task; choose one of"), (("push", "sparse"), "'sparse'")],
)
def test_unknown_task_and_reward_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        tasks.keypoint_env(*arguments)


@pytest.mark.peers
def test_stable_baselines_trains_on_it_in_the_lines_of_the_readme():
    pytest.importorskip("stable_baselines3", reason="needs stable-baselines3: make peers")
    (lines,) = re.findall(r"(?:^    .*\n)*^    .*stable_baselines3.*\n(?:^    .*\n)*", README, re.M)
    code = re.sub("^    ", "", lines, flags=re.M)
    assert len(code.splitlines()) == 6 and "learn(3_000)" in code
    names = {}
    exec(code.replace("learn(3_000)", "learn(300)"), names)  # the test is whether it runs
    assert names["agent"].num_timesteps == 300
    assert names["env"].action_space.contains(names["action"])
