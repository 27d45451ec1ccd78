"""What `python -m tests.grade` is asked to do; read before what takes seconds to import."""

from __future__ import annotations

import argparse
from importlib import import_module
from pathlib import Path

from lbw_minimal import cluster


def read(argv: list[str] | None = None) -> argparse.Namespace:
    """The arguments, by default the program's, which ends where they are wrong."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.grade", description="Grade a folder of submissions."
    )
    parser.add_argument("folder", type=Path, help="submissions: one folder or one notebook each")
    parser.add_argument("--one", action="store_true", help="the folder is a single submission")
    parser.add_argument("--out", type=Path, default=Path("grades"))
    parser.add_argument(
        "--notebooks",
        help="numbers of those that were set, such as 5 or 5,6; default: what most handed in",
    )
    parser.add_argument(
        "--seed", type=int, help="of the inputs, to repeat a grading; by default a new one is drawn"
    )
    how = parser.add_mutually_exclusive_group()
    jobs = {"type": int, "choices": range(1, 65), "default": 2, "metavar": "N"}
    how.add_argument("-j", "--jobs", **jobs, help="submissions at a time")
    how.add_argument("--ray", action="store_true", help="grade on a Ray cluster")
    parser.add_argument(
        "--gradescope", action="store_true", help="write results.json for Gradescope, too"
    )
    parser.add_argument(
        "--require-bubblewrap", action="store_true", help="stop where bubblewrap does not start"
    )
    return parser.parse_args(argv)


def start_ray() -> None:
    """Start Ray if it is asked for and something is there to grade, and load the exercises."""
    args = read()
    if args.ray and args.folder.exists():
        cluster.ahead(cluster.CODE, lambda: import_module("tests.grade.exercise").everything())
