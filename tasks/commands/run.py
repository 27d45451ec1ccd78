"""The paper on one task: check the input, perceive, learn, test, report.

In: the human video of the task, or the user's. Out: a folder with weights, logs, `metrics.json` and
`report.html`, and a line with the result.
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import json
import os
import platform
import resource
import shlex
import shutil
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch

import tasks
from lbw_minimal import sac, video
from lbw_minimal.imitate import (
    PACE,
    Perception,
    Recipe,
    Run,
    imitate,
    learn_perception,
    load_perception,
)
from lbw_minimal.report import wilson, write_report
from lbw_minimal.reward import MENDS
from lbw_minimal.training import InputError, pick_device, seed_everything, write_atomic
from tasks.commands import Parser, at_least, make_folder
from tasks.commands.probe import PROBE_SEED, probe
from tasks.world import record_random
from tasks.world.viewer import mirror

TEST_EPISODES = 10  # as in the paper
JITTER = 0.005  # m, start jitter, so that ten test episodes are ten episodes
TEST_SEED = 1_000_000  # first seed of the test episodes, far from those of training
RESULTS = ("*.checkpoint", "*.safetensors", "*_log.json", "metrics.json", "report.html")
FAST = {
    "munit_iterations": 20,
    "munit_width": 8,
    "transporter_iterations": 30,
    "policy_steps": 1000,
    "robot_frames": 200,
}
PERCEPTION = ("munit_iterations", "munit_width", "transporter_iterations", "K", "robot_frames")


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
    add("--weights", type=Path, metavar="DIR", help="trained weights (those of the kit)")
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
    perception: Perception | None  # trained; None if it is to be learnt
    weights: Path  # folder of trained weights
    command: str  # what makes this run again
    run: Run


def main(name: str, argv: list[str]) -> None:
    """Run the task `name` with these arguments. Raises InputError for a mistake in them."""
    job = check(name, parser(name).read(argv), argv)
    robot = perceive(job)
    agent, env = learn(job, robot)
    first, scene = test(job, agent, env)
    report(job, first, scene)


def check(name: str, args: argparse.Namespace, argv: list[str]) -> Job:
    """Look at everything the user gave before anything is written."""
    from_scratch = args.from_scratch or args.fast or args.video is not None
    refuse_idle_options(args, from_scratch)
    module = tasks.module(name)
    recipe = dataclasses.replace(module.RECIPE, **FAST) if args.fast else module.RECIPE
    recipe = dataclasses.replace(recipe, **read_settings(args.set, from_scratch))
    pick_device(args.device or "cpu")
    torch.set_num_threads(args.threads or os.cpu_count())

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
        "video": hashlib.sha256(demo.tobytes()).hexdigest()[:16],
        "set": sorted(args.set),
    }
    run = Run(prepare_folder(args.out or Path("runs") / name, settings, args.resume))
    command = shlex.join(["python", "-m", "tasks", name, *argv])
    run.metrics["command"] = command
    run.metrics["settings"] = settings | {"recipe": dataclasses.asdict(recipe)}
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
        try:
            out[name] = int(value)
        except ValueError:
            out[name] = 0
        if out[name] < 1:
            raise InputError(f"--set {text}: {value!r} is no whole number of 1 or more.")
    return out


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


def perceive(job: Job) -> np.ndarray:
    """Film the robot's random motion, and train perception if it is to be learnt.

    Returns the film (M, 84, 84, 3) uint8: what perception learns from, or as much as shows the
    pace.
    """
    start, seed = time.monotonic(), job.args.seed
    film_env = gym.make(tasks.id_of(job.name)).unwrapped
    most = job.recipe.robot_frames
    robot, _ = record_random(film_env, most if job.from_scratch else min(PACE, most), seed=seed)
    film_env.close()
    job.run.metrics["stages"]["robot_video"] = round(time.monotonic() - start, 1)
    if job.perception is None:
        seed_everything(seed)
        job.perception = learn_perception(
            job.demo, job.random, robot, job.recipe,
            task=job.name, seed=seed, run=job.run, device=job.args.device or "cpu",
        )  # fmt: skip
    # The probe films the simulated human, whom a perception of another video never saw.
    if job.from_scratch and job.args.video is None and "perception" not in job.run.metrics:
        job.perception.watch(job.demo)
        found = probe(tasks.id_of(job.name), job.perception, PROBE_SEED + seed)
        job.run.metrics["perception"] = found
        job.run.save()
    return robot


def learn(job: Job, robot: np.ndarray) -> tuple[sac.SAC, gym.Env]:
    """The policy, trained or replayed, and its environment."""
    torch.set_num_threads(1)  # SAC's networks are small: a second thread costs more than it brings
    if job.args.evaluate:
        shutil.copy(job.weights / "policy.safetensors", job.run.out / "policy.safetensors")
    agent, env = imitate(
        gym.make(tasks.id_of(job.name), jitter=JITTER), job.demo, robot, job.perception, job.recipe,
        seed=job.args.seed, run=job.run, form=job.args.reward, without=job.args.without,
    )  # fmt: skip
    sees, given = agent.sizes["obs_dim"], env.observation_space.shape[0]
    if sees != given:
        why = f"that policy sees {sees} numbers, and {given} come with this reward"
        raise InputError(f"{job.weights}: {why}; give the --reward it was trained with.")
    return agent, env


def test(job: Job, agent: sac.SAC, env: gym.Env) -> tuple[dict[str, Any], str]:
    """Play the test episodes, note their results, and return the first one's film and scene."""
    n = job.args.episodes or (2 if job.args.fast else TEST_EPISODES)
    episodes, first, scene = evaluate(agent, env, n)
    wins = sum(episode["success"] for episode in episodes)
    low, high = wilson(wins, n)
    metrics = job.run.metrics
    metrics["episodes"] = episodes
    metrics["success"] = {"rate": wins / n, "low": low, "high": high, "episodes": n}
    metrics["memory_mb"] = round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    job.run.save()
    return first, scene


