"""A run from its job to its line of result, with methods that are not carried out."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from lbw_minimal.clips.stills import write_stills
from lbw_minimal.imitate import Recipe, Run
from tasks.commands import controls, probe, record, robustness, run

RECIPE = Recipe(human_frames=1, robot_frames=70)


def film(level, n=2):
    return np.full((n, 84, 84, 3), level, np.uint8)


def a_job(out, **args):
    given = {"method": "lbw", "weights": None, "evaluate": False, "jitter": 0.01, "seed": 4,
             "device": None, "fast": False, "episodes": None}  # fmt: skip
    out.mkdir(exist_ok=True)
    return SimpleNamespace(
        name="push", recipe=RECIPE, run=Run(out), args=SimpleNamespace(**(given | args)),
        demo=film(1), experts=[film(1), film(2)], random=film(3), weights=out / "weights",
        command="python -m tasks push",
    )  # fmt: skip


@pytest.mark.parametrize("method", ["lbw", "tracks", "avid", "classifier"])
def test_a_method_is_carried_out_then_tested_and_then_reported(method, tmp_path, monkeypatch):
    done = []
    job = a_job(tmp_path / "run", method=method)
    seer = SimpleNamespace(translated="translated", z_E="z_E")
    monkeypatch.setattr(run, "parser", lambda name: SimpleNamespace(read=lambda argv: (name, argv)))
    monkeypatch.setattr(run, "check", lambda name, args, argv: job)
    monkeypatch.setattr(run, "perceive", lambda job: (seer, "robot's film"))
    monkeypatch.setattr(run, "learn", lambda *asked: done.append(asked) or ("lbw", "env"))
    monkeypatch.setattr(run, "track", lambda job: ("tracks", "env", {"demo": "tracked"}))
    monkeypatch.setattr(run, "rival", lambda job: ("rival", "env", {"demo": "shown"}))
    monkeypatch.setattr(run, "test", lambda *asked: done.append(asked) or ("first", "scene"))
    monkeypatch.setattr(run, "report", lambda *asked: done.append(asked))
    run.main("push", ["--fast"])
    *learnt, tested, reported = done
    agent = {"lbw": "lbw", "tracks": "tracks"}.get(method, "rival")
    assert tested == (job, agent, "env") and reported[0] is job
    assert reported[2:] == ("first", "scene")
    if method == "lbw":
        assert learnt == [(job, seer, "robot's film")]
        seen = reported[1]
        assert seen.pop("demo") is job.demo
        assert seen == {"translated": "translated", "z_demo": "z_E"}
    else:
        assert reported[1] == {"demo": "tracked" if method == "tracks" else "shown"}


@pytest.fixture
def rivals(monkeypatch):
    """What the rivals are asked for; a translation adds 100, a logit is a frame's level."""
    told = []

    def learn_avid(env, experts, random, robot, recipe, **common):
        told.append(("avid", len(experts), int(random[0, 0, 0, 0]), len(robot), recipe, common))
        return "avid's agent", "its env"

    def learn_classifier(env, videos, random, recipe, **common):
        told.append(("classifier", len(videos), len(random), recipe, common))
        return "classifier's agent", "its env"

    def replayed(env, out, task):
        told.append(("replayed", out.name, task))
        return "a replay", "its env"

    fake = SimpleNamespace(avid_m=learn_avid, classifier_reward=learn_classifier, replayed=replayed)
    monkeypatch.setattr(run, "rivals", fake)
    monkeypatch.setattr(run.gym, "make", lambda name, jitter: told.append((name, jitter)))
    monkeypatch.setattr(run, "bring", lambda job, *names: told.append(("brought", *names)))
    monkeypatch.setattr(run, "film_robot", lambda job, n: told.append(("filmed", n)) or film(50, n))
    monkeypatch.setattr(
        run.tasks, "robot_experts", lambda *of: ((film(60 + i), of) for i in range(3))
    )
    monkeypatch.setattr(
        run, "cyclegan",
        SimpleNamespace(
            load=lambda path, task: path.name, translate=lambda G, frames: frames + np.uint8(100)
        ),
    )  # fmt: skip
    monkeypatch.setattr(
        run, "classifier",
        SimpleNamespace(
            load=lambda path, task: path.name, logits=lambda model, f: [int(v[0, 0, 0]) for v in f]
        ),
    )  # fmt: skip
    return told


