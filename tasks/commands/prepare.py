"""A person's clip made into a human video of a task, and a page that says what was done.

In: any video file of an arm that does the task. Out: a verdict, `prepare.html`, and, if the clip is
usable, `reenactment.mp4`, which `python -m tasks TASK --video` takes: the clip's motion, done by
the simulated human in front of the kit's own camera.
"""

from __future__ import annotations

import json
import shlex
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

import tasks
from lbw_minimal import imitate, video
from lbw_minimal.clips import arms, footage, light, screen, vanished
from lbw_minimal.clips.behind import behind
from lbw_minimal.clips.decoding import check_file
from lbw_minimal.clips.detector import Detector, Found, refine
from lbw_minimal.clips.hiding import alike, unlike
from lbw_minimal.clips.motion import small, some
from lbw_minimal.clips.outline import reaching
from lbw_minimal.clips.page import clip_column, write_page
from lbw_minimal.clips.patches import gone, mended, of_hand
from lbw_minimal.clips.paths import Tracks, Unusable, jumps
from lbw_minimal.clips.reader import Clip, read_clip
from lbw_minimal.clips.retarget import FPS, Motion, Scene, lay
from lbw_minimal.clips.shots import correctable
from lbw_minimal.clips.sight import Sight, shots
from lbw_minimal.clips.stills import write_stills
from lbw_minimal.pictures import spread
from lbw_minimal.report import COLUMNS
from lbw_minimal.training import InputError, write_atomic
from tasks.commands import make_folder
from tasks.commands.choices import Choices, Misplaced, open_ended, parser
from tasks.commands.links import FILM, NOTE, RUNS, folder, links, note_of, noted
from tasks.world.reenact import Reenactment, reenact

PAGE = "prepare.html"
STILLS = "stills.webp"  # of a clip that was re-enacted, for the report of a run
SHOWN = 60  # frames of the page's film, which are translated as well: 4 s of work on one core
OWN = 12  # grey levels: the kit's own films begin with the scene's picture to within 6 of 256
# s at most between frames, or it has to be interpolated, as a motion, and from first to last.
OWN_STEP, OWN_LONGEST = 0.05, 60.0
EYES = tasks.WEIGHTS / "eyes" / "eyes.safetensors"  # the detector of tip and object


def no_frames() -> np.ndarray:
    """A film (0, 84, 84, 3) of no frames."""
    return np.zeros((0, video.SIZE, video.SIZE, 3), np.uint8)


@dataclass
class Prepared:
    """A clip and what became of it; what is None was not reached."""

    clip: Clip
    scene: Scene
    tracks: Tracks | None = None
    motion: Motion | None = None
    done: Reenactment | None = None
    film: np.ndarray = field(default_factory=no_frames)  # (N, 84, 84, 3), as `--video` reads it
    file: bytes = b""  # the same film as an mp4
    why_not: str = ""  # if the clip is not usable
    light: Callable[[], str] = str  # says what is poor about its light, see `light.poor`
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    @property
    def verdict(self) -> str:
        """What the command's first line says, and the page's title."""
        if self.why_not:
            return f"not usable: {self.why_not}"
        several = f", with {len(self.warnings)} warnings" if self.warnings else ""
        return "usable" + (", with a warning" if len(self.warnings) == 1 else several)


