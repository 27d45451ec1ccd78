"""Notebook 8, coffee: clutter, and what translation does about it."""

import numpy as np

from tests.grade.exercise import exercise


def _video(rng):
    """Mostly a still picture, with something that moves across it."""
    T, *size = (int(n) for n in rng.integers((8, 9, 13), (12, 13, 17)))
    H, W = rng.permutation(size)
    frames = np.repeat(rng.integers(30, 220, (1, H, W, 3)), T, axis=0)
    for t in range(T):
        frames[t, 2:6, t : t + 3] = rng.integers(0, 256, 3)
    return (frames + rng.integers(-2, 3, frames.shape)).clip(0, 255).astype(np.uint8)


def _grey(rng):
    """A grey video, whose differences are whole numbers, and one of them for a threshold."""
    grey = _video(rng)[..., :1]
    apart = np.abs(grey - np.median(grey, axis=0)).astype(int)
    some = np.unique(apart[(apart > 4) & (np.median(grey, axis=0) % 1 == 0)])
    return np.repeat(grey, 3, axis=-1), float(rng.choice(some))


def _lamp(rng):
    """Lamps that burn in half of an even number of frames: the median lies halfway between, and all
    frames are as far off it, at some pixels half a grey more than a whole number."""
    video, apart = _video(rng), int(rng.integers(8, 40))
    video = video[: len(video) // 2 * 2]
    dark = rng.integers(20, 120, (4, 4, 1)).repeat(3, -1)
    bright = dark + 2 * apart + rng.permutation([1, 9] * 8).reshape(4, 4, 1)
    burns = rng.permutation(len(video)) % 2 == 0
    video[:, -5:-1, -5:-1] = np.where(burns[:, None, None, None], bright, dark)
    return video, apart + 0.25


@exercise("8.2", "What stands out from the median")
def foreground(video, threshold):
    video = video.astype(float)
    return np.abs(video - np.median(video, axis=0)).mean(-1) > threshold


foreground.check("something crosses a still picture", lambda rng: (_video(rng), 20.0))
foreground.mistake("The threshold is the argument, not always 20.", "> threshold", "> 20")
foreground.mistake(
    "Foreground is what differs by more than the threshold; yours is the rest.",
    "> threshold",
    "< threshold",
)
foreground.mistake("One truth value a pixel: you return how much it differs.", " > threshold", "")
foreground.mistake(
    "The mean over the three colours decides, not their sum.",
    ".mean(-1) > threshold",
    ".sum(-1) > threshold",
)
foreground.mistake(
    "Compare with the median over time, the picture without what passes; you compare with the "
    "first frame.",
    "np.median(video, axis=0)",
    "video[0]",
)
foreground.mistake(
    "Compare with the median over time, the picture without what passes; you compare with the "
    "frame before.",
    "np.median(video, axis=0)",
    "np.concatenate([video[:1], video[:-1]])",
)
foreground.check("a difference of just the threshold is not above it", _grey)
foreground.mistake(
    "More than the threshold: a difference of just the threshold is not foreground, > and not >=.",
    "> threshold",
    ">= threshold",
)
foreground.check("another threshold, and a lamp that burns in half of the frames", _lamp)
foreground.mistake(
    "The median of an even number of frames may end in a half, which integers cut off: leave it a "
    "float.",
    "np.median(video, axis=0)",
    "np.median(video, axis=0).astype(int)",
)
foreground.mistake(
    "Differences from a median that ends in a half end in one, too, and integers cut it off: leave "
    "them floats.",
    "np.abs(video - np.median(video, axis=0))",
    "np.abs(video - np.median(video, axis=0)).astype(int)",
)
foreground.mistake(
    "The median of an even number of frames is the mean of the two in the middle; you take the "
    "upper one.",
    "np.median(video, axis=0)",
    "np.sort(video, axis=0)[len(video) // 2]",
)
foreground.check(
    "darker than the background counts as well",
    lambda rng: (255 - _video(rng) // 2, float(rng.uniform(10, 25))),
)
foreground.mistake(
    "uint8 has no negative numbers: 10 - 20 is 246. Turn the video into floats first.",
    "video.astype(float)",
    "video.copy()",
    "np.median(video, axis=0)",
    "np.median(video, axis=0).astype(np.uint8)",
)
foreground.mistake(
    "The median goes over time, axis 0: one picture for the whole video.",
    "np.median(video, axis=0)",
    "np.median(video, axis=-1, keepdims=True)",
)
foreground.mistake(
    "Take the median: the mean is smeared by everything that passes.",
    "np.median(video",
    "np.mean(video",
)
foreground.mistake(
    "What is darker than the background stands out, too: take the absolute difference.",
    "np.abs(",
    "(",
)
foreground.mistake(
    "One truth value a pixel: take the mean of the three colours' absolute differences.",
    ".mean(-1)",
    "",
)
foreground.mistake(
    "Differences of opposite sign must not cancel: the absolute value first, then the mean over "
    "the colours.",
    "np.abs(video - np.median(video, axis=0)).mean(-1)",
    "np.abs((video - np.median(video, axis=0)).mean(-1))",
)
foreground.mistake(
    "The mean over the three colours decides, not one colour alone.",
    ".mean(-1) > threshold",
    ".max(-1) > threshold",
)
foreground.mistake(
    "The median is a picture, one value for each pixel and colour: give np.median the axis of "
    "time, 0.",
    "np.median(video, axis=0)",
    "np.median(video)",
)
foreground.mistake(
    "Take the differences first, then the mean over the colours: more red and less green do "
    "not cancel.",
    "video = video.astype(float)",
    "video = video.astype(float).mean(-1, keepdims=True)",
)
foreground.mistake(
    "Of an even number of frames you take the lower of the two in the middle, as torch.median "
    "does; np.median takes their mean.",
    "np.median(video, axis=0)",
    "torch.from_numpy(video).median(0).values.numpy()",
)


@exercise("8.3", "Where the motion is")
def share_inside(video, mask):
    energy = (np.diff(video.astype(float), axis=0) ** 2).sum((0, 3))
    return energy[mask].sum() / energy.sum()


def _masked(rng):
    video = _video(rng)
    mask = np.zeros(video.shape[1:3], bool)
    mask[rng.integers(4) :, : rng.integers(4, 10)] = True
    return video, mask


share_inside.check("any region", _masked, points=2)
share_inside.check(
    "the whole picture holds all of it",
    lambda rng: (v := _video(rng), np.ones(v.shape[1:3], bool)),
)
share_inside.mistake(
    "Square each colour's difference, then add up: yours adds the colours first, and what gets "
    "redder and less green cancels.",
    "(np.diff(video.astype(float), axis=0) ** 2).sum((0, 3))",
    "(np.diff(video.astype(float).sum(3), axis=0) ** 2).sum(0)",
)
share_inside.mistake(
    "You return the energy inside; the share is that divided by all of it.",
    "energy[mask].sum() / energy.sum()",
    "energy[mask].sum()",
)
share_inside.mistake(
    "How much moves inside counts, not how large the mask is.",
    "energy[mask].sum() / energy.sum()",
    "mask.mean()",
)
share_inside.mistake(
    "A share lies between 0 and 1; yours is per cent.",
    "energy[mask].sum() / energy.sum()",
    "100 * energy[mask].sum() / energy.sum()",
)
share_inside.mistake(
    "uint8 has no negative numbers: a pixel that gets darker by 1 counts as 255. Make the video "
    "floats before you subtract.",
    "video.astype(float)",
    "video",
    ") ** 2)",
    ").astype(float) ** 2)",
)
share_inside.mistake(
    "Motion is a difference between frames; you add up the frames themselves.",
    "np.diff(video.astype(float), axis=0)",
    "video.astype(float)",
)
share_inside.mistake(
    "Motion is from frame to frame; you compare all frames with the first one.",
    "np.diff(video.astype(float), axis=0)",
    "(video[1:].astype(float) - video[0])",
)
share_inside.mistake(
    "That is the share outside: the mask is True inside.", "energy[mask]", "energy[~mask]"
)
share_inside.mistake(
    "Divide by all the motion, not by the number of pixels.", "/ energy.sum()", "/ energy.size"
)
share_inside.mistake(
    "Energy is the square of the difference, not its size.",
    "(np.diff(video.astype(float), axis=0) ** 2)",
    "np.abs(np.diff(video.astype(float), axis=0))",
)
share_inside.mistake(
    "Differences with their signs cancel over time: square them.",
    "(np.diff(video.astype(float), axis=0) ** 2)",
    "np.diff(video.astype(float), axis=0)",
)
share_inside.mistake(
    "A share of the whole: divide sums, not means, which forget how large the mask is.",
    "energy[mask].sum() / energy.sum()",
    "energy[mask].mean() / energy.mean()",
)
share_inside.mistake(
    "A share of the whole: divide by all the motion, not by that outside.",
    "/ energy.sum()",
    "/ max(energy[~mask].sum(), 1e-9)",
)
share_inside.mistake(
    "Inside over the whole, which is a share; yours is inside over outside.",
    "/ energy.sum()",
    "/ energy[~mask].sum()",
)
share_inside.mistake(
    "np.diff takes the last axis, from colour to colour: energy is between frames, axis=0.",
    "np.diff(video.astype(float), axis=0)",
    "np.diff(video.astype(float))",
)
share_inside.mistake(
    "int16 ends at 32,767, and a square of 182 and more does not fit: use floats.",
    "video.astype(float)",
    "video.astype(np.int16)",
)
share_inside.mistake(
    "You compare the means inside and outside; the share is of the sums, of all pixels there.",
    "energy[mask].sum() / energy.sum()",
    "energy[mask].mean() / (energy[mask].mean() + energy[~mask].mean())",
)
share_inside.mistake(
    "uint8 has no negative numbers: a difference of -1 counts as 255, and squares wrap around, "
    "too. Make the video floats before you subtract.",
    "video.astype(float)",
    "video",
)


@exercise("8.1", "Slide or tip")
def highest_push(radius, mu):
    return radius / mu


highest_push.check(
    "any mug", lambda rng: (float(rng.uniform(0.02, 0.05)), float(rng.uniform(0.1, 1)))
)
highest_push.check(
    "a smooth table lets you push anywhere",
    lambda rng: (float(rng.uniform(0.02, 0.05)), float(rng.uniform(0.01, 0.05))),
)
highest_push.mistake("You divide the wrong way round: r / mu.", "radius / mu", "mu / radius")
highest_push.mistake("The mug's foot is the argument, not always 3 cm.", "radius / mu", "0.03 / mu")
highest_push.mistake(
    "The weight m g stands on both sides and drops out: gravity is not in the answer.",
    "radius / mu",
    "radius * 9.81 / mu",
)
highest_push.mistake(
    "The weight m g stands on both sides and drops out: gravity is not in the answer.",
    "radius / mu",
    "radius / (mu * 9.81)",
)
highest_push.mistake(
    "A rougher table makes it tip sooner: divide by mu.", "radius / mu", "radius * mu"
)
highest_push.mistake(
    "It turns about the edge of its foot, one radius from the middle, not two.",
    "radius / mu",
    "2 * radius / mu",
)
highest_push.mistake(
    "The weight acts in the middle, a whole radius from the edge, not half of one.",
    "radius / mu",
    "radius / (2 * mu)",
)
highest_push.mistake(
    "The height is in m, as the radius is; yours is in cm.",
    "radius / mu",
    "100 * radius / mu",
)
highest_push.mistake(
    "// cuts off what is behind the point: divide with /.",
    "radius / mu",
    "radius // mu",
)


@exercise("8.4", "What the background does to a keypoint")
def disturbance(z_a, z_b, size):
    return np.linalg.norm(z_a - z_b, axis=-1).mean(0) * size / 2


def _pair(rng):
    z = rng.uniform(-1, 1, (*rng.integers((6, 2), (18, 8)), 2))
    return z, z + rng.normal(0, 0.03, z.shape), int(rng.integers(40, 250))


disturbance.check(
    "two videos that differ a little",
    _pair,
    points=2,
    least=lambda rng: ((p := _pair(rng))[0][:1, :1], p[1][:1, :1], p[2]),
)
disturbance.check("two equal ones", lambda rng: ((p := _pair(rng))[0], p[0].copy(), p[2]))
disturbance.mistake("The picture's width is `size`, not always 84.", "* size", "* 84")
disturbance.mistake(
    "One number a keypoint: the mean goes over frames, axis 0; yours goes over the keypoints.",
    ".mean(0)",
    ".mean(1)",
)
disturbance.mistake("The mean over the frames, not their sum.", ".mean(0)", ".sum(0)")
disturbance.mistake(
    "In pixels: 2 units of z are `size` pixels; yours are units of z.", " * size / 2", ""
)
disturbance.mistake(
    "A distance is the norm, with its root: yours is squared.",
    "np.linalg.norm(z_a - z_b, axis=-1)",
    "((z_a - z_b) ** 2).sum(-1)",
)
disturbance.mistake(
    "Take each frame's distance, then the mean; yours is the root of the mean square.",
    "np.linalg.norm(z_a - z_b, axis=-1).mean(0)",
    "np.sqrt(((z_a - z_b) ** 2).sum(-1).mean(0))",
)
disturbance.mistake(
    "From -1 to 1 are 2 units over `size` pixels: half of size for each.", "* size / 2", "* size"
)
disturbance.mistake(
    "-1 and 1 are the edges of the picture, `size` pixels apart, not the centres of its outer "
    "pixels.",
    "* size / 2",
    "* (size - 1) / 2",
)
disturbance.mistake("One number a keypoint: the mean goes over frames only.", ".mean(0)", ".mean()")
disturbance.mistake(
    "A shift to the left and one to the right do not cancel: take each frame's distance first.",
    "np.linalg.norm(z_a - z_b, axis=-1).mean(0)",
    "np.linalg.norm((z_a - z_b).mean(0), axis=-1)",
)
disturbance.mistake(
    "x and y belong together: the distance is the root of the sum of their squares, not their sum.",
    "np.linalg.norm(z_a - z_b, axis=-1)",
    "np.abs(z_a - z_b).sum(-1)",
)
disturbance.mistake(
    "One distance for x and y together: the norm over both, not their mean.",
    "np.linalg.norm(z_a - z_b, axis=-1)",
    "np.abs(z_a - z_b).mean(-1)",
)
