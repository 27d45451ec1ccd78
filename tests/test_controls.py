"""The controls: robots that see little or nothing, and what they can and cannot do."""

import json
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
from digests import options

import tasks
from lbw_minimal import classifier, rivals, sac, sac_ae
from lbw_minimal.classifier import GoalClassifier
from lbw_minimal.training import InputError
from tasks.commands import JITTER, controls, job
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


@pytest.fixture
def compared(monkeypatch):
    """`compare` on a world of names: who played where, with which seeds; takes are numbered."""
    played, films = [], []

    class World(gym.Env):
        observation_space = action_space = gym.spaces.Box(-1, 1, (3,), np.float32)

        def __init__(self, name, jitter):
            self.name, self.jitter, self.limit = name, jitter, None

    def make(id, jitter, observation="rgb"):
        return World({"rgb": "seen", "state": "blind"}[observation], jitter)

    def camera(name):
        return lambda env: World(name, env.jitter)

    def wins(env, robot, episodes, seed=TEST_SEED):
        played.append((env.name, env.jitter, episodes, seed, env.limit, robot))
        return len(played)

    def play(env, robot, seed, whole=True):
        i = seed - controls.TRIAL_SEED
        assert whole and env.name == "seen"
        # (done, return, first observation, actions): take 1 earns most, and fails.
        return i != 1, [3.0, 9.0, 7.0, 5.0][i], np.full(3, i), np.full((2, 3), i)

    def limited(env, steps):
        env.limit = steps
        return env

    reward, policy = SimpleNamespace(episode=17), SimpleNamespace(act=trained, sizes={"obs_dim": 3})
    monkeypatch.setattr(controls.tasks, "trained_perception", lambda task, weights: "perception")
    monkeypatch.setattr(controls.tasks, "pace_film", lambda *asked: films.append(asked) or "film")
    monkeypatch.setattr(controls.sac, "load", lambda path: policy)
    monkeypatch.setattr(controls.gym, "make", make)
    monkeypatch.setattr(controls, "watched", lambda env, perception, film: (env, reward))
    monkeypatch.setattr(controls, "rival_wins", lambda *asked: asked)
    for name, value in {"Frozen": camera("frozen"), "Grey": camera("grey"), "wins": wins,
                        "play": play, "TimeLimit": limited}.items():  # fmt: skip
        monkeypatch.setattr(controls, name, value)
    beside = {"AVID-m": tasks.ROOT / "avid"}
    found = controls.compare("push", tasks.ROOT, 0.01, 50, 3, beside, library=4, trials=2)
    assert films == [("push", 3)]
    return found, played


def trained(obs, deterministic):
    return np.full(3, 0.5) if deterministic else np.zeros(3)


def test_each_control_plays_where_its_name_says_on_the_tests_starts(compared):
    found, played = compared
    tests = {name: played[n - 1] for name, n in found.items() if name != "AVID-m"}
    assert {name: test[0] for name, test in tests.items()} == {
        "the policy": "seen", "its camera frozen": "frozen", "its camera grey": "grey",
        "looks once, then replays": "frozen", "blind replay of its best episode": "blind",
        "best constant action": "blind", "down, then along": "blind", "random actions": "blind",
        "idle": "blind",
    }  # fmt: skip
    assert all(test[1:4] == (0.01, 50, TEST_SEED) for test in tests.values())
    # A blind robot has no more time than the policy.
    assert all((test[4] == 17) == (test[0] == "blind") for test in tests.values())
    assert found["AVID-m"] == ("push", tasks.ROOT / "avid", 0.01, 50)


def test_each_control_does_what_its_name_says(compared):
    found, played = compared
    does = {name: played[n - 1][5] for name, n in found.items() if name != "AVID-m"}
    for name in ("the policy", "its camera frozen", "its camera grey"):
        assert does[name](None, 0).tolist() == [0.5, 0.5, 0.5]  # without noise
    # Of takes that did the task the one that earned most; a look finds the nearest of them.
    assert does["blind replay of its best episode"](None, 0).tolist() == [2, 2, 2]
    looks = does["looks once, then replays"]
    assert [looks(np.full(3, x), 0)[0] for x in (0.2, 1.2, 2.9)] == [0, 2, 3]
    assert does["idle"](None, 0).tolist() == [0, 0, 0]
    assert 0 < np.abs(does["random actions"](None, 0)).max() <= 1


