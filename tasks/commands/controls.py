"""Does a task need eyes? The trained policy beside robots that see little, nothing, or only once.

In: trained weights. Out: success over start jitter, the same starts for all. What a blind robot
does is chosen among many by the simulator's own verdict, on other starts than those of the test:
it is flattered, and a policy that is no better than it has not been shown to look.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import gymnasium as gym
import numpy as np
import torch
from gymnasium.wrappers import TimeLimit

import tasks
from lbw_minimal import follow, rivals, sac, video
from lbw_minimal.imitate import watched
from lbw_minimal.report import wilson
from lbw_minimal.training import InputError, counted, write_atomic
from tasks.commands import JITTER, Parser, at_least, make_folder, metres
from tasks.commands.job import check_task, settings_of
from tasks.commands.run import TEST_SEED, refuse_strangers
from tasks.commands.table import METHODS, markdown
from tasks.world import SIZE, TaskEnv

JITTERS = (JITTER, 0.01, 0.02, 0.04)  # m
TRIAL_SEED, TRIALS = 2_000_000, 10  # starts on which blind robots are chosen
LIBRARY = 50  # episodes of the policy, from which the robot that looks once takes one
BLIND = (  # what has no eyes at all
    "its camera grey",
    "blind replay of its best episode",
    "best constant action",
    "down, then along",
    "random actions",
    "idle",
)
Robot = Callable[[np.ndarray, int], np.ndarray]  # (observation, step of the episode) -> action


class Frozen(gym.Wrapper):
    """A task whose camera shows an episode's first frame for ever."""

    def reset(self, **options: Any) -> tuple[np.ndarray, dict]:
        """As Gymnasium's; the camera takes its one picture."""
        camera_of(self).pop("render", None)
        first, info = self.env.reset(**options)
        camera_of(self)["render"] = (
            first.copy
        )  # a picture that nobody sees is three quarters of a step
        return first, info


class Grey(gym.Wrapper):
    """A task whose camera shows nothing: grey frames (84, 84, 3) uint8."""

    def __init__(self, env: gym.Env):
        super().__init__(env)
        nothing = np.full((SIZE, SIZE, 3), 128, np.uint8)
        camera_of(self)["render"] = nothing.copy


def camera_of(env: gym.Env) -> dict[str, Any]:
    """What stands in for the methods of a task's world: its `render` takes the pictures."""
    return cast(TaskEnv, env.unwrapped).world.__dict__


def replay(actions: np.ndarray) -> Robot:
    """Play actions (T, 3) again with closed eyes, and then rest."""
    return lambda obs, t: actions[t] if t < len(actions) else np.zeros(3, np.float32)


def constant(action: tuple[float, ...]) -> Robot:
    """The same action (3,) at every step."""
    return lambda obs, t: np.array(action, np.float32)


def down_then_along(steps: int) -> Robot:
    """So many steps down, and then along x."""
    down, along = np.array([[0, 0, -1], [1, 0, 0]], np.float32)
    return lambda obs, t: down if t < steps else along


def noise(seed: int = 0) -> Robot:
    """Uniformly random actions."""
    rng = np.random.default_rng(seed)
    return lambda obs, t: rng.uniform(-1, 1, 3).astype(np.float32)


def look_once(starts: np.ndarray, takes: list[np.ndarray]) -> Robot:
    """Look at the first frame, replay the take whose start looked most alike, see no more.

    starts (n, S): first observations of n episodes; takes: their actions (T, 3).
    """
    chosen = 0

    def act(obs, t):
        nonlocal chosen
        if t == 0:
            chosen = int(np.linalg.norm(starts - obs, axis=1).argmin())
        return replay(takes[chosen])(obs, t)

    return act


def play(
    env: gym.Env, robot: Robot, seed: int, whole: bool = True
) -> tuple[bool, float, np.ndarray, np.ndarray]:
    """An episode: whether the task was done, the return, the first observation, the actions.

    whole: go on to its end even if the task is done before.
    """
    first, _ = env.reset(seed=seed)
    actions: list[np.ndarray] = []
    obs, total, done, ended = first, 0.0, False, False
    while not ended:
        actions.append(robot(obs, len(actions)))
        obs, reward, terminated, truncated, info = env.step(actions[-1])
        total, done = total + float(reward), done or info["is_success"]
        ended = terminated or truncated or (done and not whole)
    return done, total, first, np.stack(actions)


