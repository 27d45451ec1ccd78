"""`python -m tasks prepare`: a filmed clip goes in, a page, a film and a verdict come out."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from toy_clips import encode, room, shows

from lbw_minimal import tracks, video
from lbw_minimal.clips import page
from lbw_minimal.clips.arms import Arms
from lbw_minimal.clips.detector import Found
from lbw_minimal.clips.footage import Footage
from lbw_minimal.clips.lookalike import look_alike
from lbw_minimal.clips.page import write_page
from lbw_minimal.clips.paths import Unusable
from lbw_minimal.clips.reader import Clip, read_clip
from lbw_minimal.clips.stills import read_stills
from lbw_minimal.training import InputError
from tasks import VIDEOS, bare
from tasks.__main__ import main
from tasks.commands import prepare
from tasks.commands.choices import Choices
from tasks.commands.job import check, parser
from tasks.commands.prepare import Prepared, follow
from tasks.world import record_expert
from tasks.world.scene import FPS

SCALE = 3  # times the kit's frames: the clip's pixels


@pytest.fixture(scope="module")
def filmed(tmp_path_factory):
    """A push from the right, as a file, and where tip and object are in it."""
    env = bare("push", embodiment="human")
    frames, pixels, _ = record_expert(env, 3)
    env.close()
    path = tmp_path_factory.mktemp("clips") / "my push.mp4"
    video.write(path, frames[:, :, ::-1], FPS, SCALE)
    pixels = SCALE * (pixels * (-1, 1, -1, 1) + (84, 0, 84, 0))
    sure = np.ones(len(frames))
    return path, Found(pixels[:, :2], pixels[:, 2:], sure, sure)


@pytest.fixture(autouse=True)
def a_short_film(monkeypatch):
    """Translating is slow, and four steps show it."""
    monkeypatch.setattr(prepare, "SHOWN", 4)


@pytest.fixture
def eyes(filmed, monkeypatch):
    """A detector that is told the truth; what it says can be set."""
    monkeypatch.setattr(prepare, "look", lambda sights, frames, cuts, touched: eyes.found)
    eyes.found = filmed[1]
    return eyes


def blind(found):
    return Found(0 * found.tip, 0 * found.object, 0 * found.tip_sure, 0 * found.object_sure)


def test_a_clip_becomes_a_human_video_that_the_kit_takes_as_its_own(filmed, eyes, tmp_path, capfd):
    assert main(["prepare", "push", str(filmed[0]), "--out", str(tmp_path)]) == 0
    out = capfd.readouterr().out
    film = tmp_path / "reenactment.mp4"
    assert out.startswith("usable\npage: ")
    assert out.endswith(f"push --video {film} --out 'runs/push-my push'\n")
    page = (tmp_path / "prepare.html").read_text()
    for part in ("Push: usable", "mirrored", "What was found", "in the scene", "--tip X,Y@S"):
        assert part in page
    assert page.count("data-time=") == 12 and page.count("data:video/webm") == 1
    assert "after all" not in page
    assert "http" not in page.replace("http://www.w3.org", "")  # it needs no network

    stills = read_stills(tmp_path / "stills.webp")
    assert stills.shape == (8, 252, 252, 3) and len(np.unique(stills.mean((1, 2, 3)))) > 4

    again = prepare.prepare("push", film)
    assert len(prepare.stills(again)) == 0  # it shows nobody
    assert again.notes[-1].endswith("taken as it is.") and again.motion is None
    assert len(again.film) == len(video.read(film)[0]) > 40
    green, red = again.film[-1, 58:68, 50:66], again.film[0, 55:68, 30:45]
    assert (green[..., 0] > 150).any() and (red[..., 0] > 150).any()  # the cube, at its two places


def test_what_is_not_usable_ends_with_2_and_a_page_that_says_why(filmed, eyes, tmp_path, capfd):
    eyes.found = blind(eyes.found)
    assert main(["prepare", "push", str(filmed[0]), "--out", str(tmp_path)]) == 2
    assert capfd.readouterr().out.startswith("not usable: the tip of the hand is seen in 0%")
    page = (tmp_path / "prepare.html").read_text()
    assert (
        "Push: not usable" in page
        and "<p>The tip of the hand is seen" in page
        and "film from the side" in page
        and "may be usable after all" in page  # if it was wrongly found
        and "data-time=" in page
    )
    assert not (tmp_path / "reenactment.mp4").exists()


@pytest.mark.parametrize(
    ("gain", "more", "said"),
    [(0.15, 60, "dark"), (1, 10, "Something large comes in"), (1, 60, "")],
)
def test_a_refused_clip_says_whether_it_is_dark_or_its_arm_like_the_room(
    gain, more, said, tmp_path
):
    """A bar that comes in and pushes nothing, before a still room."""
    frames = np.repeat(room()[None], 30, axis=0) + np.random.default_rng(0).normal(
        0, 2, (30, 1, 1, 1)
    )
    for i, frame in enumerate(frames):
        frame[48:64, : max(0, 4 * i - 20)] += more
    path = encode(tmp_path / "a.mp4", np.clip(gain * frames, 0, 255).astype(np.uint8))
    result = prepare.prepare("push", path)
    poor = [words for words in ("dark", "Something large comes in") if words in result.why_not]
    assert result.why_not and poor == [said] * bool(said)


def test_a_clip_in_a_tenth_of_the_light_is_usable(tmp_path):
    """In it no pixel moves by as much as by day; its page says what was done."""
    env = bare("coffee", embodiment="human")
    clip = look_alike(*record_expert(env, 3)[:2])
    env.close()
    noise = np.random.default_rng(0).normal(0, 2, clip.frames.shape)
    dark = np.clip(0.1 * clip.frames + noise, 0, 255).astype(np.uint8)
    result = prepare.prepare("coffee", encode(tmp_path / "a.mp4", dark, options={"crf": "20"}))
    assert result.verdict.startswith("usable")
    assert "It is dark, and was made 8.0 times as bright." in result.notes


def test_a_file_that_is_no_video_is_not_usable(tmp_path, capfd):
    path = tmp_path / "text.mp4"
    path.write_text("not a video")
    assert main(["prepare", "push", str(path), "--out", str(tmp_path / "out")]) == 2
    out, err = capfd.readouterr()
    assert out.startswith(f"not usable: {path}") and err == ""
    assert not (tmp_path / "out").exists()


def test_a_clip_of_too_few_pixels_is_not_usable(filmed, eyes, tmp_path):
    video.write(tmp_path / "tiny.mp4", video.read(filmed[0])[0][:, ::2, ::2], FPS, 1)
    assert (
        "42x42 pixels, as it is read, are too few"
        in prepare.prepare("push", tmp_path / "tiny.mp4").why_not
    )


def test_a_missing_file_is_a_mistake(tmp_path, capfd):
    assert main(["prepare", "push", str(tmp_path / "no.mp4")]) == 2
    assert "there is no such file" in capfd.readouterr().err


@pytest.mark.parametrize(
    "wrong", [["--tip", "3;4@1"], ["--object", "3,4"], ["--from", "-1"], ["--to", "end"]]
)
def test_a_mark_or_a_time_that_is_none_is_named(wrong, tmp_path, capfd):
    (tmp_path / "a.mp4").touch()
    assert main(["prepare", "push", str(tmp_path / "a.mp4"), *wrong]) == 2
    assert repr(wrong[1]) in capfd.readouterr().err


@pytest.mark.parametrize("last", ["1.5", "2"])
def test_an_end_before_the_start_is_a_mistake_and_not_the_clips_fault(last, tmp_path, capfd):
    (tmp_path / "a.mp4").touch()
    assert main(["prepare", "push", str(tmp_path / "a.mp4"), "--from", "2", "--to", last]) == 2
    said = capfd.readouterr()
    assert f"--to {last} is not after --from 2" in said.err and "not usable" not in said.out


@pytest.fixture(scope="module")
def scene():
    env = bare("push", observation="state")
    env.reset(seed=0)
    yield env.scene()
    env.close()


def test_marks_in_the_clips_pixels_and_seconds_do_what_a_detector_does(filmed, eyes, scene):
    path, truth = filmed
    clip = read_clip(path)
    seen = follow(Prepared(clip, scene), Choices())
    eyes.found = blind(truth)
    marks = [
        tuple((*points[i].tolist(), clip.times[i]) for i in range(len(clip.times)))
        for points in (truth.tip, truth.object)
    ]
    marked = follow(Prepared(clip, scene), Choices(tip=marks[0], object=marks[1]))
    np.testing.assert_allclose(marked.tip, seen.tip, atol=1e-9)


def test_a_mark_outside_of_the_picture_is_named(filmed, eyes, tmp_path):
    """A mistake of the command: the page that the user clicks into stays."""
    page = tmp_path / prepare.PAGE
    page.write_text("before")
    argv = ["push", str(filmed[0]), "--tip", "1348,418@0.3", "--out", str(tmp_path)]
    with pytest.raises(InputError, match=r"^1348,418@0\.3 is outside of 252x252 pixels"):
        prepare.main(argv)
    assert page.read_text() == "before"


def test_the_user_decides_which_seconds_count_and_what_is_mirrored(filmed, eyes, scene):
    path, _ = filmed
    prepared = prepare.prepare("push", path, Choices(mirror=False))
    assert "leave out --mirror or --no-mirror" in prepared.why_not
    eyes.found = Found(
        *(getattr(eyes.found, n)[20:30] for n in ("tip", "object", "tip_sure", "object_sure"))
    )
    short = prepare.prepare("push", path, Choices(first=20 / FPS - 0.01, last=29 / FPS + 0.01))
    assert len(short.clip.frames) == 10 and short.clip.times[0] == pytest.approx(0.8, abs=0.05)


def test_learning_from_a_clip_keeps_the_shipped_eyes_and_the_page(tmp_path):
    arguments = ["--video", str(VIDEOS / "push" / "expert_02.mp4"), "--out", str(tmp_path)]
    job = check("push", parser("push").read(arguments), arguments)
    assert job.trained is not None and not job.from_scratch
    np.testing.assert_array_equal(job.demo[0], video.read(tmp_path / "reenactment.mp4")[0][0])
    assert "Push: usable" in (tmp_path / "prepare.html").read_text()


def test_object_tracks_watch_the_reenactment_and_not_the_clip(filmed, eyes, tmp_path):
    """The clip's cube goes to the left, for it was filmed from the other side."""
    arguments = ["--method", "tracks", "--video", str(filmed[0]), "--out", str(tmp_path)]
    job = check("push", parser("push").read(arguments), arguments)
    clip, _ = video.read(filmed[0])
    assert tracks.watch(clip).path[-1][0] < -15 and tracks.watch(job.demo).path[-1][0] > 15


