"""What `prepare` says and in what order it looks, with clips that were never filmed."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lbw_minimal.clips import sight
from lbw_minimal.clips.arms import Arms
from lbw_minimal.clips.detector import Found
from lbw_minimal.clips.footage import Footage
from lbw_minimal.clips.paths import Tracks, Unusable
from lbw_minimal.clips.reader import Clip
from lbw_minimal.training import InputError
from tasks.commands import prepare
from tasks.commands.choices import Choices, parser
from tasks.commands.links import mark
from tasks.commands.prepare import Prepared, follow

FEW = (
    "6 frames are too few: 8 are needed; film the whole motion in one go, at 10 frames a second or "
    "more."
)
ONE = Arms(1.0, 0.0, 0.5, True, 0.0)  # arms that come in
NONE = Arms(0.0, 0.0, np.nan, False, 0.0)


@pytest.fixture(autouse=True)
def alone(monkeypatch):
    """One arm, no other beside it, and a room that stands: what a shot is asked is told below."""
    monkeypatch.setattr(sight.Sight, "beside", lambda *what: 0.0)
    monkeypatch.setattr(sight.Sight, "room", lambda *what: 0.0)


def clip(n=6, height=90, width=160, start=0.0):
    frames = (np.arange(n * height * width * 3) % 251).astype(np.uint8)  # as many colours as a room
    return Clip(frames.reshape(n, height, width, 3), start + np.arange(n) / 20, [], [])


def prepared(**more):
    return Prepared(**({"clip": clip(), "scene": SimpleNamespace(contact=None)} | more))


@pytest.mark.parametrize(
    ("warnings", "why_not", "verdict"),
    [
        ([], "", "usable"),
        (["dark"], "", "usable, with a warning"),
        (["dark", "far"], "", "usable, with 2 warnings"),
        (["dark"], "no arm is seen.", "not usable: no arm is seen."),
    ],
)
def test_the_verdict_counts_warnings_and_says_why_not(warnings, why_not, verdict):
    assert prepared(warnings=warnings, why_not=why_not).verdict == verdict


@pytest.mark.parametrize(
    ("tip", "thing", "said"),
    [
        (0, 0, ""), (1, 0, "You placed the tip in 1 picture."),
        (0, 3, "You placed the object in 3 pictures."),
        (2, 1, "You placed the tip in 2 pictures and the object in 1 picture."),
    ],
)  # fmt: skip
def test_what_a_user_placed_is_said(tip, thing, said):
    marks = [(1.0, 2.0, float(i)) for i in range(3)]
    assert Choices(tip=tuple(marks[:tip]), object=tuple(marks[:thing])).placed == said


def test_a_usable_clip_is_told_with_its_warnings_and_how_to_learn_from_it(
    tmp_path, monkeypatch, capsys
):
    asked = []
    result = prepared(warnings=["It is dark.", "It is far."])
    monkeypatch.setattr(prepare, "prepare", lambda *what: asked.append(what) or result)
    monkeypatch.setattr(prepare, "write", lambda out, *what: asked.append(what) or out / "page")
    file, out = tmp_path / "my clip.mp4", tmp_path / "out"
    file.write_bytes(b"")
    argv = ["push", str(file), "--from", "1", "--tip", "3,4@1.5", "--no-mirror", "--out", str(out)]
    assert prepare.main(argv) == 0
    choices = Choices(first=1.0, mirror=False, tip=((3.0, 4.0, 1.5),))
    command = (
        f"python -m tasks prepare push '{file}' --from 1 --tip 3,4@1.5 --no-mirror --out {out}"
    )
    learn = f"python -m tasks push --video {out / 'reenactment.mp4'} --out 'runs/push-my clip'"
    said = "--from 1 --no-mirror --tip 3,4@1.5"
    known = {"clip": "my clip.mp4", "mark": mark(file), "task": "push"}
    note = known | {"corrections": said, "command": command}
    assert asked == [("push", file, choices), ("push", result, note, learn)]
    assert capsys.readouterr().out.splitlines() == [
        "usable, with 2 warnings", f"page: {out / 'page'}", "warning: It is dark.",
        "warning: It is far.", f"learn: {learn}",
    ]  # fmt: skip
    result.why_not = "no arm is seen."
    assert prepare.main(argv) == 2
    assert capsys.readouterr().out.splitlines()[2:] == [
        "warning: It is dark.",
        "warning: It is far.",
    ]
    assert asked[-1] == ("push", result, note, "")


@pytest.mark.parametrize(
    ("yours", "said"),
    [
        ((), True), ((("tip", 0.0, 0.25), ("object", 0.0, 0.2)), True),
        ((("tip", 0.0, 0.25), ("object", 0.0, 0.25)), False),  # all of them
    ],
)  # fmt: skip
def test_a_clip_refused_for_what_was_found_in_it_can_be_corrected_by_a_click(
    yours, said, tmp_path, monkeypatch, capsys
):
    way, none = np.zeros((6, 2)), np.zeros(6)
    tracks = Tracks(clip().times, way, way, none, none, 90, yours=yours)
    result = prepared(why_not="the object never moves.", tracks=tracks)
    monkeypatch.setattr(prepare, "prepare", lambda *what: result)
    monkeypatch.setattr(prepare, "write", lambda out, *what: out / "page")
    (tmp_path / "a.mp4").touch()
    assert prepare.main(["push", str(tmp_path / "a.mp4"), "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().out.splitlines() == [
        "not usable: the object never moves.", f"page: {tmp_path / 'page'}",
        *["or else: if a dot on the page is wrong, click it right, and run what it says"] * said,
    ]  # fmt: skip


def test_each_clip_is_prepared_in_a_folder_of_its_own(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(prepare, "prepare", lambda *what: prepared())
    monkeypatch.setattr(prepare, "write", lambda out, *what: out / "page")
    for name in ("one", "two"):
        (tmp_path / f"{name}.mp4").touch()
        assert prepare.main(["push", f"{name}.mp4"]) == 0
        assert f"page: runs/prepare/push-{name}/page\n" in capsys.readouterr().out


def test_choices_are_told_as_the_options_that_make_them():
    assert str(Choices()) == ""
    given = "--from 0.5 --to 12.345 --mirror --tip 3,4@1.5 --tip 5,6@2 --object 1348,7@0"
    args = parser().read(["push", "a.mp4", *given.split()])
    chosen = Choices(args.first, args.last, args.mirror, tuple(args.tip), tuple(args.object))
    assert str(chosen) == given


def test_a_clip_that_is_not_usable_leaves_no_film_of_another_one(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(prepare, "prepare", lambda *what: prepared(why_not="no arm is seen."))
    monkeypatch.setattr(prepare, "write", lambda out, *what: out / "page")
    film, clip = tmp_path / "reenactment.mp4", tmp_path / "my.mp4"
    for file in (film, clip):
        file.write_bytes(b"")
    assert prepare.main(["push", str(film), "--out", str(tmp_path)]) == 2
    assert film.exists()  # the clip itself
    for said in (f"note: {film}, of an earlier try, is removed.\n", ""):
        capsys.readouterr()
        assert prepare.main(["push", str(clip), "--out", str(tmp_path)]) == 2
        assert clip.exists() and not film.exists() and capsys.readouterr().err == said


def test_a_run_on_a_clip_says_what_is_odd_about_it_or_why_it_is_none(tmp_path, monkeypatch, capsys):
    result = prepared(warnings=["It is dark."])
    monkeypatch.setattr(prepare, "prepare", lambda name, path: result)
    assert prepare.usable("push", tmp_path) is result
    assert capsys.readouterr().err == f"warning: {tmp_path}: It is dark.\n"
    result.why_not = "no arm is seen."
    with pytest.raises(InputError, match=r": no arm is seen\.$"):
        prepare.usable("push", tmp_path)
    result.tracks = object()  # it was searched
    look = f"python -m tasks prepare push {tmp_path} shows what was seen in it, "
    with pytest.raises(InputError, match=rf"no arm is seen\. {look}.*\.$"):
        prepare.usable("push", tmp_path)


def test_patches_mend_what_a_detector_finds_in_each_shot_and_corners_refine_it(monkeypatch):
    """Two frames, with a cut between them: the detector sees each shot by itself."""
    frames = np.arange(2, dtype=np.uint8)[:, None, None, None] + np.zeros((1, 84, 84, 3), np.uint8)

    def detect(seen, first):
        return Found(*[seen[:, 0, 0, 0] + 10 * len(seen)] * 4)

    def mended(seen, found):  # each time by 100 and the shot's frames
        return replace(found, object=found.object + 100 + len(seen)), True

    monkeypatch.setattr(prepare, "mended", mended)
    monkeypatch.setattr(prepare, "gone", lambda found: 0.0)
    monkeypatch.setattr(prepare, "of_hand", lambda found, side: False)
    monkeypatch.setattr(prepare, "refine", lambda seen, found, cuts: (cuts, seen is frames, found))
    model = SimpleNamespace(look=lambda seen: None, detect=detect)
    cuts, same, found = prepare.look(sight.shots(model, frames, [1]), frames, [1], True)
    assert cuts == [1] and same
    assert found.tip.tolist() == [10, 11] and found.object.tolist() == [111, 112]
    found = prepare.look(sight.shots(model, frames, []), frames, [], True)[2]
    assert found.object.tolist() == [122, 123]


def seen_by(detect, frames):
    """A shot's frames as a model sees them that detects by `detect`, whatever its first look."""
    model = SimpleNamespace(look=lambda seen: None, detect=lambda seen, first: detect(seen))
    return sight.Sight(model, frames)


