"""How far the detector is off in clips of strangers, whose makers know where tip and object are.

    python -m tests.strange_eyes --seed 4 --count 24     # by how a clip is made, and by task

Only usable clips count: in others what is to be found is hidden, or not there.
"""

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lbw_minimal.clips.detector import Detector
from lbw_minimal.clips.drawn_shapes import SIZE
from lbw_minimal.clips.reader import read_clip
from tasks.commands.eyes import Seen, compare
from tasks.commands.prepare import EYES
from tests.strangers import Stranger, stranger


def looked_at(model: Detector, one: Stranger, folder: Path) -> Seen:
    """What the model finds in a clip as it comes back from its file, and the truth.

    A reach has no object: what it goes to is a mark. Nor has a frame that shows it no longer.
    """
    frames = read_clip(one.write(folder)).frames
    h, w = frames.shape[1:3]
    scale = w / one.frames.shape[2]  # a large clip is read smaller
    tip, thing = scale * one.tip, scale * one.object
    if one.task == "reach":
        thing = np.full_like(thing, np.nan)
    for path in (tip, thing):
        path[~((path >= 0) & (path < (w, h))).all(1)] = np.nan
    return Seen(model.detect(frames), tip, thing, max(h, w) / SIZE)


def looks(model: Detector, seed: int, count: int) -> Iterator[tuple[Stranger, Seen]]:
    """The usable ones among the first clips of a seed."""
    for i in range(count):
        one = stranger(seed, i)
        if one.kind == "usable":
            with tempfile.TemporaryDirectory() as folder:
                yield one, looked_at(model, one, Path(folder))


def main() -> None:
    """Print the figures of `eyes`."""
    p = argparse.ArgumentParser()
    p.add_argument("--seed", type=int, default=4)
    p.add_argument("--count", type=int, default=24)
    args = p.parse_args()
    seen = list(looks(Detector.load(EYES), args.seed, args.count))
    for group in ("painted", "filmed", "reach", "push", "slide", "coffee", "drawer"):
        some = [look for one, look in seen if group in (one.made, one.task)]
        for what, row in compare(some).items() if some else ():
            told = "".join(f"{k} {v:<8}" for k, v in row.items())
            print(f"{group:8s}{len(some):3d} clips  {what:8s}{told}")


if __name__ == "__main__":
    main()
