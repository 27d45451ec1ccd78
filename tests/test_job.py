"""What a run is asked to do, piece by piece: folders, settings, files, numbers."""

import hashlib
import json
from argparse import Namespace
from types import SimpleNamespace

import numpy as np
import pytest
from digests import options

import tasks
from lbw_minimal import sac
from lbw_minimal.imitate import Recipe, Run
from lbw_minimal.training import InputError
from tasks.commands import job
from tasks.commands.job import prepare_folder, videos
from tasks.commands.recipe import METHODS, fields_of, read_number, read_settings, recipe_of


def test_a_new_run_clears_an_older_runs_results_and_nothing_else(tmp_path):
    prepare_folder(tmp_path, {"seed": 0}, resume=False)
    old = ("policy.checkpoint", "policy.frames", "policy.safetensors", "policy_log.json",
           "metrics.json", "report.html", "prepare.html", "reenactment.mp4",
           "stills.webp", "prepare.json")  # fmt: skip
    for name in (*old, "thesis.txt", "notes.json"):
        (tmp_path / name).write_text("")
    assert prepare_folder(tmp_path, {"seed": 1}, resume=False) == tmp_path
    assert {p.name for p in tmp_path.iterdir()} == {"thesis.txt", "notes.json", "settings.json"}
    assert json.loads((tmp_path / "settings.json").read_text()) == {"seed": 1}


def test_who_replaces_an_earlier_run_of_other_settings_is_told(tmp_path, capsys):
    prepare_folder(tmp_path, {"seed": 0}, resume=False)
    prepare_folder(tmp_path, {"seed": 0}, resume=False)
    assert capsys.readouterr().err == ""
    prepare_folder(tmp_path, {"seed": 1}, resume=False)
    said = f"note: {tmp_path}: an earlier run with other settings is replaced.\n"
    assert capsys.readouterr().err == said


def test_a_smoke_run_replaces_no_whole_run_that_has_learnt(tmp_path):
    prepare_folder(tmp_path, {"fast": False}, resume=False)
    prepare_folder(tmp_path, {"fast": True}, resume=False)  # a replay is soon done again
    for fast in (True, False):  # over a smoke run both may go
        (tmp_path / "policy_log.json").write_text("[]")
        prepare_folder(tmp_path, {"fast": fast}, resume=False)
    (tmp_path / "policy_log.json").write_text("[]")
    with pytest.raises(InputError, match="a smoke run would replace the whole run"):
        prepare_folder(tmp_path, {"fast": True}, resume=False)
    assert (tmp_path / "policy_log.json").exists()


def test_what_looks_like_results_in_a_folder_without_a_run_is_somebody_elses(tmp_path):
    (tmp_path / "metrics.json").write_text("a thesis")
    prepare_folder(tmp_path, {"seed": 0}, resume=False)
    assert (tmp_path / "metrics.json").read_text() == "a thesis"


def test_a_run_is_gone_on_with_by_its_own_settings_alone(tmp_path):
    with pytest.raises(InputError, match="there is no run to resume"):
        prepare_folder(tmp_path, {"seed": 0}, resume=True)
    prepare_folder(tmp_path, {"seed": 0}, resume=False)
    (tmp_path / "policy.checkpoint").write_text("half of it")
    assert prepare_folder(tmp_path, {"seed": 0}, resume=True) == tmp_path
    assert (tmp_path / "policy.checkpoint").read_text() == "half of it"
    with pytest.raises(InputError, match="that run had other settings"):
        prepare_folder(tmp_path, {"seed": 1}, resume=True)


@pytest.mark.parametrize("bad", ['{"fast": tr', "", b"\xff\xfe{"])
def test_settings_that_are_no_json_are_named_and_a_new_run_replaces_them(tmp_path, bad):
    note = tmp_path / "settings.json"
    note.write_bytes(bad if isinstance(bad, bytes) else bad.encode())
    (tmp_path / "policy_log.json").write_text("[]")
    for ask in (job.settings_of, Run, lambda out: prepare_folder(out, {"fast": True}, False),
                lambda out: prepare_folder(out, {"fast": True}, True)):  # fmt: skip
        (tmp_path / "metrics.json").write_bytes(note.read_bytes())
        with pytest.raises(InputError, match=r"(settings|metrics)\.json: this is no JSON, or half"):
            ask(tmp_path)
    prepare_folder(tmp_path, {"fast": False}, resume=False)
    assert job.settings_of(tmp_path) == {"fast": False}


