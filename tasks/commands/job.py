"""What a run is asked to do: its arguments, checked before anything is written."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import platform
import shlex
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

import tasks
from lbw_minimal import __version__, classifier, cyclegan, sac, sac_ae, tracks, video
from lbw_minimal.imitate import Perception, Recipe, Run, load_perception
from lbw_minimal.reward import MENDS
from lbw_minimal.training import InputError, pick_device, read_json, write_atomic
from tasks.commands import JITTER, Parser, at_least, make_folder, metres
from tasks.commands.links import FILM, NOTE, folder
from tasks.commands.own_clip import bring
from tasks.commands.prepare import PAGE, STILLS, usable
from tasks.commands.recipe import METHODS, PIXELS, fields_of, recipe_of
from tasks.commands.record import EXPERTS

TEST_EPISODES = 10  # as in the paper
RESULTS = (
    "*.checkpoint",
    "*.frames",
    "*.safetensors",
    "*_log.json",
    "metrics.json",
    "report.html",
    FILM,
    PAGE,
    STILLS,
    NOTE,
)


def parser(name: str) -> Parser:
    """The arguments of a run of the task `name`."""
    p = Parser(name, "Learn a task from its human video, test the policy, and write a report.")
    add = p.add_argument
    add(
        "--method",
        choices=tuple(METHODS),
        default="lbw",
        help="avid, classifier: the paper's rivals; tracks: after the paper",
    )
    add("--video", type=Path, metavar="FILE", help="a clip of your own arm; see prepare")
    add(
        "--translate-clip",
        action="store_true",
        help="translation trained on that clip alone, as the paper has it, and no re-enactment",
    )
    add("--videos", type=at_least(1), metavar="N", help="human videos (lbw 1, avid 15)")
    add("--from-scratch", action="store_true", help="train perception too")
    add("--reward", choices=("mended", "literal"), default="mended", help="literal: Eq. 8-10")
    add("--without", choices=MENDS, help="leave one mend of the reward out")
    add("--set", action="append", default=[], metavar="NAME=VALUE", help="a field of the recipe")
    add("--evaluate", action="store_true", help="only replay a trained policy")
    p.add_weights()
    add("--jitter", type=metres, default=JITTER, metavar="M", help="how far starts are moved")
    add("--episodes", type=at_least(1), default=None, help=f"test episodes ({TEST_EPISODES})")
    add("--seed", type=at_least(0), default=0)
    add("--device", help="where perception, or a rival, learns: cpu (the default) or cuda")
    add("--threads", type=at_least(1), help="torch's threads (all cores)")
    add("--fast", action="store_true", help="a smoke run through every stage")
    add("--resume", action="store_true", help="go on with the run in --out")
    add(
        "--out",
        type=Path,
        metavar="DIR",
        help=f"folder of the run (runs/{name}; with --video also the clip's name)",
    )
    return p


@dataclass
class Job:
    """A checked command line: what to learn, from which frames, and where the result goes."""

    name: str  # of the task
    args: argparse.Namespace
    recipe: Recipe
    from_scratch: bool
    experts: list[np.ndarray]  # human videos of the task, (N, 84, 84, 3) uint8 each
    random: np.ndarray  # other human motion, same type; empty where nothing learns from it
    trained: Perception | None  # None if perception is to be learnt
    weights: Path  # folder of trained weights
    command: str  # what makes this run again
    run: Run

    @property
    def demo(self) -> np.ndarray:
        """The one human video that LbW learns from, (N, 84, 84, 3) uint8."""
        return self.experts[0]


def check(name: str, args: argparse.Namespace, argv: list[str]) -> Job:
    """Look at everything the user gave before anything is written."""
    lbw = args.method == "lbw"
    from_scratch = lbw and (args.from_scratch or args.fast or args.translate_clip)
    refuse_idle_options(args, from_scratch)
    module = tasks.module(name)
    recipe = recipe_of(module.RECIPE, args, from_scratch)
    pick_device(args.device or "cpu")
    torch.set_num_threads(args.threads or os.cpu_count() or 1)

    clip = usable(name, args.video) if args.video and not args.translate_clip else None
    experts = [clip.film] if clip else [read_video(path) for path in videos(name, args)]
    if args.method == "tracks":
        tracks.watch(experts[0])  # raises InputError if it moves no object, as reach's
    learns = from_scratch or (args.method == "avid" and not args.evaluate)
    random = np.empty((0, video.SIZE, video.SIZE, 3), np.uint8)
    # It takes seconds to read. A clip that is translated is the human domain alone.
    if learns and not args.translate_clip:
        random = read_video(tasks.VIDEOS / name / "random.mp4", whole=True)
    if lbw:  # whose demonstration is one: the translation sees the others beside random motion
        random = np.concatenate([random, *experts[1:]])
    weights, out = args.weights or tasks.WEIGHTS / name, args.out or folder(name, args.video)
    if weights.resolve() == out.resolve():
        raise InputError(f"{out}: the run would clear it of the weights; give another --out.")
    perception = load_perception(weights, name) if lbw and not from_scratch else None
    if args.evaluate:
        check_weights(weights, name, args.method)
    elif args.method == "avid" and args.weights:
        cyclegan.load(weights / "translation.safetensors", name)

    settings = {
        "task": name,
        "seed": args.seed,
        "method": args.method,
        "reward": args.reward,
        "without": args.without,
        "fast": args.fast,
        "from_scratch": from_scratch,
        "jitter": args.jitter,
        "video": hashlib.sha256(b"".join(v.tobytes() for v in experts)).hexdigest()[:16],
        "set": sorted(args.set),
        "recipe": fields_of(recipe, args.method),
    }
    run = Run(prepare_folder(out, settings, args.resume))
    again = [word for word in argv if word != "--resume"]  # which would only test it again
    command = shlex.join(["python", "-m", "tasks", name, *again])
    run.metrics["command"] = command
    run.metrics["settings"] = settings
    run.metrics["version"] = __version__
    machine = f"{platform.machine()}, {os.cpu_count()} cores, torch {torch.__version__}"
    run.metrics["machine"] = machine
    if clip:
        run.metrics["clip"] = bring(run.out, name, clip, args.video)
    return Job(name, args, recipe, from_scratch, experts, random, perception, weights, command, run)


def videos(name: str, args: argparse.Namespace) -> list[Path]:
    """Files of the human videos that the method learns from, the demonstration first."""
    if args.video:
        return [args.video]
    if args.videos and args.videos > EXPERTS:
        raise InputError(f"--videos {args.videos}: {name} has {EXPERTS} human videos.")
    usual = {"avid": EXPERTS, "classifier": 0}  # the last one films the robot
    count = args.videos or usual.get(args.method, 1)
    return [tasks.VIDEOS / name / f"expert_{i + 1:02d}.mp4" for i in range(count)]


def read_video(path: Path, whole: bool = False) -> np.ndarray:
    """The frames (T, 84, 84, 3) uint8 of a file; what is odd about it is said."""
    frames, warnings = video.read(path, whole)
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    return frames


def check_weights(weights: Path, name: str, method: str) -> None:
    """Raise InputError unless the folder `weights` holds what a replay of the method takes."""
    if method not in PIXELS:
        check_task(weights, name)
        sac.load(weights / "policy.safetensors")
        return
    sac_ae.load(weights / "policy.safetensors")
    classifier.load(weights / "classifier.safetensors", name)
    if method == "avid":
        cyclegan.load(weights / "translation.safetensors", name)


def check_task(run: Path, name: str) -> None:
    """Raise InputError if the folder `run` holds a run of another task than `name`.

    A policy by object tracks does not tell by itself: what it sees is as long in every task.
    """
    if (task := settings_of(run).get("task", name)) != name:
        raise InputError(f"{run}: a run of the task {task}, not of {name}; give one of {name}.")


def settings_of(run: Path) -> dict[str, Any]:
    """The settings of the run in that folder; those of LbW where none are noted."""
    note = run / "settings.json"
    return read_json(note) if note.exists() else {"method": "lbw"}


def refuse_idle_options(args: argparse.Namespace, from_scratch: bool) -> None:
    """Raise InputError for an option that would do nothing beside the others."""
    idle = []
    if args.evaluate:
        why = "--evaluate only replays a trained policy"
        idle = [("--from-scratch", args.from_scratch, why), ("--video", args.video, why),
                ("--set", args.set, why), ("--fast", args.fast, why),
                ("--resume", args.resume, why)]  # fmt: skip
    if args.method == "lbw" and args.videos and args.videos > 1 and not args.from_scratch:
        why = "only a translation that is trained sees more than one; add --from-scratch"
        idle += [("--videos", args.videos, why)]
    if args.method == "tracks":
        idle += [("--videos", args.videos, "object tracks watch one video"),
                 ("--device", args.device, "so small a policy learns on the CPU")]  # fmt: skip
    if args.method == "classifier":
        idle += [("--videos", args.videos, "the classifier reward films the robot itself")]
    if args.video:
        idle += [("--videos", args.videos, "--video gives the only one")]
    else:
        idle += [("--translate-clip", args.translate_clip, "--video names the clip")]
    if args.method != "lbw":
        why = f"--method {args.method} has no keypoints and a reward of its own"
        idle += [("--from-scratch", args.from_scratch, why), ("--without", args.without, why),
                 ("--reward", args.reward if args.reward != "mended" else None, why)]  # fmt: skip
        many = args.video if args.method in PIXELS else None
        idle += [("--video", many, "the rivals learn from many videos"),
                 ("--translate-clip", args.translate_clip, "nothing is translated")]  # fmt: skip
        if not args.evaluate:
            why = f"--method {args.method} trains all of its networks anew"
            idle += [("--weights", args.weights if args.method != "avid" else None, why)]
        elif args.weights is None:
            raise InputError("--evaluate: the kit has no such policy; name a run by --weights.")
    elif args.reward == "literal":
        idle += [("--without", args.without, "the literal reward has no mends")]
    if from_scratch:
        idle += [("--weights", args.weights, "perception is trained anew here")]
    elif args.method == "lbw":
        idle += [("--device", args.device, "only perception learns there; add --from-scratch")]
    for option, given, why in idle:
        if given:
            value = (
                ""
                if given is True
                else f" {', '.join(given)}"
                if option == "--set"
                else f" {given}"
            )
            raise InputError(f"{option}{value} does nothing here: {why}.")


def prepare_folder(out: Path, settings: dict[str, Any], resume: bool) -> Path:
    """The run's folder: the same run's if `resume`, else a new one, or InputError."""
    note = out / "settings.json"
    if resume:
        if not note.exists():
            raise InputError(f"{out}: there is no run to resume here; start it without --resume.")
        if settings_of(out) != settings:
            raise InputError(f"{out}: that run had other settings; give those, or another --out.")
        return out
    make_folder(out)
    trained = (out / "policy_log.json").exists()
    if settings.get("fast") and trained and not settings_of(out).get("fast"):
        raise InputError(
            f"{out}: a smoke run would replace the whole run that is there; give another --out."
        )
    try:
        if note.exists() and note.read_bytes() != json.dumps(settings).encode():
            print(f"note: {out}: an earlier run with other settings is replaced.", file=sys.stderr)
        for pattern in RESULTS if note.exists() else ():  # an older run makes room
            for file in out.glob(pattern):
                file.unlink()
        write_atomic(note, json.dumps(settings))
    except OSError as error:
        raise InputError(
            f"{out}: cannot write there ({error.strerror}); give another --out."
        ) from None
    return out
