"""Learning by Watching, the whole method: one human video in, a policy out.

    translate (Eq. 1-5) -> detect keypoints (Eq. 6-7) -> reward (Eq. 8-10) -> soft actor-critic

Every stage leaves its result as a file in the run's folder and is skipped if that file exists, so a
run that was killed goes on where it was. Frames are all that any stage learns from.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from gymnasium.wrappers import TimeLimit

from lbw_minimal import munit, sac, transporter
from lbw_minimal.reward import KeypointReward, LiteralReward, MendedReward
from lbw_minimal.training import Checkpoint, InputError, read_json, write_atomic
from lbw_minimal.wrappers import KeypointObservation, KeypointRewardWrapper

# Frames of random robot motion that show its pace. So few take seconds to film anew, and a trained
# policy gets the very reward it was trained on.
PACE = 400


@dataclass(frozen=True)
class Recipe:
    """How much of everything a task takes; the defaults serve all tasks."""

    human_frames: int  # frames the translation sees: the demonstration and random motion (Table I)
    robot_frames: int  # frames of random robot motion (Table I)
    munit_iterations: int = 1200
    munit_width: int = 20  # channels of the first layer
    transporter_iterations: int = 600
    K: int = 5  # keypoints
    shift: int = 0  # pixels by which the detector's training moves frames
    hue: int = 0  # degrees by which it turns hues
    policy_steps: int = 3_000  # environment steps of SAC
    updates: int = 2  # of SAC's networks, an environment step
    entropy: float = -1.0  # SAC's target at first, per number of an action; it falls to -3.5
    # The rivals' alone, see `rivals.py`.
    motion: bool = False  # CycleGAN with MUNIT's motion weights
    classifier_iterations: int = 10_000
    random_negatives: bool = True  # random motion is among the classifier's negatives
    clip: float = 10.0  # the classifier's logit that earns a reward of 1, and the most that counts
    pixel_updates: int = 1  # of SAC+AE's networks, an environment step
    hold: int = 10  # steps for which each random action is kept, before SAC+AE has learnt any


@dataclass
class Perception:
    """The trained translator T and detector Psi, and what they see in the demonstration."""

    translator: munit.MUNIT
    style: torch.Tensor  # (style_dim,) the robot style that every human frame is given
    detector: transporter.Transporter
    translated: np.ndarray = field(init=False)  # v^E (N, 84, 84, 3) uint8, from `watch`
    z_E: np.ndarray = field(init=False)  # (N, K, 2), from `watch`

    def translate(self, frames: np.ndarray) -> np.ndarray:
        """Human frames (T, 84, 84, 3) uint8 as the robot would look, same shape."""
        return munit.translate(self.translator, frames, self.style)

    def watch(self, demo: np.ndarray) -> None:
        """Translate the demonstration (N, 84, 84, 3) uint8 and find its keypoint trajectory."""
        self.translated = self.translate(demo)  # v_1^E .. v_N^E
        self.z_E = self.detect(self.translated)  # z_1^E .. z_N^E

    def detect(self, frames: np.ndarray) -> np.ndarray:
        """Keypoints (T, K, 2) of robot frames, real or translated."""
        return transporter.detect(self.detector, frames)


class Run:
    """The folder of one run: results of its stages, checkpoints, logs, and metrics.json."""

    def __init__(self, out: Path):
        self.out = Path(out)
        path = self.out / "metrics.json"
        self.metrics = read_json(path) if path.exists() else {"stages": {}}

    def save(self) -> None:
        """Write metrics.json."""
        write_atomic(self.out / "metrics.json", json.dumps(self.metrics, indent=1) + "\n")

    @contextmanager
    def stage(self, name: str) -> Iterator[Checkpoint]:
        """Lend a checkpoint to a training. Afterwards note the time it took and drop its files."""
        path = self.out / f"{name}.checkpoint"
        checkpoint = Checkpoint(path)
        yield checkpoint
        self.metrics["stages"][name] = round(checkpoint.spent, 1)
        self.save()
        for file in (path, path.with_suffix(".frames")):  # a policy's from pixels
            file.unlink(missing_ok=True)

    def log(self, name: str, rows: list[dict]) -> None:
        """Write the log of a training."""
        write_atomic(self.out / f"{name}.json", json.dumps(rows) + "\n")


def load_perception(folder: Path, task: str) -> Perception:
    """Perception from `translation.safetensors` and `keypoints.safetensors`.

    Raises InputError if a file is missing, damaged, or belongs to another task.
    """
    translator, style = munit.load(Path(folder) / "translation.safetensors", task)
    detector = transporter.load(Path(folder) / "keypoints.safetensors", task)
    return Perception(translator, style, detector)


def learn_perception(
    demo: np.ndarray,
    random: np.ndarray,
    robot: np.ndarray,
    recipe: Recipe,
    *,
    task: str,
    seed: int,
    run: Run,
    device: str = "cpu",
) -> Perception:
    """Train T and Psi on frames (T, 84, 84, 3) uint8 of the human and the robot.

    demo: the demonstration; random, robot: random motion of the human, which may be empty, and of
    the robot. task: what the files are marked with.
    """
    human = np.concatenate([demo, random])
    path = run.out / "translation.safetensors"
    if not path.exists():
        with run.stage("translation") as checkpoint:
            T, log = munit.train(
                human, robot, iterations=recipe.munit_iterations, width=recipe.munit_width,
                seed=seed, device=device, checkpoint=checkpoint,
            )  # fmt: skip
            run.log("translation_log", log)
            munit.save(path, T, munit.robot_style(T, robot), task)
    T, style = munit.load(path, task)

    path = run.out / "keypoints.safetensors"
    if not path.exists():
        with run.stage("keypoints") as checkpoint:
            v = [munit.translate(T, x, style) for x in (demo, random) if len(x)]
            Psi, log = transporter.train(
                [*v, robot], iterations=recipe.transporter_iterations, K=recipe.K,
                shift=recipe.shift, hue=recipe.hue,
                seed=seed, device=device, checkpoint=checkpoint,
            )  # fmt: skip
            run.log("keypoints_log", log)
            transporter.save(path, Psi, task)
    return Perception(T, style, transporter.load(path, task))


def make_reward(
    perception: Perception,
    robot: np.ndarray,
    form: str = "mended",
    *,
    without: str | None = None,
    horizon: int | None = None,
) -> KeypointReward:
    """r_t for the demonstration that `perception` has watched.

    robot (M, 84, 84, 3) uint8: random robot motion. form: "literal" or "mended"; without: one of
    `MENDS` to leave out. horizon: the most steps an episode may have.
    """
    if form == "literal":
        return LiteralReward(perception.z_E)
    if form != "mended":
        raise InputError(f"reward form {form!r}: choose 'literal' or 'mended'.")
    switches: dict[str, Any] = {without: False} if without else {}
    z_robot = perception.detect(robot[:PACE])
    return MendedReward(perception.z_E, z_robot, horizon=horizon, **switches)


def watched(
    env: gym.Env,
    perception: Perception,
    robot: np.ndarray,
    form: str = "mended",
    without: str | None = None,
) -> tuple[gym.Env, KeypointReward]:
    """`env` as the paper's agent sees it, observing keypoints and earning r_t, and that reward.

    An episode ends some time after the demonstration does, even if the horizon is longer: nothing
    is left to do then. The other arguments are those of `make_reward`.
    """
    horizon = env.spec.max_episode_steps if env.spec else None
    reward = make_reward(perception, robot, form, without=without, horizon=horizon)
    env = KeypointRewardWrapper(KeypointObservation(env, perception.detect), reward)
    return TimeLimit(env, min(horizon or reward.episode, reward.episode)), reward


def imitate(
    env: gym.Env,
    demo: np.ndarray,
    robot: np.ndarray,
    perception: Perception,
    recipe: Recipe,
    *,
    seed: int,
    run: Run,
    form: str = "mended",
    without: str | None = None,
) -> tuple[sac.Policy, gym.Env]:
    """Learn a policy for `env`, a Gymnasium environment of RGB frames, from one demonstration.

    demo (N, 84, 84, 3) uint8: the human video. robot (M, 84, 84, 3) uint8: random robot motion.
    form: "literal" for Eq. 8-10 as written, "mended" for what `reward.py` adds; without: one of
    `MENDS` to leave out. Returns the policy and `env` wrapped so that its observations are the
    policy's.
    """
    perception.watch(demo)
    env, _ = watched(env, perception, robot, form, without)
    return learn_policy(env, recipe, seed, run), env


def learn_policy(env: gym.Env, recipe: Recipe, seed: int, run: Run) -> sac.Policy:
    """SAC's policy for `env`, an environment of vectors: trained, or as the run has it."""
    path = run.out / "policy.safetensors"
    if not path.exists():
        with run.stage("policy") as checkpoint:
            agent, log = sac.train(
                env, steps=recipe.policy_steps, updates=recipe.updates,
                entropy=recipe.entropy, seed=seed, checkpoint=checkpoint,
            )  # fmt: skip
            run.log("policy_log", log)
            sac.save(path, agent)
    return sac.load(path)
