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

from lbw_minimal.diagram import method as diagram
from lbw_minimal.films import Film
from lbw_minimal.pictures import (
    courses,
    curve,
    draw_keypoints,
    enlarge,
    parts,
    paths,
    picture,
    png,
    spread,
    svg,
)
from lbw_minimal.report_texts import (
    CLIP,
    CSS,
    DEMONSTRATION,
    EPISODE,
    GOAL,
    HTML,
    INTRODUCTION,
    LEARNING,
    LEARNT,
    METHOD,
    PATHS,
    PERCEPTION,
    REPLAY,
    REWARD,
    SCENE,
    SET,
    SHOWN,
    SMOKE,
    VIDEOS,
    WORDS,
    options,
    shell,
)
from lbw_minimal.training import quantity, write_atomic

LEARNS = {  # the stages in which something is learnt; the others film
    "lbw": ("translation", "keypoints", "policy"),
    "avid": ("translation", "classifier", "policy"),
    "classifier": ("classifier", "policy"),
    "tracks": ("policy",),
}
COLUMNS = 8  # of the strips that show a video
EPISODE_TITLE = "What the robot does now"
MACHINE = (
    "version",
    "machine",
    "memory_mb",
)  # of metrics.json; the page shows them with the settings


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


def write_report(
    path: Path | str,
    *,
    task: str,
    demo: np.ndarray,
    translated: np.ndarray | None = None,
    z_demo: np.ndarray | None = None,
    clip: np.ndarray | None = None,
    logits: np.ndarray | None = None,
    log: list[dict] | None = None,
    episode: dict | None = None,
    metrics: dict | None = None,
    scene_html: str | None = None,
    command: str | None = None,
    goal: str = "",
    links: str = "",
    fps: float = 25,
) -> None:
    """Write the page of a run, whole or not at all; what is None or empty is left out.

    demo, translated: (N, 84, 84, 3) uint8; z_demo (N, K, 2): the keypoints found on `translated`;
    clip (n, S, S, 3) uint8: stills of a person's clip, which `demo` does again; logits (N,): a
    rival's goal classifier on `translated`, or on `demo` where nothing is translated. log: the
    policy's, a row per episode. episode: a test episode's "frames" (T, 84, 84, 3) uint8, "z"
    (T, K, 2) (or observations whose first 2K numbers are z), and "parts", a dict of reward parts
    per step. metrics: as in metrics.json: "success", "episodes", "stages" in s, "perception",
    "settings", "machine", and of a person's clip "clip": the "clip"'s name, its "corrections", and
    the "command" that comes before this run's. scene_html: a page of its own. command: what makes
    this run again. goal: what success is. links: HTML that leads to other pages.
    """
    metrics, episode = metrics or {}, episode or {}
    settings, ends = metrics.get("settings", {}), metrics.get("episodes", [])
    method = settings.get("method", "lbw")
    form = settings.get("reward", "mended") if method == "lbw" else "classifier"
    kind = method if method in ("lbw", "tracks") else "rival"
    form = "object tracks'" if kind == "tracks" else form
    page = [headline(task, metrics, method, goal)]
    if clip is not None:
        page += section("Your clip", CLIP[method], whose(metrics.get("clip")), strip(clip))
    if translated is not None and z_demo is not None and "frames" in episode:
        page += section("The method", METHOD, _method(demo, translated, z_demo, episode))
    columns = demonstration(demo, translated, z_demo, fps, logits)
    page += section(SHOWN[method], DEMONSTRATION[method], columns)
    if "frames" in episode:
        page += _test_episode(demo, translated, z_demo, episode, ends, fps, kind)
    if scene_html:
        frame = f'<iframe title="The episode in 3-D" srcdoc="{escape(scene_html)}"></iframe>'
        page += section("The same episode in three dimensions", SCENE, frame, kind="scene")
    if log and len(log) > 1:
        shown = picture(svg(curve(log, form)), "Learning curves")
        page += section("How the robot learnt", LEARNING[kind], shown)
    if episode.get("parts"):
        done = ends[0].get("first_success") if ends else None
        shown = picture(svg(parts(episode["parts"], fps, done)), "Parts of the reward over time")
        page += section("The reward, step by step", REWARD[kind], shown)
    page += figures(metrics)
    if command:
        page += again(command, metrics.get("clip", {}))
    title = f"{escape(task)}: learning by watching"
    write_atomic(path, HTML.format(title=title, css=CSS, links=links, body="".join(page)))