WHOLE, MOVING = [50, 51, 52, 53, 54], [20, 20, 20, 21, 21]


@pytest.mark.parametrize(
    ("touched", "tip_by", "object_by", "tip", "thing"),
    [(True, 5, 2, WHOLE, MOVING), (True, 2, 5, MOVING, WHOLE), (False, 5, 5, MOVING, WHOLE)],
)
def test_the_surer_look_counts_and_for_a_hand_that_touches_nothing_the_one_at_what_moves(
    touched, tip_by, object_by, tip, thing, monkeypatch
):
    """Of five frames two show something new: what stands moves at the fourth. A place is the
    number of a frame among those that are seen, and ten times how many these are."""
    frames = np.zeros((5, 84, 84, 3), np.uint8)
    frames[:3, 40:50, 20:30] = frames[3:, 40:50, 50:60] = 200

    def detect(seen):
        n = len(seen)
        sure = [np.full(n, 0.9 if n == by else 0.5 + 0.1 * n / 5) for by in (tip_by, object_by)]
        return Found(*[np.arange(n) + 10 * n] * 2, *sure)

    monkeypatch.setattr(prepare, "mended", lambda frames, found: (found, True))
    monkeypatch.setattr(prepare.vanished, "followed", lambda thing, frames, found: found)
    monkeypatch.setattr(prepare, "gone", lambda found: 0.0)
    monkeypatch.setattr(prepare, "of_hand", lambda found, side: False)
    found = prepare.looked(seen_by(detect, frames), touched)
    assert found.tip.tolist() == tip and found.object.tolist() == thing
    assert found.tip_sure[0] == (0.9 if touched else 0.54) and found.object_sure[0] == 0.9


