"""The parts of the paper's page that look at films and runs: at which, and where they stand."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

import tasks
from tasks.commands import figures, paper


def plan(out, **more):
    """A plan with a folder for its figures."""
    (out / "figures").mkdir(exist_ok=True)
    return paper.Plan(**{"out": out, "jobs": 1, "episodes": 10, "seeds": 2, "fast": False} | more)


def film(n, first=0):
    """n frames, each of one grey level, which counts them."""
    return np.repeat(np.arange(first, first + n, dtype=np.uint8), 84 * 84 * 3).reshape(n, 84, 84, 3)


@pytest.fixture
def figure():
    return Figure(figsize=(1, 1))


def test_the_methods_picture_has_the_middles_of_both_films(tmp_path, monkeypatch, figure):
    """Human, translated and their keypoints of one moment, and the robot's with its own."""
    shown, z_E = [], np.arange(11)
    seen = SimpleNamespace(translated=film(11, 100), z_E=z_E, detect=lambda f: f[:, 0, 0, 0])
    monkeypatch.setattr(paper.translations, "munit", lambda runs: seen)
    monkeypatch.setattr(paper, "demo_of", lambda task: film(11))
    monkeypatch.setattr(paper, "robot_of", lambda task: film(21, 40))
    monkeypatch.setattr(paper.diagram, "method", lambda *what: shown.append(what) or figure)
    assert paper.method(plan(tmp_path)).startswith("![Human video to keypoints")
    human, translated, z_human, robot, z = shown[0]
    assert (human[0, 0, 0], translated[0, 0, 0], z_human) == (5, 105, 5)
    assert (robot[0, 0, 0], z) == (50, 50)


def test_the_overviews_frames_are_a_little_behind_the_middle_of_each_film(
    tmp_path, monkeypatch, figure
):
    shown = []
    monkeypatch.setattr(paper, "demo_of", lambda task: film(20))
    monkeypatch.setattr(paper, "robot_of", lambda task: film(40, 100))
    monkeypatch.setattr(paper.figures, "overview", lambda pairs: shown.append(pairs) or figure)
    paper.overview(plan(tmp_path))
    (pairs,) = shown
    assert list(pairs) == list(tasks.TASKS)
    assert [int(frame[0, 0, 0]) for frame in pairs["slide"]] == [11, 122]
    assert (tmp_path / "figures" / "tasks.png").exists()


def test_the_robots_film_is_its_experts_with_no_seed_but_0(monkeypatch):
    asked = []
    env = SimpleNamespace(close=lambda: asked.append("closed"))
    monkeypatch.setattr(paper.tasks, "bare", lambda task: asked.append(task) or env)
    monkeypatch.setattr(
        paper, "record_expert", lambda env, seed: asked.append(seed) or ("film", None, None)
    )
    assert paper.robot_of("push") == "film" and asked == ["push", 0, "closed"]


def test_curves_are_of_all_seeds_of_all_three_methods(tmp_path, monkeypatch, figure):
    some, shown = plan(tmp_path), []
    for task in tasks.TASKS:
        for change in ("", "-classifier", "-avid"):
            for seed in range(2):
                run = some.runs / f"{task}-{seed}{change}"
                run.mkdir(parents=True)
                (run / "policy_log.json").write_text(json.dumps([run.name]))
    monkeypatch.setattr(paper.figures, "over_steps", lambda logs: shown.append(logs) or figure)
    paper.over_steps(some)
    assert shown[0]["push"] == {
        "LbW": [["push-0"], ["push-1"]],
        "Classifier reward": [["push-0-classifier"], ["push-1-classifier"]],
        "AVID-m": [["push-0-avid"], ["push-1-avid"]],
    }
    assert list(shown[0]) == list(tasks.TASKS)


@pytest.mark.parametrize(("fast", "jitters"), [(False, 4), (True, 1)])
def test_a_smoke_run_meets_the_controls_at_one_jitter(fast, jitters, tmp_path, monkeypatch, figure):
    def measure(task, run, episodes, seed, beside, at, brief):
        robots = dict.fromkeys(("the policy", *paper.controls.BLIND), 1)
        return {"task": task, "episodes": 10, "success": {str(jitter): robots for jitter in at}}

    shown = []
    monkeypatch.setattr(paper.controls, "measure", measure)
    monkeypatch.setattr(
        paper.figures, "over_jitter", lambda found, n: shown.append((found, n)) or figure
    )
    text = paper.needs_eyes(plan(tmp_path, fast=fast))
    ((found, episodes),) = shown
    assert list(found) == list(tasks.TASKS) and episodes == 10
    assert len(found["push"]) == jitters and found["push"]["0.005"]["idle"] == 1
    assert text.count("| idle |") == 5 and "no: 1 to 1" in text and text.startswith("![Success")


