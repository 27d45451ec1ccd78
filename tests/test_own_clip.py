"""A clip of one's own in the folder of a run."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from lbw_minimal.clips.stills import read_stills, write_stills
from tasks.commands import own_clip
from tasks.commands.links import folder, mark
from tasks.commands.own_clip import bring


def test_a_run_on_a_clip_keeps_clear_of_other_runs():
    assert folder("push", None) == Path("runs/push")
    assert folder("push", Path("clips/my clip.v2.mp4")) == Path("runs/push-my clip.v2")
    assert folder("push", Path("my.mp4"), Path("there")) == Path("there/push-my")


def test_of_two_clips_of_one_name_each_keeps_its_folder(tmp_path):
    mine, yours = tmp_path / "mine" / "my.mp4", tmp_path / "yours" / "my.mp4"
    for clip, data in ((mine, b"a push"), (yours, b"another")):
        clip.parent.mkdir()
        clip.write_bytes(data)
    runs = tmp_path / "runs"
    for clip, name in ((mine, "push-my"), (yours, "push-my-2"), (mine, "push-my")):
        here = folder("push", clip, runs)
        assert here == runs / name
        here.mkdir(parents=True, exist_ok=True)
        (here / "prepare.json").write_text(json.dumps({"mark": mark(clip)}))
    mine.write_bytes(b"a plea")  # as long, and filmed again
    assert folder("push", mine, runs) == runs / "push-my-3"
    film = runs / "push-my-2" / "reenactment.mp4"  # made of yours, and so has its run
    assert mark(film) == mark(yours)
    film.with_name("prepare.json").write_text("{")  # nobody's, as far as is known
    assert folder("push", mine, runs) == runs / "push-my-2"


def test_stills_come_back_in_their_order_and_an_older_clips_are_removed(tmp_path):
    file = tmp_path / "stills.webp"
    assert read_stills(file) is None
    stills = np.stack([np.full((252, 252, 3), (50 * k, 0, 200), np.uint8) for k in range(5)])
    write_stills(file, stills)
    back = read_stills(file)
    assert back.shape == stills.shape and back.dtype == np.uint8
    colours = np.median(back, axis=(1, 2))  # at the edges the compression mixes neighbours
    np.testing.assert_allclose(colours, stills[:, 0, 0], atol=2)
    write_stills(file, stills[:0])
    assert not file.exists()
    write_stills(file, stills[:0])


NOTE = {
    "clip": "my.mp4",
    "corrections": "--tip 3,4@1",
    "command": "prepare push my.mp4 --tip 3,4@1",
}


def prepared(here):
    """What `prepare` leaves in a folder, of a clip called my.mp4."""
    here.mkdir()
    nav = "<nav><a href='../../gallery/index.html'>all tasks</a></nav>\n"
    (here / "prepare.html").write_text(f"{nav}Push: usable. <nav>\\1</nav>\n")
    (here / "stills.webp").write_bytes(b"stills of my.mp4")
    (here / "reenactment.mp4").write_bytes(b"its motion")
    (here / "prepare.json").write_text(json.dumps(NOTE))
    return here / "reenactment.mp4"


def test_a_film_that_prepare_made_brings_its_page_with_links_of_the_runs_own(tmp_path, monkeypatch):
    run, film = tmp_path / "run", prepared(tmp_path / "made")
    run.mkdir()
    monkeypatch.setattr(own_clip, "links", lambda page: f"<nav>{page.parent.name} \\2</nav>\n")
    clip = SimpleNamespace(done=None, file=b"as it is learnt from")
    assert bring(run, "push", clip, film) == NOTE
    page = (run / "prepare.html").read_text()
    assert page == "<nav>run \\2</nav>\nPush: usable. <nav>\\1</nav>\n"
    assert (run / "stills.webp").read_bytes() == b"stills of my.mp4"
    assert (run / "reenactment.mp4").read_bytes() == b"as it is learnt from"
    assert bring(tmp_path, "push", clip, run / "reenactment.mp4") == NOTE  # so has the run's film
    assert bring(run, "push", clip, run / "reenactment.mp4") == NOTE  # where it lies already
    again = tmp_path / "made" / ".." / "run"  # the same place
    assert bring(again, "push", clip, run / "reenactment.mp4") == NOTE


def test_any_other_clip_gets_a_page_of_its_own(tmp_path, monkeypatch):
    """One that was not made by `prepare`, one alone, and one that had to be done again."""
    wrote = []
    monkeypatch.setattr(own_clip, "write", lambda *what: wrote.append(what))
    own, again = SimpleNamespace(done=None, file=b""), SimpleNamespace(done="motion", file=b"")
    film = prepared(tmp_path / "made")
    alone = tmp_path / "reenactment.mp4"
    for clip, file in ((own, film.with_name("my clip.mp4")), (own, alone), (again, film)):
        file.write_bytes(b"a film")
        said = bring(tmp_path, "push", clip, file)
        known = {"clip": file.name, "mark": mark(file), "task": "push", "corrections": ""}
        assert said == known | {"command": ""}
        note = wrote[-1][-1]
        assert wrote.pop()[:3] == (tmp_path, "push", clip)
        quoted = f"'{file}'" if " " in str(file) else f"{file}"
        assert note == said | {"command": f"python -m tasks prepare push {quoted}"}
