"""The tasks as environments: the contract with Gymnasium, fairness, and repeatability."""

import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import tasks
from tasks.world import expert_actions, record_random

IDS = [f"LbW-{name.capitalize()}-v0" for name in tasks.TASKS]
EMBODIMENTS = ("robot", "human")


def make(id, **options):
    return gym.make(id, **options)


@pytest.mark.parametrize("embodiment", EMBODIMENTS)
@pytest.mark.parametrize("id", IDS)
def test_gymnasium_has_nothing_to_complain_about(id, embodiment):
    env = make(id, embodiment=embodiment, render_mode="rgb_array").unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env)
    env.close()


@pytest.mark.parametrize("id", IDS)
def test_standing_still_solves_nothing(id):
    env = make(id, observation="state", jitter=0.005)
    for seed in range(20):
        _, info = env.reset(seed=seed)
        assert not info["is_success"]
        done = False
        while not done:
            _, _, _, done, info = env.step(np.zeros(3))
            assert not info["is_success"]
    env.close()


@pytest.mark.parametrize("id", [id for id in IDS if "Reach" not in id])
def test_random_actions_seldom_solve_it(id):
    """Independent random actions, and the held ones that cover the table, 100 episodes together."""
    env = make(id, observation="state", jitter=0.005)
    env.action_space.seed(0)
    rng, solved = np.random.default_rng(0), 0
    for seed in range(100):
        env.reset(seed=seed)
        held, done, success = tasks.world.random_actions(rng), False, False
        while not done:
            action = next(held) if seed % 2 else env.action_space.sample()
            _, _, _, done, info = env.step(action)
            success |= info["is_success"]
        solved += success
    env.close()
    assert solved <= 5


@pytest.mark.parametrize("embodiment", EMBODIMENTS)
@pytest.mark.parametrize("id", IDS)
def test_the_scripted_expert_always_succeeds(id, embodiment):
    env = make(id, embodiment=embodiment, observation="state", jitter=0.005)
    for seed in range(100):
        env.reset(seed=seed)
        for action in expert_actions(env.unwrapped, np.random.default_rng(seed)):
            _, _, _, late, info = env.step(action)
            assert not late or info["is_success"]
        assert info["is_success"], f"seed {seed}"
    env.close()


@pytest.mark.parametrize("id", IDS)
def test_reset_number_20_equals_reset_number_1(id):
    def episode(env):
        frames = [env.reset(seed=7)[0]]
        for action in expert_actions(env.unwrapped):
            frames.append(env.step(action)[0])
        return np.stack(frames)

    env = make(id)
    first = episode(env)
    for seed in range(18):
        env.reset(seed=seed)
        for _ in range(5):
            env.step(env.action_space.sample())
    np.testing.assert_array_equal(episode(env), first)
    env.close()


def test_two_environments_do_not_disturb_each_other():
    def frames(env, other=None):
        out = [env.reset(seed=3)[0]]
        if other is not None:
            other.reset(seed=4)
        for action in expert_actions(env.unwrapped):
            out.append(env.step(action)[0])
            if other is not None:
                other.step(-action)
        return np.stack(out)

    a, b = make("LbW-Push-v0"), make("LbW-Push-v0", embodiment="human")
    np.testing.assert_array_equal(frames(a), frames(a, b))


def test_the_same_seed_gives_the_same_frames_in_two_processes():
    code = (
        "import hashlib, tasks, tasks.world, gymnasium as gym; "
        "env = gym.make('LbW-Push-v0').unwrapped; "
        "frames, _ = tasks.world.record_random(env, 60, seed=5); "
        "print(hashlib.sha256(frames.tobytes()).hexdigest())"
    )
    out = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True) for _ in range(2)]
    assert len(out[0].stdout) == 65, "one line, and nothing from PyBullet"
    assert out[0].stdout == out[1].stdout


def test_random_data_moves_the_cube():
    env = make("LbW-Push-v0", observation="state").unwrapped
    _, truth = record_random(env, 1000, seed=0)
    moved = np.abs(np.diff(truth[:, 2])) > 0.2
    assert truth[:, 2].std() > 5  # pixels
    assert moved.mean() > 0.06  # of all steps
