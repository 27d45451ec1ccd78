"""Notebook 6, the keypoint reward: Eq. 8-10 and what mends them."""

import numpy as np

from tests.grade.exercise import exercise


def _walk(rng, n, K=5):
    """A keypoint trajectory (n, K, 2) that goes somewhere."""
    return np.cumsum(rng.normal(0.02, 0.05, (n, K, 2)), axis=0)


def _any_walk(rng):
    return _walk(rng, int(rng.integers(8, 22)), int(rng.integers(2, 8)))


@exercise("6.1", "The nearest frame, r1 (Eq. 9)")
def r1(z, z_E):
    distances = np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=(1, 2)))
    return -distances.min()


r1.check(
    "keypoints anywhere",
    lambda rng: (rng.normal(size=(z := _any_walk(rng))[0].shape), z),
    least=lambda rng: (rng.normal(size=(1, 2)), _walk(rng, 2, 1)),
)
r1.check(
    "at a frame of the demonstration it is 0",
    lambda rng: ((z := _any_walk(rng))[rng.integers(len(z) - 1)], z),
)
r1.check(
    "at its first frame, too: p begins at 1, z_E[0]", lambda rng: ((z := _any_walk(rng))[0], z)
)
r1.check(
    "at the last frame it is not: p ends at N - 1",
    lambda rng: ((z := _any_walk(rng))[-1] + 1, z + 1),
)
r1.mistake(
    "Take the minimum of the distances; yours is the largest.",
    "-distances.min()",
    "-distances.max()",
)
r1.mistake(
    "The differences are squared before they are added up; yours are absolute values.",
    "np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=(1, 2)))",
    "np.abs(z_E[:-1] - z).sum(axis=(1, 2))",
)
r1.mistake(
    "You return which frame is nearest; the reward is how near it is.",
    "-distances.min()",
    "-distances.argmin()",
)
r1.mistake(
    "You return which frame is nearest; the reward is how near it is.",
    "-distances.min()",
    "distances.argmin()",
)
r1.mistake("One number: the minimum over p is missing.", "-distances.min()", "-distances")
r1.mistake(
    "The norm is one length of all 2K numbers, each frame's own: sum over axes 1 and 2; yours goes "
    "over the frames, too.",
    "np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=(1, 2)))",
    "np.sqrt(((z_E[:-1] - z) ** 2).sum())",
)
r1.mistake(
    "A reward is larger when the robot is nearer: Eq. 9 has a minus in front.",
    "-distances",
    "distances",
)
r1.mistake(
    "Your distance is squared: Eq. 9 has the norm, with its square root.",
    "np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=(1, 2)))",
    "((z_E[:-1] - z) ** 2).sum(axis=(1, 2))",
)
r1.mistake("Your minimum includes the last frame: in Eq. 9 p ends at N - 1.", "z_E[:-1]", "z_E")
r1.mistake(
    "A slice leaves its end out: z_E[0 : N - 1] ends with z_E[N - 2], and yours one frame before.",
    "z_E[:-1]",
    "z_E[:-2]",
)
r1.mistake(
    "Your minimum leaves out the first frame: p = 1 is z_E[0] in Python.", "z_E[:-1]", "z_E[1:-1]"
)
r1.mistake(
    "Eq. 9 takes the nearest frame, a minimum over p; you take the mean.", ".min()", ".mean()"
)
r1.mistake(
    "You take the mean distance of a keypoint: the norm is one length of all 2K numbers.",
    "np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=(1, 2)))",
    "np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=2)).mean(axis=1)",
)
r1.mistake(
    "You take the nearest single keypoint: one frame counts with all its keypoints.",
    "np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=(1, 2)))",
    "np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=2))",
)
r1.mistake(
    "You add up one distance per keypoint: the norm goes over all K keypoints and both coordinates "
    "at once.",
    "np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=(1, 2)))",
    "np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=2)).sum(axis=1)",
)
r1.mistake(
    "ord=2 of a (K, 2) matrix is its largest singular value; the norm is the length of all "
    "2K numbers.",
    "np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=(1, 2)))",
    "np.linalg.norm(z_E[:-1] - z, 2, axis=(1, 2))",
)
r1.mistake(
    "One frame is the nearest for the whole robot; in yours each keypoint has its own.",
    "np.sqrt(((z_E[:-1] - z) ** 2).sum(axis=(1, 2)))",
    "np.sqrt(((z_E[:-1] - z) ** 2).sum(2).min(0).sum(keepdims=True))",
)
r1.mistake(
    "The norm is the root of a sum; yours is the root of a mean.",
    ".sum(axis=(1, 2))",
    ".mean(axis=(1, 2))",
)
r1.mistake(
    "Python counts from 0: frames 1 to N - 1 of Eq. 9 are z_E[0] to z_E[N - 2], z_E[:-1].",
    "z_E[:-1]",
    "z_E[1:]",
)


