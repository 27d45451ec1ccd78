"""The rivals as whole methods: what each stage is given, what it leaves, and how a run goes on."""

import json
import re

import gymnasium as gym
import numpy as np
import pytest
import torch
from moves import blocks, facts, look

import tasks
from lbw_minimal import classifier, cyclegan, rivals, sac_ae
from lbw_minimal.imitate import Recipe, Run
from lbw_minimal.training import InputError
from tasks.__main__ import main
from tasks.commands import job
from tasks.commands.job import parser
from tasks.commands.run import TEST_SEED
from tasks.world import film as film_of
from tasks.world import load_recordings, record_expert

pytestmark = pytest.mark.usefixtures("one_trial")
TINY = Recipe(
    human_frames=0, robot_frames=0, munit_iterations=2, munit_width=4,
    classifier_iterations=5, policy_steps=40,
)  # fmt: skip


def film(length, tone=90, seed=0):
    frames = np.random.default_rng(seed).integers(0, 20, (length, 84, 84, 3)) + tone
    return frames.astype(np.uint8)


def run_in(folder):
    folder.mkdir(exist_ok=True)
    return Run(folder)


def reach():
    return gym.make(tasks.id_of("reach"), jitter=0.005)


ARGS = {"task": "reach", "seed": 0}


def test_the_classifier_reward_goes_from_videos_to_a_policy_and_repeats_nothing(
    tmp_path, monkeypatch
):
    videos = [film(30 + 5 * i, seed=i) for i in range(2)]
    policy, env = rivals.classifier_reward(
        reach(), videos, videos[0][:0], TINY, run=run_in(tmp_path), **ARGS
    )
    obs, _ = env.reset(seed=0)
    assert obs.shape == (3, 84, 84, 3)
    assert policy.act(obs, deterministic=True).shape == (3,)
    for module in (classifier, sac_ae):
        monkeypatch.setattr(module, "train", lambda *_, **__: pytest.fail("trained again"))
    again, _ = rivals.classifier_reward(
        reach(), videos, videos[0][:0], TINY, run=run_in(tmp_path), **ARGS
    )
    np.testing.assert_array_equal(
        again.act(obs, deterministic=True), policy.act(obs, deterministic=True)
    )
    assert set(run_in(tmp_path).metrics["stages"]) == {"classifier", "policy"}
    assert classifier.load(tmp_path / "classifier.safetensors").longest == 35


def test_avids_classifier_is_shown_translated_videos_of_all_experts(tmp_path, monkeypatch):
    shown, learnt = [], []
    monkeypatch.setattr(cyclegan, "translate", lambda model, frames: 255 - frames)
    real = classifier.goal_frames
    monkeypatch.setattr(classifier, "goal_frames", lambda v: shown.append(v) or real(v))
    train, judge, judged = cyclegan.train, classifier.train, []
    monkeypatch.setattr(classifier, "train", lambda *a, **k: judged.append(a) or judge(*a, **k))

    def watch(human, robot, **more):
        learnt.append((human, robot, more["iterations"]))
        return train(human, robot, **more)

    monkeypatch.setattr(cyclegan, "train", watch)
    experts, random, robot = [film(20, 60 + i) for i in range(3)], film(6, 100), film(8, 200)
    rivals.avid_m(reach(), experts, random, robot, TINY, run=run_in(tmp_path), **ARGS)
    ((human, seen, iterations),) = learnt
    # LbW's frames: the one demonstration, and random motion
    np.testing.assert_array_equal(human, np.concatenate([experts[0], random]))
    np.testing.assert_array_equal(seen, robot)
    assert iterations == TINY.munit_iterations
    for video, expert in zip(shown[0], experts, strict=True):
        np.testing.assert_array_equal(video, 255 - expert)
    ((_, negative),) = judged  # random motion too is seen through the translation
    np.testing.assert_array_equal(negative[-6:], 255 - random)


@pytest.mark.parametrize(("longest", "steps"), [(20, 25), (500, tasks.module("reach").HORIZON)])
def test_an_episode_lasts_as_long_as_the_longest_video_asks_and_the_task_allows(longest, steps):
    env = rivals.watched(reach(), classifier.GoalClassifier(longest))
    env.reset(seed=0)
    count, ended = 0, False
    while not ended:
        *_, truncated, info = env.step(np.zeros(3, np.float32))
        count, ended = count + 1, truncated
    assert count == steps and set(info["reward_parts"]) == {"logit"}


