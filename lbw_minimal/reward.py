"""The keypoint reward, Eq. 8-10: how well does the robot follow the translated demonstration?

In: the demonstration's keypoint trajectory z^E (N, K, 2); for the mended form also the keypoints of
the robot's random video (M, K, 2). Out: r_t of a transition z_t -> z_{t+1}, with its parts r1 and
r2. `LiteralReward` is the paper's. It pays an idle arm as much as the demonstration whenever that
starts at rest or pauses: r1 = 0 and r2 = 0, for ever. `MendedReward` is what learns. None of its
mends is in the paper, and each can be switched off alone.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from lbw_minimal.training import InputError

# (lambda_r1, lambda_r2); the paper names neither. With (1, 1) slide's pucks scatter almost twice
# as far: see lbw_minimal/README.md, "What differs".
LAMBDA = (1.0, 3.0)
LEAST_STEP = 0.1  # of the robot's median step: what moves less between two frames is at rest
# Frames of a rest that stay, 0.2 s. Movements start and end slowly. Without these frames the robot
# is always late, and it hits a sliding puck too hard in order to catch up.
REST = 5
MOST_OF_HORIZON = 0.8  # the demonstration's share of an episode; the rest is for reaching the goal
MENDS = ("trim", "speed", "include_goal", "timed")  # the switches of `MendedReward`

Parts = dict[str, float]  # {"r1": ..., "r2": ...}


class LiteralReward:
    """Eq. 8-10 as the paper states them, for a trajectory z^E (N, K, 2) in [-1, 1] with N >= 3.

    lam: (lambda_r1, lambda_r2). Raises InputError for a trajectory of another shape.
    """

    timed: Literal[False] = False  # a transition earns the same at any step of the episode

    def __init__(self, trajectory: ArrayLike, lam: tuple[float, float] = LAMBDA):
        self.z_E, self.lam = _checked(trajectory), lam
        self.v_E = self.z_E[1:] - self.z_E[:-1]  # (N - 1, K, 2)
        self.episode = _episode(self.z_E)

    def __call__(self, z: np.ndarray, z_next: np.ndarray, t: int = 0) -> tuple[float, Parts]:
        """r_t and its parts for z_t and z_{t+1}, (K, 2) each; the step t makes no difference."""
        r1 = -np.linalg.norm(z - self.z_E[:-1], axis=(1, 2)).min()  # Eq. 9, p = 1 .. N - 1
        r2 = -np.linalg.norm(z_next - z - self.v_E, axis=(1, 2)).min()  # Eq. 10
        r = self.lam[0] * r1 + self.lam[1] * r2  # Eq. 8
        return float(r), {"r1": float(r1), "r2": float(r2)}


class MendedReward:
    """Eq. 8-10 with four mends, and then a function of the step t as well.

    trajectory: z^E (N, K, 2) in [-1, 1], N >= 3. robot: keypoints (M, K, 2), M >= 3, of the robot's
    random video, which show its pace. horizon: the most steps an episode may have. lam:
    (lambda_r1, lambda_r2).

    The mends: `trim` cuts pauses, which make idling look like the skill. `speed` slows the
    demonstration down to the robot's pace, and hurries it if it would take more than 80 % of the
    horizon. `include_goal` lets p reach N. `timed` compares with frame t + 1 and step t instead of
    the nearest ones, so that falling behind costs. Four changes have no switch. r1 judges z_{t+1},
    which a_t can still change, where Eq. 9 judges z_t. The distance is the mean over keypoints,
    each capped at twice the mean path, so that a lost keypoint costs a bounded share. It is divided
    by the mean path: r1 = -1 is an arm that never moved, seen at the end, if the demonstration ends
    farthest from its start. A median over three frames takes single glitches out of the
    demonstration. The reward lies in [-2 sum(lam), 0].

    Raises InputError if shapes do not fit or nothing moves in the demonstration.
    """

    def __init__(
        self,
        trajectory: ArrayLike,
        robot: ArrayLike,
        *,
        horizon: int | None = None,
        lam: tuple[float, float] = LAMBDA,
        trim: bool = True,
        speed: bool = True,
        include_goal: bool = True,
        timed: bool = True,
    ):
        z, robot = _checked(trajectory), np.asarray(robot, np.float64)
        if robot.ndim != 3 or robot.shape[1:] != z.shape[1:] or len(robot) < 3:
            raise InputError(
                f"robot keypoints of shape {robot.shape}: give (M, {z.shape[1]}, 2), M >= 3."
            )
        self.z_E = z = prepare(z, robot, horizon=horizon, trim=trim, speed=speed)
        self.v_E = z[1:] - z[:-1]  # (N - 1, K, 2)
        self.path = np.linalg.norm(z - z[0], axis=-1).max(0).mean()
        if self.path < 1e-6:
            raise InputError(
                "nothing moves in the demonstration; give a video that shows the skill."
            )
        self.timed, self.lam, self.episode = timed, lam, _episode(z)
        self.last = len(z) - 1 if include_goal else len(z) - 2

    def __call__(self, z: np.ndarray, z_next: np.ndarray, t: int = 0) -> tuple[float, Parts]:
        """r_t and its parts for z_t and z_{t+1}, (K, 2) each, at step t = 0, 1, ..."""
        if self.timed:
            z_p = self.target(t)
            v_q = z_p - self.z_E[min(t, self.last)]  # 0 once the goal is reached: stay there
        else:
            z_p, v_q = self.z_E[: self.last + 1], self.v_E  # all p, all q
        r1 = -self._distance(z_next - z_p).min()  # Eq. 9
        r2 = -self._distance(z_next - z - v_q).min()  # Eq. 10
        r = self.lam[0] * r1 + self.lam[1] * r2  # Eq. 8
        return float(r), {"r1": float(r1), "r2": float(r2)}

    def _distance(self, d):
        """Mean length of the differences d (..., K, 2), capped, in units of the path: (...)."""
        return np.minimum(np.linalg.norm(d, axis=-1), 2 * self.path).mean(-1) / self.path

    def target(self, t: int) -> np.ndarray:
        """z^E (K, 2) that the demonstration reaches with step t; from its end on, its last one."""
        return self.z_E[min(t + 1, self.last)]

    def clock(self, t: int) -> float:
        """How far along the demonstration is at step t, 0 to 1."""
        return min(t, self.last) / self.last


KeypointReward = LiteralReward | MendedReward  # what the wrappers and `imitate` take


def _checked(trajectory):
    z = np.asarray(trajectory, np.float64)
    if z.ndim != 3 or z.shape[2] != 2 or len(z) < 3:
        raise InputError(
            f"keypoint trajectory of shape {z.shape}: give (N, K, 2) with N of 3 or more."
        )
    return z


def _episode(z_E):
    # Steps of an episode in which the demonstration takes its share.
    return round(len(z_E) / MOST_OF_HORIZON)


def prepare(
    z: ArrayLike,
    robot: ArrayLike,
    *,
    horizon: int | None = None,
    trim: bool = True,
    speed: bool = True,
) -> np.ndarray:
    """The demonstration z (N, K, 2) as the robot could do it, (n, K, 2), without single glitches.

    robot (M, K, 2): keypoints of its random video. The other arguments are `MendedReward`'s.
    """
    z, robot = np.asarray(z, np.float64), np.asarray(robot, np.float64)
    z = np.concatenate([z[:1], np.median([z[:-2], z[1:-1], z[2:]], axis=0), z[-1:]])
    z = trim_pauses(z, LEAST_STEP * _quantile_step(robot, 0.5), REST) if trim else z
    longest = int(MOST_OF_HORIZON * horizon) if horizon else 10 * len(z)
    return resample(z, _top_step(robot), longest) if speed else z


def trim_pauses(z: np.ndarray, least: float, rest: int = 0) -> np.ndarray:
    """Cut the pauses of z (N, K, 2) down to `rest` frames each.

    A frame belongs to a pause if it is nearer than `least` to the last frame that moved. The first
    and the last frame stay.
    """
    kept, moved = [0], 0
    for i in range(1, len(z) - 1):
        if np.linalg.norm(z[i] - z[moved]) >= least:
            moved = i
        if i - moved <= rest:
            kept.append(i)
    return z[[*kept, len(z) - 1]]


def resample(z: np.ndarray, step: float, longest: int) -> np.ndarray:
    """Stretch the time of z (N, K, 2) until its top step (90th percentile) is at most `step`.

    It never gets faster than it was, because what slides or falls has a time of its own. The factor
    is one for all frames, so a strike stays faster than the approach to it. Only if there would be
    more than `longest` frames is the whole hurried to fit.
    """
    n = int(np.clip(round((len(z) - 1) * max(1.0, _top_step(z) / step)) + 1, 2, longest))
    t = np.linspace(0, len(z) - 1, n)
    i = np.minimum(t.astype(int), len(z) - 2)
    return z[i] + (t - i)[:, None, None] * (z[i + 1] - z[i])  # (n, K, 2)


def _quantile_step(z, q):
    # Of the lengths of the steps from frame to frame, over all keypoints at once.
    return float(np.quantile(np.linalg.norm(z[1:] - z[:-1], axis=(1, 2)), q))


def _top_step(z):
    # The 90th percentile leaves out the resets of a random video, one frame in twenty-five.
    return _quantile_step(z, 0.9)
