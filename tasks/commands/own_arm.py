"""A clip of one's own, as the gallery and the README show it.

A real person's clip cannot come with the kit: a look-alike stands for it, and whoever shows the
pictures has to say so.
"""

from __future__ import annotations

import tempfile
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

import tasks
from lbw_minimal import imitate
from lbw_minimal.clips.lookalike import look_alike, write
from lbw_minimal.clips.page import nearest
from lbw_minimal.pictures import draw_keypoints, enlarge, picture, png, spread
from tasks.commands.prepare import Prepared, prepare
from tasks.world import record_expert
from tasks.world.scene import FPS

NAME, SEED = "push", 3  # the task, and the seed of its expert
SCALE = 3  # of the kit's frames
SHRINK = 2 / 3  # of the gallery's pictures in a README


def prepared() -> Prepared:
    """What `prepare` makes of a look-alike clip of the task, read from a file as a person's is."""
    human = tasks.bare(NAME, embodiment="human")
    film, pixels, _ = record_expert(human, SEED)
    human.close()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "my.mp4"
        write(path, look_alike(film, pixels))
        return prepare(NAME, path)


def columns(clip: Prepared, n: int = 8) -> list[tuple[float, np.ndarray]]:
    """n moments of a usable clip: seconds of its re-enactment, and a picture (H, 252, 3) uint8.

    From above: the clip's frame, the same moment done again, and its translation with keypoints.
    """
    assert clip.done is not None, clip.verdict
    perception = imitate.load_perception(tasks.WEIGHTS / NAME, NAME)
    steps = spread(len(clip.film), n)
    moments = clip.done.motion.times[np.minimum(steps, len(clip.done.motion.times) - 1)]
    again, width = clip.film[steps], clip.film.shape[2] * SCALE
    robot = perception.translate(again)
    seen = draw_keypoints(robot, perception.detect(robot), SCALE)
    out = []
    for step, moment, *below in zip(steps, moments, enlarge(again, SCALE), seen, strict=True):
        frame = clip.clip.frames[nearest(clip.clip.times, moment)]
        size = width, round(width * frame.shape[0] / frame.shape[1])
        above = cv2.resize(frame, size, interpolation=cv2.INTER_AREA)
        out.append((step / FPS, np.concatenate([above, *below])))
    return out


def strip(clip: Prepared) -> bytes:
    """Six moments of a usable clip side by side as a PNG of 256 colours, for READMEs."""
    images = [
        cv2.resize(image, None, fx=SHRINK, fy=SHRINK, interpolation=cv2.INTER_AREA)
        for _, image in columns(clip, 6)
    ]
    file = BytesIO()
    row = Image.fromarray(np.concatenate(images, axis=1))
    row.quantize().save(file, "PNG", optimize=True)  # half as large as in all its colours
    return file.getvalue()


def section(clip: Prepared) -> str:
    """The gallery's section about a clip of one's own."""
    if clip.done is None:
        return f"<section><h2>Your own arm</h2>{SAID}<p>{clip.verdict}</p></section>"
    figures = []
    for seconds, image in columns(clip):
        alt = f"At {seconds:.1f} s: the look-alike clip, its motion done again, its translation"
        figures.append(
            f"<figure>{picture(png(image), alt)}<figcaption>{seconds:.1f} s</figcaption></figure>"
        )
    strip = f'<div class="strip">{"".join(figures)}</div>'
    return f"<section><h2>Your own arm</h2>{SAID}{strip}</section>"


SAID = """
<p>Above: a clip as somebody's phone might have filmed it. It is a look-alike from the simulator,
mirrored, tinted, noisy, slower and unevenly filmed, since no real person's clip can come with the
kit. In the middle: the motion that was found in it, done again by the simulated human in front of
the kit's own camera. Below: its translation, with the keypoints the robot follows.
<code>python -m tasks prepare push my.mp4</code> makes such a page of a clip of yours.</p>
"""
