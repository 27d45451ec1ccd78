"""The page to film oneself with: its outline, its silence, and a recording in a real browser."""

import asyncio
import base64
import re

import browser
import cv2
import numpy as np
import pytest

import tasks
from lbw_minimal import video
from lbw_minimal.clips.lookalike import look_alike
from tasks.__main__ import main
from tasks.commands.prepare import prepare
from tasks.commands.stage import _contours, outlines, page
from tasks.world import record_expert


def box(polygons):
    """Left, top, right and bottom of polygons."""
    points = np.concatenate(polygons)
    return np.concatenate([points.min(0), points.max(0)])


@pytest.mark.parametrize("name", tasks.TASKS)
def test_outlines_lie_where_the_picture_changes(name):
    """The arm's contains the tip, and the object's the object; none leaves the picture."""
    env = tasks.bare(name, embodiment="human", observation="state")
    env.reset(seed=0)
    drawn = outlines(env)
    tip, thing = np.split(env.true_pixels(), 2)
    thing = env.world.pixel(env.target_position()) if name == "reach" else thing
    left, _, right, bottom = box(drawn["arm"])
    assert left - 1 <= tip[0] <= right + 1 and bottom == pytest.approx(tip[1], abs=4)
    left, top, right, bottom = box(drawn["object"])
    assert left <= thing[0] <= right and top <= thing[1] <= bottom
    assert right - left < 42 and bottom - top < 30 and drawn["scene"]
    assert all(0 <= v <= 84 for part in drawn.values() for v in box(part))
    env.close()


def test_what_the_page_fills_in_itself_is_left_to_it():
    """Of `${size}` the size of the kit's pictures had been put in: every film had $84 MB."""
    text = page("push")
    assert "${megabytes} MB" in text and not re.search(r"\$\d", text)


@pytest.mark.parametrize("name", tasks.TASKS)
def test_the_goal_is_drawn_where_the_object_has_to_get(name):
    text = page(name)
    env = tasks.bare(name, embodiment="human", observation="state")
    env.reset(seed=0)
    way = env.world.pixel(env.target_position()) - env.world.pixel(env.object_position())
    env.close()
    paths = dict(re.findall(r'<path class="(\w+)" d="(.*?)"/>', text))
    assert ("goal" in paths) == (name != "reach") == ("dashed the place" in text)
    assert "Start with the hand where the blue arm is" in text
    if "goal" in paths:
        start, goal = (
            np.array(re.findall(r"[\d.e-]+", paths[k]), float) for k in ("object", "goal")
        )
        shift = (goal - start).reshape(-1, 2)
        assert shift == pytest.approx(np.broadcast_to(way, shift.shape), abs=1e-3)