def wins(env: gym.Env, robot: Robot, episodes: int, seed: int = TEST_SEED) -> int:
    """Successful episodes, from the starts that follow `seed`."""
    seeds = counted(range(seed, seed + episodes), episodes, "episodes")
    return sum(play(env, robot, i, whole=False)[0] for i in seeds)


def best(env: gym.Env, robots: list[Robot], trials: int) -> Robot:
    """The robot that succeeds most often on the trial starts."""
    return max(robots, key=lambda robot: wins(env, robot, trials, TRIAL_SEED))


def rival_wins(task: str, run: Path, jitter: float, episodes: int) -> int:
    """Successful episodes of another method's policy; run: the folder of its run."""
    env: gym.Env = gym.make(tasks.id_of(task), jitter=jitter)
    if settings_of(run)["method"] == "tracks":
        demo, _ = video.read(tasks.VIDEOS / task / "expert_01.mp4")
        env, _ = follow.watched(env, demo, tasks.pace_film(task, settings_of(run)["seed"]))
        policy = sac.load(run / "policy.safetensors")
    else:
        policy, env = rivals.replayed(env, run, task)
    count = wins(env, lambda obs, t: policy.act(obs, deterministic=True), episodes)
    env.close()
    return count


def compare(
    task: str,
    weights: Path,
    jitter: float,
    episodes: int,
    seed: int,
    beside: Mapping[str, Path],
    library: int = LIBRARY,
    trials: int = TRIALS,
) -> dict[str, int]:
    """Successes of the policy in `weights` and of every control, with starts moved by `jitter` (m).

    seed: that of the training, whose film of the robot set the demonstration's pace. beside: names
    and folders of rivals' runs. library: episodes of the policy that are kept for replays; trials:
    episodes that choose a blind robot. Raises InputError if weights are missing, damaged, or
    another task's.
    """
    perception = tasks.trained_perception(task, weights)
    policy = sac.load(weights / "policy.safetensors")
    film = tasks.pace_film(task, seed)

    def seen_through(camera=None):
        env: gym.Env = gym.make(tasks.id_of(task), jitter=jitter)
        return watched(camera(env) if camera else env, perception, film)

    def trained(obs, t):
        return policy.act(obs, deterministic=True)

    env, reward = seen_through()
    refuse_strangers(weights, policy, env)
    found = {"the policy": wins(env, trained, episodes)}
    found |= {name: rival_wins(task, run, jitter, episodes) for name, run in beside.items()}
    frozen, grey = (seen_through(camera)[0] for camera in (Frozen, Grey))
    found["its camera frozen"] = wins(frozen, trained, episodes)
    found["its camera grey"] = wins(grey, trained, episodes)
    seeds = counted(range(TRIAL_SEED, TRIAL_SEED + library), library, "the policy's episodes")
    own = [play(env, trained, seed) for seed in seeds]
    done = [episode for episode in own if episode[0]] or own
    looks = look_once(np.stack([first for _, _, first, _ in done]), [a for *_, a in done])
    found["looks once, then replays"] = wins(frozen, looks, episodes)
    for seen in (env, frozen, grey):
        seen.close()

    blind: gym.Env = gym.make(tasks.id_of(task), jitter=jitter, observation="state")
    blind = TimeLimit(blind, reward.episode)  # whose true state no blind robot reads
    _, _, _, actions = max(done, key=lambda episode: episode[1])
    directions = [d for d in itertools.product((-1, 0, 1), repeat=3) if d[1] == 0 and any(d)]
    found |= {
        "blind replay of its best episode": wins(blind, replay(actions), episodes),
        "best constant action": wins(
            blind, best(blind, [*map(constant, directions)], trials), episodes
        ),
        "down, then along": wins(
            blind, best(blind, [down_then_along(n) for n in range(3, 25, 3)], trials), episodes
        ),
        "random actions": wins(blind, noise(), episodes),
        "idle": wins(blind, constant((0, 0, 0)), episodes),
    }
    blind.close()
    return found


