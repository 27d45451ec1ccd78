"""The method as a whole, on data too small to learn anything from."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from gymnasium.envs.registration import EnvSpec
from toy_push import ToyPush

from lbw_minimal import munit, sac, transporter
from lbw_minimal.imitate import (
    Perception,
    Recipe,
    Run,
    imitate,
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


def test_a_demonstration_that_is_not_hurried_ends_with_the_task(watcher):
    env = ToyPush()
    env.spec = EnvSpec("Toy-v0", max_episode_steps=3)
    env, reward = watched(env, watcher, frames(6), "literal")
    env.reset(seed=0)
    over = [env.step(np.zeros(3, np.float32))[3] for _ in range(3)]
    assert over == [False, False, True] and reward.episode > 3


def level(frames):
    return int(frames[0, 0, 0, 0])


def flat(grey, n=5):
    return np.full((n, 84, 84, 3), grey, np.uint8)


def test_each_stage_learns_from_the_frames_and_numbers_that_are_its_own(tmp_path, monkeypatch):
    """Demonstration 10, random motion 20, robot 200; translated, human frames are 100 brighter."""
    given = {}
    model = MUNIT(2)
    monkeypatch.setattr(munit, "train", lambda *a, **k: given.update(munit=(a, k)) or (model, []))
    monkeypatch.setattr(
        munit, "robot_style", lambda T, frames: given.update(style=frames) or torch.zeros(8)
    )
    monkeypatch.setattr(munit, "translate", lambda T, frames, style: frames + 100)
    monkeypatch.setattr(
        transporter, "train", lambda *a, **k: given.update(psi=(a, k)) or (Transporter(7), [])
    )
    recipe = replace(
        TINY, munit_iterations=11, munit_width=12, transporter_iterations=13, K=7, shift=2, hue=3
    )
    learn_perception(
        flat(10), flat(20, 7), flat(200), recipe, task="push", seed=4, run=Run(tmp_path)
    )
    (human, robot), options = given["munit"]
    assert (level(human), level(human[5:]), len(human), level(robot)) == (10, 20, 12, 200)
    asked = {name: options[name] for name in ("iterations", "width", "seed")}
    assert asked == {"iterations": 11, "width": 12, "seed": 4}
    assert level(given["style"]) == 200
    (videos,), options = given["psi"]
    assert [level(video) for video in videos] == [110, 120, 200]
    del options["checkpoint"], options["device"]
    assert options == {"iterations": 13, "K": 7, "shift": 2, "hue": 3, "seed": 4}


def test_the_trajectory_is_that_of_the_translated_demonstration():
    perception = Perception("T", "s", "Psi")
    perception.translate = lambda frames: frames + 100
    perception.detect = lambda frames: frames[:, :1, :1, 0] / 255
    perception.watch(flat(10))
    assert level(perception.translated) == 110 and perception.z_E[0, 0, 0] == 110 / 255


def test_the_policy_learns_what_the_recipe_says_and_the_reward_that_was_asked_for(
    tmp_path, monkeypatch, watcher
):
    given = {}
    watcher = replace(watcher)
    watcher.z_E = np.cumsum(np.full((30, 2, 2), 0.02), axis=0)
    watcher.watch = lambda demo: given.update(demo=demo)
    watcher.detect = lambda frames: np.cumsum(np.full((len(frames), 2, 2), 0.02), axis=0)
    monkeypatch.setattr(sac, "train", lambda env, **k: given.update(k, env=env) or ("agent", []))
    monkeypatch.setattr(sac, "save", lambda path, agent: given.update(saved=agent))
    monkeypatch.setattr(sac, "load", lambda path: "policy")
    recipe = replace(TINY, policy_steps=77, updates=5, entropy=-2.5)
    for form, timed in (("mended", True), ("literal", False)):
        policy, env = imitate(
            ToyPush(), "demo", frames(6), watcher, recipe, seed=6, run=Run(tmp_path), form=form
        )
        assert policy == "policy" and given["saved"] == "agent" and given["demo"] == "demo"
        asked = {name: given[name] for name in ("steps", "updates", "entropy", "seed")}
        assert asked == {"steps": 77, "updates": 5, "entropy": -2.5, "seed": 6}
        size = env.observation_space.shape[0]
        assert given["env"] is env and size == (4 * 4 + 1 if timed else 4)
    _, env = imitate(
        ToyPush(), "demo", frames(6), watcher, recipe, seed=6, run=Run(tmp_path), without="timed"
    )
    assert env.observation_space.shape == (4,)


def test_a_stage_leaves_its_time_and_none_of_its_files(tmp_path):
    run = Run(tmp_path)
    with run.stage("policy") as checkpoint:
        for name in ("policy.checkpoint", "policy.frames", "policy.safetensors"):
            (tmp_path / name).write_text("")
        checkpoint._start -= 90
    assert run.metrics["stages"]["policy"] == pytest.approx(90, abs=1)
    assert [path.name for path in tmp_path.glob("policy*")] == ["policy.safetensors"]
    assert Run(tmp_path).metrics == run.metrics
