"""Clips of strangers, each with the verdict that a person would give it: a trial for `prepare`.

    python -m tests.strangers --seed 1 --count 60      # each verdict, and how many are right
    python -m tests.strangers --made filmed --seed 70

Filmed ones come from the simulator, with another person, room, light and camera
(`strange_scenes.py`); others are painted (`strange_paintings.py`). As they come, half of the usable
clips and of those of a camera that moves are filmed, and all others painted. Frame rates, codecs,
noise, flicker, cuts and shake are a phone's. The verdict follows from how a clip is made: nothing
here looks at what `prepare` makes of it.
"""

import argparse
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from tests.strange_cameras import MARGIN, camera, developed
from tests.strange_paintings import painted
from tests.toy_clips import encode

# Kinds of clips that are not usable, and what the verdict has to say.
FAULTS = {
    "still": "nothing moves", "pan": "the camera moves", "zoom": "the camera moves",
    "carried about": "the camera moves", "no arm": "no arm", "two people": "several people",
    "never moves": "never moves", "hidden": "hid", "short": "too few", "pulled": "pull|towards",
    "lifted": "straight way|up or down", "steep": "up or down",  # a steep reach is usable
}  # fmt: skip
TASKS = ("reach", "push", "slide", "coffee", "drawer")
USABLE = 0.55  # share of the clips
SIZES = ((240, 320), (216, 384), (270, 360), (384, 216), (256, 256))  # height, width
CODECS = (
    ("libx264", {"crf": "23"}), ("libx264", {"crf": "34"}), ("libx265", {"crf": "28"}),
    ("libx265", {"crf": "36"}), ("mpeg4", {"qscale": "6"}), ("mjpeg", {}),
)  # fmt: skip
TOOLS = 0.2  # share of the filmed usable clips, if all are filmed


@dataclass
class Stranger:
    """A clip, and what is true of it."""

    kind: str  # "usable" or one of FAULTS
    task: str
    made: str  # "painted" or "filmed"
    frames: np.ndarray  # (T, H, W, 3) uint8
    rate: int  # frames a second
    tip: np.ndarray  # (T, 2) pixels
    object: np.ndarray  # (T, 2) pixels
    first: int = 0  # the frame with which what counts begins: before it there is a cut
    shaken: bool = False
    codec: int = 0

    @property
    def usable(self) -> bool:
        """Whether it shows its task. A hand that reaches may come from straight above: two persons
        who judged films of others by README alone call such films usable."""
        return self.kind == "usable" or (self.kind == "steep" and self.task == "reach")

    @property
    def reason(self) -> str:
        """A pattern of the reason for which it is not usable; "" if it is usable."""
        if self.kind in ("pulled", "hidden") and self.task == "slide":
            return FAULTS[self.kind] + "|goes along"  # the hand does so, and a slide is a hit
        if self.kind == "no arm" and self.task == "reach":
            return FAULTS["still"] + "|no arm"  # a lamp may swing, and nothing else
        return "" if self.usable else FAULTS[self.kind]

    def write(self, folder: Path) -> Path:
        """The clip as a file."""
        codec, options = CODECS[self.codec]
        fmt = "yuvj420p" if codec == "mjpeg" else None
        quiet = {"x265-params": "log-level=none"} if codec == "libx265" else {}
        suffix = ".avi" if codec == "mjpeg" else ".mp4"
        path = folder / f"a stranger's {self.kind}, {self.task}{suffix}"
        return encode(path, self.frames, codec, self.rate, fmt=fmt, options=options | quiet)


