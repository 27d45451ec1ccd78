"""The results of all tasks: what is missing is run first, what is finished is not repeated.

`python -m tasks table`: LbW's row of the paper's Table II, five tasks and three seeds, mended and
literal reward; with `--rivals` the whole table, with `--tracks` what came after the paper beside
it. Out: Markdown and JSON in `runs/table/`, where every run has a folder of its own.
"""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np

import tasks
from lbw_minimal.report import wilson
from lbw_minimal.training import quantity, write_atomic
from tasks.commands import Parser, at_least
from tasks.commands.batch import Job, Row, print_missing, read, run_missing
from tasks.commands.job import TEST_EPISODES

SEEDS = 3
RIVAL_SEEDS = 2
RIVALS = ("classifier", "avid")
METHODS = {  # name and number of expert videos, as in Table II, and one that came after it
    "classifier": ("Classifier reward", "35 robot videos"),
    "avid": ("AVID-m", "15 human videos"),
    "": ("LbW", "1 human video"),
    "tracks": ("Object tracks", "1 human video"),
}
TABLE_II = {  # %
    "classifier": {"reach": 100, "push": 100, "slide": 30, "coffee": 50, "drawer": 70},
    "avid": {"reach": 100, "push": 60, "slide": 0, "coffee": 40, "drawer": 50},
    "": {"reach": 100, "push": 100, "slide": 80, "coffee": 70, "drawer": 80},
}
PAPER = TABLE_II[""]
HEAD = [
    "task",
    "paper",
    "mended (95 % interval)",
    "by seed",
    "literal",
    "by seed",
    "time",
    "policy steps",
]


def parser(command: str = "table") -> Parser:
    """The arguments of `table`, and of `ablation`, whose runs lie beside the table's."""
    what = {
        "table": "The results of all tasks",
        "ablation": "What each mend of the reward is worth",
    }
    p = Parser(command, f"{what[command]}. What is missing is run first; it takes hours.")
    how = p.add_mutually_exclusive_group()
    how.add_argument("--jobs", type=at_least(1), default=1, help="runs at a time")
    how.add_argument("--ray", action="store_true", help="run what is missing on a Ray cluster")
    how.add_argument(
        "--print", action="store_true", help="only print what is missing: its commands"
    )
    p.add_argument(
        "--episodes", type=at_least(1), default=TEST_EPISODES, help="test episodes a run"
    )
    p.add_argument("--seeds", type=at_least(1), default=SEEDS, help="trainings of each task")
    p.add_argument(
        "--out", type=Path, default=Path("runs/table"), metavar="DIR", help="their folder"
    )
    if command == "table":
        p.add_argument("--rivals", action="store_true", help="the paper's rivals too, two seeds")
        p.add_argument("--tracks", action="store_true", help="object tracks too, after the paper")
    return p


def main(argv: list[str]) -> None:
    """Print the table, after running what is missing. Raises InputError if a run fails."""
    args = parser().read(argv)
    if args.print:
        count = counts(args.seeds, args.rivals, args.tracks)
        print_missing(args.out, wanted(count), args.episodes)
    else:
        how = {"rivals": args.rivals, "tracks": args.tracks, "ray": args.ray}
        print(table(args.out, args.jobs, args.episodes, args.seeds, **how))


def rate(rows: list[Row]) -> tuple[float, float, float]:
    """Success rate of some runs together, with its 95 % interval."""
    wins, n = sum(r["wins"] for r in rows), sum(r["episodes"] for r in rows)
    return wins / n, *wilson(wins, n)


def percent(rows: list[Row]) -> str:
    """Success rate and interval in whole percent."""
    mean, low, high = rate(rows)
    return f"{100 * mean:.0f} % ({100 * low:.0f}-{100 * high:.0f})"


def each(rows: list[Row]) -> str:
    """Successes run by run."""
    return ", ".join(f"{r['wins']}/{r['episodes']}" for r in rows)


def hours(rows: list[Row]) -> str:
    """Time of all stages of some runs together."""
    return f"{sum(sum(r['stages'].values()) for r in rows) / 3600:.1f} h"


