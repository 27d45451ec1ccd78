"""The paper's two rivals: the same control, from other rewards.

Both take many expert videos where LbW takes one. A goal classifier learns to tell their ends from
the rest, its logit is the reward, and SAC+AE learns from pixels. "Classifier reward" shows the
classifier videos of the robot itself, "AVID-m" videos of the human that CycleGAN has translated.

AVID-m is what the paper makes of AVID (Smith et al. 2020, arXiv 1912.04443). Its authors cut a task
into stages, with instruction images and a classifier for each, plan in a learnt model of latent
dynamics, and let a human confirm what was reached. Here, as in the paper, there is one stage, and
SAC+AE in the planner's place.

Every stage leaves its result in the run's folder, as in `imitate.py`.
"""

from __future__ import annotations

from pathlib import Path

import gymnasium as gym
import numpy as np
from gymnasium.wrappers import FrameStackObservation, TimeLimit

from lbw_minimal import classifier, cyclegan, sac_ae
from lbw_minimal.classifier import ClassifierReward, GoalClassifier
from lbw_minimal.imitate import Recipe, Run
from lbw_minimal.replay import STACK
from lbw_minimal.reward import MOST_OF_HORIZON
from lbw_minimal.sac_networks import Policy
from lbw_minimal.wrappers import ClassifierRewardWrapper

Videos = list[np.ndarray]  # each (T, 84, 84, 3) uint8


def classifier_reward(
    env: gym.Env,
    videos: Videos,
    random: np.ndarray,
    recipe: Recipe,
    *,
    task: str,
    seed: int,
    run: Run,
    device: str = "cpu",
) -> tuple[Policy, gym.Env]:
    """Learn a policy for `env` from expert videos of the robot itself.

    random (T, 84, 84, 3) uint8: further frames of the robot that show no goal, or none of them, as
    in the paper. Returns the policy and `env` wrapped so that its observations are the policy's.
    device: where all networks learn.
    """
    model = learn_goals(videos, random, recipe, task=task, seed=seed, run=run, device=device)
    return learn_from_pixels(env, model, recipe, seed=seed, run=run, device=device)


def avid_m(
    env: gym.Env,
    experts: Videos,
    random: np.ndarray,
    robot: np.ndarray,
    recipe: Recipe,
    *,
    task: str,
    seed: int,
    run: Run,
    device: str = "cpu",
) -> tuple[Policy, gym.Env]:
    """Learn a policy for `env` from expert videos of a human.

    random, robot (T, 84, 84, 3) uint8: random motion of the human and of the robot. The translation
    learns from the frames that LbW's learns from: of the experts only the first is among them. The
    classifier sees translated frames alone: among real ones it would learn to tell the two apart.
    """
    G = learn_translation(
        experts[0], random, robot, recipe, task=task, seed=seed, run=run, device=device
    )
    translated = [cyclegan.translate(G, video) for video in experts]
    others = cyclegan.translate(G, random) if recipe.random_negatives else random[:0]
    model = learn_goals(translated, others, recipe, task=task, seed=seed, run=run, device=device)
    return learn_from_pixels(env, model, recipe, seed=seed, run=run, device=device)


def learn_translation(
    demo: np.ndarray,
    random: np.ndarray,
    robot: np.ndarray,
    recipe: Recipe,
    *,
    task: str,
    seed: int,
    run: Run,
    device: str = "cpu",
) -> cyclegan.CycleGAN:
    """CycleGAN on the frames and for the number of updates that MUNIT has in `imitate.py`."""
    path = run.out / "translation.safetensors"
    if not path.exists():
        with run.stage("translation") as checkpoint:
            G, log = cyclegan.train(
                np.concatenate([demo, random]), robot, iterations=recipe.munit_iterations,
                width=recipe.munit_width, motion=recipe.motion, seed=seed, device=device,
                checkpoint=checkpoint,
            )  # fmt: skip
            run.log("translation_log", log)
            cyclegan.save(path, G, task)
    return cyclegan.load(path, task)


def learn_goals(
    videos: Videos,
    others: np.ndarray,
    recipe: Recipe,
    *,
    task: str,
    seed: int,
    run: Run,
    device: str = "cpu",
) -> GoalClassifier:
    """The goal classifier: the last tenth of each video against the rest, and `others`."""
    path = run.out / "classifier.safetensors"
    if not path.exists():
        with run.stage("classifier") as checkpoint:
            positive, negative = classifier.goal_frames(videos)
            model, log = classifier.train(
                positive, np.concatenate([negative, others]),
                iterations=recipe.classifier_iterations, seed=seed, device=device,
                checkpoint=checkpoint,
            )  # fmt: skip
            model.longest.fill_(max(map(len, videos)))
            run.log("classifier_log", log)
            classifier.save(path, model, task)
    return classifier.load(path, task)


def watched(env: gym.Env, model: GoalClassifier, clip: float = classifier.CLIP) -> gym.Env:
    """`env` as a rival's agent sees it: the last three frames, and the classifier's reward.

    An episode ends some time after the classifier's longest video, as LbW's after its
    demonstration.
    """
    horizon = env.spec.max_episode_steps if env.spec else None
    episode = round(model.longest.item() / MOST_OF_HORIZON)
    env = ClassifierRewardWrapper(env, ClassifierReward(model, clip))
    return TimeLimit(FrameStackObservation(env, STACK), min(horizon or episode, episode))


def replayed(env: gym.Env, folder: Path, task: str) -> tuple[Policy, gym.Env]:
    """A rival's policy from the folder of its run, and `env` as it sees it.

    Raises InputError if a file is missing, damaged, or another task's.
    """
    model = classifier.load(folder / "classifier.safetensors", task)
    return sac_ae.load(folder / "policy.safetensors"), watched(env, model)


def learn_from_pixels(
    env: gym.Env,
    model: GoalClassifier,
    recipe: Recipe,
    *,
    seed: int,
    run: Run,
    device: str = "cpu",
) -> tuple[Policy, gym.Env]:
    """SAC+AE on the classifier's reward."""
    env = watched(env, model, recipe.clip)
    path = run.out / "policy.safetensors"
    if not path.exists():
        with run.stage("policy") as checkpoint:
            agent, log = sac_ae.train(
                env, steps=recipe.policy_steps, updates=recipe.pixel_updates,
                hold=recipe.hold, entropy=recipe.entropy, seed=seed, device=device,
                checkpoint=checkpoint,
            )  # fmt: skip
            run.log("policy_log", log)
            sac_ae.save(path, agent)
    return sac_ae.load(path), env
