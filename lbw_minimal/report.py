"""The page of a run: what the human showed, what perception made of it, what the robot learnt.

In: frames (T, 84, 84, 3) uint8, keypoints z (T, K, 2) in [-1, 1] (x right, y down), logs, figures.
Out: one HTML file that needs no other file and no network, for readers who have never seen the
paper. Each picture is a function of its own, for notebooks, in Okabe and Ito's colours, which
colour-blind readers tell apart.
"""

from __future__ import annotations

import base64
import io
from html import escape
from pathlib import Path

import cv2
import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from PIL import Image

from lbw_minimal.training import write_atomic

COLOURS = ("#E69F00", "#0072B2", "#009E73", "#CC79A7", "#D55E00", "#56B4E9", "#F0E442", "#000000")
MACHINE = ("machine", "memory_mb")  # of metrics.json, beside the settings
STYLE = {
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "legend.frameon": False,
    "legend.fontsize": 9,
    "figure.constrained_layout.use": True,
    "svg.hashsalt": "lbw",  # else the same figure gives another file each time
}


def wilson(successes: int, n: int) -> tuple[float, float]:
    """The 95 % confidence interval of a success rate (Wilson 1927); honest at 0 and at n of n, too.

    Raises ValueError unless 0 <= successes <= n and n >= 1.
    """
    if not 0 <= successes <= n or n < 1:
        raise ValueError(f"{successes} successes of {n}: give 0 <= successes <= n and n >= 1.")
    z2, rate = 1.959964**2, successes / n
    centre = (rate + z2 / (2 * n)) / (1 + z2 / n)
    half = np.sqrt(z2 * (rate * (1 - rate) / n + z2 / (4 * n * n))) / (1 + z2 / n)
    return max(0.0, float(centre - half)), min(1.0, float(centre + half))


def colour(k: int) -> tuple[int, int, int]:
    """RGB of keypoint k, the same in every picture."""
    return tuple(bytes.fromhex(COLOURS[k % len(COLOURS)][1:]))


def draw_keypoints(frames: np.ndarray, z: np.ndarray, scale: int = 4) -> np.ndarray:
    """Frames (T, H, W, 3) enlarged `scale` times, with keypoints z (T, K, 2) on them, numbered from
    1."""
    out = enlarge(frames, scale)
    h, w = out.shape[1:3]
    for image, points in zip(out, z, strict=True):
        # z counts from edge to edge, pixels from centre to centre; OpenCV takes sixteenths of a
        # pixel.
        for k, (x, y) in enumerate(((points + 1) / 2 * (w, h) - 0.5).tolist()):
            at = round(16 * x), round(16 * y)
            for radius, paint in ((2.6, (0, 0, 0)), (2.3, (255, 255, 255)), (1.8, colour(k))):
                cv2.circle(image, at, round(radius * scale * 16), paint, -1, cv2.LINE_AA, shift=4)
            if scale >= 4:  # below, a digit would not be legible
                corner, size = (round(x - 0.9 * scale), round(y + 1.1 * scale)), 0.1 * scale
                cv2.putText(
                    image,
                    str(k + 1),
                    corner,
                    cv2.FONT_HERSHEY_SIMPLEX,
                    size,
                    ink(k),
                    1,
                    cv2.LINE_AA,
                )
    return out


def ink(k: int) -> tuple[int, int, int]:
    """Black or white, whichever reads better on keypoint k's colour."""
    return (0, 0, 0) if np.dot(colour(k), (0.3, 0.6, 0.1)) > 110 else (255, 255, 255)


def enlarge(frames, scale):
    """Every pixel as a square: what is shown is what the networks see."""
    return np.repeat(np.repeat(frames, scale, axis=1), scale, axis=2)


def spread(T: int, n: int) -> np.ndarray:
    """At most n of the indices 0 .. T - 1, evenly, first and last included."""
    return np.linspace(0, T - 1, min(n, T)).round().astype(int)


def strip(
    frames: np.ndarray, z: np.ndarray | None = None, n: int = 8, scale: int = 3
) -> np.ndarray:
    """n frames side by side, (scale H, n scale W, 3): a video at one glance, keypoints on it where
    given."""
    i = spread(len(frames), n)
    tiles = enlarge(frames[i], scale) if z is None else draw_keypoints(frames[i], z[i], scale)
    return np.concatenate(tiles, axis=1)


