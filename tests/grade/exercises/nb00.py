"""Notebook 0, start here: pixels, keypoints and success."""

import numpy as np

from tests.grade.exercise import exercise


@exercise("0.1", "How often did it work?")
def success_rate(distances, threshold):
    return float((distances < threshold).mean())


success_rate.check("ten episodes", lambda rng: (rng.uniform(0, 0.1, 10), 0.05))
success_rate.check(
    "any number of episodes, any threshold",
    lambda rng: (rng.uniform(0, 1, rng.integers(11, 40)), float(rng.uniform(0.2, 0.8))),
    least=lambda rng: (rng.uniform(0, 0.2, 1), 0.3),
)
success_rate.check("all of them", lambda rng: (rng.uniform(0, 0.04, 5), 0.05))
success_rate.check(
    "a distance equal to the threshold is not below it",
    lambda rng: (np.append(rng.choice([0.125, 0.25, 0.5], 11), 0.25), 0.25),
)
success_rate.mistake(
    "You count the failures: an episode succeeds where its distance is below the threshold.",
    "distances < threshold",
    "distances > threshold",
)
success_rate.mistake(
    "You return how many succeeded; a rate is that number divided by all episodes.",
    ".mean()",
    ".sum()",
)
success_rate.mistake(
    "You return per cent; a rate lies between 0 and 1.",
    "(distances < threshold).mean()",
    "100 * (distances < threshold).mean()",
)
success_rate.mistake(
    "You divide by ten; divide by the number of episodes there are.",
    "(distances < threshold).mean()",
    "(distances < threshold).sum() / 10",
)
success_rate.mistake("The threshold is the argument, not always 0.05.", "< threshold", "< 0.05")
success_rate.mistake(
    "You compare the mean distance: ask of each episode by itself, then take the mean of the "
    "answers.",
    "float((distances < threshold).mean())",
    "float(distances.mean() < threshold)",
)
success_rate.mistake(
    "You compare the mean distance: ask of each episode by itself, then take the mean of the "
    "answers.",
    "float((distances < threshold).mean())",
    "distances.mean() < threshold",
)
success_rate.mistake(
    "`len` counts the episodes, whatever became of them: the mean of truth values is the share of "
    "the true ones.",
    "(distances < threshold).mean()",
    "len(distances < threshold) / len(distances)",
)
success_rate.mistake(
    "One number for all episodes: you return a truth value for each.",
    "float((distances < threshold).mean())",
    "distances < threshold",
)
success_rate.mistake(
    "An episode at exactly the threshold is not below it: <, not <=.",
    "distances < threshold",
    "distances <= threshold",
)
success_rate.mistake(
    "You round: a share of one in three is 0.333..., not 0.3.",
    "float((distances < threshold).mean())",
    "round(float((distances < threshold).mean()), 1)",
)
success_rate.mistake(
    "// cuts off what is behind the point: divide with /.",
    ".mean()",
    ".sum() // len(distances)",
)
success_rate.mistake(
    "searchsorted counts right only where the distances are sorted: count those below the "
    "threshold.",
    "float((distances < threshold).mean())",
    "float(np.searchsorted(distances, threshold) / len(distances))",
)


@exercise("0.2", "From keypoint to pixel")
def to_pixels(z, size):
    return (z + 1) / 2 * size


to_pixels.check("keypoints anywhere", lambda rng: (rng.uniform(-1, 1, (5, 2)), 84))
to_pixels.check(
    "a whole trajectory, another size",
    lambda rng: (rng.uniform(-1, 1, (*rng.integers(3, 12, 2), 2)), int(rng.integers(90, 250))),
    least=lambda rng: (rng.uniform(-1, 1, (1, 1, 2)), int(rng.integers(90, 250))),
)
to_pixels.check(
    "the corners",
    lambda rng: (np.array([[-1.0, -1.0], [1.0, 1.0]]), int(rng.integers(20, 100))),
)
to_pixels.mistake("The picture's width is `size`, not always 84.", "* size", "* 84")
to_pixels.mistake(
    "Do not round: a keypoint may lie between two pixels.",
    "(z + 1) / 2 * size",
    "((z + 1) / 2 * size).astype(int)",
)
to_pixels.mistake(
    "Do not round: a keypoint may lie between two pixels.",
    "(z + 1) / 2 * size",
    "np.round((z + 1) / 2 * size)",
)
to_pixels.mistake(
    "The middle, 0, belongs at half of `size`: halve both summands, (z + 1) / 2.",
    "(z + 1) / 2",
    "(z / 2 + 1)",
)
to_pixels.mistake(
    "y already runs down in keypoints, as rows do in a picture: do not flip it.",
    "return (z + 1) / 2 * size",
    "z = z * (1, -1)\n    return (z + 1) / 2 * size",
)
to_pixels.mistake(
    "-1 is the left edge, so it becomes pixel 0: add 1 before you scale.",
    "(z + 1) / 2 * size",
    "z / 2 * size",
)
to_pixels.mistake(
    "From -1 to 1 it is 2 units, from edge to edge `size` pixels: halve.", "(z + 1) / 2", "(z + 1)"
)
to_pixels.mistake(
    "-1 and 1 are the edges of the picture, `size` pixels apart, not the centres of its outer "
    "pixels.",
    "/ 2 * size",
    "/ 2 * (size - 1)",
)
to_pixels.mistake(
    "Pixels are counted from 0 at the edge, not from a pixel's centre: take no half off.",
    "(z + 1) / 2 * size",
    "(z + 1) / 2 * size - 0.5",
)
to_pixels.mistake(
    "Pixels are counted from 0 here, at the left and upper edge, to `size`: yours from 1.",
    "(z + 1) / 2 * size",
    "(z + 1) / 2 * (size - 1) + 1",
)
to_pixels.mistake(
    "x comes first in both: column before row.",
    "(z + 1) / 2 * size",
    "(z[..., ::-1] + 1) / 2 * size",
)
to_pixels.mistake(
    "Half of an odd size is no whole number: divide by 2 with /, not with //.",
    "(z + 1) / 2 * size",
    "(z + 1) * (size // 2)",
)
