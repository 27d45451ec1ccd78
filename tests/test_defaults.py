"""What a command does when nothing is said: README's tables and the paper's own numbers."""

import json
from inspect import signature
from threading import Barrier
from types import SimpleNamespace

import numpy as np
import pytest

import tasks
from tasks import commands
from tasks.commands import (
    JITTER,
    batch,
    bench,
    controls,
    figures,
    job,
    paper,
    recipe,
    record,
    robustness,
    run,
    table,
)

RESULTS = tasks.ROOT / "solutions" / "results"


def said(parser, *line):
    return vars(parser.read(list(line)))


def test_a_run_moves_starts_by_5_mm_and_is_tested_ten_times_as_in_the_paper():
    """Seed 0's policies are the ones that come with the kit."""
    args = said(job.parser("push"))
    assert (args["jitter"], args["seed"], args["method"], args["reward"]) == (
        0.005, 0, "lbw", "mended",
    )  # fmt: skip
    assert args["episodes"] is None and job.TEST_EPISODES == 10
    assert not any(args[name] for name in ("fast", "resume", "evaluate", "from_scratch", "set"))


def test_lbw_is_trained_three_times_a_task_the_rivals_twice_and_nothing_they_are_not_asked_for():
    args = said(table.parser())
    assert (args["seeds"], args["jobs"], args["episodes"]) == (3, 1, 10)
    assert not (args["rivals"] or args["tracks"] or args["ray"] or args["print"])
    assert table.counts(3, True, False) == {"": 3, "literal": 3, "classifier": 2, "avid": 2}
    assert table.counts(1, True, True) == {
        "": 1, "literal": 1, "classifier": 1, "avid": 1, "tracks": 1,
    }  # fmt: skip
    own = {n: p.default for n, p in signature(table.table).parameters.items()}
    assert own == {"out": own["out"], "jobs": own["jobs"], "episodes": 10, "seeds": 3,
                   "rivals": False, "ray": False, "tracks": False}  # fmt: skip


@pytest.mark.parametrize("flag", ["rivals", "tracks", "ray"])
def test_the_table_is_made_of_what_was_asked_for(flag, tmp_path, monkeypatch, capsys):
    asked = []
    monkeypatch.setattr(table, "table", lambda *a, **k: asked.append((a, k)) or "a table")
    table.main([f"--{flag}", "--seeds", "2", "--episodes", "4", "--out", str(tmp_path)])
    assert asked == [
        ((tmp_path, 1, 4, 2), {name: name == flag for name in ("rivals", "tracks", "ray")})
    ]
    assert capsys.readouterr().out == "a table\n"


