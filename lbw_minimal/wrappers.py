"""Two Gymnasium wrappers that turn an environment of images into the paper's, for any agent.

`KeypointObservation`: RGB frame O_t -> keypoints z_t = Psi(O_t). `KeypointRewardWrapper`: the
environment's own reward is dropped for r_t of Eq. 8. What an agent sees and earns is a function of
the frames, the demonstration and the number of steps taken, of nothing else.
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
    """r_t of a `KeypointReward` over a `KeypointObservation`; its parts go to
    `info["reward_parts"]`.

    The observation is z_t (2K,), as in the paper. If the reward is timed, the same z_t earns
    different rewards at different times, so the agent has to know the time. It is told in the
    demonstration's own coordinates: (z_t, z_t - z_{t-1}, z_{t-1} - z_{t-2}, z^E_{t+1} - z_t,
    clock), (8K + 1,): where everything is, how it moved in the last step and in the one before, the
    way to where the demonstration will be, and how much of that has passed, 0 to 1. The clock alone
    would do in theory, but then the agent has to learn the demonstration by heart: on push, seed 0,
    with one update a step and no look back, it had not solved the task after 4,000 steps, with the
    way it first did after 2,500. How things move decides a hit: on slide, one perception, without
    it 0 of 10 pucks stopped at the target, with it 10. The step before tells where the tip is drawn
    to: its goal leads it, and no frame shows a goal. Without it another perception's pucks ended 5
    cm too far, 3 of 10 at the target; with it 10.
    """

    def __init__(self, env: gym.Env, reward):
        super().__init__(env)
        self.keypoint_reward = reward
        low, high = env.observation_space.low, env.observation_space.high
        if reward.timed:
            reach = high - low
            low, high = (
                np.concatenate([low, *3 * [-reach], [0]]),
                np.concatenate([high, *3 * [reach], [1]]),
            )
        self.observation_space = gym.spaces.Box(np.float32(low), np.float32(high))

    def reset(self, **kwargs):
        z, info = self.env.reset(**kwargs)
        self._recent, self._t = [z, z, z], 0  # z_{t-2}, z_{t-1}, z_t
        return self._observe(), info

    def step(self, action):
        z, _, terminated, truncated, info = self.env.step(action)
        pair = self._recent[-1].reshape(-1, 2), z.reshape(-1, 2)  # z_t and z_{t+1}, (K, 2) each
        reward, parts = self.keypoint_reward(*pair, self._t)
        self._recent, self._t = [*self._recent[1:], z], self._t + 1
        return self._observe(), reward, terminated, truncated, info | {"reward_parts": parts}

    def _observe(self):
        reward, (z_2, z_1, z) = self.keypoint_reward, self._recent
        if not reward.timed:
            return z
        ahead = reward.target(self._t).reshape(-1) - z
        return np.concatenate([z, z - z_1, z_1 - z_2, ahead, [reward.clock(self._t)]]).astype(
            np.float32
        )