class Endless(gym.Env):
    """A brighter frame at each step; nothing says how long an episode may be."""

    observation_space = gym.spaces.Box(0, 255, (84, 84, 3), np.uint8)
    action_space = gym.spaces.Box(-1, 1, (2,), np.float32)

    def reset(self, seed=None, options=None):
        self.level = 7
        return np.full((84, 84, 3), 7, np.uint8), {}

    def step(self, action):
        self.level += 1
        return np.full((84, 84, 3), self.level, np.uint8), 0.0, False, False, {}


def test_an_episode_lasts_by_the_video_alone_where_the_task_sets_no_end():
    """A fourth more than the longest video's 43 frames, in whole steps: 53.75 are 54."""
    env = rivals.watched(Endless(), classifier.GoalClassifier(43))
    env.reset()
    assert [env.step(np.zeros(2))[3] for _ in range(54)] == [*53 * [False], True]


def test_a_rivals_agent_sees_three_frames_and_at_first_the_first_three_times():
    env = rivals.watched(Endless(), classifier.GoalClassifier(43))
    seen = [env.reset()[0], *(env.step(np.zeros(2))[0] for _ in range(3))]
    assert [stack[:, 0, 0, 0].tolist() for stack in seen] == [
        [7, 7, 7], [7, 7, 8], [7, 8, 9], [8, 9, 10]
    ]  # fmt: skip


def test_the_clip_of_the_recipe_bounds_the_reward():
    model = classifier.GoalClassifier(20)
    model.layers[-1].bias.data.fill_(7.0)
    env = rivals.watched(reach(), model, clip=2.0)
    env.reset(seed=0)
    _, reward, *_, info = env.step(np.zeros(3, np.float32))
    assert reward == 1.0 and info["reward_parts"]["logit"] > 5
    env = rivals.watched(reach(), model)  # by default a logit of 10 earns 1
    env.reset(seed=0)
    _, reward, *_, info = env.step(np.zeros(3, np.float32))
    assert reward == pytest.approx(info["reward_parts"]["logit"] / 10)


@pytest.mark.parametrize("motion", [False, True])
def test_each_stage_of_a_rival_takes_the_recipes_numbers(motion, tmp_path, monkeypatch):
    given = {}

    def trains(name, result):
        return lambda *a, **k: given.update({name: (a, k)}) or (result, [{"of": name}])

    model = classifier.GoalClassifier()
    monkeypatch.setattr(cyclegan, "train", trains("G", cyclegan.CycleGAN(2, 1)))
    monkeypatch.setattr(classifier, "train", trains("D", model))
    monkeypatch.setattr(sac_ae, "train", trains("policy", "agent"))
    monkeypatch.setattr(sac_ae, "save", lambda path, agent: path.write_text(agent))
    monkeypatch.setattr(sac_ae, "load", lambda path: path.read_text())
    recipe = Recipe(
        human_frames=0, robot_frames=0, munit_iterations=11, munit_width=12, motion=motion,
        classifier_iterations=13, policy_steps=14, pixel_updates=15, hold=16, entropy=-1.75,
        clip=3.0, random_negatives=False,
    )  # fmt: skip
    experts = [film(20, 60), film(30, 61), film(25, 62)]
    run = run_in(tmp_path)
    policy, env = rivals.avid_m(
        reach(), experts, film(6), film(8), recipe, run=run, task="reach", seed=4, device="there"
    )
    assert policy == "agent" and env.get_wrapper_attr("classifier_reward").clip == 3.0
    options = {name: given[name][1] for name in given}
    for name, asked in {
        "G": {"iterations": 11, "width": 12, "motion": motion},
        "D": {"iterations": 13},
        "policy": {"steps": 14, "updates": 15, "hold": 16, "entropy": -1.75},
    }.items():
        asked |= {"seed": 4, "device": "there"}
        assert asked == {field: options[name][field] for field in asked}
    for name, stage in {"G": "translation", "D": "classifier", "policy": "policy"}.items():
        assert options[name]["checkpoint"].path == tmp_path / f"{stage}.checkpoint"
        assert json.loads((tmp_path / f"{stage}_log.json").read_text()) == [{"of": name}]
    positive, negative = given["D"][0]
    # The last tenths, 2, 3 and 3 frames; of no random motion any negative.
    assert (len(positive), len(negative)) == (8, 18 + 27 + 22)
    assert classifier.load(tmp_path / "classifier.safetensors").longest == 30


