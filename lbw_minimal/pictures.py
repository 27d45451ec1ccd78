"""Pictures of what the method sees and does, for notebooks and for the page of a run.

In: frames (T, 84, 84, 3) uint8, keypoints z (T, K, 2) in [-1, 1] (x right, y down), logs. Out:
images, figures, and each of them as a data URI. The colours are Okabe and Ito's, which
colour-blind readers can tell apart.
"""

from __future__ import annotations

import base64
import io
from typing import Any

import cv2
import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

COLOURS = ("#E69F00", "#0072B2", "#009E73", "#CC79A7", "#D55E00", "#56B4E9", "#F0E442", "#000000")
STYLE: dict[Any, Any] = {
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "legend.frameon": False,
    "legend.fontsize": 9,
    "figure.constrained_layout.use": True,
    "svg.hashsalt": "lbw",  # or the same figure gives a different file each time
}


def colour(k: int) -> tuple[int, int, int]:
    """RGB of keypoint k, the same in every picture."""
    r, g, b = bytes.fromhex(COLOURS[k % len(COLOURS)][1:])
    return r, g, b


def draw_keypoints(frames: np.ndarray, z: np.ndarray, scale: int = 4) -> np.ndarray:
    """Frames (T, H, W, 3) enlarged `scale` times, with keypoints z (T, K, 2), numbered from 1."""
    out = enlarge(frames, scale)
    h, w = out.shape[1:3]
    for image, points in zip(out, z, strict=True):
        # z counts from edge to edge, pixels from centre to centre. OpenCV takes sixteenths of a
        # pixel.
        for k, (x, y) in enumerate(((points + 1) / 2 * (w, h) - 0.5).tolist()):
            at = round(16 * x), round(16 * y)
            for radius, paint in ((2.6, (0, 0, 0)), (2.3, (255, 255, 255)), (1.8, colour(k))):
                cv2.circle(image, at, round(radius * scale * 16), paint, -1, cv2.LINE_AA, shift=4)
            if scale >= 4:  # below, a digit would not be legible
                corner, size = (round(x - 0.9 * scale), round(y + 1.1 * scale)), 0.1 * scale
                font, smooth = cv2.FONT_HERSHEY_SIMPLEX, cv2.LINE_AA
                cv2.putText(image, str(k + 1), corner, font, size, ink(k), 1, smooth)
    return out


def ink(k: int) -> tuple[int, int, int]:
    """Black or white, whichever reads better on keypoint k's colour."""
    return (0, 0, 0) if np.dot(colour(k), (0.3, 0.6, 0.1)) > 110 else (255, 255, 255)


def enlarge(frames: np.ndarray, scale: int) -> np.ndarray:
    """Every pixel as a square: what is shown is what the networks see."""
    return np.repeat(np.repeat(frames, scale, axis=1), scale, axis=2)


def spread(T: int, n: int) -> np.ndarray:
    """At most n of the indices 0 .. T - 1, evenly, first and last included."""
    return np.linspace(0, T - 1, min(n, T)).round().astype(int)


def strip(
    frames: np.ndarray, z: np.ndarray | None = None, n: int = 8, scale: int = 3
) -> np.ndarray:
    """A video at one glance: n of its frames side by side, (scale H, n scale W, 3).

    Keypoints z (T, K, 2) are drawn on them if given.
    """
    i = spread(len(frames), n)
    tiles = enlarge(frames[i], scale) if z is None else draw_keypoints(frames[i], z[i], scale)
    return np.concatenate(tiles, axis=1)


def curve(log: list[dict], form: str = "mended", last: int = 10) -> Figure:
    """Success and return of the training episodes over environment steps.

    log: what `sac.train` returned; last: episodes that the mean runs over.
    """
    steps = np.array([row["step"] for row in log])
    with rc_context(STYLE):
        figure = Figure(figsize=(6.4, 4.4))
        above, below = figure.subplots(2, sharex=True)
        for axis, name, label in (
            (above, "success", "share of episodes\nthat succeed"),
            (below, "return", "return\n(sum of the rewards)"),
        ):
            values = np.array([row[name] for row in log], float)
            mean = [values[max(0, i + 1 - last) : i + 1].mean() for i in range(len(values))]
            axis.plot(steps, values, ".", color="#9a9a9a", ms=4, label="one episode")
            axis.plot(steps, mean, color=COLOURS[1], lw=2, label=f"mean of the last {last}")
            axis.set_ylabel(label)
        above.set(ylim=(-0.05, 1.05), title=f"Learning with {form} reward")
        below.set_xlabel("environment steps")
        below.legend(loc="lower right")
    return figure