@exercise("6.2", "The nearest step, r2 (Eq. 10)")
def r2(z, z_next, z_E):
    step = z_next - z
    steps = z_E[1:] - z_E[:-1]
    return -np.sqrt(((steps - step) ** 2).sum(axis=(1, 2))).min()


def _homewards(rng):
    """A step about as long as from the last frame back to the first, which nobody made."""
    z_E = _any_walk(rng)
    z = rng.normal(size=z_E[0].shape)
    return z, z + z_E[0] - z_E[-1] + rng.normal(size=z.shape) * 0.2, z_E


r2.check(
    "any step, no matter where",
    _homewards,
    least=lambda rng: (*rng.normal(size=(2, 1, 2)), _walk(rng, 2, 1)),
)
r2.check(
    "a step of the demonstration, made elsewhere, earns 0",
    lambda rng: ((z := _any_walk(rng))[q := rng.integers(len(z) - 2)] + 3, z[q + 1] + 3, z),
)
r2.check(
    "so does its last step: q = N - 1 leads to the last frame",
    lambda rng: ((z := _any_walk(rng))[-2] + 3, z[-1] + 3, z),
)
r2.mistake(
    "Your distance is squared: Eq. 10 has the norm, with its square root.",
    "-np.sqrt(((steps - step) ** 2).sum(axis=(1, 2))).min()",
    "-((steps - step) ** 2).sum(axis=(1, 2)).min()",
)
r2.mistake(
    "You add up one distance per keypoint: the norm goes over all K keypoints and both coordinates "
    "at once.",
    "np.sqrt(((steps - step) ** 2).sum(axis=(1, 2)))",
    "np.sqrt(((steps - step) ** 2).sum(axis=2)).sum(axis=1)",
)
r2.mistake(
    "You take the mean distance of a keypoint: the norm is one length of all 2K numbers.",
    "np.sqrt(((steps - step) ** 2).sum(axis=(1, 2)))",
    "np.sqrt(((steps - step) ** 2).sum(axis=2)).mean(axis=1)",
)
r2.mistake(
    "You leave out the first step, from z_E[0] to z_E[1].",
    "z_E[1:] - z_E[:-1]",
    "z_E[2:] - z_E[1:-1]",
)
r2.mistake(
    "A step is the later place minus the earlier one, the robot's as the demonstration's: one of "
    "yours has the opposite sign.",
    "z_next - z",
    "z - z_next",
)
r2.mistake(
    "A reward is larger when the step is nearer: Eq. 10 has a minus in front.",
    "-np.sqrt",
    "np.sqrt",
)
r2.mistake(
    "You compare places; Eq. 10 compares steps, z^E_{q+1} - z^E_q.",
    "z_E[1:] - z_E[:-1]",
    "z_E[:-1]",
)
r2.mistake(
    "Eq. 10 takes the nearest step, a minimum over q; you take the mean.", ".min()", ".mean()"
)
r2.mistake(
    "N frames have N - 1 steps: you leave out the last, q = N - 1, to the last frame.",
    "z_E[1:] - z_E[:-1]",
    "z_E[1:-1] - z_E[:-2]",
)
r2.mistake(
    "q is not p: Eq. 10 takes the step most like the robot's, wherever it was made; you take the "
    "step at the nearest frame.",
    "z_E[1:] - z_E[:-1]",
    "(z_E[1:] - z_E[:-1])[[((z_E[:-1] - z) ** 2).sum(axis=(1, 2)).argmin()]]",
)
r2.mistake(
    "You return r_1 of z_next, a distance between places; Eq. 10 compares steps.",
    "step = z_next - z",
    "step = z_next",
    "z_E[1:] - z_E[:-1]",
    "z_E[:-1]",
)
r2.mistake(
    "You compare how long the steps are; Eq. 10 compares where they go, too.",
    "np.sqrt(((steps - step) ** 2).sum(axis=(1, 2)))",
    "np.abs(np.linalg.norm(steps, axis=(1, 2)) - np.linalg.norm(step))",
)
r2.mistake(
    "A step leads from frame to frame, axis 0; np.diff takes the last axis and subtracts x from y.",
    "z_E[1:] - z_E[:-1]",
    "np.diff(z_E)",
)
r2.mistake(
    "The last frame leads nowhere: np.roll adds a step from there to the first.",
    "z_E[1:] - z_E[:-1]",
    "np.roll(z_E, -1, axis=0) - z_E",
)