@pytest.mark.parametrize(
    ("ways", "pushed", "hand", "touched", "object_"),
    [
        ((5, 3, 4), (0, 0, 0), "", True, 0),
        ((5, 5, 9), (1, 1, 1), "", True, 2),
        ((5, 9, 5), (0, 0, 0), "", True, 1),
        ((5, 9, 4), (0, 0, 1), "", True, 2),
        ((5, 9, 7), (1, 1, 1), "1", True, 2),
        ((5, 9, 7), (0, 1, 0), "1", True, 1),
        ((5, 9, 7), (1, 1, 1), "012", True, 1),
        ((5, 9, 9), (0, 1, 1), "", False, 0),
    ],
    ids=["the-surer", "at-what-moves", "at-all", "as-one-that-is-pushed", "no-piece-of-the-hand",
         "the-only-one-that-is-pushed", "all-are-of-the-hand", "nothing-is-touched"],
)  # fmt: skip
def test_of_what_patches_make_of_the_looks_the_object_is_pushed_or_else_goes_farthest(
    ways, pushed, hand, touched, object_, monkeypatch
):
    """The tip stays the surer look's. Patches are asked of it, of the whole look, of the other."""
    asked = []

    def mended(seen, found):
        asked.append(n := len(asked))
        return replace(found, tip=found.tip - 1, object=np.full(len(seen), n)), bool(pushed[n])

    def detect(seen):
        n = len(seen)
        return Found(*[np.full(n, 10 * n)] * 2, np.full(n, 0.9 - 0.1 * n), np.full(n, 0.5))

    monkeypatch.setattr(prepare, "mended", mended)
    monkeypatch.setattr(prepare.vanished, "followed", lambda thing, frames, found: found)
    monkeypatch.setattr(prepare, "gone", lambda found: ways[found.object[0]])
    monkeypatch.setattr(prepare, "of_hand", lambda found, side: str(found.object[0]) in hand)
    frames = np.zeros((5, 84, 84, 3), np.uint8)
    frames[:3, 40:50, 20:30] = frames[3:, 40:50, 50:60] = 200
    found = prepare.looked(seen_by(detect, frames), touched)
    assert found.object.tolist() == [object_] * 5
    assert found.tip.tolist() == [20] * 5  # the look at the two frames is surer


