"""The controls: robots that see little or nothing, and what they can and cannot do."""

import json

import gymnasium as gym
import numpy as np
import pytest

import tasks
from lbw_minimal import classifier, rivals, sac_ae
from lbw_minimal.classifier import GoalClassifier
from lbw_minimal.training import InputError
from tasks.commands import JITTER, controls
from tasks.commands.run import TEST_SEED


class Sides(gym.Env):
    """A flag is up on one side, +1 or -1: done after two steps to that side. It blinks off."""

    observation_space = gym.spaces.Box(-1, 1, (2,), np.float32)
    action_space = gym.spaces.Box(-1, 1, (3,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.side, self.x, self.t = self.np_random.choice([-1, 1]), 0, 0
        return np.array([self.side, 0], np.float32), {}

    def step(self, action):
        self.x, self.t = self.x + np.sign(action[0]) * self.side, self.t + 1
        obs = np.array([0, self.t / 4], np.float32)
        return obs, float(self.x), False, self.t == 4, {"is_success": bool(self.x >= 2)}


def side(obs, t):
    """The robot that looks at the flag and remembers."""
    side.of = obs[0] if t == 0 else side.of
    return np.array([side.of, 0, 0], np.float32)


def test_who_looks_wins_and_who_does_not_wins_half():
    env = Sides()
    sides = [np.sign(env.reset(seed=TEST_SEED + i)[0][0]) for i in range(40)]
    assert controls.wins(env, side, 40) == 40
    assert controls.wins(env, controls.constant((1, 0, 0)), 40) == sides.count(1)
    assert controls.wins(env, controls.constant((0, 0, 0)), 40) == 0


def test_one_look_is_enough_where_the_start_tells_all():
    env = Sides()
    own = [controls.play(env, side, i) for i in range(10)]
    firsts, takes = np.stack([o[2] for o in own]), [o[3] for o in own]
    assert set(firsts[:, 0]) == {-1, 1}
    assert controls.wins(env, controls.look_once(firsts, takes), 40) == 40
    assert controls.wins(env, controls.replay(takes[0]), 40) not in (0, 40)


def test_an_episode_is_played_whole_or_to_its_success():
    env = Sides()
    done, total, first, actions = controls.play(env, side, seed=0)
    assert done and total == 1 + 2 + 3 + 4 and actions.shape == (4, 3) and first.shape == (2,)
    assert len(controls.play(env, side, seed=0, whole=False)[3]) == 2


def test_a_success_that_is_lost_again_counts():
    back = controls.replay(np.array([[1, 0, 0], [1, 0, 0], [-1, 0, 0], [-1, 0, 0]], np.float32))
    done = [controls.play(Sides(), back, seed)[0] for seed in range(10)]
    assert any(done) and not all(done)


def test_the_best_robot_is_chosen_on_other_starts_than_the_tests(monkeypatch):
    seeds = []
    monkeypatch.setattr(
        controls, "play", lambda env, robot, seed, whole: (seeds.append(seed) or robot(0, 0) > 0, 0)
    )
    good, bad = (lambda obs, t: 1), (lambda obs, t: -1)
    assert controls.best(Sides(), [bad, good, bad], trials=7) is good
    assert len(set(seeds)) == 7 and min(seeds) >= TEST_SEED + 100_000


def test_eyes_pay_where_intervals_do_not_meet():
    """Wilson's of 100: 95 is 89-98 %, 85 is 77-91 %, 100 is 96-100 %."""

    def note(policy, blind):
        few = dict.fromkeys(controls.BLIND, 0) | {"idle": blind}
        success = {"the policy": policy, "its camera frozen": 99, "looks once, then replays": 99}
        return {"task": "push", "episodes": 100, "success": {"0.005": success | few}}

    def said(*args):
        return controls.eyes_pay([note(*args)]).splitlines()

    assert said(100, 85)[0] == "| of 100 | 5 mm |"
    assert said(100, 85)[2] == "| push | eyes pay: 100 to 85 |"
    assert said(95, 85)[2] == "| push | no: 95 to 85, idle |"
    assert said(0, 90)[2] == "| push | no: 0 to 90, idle |"


def test_tasks_stand_side_by_side_at_one_jitter():
    notes = [
        {"task": task, "episodes": n, "success": {"0.01": {"idle": 0}, "0.02": {"idle": wins}}}
        for task, n, wins in (("reach", 10, 5), ("push", 100, 0))
    ]
    head, _, row = controls.side_by_side(notes, 0.02).splitlines()
    assert head == "| 20 mm | reach | push |"
    assert row == "| idle | 5/10 (24-76 %) | 0/100 (0-4 %) |"


def test_robots_without_eyes_do_what_their_names_say():
    down = controls.down_then_along(2)
    assert [down(None, t).tolist() for t in (0, 1, 2, 9)] == [[0, 0, -1]] * 2 + [[1, 0, 0]] * 2
    again = controls.replay(np.ones((2, 3), np.float32))
    assert [again(None, t).sum() for t in range(4)] == [3, 3, 0, 0]
    random = controls.noise()
    many = np.stack([random(None, t) for t in range(200)])
    assert np.abs(many).max() <= 1 and np.abs(many.mean(0)).max() < 0.2


def test_the_blinded_cameras_show_no_news():
    frozen, grey = (c(gym.make(tasks.id_of("reach"))) for c in (controls.Frozen, controls.Grey))
    first, _ = frozen.reset(seed=0)
    later, *_ = frozen.step(np.ones(3, np.float32))
    np.testing.assert_array_equal(later, first)
    assert (frozen.unwrapped.render_mode is None) and first.std() > 0
    other, _ = frozen.reset(seed=1, options={"scatter": True})
    assert (other != first).any()  # an episode has its own first frame
    assert {int(v) for v in grey.reset(seed=0)[0].flat} == {128}
    frozen.close(), grey.close()


def test_a_rival_is_tested_beside_it_on_the_same_starts(tmp_path, monkeypatch):
    model, starts = GoalClassifier(longest=3), []
    env = rivals.watched(gym.make(tasks.id_of("reach")), model)
    policy, _ = sac_ae.train(env, steps=4, seed=0)
    classifier.save(tmp_path / "classifier.safetensors", model, "reach")
    sac_ae.save(tmp_path / "policy.safetensors", policy)
    whole = controls.play
    monkeypatch.setattr(
        controls,
        "play",
        lambda *a, **k: starts.append((a[0].observation_space.shape, a[2])) or whole(*a, **k),
    )
    assert controls.rival_wins("reach", tmp_path, 0.01, episodes=2) == 0
    assert starts == [((3, 84, 84, 3), TEST_SEED), ((3, 84, 84, 3), TEST_SEED + 1)]
    with pytest.raises(InputError, match="no run of a rival"):
        controls.method_of(tmp_path)
    (tmp_path / "settings.json").write_text('{"method": "avid"}')
    assert controls.method_of(tmp_path) == "AVID-m"


def test_the_shipped_policy_reaches_and_idle_does_not(tmp_path, capsys, monkeypatch):
    whole = controls.measure
    monkeypatch.setattr(controls, "measure", lambda *asked: whole(*asked, brief=True))
    controls.main(["reach", "--episodes", "1", "--jitter", str(JITTER), "--out", str(tmp_path)])
    found = json.loads((tmp_path / "reach.json").read_text())["success"][str(JITTER)]
    assert found["the policy"] == 1 and found["idle"] == 0
    assert len(found) == 9
    shown = capsys.readouterr().out
    assert "| reach | 5 mm |" in shown and "| the policy | 1/1 (21-100 %) |" in shown


def test_the_tables_in_the_results_are_those_of_the_measurements():
    results = tasks.ROOT / "solutions" / "results"
    notes = [json.loads(path.read_text()) for path in (results / "controls").glob("*.json")]
    assert notes and all(note["episodes"] == 100 for note in notes)
    text = (results / "README.md").read_text()
    assert all(controls.table(note) in text for note in notes)