@exercise("6.3", "What an episode earns (Eq. 8)", given=(r1, r2))
def episode_return(z, z_E, lam1, lam2):
    total = 0.0
    for t in range(len(z) - 1):
        total += lam1 * r1(z[t], z_E) + lam2 * r2(z[t], z[t + 1], z_E)
    return total


def _near_the_end(rng):
    """Three frames near the end of a demonstration that is longer and goes on and on."""
    z_E = _walk(rng, 21, 2) + np.linspace(0, 9, 21)[:, None, None]
    return z_E[-4:-1] + rng.normal(0, 0.05, (3, 2, 2)), z_E, 0.5, 2.0


def _episode(rng, *weights, shorter=False):
    """An episode and a demonstration, which is shorter or of any length."""
    K, T = (int(n) for n in rng.integers((2, 8), (7, 18)))
    N = int(rng.integers(5, T if shorter else 22))
    return _walk(rng, T, K), _walk(rng, N, K), *weights


episode_return.check(
    "a random episode",
    lambda rng: _episode(rng, 1.0, 1.0, shorter=True),
    least=lambda rng: (_walk(rng, 2, 1), _walk(rng, 2, 1), 1.0, 1.0),
)
episode_return.check(
    "other weights",
    lambda rng: _episode(rng, float(rng.uniform(0.1, 0.8)), float(rng.uniform(1.5, 3))),
    least=_near_the_end,
)
episode_return.mistake(
    "z_{t+1} is the robot's next frame, z[t + 1]: r2 judges its own step.",
    "r2(z[t], z[t + 1], z_E)",
    "r2(z[t + 1], z[t], z_E)",
)
episode_return.mistake(
    "Only the first part: lambda_r2 r_2 is missing.", " + lam2 * r2(z[t], z[t + 1], z_E)", ""
)
episode_return.mistake(
    "Only the second part: lambda_r1 r_1 is missing.", "lam1 * r1(z[t], z_E) + ", ""
)
episode_return.mistake(
    "Add up over all transitions: yours is what the last one earns.", "total +=", "total ="
)
episode_return.mistake(
    "Begin with the first transition, t = 0: you leave it out.",
    "range(len(z) - 1)",
    "range(1, len(z) - 1)",
)
episode_return.mistake(
    "The robot's episode has T frames; you count those of the demonstration.",
    "range(len(z) - 1)",
    "range(len(z_E) - 1)",
)
episode_return.check(
    "a robot that never moves beside a demonstration that starts at rest",
    lambda rng: (
        np.zeros((30, 5, 2)),
        np.concatenate([np.zeros((4, 5, 2)), _walk(rng, 20)]),
        1.0,
        1.0,
    ),
)
episode_return.mistake(
    "T frames have T - 1 transitions: you leave out the last one.",
    "range(len(z) - 1)",
    "range(len(z) - 2)",
)
episode_return.mistake(
    "Eq. 9 judges z_t, the keypoints before the action; you take z_{t+1}.",
    "r1(z[t], z_E)",
    "r1(z[t + 1], z_E)",
)
episode_return.mistake(
    "lambda_r1 weighs r1, lambda_r2 weighs r2; yours are swapped.", "lam1, lam2):", "lam2, lam1):"
)
episode_return.mistake(
    "T frames have T - 1 transitions, and each earns one r_1; yours adds a T-th, that of the last "
    "frame.",
    "return total",
    "return total + lam1 * r1(z[-1], z_E)",
)
episode_return.mistake(
    "Eq. 8 weighs the two parts: multiply r_1 by lam1 and r_2 by lam2.",
    "lam1 * ",
    "",
    "lam2 * ",
    "",
)
episode_return.mistake(
    "Rewards add up over an episode; you return their mean.",
    "return total",
    "return total / (len(z) - 1)",
)
episode_return.mistake(
    "r_1 asks the whole video, every p: yours ends where the episode does.",
    "r1(z[t], z_E)",
    "r1(z[t], z_E[: len(z)])",
)
episode_return.mistake(
    "Each pair shares a frame with the next: T frames make T - 1 pairs; yours do not overlap.",
    "range(len(z) - 1)",
    "range(0, len(z) - 1, 2)",
)
episode_return.mistake(
    "The robot's episode has T frames, z; you walk over those of the demonstration.",
    "range(len(z) - 1)",
    "range(min(len(z), len(z_E)) - 1)",
)