def test_avid_learns_from_all_human_videos_and_shows_the_first_translated(rivals, tmp_path):
    job = a_job(tmp_path / "run", method="avid", device="cuda")
    agent, env, seen = run.rival(job)
    common = {"task": "push", "seed": 4, "run": job.run, "device": "cuda"}
    assert rivals == [
        ("LbW-Push-v0", 0.01), ("filmed", 70), ("avid", 2, 3, 70, RECIPE, common),
    ]  # fmt: skip
    assert (agent, env) == ("avid's agent", "its env")
    assert seen["demo"] is job.demo and (seen["translated"] == 101).all()
    assert seen["logits"] == [101, 101]  # of what the classifier was shown


def test_avid_on_a_translation_that_is_there_films_no_robot(rivals, tmp_path):
    run.rival(a_job(tmp_path / "run", method="avid", weights="there"))
    assert rivals[0] == ("brought", "translation") and rivals[2][:4] == ("avid", 2, 3, 0)


@pytest.mark.parametrize("negatives", [True, False])
def test_the_classifier_reward_is_shown_the_robots_experts(negatives, rivals, tmp_path):
    job = a_job(tmp_path / "run", method="classifier")
    job.recipe = Recipe(human_frames=1, robot_frames=70, random_negatives=negatives)
    _, _, seen = run.rival(job)
    name, videos, random, *_ = rivals[-1]
    assert (name, videos, random) == ("classifier", 3, 70 if negatives else 0)
    assert (("filmed", 70) in rivals) == negatives
    assert (seen["demo"] == 60).all() and seen["logits"] == [60, 60]
    assert "robot_experts" in job.run.metrics["stages"]


@pytest.mark.parametrize(
    ("method", "brought"),
    [("avid", ("translation", "classifier", "policy")), ("classifier", ("classifier", "policy"))],
)
def test_a_replay_of_a_rival_brings_its_networks_and_trains_none(
    method, brought, rivals, tmp_path, monkeypatch
):
    job = a_job(tmp_path / "run", method=method, weights="there", evaluate=True)
    filmed = []
    films = ((film(60 + i), filmed.append(i)) for i in range(3))
    monkeypatch.setattr(run.tasks, "robot_experts", lambda *_: films)
    agent, _, _ = run.rival(job)
    assert filmed == [0] * (method == "classifier")  # for a look; an expert takes seconds
    assert rivals == [
        ("brought", *brought), ("LbW-Push-v0", 0.01), ("replayed", "run", "push"),
    ]  # fmt: skip
    assert agent == "a replay"


def test_weights_are_copied_to_the_run(tmp_path):
    job = a_job(tmp_path / "run")
    job.weights.mkdir()
    for name in ("translation", "keypoints", "policy"):
        (job.weights / f"{name}.safetensors").write_text(name)
    run.bring(job, "translation", "policy")
    assert {p.name for p in job.run.out.glob("*.safetensors")} == {
        "translation.safetensors", "policy.safetensors",
    }  # fmt: skip


def test_the_result_is_a_line_with_wins_and_their_interval(tmp_path, monkeypatch, capsys):
    job, page = a_job(tmp_path / "run"), {}
    job.run.metrics["success"] = {"rate": 0.9, "low": 0.596, "high": 0.982, "episodes": 10}
    monkeypatch.setattr(run, "write_report", lambda path, **what: page.update(what, path=path))
    run.report(job, {"demo": "d"}, {"frames": "f"}, "<scene>")
    assert capsys.readouterr().out.splitlines() == [
        "push: 9/10 successes (95% CI 0.60-0.98)", f"report: {tmp_path / 'run' / 'report.html'}",
    ]  # fmt: skip
    assert (
        page["clip"] is None
        and page["log"] == []
        and page["demo"] == "d"
        and page["episode"] == {"frames": "f"}
    )
    assert page["goal"] == "the cube's centre gets to within 5 cm of the green disc's"
    assert (page["scene_html"], page["command"]) == ("<scene>", "python -m tasks push")
    (job.run.out / "policy_log.json").write_text(json.dumps([{"step": 1}]))
    write_stills(job.run.out / "stills.webp", np.zeros((3, 8, 8, 3), np.uint8))
    run.report(job, {}, {}, "")
    assert page["log"] == [{"step": 1}] and len(page["clip"]) == 3


