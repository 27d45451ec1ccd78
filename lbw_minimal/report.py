"""The page of a run: what the human showed, what perception made of it, what the robot learnt.

In: frames (T, 84, 84, 3) uint8, keypoints z (T, K, 2) in [-1, 1] (x right, y down), logs, figures.
Out: one HTML file that needs no other file and no network, for readers who have never seen the
paper. Its pictures are those of `pictures.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from lbw_minimal.pictures import (
    courses,
    curve,
    data_uri,
    draw_keypoints,
    enlarge,
    film,
    parts,
    paths,
    picture,
    png,
    spread,
    svg,
)
from lbw_minimal.training import write_atomic

MACHINE = ("machine", "memory_mb")  # of metrics.json; the page shows them with the settings


def wilson(successes: int, n: int) -> tuple[float, float]:
    """The 95 % confidence interval of a success rate (Wilson 1927), honest even at 0 or n of n.

    Raises ValueError unless 0 <= successes <= n and n >= 1.
    """
    if not 0 <= successes <= n or n < 1:
        raise ValueError(f"{successes} successes of {n}: give 0 <= successes <= n and n >= 1.")
    z2, rate = 1.959964**2, successes / n
    centre = (rate + z2 / (2 * n)) / (1 + z2 / n)
    half = np.sqrt(z2 * (rate * (1 - rate) / n + z2 / (4 * n * n))) / (1 + z2 / n)
    return max(0.0, float(centre - half)), min(1.0, float(centre + half))


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
table { border-collapse: collapse; margin: .8rem 0; font-size: .92rem; display: block;
        overflow-x: auto }
th, td { text-align: left; padding: .25rem 1.1rem .25rem 0; border-bottom: 1px solid #e4e4e4 }
pre { white-space: pre-wrap; background: #f2f4f7; border-radius: 8px; padding: .7rem .9rem;
      overflow-x: auto }
@media print { .scene { display: none } h2, figure, img, tr { break-inside: avoid } }
"""

