"""The keypoint reward, Eq. 8-10: how near is the robot to the translated demonstration?

In: the demonstration's keypoint trajectory z^E (N, K, 2), and for the mended form the keypoints of the
robot's random video (M, K, 2). Out: r_t for a transition z_t -> z_{t+1}, with its parts r1 and r2.
`form="literal"` is the paper's. Under it an arm that idles scores as well as the demonstration if that
starts at rest or pauses: r1 = 0, r2 = 0. `form="mended"` adds what makes it learn; every line of it
that is not in the paper says so, and every mend can be switched off alone.
"""

from __future__ import annotations

import numpy as np


def keypoint_noise(video: np.ndarray) -> np.ndarray:
    """Standard deviation (K,) of a still keypoint's jitter, from second differences of z (M, K, 2).

    A median, because smooth motion has small second differences and resets are rare.
    """
    jerk = np.abs(z_diff(z_diff(video)))  # (M - 2, K, 2)
    return 1.4826 * np.median(jerk, axis=(0, 2)) / 6**0.5  # var(a - 2b + c) = 6 var


def z_diff(z):
    return z[1:] - z[:-1]


def step_length(z: np.ndarray) -> float:
    """Median norm of z_{t+1} - z_t over (T, K, 2)."""
    return float(np.median(np.linalg.norm(z_diff(z).reshape(len(z) - 1, -1), axis=1)))


def trim(z: np.ndarray, least: float) -> np.ndarray:
    """Drop the frames less than `least` away from the last one kept: pauses go, the goal stays."""
    kept = [0]
    for i in range(1, len(z)):
        if np.linalg.norm(z[i] - z[kept[-1]]) >= least:
            kept.append(i)
    if kept[-1] != len(z) - 1:
        kept[-1 if len(kept) > 1 else len(kept):] = [len(z) - 1]
    return z[kept]


def resample(z: np.ndarray, step: float, longest: int) -> np.ndarray:
    """Stretch time by one factor so that the median step is `step`, in at most `longest` frames."""
    n = round((len(z) - 1) * step_length(z) / step) + 1
    n = int(np.clip(n, 2, longest))
    t = np.linspace(0, len(z) - 1, n)
    i = np.minimum(t.astype(int), len(z) - 2)
    return z[i] + (t - i)[:, None, None] * (z[i + 1] - z[i])


class KeypointReward:
    def __init__(self, trajectory, robot=None, *, longest=10**6, form="mended", trim=True, resample=True, include_goal=True, weights=True, timed=True, lam2=1.0, power=1.0):
        z = np.asarray(trajectory, np.float64)
        N, K = z.shape[:2]
        self.form = form
        if form == "literal":
            self.z_E, self.timed, self.include_goal = z, False, False
            self.w, self.R, self.lam = None, 1, (1, 1)
            return
        noise = keypoint_noise(robot)
        step = step_length(robot)
        z = np.median([z[:-2], z[1:-1], z[2:]], axis=0) if len(z) > 4 else z
        if trim:
            z = globals()["trim"](z, 0.25 * step)
        if resample:
            z = globals()["resample"](z, step, longest)
        self.z_E = z
        extent = np.linalg.norm(z - z[0], axis=-1).max(0)
        if weights:
            moved = extent > np.maximum(6 * noise, 0.1 * extent.max())
            mean_step = np.linalg.norm(z_diff(robot), axis=-1).mean(0)
            self.w = moved / np.maximum(mean_step, noise)**power
            self.w /= self.w.sum()
        else:
            self.w = np.full(K, 1 / K)
        self.R = (self.w * extent).sum()
        self.timed, self.include_goal = timed, include_goal
        self.lam = (1.0, lam2)

    @property
    def N(self):
        return len(self.z_E)

    def clock(self, t):
        return min(t, self.N - 1) / (self.N - 1)

    def _norm(self, d):
        if self.form == "literal":
            return np.sqrt((d**2).sum((-2, -1)))
        return (self.w * np.minimum(np.linalg.norm(d, axis=-1), 2 * self.R)).sum(-1) / self.R

    def __call__(self, z, z_next, t=None):
        last = self.N - 1 if self.include_goal else self.N - 2
        v_E = z_diff(self.z_E)
        if self.form == "literal":
            r1 = -self._norm(z - self.z_E[:-1]).min()
            r2 = -self._norm(z_next - z - v_E).min()
        elif self.timed:
            i = min(t + 1, last)
            r1 = -self._norm(z_next - self.z_E[i])
            v = self.z_E[i] - self.z_E[min(t, last)]
            r2 = -self._norm(z_next - z - v)
        else:
            r1 = -self._norm(z_next - self.z_E[: last + 1]).min()
            r2 = -self._norm(z_next - z - v_E).min()
        return self.lam[0] * r1 + self.lam[1] * r2, {"r1": r1, "r2": r2}