def main(argv: list[str]) -> int:
    """Prepare the clip, print the verdict, and return the exit code: 2 if it is not usable.

    Raises InputError for a mistake in the arguments.
    """
    args = parser().read(argv)
    check_file(args.file)
    choices = Choices(args.first, args.last, args.mirror, tuple(args.tip), tuple(args.object))
    try:
        result = prepare(args.task, args.file, choices)
    except Misplaced:  # a mistake of the command, not the clip's: its page stays
        raise
    except InputError as error:  # no picture to show
        print(f"not usable: {error}")
        return 2
    out = args.out or folder(args.task, args.file, RUNS / "prepare")
    make_folder(out)
    if result.why_not and args.file.resolve() != (out / FILM).resolve():
        if (out / FILM).exists():
            print(f"note: {out / FILM}, of an earlier try, is removed.", file=sys.stderr)
        for before in (FILM, STILLS):  # which nobody is to learn from by mistake
            (out / before).unlink(missing_ok=True)
    # The film's name is every clip's; a run bears the clip's.
    named = ["--video", str(out / FILM), "--out", str(folder(args.task, args.file))]
    learn = shlex.join(["python", "-m", "tasks", args.task, *named])
    command = shlex.join(["python", "-m", "tasks", "prepare", *open_ended(argv, args.file)])
    note = note_of(args.file, args.task, command) | {"corrections": str(choices)}
    page = write(out, args.task, result, note, "" if result.why_not else learn)
    print(f"{result.verdict}\npage: {page}")
    for warning in result.warnings:
        print(f"warning: {warning}")
    if result.why_not:
        if result.tracks is not None and correctable(result.tracks):
            print("or else: if a dot on the page is wrong, click it right, and run what it says")
        return 2
    print(f"learn: {learn}")
    return 0


def prepare(name: str, path: Path, choices: Choices | None = None) -> Prepared:
    """The clip in the file `path` as a human video of the task `name`.

    Raises InputError if the file cannot be read as a video. A clip that can be read and not used is
    returned as it is, with the reason.
    """
    choices = choices or Choices()
    clip = read_clip(path, start=choices.first or None, end=choices.last)
    clip = replace(clip, times=clip.times + clip.start)
    with closing(tasks.bare(name, embodiment="human")) as env:
        first, _ = env.reset(seed=0)
        result = Prepared(clip, env.scene(), notes=[*clip.notes], warnings=[*clip.losses])
        if choices == Choices() and is_own(clip, first):
            take_as_it_is(result)
            return result
        try:
            result.motion = follow(result, choices)
            result.done = reenact(env, result.motion)
        except Unusable as error:
            on_a_screen = None if choices.placed else screen.recorded(clip.frames)
            result.why_not = str(on_a_screen or f"{error}{result.light()}")
            if on_a_screen:
                result.warnings = [*clip.losses]  # no camera trembles there
            elif not result.motion and result.tracks and (said := jumps(result.tracks)):
                result.warnings.append(f"{said}: only one piece of it counts.")
    if result.motion:
        result.notes += result.motion.notes
        result.warnings += result.motion.warnings
    if result.done:
        result.notes += result.done.notes
        result.warnings += result.done.warnings
        keep(result, result.done.frames)
    return result


def usable(name: str, path: Path) -> Prepared:
    """The user's clip, re-enacted for the task; what is odd about it is said.

    Raises InputError if it is not usable, or was prepared for another task.
    """
    made_for = noted(path.parent).get("task", name) if path.name == FILM else name
    if made_for != name:
        raise InputError(f"{path}: it was prepared for {made_for}; prepare the clip for {name}.")
    clip = prepare(name, path)
    if clip.why_not:
        look = shlex.join(["python", "-m", "tasks", "prepare", name, str(path)])
        more = f" {look} shows what was seen in it, and how to correct that."
        raise InputError(f"{path}: {clip.why_not}{more if clip.tracks is not None else ''}")
    for warning in clip.warnings:
        print(f"warning: {path}: {warning}", file=sys.stderr)
    return clip