def test_what_is_missing_is_printed_of_the_methods_asked_for(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(table, "print_missing", lambda *what: asked.append(what))
    table.main(["--print", "--tracks", "--seeds", "1", "--out", str(tmp_path)])
    (out, wanted, episodes), = asked  # fmt: skip
    assert (out, episodes) == (tmp_path, 10)
    assert {change for *_, change in wanted} == {"", "literal", "tracks"}
    assert len(wanted) == 5 + 5 + 4  # reach has no object


def test_controls_are_tested_as_in_readmes_table():
    """Of 100, at 5, 10, 20 and 40 mm; who looks once has the policy's own fifty episodes."""
    args = said(controls.parser(), "push")
    assert (args["episodes"], args["jitter"], args["seed"], args["beside"]) == (100, None, 0, [])
    assert controls.JITTERS == (0.005, 0.01, 0.02, 0.04)
    defaults = {n: p.default for n, p in signature(controls.compare).parameters.items()}
    assert (defaults["library"], defaults["trials"]) == (50, 10)
    for path in (RESULTS / "controls").glob("*.json"):
        note = json.loads(path.read_text())
        assert list(map(float, note["success"])) == list(controls.JITTERS)


def test_a_share_is_of_its_own_number_of_episodes():
    """Wilson's 57 to 100 % of five of five, and 2 to 11 % of five of a hundred."""
    assert controls.share(5, 5) == "5/5 (57-100 %)"
    assert controls.share(5, 100) == "5/100 (2-11 %)"


def test_controls_play_on_one_core_and_close_a_rivals_world(tmp_path, monkeypatch):
    """A second thread costs more than it brings, and an open world is a simulator in memory."""
    threads, closed = [], []
    env = SimpleNamespace(close=lambda: closed.append(1))
    monkeypatch.setattr(controls.torch, "set_num_threads", threads.append)
    monkeypatch.setattr(controls, "compare", lambda *_, **__: {})
    monkeypatch.setattr(controls.gym, "make", lambda *_, **__: None)
    monkeypatch.setattr(controls.rivals, "replayed", lambda *_: (None, env))
    monkeypatch.setattr(controls, "wins", lambda *_: 3)
    controls.measure("push", tmp_path, 1, 0, {})
    assert controls.rival_wins("push", tmp_path, 0.01, 5) == 3
    assert (threads, closed) == ([1], [1])


@pytest.mark.parametrize("method", ["learn", "track"])
def test_a_policy_from_few_numbers_learns_on_one_core(method, monkeypatch):
    told = []
    args = SimpleNamespace(evaluate=False, jitter=0.0, seed=0, reward="mended", without=None)
    some = SimpleNamespace(
        name="push", args=args, demo=[], random=[], recipe=None, run=None, weights=None
    )
    monkeypatch.setattr(run.torch, "set_num_threads", told.append)
    for name in ("imitate", "follow"):
        monkeypatch.setattr(run, name, lambda *_, **__: ("agent", "env"))
    for name in ("film_robot", "refuse_strangers"):
        monkeypatch.setattr(run, name, lambda *_: None)
    monkeypatch.setattr(run.gym, "make", lambda *_, **__: None)
    monkeypatch.setattr(run.tracks, "draw", lambda demo: None)
    run.learn(some, None, None) if method == "learn" else run.track(some)
    assert told == [1]


def test_robustness_is_of_twenty_episodes_of_the_shipped_policy(monkeypatch, capsys):
    asked = []
    monkeypatch.setattr(robustness, "robustness", lambda *of: asked.append(of) or {})
    robustness.main(["slide"])
    assert asked == [("slide", tasks.WEIGHTS / "slide", 20, 0)]


def test_what_has_nothing_red_is_not_painted_and_not_played(monkeypatch):
    """Seven changes are left; each of their worlds is closed once."""
    closed, played = [], []
    env = SimpleNamespace(unwrapped=SimpleNamespace(world="world"), close=lambda: closed.append(1))
    monkeypatch.setattr(robustness.gym, "make", lambda *_, **__: env)
    monkeypatch.setattr(robustness, "TransformObservation", lambda env, change, space: env)
    monkeypatch.setattr(robustness, "paint", lambda world, old, new: 0)
    monkeypatch.setattr(robustness, "watched", lambda env, perception, robot: (env, None))
    monkeypatch.setattr(
        robustness, "evaluate", lambda policy, env, n: (played.append(n) or [{"success": True}], 0)
    )
    monkeypatch.setattr(tasks, "trained_perception", lambda task, weights: None)
    monkeypatch.setattr(tasks, "pace_film", lambda task, seed: None)
    monkeypatch.setattr(robustness.sac, "load", lambda path: None)
    monkeypatch.setattr(robustness, "refuse_strangers", lambda *_: None)
    wins = robustness.robustness("reach", tasks.WEIGHTS, 3)
    assert "object blue" not in wins and len(wins) == 7 and played == [3] * 7
    assert len(closed) == 8


def test_only_what_has_exactly_a_colour_is_painted():
    """Red as the tasks have it, and not what is like it."""
    painted = []
    shapes = {
        7: [(1, 0, 0, 0, 0, 0, 0, (0.85, 0.1, 0.1, 1))],
        9: [(2, 0, 0, 0, 0, 0, 0, (0.855, 0.1, 0.1, 1)), (2, 1, 0, 0, 0, 0, 0, (0.9, 0.1, 0.1, 1))],
    }
    p = SimpleNamespace(
        getNumBodies=lambda: 2, getBodyUniqueId=lambda i: (7, 9)[i],
        getVisualShapeData=shapes.get,
        changeVisualShape=lambda body, link, rgbaColor: painted.append((body, link, rgbaColor)),
    )  # fmt: skip
    count = robustness.paint(SimpleNamespace(p=p), (0.85, 0.1, 0.1, 1), robustness.BLUE)
    assert count == 2 and painted == [(7, 0, robustness.BLUE), (9, 0, robustness.BLUE)]
    assert max(robustness.BLUE[:3]) == robustness.BLUE[2]


def test_as_many_experts_are_filmed_as_in_the_papers_table_two():
    """15 human videos for AVID-m, 35 of the robot for the classifier reward."""
    assert (record.EXPERTS, tasks.ROBOT_EXPERTS) == (15, 35)


def test_a_smoke_run_trains_a_classifier_for_two_hundred_steps():
    args = job.parser("push").read(["--fast", "--method", "classifier"])
    small = recipe.recipe_of(tasks.push.RECIPE, args, False)
    assert (small.classifier_iterations, small.policy_steps) == (200, 530)


@pytest.mark.parametrize("name", ["K", "shift", "hue", "transporter_iterations", "robot_frames"])
def test_what_only_perception_takes_is_refused_where_none_is_trained(name):
    """And taken where one is."""
    args = job.parser("push").read(["--set", f"{name}=3"])
    with pytest.raises(commands.InputError, match="perception is not trained here"):
        recipe.read_settings(args, from_scratch=False)
    assert list(recipe.read_settings(args, from_scratch=True)) == [name]


@pytest.mark.parametrize("method", ["lbw", "avid"])
def test_how_many_frames_the_human_has_is_for_the_videos_to_say(method):
    args = job.parser("push").read(["--method", method, "--set", "human_frames=9"])
    with pytest.raises(commands.InputError, match="no 'human_frames'"):
        recipe.read_settings(args, from_scratch=True)


# The paper's page ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "plan"),
    [
        ([], (1, 10, 3, False)),
        (["--fast"], (6, 2, 1, True)),
        (["--fast", "--jobs", "2", "--episodes", "50"], (2, 2, 1, True)),
        (["--jobs", "4", "--episodes", "50", "--seeds", "2"], (4, 50, 2, False)),
    ],
)
def test_the_page_is_of_three_seeds_and_a_smoke_run_of_one_on_all_cores(
    line, plan, tmp_path, monkeypatch
):
    done = []
    monkeypatch.setattr(paper.os, "cpu_count", lambda: 6)
    monkeypatch.setattr(paper, "run_missing", lambda *a, **k: done.append((a, k)))
    monkeypatch.setattr(paper, "write", lambda asked: done.append(asked))
    paper.main([*line, "--out", str(tmp_path)])
    ((out, wanted, jobs, episodes), more), asked = done
    assert (asked.jobs, asked.episodes, asked.seeds, asked.fast) == plan
    assert (out, jobs, episodes, more) == (tmp_path / "runs", plan[0], plan[1], {"fast": plan[3]})
    assert wanted == paper.wanted(asked) and (tmp_path / "figures").is_dir()