def test_perception_is_measured_once_for_each_form_of_translation(tmp_path, monkeypatch):
    asked = []
    names = ("tip_x", "tip_y", "object_x", "object_y")

    def scores(runs, cycles):
        asked.append((runs, dict(cycles)))
        rows = {n: {"r2": k / 10 if k else None} for k, n in enumerate(names)}
        return {"MUNIT": {"translated": rows, "transfer": rows}}

    monkeypatch.setattr(paper.translations, "scores", scores)
    some = plan(tmp_path)
    text = paper.perception(some)
    assert text.splitlines()[0] == "| frames | tip x | tip y | object x | object y |"
    assert text.splitlines()[2] == "| MUNIT, translated | - | 0.100 | 0.200 | 0.300 |"
    assert paper.perception(some) == text and len(asked) == 1
    assert asked[0][1] == {"CycleGAN": "avid", "CycleGAN with motion weights": "avid-motion"}
    assert plan(tmp_path, fast=True).cycles == {"CycleGAN": "avid"}


def test_figure_5_is_of_the_pages_runs(tmp_path, monkeypatch, figure):
    asked = []
    monkeypatch.setattr(paper.translations, "strips", lambda *what: asked.append(what) or figure)
    some = plan(tmp_path, fast=True)
    assert "(figures/push.svg)" in paper.translated(some)
    assert asked == [(tmp_path / "runs", {"CycleGAN": "avid"})]


@pytest.mark.parametrize(
    ("argv", "wanted"),
    [
        (["--fast"], {"episodes": 2, "seeds": 1, "fast": True}),
        (["--fast", "--jobs", "3"], {"episodes": 2, "seeds": 1, "fast": True, "jobs": 3}),
        ([], {"episodes": 10, "seeds": 3, "fast": False, "jobs": 1}),
        (["--episodes", "7", "--seeds", "2"], {"episodes": 7, "seeds": 2, "jobs": 1}),
    ],
)
def test_what_is_missing_is_run_before_the_page_is_written(argv, wanted, tmp_path, monkeypatch):
    done = []

    def run(runs, jobs, at_a_time, episodes, fast):
        done.append((runs, len(jobs), at_a_time, episodes, fast))

    monkeypatch.setattr(paper, "run_missing", run)
    monkeypatch.setattr(paper, "write", done.append)
    paper.main([*argv, "--out", str(tmp_path)])
    ran, made = done
    assert {name: getattr(made, name) for name in wanted} == wanted
    assert ran == (
        tmp_path / "runs", len(paper.wanted(made)), made.jobs, made.episodes, made.fast,
    )  # fmt: skip
    assert (tmp_path / "figures").is_dir()


def test_a_whole_page_has_what_a_smoke_run_leaves_out(tmp_path, monkeypatch, figure):
    """Trainings with moved starts, longer ones, and more videos: from runs that are all alike."""
    row = {"wins": 1, "episodes": 2, "stages": {"policy": 60}, "steps": 1000}
    monkeypatch.setattr(paper, "read", lambda *_: row)
    for name in ("table_one", "overview", "method", "over_steps", "needs_eyes", "translated"):
        monkeypatch.setattr(paper, name, lambda *_, name=name: f"{name}\n")
    monkeypatch.setattr(paper, "perception", lambda _: "R²\n")
    monkeypatch.setattr(paper, "needs_eyes_wide", lambda _: "eyes\n")
    text = paper.write(plan(tmp_path)).with_suffix(".md").read_text(encoding="utf-8")
    heads = [line for line in text.splitlines() if line.startswith("## ")]
    assert len(heads) == 13 and "smoke" not in text
    assert heads[-4:] == [
        "## Trained with starts moved by 2 cm", "## Does that need to see?",
        "## The rivals with three times the steps", "## Success over human videos, push",
    ]  # fmt: skip
    assert text.rstrip().endswith("`python -m tasks push --videos N`")


def test_a_strip_shows_as_many_moments_of_each_film_from_first_to_last():
    figure = figures.strips({"human": film(11), "MUNIT": film(11, 100)}, n=3)
    levels = [int(axis.images[0].get_array()[0, 0, 0]) for axis in figure.axes]
    assert levels == [0, 5, 10, 100, 105, 110]
    assert [axis.get_ylabel() for axis in figure.axes] == ["human", "", "", "MUNIT", "", ""]
