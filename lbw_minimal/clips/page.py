"""The page about a person's clip: what was found in it, what was done, and what came of it.

In: the clip, the tracks found in it, their motion in the scene, the film of its re-enactment and
what the shipped networks see in that. Out: one HTML file that needs no other file and no network.
The pictures that a click corrects are those of `shots.py`.
"""

from __future__ import annotations

from html import escape
from pathlib import Path

import cv2
import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from lbw_minimal.clips.paths import SURE, Tracks
from lbw_minimal.clips.retarget import FPS, Motion, Scene
from lbw_minimal.clips.shots import STRIP, correctable, drawn, to_correct
from lbw_minimal.films import Film
from lbw_minimal.pictures import (
    COLOURS,
    STYLE,
    draw_keypoints,
    picture,
    svg,
)
from lbw_minimal.report import section, table
from lbw_minimal.report_texts import CSS, HTML, shell
from lbw_minimal.training import write_atomic

SCALE = 3  # of the film's pictures, 84 pixels wide
OPTIONS = [
    ("--from S, --to S", "use only what is between these seconds of the clip"),
    ("--mirror, --no-mirror", "turn left into right, or do not"),
    (
        "--tip X,Y@S",
        "the tip, the point that pushes, is at these pixels of the pictures above at that second, "
        "which are {width}x{height}: large clips are read smaller. A click writes it",
    ),
    ("--object X,Y@S", "and the object at these"),
]
UNLESS = """
<p>It may have been seen wrongly. Is a dot below not on the {}? Click where it should be: the clip
may be usable after all.</p>
"""
FIRST = """
<p id="first" class="note" hidden>Run the corrected command above first: this one learns the motion
as it is now.</p>
"""
SURENESS = """
<p>How sure the network is of tip and object, over the clip. Below the dashed line a dot is hollow.
{}</p>
"""
CUTS = "At a black line the whole picture changes."
SCENE = """
<p>The clip's motion in the task's scene, in centimetres, as the simulated human was asked to do it
(dashed) and did it (solid). Contact and arrival are the two grey lines. Before the clip's hand
comes into reach, the arm comes from its own start.</p>
"""
SIDE_BY_SIDE = """
<p>From left to right: the clip; the same motion, done by the simulated human in front of the kit's
own camera; its translation into the robot's world; and the keypoints found there, which the robot
will follow. At half speed.</p>
"""


def write_page(
    path: Path | str,
    *,
    task: str,
    command: str,
    verdict: str,
    frames: np.ndarray,
    times: np.ndarray,
    scene: Scene,
    notes: list[str],
    warnings: list[str],
    tracks: Tracks | None = None,
    motion: Motion | None = None,
    states: np.ndarray | None = None,
    columns: tuple[np.ndarray, ...] = (),
    shown: np.ndarray | None = None,
    links: str = "",
    learn: str = "",
) -> None:
    """Write the page, whole or not at all; what is None was not reached and is left out.

    command: what made it; verdict: the sentence on top. frames (T, H, W, 3) uint8, times (T,) s:
    the clip. states (N, 9) m: tip, object and target of the re-enactment. shown (n,): the steps of
    the motion in the film; columns: its re-enactment and translation (n, 84, 84, 3) uint8 and
    keypoints (n, K, 2). links: HTML that leads to other pages. learn: the command that comes next.
    """
    head, _, rest = verdict.partition(": ")
    why = escape(rest[:1].upper() + rest[1:])
    page = [f"<h1>{escape(task).capitalize()}: {escape(head)}</h1>", f"<p>{why}</p>"]
    if tracks is not None and head == "not usable" and (names := correctable(tracks)):
        page.append(UNLESS.format(", or not on the ".join(names)))
    page += [f'<p class="note">{escape(warning)}</p>' for warning in warnings]
    if columns and shown is not None:
        seen = clip_column(frames, times, tracks, motion, shown)
        page += _films(seen, columns, _rate(shown) / 2)
    clickable = tracks is not None or not columns  # nobody corrects a film taken as it is
    if clickable:
        used = None if motion is None else (motion.times[0], motion.times[-1])
        title = "What was found in the clip" if tracks else "The clip"
        page += section(title, *to_correct(frames, times, tracks, used, command))
    if tracks is not None:
        words = SURENESS.format(CUTS if tracks.cuts else "")
        page += [words, picture(svg(confidence(tracks)), "How sure tip and object were found")]
    if notes:
        page += section(
            "What was done", f"<ul>{''.join(f'<li>{escape(n)}</li>' for n in notes)}</ul>"
        )
    if motion is not None:
        figure = courses(motion, scene, states)
        page += section("The motion in the scene", SCENE, picture(svg(figure), "Paths over time"))
    again = "" if clickable else shell(command)
    options = OPTIONS[: 1 if clickable and tracks is None else None]  # no other is of any help
    height, width = frames.shape[1:3]
    said = [(name, text.format(width=width, height=height)) for name, text in options]
    page += section("To decide otherwise", table(said), again)
    if learn:
        page += section("Next", FIRST, "<p>The robot learns it:</p>", shell(learn))
    title = f"{escape(task)}: a clip of one's own"
    body = "".join(page)
    write_atomic(path, HTML.format(title=title, css=CSS + STRIP, links=links, body=body))


