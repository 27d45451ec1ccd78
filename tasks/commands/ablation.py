"""What each mend of the reward is worth: each is switched off alone, on two tasks.

Out: Markdown, JSON and a picture in `runs/table/`, where the runs lie beside the table's.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from lbw_minimal.pictures import COLOURS, STYLE
from lbw_minimal.reward import MENDS
from lbw_minimal.training import write_atomic
from tasks.commands import Parser, table
from tasks.commands.batch import Job, Row, print_missing, read, run_missing
from tasks.commands.job import TEST_EPISODES
from tasks.commands.table import SEEDS, each, percent, rate

ABLATED = ("push", "slide")
CHANGES = ("", *MENDS, "literal")


def parser() -> Parser:
    """The arguments of `ablation`."""
    return table.parser("ablation")


def main(argv: list[str]) -> None:
    """Print the table, after running what is missing. Raises InputError if a run fails."""
    args = parser().read(argv)
    if args.print:
        print_missing(args.out, wanted(args.seeds), args.episodes)
    else:
        print(ablation(args.out, args.jobs, args.episodes, args.seeds, args.ray))


def wanted(seeds: int) -> list[Job]:
    """The runs of the ablation."""
    return [(t, s, c) for c in CHANGES for t in ABLATED for s in range(seeds)]


def ablation(
    out: Path, jobs: int, episodes: int = TEST_EPISODES, seeds: int = SEEDS, ray: bool = False
) -> str:
    """Run what is missing, write ablation.md, .json and .png, and return the Markdown."""
    run_missing(out, wanted(seeds), jobs, episodes, ray)
    runs = {(t, c): [read(out, t, s, c) for s in range(seeds)] for t in ABLATED for c in CHANGES}
    names = {c: f"without {c}" for c in MENDS} | {"": "all mends", "literal": "literal Eq. 8-10"}
    text = table.markdown(
        ["reward", *(column for t in ABLATED for column in (t, "by seed"))],
        [
            [names[c], *(cell for t in ABLATED for cell in (percent(runs[t, c]), each(runs[t, c])))]
            for c in CHANGES
        ],
    )
    write_atomic(out / "ablation.md", text)
    table.write_rows(out / "ablation.json", runs)
    figure = bars({names[c]: [runs[t, c] for t in ABLATED] for c in CHANGES})
    figure.savefig(out / "ablation.png", dpi=110)
    return text


def bars(rows: dict[str, list[list[Row]]]) -> Figure:
    """Success rates with their intervals, a group of bars per reward, a bar per task."""
    with rc_context(STYLE):
        figure = Figure(figsize=(7.2, 3.8))
        axis = figure.subplots()
        height = 0.8 / len(ABLATED)
        for i, task in enumerate(ABLATED):
            y = np.arange(len(rows)) + (i - (len(ABLATED) - 1) / 2) * height
            mean, low, high = 100 * np.array([rate(some[i]) for some in rows.values()]).T
            bounds = [np.maximum(mean - low, 0), np.maximum(high - mean, 0)]
            axis.barh(y, mean, 0.9 * height, color=COLOURS[(1, 0)[i % 2]], label=task)
            axis.errorbar(mean, y, xerr=bounds, fmt="none", ecolor="black", capsize=2, lw=1)
        axis.set_yticks(range(len(rows)), rows)
        axis.invert_yaxis()
        axis.set(
            xlim=(0, 100),
            xlabel="test episodes that succeed, all seeds together (%), 95 % interval",
        )
        axis.grid(axis="y", visible=False)
        figure.legend(loc="outside upper right", ncols=2)
    return figure