def test_the_classifier_reward_hands_all_it_was_given_on(tmp_path, monkeypatch):
    """Random motion to the negatives; seed and device to the trainings of both networks."""
    given = {}

    def trains(name, result):
        return lambda *a, **k: given.update({name: (a, k)}) or (result, [])

    monkeypatch.setattr(classifier, "train", trains("D", classifier.GoalClassifier()))
    monkeypatch.setattr(sac_ae, "train", trains("policy", "agent"))
    monkeypatch.setattr(sac_ae, "save", lambda path, agent: path.write_text(agent))
    monkeypatch.setattr(sac_ae, "load", lambda path: path.read_text())
    random, more = film(6, 200), {"task": "reach", "seed": 5, "device": "there"}
    rivals.classifier_reward(reach(), [film(20)], random, TINY, run=run_in(tmp_path), **more)
    (_, negative), options = given["D"]
    np.testing.assert_array_equal(negative[-6:], random)
    for k in (options, given["policy"][1]):
        assert (k["seed"], k["device"]) == (5, "there")


@pytest.mark.parametrize("negatives", [True, False])
def test_all_that_the_stages_of_a_rival_are_given_and_leave_is_what_it_was(
    negatives, golden, tmp_path, monkeypatch
):
    """Every argument of every training, the frames among them, and every file."""
    given = {}

    def trains(name, result):
        def train(*frames, **options):
            given[name] = frames
            told = {k: v for k, v in options.items() if k != "checkpoint"}
            given[f"{name}'s options"] = str(sorted(told.items()))
            return result, [{"row": name}]

        return train

    torch.manual_seed(0)
    monkeypatch.setattr(cyclegan, "train", trains("translation", cyclegan.CycleGAN(2, 1)))
    monkeypatch.setattr(classifier, "train", trains("classifier", classifier.GoalClassifier()))
    monkeypatch.setattr(sac_ae, "train", trains("policy", sac_ae.SACAE(3)))
    recipe = Recipe(
        human_frames=1, robot_frames=2, munit_iterations=3, munit_width=4, motion=True,
        classifier_iterations=6, policy_steps=7, pixel_updates=8, hold=9, entropy=-1.5, clip=2.5,
        random_negatives=negatives,
    )  # fmt: skip
    films = [blocks(n, n) for n in (23, 40, 31, 6, 9)]
    _, env = rivals.avid_m(
        reach(), films[:3], *films[3:], recipe, run=run_in(tmp_path), task="reach", seed=5
    )
    layers, inner = [], env
    while isinstance(inner, gym.Wrapper):
        layers, inner = [*layers, type(inner).__name__], inner.env
    figures = facts(rivals) | {"wrappers": layers[:4], "seen": str(env.observation_space.shape)}
    figures |= {"files": sorted(path.name for path in tmp_path.iterdir())}
    (policy_env,) = given.pop("policy")
    assert policy_env is env
    for name, value in given.items():
        if isinstance(value, tuple):
            value = [[len(frames), *look(frames / 1.0, 3)] for frames in value]
        figures[name] = value
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    figures |= {"metrics": [*metrics], "stages": [*metrics["stages"]]}
    figures["longest"] = classifier.load(tmp_path / "classifier.safetensors", "reach").longest
    golden(figures)


def test_a_stage_hands_on_what_its_file_holds_as_if_it_were_resumed(tmp_path, monkeypatch):
    """A translation is kept in half precision."""
    G = cyclegan.CycleGAN(2, 1)
    monkeypatch.setattr(cyclegan, "train", lambda *_, **__: (G, []))
    run = run_in(tmp_path)
    kept = rivals.learn_translation(film(3), film(2), film(2), TINY, run=run, **ARGS)
    for p, trained in zip(kept.parameters(), G.parameters(), strict=True):
        assert torch.equal(p, trained.half().float())


def test_a_rivals_policy_is_replayed_on_its_own_task_alone(tmp_path, monkeypatch):
    classifier.save(tmp_path / "classifier.safetensors", classifier.GoalClassifier(20), "push")
    monkeypatch.setattr(sac_ae, "load", lambda path: path.name)
    policy, env = rivals.replayed(gym.make(tasks.id_of("push")), tmp_path, "push")
    assert policy == "policy.safetensors" and env.observation_space.shape == (3, 84, 84, 3)
    assert env.get_wrapper_attr("classifier_reward").clip == classifier.CLIP
    env.close()
    with pytest.raises(InputError, match="push"):
        rivals.replayed(reach(), tmp_path, "reach")