def parser() -> Parser:
    """The arguments of `controls`."""
    p = Parser("controls", "Test a trained policy beside robots that see little or nothing.")
    p.add_task()
    p.add_weights()
    p.add_argument("--episodes", type=at_least(1), default=100, help="test episodes for each")
    p.add_argument("--jitter", type=metres, metavar="M", help="test at this start jitter alone (m)")
    p.add_argument("--seed", type=at_least(0), default=0, help="that the weights were trained with")
    p.add_argument(
        "--beside", type=Path, action="append", default=[], metavar="DIR", help="a run beside it"
    )
    p.add_argument(
        "--out", type=Path, default=Path("runs/controls"), metavar="DIR", help="its folder"
    )
    return p


def main(argv: list[str]) -> None:
    """Print the table and write it. Raises InputError for a mistake in the arguments."""
    args = parser().read(argv)
    weights = args.weights or tasks.WEIGHTS / args.task
    make_folder(args.out)
    beside: dict[str, Path] = {}
    for run in args.beside:
        check_task(run, args.task)
        if (name := method_of(run)) in beside:
            raise InputError(f"--beside {run}: {beside[name]} is of {name}, too; give one of each.")
        beside[name] = run
    jitters = JITTERS if args.jitter is None else (args.jitter,)
    note = measure(args.task, weights, args.episodes, args.seed, beside, jitters)
    write_atomic(args.out / f"{args.task}.json", json.dumps(note, indent=1) + "\n")
    print(table(note), end="")


def method_of(run: Path) -> str:
    """The name of the method whose run is in that folder. Raises InputError for LbW's own."""
    method = settings_of(run)["method"]
    names = {rival: name for rival, (name, _) in METHODS.items()}
    if method not in names:
        raise InputError(f"--beside {run}: no run of a rival is there.")
    return names[method]


def measure(
    task: str,
    weights: Path,
    episodes: int,
    seed: int,
    beside: Mapping[str, Path],
    jitters: Sequence[float] = JITTERS,
    brief: bool = False,
) -> dict[str, Any]:
    """`compare` at every jitter (m), with what was asked beside it.

    brief: with hardly any trials, for a smoke run.
    """
    torch.set_num_threads(1)  # for single frames a second thread costs more than it brings
    few = {"library": 2, "trials": 1} if brief else {}
    found = {
        str(jitter): compare(task, weights, jitter, episodes, seed, beside, **few)
        for jitter in jitters
    }
    return {"task": task, "episodes": episodes, "seed": seed, "success": found}


def eyes_pay(notes: list[dict[str, Any]]) -> str:
    """A row a task, a column a jitter, as Markdown: the policy beside the best robot without eyes.

    notes: what `measure` returned, all over the same jitters. Eyes pay where the policy's 95 %
    interval lies above that robot's.
    """

    def cell(note, jitter):
        found, n = note["success"][jitter], note["episodes"]
        robot = max(BLIND, key=lambda name: found[name])
        policy, blind = found["the policy"], found[robot]
        if wilson(policy, n)[0] > wilson(blind, n)[1]:
            return f"eyes pay: {policy} to {blind}"
        return f"no: {policy} to {blind}, {robot}"

    jitters = list(notes[0]["success"])
    head = [f"of {notes[0]['episodes']}", *(f"{1000 * float(j):g} mm" for j in jitters)]
    return markdown(head, [[note["task"], *(cell(note, j) for j in jitters)] for note in notes])


def table(note: dict[str, Any]) -> str:
    """What `main` wrote, as Markdown: a row a robot, a column a jitter, with 95 % intervals."""
    success, n = note["success"], note["episodes"]
    head = [note["task"], *(f"{1000 * float(jitter):g} mm" for jitter in success)]
    robots = next(iter(success.values()))
    rows = [[robot, *(share(row[robot], n) for row in success.values())] for robot in robots]
    return markdown(head, rows)


def side_by_side(notes: list[dict[str, Any]], jitter: float) -> str:
    """What `measure` returned of several tasks, at one of its jitters (m): a column a task."""
    found = [note["success"][str(jitter)] for note in notes]
    rows = [
        [robot, *(share(f[robot], n["episodes"]) for f, n in zip(found, notes, strict=True))]
        for robot in found[0]
    ]
    return markdown([f"{1000 * jitter:g} mm", *(note["task"] for note in notes)], rows)


def share(wins: int, episodes: int) -> str:
    """Successes of so many, with the 95 % interval."""
    low, high = wilson(wins, episodes)
    return f"{wins}/{episodes} ({100 * low:.0f}-{100 * high:.0f} %)"
