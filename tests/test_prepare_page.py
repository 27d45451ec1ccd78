"""The page of `prepare` in a browser: what a click into a frame of the clip does."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lbw_minimal.clips.page import confidence, courses, write_page
from lbw_minimal.clips.paths import Tracks
from lbw_minimal.clips.shots import clip_frames
from tests import browser
from tests.test_pages import AUDIT, FINE, PHONE, WIDE

COMMAND = "python -m tasks prepare push 'my push.mp4' --out runs/a"
LEARN = "python -m tasks push --video runs/a/reenactment.mp4"
N = 12  # frames, 10 a second, all of which the page shows
CLICK = """
(what, i, x, y) => {
  document.querySelector(`[value=${what}]`).click();
  const img = document.querySelectorAll(".clip img")[i], box = img.getBoundingClientRect();
  const [clientX, clientY] = [box.left + x * box.width, box.top + y * box.height];
  img.dispatchEvent(new MouseEvent("click", {clientX, clientY, bubbles: true}));
}
"""
# An event made by a script has whole pixels: each frame gets 160x120 of them.
WHOLE = """
.clip { position: absolute; left: 0; top: 0; width: 160px; display: block }
.clip img { height: 120px } .clip figcaption { height: 20px; font-size: 5px }
"""
STATE = """
({command: document.getElementById("command").textContent,
  copy: document.getElementById("copy").textContent,
  dots: [...document.querySelectorAll(".clip .click")].map(dot => {
    const [a, b] = [dot, dot.parentElement.querySelector("img")]
      .map(e => e.getBoundingClientRect());
    return [dot.parentElement.querySelector("img").dataset.time,
      getComputedStyle(dot).backgroundColor,
      (a.left + a.width / 2 - b.left) / b.width, (a.top + a.height / 2 - b.top) / b.height];
  })})
"""


def clip():
    """A grey clip of 320x240 pixels and what was found in it: the tip, not surely at first."""
    frames, times = np.full((N, 240, 320, 3), 120, np.uint8), np.arange(N) / 10
    sure = np.where(times < 0.35, 0.2, 0.9)
    path = np.stack([20.0 * np.arange(N) + 20, np.full(N, 100.0)], 1)
    return frames, times, Tracks(times, path, path + 40, sure, np.ones(N), 240)


def write(folder):
    """The page of a usable clip, and of one in which nothing was looked for."""
    frames, times, tracks = clip()
    common = {"task": "push", "command": COMMAND, "frames": frames, "times": times,
              "scene": SimpleNamespace(), "notes": ["It was dark."]}  # fmt: skip
    write_page(
        folder / "prepare.html", verdict="usable, with a warning", tracks=tracks, learn=LEARN,
        warnings=["The clip jumps once."], **common,
    )  # fmt: skip
    write_page(folder / "not.html", verdict="not usable: no arm is seen.", warnings=[], **common)


CHOICES = "[...document.querySelectorAll('[name=what]')].map(e => e.value + +e.checked)"
END = '[...document.querySelectorAll("section")].at(-1).innerText.split("\\n")'
# What can be clicked, and how many pictures of the clip stand side by side.
PAPER = """
[[...document.querySelectorAll("input, button, summary")].filter(e => e.checkVisibility()
   && !e.closest(".film")).length,
 (tops => tops.filter(top => top === tops[0]).length)(
   [...document.querySelectorAll(".clip img")].map(e => e.getBoundingClientRect().top))]
