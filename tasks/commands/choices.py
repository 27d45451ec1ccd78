"""What `prepare` is asked: its arguments, and what the user decides instead of the clip."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lbw_minimal.clips.reader import Clip
from lbw_minimal.clips.upright import SIDE
from lbw_minimal.training import InputError, quantity
from tasks.commands import Parser, within

MOST_SECONDS = 1e6  # eleven days: no clip is longer
SLACK = 0.01  # s: the page rounds times to 0.001
WHERE = (
    "X and Y pixels from the left and the upper edge of the picture as it was read, at most "
    f"{SIDE} wide or high, S seconds into the clip; a click into the page writes it, and it may be "
    "given several times"
)

Mark = tuple[float, float, float]  # x, y in pixels of the clip as it was read, s


class Misplaced(InputError):
    """A correction names a place or a second that the clip has not, or an end before its start."""


@dataclass(frozen=True)
class Choices:
    """What the user decides instead of the clip. Raises Misplaced if it ends before it starts."""

    first: float = 0.0  # s
    last: float | None = None  # s
    mirror: bool | None = None
    tip: tuple[Mark, ...] = ()
    object: tuple[Mark, ...] = ()

    def __post_init__(self) -> None:
        if self.last is not None and self.last <= self.first:
            raise Misplaced(
                f"--to {self.last:g} is not after --from {self.first:g}; give the first and the "
                "last second to use, in this order."
            )

    def __str__(self) -> str:
        """The options that say so, as on a command line; "" if all is left to the clip."""
        said = [f"--from {self.first:g}"] if self.first else []
        said += [] if self.last is None else [f"--to {self.last:g}"]
        said += [] if self.mirror is None else ["--mirror" if self.mirror else "--no-mirror"]
        for name, marks in (("tip", self.tip), ("object", self.object)):
            said += [f"--{name} {x:g},{y:g}@{s:g}" for x, y, s in marks]
        return " ".join(said)

    @property
    def placed(self) -> str:
        """A sentence on what the user placed; "" if that is nothing."""
        counts = [("tip", len(self.tip)), ("object", len(self.object))]
        said = [f"the {name} in {quantity(n, 'picture')}" for name, n in counts if n]
        return f"You placed {' and '.join(said)}." if said else ""

    def check(self, clip: Clip) -> None:
        """Raises Misplaced unless all that the user placed is in the clip."""
        height, width = clip.frames.shape[1:3]
        first, last = clip.times[0] - SLACK, clip.times[-1] + SLACK
        for x, y, s in (*self.tip, *self.object):
            if not (0 <= x <= width and 0 <= y <= height and first <= s <= last):
                raise Misplaced(
                    f"{x:g},{y:g}@{s:g} is outside of {width}x{height} pixels and "
                    f"{clip.times[0]:.1f} to {clip.times[-1]:.1f} s; click into a frame of the "
                    "page: it writes the place in the picture as it was read."
                )


def parser() -> Parser:
    """The arguments of `prepare`."""
    p = Parser("prepare", "Make a clip of an arm into a human video of a task, and say how.")
    p.add_task()
    add = p.add_argument
    add("file", type=Path, metavar="FILE", help="the clip, as a phone or a webcam wrote it")
    add(
        "--from",
        type=seconds,
        dest="first",
        default=0.0,
        metavar="S",
        help="second of the clip from which on it is used",
    )
    add(
        "--to",
        type=seconds,
        dest="last",
        metavar="S",
        help="second up to which it is used (its end)",
    )
    add(
        "--mirror",
        action=argparse.BooleanOptionalAction,
        help="turn left into right, or do not (as it goes)",
    )
    marks: Any = {"type": mark, "action": "append", "default": [], "metavar": "X,Y@S"}
    add("--tip", **marks, help=f"where the tip is: {WHERE}")
    add("--object", **marks, help="where the object is, written likewise")
    add(
        "--out",
        type=Path,
        metavar="DIR",
        help="its folder (runs/prepare/TASK-NAME, NAME being the clip's)",
    )
    return p


def open_ended(argv: list[str], file: Path) -> list[str]:
    """The arguments without a "--", so that a click can add options behind them."""
    named = f"./{file}" if str(file).startswith("-") else str(file)
    return [named if a == str(file) else a for a in argv if a != "--"]


# a type for argparse
seconds = within(0, MOST_SECONDS, "time in seconds from 0 on")


def mark(text: str) -> Mark:
    """A type for argparse: X,Y@S, a place in a clip in pixels, and a time in s."""
    try:
        where, when = text.split("@")
        x, y = (float(part) for part in where.split(","))
        return x, y, seconds(when)
    except (ValueError, argparse.ArgumentTypeError):
        raise argparse.ArgumentTypeError(f"{text!r} is no place and time like 120,85@1.5") from None