def test_the_papers_way_translates_the_clip_itself(tmp_path):
    film = VIDEOS / "push" / "expert_02.mp4"
    arguments = ["--video", str(film), "--translate-clip", "--out", str(tmp_path)]
    job = check("push", parser("push").read(arguments), arguments)
    assert job.from_scratch and job.trained is None and len(job.random) == 0
    np.testing.assert_array_equal(job.demo, video.read(film)[0])
    assert not (tmp_path / "prepare.html").exists()


def test_a_clip_that_is_not_usable_teaches_nothing(filmed, eyes, tmp_path):
    eyes.found = blind(eyes.found)
    arguments = ["--video", str(filmed[0]), "--out", str(tmp_path / "run")]
    with pytest.raises(InputError, match=r"my push\.mp4: the tip of the hand"):
        check("push", parser("push").read(arguments), arguments)
    assert not (tmp_path / "run").exists()


def test_the_page_is_safe_from_the_names_of_files(scene, tmp_path):
    frames = np.zeros((3, 90, 120, 3), np.uint8)
    write_page(
        tmp_path / "page.html", task="push", command="prepare push '</script><b>.mp4'",
        verdict="not usable: <i>", frames=frames, times=np.arange(3.0), scene=scene,
        notes=["<u>"], warnings=["<s>"],
    )  # fmt: skip
    page = (tmp_path / "page.html").read_text()
    assert not [tag for tag in ("<b>.mp4", "<i>", "<u>", "<s>") if tag in page]