def a_plan(out, fast=False, seeds=2):
    (out / "figures").mkdir(exist_ok=True)
    return paper.Plan(out=out, jobs=1, episodes=10, seeds=seeds, fast=fast)


def test_curves_are_of_all_seeds_of_each_method(tmp_path, monkeypatch):
    plan, seen = a_plan(tmp_path), {}
    monkeypatch.setattr(tasks, "TASKS", ("push",))
    for change, seeds in (("", 2), ("classifier", 2), ("avid", 2)):
        for seed in range(seeds):
            path = batch.folder(plan.runs, "push", seed, change)
            path.mkdir(parents=True)
            (path / "policy_log.json").write_text(json.dumps([path.name]))
    monkeypatch.setattr(figures, "over_steps", lambda logs: seen.update(logs))
    monkeypatch.setattr(paper, "shown", lambda plan, name, figure, alt: name)
    assert paper.over_steps(plan) == "steps"
    assert seen == {"push": {
        "LbW": [["push-0"], ["push-1"]],
        "Classifier reward": [["push-0-classifier"], ["push-1-classifier"]],
        "AVID-m": [["push-0-avid"], ["push-1-avid"]],
    }}  # fmt: skip


@pytest.mark.parametrize("fast", [False, True])
def test_eyes_are_asked_about_at_all_jitters_and_in_a_smoke_run_at_one(fast, tmp_path, monkeypatch):
    asked = []
    note = {"task": "push", "episodes": 10, "success": {"0.005": {"the policy": 1}}}
    monkeypatch.setattr(paper, "measured", lambda *of: asked.append(of[1:]) or [note])
    monkeypatch.setattr(figures, "over_jitter", lambda found, n: (found, n))
    monkeypatch.setattr(paper, "shown", lambda plan, name, figure, alt: f"{name} {figure}")
    monkeypatch.setattr(controls, "eyes_pay", lambda notes: "does it pay?")
    monkeypatch.setattr(controls, "side_by_side", lambda notes, jitter: f"at {jitter}")
    text = paper.needs_eyes(a_plan(tmp_path, fast))
    assert asked == [("", controls.JITTERS[:1] if fast else controls.JITTERS)]
    assert text.startswith(f"controls {({'push': note['success']}, 10)}") and "does it pay?" in text
    assert paper.needs_eyes_wide(a_plan(tmp_path)) == "at 0.02\ndoes it pay?"
    assert asked[1] == ("wide", (0.02,)) and batch.LATER["wide"][1][-1] == "0.02"


def test_a_motion_weighted_cyclegan_is_shown_where_one_was_trained(tmp_path):
    assert a_plan(tmp_path).cycles == {
        "CycleGAN": "avid", "CycleGAN with motion weights": "avid-motion",
    }  # fmt: skip
    assert a_plan(tmp_path, fast=True).cycles == {"CycleGAN": "avid"}