def curve(log: list[dict], form: str = "mended", last: int = 10) -> Figure:
    """Success and return of the training episodes over environment steps; log: rows of
    `sac.train`."""
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
    """Paths of the demonstration's keypoints (N, K, 2), dashed, and the robot's (T, K, 2) in the
    image."""
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
            axis.text(*z[-1, k], k + 1, ha="center", va="center_baseline", fontsize=8, color=text)
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
                axis.plot(
                    np.linspace(0, 1, len(z_demo)), z_demo[:, k, i], "--", color=paint, lw=1.5
                )
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
    """The parts of the reward over an episode, rows one a step; success: the first step it was done
    at."""
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
            axis.annotate(
                " task done", (success / fps, 0.03), xycoords=("data", "axes fraction"), fontsize=9
            )
        axis.set(xlabel="time in the episode (s)", ylabel="part of the reward a step")
        axis.set_ylim(top=max(0, axis.get_ylim()[1]))  # 0 is the best there is
        figure.legend(loc="outside upper center", ncols=4)
    return figure


CSS = """
:root { color-scheme: light }
* { box-sizing: border-box }
body { margin: 0 auto; max-width: 56rem; padding: 1rem 1rem 4rem; background: #fff; color: #1b1b1b;
       font: 1rem/1.55 system-ui, sans-serif }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 1rem 0 .5rem }
h2 { font-size: 1.25rem; margin: 2.6rem 0 .4rem; border-top: 1px solid #ddd; padding-top: 1.2rem }
p, ol { max-width: 44rem; margin: .5rem 0 }
img, iframe { max-width: 100%; border: 0; display: block }
iframe { width: 100%; height: min(26rem, 65vh) }
.tiles, .row { display: flex; flex-wrap: wrap; gap: .75rem; margin: 1rem 0 }
.tiles div { flex: 1 1 8rem; background: #f2f4f7; border-radius: 8px; padding: .6rem .9rem }
.tiles b { display: block; font-size: 1.35rem }
.tiles span, figcaption, .small { color: #555; font-size: .85rem }
.row > img { flex: 1 1 20rem; min-width: 0 }
.strip { display: grid; grid-template-columns: repeat(8, 1fr); gap: .5rem .3rem; margin: 1rem 0 }
@media (max-width: 40rem) { .strip { grid-template-columns: repeat(4, 1fr) } }
.strip figure { margin: 0; text-align: center }
.strip img { width: 100% }
.note { background: #fff3d6; border-left: 4px solid #E69F00; padding: .5rem .9rem }
table { border-collapse: collapse; margin: .8rem 0; font-size: .92rem; display: block; overflow-x: auto }
th, td { text-align: left; padding: .25rem 1.1rem .25rem 0; border-bottom: 1px solid #e4e4e4 }
pre { white-space: pre-wrap; background: #f2f4f7; border-radius: 8px; padding: .7rem .9rem; overflow-x: auto }
@media print { .scene { display: none } h2, figure, img, tr { break-inside: avoid } }
"""

INTRODUCTION = """
<p>A human arm did the task once, in front of a camera. From that video a robot is to learn it:</p>
<ol>
<li>A first network <b>translates</b> the video: it repaints the human arm as the robot's.</li>
<li>A second one finds <b>keypoints</b> on the translated video: a few spots that follow arm and object.
Nobody told it which.</li>
<li>The robot tries, over and over. The nearer its own keypoints come to the demonstrated ones, the higher
its <b>reward</b>.</li>
</ol>
<p>No action of the human was recorded, and nobody told the robot what success is.</p>
"""

DEMONSTRATION = """
<p>Above: the human video, from left to right. Below: the same moments as the translation network repaints
them, with the keypoints found there. Look for two things. The robot's arm should stand where the human's
does, and the object should still be there. A dot of one colour should stay on the same part of the arm, or
on the object, in every column.</p>
"""

EPISODE = """
<p>The first test episode at half speed, as the robot's camera sees it. The numbered dots are the keypoints
it steers by: all it knows of the scene.</p>
"""

PATHS = """
<p>Dashed: where each keypoint went in the demonstration. Solid: where it goes in the robot's test episode,
from the white dot to the numbered one. A solid line that runs along the dashed one of its colour is
imitation. The robot keeps its own pace, so compare the shapes of the paths, and where they end.</p>
"""

SCENE = """
<p>Drag to turn the scene, drag with the right button to shift it; after a click the wheel zooms. <i>Open
Controls</i> stops the film and steps through it.</p>
"""