@exercise("6.4", "Cut the pauses")
def trim(z, least):
    kept = [0]
    for i in range(1, len(z) - 1):
        if np.linalg.norm(z[i] - z[kept[-1]]) >= least:
            kept.append(i)
    return z[kept + [len(z) - 1]]


def _with_pauses(rng):
    n, K = (int(k) for k in rng.integers((8, 2), (13, 8)))
    z = np.repeat(_walk(rng, n, K), rng.integers(1, 5, n), axis=0)
    return z + rng.normal(0, 1e-3, z.shape), float(rng.uniform(0.03, 0.08))


def _trembling(rng):
    """A keypoint that swings between two places nearer than `least`, and at last walks away."""
    least, swings = float(rng.uniform(0.1, 0.3)), int(rng.integers(10, 20))
    x = np.append(np.arange(swings) % 2 * rng.uniform(0.4, 0.9), np.arange(1.5, 4, 0.6))
    return x[:, None, None] * least * np.array([[0.6, 0.8]]), least


def _slow(rng):
    """A steady motion of steps far shorter than `least`."""
    return np.linspace(0, 1, rng.integers(40, 80))[:, None, None] * rng.uniform(0.5, 1, (1, 3, 2))


def _rest(rng):
    return np.repeat(rng.normal(size=(1, 4, 2)), rng.integers(3, 12), axis=0)