def test_the_method_is_shown_in_the_middle_of_both_films_and_the_tasks_a_little_later(
    tmp_path, monkeypatch
):
    """Where the arm is at work, not where it rests."""
    films = {name: np.arange(n)[:, None] for name, n in (("demo", 40), ("robot", 60))}
    seen = {}
    perception = SimpleNamespace(
        translated=100 + np.arange(40), z_E=200 + np.arange(40), detect=lambda f: 300 + f
    )
    monkeypatch.setattr(paper.translations, "munit", lambda runs: perception)
    monkeypatch.setattr(paper, "demo_of", lambda task: films["demo"])
    monkeypatch.setattr(paper, "robot_of", lambda task: films["robot"])
    monkeypatch.setattr(paper, "shown", lambda plan, name, figure, alt: figure)
    monkeypatch.setattr(paper.diagram, "method", lambda *what: what)
    monkeypatch.setattr(figures, "overview", lambda pairs: seen.update(pairs))
    human, translated, z, robot, own = paper.method(a_plan(tmp_path))
    assert (human[0], translated, z, robot[0], own[0]) == (20, 120, 220, 30, 330)
    paper.overview(a_plan(tmp_path))
    assert {tuple(int(f[0]) for f in pair) for pair in seen.values()} == {(22, 33)}
    assert tuple(seen) == tasks.TASKS


# Runs ---------------------------------------------------------------------------------------------


def test_runs_go_side_by_side_and_write_to_the_end_of_their_logs(tmp_path, monkeypatch):
    """Two wait for each other: one after the other they would wait for ever."""
    both, lines = Barrier(2, timeout=20), []

    def run(line, stdout, stderr):
        lines.append(line)
        both.wait()
        stdout.write("again\n")
        return SimpleNamespace(returncode=0)

    monkeypatch.setattr(batch.subprocess, "run", run)
    (tmp_path / "push-0.log").write_text("before\n")
    batch.run_missing(tmp_path, [("push", 0, ""), ("push", 1, "")], 2, 10, fast=True)
    assert (tmp_path / "push-0.log").read_text() == "before\nagain\n"
    assert all("--fast" in line for line in lines)


@pytest.mark.parametrize(("asked", "threads"), [([], 6), (["--threads", "2"], 2)])
def test_a_run_takes_all_cores_unless_told(asked, threads, tmp_path, monkeypatch):
    told = []
    monkeypatch.setattr(job.os, "cpu_count", lambda: 6)
    monkeypatch.setattr(job.torch, "set_num_threads", told.append)
    monkeypatch.setattr(job, "read_video", lambda *_, **__: np.zeros((3, 84, 84, 3), np.uint8))
    monkeypatch.setattr(job.tracks, "watch", lambda demo: None)
    argv = ["--method", "tracks", *asked, "--out", str(tmp_path)]
    made = job.check("push", job.parser("push").read(argv), argv)
    assert told == [threads]
    assert made.run.metrics["version"] == job.__version__ and made.run.metrics["machine"]


def test_the_options_set_are_noted_in_one_order_however_they_were_given(tmp_path, monkeypatch):
    """A run that is resumed with them in another order has the same settings."""
    monkeypatch.setattr(job, "read_video", lambda *_, **__: np.zeros((3, 84, 84, 3), np.uint8))
    monkeypatch.setattr(job.tracks, "watch", lambda demo: None)
    monkeypatch.setattr(job.torch, "set_num_threads", lambda n: None)
    for sets, resume in (
        (("updates=3", "entropy=-2"), []),
        (("entropy=-2", "updates=3"), ["--resume"]),
    ):
        argv = ["--method", "tracks", "--out", str(tmp_path), *resume]
        argv += [word for s in sets for word in ("--set", s)]
        job.check("push", job.parser("push").read(argv), argv)


def test_a_scene_and_a_film_are_made_of_the_first_test_episode_alone(monkeypatch):
    """A picture of each step is what costs most."""
    made, rendered = [], []

    class World:
        observation_space = None

        def __init__(self):
            self.unwrapped = self
            self.world = SimpleNamespace(render=lambda: rendered.append(1) or np.zeros((2, 2, 3)))

        def reset(self, seed):
            return np.zeros(3), {}

        def step(self, action):
            return np.zeros(3), 0.0, False, True, {"is_success": False, "reward_parts": {}}

    scene = SimpleNamespace(snap=lambda: None, html=lambda title: title)
    monkeypatch.setattr(run, "mirror", lambda env: made.append(env) or scene)
    run.evaluate(SimpleNamespace(act=lambda z, deterministic: None), World(), 3)
    assert len(made) == len(rendered) == 1


def test_a_benchmark_is_of_one_core(monkeypatch):
    told = []
    monkeypatch.setattr(bench.torch, "set_num_threads", told.append)
    for name in ("contest", "our_env", "env_steps", "iterations", "our_updates"):
        monkeypatch.setattr(bench, name, lambda *_, **__: None)
    for name in ("peers", "sb3_updates"):
        monkeypatch.setattr(bench, name, lambda *_: {})
    bench.main([])
    assert told == [1] and JITTER == 0.005