def _films(seen, columns, fps):
    """The section with the clip, its re-enactment, translation and keypoints side by side."""
    done, translated, z = columns
    films = {"the clip": seen, "done again": done, "its translation": translated,
             "its keypoints": draw_keypoints(translated, z, SCALE)}  # fmt: skip
    title = "Clip, re-enactment, translation, keypoints"
    return section(title, SIDE_BY_SIDE, Film(films, fps).html())


def nearest(times: np.ndarray, t: float) -> int:
    """The index of the one of times (T,) that is nearest to t, all in s."""
    return int(np.abs(times - t).argmin())


def clip_column(
    frames: np.ndarray,
    times: np.ndarray,
    tracks: Tracks | None,
    motion: Motion | None,
    shown: np.ndarray,
) -> np.ndarray:
    """The clip's frames (n, S, S, 3) uint8 at the steps shown (n,) of the motion, in black bars.

    frames (T, H, W, 3) uint8, times (T,) s: the clip.
    """
    out, S = [], 84 * SCALE
    for k in shown:
        t = times[0] + k / FPS
        if motion is not None:  # after its end, as after a hit, the clip goes on
            t = motion.times[min(k, len(motion.times) - 1)]
            t += max(0, k + 1 - len(motion.times)) / FPS
        frame = frames[nearest(times, t)]
        small = drawn(frame, tracks, 0 if tracks is None else nearest(tracks.times, t))
        if motion is not None and motion.mirrored:
            small = small[:, ::-1]
        scale = S / max(small.shape[:2])
        small = cv2.resize(small, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)[:S, :S]
        square = np.zeros((S, S, 3), np.uint8)
        top, left = (S - small.shape[0]) // 2, (S - small.shape[1]) // 2
        square[top : top + small.shape[0], left : left + small.shape[1]] = small
        out.append(square)
    return np.stack(out)


def _rate(shown):
    return FPS / max(1.0, float(np.mean(np.diff(shown)))) if len(shown) > 1 else FPS


def confidence(tracks: Tracks) -> Figure:
    """How sure tip and object were found in every frame."""
    with rc_context(STYLE):
        figure = Figure(figsize=(7, 2.2))
        axis = figure.subplots()
        axis.plot(tracks.times, tracks.tip_sure, ".-", color=COLOURS[4], label="tip")
        axis.plot(tracks.times, tracks.object_sure, ".-", color=COLOURS[5], label="object")
        axis.axhline(SURE, color="black", lw=1, ls="--")
        for cut in tracks.cuts:
            axis.axvline(tracks.times[cut], color="black", lw=1)
        axis.set(xlabel="time in the clip (s)", ylabel="sureness", ylim=(0, 1.05))
        figure.legend(loc="outside upper center", ncols=2)
    return figure


def courses(motion: Motion, scene: Scene, states: np.ndarray | None) -> Figure:
    """Tip and object in the scene over time, asked for (dashed) and done (solid), in cm."""
    with rc_context(STYLE):
        figure = Figure(figsize=(7, 4.4))
        above, below = figure.subplots(2, sharex=True)
        for axis, k, name in ((above, 0, "along the table"), (below, 1, "above the table")):
            t = np.arange(len(motion.tip)) / FPS
            names = ("tip", "object") if states is None else (None, None)  # the solid one has it
            dashed = {"ls": "--", "lw": 1.5}
            axis.plot(t, 100 * motion.tip[:, k], color=COLOURS[4], label=names[0], **dashed)
            if motion.object is not None:
                axis.plot(t, 100 * motion.object[:, k], color=COLOURS[5], label=names[1], **dashed)
            if states is not None:
                t = np.arange(len(states)) / FPS
                axis.plot(t, 100 * states[:, 2 * k], color=COLOURS[4], lw=2, label="tip")
                if motion.object is not None:
                    axis.plot(t, 100 * states[:, 3 + 2 * k], color=COLOURS[5], lw=2, label="object")
            axis.axhline(100 * scene.goal[k], color=COLOURS[2], lw=1, label="goal")
            for step in (motion.contact, motion.arrival):
                axis.axvline(step / FPS, color="grey", lw=1)
            axis.set(ylabel=f"{name} (cm)")
        below.set_xlabel("time in the re-enactment (s)")
        figure.legend(*above.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure
