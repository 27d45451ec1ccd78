"""How fast is it? Steps, iterations and updates a second, beside the libraries people know.

Every figure is for one core. Absolute figures depend on the machine and on what else it does: read
the ratios, which come from the same run. panda-gym and stable-baselines3 are measured where
installed.
"""

from __future__ import annotations

import importlib.util
import time

import gymnasium as gym
import numpy as np
import torch
from gymnasium.utils.performance import benchmark_step

from lbw_minimal import munit, sac, transporter
from tasks import TASKS, id_of
from tasks.commands import Parser

SECONDS = 5  # per figure


def rate(train, iterations):
    """Iterations a second of a training, the start excluded by taking the difference of two
    runs."""
    times = []
    for n in (iterations, 3 * iterations):
        start = time.perf_counter()
        train(n)
        times.append(time.perf_counter() - start)
    return 2 * iterations / (times[1] - times[0])


def show(name, value, unit, beside=""):
    print(f"{name:34s} {value:9.1f} {unit:14s} {beside}", flush=True)


def installed(name):
    return importlib.util.find_spec(name) is not None


class PandaGymPush(gym.Wrapper):
    """panda-gym's push with a rendered 84x84 frame each step, as a learner from pixels needs it."""

    def __init__(self):
        import panda_gym  # noqa: F401 (registers its environments)

        super().__init__(
            gym.make("PandaPush-v3", render_mode="rgb_array", render_width=84, render_height=84)
        )

    def step(self, action):
        out = self.env.step(action)
        self.env.render()
        return out


def parser() -> Parser:
    """The arguments of `bench`: none."""
    return Parser("bench", "Steps, iterations and updates a second, for one core of this machine.")


def main(argv: list[str]) -> None:
    """Measure and print."""
    parser().read(argv)
    torch.set_num_threads(1)
    speed = {}
    for task in TASKS:
        for mode in ("state", "rgb"):
            env = gym.make(id_of(task), observation=mode)
            speed[task, mode] = benchmark_step(env, SECONDS, seed=0)
            show(f"{task}, {mode} observations", speed[task, mode], "steps/s")
            env.close()
    if installed("panda_gym"):
        env = PandaGymPush()
        value = benchmark_step(env, SECONDS, seed=0)
        ratio = f"ours: {speed['push', 'rgb'] / value:.1f} times"
        show("panda-gym push, 84x84 frames", value, "steps/s", ratio)
        env.close()
    else:
        print("panda-gym is not installed: no comparison (pip install panda-gym)")

    rng = np.random.default_rng(0)
    frames = rng.integers(0, 256, (64, 84, 84, 3), np.uint8)
    show(
        "MUNIT",
        rate(lambda n: munit.train(frames, frames, iterations=n, seed=0), 10),
        "iterations/s",
    )
    show(
        "Transporter",
        rate(lambda n: transporter.train([frames], iterations=n, seed=0), 10),
        "iterations/s",
    )

    obs_dim, action_dim, batch, width = 11, 3, 128, 256
    agent = sac.SAC(obs_dim, action_dim, width=width)
    buffer = sac.ReplayBuffer(obs_dim, action_dim, 10_000)
    for _ in range(1000):
        buffer.add(obs=rng.normal(size=obs_dim), action=rng.uniform(-1, 1, action_dim), reward=0.0,
                   next_obs=rng.normal(size=obs_dim), terminal=0.0)  # fmt: skip
    ours = updates(lambda: agent.update(buffer.sample(rng, batch)))
    show(f"SAC, width {width}, batch {batch}", ours, "updates/s")
    if installed("stable_baselines3"):
        theirs = sb3_updates(obs_dim, action_dim, batch, width)
        show(
            "stable-baselines3 SAC, same sizes",
            theirs,
            "updates/s",
            f"ours: {ours / theirs:.1f} times",
        )
    else:
        print("stable-baselines3 is not installed: no comparison (pip install stable-baselines3)")


def updates(update):
    """Calls a second."""
    for _ in range(20):
        update()
    start, n = time.perf_counter(), 0
    while time.perf_counter() - start < SECONDS:
        update()
        n += 1
    return n / (time.perf_counter() - start)


def sb3_updates(obs_dim, action_dim, batch, width):
    """Updates a second of stable-baselines3's SAC on the same shapes."""
    from stable_baselines3 import SAC
    from stable_baselines3.common.logger import configure

    class Noise(gym.Env):
        observation_space = gym.spaces.Box(-np.inf, np.inf, (obs_dim,), np.float32)
        action_space = gym.spaces.Box(-1, 1, (action_dim,), np.float32)

        def reset(self, *, seed=None, options=None):
            return np.zeros(obs_dim, np.float32), {}

        def step(self, action):
            return np.random.standard_normal(obs_dim).astype(np.float32), 0.0, False, False, {}  # noqa: NPY002

    model = SAC("MlpPolicy", Noise(), batch_size=batch, policy_kwargs={"net_arch": [width, width]},
                learning_starts=1000, train_freq=1000, device="cpu")  # fmt: skip
    model.learn(1000)
    model.set_logger(configure(None, []))
    return updates(lambda: model.train(gradient_steps=1, batch_size=batch))