trim.check("a demonstration with pauses", _with_pauses, least=lambda rng: (_walk(rng, 2, 1), 0.5))
trim.check(
    "slow motion is kept where it adds up",
    lambda rng: (_slow(rng), rng.uniform(0.15, 0.4)),
)
trim.check(
    "where nothing rests, every frame stays, there and back",
    lambda rng: (np.concatenate([z := _any_walk(rng), z[-2::-1]]), 1e-3),
)
trim.check("trembling on the spot is rest, however long the way", _trembling)
trim.check(
    "a frame exactly `least` away stays, one that is a hair nearer does not",
    lambda rng: (0.5 * np.arange(rng.integers(6, 12))[:, None, None] * np.array([[1.0, 0.0]]), 0.5),
    least=lambda rng: (np.array([0, 0.5 - 2**-12, 1.5, 2])[:, None, None] * [[1.0, 0.0]], 0.5),
)
trim.check(
    "first and last frame stay",
    lambda rng: (_rest(rng), float(rng.uniform(0.05, 0.2))),
)
trim.mistake(
    "Compare with the last frame that was kept: yours asks all of them, and a way back is lost.",
    "np.linalg.norm(z[i] - z[kept[-1]]) >= least",
    "all(np.linalg.norm(z[i] - z[k]) >= least for k in kept)",
)
trim.mistake(
    "The last frame stays, even if it is near the one before it.",
    "[len(z) - 1]]",
    "[len(z) - 1] * (np.linalg.norm(z[-1] - z[kept[-1]]) >= least)]",
)
trim.mistake(
    "The last frame stays, even if it is the same as the one before it.",
    "[len(z) - 1]]",
    "[len(z) - 1] * bool((z[-1] != z[kept[-1]]).any())]",
)
trim.mistake(
    "How far is one length of all 2K numbers; you add up one for each keypoint.",
    "np.linalg.norm(z[i] - z[kept[-1]])",
    "np.linalg.norm(z[i] - z[kept[-1]], axis=-1).sum()",
)
trim.mistake(
    "The distance counts, not the length of the way since the last frame you kept: what trembles "
    "on the spot rests.",
    "    kept = [0]\n",
    "    kept = [0]\n    way = np.insert(np.cumsum(np.sqrt((np.diff(z, axis=0) ** 2)"
    ".sum((1, 2)))), 0, 0.0)\n",
    "np.linalg.norm(z[i] - z[kept[-1]])",
    "way[i] - way[kept[-1]]",
)
trim.mistake(
    "The first frame stays: begin with it.",
    "    kept = [0]\n",
    "    kept = []\n",
    "np.linalg.norm(z[i] - z[kept[-1]])",
    "np.linalg.norm(z[i] - z[kept[-1] if kept else 0])",
)
trim.mistake(
    "Return the frames, not their numbers.", "z[kept + [len(z) - 1]]", "kept + [len(z) - 1]"
)
trim.mistake(
    "Take the norm of all 2K numbers: your distance is squared.",
    "np.linalg.norm(z[i] - z[kept[-1]])",
    "((z[i] - z[kept[-1]]) ** 2).sum()",
)
trim.mistake(
    "The distance is the length of all 2K numbers; you take the mean over the keypoints.",
    "np.linalg.norm(z[i] - z[kept[-1]])",
    "np.linalg.norm(z[i] - z[kept[-1]], axis=1).mean()",
)
trim.mistake(
    "Compare with the last frame you kept, not with the one before: slow motion would vanish as a "
    "whole.",
    "z[kept[-1]]",
    "z[i - 1]",
)
trim.mistake(
    "The last frame stays, even if it is near the one before it.",
    "    for i in range(1, len(z) - 1):",
    "    for i in range(1, len(z)):",
    "kept + [len(z) - 1]",
    "kept",
)
trim.mistake("The last frame is the goal: keep it always.", "kept + [len(z) - 1]", "kept")
trim.mistake(
    "The last frame stays beside what was kept before, however near; yours throws its neighbour "
    "out.",
    "    return z[kept + [len(z) - 1]]",
    "    if len(kept) > 1 and np.linalg.norm(z[-1] - z[kept[-1]]) < least:\n        kept.pop()\n"
    "    return z[kept + [len(z) - 1]]",
)
trim.mistake(
    "At least `least` away, exactly: yours lets pass what is a little nearer.",
    ">= least",
    ">= least - 1e-3",
)
trim.mistake("You keep what rests and cut what moves.", ">= least", "< least")
trim.mistake(
    "Your last frame is there twice: the rule has kept it already, and you add it once more.",
    "range(1, len(z) - 1)",
    "range(1, len(z))",
)
trim.mistake(
    "At least `least` away: a distance of just `least` is enough, >= and not >.",
    ">= least",
    "> least",
)
trim.mistake(
    "The distance is the length of all 2K numbers, as in Eq. 9; you take the farthest keypoint's.",
    "np.linalg.norm(z[i] - z[kept[-1]])",
    "np.linalg.norm(z[i] - z[kept[-1]], axis=1).max()",
)
trim.mistake(
    "Compare with the last frame you kept; you compare with the first one.", "z[kept[-1]]", "z[0]"
)
trim.mistake(
    "The last frame is added to those you kept; yours takes its neighbour's place.",
    "kept + [len(z) - 1]",
    "kept[: max(1, len(kept) - 1)] + [len(z) - 1]",
)