def _keypoints(episode, K):
    """z (T, K, 2) of a test episode, of its observations."""
    seen = np.asarray(episode["z"], float).reshape(len(episode["frames"]), -1)
    return seen[:, : 2 * K].reshape(-1, K, 2)


def _method(demo, translated, z_demo, episode):
    """The method in frames of this run: the middle of the video and of the test episode."""
    i, j = len(demo) // 2, len(episode["frames"]) // 2
    z = _keypoints(episode, z_demo.shape[1])[j]
    figure = diagram(demo[i], translated[i], z_demo[i], episode["frames"][j], z)
    return picture(svg(figure), "The method in frames of this run")


def _test_episode(demo, translated, z_demo, episode, episodes, fps, kind):
    """The film of a test episode, how all of them ended, and its keypoints beside the video's."""
    frames = episode["frames"]
    marks = " ".join("✓" if row["success"] else "✗" for row in episodes)
    marks = f'<p class="small">All test episodes, this one first: {marks}</p>' if marks else ""
    if z_demo is None:
        shown = Film({"the robot, in a test episode": frames}, fps / 2).html()
        return section(EPISODE_TITLE, EPISODE[kind], shown, marks)
    z = _keypoints(episode, z_demo.shape[1])
    films = {"the human": demo}
    if translated is not None:
        films["its translation"] = draw_keypoints(translated, z_demo, 3)
    films["the robot, in a test episode"] = draw_keypoints(frames, z, 3)
    pair = picture(svg(paths(z_demo, z, frames[-1])), "Paths of the keypoints in the image")
    pair += picture(svg(courses(z_demo, z)), "Coordinates of the keypoints over time")
    beside = f'<div class="row">{pair}</div>'
    return [
        *section(EPISODE_TITLE, EPISODE["lbw"], Film(films, fps / 2).html(), marks),
        *section("Does it follow the demonstration?", PATHS, beside),
    ]


def section(title: str, *body: str, kind: str = "") -> list[str]:
    """A section of the page; kind: its class in the style sheet."""
    return [f'<section class="{kind}">\n<h2>{title}</h2>', *body, "</section>\n"]


def again(command: str, clip: dict[str, str]) -> list[str]:
    """The section with the run's command, and before it the one that prepared a person's clip."""
    lines = "\n".join(filter(None, [clip.get("command"), command]))
    return section("To make this run again", shell(lines))


def whose(clip: dict[str, str] | None) -> str:
    """Which clip that is, and what its owner decided: the "clip"'s name and its "corrections"."""
    if not clip:
        return ""
    c = clip["corrections"]
    how = f"corrected by <code>{options(c)}</code>" if c else "not corrected"
    return f"<p><b>{escape(clip['clip'])}</b>, {how}.</p>"


def headline(task: str, metrics: dict[str, Any], method: str = "lbw", goal: str = "") -> str:
    """The result in large letters, its figures in tiles, and how it came about."""
    settings, result = metrics.get("settings", {}), metrics.get("success")
    name = escape(task).capitalize()
    title, tiles = f"{name}: a robot learns from {VIDEOS[method]}", []
    if result:
        n = result["episodes"]
        won, of = round(result["rate"] * n), quantity(n, "test episode")
        title = f"{name}: {won} of {of} {'succeeds' if n == 1 else 'succeed'}"
        low, rate, high = (round(100 * result[key]) for key in ("low", "rate", "high"))
        tiles = [(f"{rate} %", "success rate"), (f"{low}-{high} %", "95 % confidence interval")]
    notes = [SMOKE] if settings.get("fast") else []
    said = [GOAL.format(escape(goal))] if goal else []
    shown = ["reward" if method == "lbw" else "method"]
    if stages := metrics.get("stages"):
        taught = {name: stages[name] for name in LEARNS[method] if name in stages}
        if taught:
            tiles += [(duration(sum(taught.values())), "of learning in this run")]
            shown = ["seed", *shown]  # a replay's is not the one that the policy learnt with
        if not set(LEARNS[method]) <= set(taught):
            if taught:
                said.append(LEARNT.format(escape(", ".join(taught))))
            else:
                notes.append(REPLAY)
    tiles += [(str(settings[key]), key) for key in shown if key in settings]
    cells = "".join(f"<div><b>{escape(v)}</b><span>{label}</span></div>" for v, label in tiles)
    noted = "".join(f'<p class="note">{note}</p>' for note in notes)
    noted += f"<p>{' '.join(said)}</p>" if said else ""
    return f'<h1>{title}</h1>\n<div class="tiles">{cells}</div>\n{noted}{INTRODUCTION[method]}'


