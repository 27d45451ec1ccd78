"""What a run is tested on, by an agent and a task of which everything is known."""

from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest

import tasks
from tasks.commands import job, record, run


class Counted(gym.Env):
    """Done at the steps `hits` of four; it remembers seeds and actions."""

    observation_space = action_space = gym.spaces.Box(-1, 1, (3,), np.float32)

    def __init__(self, *hits):
        self.hits, self.seeds, self.actions = hits, [], []
        self.world = SimpleNamespace(render=lambda: np.full((84, 84, 3), self.t, np.uint8))

    def reset(self, *, seed=None, options=None):
        self.seeds.append(seed)
        self.t = 0
        return np.zeros(3, np.float32), {}

    def step(self, action):
        self.t += 1
        self.actions.append(float(action[0]))
        info = {"is_success": self.t in self.hits, "reward_parts": {"r1": -self.t}}
        return np.full(3, self.t, np.float32), 0.0, False, self.t == 4, info


class Agent:
    """Without noise it does 0.25."""

    def act(self, z, deterministic=False):
        return np.full(3, 0.25 if deterministic else -1.0)


@pytest.fixture(autouse=True)
def no_scene(monkeypatch):
    scene = SimpleNamespace(snap=lambda: None, html=lambda title: title)
    monkeypatch.setattr(run, "mirror", lambda env: scene)


@pytest.mark.parametrize(
    ("hits", "success", "at_end", "first"),
    [
        ((2,), True, False, 2),
        ((4,), True, True, 4),
        ((1, 4), True, True, 1),
        ((), False, False, None),
    ],
)
def test_success_is_that_of_some_step_and_the_first_one_is_noted(hits, success, at_end, first):
    env = Counted(*hits)
    rows, film, scene = run.evaluate(Agent(), env, 3)
    assert env.seeds == [run.TEST_SEED, run.TEST_SEED + 1, run.TEST_SEED + 2]
    assert [row["seed"] for row in rows] == env.seeds
    for row in rows:
        found = row["success"], row["success_at_end"], row["first_success"]
        assert found == (success, at_end, first)
    assert env.actions == 12 * [0.25]
    # The film is the first episode's, frame by frame with what was seen and paid.
    assert film["frames"][:, 0, 0, 0].tolist() == film["z"][:, 0].tolist() == [1, 2, 3, 4]
    assert [part["r1"] for part in film["parts"]] == [-1, -2, -3, -4] and scene == "A test episode"


def test_test_episodes_are_of_seeds_far_from_those_of_training():
    assert run.TEST_SEED >= 1_000_000


@pytest.mark.parametrize(("asked", "fast", "n"), [(None, False, 10), (None, True, 2), (4, True, 4)])
def test_the_metrics_say_how_many_of_how_many_with_their_interval(asked, fast, n, monkeypatch):
    """One of ten: Wilson's 1.8 to 40.4 %."""
    rows = [{"success": i == 0} for i in range(10)]
    monkeypatch.setattr(run, "evaluate", lambda agent, env, n: (rows[:n], "first", "scene"))
    monkeypatch.setattr(run, "peak_memory", lambda: 300 * 2**20)
    metrics = {}
    some = SimpleNamespace(
        args=SimpleNamespace(episodes=asked, fast=fast),
        run=SimpleNamespace(metrics=metrics, save=lambda: None),
    )
    assert run.test(some, None, None) == ("first", "scene")
    result = metrics["success"]
    assert (len(metrics["episodes"]), result["episodes"], result["rate"]) == (n, n, 1 / n)
    assert metrics["memory_mb"] == 300
    if n == 10:
        assert (result["low"], result["high"]) == pytest.approx((0.018, 0.404), abs=0.001)