def test_the_films_play_at_half_the_speed_of_what_is_shown(scene, tmp_path, monkeypatch):
    """Every second of 25 steps a second is 12.5 frames a second, of which half is 6.25."""
    asked = []
    film = SimpleNamespace(html=lambda: "")
    monkeypatch.setattr(page, "Film", lambda films, fps: asked.append(fps) or film)
    small, z = np.zeros((4, 84, 84, 3), np.uint8), np.full((4, 6, 2), 40.0)
    for every in (1, 2):
        write_page(
            tmp_path / "page.html", task="push", command="", verdict="usable", scene=scene,
            frames=np.zeros((9, 90, 120, 3), np.uint8), times=np.arange(9) / 25, notes=[],
            warnings=[], columns=(small, small, z), shown=every * np.arange(4),
        )  # fmt: skip
    assert asked == [12.5, 6.25]
    assert "At half speed" in (tmp_path / "page.html").read_text()


def test_reasons_are_sentences():
    assert str(Unusable("it rains", "wait")) == "it rains; wait."


def test_a_film_of_the_kits_own_is_played_at_25_frames_a_second_by_its_time_stamps(monkeypatch):
    """At 50 frames a second every second one; where frames come unevenly, the nearest."""
    kept = []
    monkeypatch.setattr(prepare, "keep", lambda result, frames: kept.append(frames[:, 0, 0, 0]))
    frames = np.arange(40, dtype=np.uint8)[:, None, None, None] * np.ones((84, 84, 3), np.uint8)
    for times, wanted in (
        (np.arange(21) / 50, list(range(0, 21, 2))),
        ([0.0, 0.03, 0.05, 0.09, 0.12, 0.17], [0, 1, 3, 4, 5]),
    ):
        clip = Clip(frames[: len(times)], np.array(times), [], [])
        result = Prepared(clip, None)
        prepare.take_as_it_is(result)
        assert kept.pop().tolist() == wanted and "taken as it is" in result.notes[0]