def demonstration(
    demo: np.ndarray,
    translated: np.ndarray | None,
    z_demo: np.ndarray | None,
    fps: float,
    logits: np.ndarray | None = None,
) -> str:
    """As the paper's Fig. 5: frames of the video above their translations, in columns that wrap."""
    i, columns = spread(len(demo), COLUMNS), []
    rows, what = [enlarge(demo[i], 3)], "the video"
    if translated is not None:
        what = "the video and its translation"
        if z_demo is None:
            rows.append(enlarge(translated[i], 3))
        else:
            rows.append(draw_keypoints(translated[i], z_demo[i], 3))
            what += " with keypoints"
    for t, both in zip(i, np.concatenate(rows, axis=1), strict=True):
        caption = f"{t / fps:.1f} s" + (f", {logits[t]:+.1f}" if logits is not None else "")
        shown = picture(png(both), f"Frame {t + 1} of {what}")
        columns.append(f"<figure>{shown}<figcaption>{caption}</figcaption></figure>")
    return f'<div class="strip">{"".join(columns)}</div>'


def strip(clip: np.ndarray) -> str:
    """Stills (n, S, S, 3) uint8 of a person's clip, from left to right."""
    shown = (picture(png(still), f"Still {k} of the clip") for k, still in enumerate(clip, 1))
    return f'<div class="strip">{"".join(f"<figure>{image}</figure>" for image in shown)}</div>'


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
        tables = table([("", *scores), *rows]), table(in_words(rest))
        page += section("Perception, measured", PERCEPTION, *tables)
    given = dict(metrics.get("settings", {}))
    recipe = given.pop("recipe", {})
    if stages and "policy" not in stages:
        recipe = {}  # a replay follows none
    settings = in_words(given)
    settings += [(WORDS[name], f"{name}={value:g}") for name, value in recipe.items()]
    settings += in_words({k: v for k, v in metrics.items() if k in MACHINE})
    about = SET if recipe else ""
    return page + (section("Settings", about, table(settings)) if settings else [])


def is_scores(column: object) -> bool:
    """Whether that is a dict of coordinates, each with its R² and error."""
    rows = column.values() if isinstance(column, dict) else [None]
    return all(isinstance(row, dict) and "r2" in row for row in rows)


def score(value: dict | None) -> str:
    """R² and error of one coordinate, or a dash for what does not move."""
    return f"{value['r2']:.3f} ({value['px']:.1f})" if value and value["r2"] is not None else "-"


def in_words(tree: dict[str, Any]) -> list[tuple[str, str]]:
    """The rows of `flat` with names for people, without what is not set."""
    return [(WORDS.get(name, name), value) for name, value in flat(tree) if value]


def flat(tree: Any, name: str = "") -> list[tuple[str, str]]:
    """Nested figures as rows of name and value."""
    if isinstance(tree, dict):
        return [row for key, value in tree.items() for row in flat(value, f"{name} {key}".strip())]
    values = tree if isinstance(tree, list) else [tree]
    return [(name, ", ".join(map(_value, values)))]


def _value(value):
    """A figure in words; nothing for what is not set."""
    if value is None or isinstance(value, bool):
        return "" if value is None else "yes" if value else "no"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


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