"""
# How far below the window's upper edge the choice of a dot is, while the last picture is looked at.
CHOICE = """
(() => {
  document.querySelector(".clip figure:last-child").scrollIntoView({block: "end"});
  const top = document.querySelector("[name=what]").closest("p").getBoundingClientRect().top;
  scrollTo(0, 0);
  return top;
})()
"""


async def look(folder):
    """The page before a click, after each, and after each button."""
    states = {}
    async with browser.opened(
        folder / "prepare.html", folder / "profile", "--hide-scrollbars"
    ) as page:
        await page.js('addEventListener("copy", () => window.copied = getSelection().toString())')
        await page.js(f"document.head.insertAdjacentHTML('beforeend', `<style>{WHOLE}</style>`)")
        states["first"] = await page.js(STATE)
        for name, click in {
            "tip": "'tip', 2, 0.25, 0.5", "again": "'tip', 2, 0.5, 0.75",
            "object": "'object', 2, 1, 0.5", "edge": "'tip', 7, 1.2, -0.2",
        }.items():  # fmt: skip
            await page.js(f"({CLICK})({click})")
            states[name] = await page.js(STATE)
        await page.call(
            "Runtime.evaluate", expression='document.getElementById("copy").click()',
            userGesture=True,
        )  # fmt: skip
        states["copied"] = await page.js("window.copied"), (await page.js(STATE))["copy"]
        await page.js("document.head.lastElementChild.remove()")
        for width, theme in ((WIDE, "light"), (PHONE, "light"), (WIDE, "dark")):
            size = {"width": width, "height": 900, "deviceScaleFactor": 1}
            await page.call("Emulation.setDeviceMetricsOverride", mobile=width == PHONE, **size)
            night = [{"name": "prefers-color-scheme", "value": theme}]
            await page.call("Emulation.setEmulatedMedia", features=night)
            states[width, theme] = await page.js(AUDIT)
            states[width, "choice"] = await page.js(CHOICE)
        await page.call("Emulation.setEmulatedMedia", media="print")
        states["paper"] = await page.js(PAPER)
        await page.call("Emulation.setEmulatedMedia", media="screen")
        states["clicked end"] = await page.js(END)
        await page.js('document.getElementById("again").click()')
        states["none"] = await page.js(STATE)
        states["end"] = await page.js(END)
        for click in ("'from', 1, 0.5, 0.5", "'to', 9, 0.5, 0.5", "'to', 8, 0.2, 0.5"):
            await page.js(f"({CLICK})({click})")
        states["cut"] = await page.js(STATE)
        hidden, states["swapped"] = "document.getElementById('swapped').hidden", []
        for click in ("'from', 2, 0.5, 0.5", "'to', 5, 0.5, 0.5", "'to', 1, 0.5, 0.5",
                      "'from', 0, 0.5, 0.5"):  # fmt: skip
            await page.js(f"({CLICK})({click})")
            states["swapped"].append(await page.js(hidden))
        await page.call("Page.navigate", url=(folder / "not.html").as_uri())
        there = "location.pathname.endsWith('/not.html') && document.readyState"
        await page.until(there, "complete")
        states["not usable"] = await page.js(AUDIT), await page.js(CHOICES)
        await page.js(f"({CLICK})('from', 3, 0.5, 0.5)")
        states["not usable, cut"] = await page.js(STATE)
    return states


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    return browser.seen(tmp_path_factory, write, look)


TIP, OBJECT = "rgb(213, 94, 0)", "rgb(86, 180, 233)"


def places(state):
    return [(when, colour, round(x, 2), round(y, 2)) for when, colour, x, y in state["dots"]]


def test_a_click_writes_an_option_and_draws_a_dot_in_the_colour_of_its_thing(seen):
    assert seen["first"] == {"command": COMMAND, "copy": "Copy", "dots": []}
    assert seen["swapped"] == [True, True, False, True]  # hidden; alone, in order, swapped, again
    assert seen["tip"]["command"] == f"{COMMAND} --tip 80,120@0.200"
    assert places(seen["tip"]) == [("0.200", TIP, 0.25, 0.5)]


def test_a_second_click_for_the_same_thing_in_a_frame_replaces_the_first(seen):
    assert seen["again"]["command"] == f"{COMMAND} --tip 160,180@0.200"
    assert places(seen["again"]) == [("0.200", TIP, 0.5, 0.75)]


def test_clicks_for_both_things_and_into_several_frames_add_up(seen):
    both = f"{COMMAND} --tip 160,180@0.200 --object 320,120@0.200"
    assert seen["object"]["command"] == both
    assert sorted(places(seen["object"])) == [
        ("0.200", TIP, 0.5, 0.75), ("0.200", OBJECT, 1, 0.5)
    ]  # fmt: skip
    assert seen["edge"]["command"] == f"{both} --tip 320,0@0.700"  # no place outside of the frame
    assert places(seen["edge"])[-1] == ("0.700", TIP, 1, 0)


def test_a_click_can_choose_the_first_and_the_last_picture_to_use(seen):
    """There the picture counts and not the place in it, so another picture replaces the first."""
    assert seen["cut"]["command"] == f"{COMMAND} --from 0.100 --to 0.800"
    assert [when for when, *_ in seen["cut"]["dots"]] == ["0.100", "0.800"]


def test_a_clip_that_was_not_searched_is_shown_and_can_be_cut(seen):
    """Where tip and object are would be no help: it was the whole picture that was not usable."""
    audit, choices = seen["not usable"]
    assert audit == FINE and choices == ["from1", "to0"]
    state = seen["not usable, cut"]
    assert state["command"] == f"{COMMAND} --from 0.300"
    assert [when for when, *_ in state["dots"]] == ["0.300"]


def test_the_command_is_copied_and_the_clicks_can_be_taken_back(seen):
    assert seen["copied"] == (seen["edge"]["command"], "Copied")
    assert seen["none"] == seen["first"]


def test_the_page_ends_with_what_comes_next(seen):
    assert seen["end"][0] == "Next" and seen["end"][-1] == LEARN
    assert not any("corrected" in line for line in seen["end"])


def test_after_a_click_the_corrected_command_comes_first(seen):
    assert any("corrected command above first" in line for line in seen["clicked end"])


@pytest.mark.parametrize("how", [(WIDE, "light"), (PHONE, "light"), (WIDE, "dark")])
def test_the_page_can_be_read(seen, how):
    assert seen[how] == FINE


def test_on_a_phone_the_choice_of_a_dot_stays_in_sight_at_the_last_picture(seen):
    assert 0 <= seen[PHONE, "choice"] < 10


def test_of_black_lines_a_page_speaks_only_where_the_picture_changes(tmp_path):
    frames, times, tracks = clip()
    for cuts in ((), (6,)):
        write_page(
            tmp_path / "page.html", task="push", command="", verdict="usable", frames=frames,
            times=times, scene=SimpleNamespace(), notes=[], warnings=[],
            tracks=replace(tracks, cuts=cuts),
        )  # fmt: skip
        assert ("black line" in (tmp_path / "page.html").read_text()) == bool(cuts)


@pytest.mark.parametrize("done", [True, False])
def test_the_legends_name_every_path_and_cover_none(done):
    _, _, tracks = clip()
    path = np.zeros((N, 2))
    motion = SimpleNamespace(tip=path, object=path, contact=2, arrival=9)
    states = np.zeros((N, 9)) if done else None
    figures = confidence(tracks), courses(motion, SimpleNamespace(goal=(0.5, 0.0)), states)
    for figure, names in zip(figures, (["tip", "object"], ["tip", "object", "goal"]), strict=True):
        figure.canvas.draw()
        (legend,) = figure.legends
        assert [text.get_text() for text in legend.get_texts()] == names
        over = legend.get_window_extent().padded(-5)  # without its empty border, pixels
        assert not any(over.overlaps(axis.get_window_extent()) for axis in figure.axes)


def test_on_paper_nothing_asks_for_a_click(seen):
    assert seen["paper"] == [0, 4]


@pytest.mark.parametrize(
    ("yours", "asked"),
    [
        ((), "on the tip, or not on the object?"),
        (("tip",), "on the object?"),
        (("object",), "on the tip?"),
        (("tip", "object"), None),
    ],
)
def test_a_page_asks_only_for_dots_that_are_not_the_users(yours, asked, tmp_path):
    frames, times, tracks = clip()
    for name in yours:
        tracks = tracks.marked(name, [(50.0, 60.0, 0.0), (50.0, 60.0, 1.1)])
    write_page(
        tmp_path / "page.html", task="push", command="", verdict="not usable: it rains.",
        frames=frames, times=times, scene=SimpleNamespace(), notes=[], warnings=[], tracks=tracks,
    )  # fmt: skip
    text = (tmp_path / "page.html").read_text()
    assert ("Is a dot below not" in text) == bool(asked) and (asked or "") in text


def test_pictures_outside_of_what_is_used_are_grey_and_say_so():
    frames = clip_frames(*clip(), (0.3, 0.82)).split("<figure")[1:]
    grey = ["class=unused" in frame for frame in frames]
    assert grey == [not 3 <= i <= 8 for i in range(N)]
    assert ["; not used" in frame for frame in frames] == grey
    assert "tip 20% sure, object 100% sure" in frames[3]
    assert "unused" not in clip_frames(*clip())


def test_a_picture_that_was_clicked_is_among_those_that_are_shown():
    """Of sixty frames a dozen are shown, and the first and the last that have a click."""
    frames, t = np.zeros((60, 90, 120, 3), np.uint8), np.arange(60) / 25
    tracks = Tracks(t, np.full((60, 2), 50.0), np.full((60, 2), 70.0), *np.ones((2, 60)), side=90)
    whole = clip_frames(frames, t, tracks)
    clicked = clip_frames(frames, t, tracks.marked("tip", [(9.0, 9, t[7]), (9, 9, t[31])]))
    times = [re.findall(r'data-time="([0-9.]+)"', text) for text in (whole, clicked)]
    assert set(times[1]) - set(times[0]) == {"0.280", "1.240"} and times[1] == sorted(times[1])


def test_what_the_user_placed_is_called_yours_and_no_share_of_certainty():
    """Clicks at 0.3 and 0.5 s place the tip from there to there."""
    frames, times, tracks = clip()
    tracks = tracks.marked("tip", [(80, 100, 0.3), (120, 100, 0.5)])
    shots = clip_frames(frames, times, tracks).split("<figure")[1:]
    assert ["tip yours, object 100% sure" in shot for shot in shots] == [
        3 <= i <= 5 for i in range(N)
    ]
