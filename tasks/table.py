"""The tables of results: what is missing is run first, what is finished is not repeated.

`python -m tasks table`: the paper's Table II, LbW row, five tasks and three seeds, mended and
literal reward. `python -m tasks ablation`: what mends the reward, switched off one at a time. Out:
Markdown and JSON, and for the ablation a picture, in `runs/table/`; every run has a folder of its
own there.
"""

from __future__ import annotations

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

import tasks
from lbw_minimal.report import COLOURS, STYLE, wilson
from lbw_minimal.reward import MENDS
from lbw_minimal.training import InputError, write_atomic

SEEDS = (0, 1, 2)
PAPER = {"reach": 100, "push": 100, "slide": 80, "coffee": 70, "drawer": 80}  # %, Table II
ABLATED = ("push", "slide")


def folder(out: Path, task: str, seed: int, change: str = "") -> Path:
    """Where the run of a task and seed is; change: "" (the recipe), "literal", or the mend left
    out."""
    return out / (f"{task}-{seed}-{change}" if change else f"{task}-{seed}")


def finished(path: Path) -> bool:
    note = path / "metrics.json"
    return note.exists() and "success" in json.loads(note.read_text())


def command(out: Path, task: str, seed: int, change: str) -> list[str]:
    """The arguments of one run. A changed reward learns on the perception of the unchanged run."""
    path = folder(out, task, seed, change)
    args = [task, "--seed", str(seed), "--threads", "1", "--out", str(path)]
    if not change:
        args.append("--from-scratch")
    else:
        args += ["--weights", str(folder(out, task, seed))]
        args += ["--reward", "literal"] if change == "literal" else ["--without", change]
    return args + ["--resume"] * (path / "settings.json").exists()


def run_missing(out: Path, wanted: list[tuple[str, int, str]], jobs: int) -> None:
    """Run what is not finished, `jobs` at a time, perception first. Raises InputError if a run
    fails."""

    def run(job):
        path = folder(out, *job)
        if finished(path):
            return
        print(f"running {path.name}", flush=True)
        with (out / f"{path.name}.log").open("a") as log:
            line = [sys.executable, "-m", "tasks", *command(out, *job)]
            code = subprocess.run(line, stdout=log, stderr=log).returncode
        if code:
            raise InputError(f"{path}: the run ended with code {code}; see {log.name}.")

    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{out}: cannot write there ({error.strerror}); give another --out."
        ) from None
    bases = list(dict.fromkeys((task, seed, "") for task, seed, _ in wanted))
    with ThreadPoolExecutor(jobs) as pool:
        for some in (bases, [job for job in wanted if job[2]]):
            list(pool.map(run, some))


def read(out: Path, task: str, seed: int, change: str = "") -> dict:
    """One finished run as a row: its wins, seconds a stage, steps, and R^2 of perception."""
    metrics = json.loads((folder(out, task, seed, change) / "metrics.json").read_text())
    return {
        "task": task,
        "seed": seed,
        "change": change or "mended",
        "wins": sum(e["success"] for e in metrics["episodes"]),
        "wins_at_end": sum(e["success_at_end"] for e in metrics["episodes"]),
        "episodes": len(metrics["episodes"]),
        "stages": metrics["stages"],
        "steps": metrics["settings"]["recipe"]["policy_steps"],
        "memory_mb": metrics["memory_mb"],
        "perception": metrics.get("perception"),
    }


def rate(rows: list[dict]) -> tuple[float, float, float]:
    """Success rate of some runs together, with its 95 % interval."""
    wins, n = sum(r["wins"] for r in rows), sum(r["episodes"] for r in rows)
    return wins / n, *wilson(wins, n)


def percent(rows: list[dict]) -> str:
    mean, low, high = rate(rows)
    return f"{100 * mean:.0f} % ({100 * low:.0f}-{100 * high:.0f})"


def each(rows: list[dict]) -> str:
    return ", ".join(f"{r['wins']}/{r['episodes']}" for r in rows)


def markdown(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def r_squared(row: dict, where: str) -> str:
    """Tip x / y, object x / y of one run; a dash for what does not move."""
    scores = [row["perception"][where][n]["r2"] for n in ("tip_x", "tip_y", "object_x", "object_y")]
    return " / ".join("-" if s is None else f"{s:.3f}" for s in scores)


def table(out: Path, jobs: int) -> str:
    """Run what is missing, write table.md and table.json, and return the Markdown."""
    changes = ("", "literal")
    run_missing(out, [(t, s, c) for c in changes for t in tasks.TASKS for s in SEEDS], jobs)
    runs = {(t, c): [read(out, t, s, c) for s in SEEDS] for t in tasks.TASKS for c in changes}
    rows, quality = [], []
    for task in tasks.TASKS:
        mended, literal = runs[task, ""], runs[task, "literal"]
        minutes = np.mean([sum(r["stages"].values()) for r in mended]) / 60
        rows.append(
            [task, f"{PAPER[task]} %" if task in PAPER else "-", percent(mended), each(mended),
             percent(literal), each(literal), f"{minutes:.0f} min", f"{mended[0]['steps']:,}"]
        )  # fmt: skip
        quality += [
            [task, str(r["seed"]), r_squared(r, "robot"), r_squared(r, "translated")]
            for r in mended
        ]
    text = markdown(
        [
            "task",
            "paper",
            "mended (95 % interval)",
            "by seed",
            "literal",
            "by seed",
            "time",
            "policy steps",
        ],
        rows,
    )
    text += "\n" + markdown(
        ["task", "seed", "R² of tip x / y, object x / y on robot frames", "on translated frames"],
        quality,
    )
    write_atomic(out / "table.md", text)
    write_atomic(
        out / "table.json", json.dumps([r for some in runs.values() for r in some], indent=1) + "\n"
    )
    return text


def ablation(out: Path, jobs: int) -> str:
    """Run what is missing, write ablation.md, .json and .png, and return the Markdown."""
    changes = ("", *MENDS, "literal")
    run_missing(out, [(t, s, c) for c in changes for t in ABLATED for s in SEEDS], jobs)
    runs = {(t, c): [read(out, t, s, c) for s in SEEDS] for t in ABLATED for c in changes}
    names = {c: f"without {c}" for c in MENDS} | {"": "all mends", "literal": "literal Eq. 8-10"}
    head = ["reward", *(column for t in ABLATED for column in (t, "by seed"))]
    rows = [
        [names[c], *(cell for t in ABLATED for cell in (percent(runs[t, c]), each(runs[t, c])))]
        for c in changes
    ]
    text = markdown(head, rows)
    write_atomic(out / "ablation.md", text)
    write_atomic(
        out / "ablation.json", json.dumps([r for x in runs.values() for r in x], indent=1) + "\n"
    )
    bars({names[c]: [runs[t, c] for t in ABLATED] for c in changes}).savefig(
        out / "ablation.png", dpi=110
    )
    return text


def bars(rows: dict[str, list[list[dict]]]) -> Figure:
    """Success rates with their intervals, a group of bars a reward, a bar a task."""
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
            xlabel="test episodes that succeed, three seeds together (%), 95 % interval",
        )
        axis.grid(axis="y", visible=False)
        figure.legend(loc="outside upper right", ncols=2)
    return figure