@pytest.mark.parametrize("touched", [False, True])
def test_what_has_left_its_place_may_be_the_object_where_one_is_touched(touched, monkeypatch):
    def detect(seen):
        n = len(seen)
        return Found(np.zeros((n, 2)), np.zeros((n, 2)), np.full(n, 0.9), np.full(n, 0.9))

    def followed(thing, seen, found):
        assert thing == "vanished" and seen is frames
        return replace(found, object=found.object + 7)

    monkeypatch.setattr(sight, "vanished", lambda frames: "vanished")
    monkeypatch.setattr(sight, "told", lambda frames: np.arange(2))
    monkeypatch.setattr(prepare, "mended", lambda frames, found: (found, True))
    monkeypatch.setattr(prepare, "reaching", lambda frames, found: found)
    monkeypatch.setattr(prepare.vanished, "followed", followed)
    frames = np.zeros((10, 84, 84, 3), np.uint8)
    found = prepare.looked(seen_by(detect, frames), touched)
    assert found.object[0, 0] == (7 if touched else 0)


@pytest.mark.parametrize(("seen", "rests"), [(0.09, True), (0.1, False)])
def test_an_arm_that_is_rarely_seen_is_looked_for_where_something_moves(seen, rests, monkeypatch):
    """Ten frames, two of which show something new."""
    frames, off = np.zeros((10, 84, 84, 3), np.uint8), object()
    whole, moving = Arms(seen, 0.1, 0.3, True, 0.2), Arms(0.3, 0.0, 0.7, True, 0.2)

    def count(masks, moved):
        assert moved is off
        return {10: whole, 2: moving}[len(masks)]

    model = SimpleNamespace(look=lambda seen: SimpleNamespace(arms=seen))
    monkeypatch.setattr(sight, "told", lambda frames: np.array([0, 6]))
    monkeypatch.setattr(prepare.arms, "count", count)
    assert prepare.coming_in(sight.Sight(model, frames), off) is (moving if rests else whole)


def test_the_shipped_detector_is_loaded_once_and_looks_once_at_a_frame_for_all_that_ask(
    monkeypatch,
):
    """At all frames, and at those in which something has moved: arms, tip and object are told by
    the same two looks, of which the closer ones are the detector's own affair."""
    asked, compared = [], []

    def look(seen):
        asked.append(len(seen))
        return SimpleNamespace(arms=seen)

    def detect(seen, first):
        assert (first.arms == seen).all()
        return Found(*[np.zeros((len(seen), 2))] * 2, *[np.zeros(len(seen))] * 2)

    def check_seen(thing, tip, sure):
        raise Unusable("hidden", "film it")

    def load(path):
        assert path.name == "eyes.safetensors"
        asked.append("loaded")
        return SimpleNamespace(look=look, detect=detect)

    monkeypatch.setattr(prepare, "Detector", SimpleNamespace(load=load))
    monkeypatch.setattr(prepare.arms, "count", lambda masks, off: ONE._replace(seen=0.0))
    monkeypatch.setattr(prepare.footage, "check", lambda frames, cuts: Footage(
        frames, [], slice(0, 6), None, False))  # fmt: skip
    monkeypatch.setattr(sight, "told", lambda frames: asked.append("told") or np.arange(2))
    monkeypatch.setattr(sight, "vanished", lambda frames: compared.append(len(frames)))
    monkeypatch.setattr(prepare, "mended", lambda frames, found: (found, True))
    monkeypatch.setattr(prepare, "gone", lambda found: 0.0)
    monkeypatch.setattr(prepare, "of_hand", lambda found, side: False)
    monkeypatch.setattr(prepare.vanished, "followed", lambda thing, frames, found: found)
    monkeypatch.setattr(prepare.vanished, "check_seen", check_seen)
    scene = SimpleNamespace(contact=0.04)
    with pytest.raises(Unusable, match="hidden"):
        follow(prepared(clip=replace(clip(10), cuts=[6]), scene=scene), Choices())
    assert asked == ["loaded", 6, "told", 2, 4, "told", 2] and compared == [6, 4]