HTML = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{css}</style>
</head>
<body>
{body}
</body>
</html>
"""

INTRODUCTION = """
<p>A human arm did the task once, in front of a camera. From that video a robot is to learn
it:</p>
<ol>
<li>A first network <b>translates</b> the video: it repaints the human arm as the robot's.</li>
<li>A second one finds <b>keypoints</b> on the translated video: a few spots that follow arm and
object. Nobody told it which.</li>
<li>The robot tries, over and over. The nearer its own keypoints come to the demonstrated ones,
the higher its <b>reward</b>.</li>
</ol>
<p>No action of the human was recorded, and nobody told the robot what success is.</p>
"""

DEMONSTRATION = """
<p>Above: the human video, from left to right. Below: the same moments as the translation network
repaints them, with the keypoints found there. Look for two things. The robot's arm should stand
where the human's does, and the object should still be there. A dot of one colour should stay on
the same part of the arm, or on the object, in every column.</p>
"""

EPISODE = """
<p>The first test episode at half speed, as the robot's camera sees it. The numbered dots are the
keypoints it steers by: all it knows of the scene.</p>
"""

PATHS = """
<p>Dashed: where each keypoint went in the demonstration. Solid: where it goes in the robot's test
episode, from the white dot to the numbered one. A solid line that runs along the dashed one of
its colour is imitation. The robot keeps its own pace, so compare the shapes of the paths, and
where they end.</p>
"""

SCENE = """
<p>Drag to turn the scene, drag with the right button to shift it; after a click the wheel zooms.
<i>Open Controls</i> stops the film and steps through it.</p>
"""

LEARNING = """
<p>Each grey dot is one attempt of the robot while it was learning, with some chance in its
actions. Look for the blue line of the upper picture to climb towards 1. In the lower picture, a
return nearer to 0 follows the demonstration more closely. The literal reward is Eq. 8-10 as the
paper states them; the mended one adds what makes them learn. Success is only counted here; it is
no part of the reward.</p>
"""

REWARD = """
<p>The two parts of what the robot earned at each step of the test episode: r1 for being where the
demonstration is, r2 for moving as the demonstration moves. In the sum r2 counts three times. Both
are at most 0, and 0 means exactly as in the demonstration. Look for r1 to stay near 0, or to come
back to it, until the end.</p>
"""

PERCEPTION = """
<p>How well the keypoints tell where things are: R² of a straight-line fit from them to the true
pixel of the gripper's tip and of the object (1 is perfect), and in brackets the usual error in
pixels. <i>robot</i>: on robot frames. <i>translated</i>: on translated human frames.
<i>transfer</i>: the fit of the robot frames, used on translated ones. A dash: it did not
move.</p>
"""


SMOKE = "This was a smoke run: no stage ran long enough to learn. Its figures say nothing."


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
    log: the policy's, a row per episode. episode: a test episode's "frames" (T, 84, 84, 3) uint8,
    "z" (T, K, 2) (or observations whose first 2K numbers are z), and "parts", a dict of reward
    parts per step. metrics: as in metrics.json: "success", "episodes", "stages" in s, "perception",
    "settings", "machine". scene_html: a page of its own. command: what makes this run again.
    """
    metrics, episode = metrics or {}, episode or {}
    form = metrics.get("settings", {}).get("reward", "mended")
    page = [headline(task, metrics, form)]
    columns = demonstration(demo, translated, z_demo, fps)
    page += section("What the human showed, and what the robot saw in it", DEMONSTRATION, columns)
    if "frames" in episode:
        page += _test_episode(episode, z_demo, metrics.get("episodes", []), fps)
    if scene_html:
        frame = f'<iframe title="The episode in 3-D" srcdoc="{escape(scene_html)}"></iframe>'
        page += section("The same episode in three dimensions", SCENE, frame, kind="scene")
    if log and len(log) > 1:
        shown = picture(svg(curve(log, form)), "Learning curves")
        page += section("How the robot learnt", LEARNING, shown)
    if episode.get("parts"):
        done = metrics["episodes"][0].get("first_success") if metrics.get("episodes") else None
        shown = picture(svg(parts(episode["parts"], fps, done)), "Parts of the reward over time")
        page += section("The reward, step by step", REWARD, shown)
    page += figures(metrics)
    if command:
        page += section("To make this run again", f"<pre>{escape(command)}</pre>")
    title = f"{escape(task)}: learning by watching"
    write_atomic(path, HTML.format(title=title, css=CSS, body="".join(page)))


def _test_episode(episode, z_demo, episodes, fps):
    """The film of a test episode, how all of them ended, and its keypoints beside the video's."""
    frames, K = episode["frames"], z_demo.shape[1]
    z = np.asarray(episode["z"], float).reshape(len(frames), -1)[:, : 2 * K].reshape(-1, K, 2)
    moving = film(draw_keypoints(frames, z), fps / 2)
    shown = picture(data_uri("image/webp", moving), "Film of a test episode")
    marks = " ".join("✓" if row["success"] else "✗" for row in episodes)
    marks = f'<p class="small">All test episodes, this one first: {marks}</p>' if marks else ""
    pair = picture(svg(paths(z_demo, z, frames[-1])), "Paths of the keypoints in the image")
    pair += picture(svg(courses(z_demo, z)), "Coordinates of the keypoints over time")
    beside = f'<div class="row">{pair}</div>'
    return [
        *section("What the robot does now", EPISODE, shown, marks),
        *section("Does it follow the demonstration?", PATHS, beside),
    ]


def section(title: str, *body: str, kind: str = "") -> list[str]:
    """A section of the page; kind: its class in the style sheet."""
    return [f'<section class="{kind}">\n<h2>{title}</h2>', *body, "</section>\n"]


