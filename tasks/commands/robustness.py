"""Does a trained policy cope with what its training never showed? Camera moved, light, colour.

In: trained weights. Out: success under each change, one change at a time, the same starts for all.
The demonstration stays as it was filmed. A detector that follows the change does not save a policy:
a camera that moved by a pixel moves every keypoint, but not the demonstration's.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import cast

import gymnasium as gym
import numpy as np
import torch
from gymnasium.wrappers import TransformObservation

import tasks
from lbw_minimal import sac
from lbw_minimal.imitate import watched
from lbw_minimal.report import wilson
from tasks.commands import JITTER, Parser, at_least
from tasks.commands.run import evaluate, refuse_strangers
from tasks.commands.table import markdown
from tasks.world import RED, TaskEnv, World

BLUE = (0.10, 0.12, 0.78, 1)
Change = Callable[[np.ndarray], np.ndarray]  # of a frame (84, 84, 3) uint8


def moved(right: int, down: int) -> Change:
    """The picture of a camera that was turned by whole pixels; what is at the edge is repeated."""

    def change(frame):
        height, width = frame.shape[:2]
        rows = np.clip(np.arange(height) - down, 0, height - 1)
        columns = np.clip(np.arange(width) - right, 0, width - 1)
        return frame[rows][:, columns]

    return change


def brighter(gain: float) -> Change:
    """The picture in another light."""
    return lambda frame: np.clip(gain * frame.astype(float), 0, 255).astype(np.uint8)


def unchanged(frame: np.ndarray) -> np.ndarray:
    """The picture as it is."""
    return frame


CHANGES: dict[str, Change] = {
    "as trained": unchanged,
    "camera 1 px down": moved(0, 1),
    "camera 1 px up": moved(0, -1),
    "camera 2 px right": moved(2, 0),
    "camera 2 px left": moved(-2, 0),
    "a fifth darker": brighter(0.8),
    "a fifth brighter": brighter(1.2),
    "object blue": unchanged,  # the simulator paints it: see `paint`
}


def parser() -> Parser:
    """The arguments of `robustness`."""
    p = Parser("robustness", "Test a trained policy under a moved camera, other light and colour.")
    p.add_task()
    p.add_weights()
    p.add_argument("--episodes", type=at_least(1), default=20, help="test episodes for each change")
    p.add_argument("--seed", type=at_least(0), default=0, help="that the weights were trained with")
    return p


def main(argv: list[str]) -> None:
    """Print success under each change. Raises InputError for missing or damaged weights."""
    args = parser().read(argv)
    weights = args.weights or tasks.WEIGHTS / args.task
    wins = robustness(args.task, weights, args.episodes, args.seed)
    rows = []
    for name, n in wins.items():
        low, high = wilson(n, args.episodes)
        rows.append([name, f"{n}/{args.episodes}", f"{100 * low:.0f}-{100 * high:.0f} %"])
    print(markdown([args.task, "success", "95 % interval"], rows), end="")


def robustness(task: str, weights: Path, episodes: int, seed: int = 0) -> dict[str, int]:
    """Successful test episodes of a task's policy under each change that the task's scene allows.

    seed: that of the training, whose film of the robot set the demonstration's pace.

    Raises InputError if weights are missing, damaged, or another task's.
    """
    torch.set_num_threads(1)  # for single frames a second thread costs more than it brings
    perception = tasks.trained_perception(task, weights)
    policy = sac.load(weights / "policy.safetensors")
    robot = tasks.pace_film(task, seed)
    wins = {}
    for name, change in CHANGES.items():
        env: gym.Env = gym.make(tasks.id_of(task), jitter=JITTER)
        world = cast(TaskEnv, env.unwrapped).world
        if name == "object blue" and not paint(world, RED, BLUE):
            env.close()
            continue
        env, _ = watched(TransformObservation(env, change, None), perception, robot)
        refuse_strangers(weights, policy, env)
        rows, *_ = evaluate(policy, env, episodes)
        wins[name] = sum(row["success"] for row in rows)
        env.close()
    return wins


def paint(world: World, old: tuple[float, ...], new: tuple[float, ...]) -> int:
    """Paint all of one colour in another, say red in blue; returns how many parts changed."""
    p, parts = world.p, 0
    for i in range(p.getNumBodies()):
        body = p.getBodyUniqueId(i)
        for shape in p.getVisualShapeData(body):
            if np.allclose(shape[7], old, atol=0.01):
                p.changeVisualShape(body, shape[1], rgbaColor=new)
                parts += 1
    return parts