@pytest.mark.parametrize("touched", [False, True])
def test_a_hand_that_touches_nothing_may_be_told_by_its_outline(touched, monkeypatch):
    def detect(seen):
        n = len(seen)
        return Found(*[np.full((n, 2), n)] * 2, np.full(n, 0.5 if n == 2 else 0.9), np.zeros(n))

    def outline(seen, found):
        assert seen is frames
        return replace(found, tip=found.tip + 1)

    monkeypatch.setattr(sight, "told", lambda frames: np.arange(2))
    monkeypatch.setattr(prepare, "mended", lambda frames, found: (found, True))
    monkeypatch.setattr(prepare, "reaching", outline)
    frames = np.zeros((10, 84, 84, 3), np.uint8)
    found = prepare.looked(seen_by(detect, frames), touched)
    assert found.tip[0, 0] == (10 if touched else 2 + 1)


@pytest.mark.parametrize(
    ("mark", "inside"),
    [
        ((0, 0, 2.0), True), ((160, 90, 2.25), True), ((-1, 5, 2.1), False), ((161, 5, 2.1), False),
        ((5, 91, 2.1), False), ((5, 5, 1.98), False), ((5, 5, 2.27), False), ((5, 5, 2.255), True),
    ],
)  # fmt: skip
def test_a_mark_lies_in_the_picture_and_in_the_clips_seconds(mark, inside, monkeypatch):
    """Six frames of 160x90 from 2 s on; the page rounds, so a hundredth of a second is let pass."""
    nothing = Found(np.zeros((6, 2)), np.zeros((6, 2)), np.zeros(6), np.zeros(6))
    monkeypatch.setattr(prepare, "look", lambda sights, frames, cuts, touched: nothing)
    monkeypatch.setattr(prepare, "coming_in", lambda sight, off: ONE)
    monkeypatch.setattr(
        prepare.footage, "check", lambda frames, cuts: Footage(frames, [], slice(0, 6), None, False)
    )
    monkeypatch.setattr(prepare, "lay", lambda tracks, scene, mirror, alike: "laid")
    for name in ("tip", "object"):
        result, choices = prepared(clip=clip(start=2.0)), Choices(**{name: (mark,)})
        if inside:
            assert follow(result, choices) == "laid"
        else:
            with pytest.raises(prepare.Misplaced, match="is outside of 160x90 pixels and"):
                follow(result, choices)