def test_blind_robots_are_chosen_among_constants_in_the_plane_and_times_to_turn(compared):
    """Eight directions in the plane that the camera sees, and eight numbers of steps down."""
    _, played = compared
    trials = [p for p in played if p[3] == controls.TRIAL_SEED]
    assert all(p[0] == "blind" and p[2] == 2 and p[4] == 17 for p in trials)
    constants = {tuple(p[5](None, 0)) for p in trials[:8]}
    assert len(constants) == 8 and all(y == 0 and (x, z) != (0, 0) for x, y, z in constants)
    turns = [next(t for t in range(99) if p[5](None, t)[0] == 1) for p in trials[8:]]
    assert turns == [3, 6, 9, 12, 15, 18, 21, 24]


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


def test_a_policy_by_object_tracks_is_tested_beside_it_as_it_was_trained(tmp_path, monkeypatch):
    """On the film of the run's own seed, from which its empty scene is made."""
    filmed, film = [], tasks.pace_film
    monkeypatch.setattr(tasks, "pace_film", lambda *a: filmed.append(a) or film(*a, 100))
    (tmp_path / "settings.json").write_text('{"method": "tracks", "seed": 3}')
    sac.save(tmp_path / "policy.safetensors", sac.SAC(15, 3))
    assert controls.rival_wins("push", tmp_path, 0.01, episodes=1) == 0
    assert filmed == [("push", 3)] and controls.method_of(tmp_path) == "Object tracks"


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


def test_robots_notes_and_tables_are_what_they_were(golden):
    """Arguments, jitters and names; what robots do; the tables of made-up measurements."""
    robots = {
        "replay": controls.replay(np.arange(6, dtype=np.float32).reshape(2, 3)),
        "constant": controls.constant((1, 0.5, -1)),
        "down": controls.down_then_along(3),
        "noise": controls.noise(),
        "other noise": controls.noise(4),
        "look": controls.look_once(
            np.array([[0.0, 0], [3, 4], [0, 5]]),
            [np.full((3, 3), k, np.float32) for k in range(3)],
        ),
    }
    seen = [[2.0, 3.9], [0.0, 0.1], [0.0, 9.0], [9.0, 0.0], [3.0, 4.0]]
    acts = {
        name: [robot(np.array(obs), t) for t, obs in enumerate(seen)]
        for name, robot in robots.items()
    }
    names = ("the policy", *controls.BLIND)
    notes = [
        {
            "task": task, "episodes": n,
            "success": {
                str(jitter): {name: (3 * k + i + 7 * (name == "the policy") + j) % (n + 1)
                              for k, name in enumerate(names)}
                for i, jitter in enumerate((0.005, 0.04))
            },
        }
        for j, (task, n) in enumerate((("push", 20), ("reach", 9)))
    ]  # fmt: skip
    kinds = {str(a[0].dtype) for a in acts.values()}
    golden(
        {name: np.array(a).round(5) for name, a in acts.items()}
        | {
            "kinds": sorted(kinds),
            "table": controls.table(notes[0]).splitlines(),
            "beside": controls.side_by_side(notes, 0.04).splitlines(),
            "pay": controls.eyes_pay(notes).splitlines(),
            "share": [controls.share(0, 3), controls.share(99, 100)],
            "options": list(options(controls.parser())),
            "says": controls.parser().description,
            "numbers": [*controls.JITTERS, controls.TRIAL_SEED, controls.TRIALS, controls.LIBRARY],
            "blind": list(controls.BLIND),
        }
    )