def follow(result: Prepared, choices: Choices) -> Motion:
    """Find tip and object in the clip, and lay their motion into the scene.

    Raises Unusable if that cannot be done, and Misplaced.
    """
    clip, (height, width) = result.clip, result.clip.frames.shape[1:3]
    if min(height, width) < video.SIZE:
        few = f"{width}x{height} pixels, as it is read, are too few"
        enough = f"film at {video.SIZE}x{video.SIZE} or more, less long or flat than 3:1"
        raise Unusable(few, enough)
    choices.check(clip)
    times = light.gain(clip.frames)
    seen = footage.check(light.brightened(clip.frames, times), clip.cuts)
    frames = seen.frames
    result.clip, result.warnings = replace(clip, frames=frames), result.warnings + seen.warnings
    result.notes += [f"It is dark, and was made {times:.1f} times as bright."] * (times > 1)
    result.light = partial(light.poor, frames[seen.shot], times=times)
    sights = shots(Detector.load(EYES), frames, clip.cuts)
    longest = sights[[0, *clip.cuts].index(seen.shot.start)]
    arm = coming_in(longest, seen.off)
    if seen.still and arm.seen < arms.SEEN:
        raise Unusable(*(footage.ONLY_SMALL if longest.vanished else seen.still))
    found = look(sights, frames, clip.cuts, result.scene.contact is not None)
    result.light = partial(result.light, sure=found.tip_sure[seen.shot])
    tracks = Tracks(
        clip.times, found.tip, found.object, found.tip_sure, found.object_sure,
        min(height, width), tuple(clip.cuts), arm.enters, longest.unmoved(seen), width=width,
    )  # fmt: skip
    tracks = tracks.marked("tip", list(choices.tip)).marked("object", list(choices.object))
    result.tracks, result.notes = tracks, result.notes + [choices.placed] * bool(choices.placed)
    unplaced = result.scene.contact is not None and not choices.object
    hand = tracks.tip[seen.shot], tracks.tip_sure[seen.shot]
    if unplaced:  # before arms are counted: one that is before a thing reaches far into the picture
        vanished.check_seen(longest.vanished, *hand)
    arm = arm._replace(beside=longest.beside(seen.off, *hand), room=longest.room(seen))
    if arm.doubt:
        if not choices.tip:
            raise Unusable(*arm.doubt)
        said = arm.doubt[0].capitalize()
        result.warnings.append(f"{said}: it was searched all the same, because you placed the tip.")
    rate = (len(frames) - 1) / max(1e-9, tracks.times[-1] - tracks.times[0])
    result.notes.append(
        f"{len(frames)} frames at {rate:.3g} a second; their motion was smoothed and taken at "
        f"{FPS} a second, by the time stamps."
    )
    motion = lay(tracks, result.scene, choices.mirror, partial(alike, frames, tracks))
    if not choices.tip:
        result.tracks, motion = behind(tracks, motion, result.scene, choices.mirror)
    if unplaced:
        touch, there = motion.times[[motion.contact, motion.arrival]]
        result.warnings += unlike(frames, tracks, touch, there)
    return motion


def coming_in(sight: Sight, off: np.ndarray) -> arms.Arms:
    """The arms that come into a shot, as the shipped detector sees them and by what is `off` the
    room, see `Footage`. One that rests for long is seen where something has moved."""
    arm = arms.count(some(sight.whole.arms), off)
    return arm if arm.seen >= arms.SEEN else arms.count(some(sight.moving.arms), off)


def look(sights: list[Sight], frames: np.ndarray, cuts: Sequence[int], touched: bool) -> Found:
    """Tip and object in a clip's frames, as its shots are seen and patches and corners agree."""
    each = [vars(looked(sight, touched)).values() for sight in sights]
    return refine(frames, Found(*map(np.concatenate, zip(*each, strict=True))), cuts)