@pytest.mark.parametrize(
    ("off", "share", "own"),
    [(6, 1.0, True), (11, 1.0, True), (13, 1.0, False), (200, 0.005, True), (200, 0.02, False)],
)
def test_the_kits_own_film_begins_with_the_scenes_picture_in_99_of_100_pixels(off, share, own):
    first = np.full((84, 84, 3), 30, np.uint8)
    shown = first.copy()
    shown.reshape(-1)[: round(share * first.size)] += off
    clip = Clip(np.stack([shown] * 3), np.arange(3) / 25, [], [])
    assert prepare.is_own(clip, first) == own
    assert not prepare.is_own(replace(clip, times=np.arange(3) / 15), first)  # too slow
    assert not prepare.is_own(replace(clip, frames=clip.frames[:, :, :80]), first)  # not square


def test_what_was_found_is_laid_by_the_clips_shorter_side_cuts_and_marks(monkeypatch):
    laid = {}
    n = 6
    clip = Clip(np.full((n, 90, 160, 3), 200, np.uint8), 2 + np.arange(n) / 20, [4], [])
    nothing = Found(np.zeros((n, 2)), np.zeros((n, 2)), np.zeros(n), np.zeros(n))
    touches = []
    monkeypatch.setattr(prepare, "look", lambda *asked: touches.append(asked[3]) or nothing)
    monkeypatch.setattr(
        prepare.footage,
        "check",
        lambda frames, cuts: Footage(frames, [f"cut at {cuts}"], slice(0, 4), None, True),
    )
    arm, shots = Arms(1.0, 0.0, 0.2, True, 0.0), []
    monkeypatch.setattr(prepare.Sight, "beside", lambda *what: 0.0)
    monkeypatch.setattr(prepare.Sight, "room", lambda *what: 0.0)
    monkeypatch.setattr(
        prepare, "coming_in", lambda sight, off: shots.append(len(sight.frames)) or arm
    )
    monkeypatch.setattr(
        prepare,
        "lay",
        lambda *asked: laid.update(zip(("tracks", "scene", "mirror", "alike"), asked, strict=True)),
    )
    scene, reach = SimpleNamespace(contact=0.04), SimpleNamespace(contact=None)
    result = Prepared(clip, scene)
    choices = Choices(mirror=True, tip=((10.0, 20.0, 2.1),), object=((30.0, 40.0, 2.2),))
    follow(result, choices)
    tracks = laid["tracks"]
    assert (tracks.side, tracks.cuts, laid["scene"], laid["mirror"]) == (90, (4,), scene, True)
    assert tracks.tip[2].tolist() == [10, 20] and tracks.object[4].tolist() == [30, 40]
    assert (tracks.enters, tracks.unmoved, shots) == (0.2, True, [4])
    assert result.warnings == ["cut at [4]"] and result.tracks is tracks
    assert result.notes[0] == "You placed the tip in 1 picture and the object in 1 picture."
    assert laid["alike"].args[0] is result.clip.frames and laid["alike"].args[1] is tracks
    assert result.notes[1].startswith("6 frames at 20 a second")
    for wrong in ((161.0, 20.0, 2.1), (10.0, 91.0, 2.1), (10.0, 20.0, 1.9), (10.0, 20.0, 2.3)):
        with pytest.raises(prepare.Misplaced, match=r"of 160x90 pixels and 2\.0 to 2\.2 s"):
            follow(Prepared(clip, scene), Choices(tip=(wrong,)))
    follow(Prepared(clip, reach), Choices())
    assert touches == [True, False]


def test_the_film_is_kept_as_it_comes_back_from_its_file():
    """What is learnt from has been through the codec, as it has when the file is given again."""
    rng = np.random.default_rng(0)
    frames = np.stack([np.full((84, 84, 3), 90, np.uint8)] * 12)
    for i, frame in enumerate(frames):
        frame[20:60, 3 * i : 3 * i + 30] = rng.integers(0, 255, (40, 30, 3))
    result = Prepared(None, None)
    prepare.keep(result, frames)
    assert result.film.shape == frames.shape and 0 < shows(result.film, frames) < 20
    assert result.file[4:8] == b"ftyp"
