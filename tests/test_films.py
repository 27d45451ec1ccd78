"""Films side by side, and the diagram of the method: what they hold, frame by frame."""

import asyncio
import base64
import io
import re

import av
import numpy as np
import pytest
from PIL import Image

from lbw_minimal import diagram
from lbw_minimal.films import Film, side_by_side
from tests import browser


def shades(*values, side=84):
    """A film of plain frames, each of one grey."""
    return np.repeat(np.uint8(values), 3 * side * side).reshape(-1, side, side, 3)


def film_in(html):
    """The frames (T, H, W, 3) of the video in a page, and its frames a second."""
    data = base64.b64decode(re.search(r'<video src="data:video/webm;base64,([^"]+)"', html)[1])
    with av.open(io.BytesIO(data)) as container:
        frames = [f.to_ndarray(format="rgb24") for f in container.decode(video=0)]
        return np.stack(frames), float(container.streams.video[0].average_rate)


def test_a_shorter_film_waits_at_its_end_and_a_small_one_is_enlarged():
    both = side_by_side([shades(0, 50, 100), shades(200, 250, side=252)])
    assert both.shape == (3, 252, 252 + 6 + 252, 3)
    assert both[:, 0, 0, 0].tolist() == [0, 50, 100]
    assert both[:, 0, 252 + 6, 0].tolist() == [200, 250, 250]


def test_the_video_runs_at_its_pace_and_rests_a_second_at_its_end():
    html = Film({"a": shades(0, 60, 120, 180), "b": shades(255)}, fps=12.5).html()
    frames, fps = film_in(html)
    assert fps == pytest.approx(12.5) and frames.shape == (4 + 12, 252, 510, 3)
    np.testing.assert_allclose(frames[:5, 100, 100, 0], [0, 60, 120, 180, 180], atol=6)
    assert frames[:, 100, 400].min() > 249


def test_a_film_says_what_it_shows_can_be_stopped_and_is_a_picture_on_paper():
    html = Film({"<one>": shades(0, 9), "two": shades(9)}).html()
    tag = re.search(r"<video src=\"[^\"]+\"([^>]*)>", html)[1]
    assert 'aria-label="A film of &lt;one&gt;, two"' in tag and "prefers-reduced-motion" in tag
    assert {"autoplay", "loop", "muted", "playsinline"} <= set(tag.split())
    assert not re.search(r"\bcontrols\b", tag)  # they would cover the film
    assert html.count('<img class="still"') == 1 == html.count('alt="A film of &lt;one&gt;, two"')
    assert "http" not in html


def test_a_film_on_paper_is_its_middle_frame():
    html = Film({"a": shades(0, 60, 120, 180, 240)}).html()
    data = re.search(r'class="still" src="data:image/png;base64,([^"]+)"', html)[1]
    assert (np.array(Image.open(io.BytesIO(base64.b64decode(data)))) == 120).all()


HOW = """
(() => {
  const film = document.querySelector("video"), slider = document.querySelector(".film input");
  const [a, b] = [film, slider].map(e => e.getBoundingClientRect());
  return [film.paused, document.querySelector(".film button").textContent, b.top >= a.bottom];
})()
"""
SEEK = """
(async () => {
  const film = document.querySelector("video"), slider = document.querySelector(".film input");
  const done = new Promise(done => film.addEventListener("seeked", done, {once: true}));
  slider.value = 0.5;
  slider.dispatchEvent(new Event("input"));
  await done;
  return [film.paused, film.currentTime, +slider.value];
})()
"""


async def watch(folder):
    """The film as it begins, stopped and run again by its button and by a tap, and at its half."""
    said, click = [], "document.querySelector('{}').click()"
    async with browser.opened(folder / "film.html", folder / "profile") as page:
        for what in (None, ".film button", ".film button", "video", "video"):
            if what:
                await page.js(click.format(what))
            for _ in range(50):  # until its event has come
                now = await page.js(HOW)
                if now[1] == ("Play" if now[0] else "Pause"):
                    break
                await asyncio.sleep(0.1)
            said.append(now)
        return said, await page.js(SEEK)


def test_a_film_is_controlled_below_its_picture(tmp_path_factory):
    """Sixteen frames and a rest at 12.5 a second: 1.28 s and 1 s."""
    html = Film({"a": shades(*range(0, 160, 10))}, fps=12.5).html()
    said, sought = browser.seen(
        tmp_path_factory, lambda folder: (folder / "film.html").write_text(html), watch
    )
    assert said == [[p, "Play" if p else "Pause", True] for p in (0, 1, 0, 1, 0)]
    assert sought == [True, pytest.approx(1.14, abs=0.1), pytest.approx(0.5, abs=0.05)]


def test_a_readmes_film_keeps_every_frame_loops_and_rests():
    frames = np.random.default_rng(0).integers(0, 256, (5, 84, 84, 3), np.uint8)
    with Image.open(io.BytesIO(Film({"noise": frames}).webp())) as film:
        assert (film.n_frames, film.info["loop"], film.size) == (5, 0, (252, 252))
        times = []
        for i in range(5):
            film.seek(i)
            film.load()
            times.append(film.info["duration"])
    assert times == [80, 80, 80, 80, 1000]  # ms


def test_the_diagram_shows_five_frames_each_in_its_place():
    """The human's, its translation without and with keypoints; the robot's without and with."""
    human, made, robot = (shades(v)[0] for v in (10, 100, 200))
    points = np.array([[-0.9, -0.9]]), np.array([[0.9, 0.9]])
    (page,) = diagram.method(human, made, points[0], robot, points[1]).axes
    shown = [image.get_array() for image in page.images]
    assert [int(image[160, 160, 0]) for image in shown] == [10, 100, 100, 200, 200]
    marked = [(image != image[160, 160]).any() for image in shown]
    assert marked == [False, False, True, False, True]
    assert (shown[2][:60, :60] != 100).any() and (shown[4][-60:, -60:] != 200).any()
    words = " ".join(text.get_text() for text in page.texts)
    assert all(w in words for w in ("Eq. 1-5", "Eq. 6-7", "Eq. 8-10", "policy", "SAC"))


def test_the_diagram_can_be_read_on_a_phone():
    """358 pixels are what a page leaves of a phone's 390, and below 8 pixels type is a blur."""
    frame, z = shades(0)[0], np.zeros((1, 2))
    figure = diagram.method(frame, frame, z, frame, z)
    a_point = 358 / figure.get_figwidth() / 72
    assert (
        min(text.get_fontsize() for text in figure.axes[0].texts if text.get_text()) * a_point > 8
    )
