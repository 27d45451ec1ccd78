"""The command `eyes`: what it trains, writes, measures and prints, with a detector that is none."""

import json
from types import SimpleNamespace

import pytest

import tasks
from tasks.commands import eyes

FIGURES = {"tip": {"frames": 4, "px": 1.5}, "object": {"frames": 0}}


@pytest.fixture
def told(tmp_path, monkeypatch):
    told = []
    monkeypatch.chdir(tmp_path)

    def train(iterations, seed, device, workers, checkpoint, draw):
        assert draw is eyes.a_clip
        told.append((iterations, seed, checkpoint.path.as_posix(), device, workers))
        checkpoint.path.write_text("cut off here")
        return SimpleNamespace(save=lambda path: path.write_text("weights")), ["row"]

    def load(path):
        return f"a detector of {path.parent.name}: {path.read_text()}"

    monkeypatch.setattr(eyes.detector, "train", train)
    monkeypatch.setattr(eyes, "Detector", SimpleNamespace(load=load))
    monkeypatch.setattr(eyes, "compare", lambda clips: told.append(clips) or FIGURES)
    monkeypatch.setattr(eyes, "made", lambda model, draw=eyes.draw_clip: (draw, model))
    monkeypatch.setattr(eyes, "filmed", lambda model, task: ("filmed", model, task))
    monkeypatch.setattr(eyes, "marked", lambda model, path, marks: ("marked", model, path))
    return told


def test_the_weights_that_are_shipped_are_those_that_are_measured(told, tmp_path, capsys):
    asked_for = ["--iterations", "30", "--seed", "4", "--device", "cpu"]
    eyes.main([*asked_for, "--out", str(tmp_path / "eyes")])
    metrics = json.loads((tmp_path / "eyes" / "metrics.json").read_text())
    asked, *measured = told
    assert asked[:4] == (30, 4, "runs/eyes-4.checkpoint", "cpu")
    assert not (tmp_path / "runs" / "eyes-4.checkpoint").exists()  # it has ended
    model = "a detector of eyes: weights"
    assert measured[:2] == [(eyes.draw_clip, model), (eyes.render_clip, model)]
    assert measured[2:] == [("filmed", model, task) for task in tasks.TASKS]
    assert metrics["command"] == "python -m tasks eyes --iterations 30 --seed 4"
    assert (metrics["iterations"], metrics["seed"], metrics["log"]) == (30, 4, ["row"])
    assert metrics["error"]["drawings"] == FIGURES
    assert list(metrics["error"])[2:] == [f"{task}'s videos" for task in tasks.TASKS]
    rows = capsys.readouterr().out.splitlines()
    assert len(rows) == 14 and rows[4].split() == [
        "reach's", "videos", "tip", "frames", "4", "px", "1.5",
    ]  # fmt: skip


def test_what_is_there_is_measured_again_and_keeps_its_other_figures(told, tmp_path):
    out = tmp_path / "eyes"
    out.mkdir()
    (out / "eyes.safetensors").write_text("earlier")
    old = {"seed": 9, "error": {"push.mp4": FIGURES, "drawings": "old"}}
    (out / "metrics.json").write_text(json.dumps(old))
    eyes.main(["--measure", "--out", str(out)])
    metrics = json.loads((out / "metrics.json").read_text())
    assert told[0] == (eyes.draw_clip, "a detector of eyes: earlier")  # nothing was trained
    assert metrics["seed"] == 9 and metrics["error"]["push.mp4"] == FIGURES
    assert metrics["error"]["drawings"] == FIGURES


def test_clips_with_marks_are_measured_where_their_folder_is_given(told, tmp_path):
    marks = json.loads(eyes.MARKS.read_text(encoding="utf-8"))["clips"]
    error = eyes.measure("model", tmp_path)
    assert set(marks) < set(error) and len(marks) > 0
    assert all([("marked", "model", tmp_path / name)] in told for name in marks)
    assert set(eyes.measure("model")) == set(error) - set(marks)


@pytest.mark.parametrize(
    ("cores", "device", "drawers", "threads"),
    [(1, "cpu", 0, 1), (2, "cpu", 1, 1), (8, "cpu", 1, 7), (16, "cuda", 15, 1)],
)
def test_on_a_cpu_one_core_draws_and_for_a_gpu_all_but_one(
    told, tmp_path, monkeypatch, cores, device, drawers, threads
):
    asked = []
    monkeypatch.setattr(eyes.os, "cpu_count", lambda: cores)
    monkeypatch.setattr(eyes.torch, "set_num_threads", asked.append)
    monkeypatch.setattr(eyes.torch.cuda, "get_device_name", lambda device: "a GPU")
    monkeypatch.setattr(eyes, "pick_device", asked.append)
    eyes.main(["--device", device, "--out", str(tmp_path)])
    assert told[0][3:] == (device, drawers) and asked == [device, threads]
    machine = json.loads((tmp_path / "metrics.json").read_text())["machine"]
    assert f"{cores} cores" in machine and ("a GPU" in machine) == (device == "cuda")
