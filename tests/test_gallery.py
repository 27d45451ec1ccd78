"""The gallery: one page and two scenes a task, which need nothing but each other."""

import re

import tasks
from tasks.commands import gallery


def test_the_page_shows_a_task_with_its_two_scenes(tmp_path, monkeypatch):
    monkeypatch.setattr(tasks, "TASKS", ("reach",))
    page = gallery.write(tmp_path).read_text()
    scenes = re.findall(r'<iframe[^>]* src="([^"]+)"', page)
    assert scenes == ["reach-human.html", "reach-robot.html"]
    for name in scenes:
        scene = (tmp_path / name).read_text()
        assert "MeshCat.Viewer" in scene and len(scene) < 2e6
    assert page.count("<figure>") == 8 + 3  # frames of the demonstration, two scenes and a film
    assert page.count('<img class="still" alt="reach, ') == 2  # what is printed of the scenes
    assert str(tmp_path) not in page and str(tasks.ROOT) not in page
    assert not re.search(r'(?:src|href)="(?!data:|reach-)', page)
