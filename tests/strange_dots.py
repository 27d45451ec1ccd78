"""How far the dots of usable clips of strangers are off, as they are laid into the scene.

    python -m tests.strange_dots --made filmed --seed 84 --count 60

`strangers.py` asks for verdicts alone, and a verdict counts for little if what was found is not
tip and object. Only clips that are usable, and that `prepare` takes, have dots to be asked. They
count from when the object moves until it rests, where a reach has none while the hand moves. A way
is off by its median there, as a share of the picture's width.
"""

import tempfile
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lbw_minimal.clips import camera
from lbw_minimal.clips.footage import TREMBLES
from lbw_minimal.clips.paths import Tracks, busiest_piece, low_pass, of_a_hand, trusted
from lbw_minimal.clips.reader import read_clip
from tests.strangers import Stranger, asked, stranger

RIGHT = 0.05  # of the width: what is farther off is on something else
MOVES = 0.02, 0.98  # of its way: before it rests, and after


class Dots(NamedTuple):
    """How far the dots of a clip are off, in widths of its picture."""

    tip: float
    object: float  # nan in a reach, which has none
    swapped: float  # share of the frames in which the tip's dot is nearer to the object

    @property
    def right(self) -> bool:
        """Whether both are where they should be."""
        return self.tip < RIGHT and not self.object >= RIGHT


def laid(tracks: Tracks, touched: bool, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tip and object (N, 2) at the times t (N,), in pixels, as `lay` takes them; the object is nan
    where nothing is touched."""
    piece = busiest_piece(tracks if touched else of_a_hand(tracks, []), touched, [])
    tip = low_pass(*trusted(piece, "tip"), t)
    return tip, low_pass(*trusted(piece, "object"), t) if touched else np.full_like(tip, np.nan)


def steadied(one: Stranger, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """The true tip and object (T, 2) in pixels of the clip's frames as they are searched: where
    the camera trembles they are moved as the frames are. nan where the picture shows none."""
    clip = read_clip(path)
    h, w = clip.frames.shape[1:3]
    places = w / one.frames.shape[2] * np.stack([one.tip, one.object])
    places[~((places >= 0) & (places < (w, h))).all(2)] = np.nan
    shots = [slice(*shot) for shot in pairwise([0, *clip.cuts, len(clip.frames)])]
    sways = [camera.sway(clip.frames[shot]) for shot in shots]
    longest = max(sways, key=len)
    if camera.extent(longest, h, w) > TREMBLES:
        sway = np.concatenate(sways)
        places = np.einsum("tij,ntj->nti", sway[..., :2], places) + sway[..., 2]
    return places[0], places[1]


def moving(path: np.ndarray, first: int) -> np.ndarray:
    """In which frames (T,) bool what goes a path (T, 2) from frame `first` on is on its way."""
    start = path[first:][np.isfinite(path[first:]).all(1)][0]
    gone = np.nan_to_num(np.linalg.norm(path - start, axis=1))
    gone = np.maximum.accumulate(np.where(np.arange(len(path)) < first, 0, gone)) / gone.max()
    return (gone > MOVES[0]) & (gone < MOVES[1])


def off(one: Stranger, tracks: Tracks, path: Path) -> Dots:
    """How far the tracks found in a stranger's clip, the file `path`, are off."""
    touched = one.task != "reach"
    tip, thing = steadied(one, path)
    when = moving(one.object if touched else one.tip, one.first)
    found_tip, found_thing = laid(tracks, touched, tracks.times)
    tip_off, thing_off, other = (
        np.linalg.norm(a - b, axis=1)[when] / tracks.width
        for a, b in ((found_tip, tip), (found_thing, thing), (found_tip, thing))
    )
    both = np.isfinite(tip_off + other)
    return Dots(
        float(np.nanmedian(tip_off)),
        float(np.nanmedian(thing_off)) if touched else np.nan,
        float((other < tip_off)[both].mean()) if touched and both.any() else 0.0,
    )


def taken(seed: int, count: int, made: str) -> Iterator[tuple[int, Stranger, Dots]]:
    """The usable ones among the first clips of a seed that `prepare` takes, and their dots."""
    from tasks.commands.prepare import prepare

    for i in range(count):
        one = stranger(seed, i, made)
        if one.kind != "usable":
            continue
        with tempfile.TemporaryDirectory() as folder:
            path = one.write(Path(folder))
            result = prepare(one.task, path)
            if not result.why_not and result.tracks is not None:
                yield i, one, off(one, result.tracks, path)


def main() -> None:
    """Print how far each clip's dots are off, and how many are right."""
    from lbw_minimal.report import wilson

    dots = []
    for i, one, dot in taken(*asked(seed=84)):
        said = "right" if dot.right else "WRONG"
        print(f"{i:3d} {said} {one.made} {one.task}: tip {dot.tip:.3f}, object {dot.object:.3f}, "
              f"swapped in {dot.swapped:.0%}", flush=True)  # fmt: skip
        dots.append(dot)
    right = sum(dot.right for dot in dots)
    low, high = wilson(right, len(dots))
    print(f"{right} of {len(dots)} with both dots right, 95 % interval {low:.2f} to {high:.2f}")


if __name__ == "__main__":
    main()