@pytest.mark.parametrize(
    ("value", "kind", "number"),
    [
        ("1", "bool", True), ("0", "bool", False), ("1", "int", 1), ("200", "int", 200),
        ("-2.5", "float", -2.5), ("0", "float", 0.0), ("1e3", "float", 1000.0),
    ],
)  # fmt: skip
def test_a_setting_is_a_number_of_its_fields_kind(value, kind, number):
    read = read_number(f"x={value}", value, kind)
    assert read == number and type(read) is type(number)


@pytest.mark.parametrize(
    ("value", "kind", "what"),
    [
        ("2", "bool", "neither 0 nor 1"), ("yes", "bool", "neither 0 nor 1"),
        ("0", "int", "no whole number of 1 or more"), ("1.5", "int", "no whole number"),
        ("inf", "float", "no finite number"), ("", "float", "no finite number"),
    ],
)  # fmt: skip
def test_what_is_no_number_of_that_kind_is_named(value, kind, what):
    with pytest.raises(InputError, match=f"--set x={value}: '{value}' is {what}"):
        read_number(f"x={value}", value, kind)


def test_the_logit_that_earns_a_reward_of_1_is_above_0():
    """By 0 it would be divided once the classifier has learnt; by less, the goal would cost."""

    def given(value):
        args = Namespace(method="classifier", set=[f"clip={value}"], weights=None)
        return read_settings(args, from_scratch=False)

    assert given("0.5") == {"clip": 0.5}
    for value in ("0", "-5"):
        with pytest.raises(InputError, match=f"--set clip={value}: '{value}' is no number above 0"):
            given(value)


def test_each_method_notes_the_fields_that_it_takes():
    recipe = Recipe(human_frames=3, robot_frames=4, policy_steps=50, hold=7, K=6)
    assert {m: set(fields_of(recipe, m)) for m in METHODS} == {
        "lbw": {
            "human_frames", "robot_frames", "munit_iterations", "munit_width", "K", "shift", "hue",
            "transporter_iterations", "policy_steps", "updates", "entropy",
        },
        "avid": {
            "human_frames", "robot_frames", "munit_iterations", "munit_width", "motion", "hold",
            "classifier_iterations", "random_negatives", "clip", "pixel_updates", "policy_steps",
            "entropy",
        },
        "classifier": {
            "classifier_iterations", "random_negatives", "clip", "pixel_updates", "hold",
            "policy_steps", "entropy",
        },
        "tracks": {"policy_steps", "updates", "entropy"},
    }  # fmt: skip
    assert fields_of(recipe, "classifier")["hold"] == 7 and fields_of(recipe, "lbw")["K"] == 6


def test_the_human_videos_are_the_first_of_the_kits_or_the_users_own():
    def names(**given):
        args = Namespace(**({"video": None, "videos": None, "method": "lbw"} | given))
        return [path.name for path in videos("push", args)]

    assert names() == names(method="tracks") == ["expert_01.mp4"]
    assert names(videos=3) == ["expert_01.mp4", "expert_02.mp4", "expert_03.mp4"]
    assert names(method="avid")[-1] == "expert_15.mp4" and len(names(method="avid")) == 15
    assert len(names(videos=15)) == 15
    assert names(method="avid", videos=1) == ["expert_01.mp4"] and names(method="classifier") == []
    assert names(video=tasks.ROOT / "my.mp4", videos=3) == ["my.mp4"]
    with pytest.raises(InputError, match="push has 15 human videos"):
        names(videos=16)


def test_what_is_odd_about_a_video_is_said_and_its_frames_are_taken(tmp_path, monkeypatch, capsys):
    film, asked = np.zeros((3, 84, 84, 3), np.uint8), []
    monkeypatch.setattr(
        job.video, "read", lambda *how: asked.append(how) or (film, ["it is dark.", "it jumps."])
    )
    assert job.read_video(tmp_path, whole=True) is film and asked == [(tmp_path, True)]
    assert capsys.readouterr().err == "warning: it is dark.\nwarning: it jumps.\n"
    job.read_video(tmp_path)  # the longest piece between cuts, unless all of it is asked for
    assert asked[1] == (tmp_path, False)


@pytest.mark.parametrize(
    ("method", "wanted"),
    [
        ("lbw", ["sac"]), ("tracks", ["sac"]), ("classifier", ["sac_ae", "classifier of push"]),
        ("avid", ["sac_ae", "classifier of push", "cyclegan of push"]),
    ],
)  # fmt: skip
def test_a_replay_has_to_have_all_networks_of_its_method(method, wanted, tmp_path, monkeypatch):
    loaded = []
    files = {"sac": "policy", "sac_ae": "policy", "classifier": "classifier"}
    for name in ("sac", "sac_ae", "classifier", "cyclegan"):

        def load(path, task="", name=name):
            assert path == tmp_path / f"{files.get(name, 'translation')}.safetensors"
            loaded.append(f"{name} of {task}" if task else name)

        monkeypatch.setattr(job, name, SimpleNamespace(load=load))
    job.check_weights(tmp_path, "push", method)
    assert loaded == wanted