def test_the_page_says_what_to_do_and_asks_nobody_for_anything(tmp_path, capsys):
    assert main(["stage", "coffee", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out == f"stage: {tmp_path / 'coffee.html'}\n"
    text = (tmp_path / "coffee.html").read_text(encoding="utf-8")
    assert "default-src 'none'" in text and "Put a mug" in text
    assert not re.search(r"https?://|src=|href=\"", text)
    assert not re.search(r"\{(task|what|orange|size|outlines|name)\}", text)


@pytest.mark.parametrize(
    ("like", "says"),
    [("push", "to the dashed outline as the task has it"), ("reach", "bottle cap")],
)
def test_a_new_task_has_a_page_as_well(like, says, monkeypatch):
    bare = tasks.bare
    monkeypatch.setattr(tasks, "bare", lambda name, **more: bare(like, **more))
    text = page("domino")
    assert says in text and "Film your arm: domino" in text
    assert ('class="goal"' in text) == (like == "push")


@pytest.mark.skipif(not browser.CHROMIUM, reason="needs Chromium")
def test_on_a_phone_the_command_breaks_before_the_path_alone(tmp_path):
    """It broke between -m and tasks."""
    (tmp_path / "coffee.html").write_text(page("coffee"), encoding="utf-8")
    small = {"width": 390, "height": 900, "deviceScaleFactor": 1, "mobile": True}

    async def looked():
        async with browser.opened(tmp_path / "coffee.html", tmp_path / "profile") as shown:
            await shown.call("Emulation.setDeviceMetricsOverride", **small)
            await shown.js("document.getElementById('clip').textContent = 'coffee-clip.webm'")
            heights = "[...document.querySelectorAll('pre > span')].map(e => e.offsetHeight)"
            wide = "document.documentElement.scrollWidth"
            return await shown.js(heights), await shown.js(wide)

    (command, path), wide = asyncio.run(looked())
    assert 0 < command == path < 40 and wide <= 390


def recorded(tmp_path, film, seconds):
    """What a browser records on push's stage, of a camera for which a film (T, H, W, 3) uint8 at 25
    frames a second stands in, over and over: the file. The stage has the camera's shape, so that no
    outline lies beside the picture."""
    (tmp_path / "push.html").write_text(page("push"), encoding="utf-8")
    height, width = film.shape[1:3]
    yuv = (cv2.cvtColor(frame, cv2.COLOR_RGB2YUV_I420).tobytes() for frame in film)
    (tmp_path / "camera.y4m").write_bytes(
        f"YUV4MPEG2 W{width} H{height} F25:1 Ip A1:1 C420\n".encode()
        + b"".join(b"FRAME\n" + f for f in yuv)
    )
    camera = ("--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream",
              f"--use-file-for-fake-video-capture={tmp_path / 'camera.y4m'}")  # fmt: skip
    state, click = "document.body?.dataset.state", "document.getElementById('{}').click()"
    read = """fetch(document.getElementById("save").href).then(r => r.blob()).then(blob =>
        new Promise(done => {
            const reader = new FileReader();
            reader.onload = () => done(reader.result);
            reader.readAsDataURL(blob);
        }))"""

    shape = """["#live", ".stage"].map(what => document.querySelector(what))
        .map(one => one.videoWidth ? one.videoWidth / one.videoHeight
                                   : one.offsetWidth / one.offsetHeight)"""

    async def record():
        async with browser.opened(tmp_path / "push.html", tmp_path / "profile", *camera) as shown:
            await shown.until(state, "live")
            assert await shown.js(shape) == pytest.approx([width / height] * 2, rel=0.01)
            await shown.js(click.format("record"))
            await shown.until(state, "recording")
            await asyncio.sleep(seconds)
            await shown.js(click.format("stop"))
            await shown.until(state, "recorded")
            name = await shown.js("document.getElementById('save').download")
            assert await shown.js("document.getElementById('clip').textContent") == name
            command = "document.querySelector('pre').textContent"
            assert await shown.js(command) == f"python -m tasks prepare push PATH/TO/{name}"
            return name, base64.b64decode((await shown.js(read)).split(",", 1)[1])

    name, data = asyncio.run(record())
    assert re.fullmatch(r"push-clip\.(mp4|webm)", name)
    (tmp_path / name).write_bytes(data)
    return tmp_path / name


@pytest.mark.skipif(not browser.CHROMIUM, reason="needs Chromium")
def test_a_browser_records_what_its_camera_sees(tmp_path):
    """A white square that goes right."""
    film = np.full((25, 360, 640, 3), 90, np.uint8)
    for t, frame in enumerate(film):
        frame[200:260, 120 + 14 * t : 180 + 14 * t] = 240
    frames = video.read(recorded(tmp_path, film, 3))[0]
    places = [np.argwhere(frame.mean(-1) > 180).mean(0) for frame in frames]
    assert len(frames) > 20 and np.ptp(places, axis=0)[1] > 40 > 5 > np.ptp(places, axis=0)[0]


@pytest.mark.skipif(not browser.CHROMIUM, reason="needs Chromium")
def test_prepare_takes_what_a_browser_recorded(tmp_path):
    """A look-alike of an arm that pushes. It comes again and again, and so the recording jumps."""
    env = tasks.bare("push", embodiment="human")
    clip = look_alike(*record_expert(env, 3)[:2])
    env.close()
    t = np.arange(0, clip.times[-1], 0.04)
    film = clip.frames[np.abs(clip.times - t[:, None]).argmin(1)]
    result = prepare("push", recorded(tmp_path, film, 2 * t[-1]))
    assert not result.why_not and result.film.shape[1:] == (84, 84, 3)


def test_an_outline_has_no_specks():
    """A square of 6 by 6 pixels of a frame, and beside it one that is smaller than a pixel."""
    mask = np.zeros((80, 80), bool)
    mask[8:32, 8:32] = True
    mask[40:44, 40:44] = True
    (polygon,) = _contours(mask)
    assert np.ptp(np.array(polygon), axis=0) == pytest.approx((6, 6), abs=0.3)