def headline(task: str, metrics: dict[str, Any], form: str) -> str:
    """The result in large letters, its figures in tiles, and how it came about."""
    settings, result = metrics.get("settings", {}), metrics.get("success")
    name = escape(task).capitalize()
    title, tiles = f"{name}: a robot learns from one video", []
    if result:
        n = result["episodes"]
        title = f"{name}: {round(result['rate'] * n)} of {n} test episodes succeed"
        low, rate, high = (round(100 * result[key]) for key in ("low", "rate", "high"))
        tiles = [(f"{rate} %", "success rate"), (f"{low}-{high} %", "95 % confidence interval")]
    if stages := metrics.get("stages"):
        tiles += [(duration(sum(stages.values())), "of learning in this run")]
    tiles += [(str(settings[key]), key) for key in ("seed", "reward") if key in settings]
    cells = "".join(f"<div><b>{escape(v)}</b><span>{label}</span></div>" for v, label in tiles)
    note = f'<p class="note">{SMOKE}</p>' if settings.get("fast") else ""
    return f'<h1>{title}</h1>\n<div class="tiles">{cells}</div>\n{note}{INTRODUCTION}'


def demonstration(demo: np.ndarray, translated: np.ndarray, z_demo: np.ndarray, fps: float) -> str:
    """As the paper's Fig. 5: human frames above their translations, in columns that wrap."""
    i, columns = spread(len(demo), 8), []
    seen = draw_keypoints(translated[i], z_demo[i], 3)
    pairs = np.concatenate([enlarge(demo[i], 3), seen], axis=1)
    for t, both in zip(i, pairs, strict=True):
        shown = picture(png(both), f"Frame {t + 1} of the human and its translation with keypoints")
        columns.append(f"<figure>{shown}<figcaption>{t / fps:.1f} s</figcaption></figure>")
    return f'<div class="strip">{"".join(columns)}</div>'


def figures(metrics: dict[str, Any]) -> list[str]:
    """Tables of times, perception and settings, as far as there are any."""
    page = []
    if stages := metrics.get("stages"):
        rows = [*stages.items(), ("together", sum(stages.values()))]
        page += section("Time", table([(name, duration(seconds)) for name, seconds in rows]))
    if perception := metrics.get("perception"):
        scores = {name: column for name, column in perception.items() if is_scores(column)}
        names = dict.fromkeys(name for column in scores.values() for name in column)
        rows = [(name, *(score(column.get(name)) for column in scores.values())) for name in names]
        rest = {name: value for name, value in perception.items() if name not in scores}
        tables = table([("", *scores), *rows]), table(flat(rest))
        page += section("Perception, measured", PERCEPTION, *tables)
    settings = flat(metrics.get("settings", {}))
    settings += flat({k: v for k, v in metrics.items() if k in MACHINE})
    return page + (section("Settings", table(settings)) if settings else [])


def is_scores(column: object) -> bool:
    """Whether that is a dict of coordinates, each with its R² and error."""
    rows = column.values() if isinstance(column, dict) else [None]
    return all(isinstance(row, dict) and "r2" in row for row in rows)


def score(value: dict | None) -> str:
    """R² and error of one coordinate, or a dash for what does not move."""
    return f"{value['r2']:.3f} ({value['px']:.1f})" if value and value["r2"] is not None else "-"


def flat(tree: Any, name: str = "") -> list[tuple[str, str]]:
    """Nested figures as rows of name and value."""
    if isinstance(tree, dict):
        return [row for key, value in tree.items() for row in flat(value, f"{name} {key}".strip())]
    values = tree if isinstance(tree, list) else [tree]
    return [(name, ", ".join(f"{v:.3g}" if isinstance(v, float) else str(v) for v in values))]


def duration(seconds: float) -> str:
    """Seconds as people read them."""
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.1f} min"


def table(rows: Sequence[tuple[str, ...]]) -> str:
    """Rows of text, names with spaces for underscores."""
    lines = []
    for name, *values in rows:
        cells = (f"<td>{escape(cell)}</td>" for cell in (name.replace("_", " "), *values))
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return f"<table>{''.join(lines)}</table>" if rows else ""