def paths(z_demo: np.ndarray, z: np.ndarray, background: np.ndarray | None = None) -> Figure:
    """Paths of the demonstration's keypoints (N, K, 2), dashed, and of the robot's (T, K, 2)."""
    with rc_context(STYLE):
        figure = Figure(figsize=(4.8, 4.8))
        axis = figure.subplots()
        if background is not None:
            axis.imshow(background // 2 + 127, extent=(-1, 1, 1, -1))
        for k in range(z.shape[1]):
            paint = np.array(colour(k)) / 255
            axis.plot(*z_demo[:, k].T, "--", color=paint, lw=1.5)
            axis.plot(*z[:, k].T, color=paint, lw=2)
            axis.plot(*z[0, k], "o", color=paint, mfc="white", ms=6)
            axis.plot(*z[-1, k], "o", color=paint, mec="black", ms=12)
            text = np.array(ink(k)) / 255
            x, y = z[-1, k]
            label = axis.text(x, y, str(k + 1), fontsize=8, color=text)
            label.set(ha="center", va="center_baseline")
        ticks = (-1, -0.5, 0, 0.5, 1)
        axis.set(xlim=(-1, 1), ylim=(1, -1), xticks=ticks, yticks=ticks, aspect="equal")
        axis.set(
            xlabel="x, from left to right (half images)",
            ylabel="y, from top to bottom (half images)",
        )
        axis.grid(False)
    return figure


def courses(z_demo: np.ndarray, z: np.ndarray) -> Figure:
    """x and y of the same keypoints over the share of each video that has passed."""
    with rc_context(STYLE):
        figure = Figure(figsize=(4.8, 4.8))
        above, below = figure.subplots(2, sharex=True)
        for i, (axis, name) in enumerate(((above, "x"), (below, "y"))):
            for k in range(z.shape[1]):
                paint = np.array(colour(k)) / 255
                t = np.linspace(0, 1, len(z_demo))
                axis.plot(t, z_demo[:, k, i], "--", color=paint, lw=1.5)
                axis.plot(np.linspace(0, 1, len(z)), z[:, k, i], color=paint, lw=2, label=k + 1)
            axis.set(ylabel=f"{name} (half images)", xlim=(0, 1))
        below.invert_yaxis()  # down is down, as in the image
        below.set_xlabel("share of the video that has passed")
        lines, names = above.get_legend_handles_labels()
        figure.legend(
            lines, names, title="keypoint", loc="outside upper center", ncols=8, handlelength=1
        )
    return figure


def parts(rows: list[dict], fps: float = 25, success: int | None = None) -> Figure:
    """The parts of the reward over an episode.

    rows: a dict of parts for each step; success: the first step at which the task was done.
    """
    t = np.arange(1, len(rows) + 1) / fps
    with rc_context(STYLE):
        figure = Figure(figsize=(6.4, 3.2))
        axis = figure.subplots()
        for k, name in enumerate(rows[0]):
            kind = ("-", "--", "-.", ":")[k % 4]
            values = [row[name] for row in rows]
            axis.plot(t, values, kind, color=COLOURS[(1, 0, 2, 3)[k % 4]], lw=2, label=name)
        if success:
            axis.axvline(success / fps, color="black", lw=1)
            where = ("data", "axes fraction")
            said = axis.annotate("task done", (success / fps, 1.01), xycoords=where, fontsize=9)
            said.set(ha="center", va="bottom")  # off the curves
        axis.set(xlabel="time in the episode (s)", ylabel="part of the reward a step")
        axis.set_ylim(top=max(0, axis.get_ylim()[1]))  # 0 is the best there is
        figure.legend(loc="outside upper center", ncols=4)
    return figure


def picture(uri: str, alt: str) -> str:
    """An image element of a page; alt: what it shows, for those who cannot see it."""
    return f'<img src="{uri}" alt="{alt}">'


def data_uri(kind: str, data: bytes) -> str:
    """Data of a MIME type such as "image/png" as a URI that stands in for a file."""
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def png(image: np.ndarray) -> str:
    """An RGB image as a data URI."""
    return data_uri("image/png", cv2.imencode(".png", image[..., ::-1])[1].tobytes())


def svg(figure: Figure) -> str:
    """A figure as a data URI."""
    out = io.BytesIO()
    with rc_context(STYLE):
        figure.savefig(out, format="svg", metadata={"Date": None})
    return data_uri("image/svg+xml", out.getvalue())
