"""A film in the place of a world, for wrappers that may see frames and nothing else."""

import gymnasium as gym
import numpy as np


class Film(gym.Env):
    """Plays given frames, whatever one does. The world behind them is closed: reading it raises.

    reward: what every step pays. ends: the step with which the task itself ends.
    """

    observation_space = gym.spaces.Box(0, 255, (84, 84, 3), np.uint8)
    action_space = gym.spaces.Box(-1, 1, (3,), np.float32)

    class Info(dict):
        def _closed(self, *_):
            raise AssertionError("the simulator's state was read")

        __getitem__ = get = items = values = _closed

    def __init__(self, frames, reward=0.0, ends=10**6):
        self.frames, self.own_reward, self.ends, self.t = frames, reward, ends, 0

    def __getattr__(self, name):
        if name in ("puck", "position", "parts", "state", "is_success", "unwrapped_state"):
            raise AssertionError(f"the simulator's state was read: {name}")
        raise AttributeError(name)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.t = 0
        return self.frames[0], self.Info(object=[1.0, 2.0])

    def step(self, action):
        self.t += 1
        frame = self.frames[min(self.t, len(self.frames) - 1)]
        return frame, self.own_reward, self.t >= self.ends, False, self.Info(is_success=True)


def play(env, steps=20):
    """Observations (steps + 1, S) and rewards (steps,) of an episode; actions do not matter."""
    observations, rewards = [env.reset(seed=0)[0]], []
    for _ in range(steps):
        observation, r, *_ = env.step(np.zeros(3, np.float32))
        observations.append(observation)
        rewards.append(r)
    return np.array(observations), np.array(rewards)
