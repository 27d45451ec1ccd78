"""The keypoint reward, Eq. 8-10: how well does the robot follow the translated demonstration?

In: the demonstration's keypoint trajectory z^E (N, K, 2); for the mended form also the keypoints of
the robot's random video (M, K, 2). Out: r_t of a transition z_t -> z_{t+1}, with its parts r1 and
r2. `form="literal"` is the paper's. It pays an idle arm as much as the demonstration whenever that
starts at rest or pauses: r1 = 0 and r2 = 0, for ever. `form="mended"` is what learns; none of its
mends is in the paper, and each can be switched off alone.
"""

from __future__ import annotations

import numpy as np

from .training import InputError

# of r1 and r2; the paper names none. With 1, 1 slide's pucks scatter twice as far
LAMBDA = (1.0, 3.0)
LEAST_STEP = 0.1  # of the robot's step: what moves less from frame to frame rests
# frames of a rest that stay, 0.2 s: movements start and end slowly; without them the robot is
REST = 5
# always late, and hits a sliding puck too hard to catch up
# the demonstration's share of an episode, so that time is left to reach its goal
MOST_OF_HORIZON = 0.7
MENDS = ("trim", "speed", "include_goal", "timed")  # the switches of `KeypointReward`


def _steps(z):
    return np.linalg.norm(z[1:] - z[:-1], axis=-1)  # (T - 1, K)


def _median_step(z):
    return float(np.median(np.linalg.norm(_steps(z), axis=1)))


def _top_step(z):
    # 90th percentile: resets of a random video, one frame in twenty-five, stay out.
    return float(np.quantile(np.linalg.norm(_steps(z), axis=1), 0.9))


def trim_pauses(z: np.ndarray, least: float, rest: int = 0) -> np.ndarray:
    """Cut pauses of z (N, K, 2): frames nearer than `least` to the last one that moved, but for
    `rest`.

    First and last frame stay.
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

    Never faster than it was: what slides or falls has a time of its own. One factor, not one speed:
    a strike stays faster than the approach to it. Only where there would be more than `longest`
    frames is the whole hurried on to as many.
    """
    n = int(np.clip(round((len(z) - 1) * max(1.0, _top_step(z) / step)) + 1, 2, longest))
    t = np.linspace(0, len(z) - 1, n)
    i = np.minimum(t.astype(int), len(z) - 2)
    return z[i] + (t - i)[:, None, None] * (z[i + 1] - z[i])  # (n, K, 2)


def prepare(z, robot, *, horizon=None, trim=True, speed=True) -> np.ndarray:
    """The demonstration (N, K, 2) as the robot could do it: no glitches, no pauses, no step too
    long.

    robot (M, K, 2): its random video shows the robot's pace. Arguments as `KeypointReward`.
    """
    z, step = np.asarray(z, np.float64), _median_step(robot)
    # one lost frame
    z = np.concatenate([z[:1], np.median([z[:-2], z[1:-1], z[2:]], axis=0), z[-1:]])
    z = trim_pauses(z, LEAST_STEP * step, REST) if trim else z
    longest = int(MOST_OF_HORIZON * horizon) if horizon else 10 * len(z)
    return resample(z, _top_step(robot), longest) if speed else z


