"""How fast is it? Steps, iterations and updates a second, compared with libraries people know.

Every figure is for one core, and a median of rounds in which the contestants take turns: a machine
that slows down slows all of them. Absolute figures depend on the machine, so read the ratios.
panda-gym, Gymnasium-Robotics and stable-baselines3 take part where they are installed.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
import time
from collections.abc import Callable
from typing import Any, cast

import gymnasium as gym
import numpy as np
import torch
from gymnasium.utils.performance import benchmark_step

from lbw_minimal import cyclegan, munit, sac, transporter
from lbw_minimal.replay import ReplayBuffer
from tasks import TASKS, id_of
from tasks.commands import Parser, at_least

ROUNDS = 5
OBS_DIM, ACTION_DIM, BATCH = 41, 3, 128  # those of a policy on five keypoints
Contestant = Callable[[float], float]  # seconds to measure for -> times a second


def parser() -> Parser:
    """The arguments of `bench`."""
    p = Parser("bench", "Steps, iterations and updates a second, for one core of this machine.")
    p.add_argument("--seconds", type=at_least(1), default=5, help="for each figure")
    return p


def main(argv: list[str]) -> None:
    """Measure and print. Raises InputError for a mistake in the arguments."""
    seconds = parser().read(argv).seconds
    torch.set_num_threads(1)
    for filmed, what in ((True, "a step with an 84x84 frame"), (False, "a step without a frame")):
        ours = {f"{task} (ours)": env_steps(our_env(task, filmed)) for task in ("push", *TASKS)}
        contest(what, ours | peers(filmed), seconds)
    frames = np.random.default_rng(0).integers(0, 256, (64, 84, 84, 3), np.uint8)
    translations: dict[str, Callable[..., Any]] = {
        "MUNIT (ours)": munit.train,
        "CycleGAN (ours)": cyclegan.train,
    }
    ours = {name: iterations(train, frames, frames) for name, train in translations.items()}
    contest("an iteration of a translation", ours, seconds)
    contest(
        "an iteration of Transporter", {"ours": iterations(transporter.train, [frames])}, seconds
    )
    for width in (128, 256):
        ours = {"ours": our_updates(width)}
        contest(
            f"an update of SAC, width {width}, batch {BATCH}", ours | sb3_updates(width), seconds
        )


def contest(what: str, contestants: dict[str, Contestant], seconds: float) -> None:
    """Print how often a second each contestant does it, and the first one's rate over a peer's."""
    print(f"\n{what}, times a second ({seconds:g} s for each)", flush=True)
    rates: dict[str, list[float]] = {name: [] for name in contestants}
    for _ in range(ROUNDS):
        for name, measure in contestants.items():
            rates[name].append(measure(seconds / ROUNDS))
    first, *_ = rates
    for name, values in rates.items():
        ratio = np.median(np.divide(rates[first], values))
        beside = "" if "ours" in name else f"{first}: {ratio:.1f} times as fast"
        print(f"  {name:34s} {np.median(values):9.1f}  {beside}".rstrip(), flush=True)


def installed(module: str, package: str) -> bool:
    """Whether a peer is there; says so if not."""
    there = importlib.util.find_spec(module) is not None
    if not there:
        print(f"{package} is not installed: no comparison (pip install {package})")
    return there


def env_steps(env: gym.Env) -> Contestant:
    """Steps a second under random actions, resets included."""
    return lambda seconds: benchmark_step(env, cast(int, seconds), seed=0)


def our_env(task: str, frames: bool) -> gym.Env:
    """A task with frames or the simulator's state as observations."""
    return gym.make(id_of(task), observation="rgb" if frames else "state")


class Filmed(gym.Wrapper):
    """A peer that renders a frame at every step, as a learner from pixels needs it."""

    def step(self, action: np.ndarray) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """A step, and its frame."""
        out = self.env.step(action)
        self.env.render()
        return out


def peers(frames: bool) -> dict[str, Contestant]:
    """The push tasks of panda-gym and Gymnasium-Robotics."""
    found = {}
    if installed("panda_gym", "panda-gym"):
        import panda_gym  # noqa: F401 (registers its environments)

        found["panda-gym push"] = gym.make(
            "PandaPush-v3", render_mode="rgb_array", render_width=84, render_height=84
        )
    if installed("gymnasium_robotics", "gymnasium-robotics"):
        os.environ.setdefault("MUJOCO_GL", "osmesa")  # a renderer that needs no screen
        import gymnasium_robotics

        gym.register_envs(gymnasium_robotics)
        found["Gymnasium-Robotics FetchPush"] = gym.make(
            "FetchPush-v4", render_mode="rgb_array", width=84, height=84
        )
    return {name: env_steps(Filmed(env) if frames else env) for name, env in found.items()}


def iterations(train: Callable[..., Any], *videos: Any, few: int = 3) -> Contestant:
    """Iterations a second of a training; what two runs have in common, their start, cancels out."""

    def measure(seconds: float) -> float:
        times = []
        for n in (few, 3 * few):
            start = time.perf_counter()
            with contextlib.redirect_stderr(io.StringIO()):  # its progress bar
                train(*videos, iterations=n, seed=0)
            times.append(time.perf_counter() - start)
        return 2 * few / (times[1] - times[0])

    return measure


def calls(do: Callable[[], Any]) -> Contestant:
    """Calls a second; the first one warms up."""

    def measure(seconds: float) -> float:
        do()
        start, n = time.perf_counter(), 0
        while time.perf_counter() - start < seconds:
            do()
            n += 1
        return n / (time.perf_counter() - start)

    return measure


def our_updates(width: int) -> Contestant:
    """Updates a second of the kit's SAC, batch drawn from a buffer of 1,000."""
    rng = np.random.default_rng(0)
    agent = sac.SAC(OBS_DIM, ACTION_DIM, width=width)
    buffer = ReplayBuffer(OBS_DIM, ACTION_DIM, 10_000)
    for _ in range(1000):
        obs, next_obs = rng.normal(size=(2, OBS_DIM))
        action = rng.uniform(-1, 1, ACTION_DIM)
        buffer.add(obs=obs, action=action, reward=0.0, next_obs=next_obs,
                   terminal=False)  # fmt: skip
    return calls(lambda: agent.update(buffer.sample(rng, BATCH)))


class Noise(gym.Env):
    """Observations that mean nothing: updates cost just as much on them."""

    observation_space = gym.spaces.Box(-np.inf, np.inf, (OBS_DIM,), np.float32)
    action_space = gym.spaces.Box(-1, 1, (ACTION_DIM,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Zeros."""
        super().reset(seed=seed)
        return np.zeros(OBS_DIM, np.float32), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Noise, for nothing, for ever."""
        return self.np_random.standard_normal(OBS_DIM, np.float32), 0.0, False, False, {}


def sb3_updates(width: int) -> dict[str, Contestant]:
    """Updates a second of stable-baselines3's SAC on the same sizes."""
    if not installed("stable_baselines3", "stable-baselines3"):
        return {}
    from stable_baselines3 import SAC
    from stable_baselines3.common.logger import configure

    arguments = {"batch_size": BATCH, "policy_kwargs": {"net_arch": [width, width]}}
    model = SAC(
        "MlpPolicy", Noise(), learning_starts=1000, train_freq=1000, device="cpu", **arguments
    )
    model.learn(1000)
    model.set_logger(configure(None, []))
    return {"stable-baselines3 SAC": calls(lambda: model.train(gradient_steps=1, batch_size=BATCH))}