@pytest.mark.parametrize("method", ["classifier", "avid"])
def test_a_rivals_run_ends_with_a_page_and_is_replayed(method, tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(tasks, "ROBOT_EXPERTS", 2)
    monkeypatch.setattr(job, "EXPERTS", 2)
    fields = {"classifier_iterations": 5, "policy_steps": 40, "random_negatives": 0}
    if method == "avid":
        fields |= {"munit_iterations": 2, "robot_frames": 40}
    more = [word for k, v in fields.items() for word in ("--set", f"{k}={v}")]
    out = tmp_path / "run"
    arguments = ["reach", "--method", method, "--fast", "--threads", "1", *more]
    assert main([*arguments, "--out", str(out)]) == 0
    assert "reach: " in capfd.readouterr().out
    page = (out / "report.html").read_text()
    assert {"avid": "AVID-m", "classifier": "Classifier reward"}[method] in page
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["settings"]["method"] == method
    assert "K" not in metrics["settings"]["recipe"]
    if method == "classifier":  # the replay of the other differs in a file that is copied
        again = ["reach", "--method", method, "--evaluate", "--episodes", "2", "--threads", "1"]
        again += ["--weights", str(out)]
        assert main([*again, "--out", str(tmp_path / "again")]) == 0
        episodes = json.loads((tmp_path / "again" / "metrics.json").read_text())["episodes"]
        assert episodes == metrics["episodes"]


def test_avid_learns_on_a_translation_that_is_there(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(tasks, "ROBOT_EXPERTS", 2)
    monkeypatch.setattr(job, "EXPERTS", 2)
    robot, human = film(8, 200), film(8, 60)
    G, _ = cyclegan.train(human, robot, iterations=1, width=4, seed=0)
    cyclegan.save(tmp_path / "translation.safetensors", G, "reach")
    monkeypatch.setattr(cyclegan, "train", lambda *_, **__: pytest.fail("trained again"))
    line = ["reach", "--method", "avid", "--weights", str(tmp_path), "--set", "policy_steps=20"]
    line += ["--set", "classifier_iterations=2", "--threads", "1"]
    out = tmp_path / "run"
    assert main([*line, "--set", "motion=1", "--out", str(out)]) == 2
    assert "--set motion=1: the translation in --weights" in capfd.readouterr().err
    monkeypatch.setattr(tasks, "pace_film", lambda *_: robot)
    assert main([*line, "--episodes", "1", "--out", str(out)]) == 0
    stages = json.loads((out / "metrics.json").read_text())["stages"]
    assert "translation" not in stages and {"classifier", "policy"} <= set(stages)
    assert main([*line, "--out", str(tmp_path)]) == 2
    assert "clear it of the weights" in capfd.readouterr().err
    assert (tmp_path / "translation.safetensors").exists()


REFUSED = {
    "--reward literal": "--reward literal",
    "--without trim": "--without trim",
    "--from-scratch": "--from-scratch",
    "--evaluate": "--weights",
    "--set K=3": "no 'K'",
    "--video x.mp4": "--video x.mp4",
}


@pytest.mark.parametrize("method", ["classifier", "avid"])
@pytest.mark.parametrize("options", REFUSED)
def test_what_does_nothing_for_a_rival_is_refused(options, method, tmp_path, capfd):
    out = tmp_path / "run"
    line = ["push", "--method", method, *options.split(), "--out", str(out)]
    assert main(line) == 2
    error = capfd.readouterr().err
    assert error.startswith("error: ") and error.count("\n") == 1 and REFUSED[options] in error
    assert not out.exists()


def test_what_only_rivals_take_is_refused_for_lbw(capfd):
    assert main(["push", "--set", "pixel_updates=2"]) == 2
    assert "no 'pixel_updates'" in capfd.readouterr().err


def count_videos(*line):
    args = parser("push").read(list(line))
    return len(job.videos("push", args))


def test_a_switch_of_the_recipe_is_on_or_off(tmp_path, capfd):
    line = ["--method", "classifier", "--set", "random_negatives=0", "--out", str(tmp_path)]
    asked = job.check("push", parser("push").read(line), line)
    assert asked.recipe.random_negatives is False and tasks.push.RECIPE.random_negatives is True
    assert main(["push", "--method", "avid", "--set", "motion=2"]) == 2
    assert "--set motion=2: '2' is neither 0 nor 1" in capfd.readouterr().err


def test_each_method_learns_from_as_many_videos_as_in_the_paper_or_as_asked():
    assert count_videos() == 1
    assert count_videos("--method", "avid") == 15
    assert count_videos("--method", "avid", "--videos", "5") == 5
    assert count_videos("--method", "classifier") == 0


def test_further_videos_join_the_human_domain_of_lbw_and_not_its_demonstration(tmp_path):
    line = ["--from-scratch", "--videos", "3", "--out", str(tmp_path / "three")]
    three = job.check("push", parser("push").read(line), line)
    line = ["--from-scratch", "--out", str(tmp_path / "one")]
    one = job.check("push", parser("push").read(line), line)
    np.testing.assert_array_equal(three.demo, one.demo)
    more = len(three.random) - len(one.random)
    assert more == len(three.experts[1]) + len(three.experts[2])
    assert three.run.metrics["settings"]["video"] != one.run.metrics["settings"]["video"]


@pytest.mark.parametrize(
    "line",
    ["--videos 5", "--method classifier --videos 5", "--from-scratch --videos 16",
     "--video x.mp4 --videos 2"],
)  # fmt: skip
def test_videos_that_no_one_sees_are_refused(line, tmp_path, capfd):
    assert main(["push", *line.split(), "--out", str(tmp_path / "run")]) == 2
    assert "--videos" in capfd.readouterr().err


RIVALS = tasks.WEIGHTS / "rivals"  # what notebook 11 shows


@pytest.mark.parametrize(
    "name, method, load",
    [("translation", "avid", cyclegan.load), ("classifier", "classifier", classifier.load)],
)
def test_shipped_network_of_a_rival_loads_and_its_note_says_which_run_made_it(name, method, load):
    load(RIVALS / f"{name}.safetensors", "push")
    note = json.loads((RIVALS / f"{name}.json").read_text())
    settings = note["settings"]
    assert (settings["task"], settings["method"], settings["set"]) == ("push", method, [])
    assert name in note["stages"] and note["machine"]
    assert note["command"].startswith("python -m tasks push ") and method in note["command"]


def test_shipped_episodes_fool_the_shipped_classifier():
    """The agent never pushes the cube, and earns more than the expert, which does."""
    env = tasks.bare("push", jitter=0.005)
    model = classifier.load(RIVALS / "classifier.safetensors", "push")
    episodes = load_recordings(RIVALS / "episodes.npz")
    assert [e.seed for e in episodes] == list(range(TEST_SEED, TEST_SEED + 10))
    assert not any(e.success.any() for e in episodes)
    frames, _, again = film_of(env, episodes[0].seed, episodes[0].actions)
    np.testing.assert_allclose(again.states, episodes[0].states, atol=1e-4)  # m
    expert, _, done = record_expert(env, episodes[0].seed)
    assert done.success[-1]
    paid = [classifier.logits(model, film[1:]) for film in (frames, expert)]
    assert paid[0].mean() > 0 > paid[1].mean()


TRIED = tasks.ROOT / "solutions" / "results" / "rivals"
CELL = r"([^|]+) \| "
ROW = rf"\| \[(\w+)\]\(rivals/(\S+)\.json\) \| {CELL}{CELL}{CELL}{CELL}{CELL}(\d+)/(\d+) \|"


def test_the_table_of_what_was_tried_is_that_of_the_runs():
    rows = re.findall(ROW, (TRIED.parent / "README.md").read_text())
    assert {row[1] for row in rows} == {path.stem for path in TRIED.glob("*.json")}
    for task, name, method, negatives, _, hold, updates, wins, episodes in rows:
        note = json.loads((TRIED / f"{name}.json").read_text())
        settings, recipe = note["settings"], note["settings"]["recipe"]
        assert (settings["task"], settings["seed"]) == (task, 0)
        assert settings["method"] == {"AVID-m": "avid"}.get(method, method)
        assert bool(recipe.get("random_negatives")) == ("random" in negatives)
        assert (recipe.get("hold", 1), recipe["pixel_updates"]) == (int(hold), int(updates))
        done = [episode["success"] for episode in note["episodes"]]
        assert (sum(done), len(done)) == (int(wins), int(episodes))