@pytest.mark.parametrize("method", ["lbw", "tracks"])
def test_a_policy_of_another_task_is_not_replayed(method, tmp_path):
    """By object tracks each task's policy sees fifteen numbers, so its file would fit."""
    sac.save(tmp_path / "policy.safetensors", sac.SAC(15, 3))
    job.check_weights(tmp_path, "push", method)  # nothing is noted there
    (tmp_path / "settings.json").write_text('{"task": "slide", "method": "tracks"}')
    job.check_weights(tmp_path, "slide", method)
    with pytest.raises(InputError) as told:
        job.check_weights(tmp_path, "push", method)
    assert str(told.value) == (
        f"{tmp_path}: a run of the task slide, not of push; give one of push."
    )


def test_a_job_notes_what_makes_the_run_again(tmp_path, monkeypatch):
    """And the frames that it learns from: the first sixteen digits of their sum."""
    film = np.arange(3 * 84 * 84 * 3, dtype=np.uint8).reshape(3, 84, 84, 3)
    monkeypatch.setattr(job, "read_video", lambda path, whole=False: film[: 1 + whole])
    argv = ["--method", "tracks", "--seed", "3", "--jitter", "0.01", "--out", str(tmp_path / "a b")]
    argv += ["--set", "updates=3", "--set", "entropy=-2", "--threads", "1"]
    monkeypatch.setattr(job.tracks, "watch", lambda demo: None)
    made = job.check("push", job.parser("push").read(argv), argv)
    settings = made.run.metrics["settings"]
    assert settings == json.loads((tmp_path / "a b" / "settings.json").read_text())
    recipe = {"policy_steps": 3000, "updates": 3, "entropy": -2.0}
    assert settings | {"video": ""} == {
        "task": "push", "seed": 3, "method": "tracks", "reward": "mended", "without": None,
        "fast": False, "from_scratch": False, "jitter": 0.01, "video": "",
        "set": ["entropy=-2", "updates=3"], "recipe": recipe,
    }  # fmt: skip
    assert len(settings["video"]) == 16 and made.recipe.updates == 3
    assert made.command.startswith("python -m tasks push --method tracks --seed 3")
    assert made.command.endswith("--threads 1") and f"'{tmp_path / 'a b'}'" in made.command
    assert made.random.shape == (0, 84, 84, 3) and made.trained is None and len(made.demo) == 1


@pytest.mark.parametrize(
    ("task", "given", "steps"),
    [
        ("push", ["--video", "my.mp4"], 6000),
        ("coffee", ["--video", "my.mp4"], 10_000),
        ("slide", ["--video", "my.mp4"], 20_000),
        ("push", [], 3000),
        ("push", ["--video", "my.mp4", "--fast"], 800),
        ("push", ["--video", "my.mp4", "--translate-clip"], 3000),
        ("push", ["--video", "my.mp4", "--method", "tracks"], 3000),
        ("push", ["--video", "my.mp4", "--set", "policy_steps=50"], 50),
    ],
)
def test_a_policy_that_follows_a_persons_clip_practises_twice_as_long(task, given, steps):
    args = job.parser(task).read(given)
    recipe = tasks.module(task).RECIPE
    scratch = args.fast or args.translate_clip
    assert recipe_of(recipe, args, scratch).policy_steps == steps


def test_a_smoke_run_is_of_smoke_sizes_and_what_is_set_comes_before_them(tmp_path, monkeypatch):
    film = np.zeros((3, 84, 84, 3), np.uint8)
    monkeypatch.setattr(job, "read_video", lambda path, whole=False: film)
    monkeypatch.setattr(job.tracks, "watch", lambda demo: None)

    def recipe(*more):
        argv = ["--fast", "--out", str(tmp_path), *more]
        return job.check("slide", job.parser("slide").read(argv), argv).recipe

    smoke = recipe()
    assert (smoke.munit_iterations, smoke.munit_width, smoke.transporter_iterations) == (10, 8, 20)
    assert (smoke.policy_steps, smoke.robot_frames, smoke.updates) == (800, 200, 4)
    assert recipe("--set", "policy_steps=900").policy_steps == 900
    assert recipe("--method", "avid").policy_steps == 530
    assert recipe("--method", "tracks").policy_steps == 800


