"""The command line: what a user does wrong gets one sentence, exit code 2, and leaves no trace."""

import json
import shutil

import cv2
import numpy as np
import pytest
import torch

from lbw_minimal import video
from tasks import TASKS, VIDEOS, WEIGHTS
from tasks.__main__ import main


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
        pytest.skip("this machine has a CUDA device")
    return ["push", "--fast", "--device", "cuda"], "cuda"


def no_such_device(folder):
    return ["push", "--fast", "--device", "abacus"], "abacus"


def literal_without_a_mend(folder):
    return ["push", "--reward", "literal", "--without", "trim"], "trim"


def no_episodes(folder):
    return ["push", "--evaluate", "--episodes", "0"], "--episodes 0"


MISTAKES = (missing, text, truncated, no_frames, one_frame, tiny, still, unknown_task, unknown_task_to_film,
            no_task_to_film, nothing_to_resume, other_tasks_weights, cut_weights, no_weights, no_cuda,
            no_such_device, literal_without_a_mend, no_episodes)  # fmt: skip


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
    assert main(["push", "--evaluate", "--episodes", "2", "--out", str(tmp_path)]) == 0
    assert "push: 2/2 successes" in capfd.readouterr().out
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    assert [e["seed"] for e in metrics["episodes"]] == [1_000_000, 1_000_001]
    assert "A test episode" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize("what", [["push", "--fast"], ["table"], ["ablation"], ["gallery"]])
def test_a_folder_that_cannot_be_written_is_named(what, tmp_path, capfd):
    (tmp_path / "file").write_text("in the way")
    assert main([*what, "--out", str(tmp_path / "file" / "run")]) == 2
    assert "run: cannot write there" in capfd.readouterr().err


def test_resuming_with_other_settings_is_refused(tmp_path, capfd):
    (tmp_path / "settings.json").write_text("{}")
    assert main(["push", "--fast", "--resume", "--out", str(tmp_path)]) == 2
    assert "other settings" in capfd.readouterr().err


def test_a_folder_of_the_users_own_files_is_never_emptied(tmp_path, capfd):
    (tmp_path / "thesis.txt").write_text("three years of work")
    main(["push", "--fast", "--device", "abacus", "--out", str(tmp_path)])
    assert (tmp_path / "thesis.txt").exists()


def test_filming_ends_when_the_expert_never_succeeds(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr("tasks.VIDEOS", tmp_path)
    monkeypatch.setattr("tasks.commands.record.record_expert", lambda env, seed: (None, None, False))
    assert main(["record", "push"]) == 2
    assert "0 of 45 tries" in capfd.readouterr().err


def test_every_task_has_its_videos():
    for name in TASKS:
        files = sorted(p.name for p in (VIDEOS / name).glob("*.mp4"))
        assert files == [*(f"expert_{i:02d}.mp4" for i in range(1, 16)), "random.mp4"]


@pytest.mark.parametrize(
    "name, frames",
    [("reach", 1056), ("push", 398), ("slide", 650), ("coffee", 658), ("drawer", 986)],
)
def test_demonstration_and_random_video_have_the_papers_frames(name, frames):
    parts = [video.read(VIDEOS / name / f"{part}.mp4")[0] for part in ("expert_01", "random")]
    assert sum(map(len, parts)) == frames  # Table I
