"""The method in one picture, as the paper's Figure 2, made of real frames.

In: frames (84, 84, 3) uint8 and their keypoints (K, 2) in [-1, 1]. Out: a Matplotlib figure, narrow
and in large type, so that it can be read on a phone.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lbw_minimal.pictures import STYLE, draw_keypoints, enlarge

WIDE, HIGH, SIDE = 5.5, 4.0, 1.25  # inches: the figure, and a frame in it
LEFT = (0.1, 2.12, 4.14)  # where its three columns begin
TOP, BOTTOM = 2.4, 0.1  # where the frames of its two rows stand
REWARD = 1.83  # the height of its box
ARROW = {"arrowstyle": "-|>", "lw": 1.4, "shrinkA": 0, "shrinkB": 0}


def method(
    human: np.ndarray, translated: np.ndarray, z_E: np.ndarray, robot: np.ndarray, z: np.ndarray
) -> Figure:
    """The method from frames (84, 84, 3) and keypoints (K, 2) of the moments they show.

    Above, the human video on its way to a keypoint trajectory; below, the robot's observation on
    its way to an action; between them the reward.
    """
    detected = draw_keypoints(np.stack([translated, robot]), np.stack([z_E, z]), 4)
    plain = enlarge(np.stack([human, translated, robot]), 4)
    with rc_context(STYLE | {"figure.constrained_layout.use": False}):
        figure = Figure(figsize=(WIDE, HIGH))
        page = figure.add_axes((0, 0, 1, 1))
        page.axis("off")
        for x, y, image, title in (
            (LEFT[0], TOP, plain[0], "human $x_i^E$"),
            (LEFT[1], TOP, plain[1], "translated $v_i^E$"),
            (LEFT[2], TOP, detected[0], "keypoints $z_i^E$"),
            (LEFT[0], BOTTOM, plain[2], "robot $O_t$"),
            (LEFT[1], BOTTOM, detected[1], "keypoints $z_t$"),
        ):
            page.imshow(image, extent=(x, x + SIDE, y, y + SIDE), aspect="equal")
            page.text(x + SIDE / 2, y + SIDE + 0.07, title, ha="center", fontsize=11)
        _boxes(page)
        _arrows(page)
        page.set(xlim=(0, WIDE), ylim=(0, HIGH))  # imshow changed them
    return figure


def _boxes(page: Axes) -> None:
    """What is no frame: the reward and the action, in the last column."""
    box = {"boxstyle": "round,pad=0.35", "facecolor": "#f2f4f7", "edgecolor": "#888888"}
    for y, text in ((REWARD, "reward $r_t$, Eq. 8-10"), (BOTTOM + SIDE / 2, "action $a_t$")):
        x = LEFT[2] + SIDE / 2
        page.text(x, y, text, ha="center", va="center", fontsize=10, bbox=box)


def _arrows(page: Axes) -> None:
    """What leads from each to the next, and its name."""
    above, below = TOP + SIDE / 2, BOTTOM + SIDE / 2
    gaps = [(left + SIDE + 0.06, right - 0.06) for left, right in pairwise(LEFT)]
    for (x, u), y, name in (
        (gaps[0], above, "MUNIT\nEq. 1-5"),
        (gaps[1], above, "Trans-\nporter\nEq. 6-7"),
        (gaps[0], below, "Trans-\nporter"),
        ((gaps[1][0], 4.28), below, "policy $\\pi$"),
    ):
        page.annotate("", (u, y), (x, y), arrowprops=ARROW)
        page.text((x + u) / 2, y + 0.08, name, ha="center", va="bottom", fontsize=10)
    middle = LEFT[2] + SIDE / 2
    page.annotate("", (middle, REWARD + 0.2), (middle, TOP - 0.04), arrowprops=ARROW)
    page.annotate("", (middle, below + 0.2), (middle, REWARD - 0.2), arrowprops=ARROW)
    page.text(middle + 0.08, (below + REWARD) / 2, "SAC", va="center", fontsize=10)
    page.annotate("", (3.98, REWARD - 0.06), (LEFT[1] + SIDE, BOTTOM + SIDE), arrowprops=ARROW)
