"""The paper on one task: check the input, perceive, learn, test, report.

In: the human video of the task, or the user's. Out: a folder with weights, logs, `metrics.json` and
`report.html`, and a line with the result.
"""

from __future__ import annotations

import shutil
import time
from itertools import islice
from pathlib import Path
from typing import Any, cast

import gymnasium as gym
import numpy as np
import torch
from gymnasium.spaces import Box

import tasks
from lbw_minimal import classifier, cyclegan, rivals, sac, tracks
from lbw_minimal.clips.stills import read_stills
from lbw_minimal.follow import follow
from lbw_minimal.imitate import PACE, Perception, imitate, learn_perception
from lbw_minimal.report import wilson, write_report
from lbw_minimal.training import InputError, counted, peak_memory, read_json
from tasks.commands.job import TEST_EPISODES, Job, check, parser
from tasks.commands.links import links
from tasks.commands.prepare import STILLS
from tasks.commands.probe import PROBE_SEED, probe
from tasks.world import TaskEnv
from tasks.world.viewer import mirror

TEST_SEED = 1_000_000  # first seed of the test episodes, far from those of training


def main(name: str, argv: list[str]) -> None:
    """Run the task `name` with these arguments. Raises InputError for a mistake in them."""
    job = check(name, parser(name).read(argv), argv)
    if job.args.method == "lbw":
        perception, robot = perceive(job)
        agent, env = learn(job, perception, robot)
        seen = {"demo": job.demo, "translated": perception.translated, "z_demo": perception.z_E}
    elif job.args.method == "tracks":
        agent, env, seen = track(job)
    else:
        agent, env, seen = rival(job)
    first, scene = test(job, agent, env)
    report(job, seen, first, scene)


def perceive(job: Job) -> tuple[Perception, np.ndarray]:
    """Film the robot's random motion, and train perception if it is to be learnt.

    Returns perception and the film (M, 84, 84, 3) uint8: what it learns from, or as much as shows
    the robot's pace.
    """
    seed, most = job.args.seed, job.recipe.robot_frames
    robot = film_robot(job, most if job.from_scratch else min(PACE, most))
    perception = job.trained
    if perception:
        bring(job, "translation", "keypoints")
    else:
        perception = learn_perception(
            job.demo, job.random, robot, job.recipe,
            task=job.name, seed=seed, run=job.run, device=job.args.device or "cpu",
        )  # fmt: skip
    # The probe films the simulated human, whom a perception trained on another video never saw.
    if job.from_scratch and not job.args.translate_clip and "perception" not in job.run.metrics:
        perception.watch(job.demo)
        found = probe(job.name, perception, PROBE_SEED + seed)
        job.run.metrics["perception"] = found
        job.run.save()
    return perception, robot


def bring(job: Job, *names: str) -> None:
    """Copy trained weights to the run's folder, which so has all that its policy's replay takes."""
    for name in names:
        shutil.copy(job.weights / f"{name}.safetensors", job.run.out)


def film_robot(job: Job, frames: int) -> np.ndarray:
    """Random robot motion, (frames, 84, 84, 3) uint8; the time it takes goes to the metrics."""
    start = time.monotonic()
    robot = tasks.pace_film(job.name, job.args.seed, frames)
    job.run.metrics["stages"]["robot_video"] = round(time.monotonic() - start, 1)
    return robot


def rival(job: Job) -> tuple[sac.Policy, gym.Env, dict[str, Any]]:
    """A rival's policy, its environment, and what its classifier was shown, for the report."""
    recipe, run, device = job.recipe, job.run, job.args.device or "cpu"
    avid = job.args.method == "avid"
    if job.args.weights:
        bring(job, *["translation"] * avid, *["classifier", "policy"] * job.args.evaluate)
    env = gym.make(tasks.id_of(job.name), jitter=job.args.jitter)
    common = {"task": job.name, "seed": job.args.seed, "run": run, "device": device}
    if not avid:
        start = time.monotonic()
        films = tasks.robot_experts(job.name, job.args.jitter)
        shown = [frames for frames, _ in islice(films, 1 if job.args.evaluate else None)]
        run.metrics["stages"]["robot_experts"] = round(time.monotonic() - start, 1)
        seen: dict[str, Any] = {"demo": shown[0]}
    if job.args.evaluate:
        agent, env = rivals.replayed(env, run.out, job.name)
    elif avid:  # a translation that is there needs no frames of the robot
        robot = job.demo[:0] if job.args.weights else film_robot(job, recipe.robot_frames)
        agent, env = rivals.avid_m(env, job.experts, job.random, robot, recipe, **common)
    else:
        random = film_robot(job, recipe.robot_frames) if recipe.random_negatives else shown[0][:0]
        agent, env = rivals.classifier_reward(env, shown, random, recipe, **common)
    if avid:
        G = cyclegan.load(run.out / "translation.safetensors", job.name)
        seen = {"demo": job.demo, "translated": cyclegan.translate(G, job.demo)}
    model = classifier.load(run.out / "classifier.safetensors", job.name)
    return agent, env, seen | {"logits": classifier.logits(model, [*seen.values()][-1])}