@pytest.mark.parametrize(
    ("ends", "whole", "steps"),
    [("terminated", True, 3), ("truncated", True, 3), ("terminated", False, 2), (None, False, 2)],
)
def test_an_episode_is_over_when_its_task_says_so_or_when_it_is_done(ends, whole, steps):
    """Done with the second step and not with the third; the returns of all steps add up."""

    class Env(gym.Env):
        def reset(self, *, seed=None, options=None):
            assert seed == 77
            self.t = 0
            return np.array([5.0]), {}

        def step(self, action):
            assert action.tolist() == [self.t] * 3  # the step of the episode
            self.t += 1
            over = self.t == 3
            return (
                np.array([5.0 + self.t]), 10.0**self.t, over and ends == "terminated",
                over and ends == "truncated", {"is_success": self.t == 2},
            )  # fmt: skip

    seen = []

    def robot(obs, t):
        seen.append(obs[0])
        return np.full(3, t)

    done, total, first, actions = controls.play(Env(), robot, 77, whole)
    assert done and total == sum(10.0**k for k in range(1, steps + 1)) and first.tolist() == [5]
    assert len(actions) == steps and seen == [5.0 + k for k in range(steps)]


def test_a_frozen_camera_takes_one_picture_an_episode_and_a_grey_one_none():
    frozen = controls.Frozen(tasks.gym.make("LbW-Push-v0", jitter=0.04))
    firsts = []
    for seed in (0, 1):
        first, info = frozen.reset(seed=seed)
        assert info["is_success"] is False
        firsts.append(first)
        for _ in range(3):
            later, *_ = frozen.step(np.array([1.0, 0, -1]))
            np.testing.assert_array_equal(later, first)
            later[:] = 0  # whoever writes into a picture writes into a copy
    assert (firsts[0] != firsts[1]).any() and firsts[1].any()
    frozen.close()
    grey = controls.Grey(tasks.gym.make("LbW-Push-v0"))
    for picture in (grey.reset(seed=0)[0], grey.step(np.zeros(3))[0]):
        assert picture.shape == (84, 84, 3) and picture.dtype == np.uint8
        assert (picture == 128).all()
        picture[:] = 0
    grey.close()


def test_measures_are_of_what_was_asked_and_a_smoke_run_of_few(monkeypatch):
    asked = []
    monkeypatch.setattr(controls, "compare", lambda *a, **k: asked.append((a, k)) or {"idle": 1})
    note = controls.measure("push", "w", 9, 4, {"b": 1}, (0.01, 0.02), brief=True)
    assert note == {
        "task": "push", "episodes": 9, "seed": 4,
        "success": {"0.01": {"idle": 1}, "0.02": {"idle": 1}},
    }  # fmt: skip
    few = {"library": 2, "trials": 1}
    assert asked == [(("push", "w", j, 9, 4, {"b": 1}), few) for j in (0.01, 0.02)]
    controls.measure("push", "w", 9, 4, {})
    assert [a[2] for a, k in asked[2:]] == [0.005, 0.01, 0.02, 0.04] and asked[2][1] == {}


def test_a_run_beside_is_known_by_its_settings(tmp_path):
    with pytest.raises(InputError) as told:
        controls.method_of(tmp_path)  # nothing is noted: LbW's own
    assert str(told.value) == f"--beside {tmp_path}: no run of a rival is there."
    for method, name in (("avid", "AVID-m"), ("classifier", "Classifier reward"),
                         ("tracks", "Object tracks")):  # fmt: skip
        (tmp_path / "settings.json").write_text(json.dumps({"method": method, "seed": 2}))
        assert controls.method_of(tmp_path) == name
    assert job.settings_of(tmp_path) == {"method": "tracks", "seed": 2}


def test_of_each_method_one_run_of_the_task_itself_is_tested_beside_it(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(controls, "measure", lambda *a: asked.append(a[4]) or {"success": {}})
    monkeypatch.setattr(controls, "table", lambda note: "")
    a, b, c = (tmp_path / name for name in "abc")
    for run, method, task in ((a, "tracks", "push"), (b, "avid", "push"), (c, "tracks", "slide")):
        run.mkdir()
        (run / "settings.json").write_text(json.dumps({"method": method, "task": task}))

    def test(task, *runs):
        beside = [word for run in runs for word in ("--beside", str(run))]
        controls.main([task, *beside, "--out", str(tmp_path)])

    test("push", a, b)
    assert asked == [{"Object tracks": a, "AVID-m": b}]
    for runs, why in (
        ((a, c), f"{c}: a run of the task slide, not of push; give one of push."),
        ((a, b, a), f"--beside {a}: {a} is of Object tracks, too; give one of each."),
    ):
        with pytest.raises(InputError) as told:
            test("push", *runs)
        assert str(told.value) == why
    assert len(asked) == 1
