"""The kit's pages on a wide screen, on a phone and on paper: legible, described, and whole."""

import asyncio
import re

import nbformat
import numpy as np
import pytest
from jupyter_server.services.config.manager import ConfigManager
from jupyterlab_server.config import get_page_config

import tests.test_report as a_run
from lbw_minimal import report
from lbw_minimal.diagram import method
from solutions import __main__ as course
from solutions.alt import words
from tasks.commands import links
from tasks.world.viewer import STILL
from tests import browser
from tests.grade.feedback import page as feedback

WIDE, PHONE = 1400, 390  # pixels
SHEET = 718  # pixels: A4 between Chromium's margins
LEAST = 4.5  # contrast of text, WCAG 2's AA
LONG = "print(" + " + ".join(f"'the word number {i}'" for i in range(12)) + ")"

# What a reader would miss. A text's colour counts with the opacity of all that it is in.
AUDIT = """
(() => {
  const numbers = s => s.match(/[\\d.]+/g).map(Number);
  const light = c => c.map(v => v / 255)
    .map(v => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0.05);
  const up = function* (e) { for (; e; e = e.parentElement) yield getComputedStyle(e); };
  const behind = e => {
    for (const s of up(e)) {
      const c = numbers(s.backgroundColor);
      if ((c[3] ?? 1) > 0.5) return c;
    }
    return [255, 255, 255];
  };
  const faint = [], texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const e = texts.currentNode.parentElement, text = texts.currentNode.textContent.trim();
    if (!text || !e.checkVisibility({visibilityProperty: true})) continue;
    const ground = behind(e).slice(0, 3), ink = numbers(getComputedStyle(e).color);
    const share = [...up(e)].reduce((all, s) => all * s.opacity, 1);
    const [a, b] = [ground, ground.map((v, i) => share * ink[i] + (1 - share) * v)].map(light);
    const contrast = Math.max(a, b) / Math.min(a, b);
    if (contrast < LEAST) faint.push([text.slice(0, 20), contrast]);
  }
  const shown = [...document.querySelectorAll("body *")].filter(e => e.checkVisibility());
  const cut = shown.filter(e => e.scrollWidth > e.clientWidth + 2 && e.clientWidth > 0
    && getComputedStyle(e).overflowX === "hidden");
  // A keyboard cannot scroll it; a formula has to be. In a sentence colour alone tells no link.
  const scrolls = shown.filter(e => e.scrollWidth > e.clientWidth + 2 && e.clientWidth > 0
    && getComputedStyle(e).overflowX === "auto"
    && !e.matches("[tabindex], :has([tabindex], math)"));
  const plain = shown.filter(e => e.matches("p a, li a, td a") && e.href
    && e.parentElement.textContent.trim() !== e.textContent.trim()
    && !getComputedStyle(e).textDecorationLine.includes("underline")
    && getComputedStyle(e).fontWeight === getComputedStyle(e.parentElement).fontWeight);
  return {
    faint, cut: cut.map(e => e.className), scrolls: scrolls.map(e => e.tagName + e.className),
    "links": plain.map(e => e.textContent),
    "no alt": [...document.images].filter(i => !i.alt || i.alt.includes("No desc")).length,
    "no title": [...document.querySelectorAll("iframe")].filter(f => !f.title).length,
    "too wide": Math.max(0, document.documentElement.scrollWidth - innerWidth),
    "no viewport": +!document.querySelector("meta[name=viewport]"),
    "no language": +!document.documentElement.lang,
  };
})()
""".replace("LEAST", str(LEAST))
FINE = {"faint": [], "cut": [], "scrolls": [], "links": [], "no alt": 0, "no title": 0}
FINE |= {"too wide": 0, "no viewport": 0, "no language": 0}
# Where a screen reader may jump to, what is for paper alone and yet on the screen, and how light
# the page is, from 0 to 1.
PLACES = """
({main: document.querySelectorAll("main").length, nav: document.querySelectorAll("nav").length,
  stills: [...document.querySelectorAll(".still")].filter(e => e.checkVisibility()).length,
  light: getComputedStyle(document.body).backgroundColor.match(/[\\d.]+/g)
    .slice(0, 3).reduce((sum, v) => sum + v / 765, 0)})
"""
# Blocks whose content does not fit on the paper, whether a scene or its picture is printed, and
# what is folded there, where nobody can unfold it.
PAPER = """
(() => {
  const shown = [...document.querySelectorAll("body *")].filter(e => e.checkVisibility());
  const far = shown.filter(e => e.getBoundingClientRect().right > innerWidth + 1
    || (e.scrollWidth > e.clientWidth + 2 && e.clientWidth > 0 && e.tagName !== "SPAN"));
  const folds = [...document.querySelectorAll("details")];
  return {
    folds: folds.length,
    folded: folds.filter(e => !e.lastElementChild.checkVisibility()).length,
    cut: far.map(e => e.tagName + "." + e.className),
    scenes: shown.filter(e => ["IFRAME", "VIDEO"].includes(e.tagName)).length,
    stills: shown.filter(e => e.className === "still" && e.clientHeight > 50).length,
  };
})()
"""

