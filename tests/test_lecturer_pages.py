"""The grader's pages by day, by night, on a phone and on paper."""

import pytest

from tests import browser
from tests.grade import alike, items
from tests.grade.feedback import page
from tests.test_lecturer import HINT, ODD, a_class, exercise, record
from tests.test_pages import AUDIT, FINE, PAPER, PHONE, SHEET, WIDE

NAMES = ["items.html", "alike.html", "feedback.html"]


def write_pages(folder):
    grades = [record("a student with a long name", exercise("6.1", 0, HINT), exercise("6.2", 2))]
    grades += [record(f"s{i}", exercise("6.1", 2), exercise("6.2", i % 3)) for i in range(9)]
    found = items.statistics(grades, ["6.1", "6.2"])
    (folder / "items.html").write_text(items.items_page(found, 1))
    class_ = a_class(ODD, ODD + "    # " + "a long line " * 20)
    (folder / "alike.html").write_text(alike.alike_page(class_, [{"6.1"}] * 22))
    grades[0]["exercises"][0]["example"] = f"r1({'0.25, ' * 60})\n# it is too small"
    (folder / "feedback.html").write_text(page(grades[0]))


async def look(folder):
    """What is seen of each page: name, how -> what AUDIT or PAPER say."""
    seen = {}
    async with browser.opened(folder / NAMES[0], folder / "profile", "--hide-scrollbars") as shown:
        for name in NAMES:
            await shown.call("Page.navigate", url=(folder / name).as_uri())
            there = f"location.pathname.endsWith('/{name}') && document.readyState"
            await shown.until(there, "complete")
            for how, media, width, code in (
                ("day", "screen", WIDE, AUDIT), ("night", "screen", WIDE, AUDIT),
                ("phone", "screen", PHONE, AUDIT), ("paper", "print", SHEET, PAPER),
            ):  # fmt: skip
                size = {"width": width, "height": 900, "deviceScaleFactor": 1}
                await shown.call("Emulation.setDeviceMetricsOverride", mobile=False, **size)
                scheme = {"value": "dark" if how == "night" else "light"}
                scheme["name"] = "prefers-color-scheme"
                await shown.call("Emulation.setEmulatedMedia", media=media, features=[scheme])
                await shown.js("document.querySelectorAll('details').forEach(d => d.open = true)")
                seen[name, how] = await shown.js(code)
                ground = "getComputedStyle(document.body).backgroundColor"
                seen[name, how]["ground"] = await shown.js(ground)
    return seen


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    return browser.seen(tmp_path_factory, write_pages, look)


@pytest.mark.parametrize("how", ["day", "night", "phone"])
@pytest.mark.parametrize("name", NAMES)
def test_a_page_can_be_read(seen, name, how):
    found = dict(seen[name, how])
    dark = found.pop("ground") == "rgb(22, 24, 28)"
    assert found == FINE and dark == (how == "night")


@pytest.mark.parametrize("name", NAMES)
def test_a_page_is_whole_on_paper(seen, name):
    assert seen[name, "paper"]["cut"] == [] and seen[name, "paper"]["folded"] == 0