@pytest.mark.parametrize(
    ("contact", "name", "asked"),
    [(0.04, "", True), (0.04, "tip", True), (0.04, "object", False), (None, "", False)],
)
def test_a_thing_that_is_touched_should_be_in_sight_unless_the_user_placed_it(
    contact, name, asked, monkeypatch
):
    nothing, seen = Found(np.zeros((6, 2)), np.zeros((6, 2)), np.zeros(6), np.zeros(6)), []
    looked, put = [], []
    monkeypatch.setattr(sight, "vanished", len)
    motion = SimpleNamespace(times=np.arange(4) / 10, contact=1, arrival=3)
    monkeypatch.setattr(prepare, "look", lambda sights, frames, cuts, touched: nothing)
    monkeypatch.setattr(prepare, "coming_in", lambda sight, off: ONE)
    monkeypatch.setattr(
        prepare.footage, "check", lambda frames, cuts: Footage(frames, [], slice(0, 6), None, False)
    )
    monkeypatch.setattr(prepare.vanished, "check_seen", lambda *what: looked.append(what))
    monkeypatch.setattr(prepare, "lay", lambda tracks, scene, mirror, alike: motion)
    monkeypatch.setattr(
        prepare, "behind", lambda tracks, *of: put.append(of) or ("put behind", of[0])
    )
    monkeypatch.setattr(prepare, "unlike", lambda frames, tracks, *w: seen.append(w) or ["Hidden?"])
    result = prepared(scene=SimpleNamespace(contact=contact))
    choices = Choices(**({name: ((5.0, 5.0, 0.1),)} if name else {}))
    assert follow(result, choices) is motion
    assert seen == ([(0.1, pytest.approx(0.3))] if asked else [])
    assert [(thing, len(tip), len(sure)) for thing, tip, sure in looked] == [(6, 6, 6)] * asked
    assert ("Hidden?" in result.warnings) == asked
    # A tip that the user has placed stays there.
    assert put == ([] if name == "tip" else [(motion, result.scene, None)])
    assert (result.tracks == "put behind") == (name != "tip")


@pytest.mark.parametrize(("hidden", "told"), [(True, "the arm hides"), (False, "no arm is seen")])
def test_that_an_arm_hides_the_object_is_told_before_how_many_arms_are_seen(
    hidden, told, monkeypatch
):
    """One that is before a thing may reach from edge to edge of the picture, as two people do."""

    def seen(*what):
        if hidden:
            raise Unusable("the arm hides the object", "push it from behind")

    nothing = Found(np.zeros((6, 2)), np.zeros((6, 2)), np.zeros(6), np.zeros(6))
    monkeypatch.setattr(prepare, "look", lambda sights, frames, cuts, touched: nothing)
    monkeypatch.setattr(prepare, "coming_in", lambda sight, off: NONE)
    monkeypatch.setattr(
        prepare.footage, "check", lambda frames, cuts: Footage(frames, [], slice(0, 6), None, False)
    )
    monkeypatch.setattr(prepare.vanished, "check_seen", seen)
    with pytest.raises(Unusable, match=told):
        follow(prepared(scene=SimpleNamespace(contact=0.04)), Choices())


@pytest.mark.parametrize("name", ["", "tip", "object"])
def test_a_user_who_places_the_tip_overrules_that_there_is_no_arm(name, monkeypatch):
    """It is searched all the same, so that the page shows what was found and can be corrected."""
    nothing = Found(np.zeros((6, 2)), np.zeros((6, 2)), np.zeros(6), np.zeros(6))
    monkeypatch.setattr(prepare, "look", lambda sights, frames, cuts, touched: nothing)
    monkeypatch.setattr(prepare, "coming_in", lambda sight, off: NONE)
    monkeypatch.setattr(
        prepare.footage, "check", lambda frames, cuts: Footage(frames, [], slice(0, 6), None, False)
    )
    monkeypatch.setattr(prepare, "lay", lambda tracks, scene, mirror, alike: "laid")
    result = prepared()
    choices = Choices(**({name: ((5.0, 5.0, 0.1),)} if name else {}))
    if name == "tip":
        assert follow(result, choices) == "laid"
        assert result.warnings == [
            "No arm is seen, nothing large that moves comes in from the edge: it was searched all "
            "the same, because you placed the tip."
        ]
    else:
        with pytest.raises(Unusable, match=r"^no arm is seen, .*; film from the side"):
            follow(result, choices)
        assert result.warnings == []
    assert result.tracks is not None


