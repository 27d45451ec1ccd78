"""Under each change the policy sees the changed picture, and nothing else changes."""

import numpy as np
import pytest

import tasks
from tasks.commands import JITTER, robustness


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
