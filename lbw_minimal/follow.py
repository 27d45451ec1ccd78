"""After the paper, the whole method: one human video in, a policy out, and nothing translated.

    track the object -> reward its displacement and the approach to it -> soft actor-critic

In: one demonstration, an environment of RGB frames, and a film of the robot moving at random. Out:
a policy. d_t (2,) is the object's displacement from where it began, g_t (2,) the way from a place
behind the object, where a hand stands that is to push it, to the arm, both in pixels. L is the
demonstration's longest displacement, s = L / (the robot's way to where the demonstration left the
object). With |x|_L = min(|x|, 2 L) / L,

    r_t = lambda_1 r1 + lambda_2 r2 + lambda_3 r3
    r1  = -|s d_{t+1} - d^E_{t+1}|_L                          the object is where it should be,
    r2  = -|s (d_{t+1} - d_t) - (d^E_{t+1} - d^E_t)|_L        it moves as it should,
    r3  = -(1 - |d^E_{t+1}| / L) |g_{t+1}|_L                  and the arm is at it while it must go.

r1 and r2 are Eq. 9 and 10 with the clock of `MendedReward`, for the object alone. r3 is new: an arm
that touches nothing moves nothing, and r1 does not tell it where to go. The place is not at the
object itself: to that a hand on top would be about as near as one behind it, and stay.
Nothing here says how the arm is to get there.
"""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.wrappers import TimeLimit
from numpy.typing import ArrayLike

from lbw_minimal import tracks
from lbw_minimal.imitate import Recipe, Run, learn_policy
from lbw_minimal.reward import MOST_OF_HORIZON, Parts, resample
from lbw_minimal.sac_networks import Policy
from lbw_minimal.training import InputError

LAMBDA = (1.0, 3.0, 1.0)  # (lambda_1, lambda_2, lambda_3); the first two as in `reward.py`
HALF = 42.0  # pixels, half a picture: the unit in which the policy sees, as keypoints are
LEAST_WAY = 0.2  # of the demonstration's: an object that starts near its goal stretches no further


class TrackReward:
    """r_t for a demonstration's displacement d^E (N, 2) in pixels, N >= 3.

    The demonstration keeps its own time: what slides or falls has one. horizon: the most steps an
    episode may have; a demonstration of more than 80 % of that is hurried. lam: (lambda_1,
    lambda_2, lambda_3). The reward lies in [-2 sum(lam), 0]. Raises InputError for a path of
    another shape or one on which nothing moves.
    """

    def __init__(
        self,
        path: ArrayLike,
        *,
        horizon: int | None = None,
        lam: tuple[float, float, float] = LAMBDA,
    ):
        d = np.asarray(path, np.float64)
        if d.ndim != 2 or d.shape[1] != 2 or len(d) < 3:
            raise InputError(f"path of shape {d.shape}: give (N, 2) with N of 3 or more.")
        longest = int(MOST_OF_HORIZON * horizon) if horizon else len(d)
        self.d_E = d = resample(d[:, None], np.inf, longest)[:, 0]  # (n, 2)
        self.L = float(np.linalg.norm(d, axis=1).max())
        if self.L < tracks.GONE:
            raise InputError(f"the object moves by {self.L:.1f} pixels; it takes {tracks.GONE}.")
        self.lam, self.last = lam, len(d) - 1
        self.episode = round(len(d) / MOST_OF_HORIZON)

    def __call__(
        self, d: np.ndarray, d_next: np.ndarray, g_next: np.ndarray, t: int
    ) -> tuple[float, Parts]:
        """r_t and its parts for s d_t, s d_{t+1} and g_{t+1}, (2,) each, at step t = 0, 1, ..."""
        goal = self.target(t)
        v = goal - self.d_E[min(t, self.last)]  # 0 once the demonstration is over: stay there
        left = 1 - float(np.linalg.norm(goal)) / self.L
        r1 = -self._length(d_next - goal)
        r2 = -self._length(d_next - d - v)
        r3 = -left * self._length(g_next)
        r = self.lam[0] * r1 + self.lam[1] * r2 + self.lam[2] * r3
        return r, {"r1": r1, "r2": r2, "r3": r3}

    def _length(self, x):
        """|x|_L of x (2,): an object that is lost, or thrown far away, costs a bounded share."""
        return min(float(np.linalg.norm(x)), 2 * self.L) / self.L

    def stretch(self, ahead: np.ndarray) -> float:
        """s for an object that starts `ahead` (2,) of where it started in the demonstration."""
        way = self.d_E[-1] / np.linalg.norm(self.d_E[-1])
        return self.L / max(self.L - float(ahead @ way), LEAST_WAY * self.L)

    def target(self, t: int) -> np.ndarray:
        """d^E (2,) that the demonstration reaches with step t; from its end on, its last one."""
        return self.d_E[min(t + 1, self.last)]

    def clock(self, t: int) -> float:
        """How far along the demonstration is at step t, 0 to 1."""
        return min(t, self.last) / self.last