def learn(job: Job, perception: Perception, robot: np.ndarray) -> tuple[sac.Policy, gym.Env]:
    """The policy, trained or replayed, and its environment."""
    torch.set_num_threads(1)  # SAC's networks are small: a second thread costs more than it gains
    if job.args.evaluate:
        bring(job, "policy")
    agent, env = imitate(
        gym.make(tasks.id_of(job.name), jitter=job.args.jitter),
        job.demo, robot, perception, job.recipe,
        seed=job.args.seed, run=job.run, form=job.args.reward, without=job.args.without,
    )  # fmt: skip
    refuse_strangers(job.weights, agent, env, "--reward")
    return agent, env


def track(job: Job) -> tuple[sac.Policy, gym.Env, dict[str, Any]]:
    """The policy by object tracks, its environment, and the tracked video for the report."""
    torch.set_num_threads(1)
    robot = film_robot(job, PACE)
    if job.args.evaluate:
        bring(job, "policy")
    env: gym.Env = gym.make(tasks.id_of(job.name), jitter=job.args.jitter)
    agent, env = follow(env, job.demo, robot, job.recipe, seed=job.args.seed, run=job.run)
    refuse_strangers(job.weights, agent, env, "--method")
    return agent, env, {"demo": tracks.draw(job.demo)}


def refuse_strangers(weights: Path, agent: sac.Policy, env: gym.Env, option: str = "") -> None:
    """Raise InputError if the policy in `weights` was trained to see something else than `env`
    shows: what goes with an option of the run, or else with the mended reward."""
    sees, given = agent.sizes["obs_dim"], cast(Box, env.observation_space).shape[0]
    if sees != given:
        this = f"this {option[2:]}" if option else "the mended reward"
        remedy = f"the {option} it was trained with" if option else "one that learnt by that"
        why = f"that policy sees {sees} numbers, and {given} come with {this}"
        raise InputError(f"{weights}: {why}; give {remedy}.")


def test(job: Job, agent: sac.Policy, env: gym.Env) -> tuple[dict[str, Any], str]:
    """Play the test episodes, note their results, and return the first one's film and scene."""
    n = job.args.episodes or (2 if job.args.fast else TEST_EPISODES)
    episodes, first, scene = evaluate(agent, env, n)
    wins = sum(episode["success"] for episode in episodes)
    low, high = wilson(wins, n)
    metrics = job.run.metrics
    metrics["episodes"] = episodes
    metrics["success"] = {"rate": wins / n, "low": low, "high": high, "episodes": n}
    if most := peak_memory():
        metrics["memory_mb"] = round(most / 2**20)
    job.run.save()
    return first, scene


def evaluate(agent: sac.Policy, env: gym.Env, n: int) -> tuple[list[dict], dict[str, Any], str]:
    """n test episodes of the policy without noise: a row each, and the first one's film and scene.

    Success is the paper's: the task is complete at some step. An episode is as long as in training,
    so the rest of a long horizon, when the demonstration is over, gives no second chance.
    """
    rows, base = [], cast(TaskEnv, env.unwrapped)
    film, zs, parts, scene = [], [], [], ""
    for i in counted(range(n), n, "test episodes"):
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


def report(job: Job, seen: dict[str, Any], first: dict[str, Any], scene: str) -> None:
    """Write the page of the run and print its result; seen: what its first section shows."""
    out, metrics = job.run.out, job.run.metrics
    log = out / "policy_log.json"
    write_report(
        out / "report.html",
        task=job.name,
        **seen,
        clip=read_stills(out / STILLS),
        goal=tasks.goal(job.name),
        log=read_json(log) if log.exists() else [],  # a replayed policy has none
        episode=first,
        metrics=metrics,
        scene_html=scene,
        command=job.command,
        links=links(out / "report.html"),
    )
    result = metrics["success"]
    wins, low, high = round(result["rate"] * result["episodes"]), result["low"], result["high"]
    print(f"{job.name}: {wins}/{result['episodes']} successes (95% CI {low:.2f}-{high:.2f})")
    print(f"report: {out / 'report.html'}")