# Options and intervals of which a part is in another line.
BROKEN = """
[...document.querySelectorAll("pre, .tiles b")].flatMap(e => {
  const texts = document.createTreeWalker(e, NodeFilter.SHOW_TEXT), broken = [];
  while (texts.nextNode()) {
    const node = texts.currentNode, range = document.createRange();
    for (const {index, 0: word} of node.textContent.matchAll(/--[a-z-]+|\\d+-\\d+ %/g)) {
      range.setStart(node, index);
      range.setEnd(node, index + word.length);
      if (new Set([...range.getClientRects()].map(r => r.top)).size > 1) broken.push(word);
    }
  }
  return broken;
})
"""
LARGE = "document.fullscreenElement?.alt"


def book_page():
    """A page of the book with long code, what check() says, a figure and a scene."""
    source = course.sources()[1]
    notebook = nbformat.read(source, as_version=4)
    notebook.cells = [c for c in notebook.cells if c.cell_type == "markdown"]
    png = re.search(r"base64,([^\"]*)", report.demonstration(a_run.frames(1), None, None, 25))[1]
    figure = nbformat.v4.new_output(
        "display_data", {"image/png": png}, metadata={"image/png": {"alt": "a square"}}
    )
    scene = nbformat.v4.new_output(
        "execute_result",
        {
            "text/html": f'<style>{STILL}</style><iframe title="a scene" srcdoc="x"></iframe>'
            f'<img class="still" alt="a scene" width="200" src="data:image/png;base64,{png}">'
        },
        execution_count=2,
    )
    said = nbformat.v4.new_output("stream", text="ok 1/1 " + "a long line " * 20 + "\n")
    code = f'x = 1.5  # a comment\nif x in (1, 2):\n    """text"""\n    {LONG}'
    notebook.cells.append(
        nbformat.v4.new_code_cell(code, outputs=[said, figure, scene], execution_count=1)
    )
    return course.page(notebook, source)


BAD = """<!doctype html><p style="opacity: 0.5; color: #616161">faint</p>
<img src="data:,"><iframe></iframe><div style="width: 3000px">wide</div>
<div class="x" style="overflow: hidden; width: 9px">clipped</div>
<pre style="overflow: auto; width: 9px">command</pre>
<p>a <a href="x" style="text-decoration: none">link</a></p>
<details><summary>folded</summary><p>hidden</p></details>"""
OURS = ["book.html", "contents.html", "glossary.html", "report.html"]
NAMES = [*OURS, "feedback.html"]


def write_pages(folder):
    """Pages of the kit, and a bad one."""
    (folder / "bad.html").write_text(BAD)
    (folder / "book.html").write_text(book_page())
    (folder / "contents.html").write_text(course.contents())
    (folder / "glossary.html").write_text(course.glossary())
    others = links.links(folder / "report.html")
    more = "--translate-clip --from-scratch " * 6
    run = a_run.example() | {"command": f"python -m tasks push {more}--out {'folder/' * 20}"}
    report.write_report(folder / "report.html", **run, links=others)
    outcomes = [
        {"label": "the value", "points": 0, "most": 2, "message": "the sign is wrong"},
        {"label": "the shape", "points": 1, "most": 1, "message": None},
    ]
    exercise = {"id": "6.1", "title": "Distance", "outcomes": outcomes, "points": 1, "most": 3}
    done = {"submission": "ann", "points": 1, "most": 3, "notes": ["a note"]}
    exercise["open"], exercise["example"] = False, ""
    (folder / "feedback.html").write_text(feedback(done | {"exercises": [exercise]}))