def test_what_is_random_is_read_whole_where_a_translation_learns_and_joined_by_further_experts(
    tmp_path, monkeypatch
):
    """The demonstration is learnt from by itself. A replay learns from nothing."""
    read = []

    def read_video(path, whole=False):
        read.append((path.name, whole))
        level = 99 if path.name == "random.mp4" else int(path.stem[-2:])
        return np.full((2, 84, 84, 3), level, np.uint8)

    def random(*line):
        argv = [*line, "--threads", "1", "--out", str(tmp_path)]
        made = job.check("push", job.parser("push").read(argv), argv)
        return made.random[:, 0, 0, 0].tolist()

    monkeypatch.setattr(job, "read_video", read_video)
    monkeypatch.setattr(job, "check_weights", lambda *_: None)
    assert random("--from-scratch", "--videos", "3") == [99, 99, 2, 2, 3, 3]
    assert read == [*((f"expert_0{i}.mp4", False) for i in (1, 2, 3)), ("random.mp4", True)]
    assert random("--method", "avid", "--videos", "2") == [99, 99]
    weights = ["--weights", str(tmp_path / "there")]
    assert random("--method", "avid", "--evaluate", *weights) == []
    assert random("--method", "classifier") == []


def refused(name, *argv):
    """What a command line is refused with, or "-"; nothing is looked at but the options."""
    args = job.parser(name).read([*argv])
    lbw = args.method == "lbw"
    try:
        job.refuse_idle_options(
            args, lbw and (args.from_scratch or args.fast or args.translate_clip)
        )
    except InputError as error:
        return str(error)
    return "-"


def test_what_does_nothing_beside_the_other_options_is_refused_as_it_was(golden):
    """Each option beside each method, to train and to replay, and pairs of options."""
    methods = {
        "lbw": (), "scratch": ("--from-scratch",), "fast": ("--fast",),
        "replay": ("--evaluate",),
        "replay tracks": ("--evaluate", "--method", "tracks", "--weights", "w"),
        "replay avid": ("--evaluate", "--method", "avid", "--weights", "w"),
        "avid": ("--method", "avid"), "classifier": ("--method", "classifier"),
        "tracks": ("--method", "tracks"), "clip": ("--video", "my.mp4"),
        "literal": ("--reward", "literal"),
        "blind replay": ("--evaluate", "--method", "classifier"),
    }  # fmt: skip
    options = (
        ("--videos", "1"), ("--videos", "2"), ("--from-scratch",), ("--without", "trim"),
        ("--reward", "literal"), ("--set", "K=3", "--set", "hue=2"),
        ("--weights", "w"), ("--fast",),
        ("--device", "cpu"), ("--video", "a.mp4"), ("--translate-clip",), ("--resume",),
        ("--video", "a.mp4", "--translate-clip"), ("--video", "a.mp4", "--videos", "1"),
    )  # fmt: skip
    said = {}  # each sentence once; which, for each pair, by number
    table = {
        name: [said.setdefault(refused("push", *argv, *option), len(said)) for option in options]
        for name, argv in methods.items()
    }
    golden(table | {"said": list(said)})


def test_the_arguments_of_a_run_are_what_they_were(golden):
    parser = job.parser("slide")
    golden(
        {
            "options": list(options(parser)),
            "says": [parser.description, parser.prog],
            "help": [a.help for a in parser._actions if a.dest in ("out", "episodes", "videos")],
            "episodes": job.TEST_EPISODES,
            "results": list(job.RESULTS),
        }
    )