@pytest.mark.parametrize(
    ("scratch", "clip", "frames"), [(True, False, 1220), (False, False, 400), (True, True, 1220)]
)
def test_perception_learns_from_table_ones_frames_and_the_pace_from_400(
    scratch, clip, frames, monkeypatch
):
    """A perception that learns is probed with frames of its own; one of another clip is not."""
    asked = []
    args = SimpleNamespace(seed=3, device=None, translate_clip=clip)
    some = SimpleNamespace(
        name="push", args=args, recipe=tasks.push.RECIPE, from_scratch=scratch,
        demo="demo", random="random",
        trained=None if scratch else SimpleNamespace(watch=asked.append),
        run=SimpleNamespace(metrics={"stages": {}}, save=lambda: None),
    )  # fmt: skip
    learnt = SimpleNamespace(watch=lambda demo: asked.append(demo))
    monkeypatch.setattr(run.tasks, "pace_film", lambda name, seed, n: (name, seed, n))
    monkeypatch.setattr(run, "bring", lambda *names: asked.append(names[1:]))
    monkeypatch.setattr(run, "learn_perception", lambda *a, **k: asked.append((a, k)) or learnt)
    monkeypatch.setattr(run, "probe", lambda *a: asked.append(a) or "figures")
    perception, robot = run.perceive(some)
    assert robot == ("push", 3, frames)
    if not scratch:
        assert asked == [("translation", "keypoints")] and perception is some.trained
        return
    (given, options), *rest = asked
    assert given[:3] == ("demo", "random", robot) and options["seed"] == 3
    probed = ["demo", ("push", learnt, run.PROBE_SEED + 3)]
    assert rest == ([] if clip else probed)
    assert some.run.metrics.get("perception") == (None if clip else "figures")


def test_a_policy_learns_with_the_jitter_the_reward_and_the_mends_that_were_asked_for(monkeypatch):
    given = {}
    agent = SimpleNamespace(sizes={"obs_dim": 3})

    def imitate(env, *frames, **options):
        given.update(options, env=env, frames=frames)
        return agent, env

    monkeypatch.setattr(run, "imitate", imitate)
    args = SimpleNamespace(evaluate=False, jitter=0.01, seed=4, reward="literal", without="trim")
    some = SimpleNamespace(
        name="reach", args=args, demo="demo", recipe="recipe", run="run", weights="w"
    )
    monkeypatch.setattr(run.gym, "make", lambda id, jitter: Counted() if jitter == 0.01 else None)
    assert run.learn(some, "perception", "robot") == (agent, given["env"])
    assert given["frames"] == ("demo", "robot", "perception", "recipe")
    asked = {name: given[name] for name in ("seed", "form", "without", "run")}
    assert asked == {"seed": 4, "form": "literal", "without": "trim", "run": "run"}


def test_the_first_human_video_is_the_demonstration_and_the_others_follow():
    asked = SimpleNamespace(video=None, videos=3, method="avid")
    names = [path.name for path in job.videos("push", asked)]
    assert names == ["expert_01.mp4", "expert_02.mp4", "expert_03.mp4"]
    asked.video = "mine.mp4"
    assert job.videos("push", asked) == ["mine.mp4"]


def test_human_videos_and_random_motion_together_are_table_ones_frames(tmp_path, monkeypatch):
    """Fifteen experts, of which the first is learnt from; random motion of a seed of its own."""
    asked, written = {}, {}

    def take(n, seed):
        states = np.zeros((n, 9))
        return np.zeros((n, 84, 84, 3), np.uint8), None, SimpleNamespace(states=states, seed=seed)

    def random_takes(env, frames, seed, take_of):
        asked.update(frames=frames, seed=seed, take=take_of)
        return (take(min(take_of, frames - i), 0) for i in range(0, frames, take_of))

    monkeypatch.setattr(record.tasks, "VIDEOS", tmp_path)
    monkeypatch.setattr(record.tasks, "bare", lambda name, embodiment: asked.update(arm=embodiment))
    monkeypatch.setattr(
        record, "expert_takes", lambda env, n: (take(60 + i, 2 * i) for i in range(n))
    )
    monkeypatch.setattr(
        record,
        "random_takes",
        lambda env, frames, seed, take: random_takes(env, frames, seed, take),
    )
    monkeypatch.setattr(
        record.video, "write", lambda path, film, fps: written.update({path.name: (len(film), fps)})
    )
    monkeypatch.setattr(record, "save_recordings", lambda path, some: None)
    record.film_human("push")
    assert asked == {"arm": "human", "frames": 398 - 60, "seed": 29, "take": 20}
    assert written["expert_01.mp4"] == (60, 25) and written["expert_15.mp4"] == (74, 25)
    assert len(written) == 16 and written["random.mp4"] == (338, 25)