def evaluate(agent: sac.SAC, env: gym.Env, n: int) -> tuple[list[dict], dict[str, Any], str]:
    """n test episodes of the policy without noise: a row each, and the first one's film and scene.

    Success is the paper's: the task is complete at some step. An episode is as long as in training,
    so the rest of a long horizon, when the demonstration is over, gives no second chance.
    """
    rows, base = [], env.unwrapped
    film, zs, parts, scene = [], [], [], ""
    for i in range(n):
        z, _ = env.reset(seed=TEST_SEED + i)
        recorder = mirror(base) if i == 0 else None
        if recorder:
            recorder.snap()
        done, hits = False, []
        while not done:
            z, _, terminated, truncated, info = env.step(agent.act(z, deterministic=True))
            done = terminated or truncated
            hits.append(info["is_success"])
            if recorder:
                film.append(base.world.render())
                zs.append(z)
                parts.append(info["reward_parts"])
                recorder.snap()
        rows.append(
            {
                "seed": TEST_SEED + i,
                "success": any(hits),
                "success_at_end": hits[-1],
                "first_success": hits.index(True) + 1 if any(hits) else None,
            }
        )
        if recorder:
            scene = recorder.html(title="A test episode")
    return rows, {"frames": np.stack(film), "z": np.stack(zs), "parts": parts}, scene


def report(job: Job, first: dict[str, Any], scene: str) -> None:
    """Write the page of the run and print its result."""
    out, metrics = job.run.out, job.run.metrics
    log = out / "policy_log.json"
    write_report(
        out / "report.html",
        task=job.name,
        demo=job.demo,
        translated=job.perception.translated,
        z_demo=job.perception.z_E,
        log=json.loads(log.read_text()) if log.exists() else [],  # a replayed policy brings none
        episode=first,
        metrics=metrics,
        scene_html=scene,
        command=job.command,
    )
    result = metrics["success"]
    wins, low, high = round(result["rate"] * result["episodes"]), result["low"], result["high"]
    print(f"{job.name}: {wins}/{result['episodes']} successes (95% CI {low:.2f}-{high:.2f})")
    print(f"report: {out / 'report.html'}")