async def look(folder):
    """What is seen of each page: name -> (on a wide screen, on a phone, on paper, in the dark)."""
    seen, night = {}, [{"name": "prefers-color-scheme", "value": "dark"}]
    # Without --hide-scrollbars a desktop's bar would take 15 pixels from the page.
    async with browser.opened(folder / "bad.html", folder / "profile", "--hide-scrollbars") as page:
        for name in ("bad.html", *NAMES):
            await page.call("Page.navigate", url=(folder / name).as_uri())
            there = f"location.pathname.endsWith('/{name}') && document.readyState"
            await page.until(there, "complete")
            seen[name] = []
            for media, width, code in (
                ("screen", WIDE, AUDIT), ("screen", PHONE, AUDIT), ("print", SHEET, PAPER),
            ):  # fmt: skip
                size = {"width": width, "height": 900, "deviceScaleFactor": 1}
                await page.call("Emulation.setDeviceMetricsOverride", mobile=width == PHONE, **size)
                await page.call("Emulation.setEmulatedMedia", media=media)
                seen[name].append(await page.js(code))
                if width == PHONE:
                    seen[name][-1]["broken"] = await page.js(BROKEN)
            size["width"] = WIDE
            await page.call("Emulation.setDeviceMetricsOverride", mobile=False, **size)
            await page.call("Emulation.setEmulatedMedia", media="screen", features=night)
            seen[name].append(await page.js(AUDIT) | await page.js(PLACES))
            await page.call("Emulation.setEmulatedMedia", media="screen", features=[])
        await page.call("Page.navigate", url=(folder / "report.html").as_uri())
        await page.until(
            "location.pathname.endsWith('/report.html') && document.readyState", "complete"
        )
        seen["large"] = []
        for _ in range(2):
            click = "document.querySelectorAll('.strip img')[2].click()"
            await page.call("Runtime.evaluate", expression=click, userGesture=True)
            await asyncio.sleep(0.5)
            seen["large"].append(await page.js(LARGE))
    return seen


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    return browser.seen(tmp_path_factory, write_pages, look)


@pytest.mark.parametrize("name", NAMES)
def test_a_page_can_be_read_on_a_screen_and_on_a_phone(seen, name):
    wide, phone, *_ = seen[name]
    # Beside a wide screen's code a reader may scroll, as in an editor.
    assert wide | {"scrolls": []} == FINE and phone == FINE | {"broken": []}


def test_a_picture_is_as_large_as_the_screen_after_a_click_and_small_after_another(seen):
    assert seen["large"] == ["Frame 3 of the video and its translation with keypoints", None]


@pytest.mark.parametrize("name", OURS)
def test_a_page_is_dark_where_that_is_asked_for_can_be_read_so_and_has_landmarks(seen, name):
    dark = seen[name][3]
    assert {key: dark[key] for key in FINE} | {"scrolls": []} == FINE
    assert dark["light"] < 0.2 and dark["main"] == 1 and dark["nav"] == 1
    assert dark["stills"] == 0


@pytest.mark.parametrize("name", NAMES)
def test_a_page_is_whole_on_paper(seen, name):
    """A scene or a film, which would be blank there, is a picture."""
    paper = seen[name][2]
    assert paper["cut"] == [] and paper["scenes"] == 0
    assert paper["stills"] == (name in ("book.html", "report.html"))
    assert paper["folded"] == 0 and (paper["folds"] > 5) == (name == "book.html")


def test_what_is_wrong_with_a_page_is_noticed(seen):
    wide, _, paper, _ = seen["bad.html"]
    assert wide["faint"][0] == ["faint", pytest.approx(2.17, abs=0.01)]
    assert wide["cut"] == ["x"] and all(wide[name] for name in FINE)
    assert paper["cut"] and paper["scenes"] == 1 and paper["folded"] == 1


def test_a_page_leads_to_those_beside_it_and_names_the_command_of_the_others(tmp_path):
    runs = tmp_path / "runs"
    for name in ("gallery/index.html", "push/report.html"):
        (runs / name).parent.mkdir(parents=True)
        (runs / name).touch()
    said = links.links(runs / "book" / "06_reward.html", runs)
    assert re.findall('href="([^"]+)"', said) == ["../gallery/index.html", "../push/report.html"]
    assert "python -m tasks paper" in said and "python -m tasks gallery" not in said
    assert "all tasks" not in links.links(runs / "gallery" / "index.html", runs)
    elsewhere = links.links(tmp_path / "report.html", runs)
    assert "href" not in elsewhere and str(tmp_path) not in elsewhere


def test_the_report_of_a_run_and_the_page_of_its_clip_lead_to_each_other(tmp_path):
    run, runs = tmp_path / "push-my", tmp_path / "runs"
    run.mkdir()
    for page in ("report.html", "prepare.html"):
        assert "href" not in links.links(run / page, runs)  # nothing is there yet
    (run / "settings.json").touch()
    assert re.findall('href="([^"]+)"', links.links(run / "prepare.html", runs)) == ["report.html"]
    (run / "prepare.html").touch()
    assert re.findall('href="([^"]+)"', links.links(run / "report.html", runs)) == ["prepare.html"]


