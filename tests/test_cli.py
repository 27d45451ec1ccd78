"""The command line: what a user does wrong gets one sentence, exit code 2, and leaves no trace."""

import json
import re
import shutil

import cv2
import numpy as np
import pytest
import torch

from lbw_minimal import video
from lbw_minimal.training import InputError
from tasks import TASKS, VIDEOS, WEIGHTS, bare, commands
from tasks.__main__ import main
from tasks.commands import robustness, run
from tasks.commands.job import check, parser
from tasks.world import RED, Recording


def clip(path, frames, size=84):
    film = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), 25, (size, size))
    for i in range(frames):
        frame = np.full((size, size, 3), 120, np.uint8)
        frame[10:30, 2 * i : 2 * i + 20] = (40, 60, 200)
        film.write(frame)
    film.release()
    return path


def missing(folder):
    return ["push", "--video", folder / "no.mp4"], "no.mp4"


def text(folder):
    (folder / "text.mp4").write_text("not a video")
    return ["push", "--video", folder / "text.mp4"], "text.mp4"


def truncated(folder):
    whole = clip(folder / "cut.mp4", 25).read_bytes()
    (folder / "cut.mp4").write_bytes(whole[: len(whole) // 2])
    return ["push", "--video", folder / "cut.mp4"], "cut.mp4"


def no_frames(folder):
    return ["push", "--video", clip(folder / "empty.mp4", 0)], "empty.mp4"


def one_frame(folder):
    return ["push", "--video", clip(folder / "one.mp4", 1)], "one.mp4"


def tiny(folder):
    return ["push", "--video", clip(folder / "tiny.mp4", 10, size=20)], "tiny.mp4"


def still(folder):
    video.write(folder / "still.mp4", np.full((20, 84, 84, 3), 90, np.uint8), 25)
    return ["push", "--video", folder / "still.mp4"], "still.mp4"


def unknown_task(folder):
    return ["juggle"], "juggle"


def unknown_task_to_film(folder):
    return ["record", "juggle"], "juggle"


def no_task_to_film(folder):
    return ["record"], "record"


def nothing_to_resume(folder):
    return ["push", "--resume", "--from-scratch"], "resume"


def other_tasks_weights(folder):
    shutil.copytree(WEIGHTS / "reach", folder / "weights")
    return ["push", "--weights", folder / "weights"], "weights"


def cut_weights(folder):
    shutil.copytree(WEIGHTS / "push", folder / "weights")
    file = folder / "weights" / "keypoints.safetensors"
    file.write_bytes(file.read_bytes()[:1000])
    return ["push", "--weights", folder / "weights"], "keypoints.safetensors"


def no_weights(folder):
    return ["push", "--weights", folder / "nowhere"], "nowhere"


def no_cuda(folder):
    if torch.cuda.is_available():
        pytest.skip("needs a machine without a CUDA device")
    return ["push", "--fast", "--device", "cuda"], "cuda"


def no_such_device(folder):
    return ["push", "--fast", "--device", "abacus"], "abacus"


def literal_without_a_mend(folder):
    return ["push", "--reward", "literal", "--without", "trim"], "trim"


def no_episodes(folder):
    return ["push", "--evaluate", "--episodes", "0"], "--episodes"


def another_commands_option(folder):
    return ["push", "--jobs", "9"], "python -m tasks table"


def an_option_that_is_none(folder):
    return ["push", "--vidoe", "x"], "--vidoe"


def one_argument_too_many(folder):
    return ["push", "reach"], "'reach' is one argument too many (a name with a space wants quotes)"


def no_seed(folder):
    return ["push", "--seed", "-1"], "'-1'"


def starts_off_the_table(folder):
    return ["push", "--jitter", "1"], "'1'"


def no_such_field(folder):
    return ["push", "--set", "steps=3"], "policy_steps"


def no_such_value(folder):
    return ["push", "--set", "policy_steps=many"], "'many'"


def a_value_that_is_no_number(folder):
    return ["push", "--set", "entropy=nan"], "finite number"


def a_field_of_perception_that_is_not_trained(folder):
    return ["push", "--set", "K=4"], "--from-scratch"


def replaying_and_learning(folder):
    return ["push", "--evaluate", "--set", "policy_steps=9"], "policy_steps=9"


def weights_beside_training(folder):
    return ["push", "--from-scratch", "--weights", folder], "--weights"


def a_device_where_nothing_learns_on_it(folder):
    return ["push", "--device", "cpu"], "--device"


MISTAKES = (missing, text, truncated, no_frames, one_frame, tiny, still, unknown_task,
            unknown_task_to_film, no_task_to_film, nothing_to_resume, other_tasks_weights,
            cut_weights, no_weights, no_cuda, no_such_device, literal_without_a_mend, no_episodes,
            another_commands_option, an_option_that_is_none, one_argument_too_many, no_seed,
            starts_off_the_table,
            no_such_field, no_such_value, a_value_that_is_no_number,
            a_field_of_perception_that_is_not_trained, replaying_and_learning,
            weights_beside_training,
            a_device_where_nothing_learns_on_it)  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda f: f.__name__)
def test_a_mistake_gets_one_sentence_and_leaves_no_trace(mistake, tmp_path, capfd):
    arguments, culprit = mistake(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    if arguments[0] == "push":
        arguments += ["--out", tmp_path / "run"]
    capfd.readouterr()
    assert main([str(a) for a in arguments]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert err.startswith("error: ") and err.count("\n") == 1, err
    assert culprit in err and err.rstrip().endswith(".")
    assert sorted(tmp_path.rglob("*")) == before


def test_the_shipped_policy_is_replayed_for_as_many_episodes_as_asked(tmp_path, capfd):
    assert main(["reach", "--evaluate", "--episodes", "2", "--out", str(tmp_path)]) == 0
    assert "reach: 2/2 successes" in capfd.readouterr().out
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    assert [e["seed"] for e in metrics["episodes"]] == [1_000_000, 1_000_001]
    assert "A test episode" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    "what", [["push", "--fast"], ["table"], ["ablation"], ["gallery"], ["viewer", "push"]]
)
def test_a_folder_that_cannot_be_written_is_named(what, tmp_path, capfd):
    (tmp_path / "file").write_text("in the way")
    assert main([*what, "--out", str(tmp_path / "file" / "run")]) == 2
    assert "run: cannot write there" in capfd.readouterr().err


def test_resuming_with_other_settings_is_refused(tmp_path, capfd):
    (tmp_path / "settings.json").write_text("{}")
    assert main(["push", "--fast", "--resume", "--out", str(tmp_path)]) == 2
    assert "other settings" in capfd.readouterr().err


@pytest.mark.parametrize(("command", "way"), [("push", "; the same line with --resume goes on"),
                                              ("prepare", "")])  # fmt: skip
def test_an_interrupt_is_a_line_that_names_the_way_on(command, way, monkeypatch, capfd):
    def interrupted(*_):
        raise KeyboardInterrupt

    module = "run" if command == "push" else command
    monkeypatch.setattr(f"tasks.commands.{module}.main", interrupted)
    assert main([command]) == 130
    assert capfd.readouterr().err == f"\ninterrupted{way}\n"


def test_a_film_that_was_prepared_for_another_task_is_refused(tmp_path, capfd):
    film = tmp_path / "reenactment.mp4"
    film.write_bytes(b"of a push")
    film.with_name("prepare.json").write_text('{"task": "push"}')
    assert main(["drawer", "--video", str(film), "--out", str(tmp_path / "run")]) == 2
    assert "prepared for push; prepare the clip for drawer" in capfd.readouterr().err


def test_a_folder_of_the_users_own_files_is_never_emptied(tmp_path, capfd):
    (tmp_path / "thesis.txt").write_text("three years of work")
    main(["push", "--fast", "--device", "abacus", "--out", str(tmp_path)])
    assert (tmp_path / "thesis.txt").exists()


def test_filming_ends_when_the_expert_never_succeeds(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr("tasks.VIDEOS", tmp_path)
    monkeypatch.setattr(
        "tasks.world.motion.record_expert",
        lambda env, seed: (None, None, Recording(seed, False, None, None, None, [False])),
    )
    assert main(["record", "push"]) == 2
    assert "0 of 45 tries" in capfd.readouterr().err


def test_every_task_has_its_videos():
    for name in TASKS:
        files = sorted(p.name for p in (VIDEOS / name).glob("*.mp4"))
        assert files == [*(f"expert_{i:02d}.mp4" for i in range(1, 16)), "random.mp4"]


PARSERS = {parser.command: parser for parser in commands.parsers()}
OPTIONS = sorted(set().union(*(parser.options() for parser in PARSERS.values())) - {"-h", "--help"})


@pytest.mark.parametrize("command", PARSERS)
def test_help_names_the_defaults_there_are(command):
    text = " ".join(PARSERS[command].format_help().split())
    assert "(default: None)" not in text and "(default: [])" not in text
    if command == "push":
        assert "seed" in text and "(default: 0)" in text


@pytest.mark.parametrize("command", PARSERS)
def test_every_option_is_a_commands_own_or_refused_with_the_name_of_its_command(command):
    parser = PARSERS[command]
    takes = [action.dest for action in parser._actions]
    needed = ["push"] * ("task" in takes) + ["my.mp4"] * ("file" in takes)
    values = {"--set": "K=3", "--reward": "literal", "--without": "trim", "--jitter": "0.02"}
    values |= {"--tip": "3,4@1", "--object": "3,4@1"}
    for option in OPTIONS:
        if option in parser.options():
            action = parser._option_string_actions[option]
            value = values.get(option, "200")
            value = action.choices[-1] if action.choices else value
            args = parser.read([*needed, option] + [value] * (action.nargs != 0))
            assert getattr(args, action.dest) != action.default, option
        else:
            with pytest.raises(InputError) as error:
                parser.read([*needed, option, "1"])
            owners = [name for name, other in PARSERS.items() if option in other.options()]
            assert str(error.value).startswith(f"{command}: {option} ")
            assert all(f"python -m tasks {owner}" in str(error.value) for owner in owners), option


def test_no_command_prints_the_tasks_and_three_commands_to_try(capfd):
    assert main([]) == 0
    out = capfd.readouterr().out
    tried = out.partition("try first:")[2]
    assert all(f"  {name} " in out for name in (*TASKS, *commands.COMMANDS))
    assert tried.count("python -m tasks ") == 4  # three, and how to read of options


def test_the_overview_says_what_each_task_is_about_and_offers_lines_that_are_understood(capfd):
    """The first sentence of a task's file; "reach" is to be told from the others by it."""
    assert main(["-h"]) == main(["--help"]) == 0
    out = capfd.readouterr().out
    assert "\n  push       Push: a cube lies on the table, and its centre has to end at " in out
    assert "\n  reach      Reach: a target hangs over the table, and " in out
    assert "write runs/TASK/report.html\n" in out
    for line in re.findall("^  python -m tasks (.*?)  ", out.partition("try first:")[2], re.M):
        name, *rest = line.split()
        (parser(name) if name in TASKS else PARSERS[name]).read(rest)


def test_a_command_says_by_its_exit_code_how_it_went(monkeypatch, capfd):
    for answer, code in ((None, 0), (0, 0), (3, 3)):
        monkeypatch.setattr("tasks.commands.probe.main", lambda rest, answer=answer: answer)
        assert main(["probe"]) == code
    assert main(["pish"]) == 2
    told = capfd.readouterr().err
    assert all(name in told for name in (*TASKS, *commands.COMMANDS))


@pytest.mark.usefixtures("one_trial")
def test_the_recipe_is_set_and_the_report_says_so(tmp_path):
    field = "policy_steps=60"
    fields = ["--set", field, "--set", "entropy=-2.5"]
    assert main(["reach", "--episodes", "1", "--out", str(tmp_path), *fields]) == 0
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    assert metrics["settings"]["recipe"]["policy_steps"] == 60
    assert metrics["settings"]["recipe"]["entropy"] == -2.5
    assert json.loads((tmp_path / "policy_log.json").read_text())[-1]["step"] < 200
    assert field in (tmp_path / "report.html").read_text()


def test_starts_are_moved_as_far_as_asked(tmp_path):
    arguments = ["reach", "--evaluate", "--jitter", "0.03", "--out", str(tmp_path)]
    job = check("reach", parser("reach").read(arguments[1:]), arguments[1:])
    _, env = run.learn(job, *run.perceive(job))
    assert env.unwrapped.jitter == job.run.metrics["settings"]["jitter"] == 0.03


def test_random_motion_is_read_where_something_learns_from_it(tmp_path, monkeypatch):
    read = []
    monkeypatch.setattr("tasks.commands.job.EXPERTS", 1)
    monkeypatch.setattr(
        "tasks.commands.job.read_video",
        lambda path, whole=False: read.append(path.stem) or np.zeros((2, 84, 84, 3), np.uint8),
    )
    for i, (line, learns) in enumerate(
        [("", False), ("--evaluate", False), ("--from-scratch", True), ("--method avid", True),
         ("--method classifier", False)]
    ):  # fmt: skip
        read.clear()
        job = check(
            "push", parser("push").read(line.split() + ["--out", str(tmp_path / f"{i}")]), []
        )
        assert ("random" in read) == (len(job.random) > 0) == learns, line


def test_a_policy_of_the_other_reward_is_refused(tmp_path, capfd):
    arguments = ["reach", "--evaluate", "--reward", "literal", "--out", str(tmp_path)]
    assert main(arguments) == 2
    assert "give the --reward it was trained with" in capfd.readouterr().err


def test_viewer_writes_a_scene(tmp_path):
    assert main(["viewer", "push", "--embodiment", "human", "--out", str(tmp_path)]) == 0
    assert "the expert, as a human" in (tmp_path / "push-human.html").read_text()


def test_probe_prints_what_the_keypoints_know(capfd):
    assert main(["probe", "push", "--frames", "100"]) == 0
    rows = {line.split()[0]: line.split()[1:] for line in capfd.readouterr().out.splitlines()}
    assert float(rows["tip_x"][0]) > 0.98 and rows["object_y"][0] == "-"


def test_robustness_tries_each_change_that_a_scene_allows(capfd, monkeypatch):
    """Reach has nothing red to paint, and a frame of noise tells a policy nothing."""
    noise = np.random.default_rng(0).integers(0, 256, (84, 84, 3), np.uint8)
    changes = {"as trained": robustness.unchanged, "noise": lambda frame: noise}
    monkeypatch.setattr(robustness, "CHANGES", changes | {"object blue": robustness.unchanged})
    assert main(["robustness", "reach", "--episodes", "1"]) == 0
    rows = [line.split(" | ")[:2] for line in capfd.readouterr().out.splitlines()[2:]]
    assert rows == [["| as trained", "1/1"], ["| noise", "0/1"]]


def test_changes_of_the_picture_are_what_they_say():
    frame = np.arange(84 * 84 * 3).reshape(84, 84, 3).astype(np.uint8)
    down, left = robustness.moved(0, 1)(frame), robustness.moved(-2, 0)(frame)
    assert (down[1:] == frame[:-1]).all() and (down[0] == frame[0]).all()
    assert (left[:, :-2] == frame[:, 2:]).all() and (left[:, -1] == frame[:, -1]).all()
    grey = np.array([[[10, 100, 250]]], np.uint8)
    assert robustness.brighter(1.2)(grey).tolist() == [[[12, 120, 255]]]


def test_what_is_red_is_painted_and_nothing_else():
    env = bare("push")
    env.reset(seed=0)
    before = env.world.render().astype(int)
    assert robustness.paint(env.world, RED, robustness.BLUE) == 1
    after = env.world.render().astype(int)
    changed = (before != after).any(-1)
    assert 20 < changed.sum() < 200 and (after - before)[changed][:, 2].mean() > 50
