"""The command line: `python -m tasks push` runs the paper on one task.

python -m tasks TASK      learn TASK from its human video, evaluate, write runs/TASK/report.html
python -m tasks record T  film the human videos of task T again
python -m tasks table     the results of all tasks; what is missing is run first
python -m tasks ablation  what each mend of the reward is worth
python -m tasks gallery   one page with every task's scene, demonstration and rollout
python -m tasks bench     steps, iterations and updates a second on this machine
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
from importlib import import_module
from pathlib import Path

import gymnasium as gym
import numpy as np
import torch

import tasks
from lbw_minimal import sac, video
from lbw_minimal.imitate import PACE, Run, imitate, learn_perception, load_perception
from lbw_minimal.report import wilson, write_report
from lbw_minimal.reward import MENDS
from lbw_minimal.training import InputError, pick_device, seed_everything, write_atomic
from tasks.probe import probe
from tasks.viewer import mirror
from tasks.world import record_expert, record_random

FPS = 25
EXPERTS = 15  # videos of the task being done; the method learns from the first alone
TRIES = 3 * EXPERTS  # a human films again when it went wrong, but not for ever
TEST_EPISODES = 10  # as in the paper
JITTER = 0.005  # m, start jitter, so that ten test episodes are ten episodes
TEST_SEED = 1_000_000  # first seed of the test episodes, far from those of training
PROBE_SEED = 2_000_000
OTHERS = ("record", "table", "ablation", "gallery", "bench")
RESULTS = ("*.checkpoint", "*.safetensors", "*_log.json", "metrics.json", "report.html")
FAST = {"munit_iterations": 20, "munit_width": 8, "transporter_iterations": 30, "policy_steps": 1000,
        "robot_frames": 200}  # fmt: skip


def parse(argv):
    parser = argparse.ArgumentParser(prog="python -m tasks", description=__doc__.splitlines()[0])
    parser.add_argument("what", help=f"a task ({', '.join(tasks.TASKS)}), or {', '.join(OTHERS)}")
    parser.add_argument("task", nargs="?", help="with record: the task to film")
    parser.add_argument("--video", type=Path, help="another human video, as the whole human domain")
    parser.add_argument("--out", type=Path, help="folder of the run (runs/TASK)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default="cpu", help="cpu or cuda")
    parser.add_argument("--threads", type=int, default=0, help="torch threads (all cores)")
    parser.add_argument("--reward", choices=("mended", "literal"), default="mended")
    parser.add_argument("--without", choices=MENDS, help="leave one mend of the reward out")
    parser.add_argument(
        "--jobs", type=int, default=1, help="with table and ablation: runs at a time"
    )
    parser.add_argument("--from-scratch", action="store_true", help="train perception too")
    parser.add_argument(
        "--weights", type=Path, help="folder with trained weights (the shipped ones)"
    )
    parser.add_argument("--evaluate", action="store_true", help="only replay the shipped policy")
    parser.add_argument("--episodes", type=int, help=f"test episodes ({TEST_EPISODES})")
    parser.add_argument("--resume", action="store_true", help="go on with the run in --out")
    parser.add_argument("--fast", action="store_true", help="a smoke run through every stage")
    args = parser.parse_args(argv)
    args.given = sys.argv[1:] if argv is None else argv
    return args


def task_module(name):
    if name not in tasks.TASKS:
        raise InputError(f"{name}: there is no such task; choose one of {', '.join(tasks.TASKS)}.")
    return tasks.module(name)


def record(name):
    """Film 15 expert videos and one of random motion; demonstration and random have Table I's
    frames."""
    recipe = task_module(name).RECIPE
    folder = tasks.VIDEOS / name
    folder.mkdir(parents=True, exist_ok=True)
    env = gym.make(tasks.id_of(name), embodiment="human").unwrapped
    seed, films = 0, []
    while len(films) < EXPERTS:
        if seed == TRIES:
            raise InputError(
                f"{name}: its expert succeeds in {len(films)} of {seed} tries; mend its waypoints."
            )
        film, _, done = record_expert(env, seed)
        seed += 1
        if done:
            films.append(film)
            video.write(folder / f"expert_{len(films):02d}.mp4", film, FPS)
    random, _ = record_random(env, recipe.human_frames - len(films[0]), seed=seed, take=20)
    video.write(folder / "random.mp4", random, FPS)
    print(f"{name}: {EXPERTS} expert videos and {len(random)} frames of random motion in {folder}")


def run(args):
    """One task, from its human video to its report."""
    name, module = args.what, task_module(args.what)
    recipe = dataclasses.replace(module.RECIPE, **FAST) if args.fast else module.RECIPE
    if args.reward == "literal" and args.without:
        raise InputError(
            f"--without {args.without}: the literal reward has no mends; leave one of the two."
        )
    if args.episodes is not None and args.episodes < 1:
        raise InputError(f"--episodes {args.episodes}: play at least one.")
    pick_device(args.device)  # say so before anything else if there is none
    torch.set_num_threads(args.threads or os.cpu_count())
    from_scratch = args.from_scratch or args.fast or args.video is not None

    # Look at everything the user gave before anything is written.
    clip = args.video or tasks.VIDEOS / name / "expert_01.mp4"
    demo, warnings = video.read(clip)
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    random = demo[:0] if args.video else video.read(tasks.VIDEOS / name / "random.mp4")[0]
    perception = (
        None if from_scratch else load_perception(args.weights or tasks.WEIGHTS / name, name)
    )
    policy = (args.weights or tasks.WEIGHTS / name) / "policy.safetensors"
    if args.evaluate:
        sac.load(policy)
    settings = {
        "task": name, "seed": args.seed, "reward": args.reward, "without": args.without, "fast": args.fast,
        "from_scratch": from_scratch, "video": hashlib.sha256(demo.tobytes()).hexdigest()[:16],
    }  # fmt: skip
    out = prepare_folder(args.out or Path("runs") / name, settings, args.resume)
    if args.evaluate:
        shutil.copy(policy, out / "policy.safetensors")
    here = Run(out)
    command = "python -m tasks " + shlex.join(args.given)
    here.metrics["command"] = command
    here.metrics["settings"] = settings | {"recipe": dataclasses.asdict(recipe)}
    here.metrics["machine"] = (
        f"{platform.machine()}, {os.cpu_count()} cores, torch {torch.__version__}"
    )

    start = time.monotonic()
    films = gym.make(tasks.id_of(name)).unwrapped
    frames = recipe.robot_frames if from_scratch else min(PACE, recipe.robot_frames)
    robot, _ = record_random(films, frames, seed=args.seed)
    here.metrics["stages"]["robot_video"] = round(time.monotonic() - start, 1)

    if from_scratch:
        seed_everything(args.seed)
        perception = learn_perception(
            demo, random, robot, recipe, task=name, seed=args.seed, run=here, device=args.device
        )
    torch.set_num_threads(1)  # SAC's networks are small: a second thread costs more than it brings
    env = gym.make(tasks.id_of(name), jitter=JITTER)
    agent, env = imitate(env, demo, robot, perception, recipe, seed=args.seed, run=here, form=args.reward,
                          without=args.without)  # fmt: skip

    # The probe films the simulated human, whom a perception trained on another video never saw.
    if from_scratch and args.video is None and "perception" not in here.metrics:
        here.metrics["perception"] = probe(tasks.id_of(name), perception, PROBE_SEED + args.seed)

    episodes, first, scene = evaluate(
        agent, env, args.episodes or (2 if args.fast else TEST_EPISODES)
    )
    here.metrics["episodes"] = episodes
    wins, n = sum(e["success"] for e in episodes), len(episodes)
    low, high = wilson(wins, n)
    here.metrics["success"] = {"rate": wins / n, "low": low, "high": high, "episodes": n}
    here.metrics["memory_mb"] = round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    here.save()
    log = out / "policy_log.json"
    log = json.loads(log.read_text()) if log.exists() else []  # a replayed policy brings none
    write_report(
        out / "report.html",
        task=name,
        demo=demo,
        translated=perception.translated,
        z_demo=perception.z_E,
        log=log,
        episode=first,
        metrics=here.metrics,
        scene_html=scene,
        command=command,
    )
    print(f"{name}: {wins}/{n} successes (95% CI {low:.2f}-{high:.2f})")
    print(f"report: {out / 'report.html'}")


def prepare_folder(out, settings, resume):
    """The run's folder: the same run's if `resume`, else a new one. Raises InputError where it
    cannot be."""
    note = out / "settings.json"
    if resume:
        if not note.exists():
            raise InputError(f"{out}: there is no run to resume here; start it without --resume.")
        if json.loads(note.read_text()) != settings:
            raise InputError(f"{out}: that run had other settings; give those, or another --out.")
        return out
    try:
        out.mkdir(parents=True, exist_ok=True)
        for pattern in RESULTS if note.exists() else ():  # an older run makes room
            for file in out.glob(pattern):
                file.unlink()
        write_atomic(note, json.dumps(settings))
    except OSError as error:
        raise InputError(
            f"{out}: cannot write there ({error.strerror}); give another --out."
        ) from None
    return out


def evaluate(agent, env, n):
    """Test episodes of the deterministic policy: a row each, the first filmed and mirrored in 3-D.

    Success is the paper's: the task is complete at some step. An episode is as long as in training,
    so the rest of a long horizon, when the demonstration is over, gives no second chance.
    """
    rows, first, scene = [], {}, None
    for i in range(n):
        z, _ = env.reset(seed=TEST_SEED + i)
        base = env.unwrapped
        recorder = None
        if i == 0:
            recorder = mirror(base)
        film, zs, parts, done, hits = [], [z], [], False, []
        if recorder:
            recorder.snap()
        while not done:
            z, _, terminated, truncated, info = env.step(agent.act(z, deterministic=True))
            done = terminated or truncated
            hits.append(info["is_success"])
            if recorder:
                film.append(base.world.render())
                zs.append(z)
                parts.append(info["reward_parts"])
                recorder.snap()
        rows.append({"seed": TEST_SEED + i, "success": any(hits), "success_at_end": hits[-1],
                     "first_success": hits.index(True) + 1 if any(hits) else None})  # fmt: skip
        if recorder:
            first = {"frames": np.stack(film), "z": np.stack(zs[1:]), "parts": parts}
            scene = recorder.html(title="A test episode")
    return rows, first, scene


def main(argv=None):
    args = parse(argv)
    try:
        if args.what == "record":
            if args.task is None:
                raise InputError(f"record: name the task to film; one of {', '.join(tasks.TASKS)}.")
            record(args.task)
        elif args.what in ("table", "ablation"):
            results = import_module("tasks.table")
            print(getattr(results, args.what)(args.out or Path("runs/table"), args.jobs))
        elif args.what == "gallery":
            page = import_module("tasks.gallery").write(args.out or Path("runs/gallery"))
            print(f"gallery: {page}")
        elif args.what == "bench":
            import_module("tasks.bench").main()
        else:
            run(args)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
