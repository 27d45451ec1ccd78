"""`python -m tasks`: picks the command, and says what there is if none is named.

`python -m tasks TASK ...` runs the paper on one task; the other commands are the files in
`tasks/commands/`.
"""

from __future__ import annotations

import io
import os
import sys
from importlib import import_module

import tasks
from lbw_minimal.cluster import INTERRUPTED
from lbw_minimal.training import InputError
from tasks.commands import COMMANDS

PIPE_CLOSED = 141  # as a shell has it: 128 and SIGPIPE's number


def overview() -> str:
    """What there is: tasks, commands, and what to try first."""
    lines = ["A robot watches one human video and learns the skill.", "", "tasks:"]
    lines += [f"  {name:10s} {tasks.sentence(name)}" for name in tasks.TASKS]
    lines += [
        "",
        "commands:",
        "  TASK       learn the task from its video; write runs/TASK/report.html",
    ]
    lines += [f"  {name:10s} {about}" for name, about in COMMANDS.items()]
    lines += ["", "try first:"]
    for line, about in (
        ("push --evaluate", "the trained robot pushes: ten episodes and a report"),
        ("push", "the robot learns to push, in front of you"),
        ("gallery", "all five tasks on one page"),
    ):
        lines.append(f"  python -m tasks {line:16s} {about}")
    return "\n".join([*lines, "", "python -m tasks push --help lists the options of a command."])


def main(argv: list[str] | None = None) -> int:
    """Run a command line; returns its exit code: 2 for a mistake, named in a sentence on stderr,
    130 if it was interrupted, 141 if nobody reads what it prints."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # a terminal, or Windows, may not know a letter
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        code = _run((sys.argv[1:] if argv is None else argv) or ["--help"])
        sys.stdout.flush()
    except BrokenPipeError:  # who reads has had enough, as `head` has
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python says so at exit
        return PIPE_CLOSED
    return code


def _run(argv):
    name, *rest = argv
    try:
        if name in ("-h", "--help"):
            print(overview())
        elif name in tasks.TASKS:
            import_module("tasks.commands.run").main(name, rest)
        elif name in COMMANDS:
            return import_module(f"tasks.commands.{name}").main(rest) or 0
        else:
            there = ", ".join((*tasks.TASKS, *COMMANDS))
            raise InputError(f"{name}: there is no such task or command; choose one of {there}.")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        way = "; the same line with --resume goes on" if name in tasks.TASKS else ""
        print(f"\ninterrupted{way}", file=sys.stderr)
        return INTERRUPTED
    return 0


if __name__ == "__main__":
    sys.exit(main())
