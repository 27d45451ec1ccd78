"""Gymnasium wrappers that turn an environment of images into the paper's, for any agent.

`KeypointObservation`: RGB frame O_t -> keypoints z_t = Psi(O_t). `KeypointRewardWrapper`: the
environment's own reward is replaced by r_t of Eq. 8. What an agent sees and earns is a function of
the frames, the demonstration and the number of steps taken, and of nothing else.
`ClassifierRewardWrapper` does it for the rivals: frames are seen, and a goal classifier pays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from lbw_minimal.classifier import ClassifierReward
from lbw_minimal.reward import KeypointReward


class KeypointObservation(gym.ObservationWrapper, RecordConstructorArgs):
    """Observation z_t as a vector (2K,) float32 in [-1, 1]: x_1, y_1, x_2, ...

    detect: frames (B, 84, 84, 3) uint8 -> keypoints (B, K, 2), x right, y down.
    """

    def __init__(self, env: gym.Env, detect: Callable[[np.ndarray], np.ndarray]):
        RecordConstructorArgs.__init__(self, _disable_deepcopy=True, detect=detect)
        super().__init__(env)
        self.detect = detect
        shape = env.observation_space.shape or ()
        K = detect(np.zeros((1, *shape), np.uint8)).shape[1]
        self.observation_space = gym.spaces.Box(-1, 1, (2 * K,), np.float32)

    def observation(self, observation: np.ndarray) -> np.ndarray:
        """z_t (2K,) of a frame (84, 84, 3) uint8."""
        z = np.asarray(self.detect(observation[None]), np.float32).reshape(-1)  # (2K,)
        return np.clip(z, -1, 1)


class KeypointRewardWrapper(gym.Wrapper, RecordConstructorArgs):
    """Pays r_t of a keypoint reward over a `KeypointObservation`, parts in `info["reward_parts"]`.

    The observation is z_t (2K,), as in the paper. If the reward is timed, the same z_t earns
    different rewards at different times, so the agent has to know the time. It is told in the
    demonstration's own coordinates: (z_t, z_t - z_{t-1}, z_{t-1} - z_{t-2}, z^E_{t+1} - z_t,
    clock), (8K + 1,). These are where everything is, how it moved in the last step and in the one
    before, the way to where the demonstration will be, and how much of that has passed, 0 to 1.

    The clock alone would do in theory, but then the agent would have to learn the demonstration by
    heart. How things move decides a hit. The step before the last tells where the tip is being
    pulled: its goal runs ahead of it, unseen in the frames.
    """

    def __init__(self, env: gym.Env, reward: KeypointReward):
        RecordConstructorArgs.__init__(self, _disable_deepcopy=True, reward=reward)
        super().__init__(env)
        self.keypoint_reward = reward
        space = env.observation_space
        assert isinstance(space, gym.spaces.Box)
        low, high = space.low, space.high
        if reward.timed:
            reach = high - low
            low = np.concatenate([low, *3 * [-reach], [0]])
            high = np.concatenate([high, *3 * [reach], [1]])
        self.observation_space = gym.spaces.Box(np.float32(low), np.float32(high))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict]:
        """As Gymnasium's; the reward's clock starts again."""
        z, info = self.env.reset(seed=seed, options=options)
        self._recent, self._t = [z, z, z], 0  # z_{t-2}, z_{t-1}, z_t
        return self._observe(), info

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        """As Gymnasium's, paying r_t. An episode is cut, truncated, where the task ends it."""
        z, _, terminated, truncated, info = self.env.step(action)
        pair = self._recent[-1].reshape(-1, 2), z.reshape(-1, 2)  # z_t and z_{t+1}, (K, 2) each
        reward, parts = self.keypoint_reward(*pair, self._t)
        self._recent, self._t = [*self._recent[1:], z], self._t + 1
        # r_t is below zero: an end of value 0 would be worth reaching, and an agent would learn to
        # throw the object off the table. So the episode is cut there, and s' keeps its value.
        over = terminated or truncated
        return self._observe(), reward, False, over, info | {"reward_parts": parts}

    def _observe(self):
        reward, (z_2, z_1, z) = self.keypoint_reward, self._recent
        if not reward.timed:
            return z
        ahead = reward.target(self._t).reshape(-1) - z
        seen = [z, z - z_1, z_1 - z_2, ahead, [reward.clock(self._t)]]
        return np.concatenate(seen).astype(np.float32)


class ClassifierRewardWrapper(gym.Wrapper, RecordConstructorArgs):
    """Pays the classifier's reward for the frame a step led to; the agent sees the frames.

    The logit itself is in `info["reward_parts"]`. As in `KeypointRewardWrapper` an episode is
    cut and never terminated: far from the goal logits are below zero.
    """

    def __init__(self, env: gym.Env, reward: ClassifierReward):
        RecordConstructorArgs.__init__(self, _disable_deepcopy=True, reward=reward)
        super().__init__(env)
        self.classifier_reward = reward

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        """As Gymnasium's, paying for the new frame (84, 84, 3)."""
        frame, _, terminated, truncated, info = self.env.step(action)
        reward, parts = self.classifier_reward(frame)
        return frame, reward, False, terminated or truncated, info | {"reward_parts": parts}