class TrackWrapper(gym.Wrapper, RecordConstructorArgs):
    """An environment of frames as object tracks tell it: observation and reward, for any agent.

    Observation (15,): (x_t, x_t - x_{t-1}, x_{t-1} - x_{t-2}, d^E_{t+1} - s d_t) in half pictures,
    and the clock, where x_t = (s d_t, g_t). It is `KeypointRewardWrapper`'s, with one object and
    one arm for keypoints. No place in the picture is in it: the policy knows where the object is
    from its start, and where the arm is from the object. Parts of r_t: `info["reward_parts"]`.
    """

    def __init__(self, env: gym.Env, tracker: tracks.Tracker, reward: TrackReward):
        RecordConstructorArgs.__init__(self, _disable_deepcopy=True, tracker=tracker, reward=reward)
        super().__init__(env)
        self.tracker, self.track_reward = tracker, reward
        self.observation_space = gym.spaces.Box(-8, 8, (15,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict]:
        """As Gymnasium's; the object is found anew and the reward's clock starts again."""
        frame, info = self.env.reset(seed=seed, options=options)
        self.tracker.reset(frame)
        self._s = self.track_reward.stretch(self.tracker.ahead)
        self._recent, self._t = [self._x()] * 3, 0  # x_{t-2}, x_{t-1}, x_t
        return self._observe(), info

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        """As Gymnasium's, paying r_t. An episode is cut, truncated, where the task ends it."""
        frame, _, terminated, truncated, info = self.env.step(action)
        self.tracker.step(frame)
        d, (d_next, g_next) = self._recent[-1][0], (x := self._x())
        reward, parts = self.track_reward(d, d_next, g_next, self._t)
        self._recent, self._t = [*self._recent[1:], x], self._t + 1
        over = terminated or truncated  # never terminal: see `KeypointRewardWrapper`
        return self._observe(), reward, False, over, info | {"reward_parts": parts}

    def _x(self):
        return np.stack([self._s * self.tracker.d, self.tracker.g])  # (2, 2)

    def _observe(self):
        x_2, x_1, x = self._recent
        ahead = self.track_reward.target(self._t) - x[0]
        seen = np.concatenate([x, x - x_1, x_1 - x_2, ahead[None]]).reshape(-1) / HALF  # (14,)
        return np.append(seen.clip(-8, 8), self.track_reward.clock(self._t)).astype(np.float32)


def watched(env: gym.Env, demo: np.ndarray, robot: np.ndarray) -> tuple[gym.Env, TrackReward]:
    """`env` as object tracks tell it, and that reward.

    demo (N, 84, 84, 3) uint8: the human video. robot (M, 84, 84, 3) uint8: random robot motion. An
    episode ends some time after the demonstration does, even if the horizon is longer. Raises
    InputError if the demonstration moves no object.
    """
    shown = tracks.watch(demo)
    tracker = tracks.Tracker(shown, tracks.background(robot))
    horizon = env.spec.max_episode_steps if env.spec else None
    reward = TrackReward(shown.path, horizon=horizon)
    env = TrackWrapper(env, tracker, reward)
    return TimeLimit(env, reward.episode), reward


def follow(
    env: gym.Env, demo: np.ndarray, robot: np.ndarray, recipe: Recipe, *, seed: int, run: Run
) -> tuple[Policy, gym.Env]:
    """Learn a policy for `env` that moves the object as the demonstration does.

    The arguments are those of `watched`, and as in `imitate.imitate`. Returns the policy and `env`
    wrapped so that its observations are the policy's.
    """
    env, _ = watched(env, demo, robot)
    return learn_policy(env, recipe, seed, run), env
