"""Under each change the policy sees the changed picture, and nothing else changes."""

from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
from digests import options

import tasks
from lbw_minimal import sac
from lbw_minimal.training import InputError
from tasks.commands import JITTER, controls, robustness


@pytest.fixture(scope="module")
def seen():
    """What the policy is shown first under each change of push's scene, and what was asked."""
    first, asked = {}, []

    def watched(env, perception, robot):
        asked.append((perception, robot, env.unwrapped.jitter))
        return env, None

    def evaluate(policy, env, episodes):
        first[len(first)] = env.reset(seed=0)[0].astype(int)
        return [{"success": i < 2} for i in range(episodes)], None, None

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(robustness, "watched", watched)
        patch.setattr(robustness, "evaluate", evaluate)
        patch.setattr(tasks, "trained_perception", lambda task, weights: "perception")
        patch.setattr(tasks, "pace_film", lambda task, seed: seed)
        patch.setattr(robustness.sac, "load", lambda path: None)
        patch.setattr(robustness, "refuse_strangers", lambda *_: None)
        wins = robustness.robustness("push", tasks.WEIGHTS, episodes=3, seed=5)
    assert wins == dict.fromkeys(robustness.CHANGES, 2)
    return dict(zip(wins, first.values(), strict=True)), asked


def test_every_change_meets_the_same_starts_perception_and_pace(seen):
    assert seen[1] == 8 * [("perception", 5, JITTER)]


def test_light_and_camera_change_what_is_seen(seen):
    views, plain = seen[0], seen[0]["as trained"]
    assert (views["a fifth darker"] == (0.8 * plain).astype(int)).all()
    assert (views["a fifth brighter"] == np.minimum(1.2 * plain, 255).astype(int)).all()
    assert (views["camera 1 px down"][1:] == plain[:-1]).all()
    assert (views["camera 1 px up"][:-1] == plain[1:]).all()
    assert (views["camera 2 px right"][:, 2:] == plain[:, :-2]).all()
    assert (views["camera 2 px left"][:, :-2] == plain[:, 2:]).all()


def test_a_blue_object_is_blue_and_the_rest_as_it_was(seen):
    blue, plain = seen[0]["object blue"], seen[0]["as trained"]
    changed = (blue != plain).any(-1)
    assert 20 < changed.sum() < 200
    assert (blue[changed][:, 2] > blue[changed][:, 0]).mean() > 0.8
    assert (plain[changed][:, 0] > plain[changed][:, 2]).mean() > 0.8


def test_changes_of_a_picture_are_what_they_were(golden):
    """Of a picture that is lighter to the right and down, higher than wide, bright at a place."""
    frame = np.arange(6)[:, None, None] * 30 + np.arange(4)[:, None] * 12 + np.array([0, 5, 40])
    frame[2, 1] = 250
    given = frame.astype(np.uint8)
    changes = {name: change(given) for name, change in robustness.CHANGES.items()}
    changes |= {str(by): robustness.moved(*by)(given) for by in ((1, 2), (-3, -1))}
    changes |= {str(gain): robustness.brighter(gain)(given) for gain in (0.33, 1.7)}
    assert all(change.dtype == np.uint8 for change in changes.values())
    np.testing.assert_array_equal(given, frame)  # what was given stays
    golden(
        {name: change.transpose(2, 0, 1)[::2, ::2] for name, change in changes.items()}
        | {
            "options": list(options(robustness.parser())),
            "says": robustness.parser().description,
            "blue": robustness.BLUE,
        }
    )


def test_all_parts_of_a_colour_are_painted_and_counted():
    """A mug and its handle are four parts, in the robot's world; green and grey stay."""
    env = tasks.bare("coffee", observation="state")
    p = env.world.p

    def colours():
        shapes = [s for i in range(p.getNumBodies()) for s in p.getVisualShapeData(i)]
        return np.array([s[7] for s in shapes])

    before = colours()
    assert robustness.paint(env.world, (0.3, 0.9, 0.1, 1), (0, 0, 1, 1)) == 0
    assert robustness.paint(env.world, robustness.RED, robustness.BLUE) == 4
    changed = (before != colours()).any(1)
    assert changed.sum() == 4 and np.allclose(before[changed], robustness.RED, atol=0.01)
    np.testing.assert_allclose(colours()[changed], [robustness.BLUE] * 4, atol=1e-6)
    assert robustness.paint(env.world, np.add(robustness.BLUE, 0.009), (0, 0, 0, 1)) == 4
    assert robustness.paint(env.world, (0.012, 0, 0, 1), (1, 1, 1, 1)) == 0  # farther than 0.01
    env.close()


def test_what_came_of_each_change_is_a_row_with_its_interval(monkeypatch, capsys, tmp_path):
    asked = []
    monkeypatch.setattr(
        robustness, "robustness", lambda *of: asked.append(of) or {"as trained": 7, "darker": 0}
    )
    robustness.main(["push", "--episodes", "8", "--seed", "3", "--weights", str(tmp_path)])
    assert asked == [("push", tmp_path, 8, 3)]
    assert capsys.readouterr().out == (
        "| push | success | 95 % interval |\n| --- | --- | --- |\n"
        "| as trained | 7/8 | 53-98 % |\n| darker | 0/8 | 0-32 % |\n"
    )


@pytest.mark.parametrize("command", [controls, robustness])
def test_a_policy_that_learnt_by_another_reward_is_refused(command, tmp_path, monkeypatch):
    """The literal reward's sees the keypoints alone, ten numbers; the mended one's sees 41."""
    space = gym.spaces.Box(-1, 1, (41,))
    world = SimpleNamespace(unwrapped=SimpleNamespace(world=None), observation_space=space)
    sac.save(tmp_path / "policy.safetensors", sac.SAC(10, 3))
    monkeypatch.setattr(tasks, "trained_perception", lambda *_: None)
    monkeypatch.setattr(tasks, "pace_film", lambda *_: None)
    monkeypatch.setattr(command.gym, "make", lambda *_, **__: world)
    monkeypatch.setattr(command, "watched", lambda *_: (world, None))
    monkeypatch.setattr(robustness, "TransformObservation", lambda env, *_: env)
    with pytest.raises(InputError) as told:
        if command is controls:
            controls.compare("push", tmp_path, 0.01, 1, 0, {})
        else:
            robustness.robustness("push", tmp_path, 1)
    assert str(told.value) == (
        f"{tmp_path}: that policy sees 10 numbers, and 41 come with the mended reward; give one "
        "that learnt by that."
    )