@pytest.mark.parametrize(("arms", "refused"), [(NONE, True), (ONE, False)])
def test_where_nothing_seems_to_move_an_arm_that_is_seen_does(arms, refused, monkeypatch):
    nothing = Found(np.zeros((6, 2)), np.zeros((6, 2)), np.zeros(6), np.zeros(6))
    monkeypatch.setattr(prepare, "look", lambda sights, frames, cuts, touched: nothing)
    monkeypatch.setattr(prepare, "coming_in", lambda sight, off: arms)
    still = "nothing moves", "film an arm"
    monkeypatch.setattr(
        prepare.footage,
        "check",
        lambda frames, cuts: Footage(frames, [], slice(0, 6), None, True, still),
    )
    monkeypatch.setattr(prepare, "lay", lambda tracks, scene, mirror, alike: "laid")
    result, marks = prepared(), Choices(tip=((5.0, 5.0, 0.1),))
    if refused:  # and no mark helps, so nothing is searched for
        with pytest.raises(Unusable, match=r"^nothing moves; film an arm\.$"):
            follow(result, marks)
        assert result.tracks is None
        monkeypatch.setattr(sight, "vanished", lambda frames: "a thing has left its place")
        with pytest.raises(Unusable, match=r"^no arm is seen, only something small moves; film"):
            follow(result, marks)
    else:
        assert follow(result, marks) == "laid"


@pytest.mark.parametrize(("share", "two"), [(0.09, False), (0.1, True)])
def test_an_arm_that_moves_beside_the_one_with_the_tip_is_another_person(share, two, monkeypatch):
    """The tip of the longest shot, frames 2 to 5, is asked about, as it was found."""
    found = Found(np.arange(12.0).reshape(6, 2), np.zeros((6, 2)), np.arange(6) / 10, np.zeros(6))
    asked, off = [], object()
    monkeypatch.setattr(prepare, "look", lambda sights, frames, cuts, touched: found)
    monkeypatch.setattr(prepare, "coming_in", lambda sight, off: ONE)
    monkeypatch.setattr(sight.Sight, "beside", lambda self, *what: asked.append(what) or share)
    monkeypatch.setattr(
        prepare.footage, "check", lambda frames, cuts: Footage(frames, [], slice(2, 6), off, False)
    )
    monkeypatch.setattr(prepare, "lay", lambda tracks, scene, mirror, alike: "laid")
    result = prepared(clip=replace(clip(), cuts=[2]))
    if two:
        with pytest.raises(Unusable, match="as of several people"):
            follow(result, Choices())
    else:
        assert follow(result, Choices()) == "laid"
    (moved, tip, sure), = asked  # fmt: skip
    assert moved is off and tip[0].tolist() == [4, 5] and sure.tolist() == [0.2, 0.3, 0.4, 0.5]


@pytest.mark.parametrize(("share", "moves"), [(0.39, False), (0.4, True)])
def test_a_room_that_moves_though_it_was_steadied_is_before_a_camera_that_does(
    share, moves, monkeypatch
):
    nothing = Found(np.zeros((6, 2)), np.zeros((6, 2)), np.zeros(6), np.zeros(6))
    asked, seen = [], Footage(np.zeros((6, 90, 160, 3)), [], slice(0, 6), None, False)
    monkeypatch.setattr(prepare, "look", lambda sights, frames, cuts, touched: nothing)
    monkeypatch.setattr(prepare, "coming_in", lambda sight, off: ONE)
    monkeypatch.setattr(sight.Sight, "room", lambda self, what: asked.append(what) or share)
    monkeypatch.setattr(prepare.footage, "check", lambda frames, cuts: seen)
    monkeypatch.setattr(prepare, "lay", lambda tracks, scene, mirror, alike: "laid")
    if moves:
        with pytest.raises(Unusable, match=r"^the camera moves; put it on a stand"):
            follow(prepared(), Choices())
    else:
        assert follow(prepared(), Choices()) == "laid"
    assert asked == [seen]


