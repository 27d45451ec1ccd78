"""One file per command, each with its own arguments and help.

What they share is here: how arguments are read, and how a mistake becomes one sentence.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import NoReturn

import tasks
from lbw_minimal.training import InputError
from tasks.world.env import MOST_JITTER

COMMANDS = {  # each a file in this folder
    "prepare": "a clip of your own arm made into a human video, with a page that says how",
    "record": "film the human videos of a task again",
    "stage": "a page to film your own arm with",
    "export": "the experts' actions, states and frames as a Minari dataset",
    "table": "the results of all tasks; what is missing is run first",
    "ablation": "what each mend of the reward is worth",
    "paper": "the paper's tables and figures on one page; what is missing is run first",
    "gallery": "one page with every task's scene, demonstration and rollout",
    "viewer": "a task's scene as a page that turns with the mouse",
    "probe": "how well the keypoints tell where things are",
    "eyes": "train what finds tip and object in a person's own clip, and measure it",
    "controls": "the policy beside robots that see little or nothing",
    "robustness": "success under a moved camera, other light and colour",
    "bench": "steps, iterations and updates a second on this machine",
}

JITTER = 0.005  # m, start jitter, so that ten test episodes are ten different ones


class Help(argparse.ArgumentDefaultsHelpFormatter):
    """Names the defaults there are."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        return action.help if action.default in (None, []) else super()._get_help_string(action)


class Parser(argparse.ArgumentParser):
    """The arguments of one command. A mistake raises InputError with a sentence that says more."""

    def __init__(self, command: str, description: str):
        super().__init__(
            prog=f"python -m tasks {command}",
            description=description,
            allow_abbrev=False,
            formatter_class=Help,
        )
        self.command = command

    def error(self, message: str) -> NoReturn:
        raise InputError(
            f"{self.command}: {message.removesuffix('.')}; {self.prog} --help tells more."
        )

    def read(self, argv: list[str]) -> argparse.Namespace:
        """The arguments in `argv`; one that belongs to another command is refused with its name."""
        args, unknown = self.parse_known_args(argv)
        if not unknown:
            return args
        option = unknown[0].partition("=")[0]
        if not option.startswith("-"):
            self.error(f"{option!r} is one argument too many (a name with a space wants quotes)")
        owners = [
            f"python -m tasks {parser.command}"
            for parser in parsers()
            if option in parser.options()
        ]
        if owners:
            owner = " and ".join(owners)
            raise InputError(f"{self.command}: {option} does nothing here; it belongs to {owner}.")
        self.error(f"there is no option {option}")

    def options(self) -> set[str]:
        """All options by their long names."""
        return set(self._option_string_actions)

    def add_task(self) -> None:
        """The task as a positional argument."""
        names = ", ".join(tasks.TASKS)
        self.add_argument("task", type=task, metavar="TASK", help=f"one of {names}")

    def add_weights(self) -> None:
        """A folder of trained weights as an option."""
        self.add_argument(
            "--weights", type=Path, metavar="DIR", help="trained weights (those of the kit)"
        )


def parsers() -> list[Parser]:
    """The parser of every command."""
    run = import_module("tasks.commands.run").parser("TASK")
    return [run, *(import_module(f"tasks.commands.{name}").parser() for name in COMMANDS)]


def task(name: str) -> str:
    """The name of a task, for argparse."""
    if name not in tasks.TASKS:
        raise argparse.ArgumentTypeError(
            f"there is no task {name}; choose one of {', '.join(tasks.TASKS)}"
        )
    return name


def at_least(least: int) -> Callable[[str], int]:
    """A type for argparse: a whole number of `least` or more."""

    def number(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if value < least:
            raise argparse.ArgumentTypeError(f"{text!r} is no whole number of {least} or more")
        return value

    return number


def within(low: float, high: float, what: str) -> Callable[[str], float]:
    """A type for argparse: a number from `low` to `high`, which is `what`."""

    def number(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r} is no {what}")
        return value

    return number


# a type for argparse: how far a start may be moved
metres = within(0, MOST_JITTER, f"length from 0 to {MOST_JITTER} m")


def make_folder(out: Path) -> None:
    """Make the folder `out`. Raises InputError where that is impossible, or it is read-only."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=out).close()
    except OSError as error:
        raise InputError(
            f"{out}: cannot write there ({error.strerror}); give another --out."
        ) from None
