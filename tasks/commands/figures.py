"""The paper's figures, made of frames and results of this kit.

In: frames (T, 84, 84, 3) uint8, keypoints z (T, K, 2) in [-1, 1], results. Out: Matplotlib figures.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lbw_minimal.pictures import COLOURS, STYLE, spread
from lbw_minimal.report import wilson

LINES = ("-", "--", "-.", ":")


def _show(axis: Axes, image: np.ndarray, title: str = "") -> None:
    axis.imshow(image)
    axis.set(xticks=[], yticks=[], title=title)
    axis.title.set_fontsize(9)
    for side in axis.spines.values():
        side.set_visible(False)


def overview(pairs: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> Figure:
    """The paper's task overview: for each task a frame of the human above one of the robot."""
    with rc_context(STYLE):
        figure = Figure(figsize=(1.7 * len(pairs), 3.7))
        axes = figure.subplots(2, len(pairs), squeeze=False)
        for column, (task, (human, robot)) in zip(axes.T, pairs.items(), strict=True):
            _show(column[0], human, task)
            _show(column[1], robot)
        axes[0, 0].set_ylabel("human video")
        axes[1, 0].set_ylabel("robot's camera")
    return figure


def strips(rows: Mapping[str, np.ndarray], n: int = 6) -> Figure:
    """Some moments of films (T, H, W, 3) of equal length, one below the other, as in Figure 5."""
    i = spread(len(next(iter(rows.values()))), n)
    with rc_context(STYLE):
        figure = Figure(figsize=(1.5 * len(i), 1.55 * len(rows)))
        axes = figure.subplots(len(rows), len(i), squeeze=False)
        for line, (name, frames) in zip(axes, rows.items(), strict=True):
            for axis, frame in zip(line, frames[i], strict=True):
                _show(axis, frame)
            line[0].set_ylabel(name, fontsize=9)
    return figure


def over_jitter(found: Mapping[str, Mapping[str, Mapping[str, int]]], episodes: int) -> Figure:
    """Success of the policy and its controls over start jitter, with 95 % intervals.

    found: task -> jitter in m, as text -> robot -> successes of `episodes`.
    """
    with rc_context(STYLE):
        figure = Figure(figsize=(2.5 * len(found), 3.2))
        axes = figure.subplots(1, len(found), sharey=True, squeeze=False)[0]
        for axis, (task, by_jitter) in zip(axes, found.items(), strict=True):
            x = [1000 * float(jitter) for jitter in by_jitter]
            for k, robot in enumerate(next(iter(by_jitter.values()))):
                wins = [row[robot] for row in by_jitter.values()]
                low, high = zip(*(wilson(n, episodes) for n in wins), strict=True)
                paint = COLOURS[k % len(COLOURS)]
                share = np.array(wins) / episodes
                line = {"marker": "o", "ms": 3, "color": paint, "lw": 2.5 if k == 0 else 1.2}
                axis.plot(x, share, LINES[k // 3 % 4], label=robot, **line)
                axis.fill_between(x, low, high, color=paint, alpha=0.12, lw=0)
            axis.set(title=task, xlabel="start jitter (mm)", xscale="log", ylim=(-0.03, 1.03))
            axis.set_xticks(x, [f"{v:g}" for v in x])
            axis.minorticks_off()
        axes[0].set_ylabel("success")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def over_steps(logs: Mapping[str, Mapping[str, Sequence[list[dict]]]], last: int = 20) -> Figure:
    """Share of training episodes that succeed over environment steps, a line a run.

    logs: task -> method -> logs of its runs, as `sac.train` returns them. last: episodes that the
    mean runs over, a quarter of them at first. A method that has not got there yet is seen to be
    on its way, or not.
    """
    with rc_context(STYLE):
        figure = Figure(figsize=(2.5 * len(logs), 2.9))
        axes = figure.subplots(1, len(logs), sharey=True, squeeze=False)[0]
        for axis, (task, methods) in zip(axes, logs.items(), strict=True):
            for k, (name, runs) in enumerate(methods.items()):
                for i, log in enumerate(runs):
                    hits = np.array([row["success"] for row in log], float)
                    ends = range(min(max(1, last // 4), len(hits)), len(hits) + 1)
                    mean = [hits[max(0, end - last) : end].mean() for end in ends]
                    steps = [log[end - 1]["step"] for end in ends]
                    label = name if i == 0 else None
                    axis.plot(steps, mean, LINES[k % 4], color=COLOURS[k + 1], lw=1.3, label=label)
            axis.set(title=task, xlabel="environment steps", ylim=(-0.03, 1.03))
        axes[0].set_ylabel(f"success, mean of {last} episodes")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