def stranger(seed: int, i: int, made: str = "either") -> Stranger:
    """The i-th clip of a seed; made: "filmed", "painted", or "either", as it comes."""
    rng = np.random.default_rng([seed, i])
    task = TASKS[i % 5]
    kind = "usable" if rng.random() < USABLE else str(rng.choice(list(FAULTS)))
    if task == "reach" and kind in ("never moves", "hidden", "pulled", "lifted"):
        kind = "steep"
    if task == "drawer" and kind in ("lifted", "steep", "no arm"):
        kind = "pan"
    if made == "filmed" and task == "drawer" and kind == "hidden":
        kind = "two people"  # a drawer is larger than a hand
    height, width = SIZES[rng.choice(5, p=[0.3, 0.25, 0.2, 0.15, 0.1])]
    rate = int(
        rng.choice([10, 12, 15, 24, 25, 30, 60], p=[0.12, 0.12, 0.12, 0.13, 0.22, 0.24, 0.05])
    )
    canvas = round(MARGIN * height), round(MARGIN * width)
    if made == "either":
        made = "painted"
        if kind in ("usable", "pan", "zoom", "carried about") and rng.random() < 0.5:
            made = "filmed"
        tool = False
    else:
        tool = kind == "usable" and rng.random() < TOOLS
    if made == "filmed":
        from tests.strange_scenes import film

        pictures, tip, thing = film(rng, task, *canvas, rate, kind, tool)
    else:
        pictures, tip, thing = painted(rng, task, kind, *canvas, rate)
    shaken = kind == "usable" and rng.random() < 0.2
    moves = kind if kind in ("pan", "zoom", "carried about") else "shaken" if shaken else ""
    views = camera(rng, len(pictures), (height, width), canvas, moves, rate)
    frames = np.stack(
        [
            cv2.warpAffine(p, view, (width, height), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
            for p, view in zip(pictures, views, strict=True)
        ]
    )
    inverse = [np.linalg.inv(np.vstack([view, (0, 0, 1)]))[:2] for view in views]
    tip, thing = (
        np.stack([m[:, :2] @ p + m[:, 2] for m, p in zip(inverse, path, strict=True)])
        for path in (tip, thing)
    )
    first = 0
    if kind == "usable" and rng.random() < 0.15:  # another take before, from another place
        first = max(3, min(len(frames) // 4, rate // 2))
        view = np.array([[1.0, 0.03, -width / 7], [-0.03, 1.0, height / 9]])
        before = np.stack(
            [
                cv2.warpAffine(f, view, (width, height), borderMode=cv2.BORDER_REFLECT)
                for f in frames[-first:]
            ]
        )
        frames = np.concatenate([before, frames])
        tip, thing = (np.concatenate([path[-first:], path]) for path in (tip, thing))
    frames = developed(rng, frames)
    if kind == "short":
        some = np.linspace(0.3 * len(frames), 0.8 * len(frames), 5).astype(int)
        frames, tip, thing = frames[some], tip[some], thing[some]
    codec = int(rng.integers(len(CODECS)))
    return Stranger(kind, task, made, frames, rate, tip, thing, first, shaken, codec)


def judged(one: Stranger, verdict: str) -> bool:
    """Whether a verdict is right: usable or not, and why not."""
    if verdict.startswith("usable"):
        return one.usable
    return not one.usable and bool(re.search(one.reason, verdict))


def trial(seed: int, count: int, made: str = "either", show=print) -> list[tuple[Stranger, str]]:
    """Clips of strangers with the verdicts of `prepare`."""
    from tasks.commands.prepare import prepare

    out = []
    for i in range(count):
        one = stranger(seed, i, made)
        with tempfile.TemporaryDirectory() as folder:
            verdict = prepare(one.task, one.write(Path(folder))).verdict
        out.append((one, verdict))
        said = "right" if judged(one, verdict) else "WRONG"
        shake = ", shaken" if one.shaken else ""
        show(f"{i:3d} {said} {one.made} {one.task}, {one.kind}{shake}: {verdict}", flush=True)
    return out


def asked(seed: int) -> tuple[int, int, str]:
    """Which clips the command line asks for: seed, `seed` if there is none, count, and `made`."""
    p = argparse.ArgumentParser()
    p.add_argument("--seed", type=int, default=seed)
    p.add_argument("--count", type=int, default=60)
    p.add_argument("--made", choices=("either", "filmed", "painted"), default="either")
    args = p.parse_args()
    return args.seed, args.count, args.made


def main() -> None:
    """Print each verdict, and how many are right."""
    from lbw_minimal.report import wilson

    told = trial(*asked(seed=1))
    right = sum(judged(*pair) for pair in told)
    low, high = wilson(right, len(told))
    print(f"{right} of {len(told)} verdicts right, 95 % interval {low:.2f} to {high:.2f}")


if __name__ == "__main__":
    main()