# What other commands print of what they measure.


def test_probe_measures_frames_of_seeds_behind_its_own_and_prints_a_row_a_number(
    monkeypatch, capsys
):
    asked = []
    row = {name: {"r2": 0.5, "px": 1.25} for name in probe.NAMES}
    found = {where: row for where in probe.SETS} | {"contact_px": {"robot": 3}, "keypoint_std": [1]}
    monkeypatch.setattr(probe.tasks, "trained_perception", lambda *of: asked.append(of) or "seer")
    monkeypatch.setattr(probe, "probe", lambda *of: asked.append(of) or found)
    probe.main(["slide", "--seed", "5", "--frames", "200"])
    assert asked == [("slide", None), ("slide", "seer", 2_000_005, 200)]
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split() == list(probe.SETS)
    assert [line.split()[0] for line in lines[2:6]] == list(probe.NAMES)
    assert lines[6:] == ["contact_px: {'robot': 3}", "keypoint_std: [1]"]


def test_robustness_prints_wins_of_its_episodes_with_their_interval(monkeypatch, capsys):
    asked = []
    monkeypatch.setattr(
        robustness, "robustness", lambda *of: asked.append(of) or {"as trained": 9, "darker": 0}
    )
    robustness.main(["push", "--episodes", "10", "--seed", "2"])
    assert asked == [("push", robustness.tasks.WEIGHTS / "push", 10, 2)]
    assert capsys.readouterr().out.splitlines()[2:] == [
        "| as trained | 9/10 | 60-98 % |", "| darker | 0/10 | 0-28 % |",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("jitter", "at"), [([], controls.JITTERS), (["--jitter", "0.03"], (0.03,))]
)
def test_controls_are_noted_and_printed_at_every_jitter(jitter, at, tmp_path, monkeypatch, capsys):
    asked = []

    def compare(task, weights, jitter, episodes, seed, beside, **few):
        asked.append((task, weights.name, jitter, episodes, seed, beside, few))
        return {"the policy": 3, "idle": 0}

    monkeypatch.setattr(controls, "compare", compare)
    rival = tmp_path / "rival"
    rival.mkdir()
    (rival / "settings.json").write_text(json.dumps({"method": "avid"}))
    argv = ["push", *jitter, "--episodes", "4", "--seed", "2", "--beside", str(rival)]
    controls.main([*argv, "--out", str(tmp_path / "out")])
    assert asked == [("push", "push", j, 4, 2, {"AVID-m": rival}, {}) for j in at]
    note = json.loads((tmp_path / "out" / "push.json").read_text())
    assert note["success"] == {str(j): {"the policy": 3, "idle": 0} for j in at}
    assert (note["task"], note["episodes"], note["seed"]) == ("push", 4, 2)
    assert "| the policy | 3/4 (30-95 %) |" in capsys.readouterr().out
    brief = controls.measure("push", rival, 4, 2, {}, (0.1,), brief=True)
    assert asked[-1][-1] == {"library": 2, "trials": 1} and list(brief["success"]) == ["0.1"]


def test_the_robots_experts_are_kept_where_no_run_looks(tmp_path, monkeypatch, capsys):
    written, asked = {}, []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        record.tasks, "robot_experts", lambda *of: asked.append(of) or iter([("a", 1), ("b", 2)])
    )
    monkeypatch.setattr(
        record.video, "write", lambda path, film, fps: written.update({path.name: (film, fps)})
    )
    monkeypatch.setattr(
        record, "save_recordings", lambda path, all_: written.update({path.as_posix(): all_})
    )
    record.main(["push", "--robot"])
    assert asked == [("push", 0.005)]
    assert written == {
        "expert_01.mp4": ("a", 25), "expert_02.mp4": ("b", 25),
        "runs/robot/push/experts.npz": [1, 2],
    }  # fmt: skip
    assert "2 expert videos of the robot" in capsys.readouterr().out
