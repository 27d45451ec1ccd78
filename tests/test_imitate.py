"""The method as a whole, on data too small to learn anything from."""

from dataclasses import replace

import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from toy_push import ToyPush

from lbw_minimal.imitate import (
    Perception,
    Recipe,
    Run,
    learn_perception,
    load_perception,
    make_reward,
    watched,
)
from lbw_minimal.munit import MUNIT
from lbw_minimal.training import InputError
from lbw_minimal.transporter import Transporter
from tasks import TASKS, WEIGHTS

TINY = Recipe(
    human_frames=6, robot_frames=6, munit_iterations=1, munit_width=4, transporter_iterations=1
)


def frames(n):
    return np.random.default_rng(n).integers(0, 256, (n, 84, 84, 3), np.uint8)


def test_one_video_alone_may_be_the_whole_human_domain(tmp_path):
    nothing = frames(6)[:0]
    P = learn_perception(
        frames(6), nothing, frames(7), TINY, task="push", seed=0, run=Run(tmp_path)
    )
    P.watch(frames(6))
    assert P.translated.shape == (6, 84, 84, 3) and P.z_E.shape == (6, TINY.K, 2)


def test_a_finished_stage_is_loaded_and_not_trained_again(tmp_path):
    arguments = (frames(6), frames(8), frames(7), TINY)
    first = learn_perception(*arguments, task="push", seed=0, run=Run(tmp_path))
    again = learn_perception(*arguments, task="push", seed=1, run=Run(tmp_path))
    loaded = load_perception(tmp_path, "push")
    for other in (again, loaded):
        np.testing.assert_array_equal(other.detect(frames(3)), first.detect(frames(3)))
    assert set(Run(tmp_path).metrics["stages"]) == {"translation", "keypoints"}
    assert not list(tmp_path.glob("*.checkpoint"))


@pytest.fixture(scope="module")
def watcher():
    """Perception whose detector is a formula, after a demonstration in which everything moves."""
    way = np.cumsum(np.random.default_rng(0).normal(size=(30, 2, 2)) * 0.03, axis=0)
    perception = Perception(None, None, None)
    perception.z_E = way
    perception.detect = lambda frames: np.cumsum(np.full((len(frames), 2, 2), 0.02), axis=0)
    return perception


def test_the_robots_pace_is_that_of_400_frames(watcher):
    asked = []
    watcher = replace(watcher)
    watcher.z_E = np.cumsum(np.full((30, 2, 2), 0.02), axis=0)
    watcher.detect = lambda frames: (
        asked.append(len(frames)) or np.cumsum(np.full((len(frames), 2, 2), 0.02), axis=0)
    )
    make_reward(watcher, np.zeros((500, 84, 84, 3), np.uint8))
    assert asked == [400]


@pytest.mark.parametrize("task", TASKS)
def test_a_training_has_the_sizes_of_the_shipped_perception(task):
    perception = load_perception(WEIGHTS / task, task)
    assert perception.translator.sizes == MUNIT().sizes
    assert perception.detector.K == Transporter().K == 5


def test_a_form_of_reward_that_does_not_exist_is_refused(watcher):
    with pytest.raises(InputError, match="reward form 'sparse': choose 'literal' or 'mended'"):
        make_reward(watcher, frames(6), "sparse")


def test_one_mend_is_left_out_and_the_others_stay(watcher):
    late, early = (make_reward(watcher, frames(6), without=m) for m in ("timed", "include_goal"))
    assert not late.timed and early.timed and late.last == early.last + 1


@pytest.mark.parametrize("horizon", [20, 1000, None])
def test_an_episode_ends_where_the_task_or_the_demonstration_does(watcher, horizon):
    env = ToyPush()
    env.spec = horizon and EnvSpec("Toy-v0", max_episode_steps=horizon)
    env.horizon = 10**6
    env, reward = watched(env, watcher, frames(6))
    env.reset(seed=0)
    steps, over = 0, False
    while not over:
        *_, over, _ = env.step(np.zeros(3, np.float32))
        steps += 1
    assert steps == (20 if horizon == 20 else reward.episode)
    # 80 % of the 20 steps are the demonstration's; without such haste it takes longer.
    assert (len(reward.z_E) == 16) == (horizon == 20)