def markdown(head: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def r_squared(row: Row, where: str) -> str:
    """Tip x / y, object x / y of one run; a dash for what does not move."""
    scores = [row["perception"][where][n]["r2"] for n in ("tip_x", "tip_y", "object_x", "object_y")]
    return " / ".join("-" if s is None else f"{s:.3f}" for s in scores)


def counts(seeds: int, rivals: bool, tracks: bool) -> dict[str, int]:
    """How many runs of each task the table has, by their change."""
    count = {"": seeds, "literal": seeds} | ({"tracks": seeds} if tracks else {})
    return count | {rival: min(seeds, RIVAL_SEEDS) for rival in RIVALS if rivals}


def tasks_of(change: str) -> tuple[str, ...]:
    """The tasks that runs of this change can learn: object tracks need an object that moves."""
    return tuple(t for t in tasks.TASKS if change != "tracks" or tasks.moves_object(t))


def wanted(count: dict[str, int]) -> list[Job]:
    """The runs of the table."""
    return [(t, s, c) for c, n in count.items() for t in tasks_of(c) for s in range(n)]


def table(
    out: Path,
    jobs: int,
    episodes: int = TEST_EPISODES,
    seeds: int = SEEDS,
    rivals: bool = False,
    ray: bool = False,
    tracks: bool = False,
) -> str:
    """Run what is missing, write table.md and table.json, and return the Markdown."""
    count = counts(seeds, rivals, tracks)
    run_missing(out, wanted(count), jobs, episodes, ray)
    runs = {
        (t, c): [read(out, t, s, c) for s in range(n)]
        for t in tasks.TASKS
        for c, n in count.items()
        if t in tasks_of(c)
    }
    text = markdown(
        HEAD, [success(task, runs[task, ""], runs[task, "literal"]) for task in tasks.TASKS]
    )
    text += "\n" + markdown(
        ["task", "seed", "R² of tip x / y, object x / y on robot frames", "on translated frames"],
        [
            [task, str(r["seed"]), r_squared(r, "robot"), r_squared(r, "translated")]
            for task in tasks.TASKS
            for r in runs[task, ""]
        ],
    )
    if rivals or tracks:
        where = order(runs) + "\n" if rivals else ""
        text += f"\n{table_two(runs)}\n{where}{every_run(runs)}"
    write_atomic(out / "table.md", text)
    write_rows(out / "table.json", runs)
    return text


def table_two(runs: dict[tuple[str, str], list[Row]]) -> str:
    """The paper's Table II: methods, tasks, success rates, ours before the paper's, and hours.

    Below it, what was run of methods that came later, with no figure of the paper's.
    """

    def cell(change, task):
        some = runs.get((task, change))
        theirs = f" / {TABLE_II[change][task]} %" if change in TABLE_II else ""
        return percent(some) + theirs if some else "-"

    rows = []
    for change, (name, videos) in METHODS.items():
        done = [r for (_, c), some in runs.items() if c == change for r in some]
        if done:
            cells = [cell(change, task) for task in tasks.TASKS]
            rows.append([name, videos, *cells, f"{hours(done)} in {quantity(len(done), 'run')}"])
    return markdown(["method", "expert videos", *tasks.TASKS, "time"], rows)


def order(runs: dict[tuple[str, str], list[Row]]) -> str:
    """Where the methods' order is not Table II's, as a list; ours counts where intervals part."""
    lines = []
    ours_is = {1: "above", 0: "not to be told from", -1: "below"}
    theirs_is = {1: "above it", 0: "equal", -1: "below it"}
    for task, (a, b) in itertools.product(tasks.TASKS, itertools.combinations(TABLE_II, 2)):
        (_, low_a, high_a), (_, low_b, high_b) = (rate(runs[task, change]) for change in (a, b))
        ours = (low_a > high_b) - (low_b > high_a)
        theirs = int(np.sign(TABLE_II[a][task] - TABLE_II[b][task]))
        if ours != theirs:
            here = f"{METHODS[a][0]} is {ours_is[ours]} {METHODS[b][0]}"
            lines.append(f"- {task}: {here}, in the paper {theirs_is[theirs]}\n")
    if not lines:
        return "The methods stand in the paper's order on every task.\n"
    return "Where the methods' order is not the paper's:\n\n" + "".join(lines)


def every_run(runs: dict[tuple[str, str], list[Row]]) -> str:
    """Every run of Table II: successes by seed, environment steps, hours of all of them."""
    rows = []
    for change, (name, _) in METHODS.items():
        for task in tasks.TASKS:
            if some := runs.get((task, change)):
                rows.append([name, task, each(some), f"{some[0]['steps']:,}", hours(some)])
    return markdown(["method", "task", "by seed", "environment steps", "time"], rows)


def success(task: str, mended: list[Row], literal: list[Row]) -> list[str]:
    """A task's row: the paper's rate, ours by form of the reward, time and policy steps."""
    minutes = np.mean([sum(r["stages"].values()) for r in mended]) / 60
    paper = f"{PAPER[task]} %" if task in PAPER else "-"
    ours = [percent(mended), each(mended), percent(literal), each(literal)]
    return [task, paper, *ours, f"{minutes:.0f} min", f"{mended[0]['steps']:,}"]


def write_rows(path: Path, runs: dict[tuple[str, str], list[Row]]) -> None:
    """Write all rows as JSON."""
    write_atomic(path, json.dumps([r for some in runs.values() for r in some], indent=1) + "\n")
