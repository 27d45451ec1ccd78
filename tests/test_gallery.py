"""The gallery: one page and two scenes a task, which need nothing but each other."""

import re
import subprocess
from types import SimpleNamespace

import browser
import cv2
import numpy as np
import pytest
from PIL import Image

import tasks
from tasks.commands import gallery, own_arm

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A gallery of two tasks, one of which nobody has trained yet, and a clip."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tasks, "TASKS", ("domino", "reach"))
        patch.setattr(own_arm, "prepared", lambda: SimpleNamespace(done=True))
        patch.setattr(own_arm, "section", lambda clip: "")
        patch.setattr(own_arm, "strip", lambda clip: b"six moments")
        said = []
        patch.setattr("builtins.print", lambda text, **how: said.append(text))
        page = gallery.write(tmp_path_factory.mktemp("gallery"))
    assert said == [
        f"domino: left out, for it has no weights in {tasks.WEIGHTS / 'domino'}", "reach: done",
    ]  # fmt: skip
    return page.parent


def test_the_page_shows_a_task_with_its_two_scenes(folder):
    page = (folder / "index.html").read_text()
    scenes = re.findall(r'<iframe[^>]* src="([^"]+)"', page)
    assert scenes == ["reach-human.html", "reach-robot.html"]
    for name in scenes:
        scene = (folder / name).read_text()
        assert "MeshCat.Viewer" in scene and len(scene) < 2e6
    assert page.count("<figure>") == 8 + 2  # frames of the demonstration, two scenes
    assert page.count("<video") == 1
    assert (folder / "lookalike.png").read_bytes() == b"six moments"
    assert page.count('<img class="still" alt="reach, ') == 2  # what is printed of the scenes
    assert str(folder) not in page and str(tasks.ROOT) not in page
    assert not re.search(r'(?:src|href)="(?!data:|reach-)', page)


@pytest.mark.skipif(not browser.CHROMIUM, reason="needs Chromium")
@pytest.mark.parametrize(("copies", "sheets"), [(2, 1), (3, 2)])
def test_two_tasks_are_printed_on_a_sheet(copies, sheets, folder, tmp_path):
    """It was one a sheet, with most of it white."""
    page = re.sub(
        "<section>.*</section>",
        lambda found: found[0] * copies,
        (folder / "index.html").read_text(),
        flags=re.DOTALL,
    )
    (tmp_path / "page.html").write_text(page)
    line = [browser.CHROMIUM, "--headless", "--no-sandbox", f"--user-data-dir={tmp_path}/profile",
            f"--print-to-pdf={tmp_path}/page.pdf", "--no-pdf-header-footer"]  # fmt: skip
    url = (tmp_path / "page.html").as_uri()
    subprocess.run([*line, url], capture_output=True, check=True, timeout=120)
    assert len(re.findall(rb"/Type\s*/Page\b", (tmp_path / "page.pdf").read_bytes())) == sheets


def test_a_clip_of_ones_own_is_shown_and_called_a_look_alike():
    """It is read from a file, found usable, and done again; six of its moments make a picture."""
    clip = own_arm.prepared()
    assert clip.verdict.startswith("usable") and clip.done.recording.success[-1]
    moments = own_arm.columns(clip, 6)
    assert len(moments) == 6 and moments[0][0] == 0
    assert all(image.shape == (189 + 252 + 252, 252, 3) for _, image in moments)
    row = cv2.imdecode(np.frombuffer(own_arm.strip(clip), np.uint8), cv2.IMREAD_COLOR)
    assert row.shape == (462, 6 * 168, 3)
    off = row[:, :168, ::-1] - cv2.resize(
        moments[0][1], (168, 462), interpolation=cv2.INTER_AREA
    ).astype(float)
    assert np.abs(off).mean() < 8  # the first moment stands first, in few colours
    page = own_arm.section(clip)
    assert page.count('<img src="data:') == 8 == page.count('alt="At ')
    assert "look-alike" in page and "no real person's clip" in page


def test_the_readmes_picture_is_of_the_same_kind_and_says_so():
    text = (tasks.ROOT / "README.md").read_text(encoding="utf-8")
    (alt,) = re.findall(r"!\[([^]]*)\]\(solutions/weights/eyes/lookalike\.png\)", text)
    assert "look-alike" in alt and "simulator" in alt
    picture = cv2.imread(str(tasks.WEIGHTS / "eyes" / "lookalike.png"))
    assert picture.shape[1] == 6 * 168 and picture.std() > 20


def test_the_readmes_film_is_small_moves_and_is_still_where_that_is_asked_for():
    text = (tasks.ROOT / "README.md").read_text(encoding="utf-8")
    film = tasks.ROOT / "solutions" / "results" / "push.webp"
    alt, name = re.search(r'<img alt="([^"]+)" src="([^"]+\.webp)"', text).groups()
    assert (tasks.ROOT / name) == film and len(alt) > 50
    assert film.stat().st_size < 400_000
    with Image.open(film) as frames:
        assert frames.n_frames > 30 and frames.size == (768, 252)
    (still,) = re.findall(r'prefers-reduced-motion: reduce\)" srcset="([^"]+)"', text)
    assert (tasks.ROOT / still).exists()