@pytest.mark.parametrize(
    ("argv", "read", "trained", "recipe"),
    [
        ([], ["expert_01.mp4"], True, 3000),
        (["--from-scratch"], ["expert_01.mp4", "random.mp4 whole"], False, 3000),
        (["--fast"], ["expert_01.mp4", "random.mp4 whole"], False, 800),
        (["--evaluate"], ["expert_01.mp4"], True, 3000),
        (["--video", "my.mp4", "--translate-clip"], ["my.mp4"], False, 3000),
        (["--method", "classifier"], [], False, 3000),
        (["--method", "tracks"], ["expert_01.mp4"], False, 3000),
    ],
)
def test_what_a_run_reads_and_loads_is_what_it_learns_from(
    argv, read, trained, recipe, tmp_path, monkeypatch
):
    """And the threads and the machine that are noted."""
    seen, watched, threads, checked = [], [], [], []

    def read_video(path, whole=False):
        seen.append(path.name + " whole" * whole)
        return np.full((2 + whole, 84, 84, 3), len(seen), np.uint8)

    monkeypatch.setattr(job, "read_video", read_video)
    monkeypatch.setattr(job.tracks, "watch", watched.append)
    monkeypatch.setattr(job, "load_perception", lambda folder, name: (folder.name, name))
    monkeypatch.setattr(job, "check_weights", lambda *what: checked.append(what))
    monkeypatch.setattr(job.torch, "set_num_threads", threads.append)
    monkeypatch.setattr(job.os, "cpu_count", lambda: 6)
    monkeypatch.setattr(job.platform, "machine", lambda: "toy")
    line = [*argv, "--out", str(tmp_path / "out"), "--seed", "5"]
    made = job.check("push", job.parser("push").read(line), line)
    assert seen == read and threads == [6] and made.recipe.policy_steps == recipe
    assert made.trained == (("push", "push") if trained else None)
    assert len(watched) == ("tracks" in argv) and made.weights == tasks.WEIGHTS / "push"
    assert len(made.random) == 3 * ("random.mp4 whole" in read) and made.random.shape[1:] == (
        84,
        84,
        3,
    )
    assert made.from_scratch is (not trained and "--method" not in argv)
    assert made.run.metrics["machine"] == f"toy, 6 cores, torch {job.torch.__version__}"
    assert made.run.metrics["version"] == job.__version__ and "clip" not in made.run.metrics
    assert made.run.metrics["command"] == made.command and made.name == "push"
    digest = hashlib.sha256(b"".join(v.tobytes() for v in made.experts)).hexdigest()
    assert made.run.metrics["settings"]["video"] == digest[:16]
    assert made.run.metrics["settings"]["seed"] == 5 and made.run.out == tmp_path / "out"
    assert checked == [(tasks.WEIGHTS / "push", "push", "lbw")] * ("--evaluate" in argv)


def test_weights_are_not_cleared_by_the_run_that_takes_them(tmp_path, monkeypatch):
    monkeypatch.setattr(job, "read_video", lambda path, whole=False: np.zeros((2, 84, 84, 3)))
    line = ["--weights", str(tmp_path / "a" / ".." / "b"), "--out", str(tmp_path / "b")]
    (tmp_path / "a").mkdir()
    with pytest.raises(InputError) as told:
        job.check("push", job.parser("push").read(line), line)
    assert str(told.value) == (
        f"{tmp_path / 'b'}: the run would clear it of the weights; give another --out."
    )


def test_a_persons_clip_is_made_usable_and_noted(tmp_path, monkeypatch):
    """The translation of AVID is looked at before a run takes it."""
    film, loaded, asked = np.ones((4, 84, 84, 3), np.uint8), [], []
    clip = SimpleNamespace(film=film)
    monkeypatch.setattr(job, "usable", lambda *what: asked.append(what) or clip)
    monkeypatch.setattr(job, "bring", lambda *what: what)
    monkeypatch.setattr(job, "load_perception", lambda folder, name: None)
    line = ["--video", "my.mp4", "--out", str(tmp_path / "c")]
    made = job.check("push", job.parser("push").read(line), line)
    mine = job.Path("my.mp4")
    assert asked == [("push", mine)] and made.demo is film
    assert made.run.metrics["clip"] == (tmp_path / "c", "push", clip, mine)
    monkeypatch.setattr(job, "read_video", lambda path, whole=False: film)
    monkeypatch.setattr(job.cyclegan, "load", lambda *what: loaded.append(what))
    line = ["--method", "avid", "--weights", "w", "--out", str(tmp_path / "d")]
    job.check("push", job.parser("push").read(line), line)
    assert loaded == [(job.Path("w") / "translation.safetensors", "push")]


def test_a_folder_that_cannot_be_gone_on_with_is_named(tmp_path, monkeypatch):
    said = []
    for settings in ({"a": 1}, {"a": 2}):
        with pytest.raises(InputError) as told:
            prepare_folder(tmp_path, settings, resume=True)
        said.append(str(told.value))
        (tmp_path / "settings.json").write_text('{"a": 1}')
    assert said == [
        f"{tmp_path}: there is no run to resume here; start it without --resume.",
        f"{tmp_path}: that run had other settings; give those, or another --out.",
    ]

    def full(path, text):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(job, "write_atomic", full)
    with pytest.raises(InputError) as told:
        prepare_folder(tmp_path, {"a": 3}, resume=False)
    assert str(told.value) == (
        f"{tmp_path}: cannot write there (No space left on device); give another --out."
    )
