"""What a run is asked to do: its arguments, checked before anything is written."""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import json
import math
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
from lbw_minimal import sac, video
from lbw_minimal.imitate import Perception, Recipe, Run, load_perception
from lbw_minimal.reward import MENDS
from lbw_minimal.training import InputError, pick_device, write_atomic
from tasks.commands import JITTER, Parser, at_least, make_folder, metres

TEST_EPISODES = 10  # as in the paper
RESULTS = ("*.checkpoint", "*.frames", "*.safetensors", "*_log.json", "metrics.json", "report.html")
FAST = {
    "munit_iterations": 20,
    "munit_width": 8,
    "transporter_iterations": 30,
    "policy_steps": 1000,
    "robot_frames": 200,
}
PERCEPTION = (
    "robot_frames", "munit_iterations", "munit_width",
    "transporter_iterations", "K", "shift", "hue",
)  # fmt: skip


def parser(name: str) -> Parser:
    """The arguments of a run of the task `name`."""
    p = Parser(name, "Learn a task from its human video, test the policy, and write a report.")
    add = p.add_argument
    add("--video", type=Path, metavar="FILE", help="another human video, as the whole human domain")
    add("--from-scratch", action="store_true", help="train perception too")
    add("--reward", choices=("mended", "literal"), default="mended", help="literal: Eq. 8-10")
    add("--without", choices=MENDS, help="leave one mend of the reward out")
    add("--set", action="append", default=[], metavar="NAME=VALUE", help="a field of the recipe")
    add("--evaluate", action="store_true", help="only replay a trained policy")
    p.add_weights()
    add("--jitter", type=metres, default=JITTER, metavar="M", help="how far starts are moved")
    add("--episodes", type=at_least(1), default=None, help=f"test episodes ({TEST_EPISODES})")
    add("--seed", type=at_least(0), default=0)
    add("--device", help="where perception learns: cpu (the default) or cuda")
    add("--threads", type=at_least(1), help="torch's threads (all cores)")
    add("--fast", action="store_true", help="a smoke run through every stage")
    add("--resume", action="store_true", help="go on with the run in --out")
    add("--out", type=Path, metavar="DIR", help=f"folder of the run (runs/{name})")
    return p


@dataclass
class Job:
    """A checked command line: what to learn, from which frames, and where the result goes."""

    name: str  # of the task
    args: argparse.Namespace
    recipe: Recipe
    from_scratch: bool
    demo: np.ndarray  # the human video, (N, 84, 84, 3) uint8
    random: np.ndarray  # random human motion, same type; empty with the user's own video
    trained: Perception | None  # None if perception is to be learnt
    weights: Path  # folder of trained weights
    command: str  # what makes this run again
    run: Run


def check(name: str, args: argparse.Namespace, argv: list[str]) -> Job:
    """Look at everything the user gave before anything is written."""
    from_scratch = args.from_scratch or args.fast or args.video is not None
    refuse_idle_options(args, from_scratch)
    module = tasks.module(name)
    recipe = dataclasses.replace(module.RECIPE, **FAST) if args.fast else module.RECIPE
    recipe = dataclasses.replace(recipe, **read_settings(args.set, from_scratch))
    pick_device(args.device or "cpu")
    torch.set_num_threads(args.threads or os.cpu_count() or 1)

    demo, warnings = video.read(args.video or tasks.VIDEOS / name / "expert_01.mp4")
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    random = demo[:0] if args.video else video.read(tasks.VIDEOS / name / "random.mp4")[0]
    weights = args.weights or tasks.WEIGHTS / name
    perception = None if from_scratch else load_perception(weights, name)
    if args.evaluate:
        sac.load(weights / "policy.safetensors")

    settings = {
        "task": name,
        "seed": args.seed,
        "reward": args.reward,
        "without": args.without,
        "fast": args.fast,
        "from_scratch": from_scratch,
        "jitter": args.jitter,
        "video": hashlib.sha256(demo.tobytes()).hexdigest()[:16],
        "set": sorted(args.set),
        "recipe": dataclasses.asdict(recipe),
    }
    run = Run(prepare_folder(args.out or Path("runs") / name, settings, args.resume))
    command = shlex.join(["python", "-m", "tasks", name, *argv])
    run.metrics["command"] = command
    run.metrics["settings"] = settings
    machine = f"{platform.machine()}, {os.cpu_count()} cores, torch {torch.__version__}"
    run.metrics["machine"] = machine
    return Job(name, args, recipe, from_scratch, demo, random, perception, weights, command, run)


def refuse_idle_options(args: argparse.Namespace, from_scratch: bool) -> None:
    """Raise InputError for an option that would do nothing beside the others."""
    idle = []
    if args.evaluate:
        why = "--evaluate only replays a trained policy"
        idle = [("--from-scratch", args.from_scratch, why), ("--video", args.video, why),
                ("--set", args.set, why), ("--fast", args.fast, why),
                ("--resume", args.resume, why)]  # fmt: skip
    if args.reward == "literal":
        idle += [("--without", args.without, "the literal reward has no mends")]
    if from_scratch:
        idle += [("--weights", args.weights, "perception is trained anew here")]
    else:
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


def read_settings(given: list[str], from_scratch: bool) -> dict[str, Any]:
    """The recipe's fields that `--set NAME=VALUE` names, with values of the fields' types."""
    fields = {field.name: field for field in dataclasses.fields(Recipe)}
    del fields["human_frames"]  # `record` films so many; here the videos have what they have
    out = {}
    for text in given:
        name, _, value = text.partition("=")
        if name not in fields:
            raise InputError(
                f"--set {text}: the recipe has no {name!r}; it has {', '.join(fields)}."
            )
        if name in PERCEPTION and not from_scratch:
            raise InputError(f"--set {text}: perception is not trained here; add --from-scratch.")
        out[name] = read_number(text, value, whole=fields[name].type == "int")
    return out


def read_number(text: str, value: str, whole: bool) -> float:
    """The value of a setting: a whole number of 1 or more, or else any finite number."""
    try:
        number = int(value) if whole else float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number) or (whole and number < 1):
        kind = "whole number of 1 or more" if whole else "finite number"
        raise InputError(f"--set {text}: {value!r} is no {kind}.")
    return number


def prepare_folder(out: Path, settings: dict[str, Any], resume: bool) -> Path:
    """The run's folder: the same run's if `resume`, else a new one, or InputError."""
    note = out / "settings.json"
    if resume:
        if not note.exists():
            raise InputError(f"{out}: there is no run to resume here; start it without --resume.")
        if json.loads(note.read_text()) != settings:
            raise InputError(f"{out}: that run had other settings; give those, or another --out.")
        return out
    make_folder(out)
    try:
        for pattern in RESULTS if note.exists() else ():  # an older run makes room
            for file in out.glob(pattern):
                file.unlink()
        write_atomic(note, json.dumps(settings))
    except OSError as error:
        raise InputError(
            f"{out}: cannot write there ({error.strerror}); give another --out."
        ) from None
    return out