def looked(sight: Sight, touched: bool) -> Found:
    """Tip and object in one shot, at which the model looks twice: at all of it, and at the frames
    in which something has moved; what rests in between stays where it was.

    What rests for most of a shot is in the shot's median, and so looks like the room. Tip and
    object are each told by the look that is surer of it. Where nothing is touched a hand rests
    longest, at its mark, and the look at what moves tells it, or its outline. Patches take the
    object from the tip's way: beside a wrong tip they find what rests. So they ask each look, and
    what moves as an object does, and is no piece of the hand, or else goes farthest, is the object.
    """
    frames, model = sight.frames, sight.model
    whole, moves = model.detect(frames, sight.whole), model.detect(frames[sight.told], sight.moving)
    last = np.searchsorted(sight.told, np.arange(len(frames)), side="right") - 1
    moving = Found(*(values[last] for values in vars(moves).values()))
    hand = max(whole, moving, key=lambda one: one.tip_sure.mean())
    if not touched:
        hand = reaching(frames, moving)
    thing = max(whole, moving, key=lambda one: one.object_sure.mean())
    surer = Found(hand.tip, thing.object, hand.tip_sure, thing.object_sure)
    looks = [surer]
    if touched:  # the one that is surer of both is asked already
        looks += [one for one in (whole, moving) if not (one is hand and one is thing)]
    asked, side = [mended(frames, one) for one in looks], min(frames.shape[1:3])
    thing, _ = max(asked, key=lambda m: (m[1], not of_hand(m[0], side), gone(m[0])))
    found = Found(hand.tip, thing.object, hand.tip_sure, thing.object_sure)
    return vanished.followed(sight.vanished, frames, found) if touched else found


def stills(result: Prepared) -> np.ndarray:
    """Frames (n, S, S, 3) uint8 of a clip that was re-enacted; none of a film taken as it is."""
    if result.done is None:
        return no_frames()
    clip, shown = result.clip, spread(len(result.film), COLUMNS)
    return clip_column(clip.frames, clip.times, result.tracks, result.done.motion, shown)


def is_own(clip: Clip, first: np.ndarray) -> bool:
    """Whether the clip begins with the frame `first` (84, 84, 3), as the kit's own films do: such
    a one is what a re-enactment would be."""
    h, w = clip.frames.shape[1:3]
    if h != w or np.median(np.diff(clip.times)) > OWN_STEP or np.ptp(clip.times) > OWN_LONGEST:
        return False
    off = np.abs(small(clip.frames[0]).astype(int) - first)
    return bool(np.percentile(off, 99) < OWN)


def take_as_it_is(result: Prepared) -> None:
    """Take a film of the kit's own, 25 frames a second by its time stamps."""
    times = result.clip.times
    t = np.arange(times[0], times[-1] + 0.5 / FPS, 1 / FPS)
    nearest = np.abs(times[None] - t[:, None]).argmin(axis=1)
    keep(result, np.stack([small(result.clip.frames[i]) for i in nearest]))
    result.notes.append("It was filmed by the kit's own camera, and is taken as it is.")


def keep(result: Prepared, frames: np.ndarray) -> None:
    """Keep the film as a file, and as it comes back from it: that is what is learnt from."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / FILM
        video.write(path, frames, FPS)
        result.file, result.film = path.read_bytes(), video.read(path)[0]


def write(out: Path, name: str, result: Prepared, note: dict[str, str], learn: str = "") -> Path:
    """Write the page, and the film of a usable clip, into the folder `out`. Returns the page.

    note: see `note_of`; learn: the command that comes next, if there is one.
    """
    shown, columns = None, tuple[np.ndarray, ...]()
    write_atomic(out / NOTE, json.dumps(note))
    if len(result.film):
        write_atomic(out / FILM, result.file)
        write_stills(out / STILLS, stills(result))
        perception = imitate.load_perception(tasks.WEIGHTS / name, name)
        shown = spread(len(result.film), SHOWN)
        translated = perception.translate(result.film[shown])
        columns = result.film[shown], translated, perception.detect(translated)
    page, clip = out / PAGE, result.clip
    write_page(
        page, task=name, command=note["command"], verdict=result.verdict, frames=clip.frames,
        times=clip.times, scene=result.scene, notes=result.notes, warnings=result.warnings,
        tracks=result.tracks, motion=result.done.motion if result.done else result.motion,
        states=result.done.recording.states if result.done else None, columns=columns, shown=shown,
        links=links(page), learn=learn,
    )  # fmt: skip
    return page