LEARNING = """
<p>Each grey dot is one attempt of the robot while it was learning, with some chance in its actions. Look for
the blue line of the upper picture to climb towards 1. In the lower picture, a return nearer to 0 follows the
demonstration more closely. The literal reward is Eq. 8-10 as the paper states them; the mended one adds what
makes them learn. Success is only counted here; it is no part of the reward.</p>
"""

REWARD = """
<p>The two parts of what the robot earned at each step of the test episode: r1 for being where the
demonstration is, r2 for moving as the demonstration moves. In the sum r2 counts three times. Both are at
most 0, and 0 means exactly as in the demonstration. Look for r1 to stay near 0, or to come back to it, until
the end.</p>
"""

PERCEPTION = """
<p>How well the keypoints tell where things are: R² of a straight-line fit from them to the true pixel of
the gripper's tip and of the object (1 is perfect), and in brackets the usual error in pixels. <i>robot</i>:
on robot frames. <i>translated</i>: on translated human frames. <i>transfer</i>: the fit of the robot frames,
used on translated ones. A dash: it did not move.</p>
"""


def write_report(
    path: Path | str,
    *,
    task: str,
    demo: np.ndarray,
    translated: np.ndarray,
    z_demo: np.ndarray,
    log: list[dict] | None = None,
    episode: dict | None = None,
    metrics: dict | None = None,
    scene_html: str | None = None,
    command: str | None = None,
    fps: float = 25,
) -> None:
    """Write the page of a run, whole or not at all; what is None or empty is left out.

    demo, translated: (N, 84, 84, 3) uint8; z_demo (N, K, 2): the keypoints found on `translated`.
    log: the policy's, a row an episode. episode: a test episode's "frames" (T, 84, 84, 3) uint8,
    "z" (T, K, 2) (or observations whose first 2K numbers are z), and "parts", a dict of reward
    parts a step. metrics: as in metrics.json: "success", "episodes", "stages" in s, "perception",
    "settings", "machine". scene_html: a page of its own. command: what makes this run again.
    """
    metrics, episode = metrics or {}, episode or {}
    episodes, form = (
        metrics.get("episodes", []),
        metrics.get("settings", {}).get("reward", "mended"),
    )
    page = [headline(task, metrics, form)]
    columns = demonstration(demo, translated, z_demo, fps)
    page += section("What the human showed, and what the robot saw in it", DEMONSTRATION, columns)
    if "frames" in episode:
        frames, K = episode["frames"], z_demo.shape[1]
        z = np.asarray(episode["z"], float).reshape(len(frames), -1)[:, : 2 * K].reshape(-1, K, 2)
        shown = picture(
            data_uri("image/webp", film(draw_keypoints(frames, z), fps / 2)),
            "Film of a test episode",
        )
        marks = " ".join("✓" if row["success"] else "✗" for row in episodes)
        marks = f'<p class="small">All test episodes, this one first: {marks}</p>' if marks else ""
        page += section("What the robot does now", EPISODE, shown, marks)
        pair = picture(svg(paths(z_demo, z, frames[-1])), "Paths of the keypoints in the image")
        pair += picture(svg(courses(z_demo, z)), "Coordinates of the keypoints over time")
        page += section(
            "Does it follow the demonstration?", PATHS, f'<div class="row">{pair}</div>'
        )
    if scene_html:
        frame = f'<iframe title="The episode in 3-D" srcdoc="{escape(scene_html)}"></iframe>'
        page += section("The same episode in three dimensions", SCENE, frame, kind="scene")
    if log and len(log) > 1:
        page += section(
            "How the robot learnt", LEARNING, picture(svg(curve(log, form)), "Learning curves")
        )
    if episode.get("parts"):
        done = episodes[0].get("first_success") if episodes else None
        shown = picture(svg(parts(episode["parts"], fps, done)), "Parts of the reward over time")
        page += section("The reward, step by step", REWARD, shown)
    page += figures(metrics)
    if command:
        page += section("To make this run again", f"<pre>{escape(command)}</pre>")
    head = f"""<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(task)}: learning by watching</title>
<style>{CSS}</style>"""
    html = f"""<!DOCTYPE html>
<html lang="en">
<head>
{head}
</head>
<body>
{"".join(page)}
</body>
</html>
"""
    write_atomic(path, html)


def section(title: str, *body: str, kind: str = "") -> list[str]:
    return [f'<section class="{kind}">\n<h2>{title}</h2>', *body, "</section>\n"]


