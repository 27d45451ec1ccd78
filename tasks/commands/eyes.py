"""The detector of tip and object, trained on made clips alone, and its error.

Out: weights and `metrics.json`, with the error on made clips that no training saw, on the kit's
human videos, where the simulator knows the truth, and on real clips, whose places were marked by
hand. The kit cannot ship those clips, only the marks: give the folder in which the clips are.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import torch

import tasks
from lbw_minimal import video
from lbw_minimal.clips import detector
from lbw_minimal.clips.detector import SURE, Detector, Found
from lbw_minimal.clips.drawings import SIZE, Clip, draw_clip
from lbw_minimal.training import Checkpoint, InputError, pick_device, read_json, write_atomic
from tasks.commands import Parser, at_least, make_folder
from tasks.world import load_recordings
from tasks.world.renderings import render_clip

ITERATIONS = 20000  # eight minutes of a GPU and seven cores, an hour and a half of two cores
HELD_OUT = 1_000_000  # seed of the drawings to measure on; no training gets there
DRAWN = 100  # of them
MARKS = tasks.ROOT / "solutions" / "results" / "eyes" / "marks.json"


class Seen(NamedTuple):
    """What was found in a clip beside the truth, nan where the frame shows none."""

    found: Found
    tip: np.ndarray  # (T, 2) pixels
    object: np.ndarray  # (T, 2) pixels
    unit: float  # pixels of the clip in one of an 84x84 frame


def parser() -> Parser:
    """The arguments of `eyes`."""
    p = Parser("eyes", "Train the detector that finds tip and object in a person's own clip.")
    p.add_argument("--iterations", type=at_least(0), default=ITERATIONS, help="of the training")
    p.add_argument("--seed", type=at_least(0), default=0, help="of the clips and the network")
    p.add_argument(
        "--device",
        default="cuda" if torch.cuda.is_available() else "cpu",
        help="where the network learns",
    )
    p.add_argument("--out", type=Path, default=tasks.WEIGHTS / "eyes", help="folder of the weights")
    p.add_argument("--measure", action="store_true", help="measure the weights that are there")
    p.add_argument("--clips", type=Path, help=f"folder of the real clips that {MARKS.name} marks")
    return p


def main(argv: list[str]) -> None:
    """Train, measure, write. Raises InputError for a mistake in the arguments."""
    args = parser().read(argv)
    weights, metrics_file = args.out / "eyes.safetensors", args.out / "metrics.json"
    if args.measure:
        model = Detector.load(weights)
        metrics = read_json(metrics_file) if metrics_file.exists() else {}
    else:
        pick_device(args.device)  # or it is known only after minutes that there is none
        make_folder(args.out)
        metrics = learn(args.iterations, args.seed, weights, args.device)
        model = Detector.load(weights)  # what is measured is what is shipped: half precision
    write_atomic(metrics_file, json.dumps(metrics, indent=1) + "\n")  # measuring takes minutes
    metrics.setdefault("error", {}).update(measure(model, args.clips))
    write_atomic(metrics_file, json.dumps(metrics, indent=1) + "\n")
    for where, figures in metrics["error"].items():
        for what, row in figures.items():
            print(f"{where:24s}{what:8s}" + "".join(f"{k} {v:<8}" for k, v in row.items()))


def a_clip(rng: np.random.Generator) -> Clip:
    """A clip to learn from: a drawing or a rendering."""
    return render_clip(rng) if rng.random() < 0.5 else draw_clip(rng)


def learn(iterations: int, seed: int, weights: Path, device: str) -> dict[str, Any]:
    """Train, or go on with a training that was cut off, and write the weights; returns metrics.

    All cores are at work: on a CPU one draws and the others learn, for a GPU all but one draw.
    """
    cores, on_cpu = os.cpu_count() or 1, device == "cpu"
    torch.set_num_threads(max(1, cores - 1) if on_cpu else 1)
    runs = Path("runs")
    make_folder(runs)
    checkpoint = runs / f"eyes-{seed}.checkpoint"
    kept = Checkpoint(checkpoint)
    model, log = detector.train(
        iterations=iterations, seed=seed, device=device, checkpoint=kept,
        workers=min(1, cores - 1) if on_cpu else cores - 1, draw=a_clip,
    )  # fmt: skip
    model.save(weights)
    learner = "" if on_cpu else f"{torch.cuda.get_device_name(device)}, "
    checkpoint.unlink(missing_ok=True)
    return {
        "command": f"python -m tasks eyes --iterations {iterations} --seed {seed}",
        "seed": seed,
        "iterations": iterations,
        "seconds": round(kept.spent),
        "machine": f"{platform.machine()}, {cores} cores, {learner}torch {torch.__version__}",
        "log": log,
    }


def measure(model: Detector, clips: Path | None = None) -> dict[str, dict]:
    """Errors by kind of clip: drawings, each task's videos, and marked clips in the folder."""
    out = {"drawings": compare(made(model)), "renderings": compare(made(model, render_clip))}
    for task in tasks.TASKS:
        out[f"{task}'s videos"] = compare(filmed(model, task))
    if clips:
        for name, told in read_json(MARKS)["clips"].items():
            out[name] = compare([marked(model, clips / name, told)])
    return out