@exercise("6.5", "A reward that knows the time")
def timed_r1(z_next, z_E, t):
    target = z_E[min(t + 1, len(z_E) - 1)]
    return -np.linalg.norm(z_next - target)


timed_r1.check(
    "on the way",
    lambda rng: (
        rng.normal(size=(z := _any_walk(rng))[0].shape),
        z,
        int(rng.integers(len(z) - 2)),
    ),
    least=lambda rng: (rng.normal(size=(1, 2)), rng.normal(size=(1, 1, 2)), 3),
)
timed_r1.check(
    "at t = N - 1 its end has just passed",
    lambda rng: (rng.normal(size=(z := _any_walk(rng))[0].shape), z, len(z) - 1),
)
timed_r1.check(
    "after the end the goal stays the goal",
    lambda rng: (
        rng.normal(size=(z := _any_walk(rng))[0].shape),
        z,
        len(z) + int(rng.integers(0, 20)),
    ),
)
timed_r1.mistake(
    "After step t the demonstration is at frame t + 1: the robot would always be a step late.",
    "min(t + 1, len(z_E) - 1)",
    "min(t, len(z_E) - 1)",
)
timed_r1.mistake(
    "After its end the demonstration stays at its last frame; yours starts again.",
    "min(t + 1, len(z_E) - 1)",
    "(t + 1) % len(z_E)",
)
timed_r1.mistake(
    "Frames count from 0, so the last is N - 1, the goal; yours stops one before.",
    "min(t + 1, len(z_E) - 1)",
    "min(t + 1, len(z_E) - 2)",
)
timed_r1.mistake(
    "After its end the demonstration stays at its last frame: z_E[t + 1] is none any more.",
    "min(t + 1, len(z_E) - 1)",
    "t + 1",
)
timed_r1.mistake(
    "Your distance is squared: it is the norm, with its square root.",
    "-np.linalg.norm(z_next - target)",
    "-((z_next - target) ** 2).sum()",
)
timed_r1.mistake(
    "You take the mean distance of a keypoint: the norm is one length of all 2K numbers.",
    "np.linalg.norm(z_next - target)",
    "np.linalg.norm(z_next - target, axis=1).mean()",
)
timed_r1.mistake(
    "The goal is at the end of the way, not all along: ask for the frame of the time, t + 1.",
    "min(t + 1, len(z_E) - 1)",
    "-1",
)
timed_r1.mistake(
    "After step t the demonstration is at frame t + 1; yours is two frames on.",
    "min(t + 1, len(z_E) - 1)",
    "min(t + 2, len(z_E) - 1)",
)
timed_r1.mistake(
    "You add up one distance per keypoint: the distance is the length of all 2K numbers, as in "
    "Eq. 9.",
    "np.linalg.norm(z_next - target)",
    "np.linalg.norm(z_next - target, axis=1).sum()",
)
timed_r1.mistake(
    "A reward is larger when the robot is nearer: there is a minus in front.",
    "-np.linalg",
    "np.linalg",
)
timed_r1.mistake(
    "Here no minimum is taken: the frame is given by the time.",
    "-np.linalg.norm(z_next - target)",
    "-min(np.linalg.norm(z_next - frame) for frame in z_E)",
)
timed_r1.mistake(
    "When the demonstration is over its last frame stays the target; yours pays nothing.",
    "    return -np",
    "    if t + 1 >= len(z_E):\n        return 0.0\n    return -np",
)
timed_r1.mistake(
    "ord=2 of a (K, 2) matrix is its largest singular value; the norm is the length of all "
    "2K numbers.",
    "np.linalg.norm(z_next - target)",
    "np.linalg.norm(z_next - target, 2)",
)