def headline(task, metrics, form):
    """The result in large letters, its figures in tiles, and how it came about."""
    settings, result, name = (
        metrics.get("settings", {}),
        metrics.get("success"),
        escape(task).capitalize(),
    )
    title, tiles = f"{name}: a robot learns from one video", []
    if result:
        n = result["episodes"]
        title = f"{name}: {round(result['rate'] * n)} of {n} test episodes succeed"
        low, rate, high = (round(100 * result[name]) for name in ("low", "rate", "high"))
        tiles = [(f"{rate} %", "success rate"), (f"{low}-{high} %", "95 % confidence interval")]
    if stages := metrics.get("stages"):
        tiles += [(duration(sum(stages.values())), "of learning in this run")]
    tiles += [(str(settings[key]), key) for key in ("seed", "reward") if key in settings]
    cells = "".join(
        f"<div><b>{escape(value)}</b><span>{label}</span></div>" for value, label in tiles
    )
    note = (
        "This was a smoke run: every stage ran, none long enough to learn. Its figures say nothing."
    )
    note = f'<p class="note">{note}</p>' if settings.get("fast") else ""
    return f'<h1>{title}</h1>\n<div class="tiles">{cells}</div>\n{note}{INTRODUCTION}'


def demonstration(demo, translated, z_demo, fps):
    """As the paper's Fig. 5: human frames above their translations, in columns that wrap when
    narrow."""
    i, columns = spread(len(demo), 8), []
    pairs = np.concatenate(
        [enlarge(demo[i], 3), draw_keypoints(translated[i], z_demo[i], 3)], axis=1
    )
    for t, both in zip(i, pairs, strict=True):
        shown = picture(png(both), f"Frame {t + 1} of the human and its translation with keypoints")
        columns.append(f"<figure>{shown}<figcaption>{t / fps:.1f} s</figcaption></figure>")
    return f'<div class="strip">{"".join(columns)}</div>'


def figures(metrics):
    """Tables of times, perception and settings, as far as there are any."""
    page = []
    if stages := metrics.get("stages"):
        rows = [*stages.items(), ("together", sum(stages.values()))]
        page += section("Time", table([(name, duration(seconds)) for name, seconds in rows]))
    if perception := metrics.get("perception"):
        scores = {
            name: column for name, column in perception.items()
            if isinstance(column, dict) and all(isinstance(v, dict) and "r2" in v for v in column.values())
        }  # fmt: skip
        names = dict.fromkeys(name for column in scores.values() for name in column)
        rows = [(name, *(score(column.get(name)) for column in scores.values())) for name in names]
        rest = {name: value for name, value in perception.items() if name not in scores}
        page += section(
            "Perception, measured", PERCEPTION, table([("", *scores), *rows]), table(flat(rest))
        )
    settings = flat(metrics.get("settings", {})) + flat(
        {k: v for k, v in metrics.items() if k in MACHINE}
    )
    return page + (section("Settings", table(settings)) if settings else [])


def score(value) -> str:
    """R² and error of one coordinate, or a dash for what does not move."""
    return f"{value['r2']:.3f} ({value['px']:.1f})" if value and value["r2"] is not None else "-"


def flat(tree, name: str = "") -> list[tuple[str, str]]:
    """Nested figures as rows of name and value."""
    if isinstance(tree, dict):
        return [row for key, value in tree.items() for row in flat(value, f"{name} {key}".strip())]
    values = tree if isinstance(tree, list) else [tree]
    return [(name, ", ".join(f"{v:.3g}" if isinstance(v, float) else str(v) for v in values))]


def duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.1f} min"


def table(rows: list[tuple[str, ...]]) -> str:
    """Rows of text, names with spaces for underscores."""
    lines = []
    for name, *values in rows:
        lines.append(
            "<tr>"
            + "".join(f"<td>{escape(c)}</td>" for c in (name.replace("_", " "), *values))
            + "</tr>"
        )
    return f"<table>{''.join(lines)}</table>" if rows else ""


def picture(uri: str, alt: str) -> str:
    return f'<img src="{uri}" alt="{alt}">'


def data_uri(kind: str, data: bytes) -> str:
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


def film(frames: np.ndarray, fps: float) -> bytes:
    """Frames (T, H, W, 3) as an animated WebP, which all browsers show; it loops and rests at its
    end."""
    first, *rest = map(Image.fromarray, frames)
    out, times = io.BytesIO(), [round(1000 / fps)] * len(rest) + [1000]  # ms
    first.save(out, "WEBP", save_all=True, append_images=rest, duration=times, loop=0, quality=80)
    return out.getvalue()
