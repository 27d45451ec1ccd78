"""A task's scene as a page that turns with the mouse: the scripted expert does the task in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import tasks
from tasks.commands import Parser, at_least, make_folder
from tasks.world import TaskEnv, expert_actions
from tasks.world.viewer import Recorder, mirror


def parser() -> Parser:
    """The arguments of `viewer`."""
    p = Parser("viewer", "Write a task's scene as a page that turns with the mouse.")
    p.add_task()
    p.add_argument("--embodiment", choices=("robot", "human"), default="robot", help="whose arm")
    p.add_argument("--seed", type=at_least(0), default=0, help="of the expert's way of moving")
    p.add_argument(
        "--out", type=Path, default=Path("runs/viewer"), metavar="DIR", help="its folder"
    )
    return p


def main(argv: list[str]) -> None:
    """Write the page. Raises InputError for a mistake in the arguments."""
    args = parser().read(argv)
    make_folder(args.out)
    path = args.out / f"{args.task}-{args.embodiment}.html"
    env = tasks.bare(args.task, embodiment=args.embodiment, observation="state")
    perform(env, path, f"{args.task}: the expert, as a {args.embodiment}", args.seed)
    env.close()
    print(f"viewer: {path}")


def perform(env: TaskEnv, path: Path, title: str, seed: int = 0) -> Recorder:
    """Let the scripted expert do the task, write the scene to a file, and return it."""
    env.reset(seed=seed)
    scene = mirror(env)
    scene.snap()
    for action in expert_actions(env, np.random.default_rng(seed)):
        env.step(action)
        scene.snap()
    scene.save(path, title=title)
    return scene
