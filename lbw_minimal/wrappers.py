"""Two Gymnasium wrappers that turn an environment of images into the paper's, for any agent.

`KeypointObservation`: RGB frame O_t -> keypoints z_t = Psi(O_t). `KeypointReward`: the environment's own
reward is dropped for r_t of Eq. 8. What the agent sees and earns is a function of frames alone.
"""

from __future__ import annotations

import gymnasium as gym
import numpy as np


class KeypointObservation(gym.ObservationWrapper):
    """Observation z_t as a vector (2K,) float32 in [-1, 1]: x_1, y_1, x_2, ...

    detect: frames (B, 84, 84, 3) uint8 -> keypoints (B, K, 2), x right, y down.
    """

    def __init__(self, env: gym.Env, detect):
        super().__init__(env)
        self.detect = detect
        K = detect(np.zeros((1, *env.observation_space.shape), np.uint8)).shape[1]
        self.observation_space = gym.spaces.Box(-1, 1, (2 * K,), np.float32)

    def observation(self, frame):
        z = np.asarray(self.detect(frame[None]), np.float32).reshape(-1)  # (2K,)
        return np.clip(z, -1, 1)


class KeypointRewardWrapper(gym.Wrapper):
    """r_t of `reward` over a `KeypointObservation`; its parts go to `info["reward_parts"]`.

    If the reward depends on time, the observation ends with the clock t / N in [0, 1]: without it the
    same z_t would earn different rewards and the problem would not be Markov.
    """

    def __init__(self, env: gym.Env, reward):
        super().__init__(env)
        self.keypoint_reward = reward
        low, high = env.observation_space.low, env.observation_space.high
        if reward.timed:
            low, high = np.append(low, 0), np.append(high, 1)
        self.observation_space = gym.spaces.Box(low, high, dtype=np.float32)

    def reset(self, **kwargs):
        self._z, info = self.env.reset(**kwargs)
        self._t = 0
        return self._observation(), info

    def step(self, action):
        z, _, terminated, truncated, info = self.env.step(action)
        pair = self._z.reshape(-1, 2), z.reshape(-1, 2)  # z_t and z_{t+1}, (K, 2) each
        reward, parts = self.keypoint_reward(*pair, self._t)
        self._z, self._t = z, self._t + 1
        return self._observation(), reward, terminated, truncated, info | {"reward_parts": parts}

    def _observation(self):
        if not self.keypoint_reward.timed:
            return self._z
        return np.append(self._z, np.float32(self.keypoint_reward.clock(self._t)))
