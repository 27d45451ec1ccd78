"""Numbers that the kit has from elsewhere: the paper's, and those that its own pages state."""

import dataclasses
import json
import re

import numpy as np
import pytest

import tasks
from lbw_minimal import classifier
from lbw_minimal.follow import TrackReward

# Table I: frames of the human and of the robot that the perception learns from.
TABLE_I = {
    "reach": (1056, 3150),
    "push": (398, 1220),
    "slide": (650, 2120),
    "drawer": (986, 2940),
    "coffee": (658, 4007),
}
RESULTS = tasks.ROOT / "solutions" / "results"
README = (tasks.ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("task", tasks.TASKS)
def test_perception_learns_from_as_many_frames_as_in_table_1(task):
    recipe = tasks.module(task).RECIPE
    assert (recipe.human_frames, recipe.robot_frames) == TABLE_I[task]


@pytest.mark.parametrize("task", tasks.TASKS)
def test_a_policy_takes_the_steps_that_readme_says(task):
    steps = re.search(rf"^\| {task} \|.*\| ([\d,]+) \|$", README, re.M).group(1)
    assert tasks.module(task).RECIPE.policy_steps == int(steps.replace(",", ""))


@pytest.mark.parametrize("task", tasks.TASKS)
def test_the_kits_results_are_of_the_kits_recipes(task):
    """Each run in which nothing was set, of each method: all that it says of its recipe."""
    recipe, methods = dataclasses.asdict(tasks.module(task).RECIPE), set()
    runs = [*RESULTS.glob(f"policies/{task}-*"), *RESULTS.glob(f"paper/runs/{task}-*")]
    for run in runs:
        settings = json.loads((run / "metrics.json").read_text(encoding="utf-8"))["settings"]
        if not settings["set"]:
            told = settings["recipe"]
            assert told == {field: recipe[field] for field in told}, run.name
            methods.add(settings.get("method", "lbw"))
    assert methods >= {"lbw", "avid", "classifier"}


@pytest.mark.parametrize("task", tasks.TASKS)
def test_a_policy_is_paid_as_it_was_told_what_reward_it_would_be_watched_with(task):
    """The clip of a recipe is what a replayed policy's reward has, which knows no recipe."""
    assert tasks.module(task).RECIPE.clip == classifier.CLIP


def test_unless_told_otherwise_the_step_counts_three_times_in_the_tracks_reward():
    """An object and an arm that are each half a way off, at a standstill: 3 r2 outweighs."""
    reward = TrackReward([(0, 0), (0, 0), (4, 0), (8, 0)])
    still = np.zeros(2)
    r, parts = reward(still, still, np.array([0.0, 4]), 1)
    assert parts == {"r1": -0.5, "r2": -0.5, "r3": -0.25}
    assert r == pytest.approx(1 * -0.5 + 3 * -0.5 + 1 * -0.25)


@pytest.mark.parametrize("task", tasks.TASKS)
def test_a_tip_comes_down_to_the_bottom_of_its_box_and_no_lower(task):
    """A finger is 15 mm above the table at its lowest, but before the drawer's handle."""
    env = tasks.bare(task, observation="state")
    env.reset(seed=0)
    for _ in range(40):
        env.step(np.array([0.0, 0, -1]))
    assert env.arm.tip_pose()[0][2] == pytest.approx({"drawer": 0.03}.get(task, 0.015), abs=1e-3)
    env.close()