class KeypointReward:
    """r_t = lambda_r1 r1(t) + lambda_r2 r2(t), Eq. 8. A pure function of z_t, z_{t+1} and, if
    `timed`, t.

    trajectory: z^E (N, K, 2) in [-1, 1], N >= 3. robot: keypoints (M, K, 2) of the robot's random
    video, which the mended form needs for the robot's pace. horizon: the most steps an episode may
    have; with `speed` the prepared demonstration takes at most 70 % of it. lam: (lambda_r1,
    lambda_r2).

    The mends: `trim` cuts pauses, which make idling look like the skill; `speed` slows the
    demonstration down to the robot's pace where it is faster, and hurries one that takes more than
    its share of the horizon; `include_goal` lets p reach N; `timed` takes q = t and p = t + 1
    instead of the nearest frames, so that falling behind costs. The mended reward also judges
    z_{t+1}, which a_t can still change, where Eq. 9 judges z_t, and takes the mean length over
    keypoints, each capped at twice the mean path: a lost keypoint costs a bounded share. Its unit:
    r1 = -1 is an arm that never moved, seen at the end, if the demonstration ends farthest from its
    start. It lies in [-2 sum(lam), 0].

    Raises InputError where shapes do not fit or nothing moves in the demonstration.
    """

    def __init__(
        self,
        trajectory,
        robot=None,
        *,
        form: str = "mended",
        horizon: int | None = None,
        lam: tuple[float, float] = LAMBDA,
        trim: bool = True,
        speed: bool = True,
        include_goal: bool = True,
        timed: bool = True,
    ):
        z = np.asarray(trajectory, np.float64)
        if z.ndim != 3 or z.shape[2] != 2 or len(z) < 3:
            raise InputError(
                f"keypoint trajectory of shape {z.shape}: give (N, K, 2) with N of 3 or more."
            )
        if form not in ("literal", "mended"):
            raise InputError(f"reward form {form!r}: choose 'literal' or 'mended'.")
        self.literal, self.lam = form == "literal", lam
        self.timed = timed and not self.literal
        if not self.literal:
            robot = np.asarray(robot, np.float64)
            if robot.ndim != 3 or robot.shape[1:] != z.shape[1:] or len(robot) < 3:
                raise InputError(
                    f"robot keypoints of shape {robot.shape}: give (M, {z.shape[1]}, 2), M >= 3."
                )
            z = prepare(z, robot, horizon=horizon, trim=trim, speed=speed)
            self.path = np.linalg.norm(z - z[0], axis=-1).max(0).mean()
            if self.path < 1e-6:
                raise InputError(
                    "nothing moves in the demonstration; give a video that shows the skill."
                )
        self.z_E = z  # (N, K, 2)
        self.v_E = z[1:] - z[:-1]  # (N - 1, K, 2)
        self.last = len(z) - 1 if include_goal and not self.literal else len(z) - 2

    def __len__(self):
        return len(self.z_E)

    @property
    def episode(self) -> int:
        """Steps of an episode in which the demonstration takes its share."""
        return round(len(self.z_E) / MOST_OF_HORIZON)

    def _distance(self, d):
        """Norm of the differences d (..., K, 2) over all keypoints: (...)."""
        if self.literal:
            return np.sqrt(np.square(d).sum((-2, -1)))
        return np.minimum(np.linalg.norm(d, axis=-1), 2 * self.path).mean(-1) / self.path

    def __call__(self, z, z_next, t: int = 0) -> tuple[float, dict[str, float]]:
        """r_t and its parts {"r1", "r2"} of z_t, z_{t+1} (K, 2) at step t = 0, 1, ... of the
        episode."""
        if self.timed:
            z_p, i = self.target(t), min(t, self.last)
            v_q = z_p - self.z_E[i]  # 0 once the goal is reached: stay there
        else:
            z_p, v_q = self.z_E[: self.last + 1], self.v_E  # all p, all q
        r1 = -self._distance((z if self.literal else z_next) - z_p).min()  # Eq. 9
        r2 = -self._distance(z_next - z - v_q).min()  # Eq. 10
        r = self.lam[0] * r1 + self.lam[1] * r2  # Eq. 8
        return float(r), {"r1": float(r1), "r2": float(r2)}

    def target(self, t: int) -> np.ndarray:
        """z^E (K, 2) where the demonstration is after step t; its end stays."""
        return self.z_E[min(t + 1, self.last)]

    def clock(self, t: int) -> float:
        """How far the demonstration is at step t, 0 to 1; all that a timed reward's future hangs
        on."""
        return min(t, self.last) / self.last