def test_a_page_leads_to_the_runs_on_clips_which_bear_any_name(tmp_path):
    for name in ("push-a & b/prepare.html", "push-a & b/report.html", "slide-c/prepare.html",
                 "prepare/push-a & b/prepare.html", "other/report.html"):  # fmt: skip
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    for page in ("gallery/index.html", "push-d/report.html"):
        said = links.links(tmp_path / page, tmp_path)
        way = '<a href="../push-a%20%26%20b/report.html">a run on a clip: push-a &amp; b</a>'
        assert re.findall("<a href.*?</a>", said) == [way]  # the other clip's run is not done
    itself = links.links(tmp_path / "push-a & b" / "report.html", tmp_path)
    assert re.findall('href="([^"]+)"', itself) == ["prepare.html"]


def test_of_other_runs_on_clips_a_clips_page_says_which_are_its_own(tmp_path):
    """A clip was prepared, and learnt from for push and slide; another one has a run as well."""
    for name, mark in {"prepare/push-a": "7", "push-a": "7", "slide-a": "7", "push-b": "8"}.items():
        folder = tmp_path / name
        folder.mkdir(parents=True)
        (folder / "prepare.json").write_text(f'{{"mark": "{mark}"}}')
        for page in ("prepare.html", "report.html", "settings.json"):
            if not name.startswith("prepare") or page == "prepare.html":
                (folder / page).touch()

    def said(page):
        return re.findall(r">([^<>]*run[^<>]*)</a>", links.links(tmp_path / page, tmp_path))

    others = ["a run on another clip: push-b", "a run on this clip: slide-a"]
    assert said("prepare/push-a/prepare.html") == ["a run on this clip: push-a", *others]
    assert said("push-a/prepare.html") == ["the run on this clip", *others]
    assert said("push-a/report.html") == ["the clip of this run", *others]
    assert said("gallery/index.html") == [
        f"a run on a clip: {n}" for n in ("push-a", "push-b", "slide-a")
    ]


def test_a_figure_is_described_by_its_own_words():
    from matplotlib.figure import Figure

    figure = Figure()
    left, middle, right = figure.subplots(1, 3)
    left.plot([1, 2], label="OSC")
    left.set(title="along x", xlabel="time (s)", ylabel="to go (cm)")
    middle.set_title("the arm")
    middle.axis("off")
    shown = right.imshow(np.zeros((2, 2)))
    figure.colorbar(shown, label="reward")
    said = words(figure)
    assert said.startswith("along x: to go (cm) over time (s): OSC. the arm. Colours: reward.")
    assert said.endswith("A picture.")


def test_a_diagram_without_axes_is_described_by_what_is_written_in_it():
    frame, z = np.zeros((84, 84, 3), np.uint8), np.zeros((1, 2))
    said = words(method(frame, frame, z, frame, z))
    assert said.startswith("human x_i^E, translated v_i^E, ") and "MUNIT Eq. 1-5" in said


def test_the_kernel_of_the_book_puts_a_figures_words_beside_it(tmp_path, monkeypatch):
    cell = nbformat.v4.new_code_cell(
        "import matplotlib.pyplot as plt\nplt.plot([1, 2])\nplt.title('a line')\nplt.show()"
    )
    nbformat.write(nbformat.v4.new_notebook(cells=[cell]), tmp_path / "01_x.ipynb")
    (output,) = course.execute(tmp_path / "01_x.ipynb").cells[0].outputs
    assert output.metadata["image/png"]["alt"] == "a line."


def test_students_do_not_see_nbgraders_buttons(monkeypatch):
    """`make lab` starts JupyterLab with a folder of settings; a lecturer's own shows them."""
    line = re.search(r"JUPYTER_CONFIG_PATH=\$\(CURDIR\)/(\S+) .*jupyter lab", _makefile())
    monkeypatch.setenv("JUPYTER_CONFIG_PATH", str(course.ROOT / line[1]))
    assert "@jupyter/nbgrader" in get_page_config([])["disabledExtensions"]
    monkeypatch.delenv("JUPYTER_CONFIG_PATH")
    assert "@jupyter/nbgrader" not in get_page_config([])["disabledExtensions"]


def test_students_read_the_glossary_and_not_its_source(monkeypatch):
    """JupyterLab opens Markdown as a page where `make lab` starts it."""
    line = re.search(r"JUPYTER_CONFIG_PATH=\$\(CURDIR\)/(\S+) .*jupyter lab", _makefile())
    monkeypatch.setenv("JUPYTER_CONFIG_PATH", str(course.ROOT / line[1]))
    said = ConfigManager(config_dir_name="labconfig").get("default_setting_overrides")
    viewers = said["@jupyterlab/docmanager-extension:plugin"]["defaultViewers"]
    assert viewers == {"markdown": "Markdown Preview"}


def _makefile():
    return (course.ROOT / "Makefile").read_text(encoding="utf-8")