@pytest.mark.parametrize("light", ["", " The picture is dark: more light would help."])
def test_a_refused_clip_is_told_what_is_poor_about_its_light(light, monkeypatch):
    """It is measured once the camera stands, in the shot that is asked."""
    asked, still = [], ("nothing moves", "record it all")
    monkeypatch.setattr(prepare, "read_clip", lambda path, **more: replace(clip(), cuts=[2]))
    monkeypatch.setattr(prepare, "is_own", lambda *what: False)
    monkeypatch.setattr(prepare, "coming_in", lambda sight, off: NONE)
    monkeypatch.setattr(
        prepare.footage,
        "check",
        lambda frames, cuts: Footage(frames, [], slice(2, 6), None, True, still),
    )
    monkeypatch.setattr(
        prepare.light,
        "poor",
        lambda frames, sure=None, times=1: asked.append((frames, sure)) or light,
    )
    result = prepare.prepare("push", "a.mp4")
    assert result.why_not == f"nothing moves; record it all.{light}"
    assert [len(frames) for frames, _ in asked] == [4]
    found = Found(np.zeros((6, 2)), np.zeros((6, 2)), np.arange(6), np.zeros(6))
    monkeypatch.setattr(prepare, "coming_in", lambda sight, off: ONE)
    monkeypatch.setattr(prepare, "look", lambda sights, frames, cuts, touched: found)
    result = prepare.prepare("push", "a.mp4")
    assert result.why_not == f"{FEW}{light}" and asked[-1][1].tolist() == [2, 3, 4, 5]


def test_a_piece_has_the_files_own_seconds_by_which_a_click_asks_for_less_of_it(monkeypatch):
    """Forty seconds into a film too long for memory something moves."""
    monkeypatch.setattr(prepare, "read_clip", lambda path, **more: replace(clip(), start=40.0))
    monkeypatch.setattr(prepare, "is_own", lambda *what: False)

    def unusable(result, choices):
        raise Unusable("no arm is seen", "film one")

    monkeypatch.setattr(prepare, "follow", unusable)
    times = prepare.prepare("push", "a.mp4").clip.times
    assert times == pytest.approx(40 + np.arange(6) / 20)


def test_84_pixels_are_enough_and_83_are_not(monkeypatch):
    checked = []
    monkeypatch.setattr(
        prepare.footage,
        "check",
        lambda *what: checked.append(what) or (_ for _ in ()).throw(OSError),
    )
    with pytest.raises(OSError):
        follow(prepared(clip=clip(height=84)), Choices())
    with pytest.raises(Unusable, match="160x83 pixels, as it is read, are too few"):
        follow(prepared(clip=clip(height=83)), Choices())
    assert len(checked) == 1


def test_the_scene_is_closed_whatever_becomes_of_the_clip(monkeypatch):
    closed, motion = [], SimpleNamespace(notes=["laid"], warnings=[])
    done = SimpleNamespace(notes=["done"], warnings=[], frames=None)
    env = SimpleNamespace(
        reset=lambda seed: (None, {}), scene=lambda: None, close=lambda: closed.append(True)
    )
    monkeypatch.setattr(prepare.tasks, "bare", lambda *what, **more: env)
    monkeypatch.setattr(prepare, "read_clip", lambda path, **more: clip())
    monkeypatch.setattr(prepare, "is_own", lambda *what: False)
    monkeypatch.setattr(prepare, "reenact", lambda *what: done)
    monkeypatch.setattr(prepare, "keep", lambda *what: None)
    monkeypatch.setattr(prepare, "follow", lambda *what: motion)
    assert prepare.prepare("push", "a.mp4").notes == ["laid", "done"] and len(closed) == 1

    def unusable(*what):
        raise Unusable("no arm is seen", "film one")

    monkeypatch.setattr(prepare, "follow", unusable)
    assert "no arm is seen" in prepare.prepare("push", "a.mp4").why_not and len(closed) == 2
    monkeypatch.setattr(prepare, "follow", lambda *what: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        prepare.prepare("push", "a.mp4")
    assert len(closed) == 3


@pytest.mark.parametrize(
    ("cuts", "said"),
    [((), []), ((3,), ["The clip jumps once, at 0.3 s: only one piece of it counts."])],
)
def test_a_clip_that_is_not_usable_and_jumps_is_told_where(cuts, said, monkeypatch):
    monkeypatch.setattr(prepare, "read_clip", lambda path, **more: clip())
    monkeypatch.setattr(prepare, "is_own", lambda *what: False)

    def unusable(result, choices):
        way, none = np.zeros((6, 2)), np.zeros(6)
        result.tracks = Tracks(np.arange(6) / 10, way, way, none, none, 90, cuts)
        raise Unusable("no arm is seen", "film one")

    monkeypatch.setattr(prepare, "follow", unusable)
    result = prepare.prepare("push", "a.mp4")
    assert result.warnings == said and result.verdict.startswith("not usable: no arm is seen")