def compare(clips: Iterable[Seen]) -> dict[str, dict[str, float]]:
    """Figures for tip and object over some clips.

    px: median error in pixels of 84, p90: what nine in ten stay below, both where it is found.
    found: share of the frames that show it in which it is found; false: of those that do not.
    """
    clips, out = list(clips), {}
    for what in ("tip", "object"):
        truth = np.concatenate([getattr(clip, what) / clip.unit for clip in clips])
        place = np.concatenate([getattr(clip.found, what) / clip.unit for clip in clips])
        sure = np.concatenate([getattr(clip.found, f"{what}_sure") for clip in clips]) > SURE
        there = np.isfinite(truth[:, 0])
        error = np.linalg.norm(place - truth, axis=1)[there & sure]
        row = {"frames": int(there.sum())}
        if len(error):
            row |= {"px": np.median(error), "p90": np.percentile(error, 90)}
        if there.any():
            row["found"] = sure[there].mean()
        if not there.all():
            row["false"] = sure[~there].mean()
        out[what] = {k: round(float(v), 3) for k, v in row.items()}
    return out


def made(
    model: Detector, draw: Callable[[np.random.Generator], Clip] = draw_clip
) -> Iterator[Seen]:
    """Drawings or renderings that no training saw."""
    for i in range(DRAWN):
        clip = draw(np.random.default_rng([HELD_OUT, i]))
        yield Seen(model.detect(clip.frames), clip.tip, clip.object, 1.0)


def filmed(model: Detector, task: str, most: int = 3) -> Iterator[Seen]:
    """The kit's human videos; what reach calls its object is a mark that never moves."""
    env = tasks.bare(task, embodiment="human")
    recordings = load_recordings(tasks.VIDEOS / task / "experts.npz")[:most]
    for i, recording in enumerate(recordings, 1):
        frames, _ = video.read(tasks.VIDEOS / task / f"expert_{i:02d}.mp4")
        tip, object_ = (
            np.array([env.world.pixel(point) for point in recording.states[:, k : k + 3]])
            for k in (0, 3)
        )
        if task == "reach":
            object_ = np.full_like(tip, np.nan)
        yield Seen(detector.refine(frames, model.detect(frames)), tip, object_, 1.0)
    env.close()


def marked(model: Detector, path: Path, told: dict[str, Any]) -> Seen:
    """A real clip, in the frames with marks. Raises InputError if the clip is not there."""
    film, frames = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG), []
    while (read := film.read())[0]:
        frames.append(cv2.cvtColor(read[1], cv2.COLOR_BGR2RGB))
    if not frames:
        raise InputError(f"{path}: no clip that can be read; give the folder of {MARKS.name}'s.")
    clip = np.stack(frames)
    found = detector.refine(clip, model.detect(clip))
    which = [mark["frame"] for mark in told["marks"]]
    tip, object_ = (
        np.array([mark[what] or (np.nan, np.nan) for mark in told["marks"]], float)
        for what in ("tip", "object")
    )
    return Seen(Found(*(part[which] for part in vars(found).values())), tip, object_,
                max(told["size"]) / SIZE)  # fmt: skip
