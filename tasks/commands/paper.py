"""The paper by one command: its tables and figures, made here, and some that it should have had.

Out: a folder with the runs, `paper.md`, `paper.html`, and figures as PNG and SVG. What is missing
is run first, what is finished is not repeated. Each item of the page names the command for it.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mistune
import numpy as np
from matplotlib.figure import Figure

import tasks
from lbw_minimal import diagram, video
from lbw_minimal.pictures import data_uri
from lbw_minimal.report_texts import CSS, HTML, options
from lbw_minimal.training import read_json, write_atomic
from tasks.commands import Parser, at_least, controls, figures, make_folder, translations
from tasks.commands.batch import Job, folder, read, run_missing
from tasks.commands.job import TEST_EPISODES
from tasks.commands.links import links
from tasks.commands.probe import NAMES
from tasks.commands.table import (
    METHODS,
    RIVALS,
    each,
    every_run,
    markdown,
    order,
    percent,
    table_two,
    tasks_of,
)
from tasks.commands.translations import demo_of
from tasks.world import record_expert

TABLE_I = {  # frames of the human and of the robot that the paper's perception learns from
    "reach": (1056, 3150),
    "push": (398, 1220),
    "slide": (650, 2120),
    "coffee": (658, 4007),
    "drawer": (986, 2940),
}
LONG = ("reach", "push")  # where the rivals get three times the steps as well
VIDEOS = {"LbW": {1: "", 5: "videos-5", 15: "videos-15"},
          "AVID-m": {1: "avid-1", 5: "avid-5", 15: "avid"}}  # fmt: skip
FEW_STEPS = (
    "All have the environment steps after which LbW has long learnt, a few thousand. The curves "
    "of success say which method was on its way, and the rivals with three times the steps "
    "whether it gets there. Object tracks came after the paper, and need an object to track.\n"
)
WIDE = 0.02  # m, the start jitter of `batch`'s "wide" runs
EYES = (
    "Successes of the policy, to those of the best robot without eyes. Where a task says no, a "
    "success there does not show that the policy looks.\n"
)
PAGE_CSS = (
    CSS
    + """
body { max-width: 72rem }
p > code { font-size: .85rem; color: var(--soft) }
p > code::before { content: "Made by "; font-family: system-ui, sans-serif }
p:has(img) { max-width: none; overflow-x: auto }
@media screen and (max-width: 40rem) {
  p > img { max-width: none; width: 44rem } h2:first-of-type + p > img { width: 100% }
  td, th { white-space: nowrap }
}
@media print { table { font-size: .72rem } th, td { padding-right: .6rem } }
"""
)


@dataclass(frozen=True)
class Plan:
    """What is asked for: how much of everything, and where it goes."""

    out: Path
    jobs: int
    episodes: int
    seeds: int
    fast: bool

    @property
    def controls(self) -> int:
        """Test episodes of each control: cheap beside a training, and compared closely."""
        return self.episodes if self.fast else 100

    @property
    def cycles(self) -> dict[str, str]:
        """The forms of CycleGAN, and AVID-m's runs with them."""
        more = {} if self.fast else {"CycleGAN with motion weights": "avid-motion"}
        return {"CycleGAN": "avid"} | more

    @property
    def runs(self) -> Path:
        """The folder of the runs."""
        return self.out / "runs"

    def seeds_of(self, change: str) -> range:
        """The seeds of a kind of run: the rivals have two, single experiments one."""
        most = dict.fromkeys(("", "wide", "tracks"), self.seeds) | dict.fromkeys(RIVALS, 2)
        return range(min(self.seeds, most.get(change, 1)))


def parser() -> Parser:
    """The arguments of `paper`."""
    p = Parser("paper", "The paper's tables and figures. What is missing is run first: for days.")
    p.add_argument("--jobs", type=at_least(1), help="runs at a time (1; --fast all cores)")
    p.add_argument("--episodes", type=at_least(1), default=TEST_EPISODES, help="test episodes")
    p.add_argument("--seeds", type=at_least(1), default=3, help="trainings of LbW on each task")
    p.add_argument("--fast", action="store_true", help="a smoke run through all of it")
    p.add_argument(
        "--out", type=Path, default=Path("runs/paper"), metavar="DIR", help="folder of the page"
    )
    return p


def main(argv: list[str]) -> None:
    """Write the page. Raises InputError for a mistake in the arguments or if a run fails."""
    args = parser().read(argv)
    episodes, seeds = (2, 1) if args.fast else (args.episodes, args.seeds)
    jobs = args.jobs or (os.cpu_count() or 1 if args.fast else 1)
    plan = Plan(args.out, jobs, episodes, seeds, args.fast)
    make_folder(plan.out / "figures")
    run_missing(plan.runs, wanted(plan), plan.jobs, plan.episodes, fast=plan.fast)
    print(f"paper: {write(plan)}")


def wanted(plan: Plan) -> list[Job]:
    """All runs of the page."""
    changes = {change: tasks_of(change) for change in ("", *RIVALS, "wide", "tracks")}
    changes |= {f"{rival}-long": LONG for rival in RIVALS} | {"avid-motion": ("push",)}
    changes |= {c: ("push",) for n in VIDEOS.values() for c in n.values() if c not in changes}
    if plan.fast:
        changes = {change: t for change, t in changes.items() if change in ("", *RIVALS)}
    return [(t, s, c) for c, some in changes.items() for t in some for s in plan.seeds_of(c)]


def write(plan: Plan) -> Path:
    """Write the page from finished runs, and return it."""
    runs: dict[tuple[str, str], list] = {}
    for task, seed, change in wanted(plan):
        runs.setdefault((task, change), []).append(read(plan.runs, task, seed, change))
    items: list[tuple[str, str, str]] = [
        ("Figure 2: the method", "paper", method(plan)),
        ("Task overview", "paper", overview(plan)),
        ("Table I: frames that perception learns from", "paper", table_one()),
        (
            "Table II: success rates, ours / the paper's",
            "table --rivals --tracks",
            f"{table_two(runs)}\n{order(runs)}\n{FEW_STEPS}",
        ),
        ("Table II, run by run", "table --rivals --tracks", every_run(runs)),
        ("Success over environment steps", "table --rivals", over_steps(plan)),
        ("Does it need to see?", "controls TASK", needs_eyes(plan)),
        ("Figure 5: translations of push", "push --method avid", translated(plan)),
        ("What keypoints know after each translation", "probe push", perception(plan)),
    ]
    if not plan.fast:
        items += [
            ("Trained with starts moved by 2 cm", "TASK --jitter 0.02", trained_wide(runs)),
            (
                "Does that need to see?",
                f"controls TASK --weights DIR --jitter {WIDE}",
                needs_eyes_wide(plan),
            ),
            ("The rivals with three times the steps", "paper", long_runs(runs)),
            ("Success over human videos, push", "push --videos N", over_videos(runs)),
        ]
    text = "# Learning by Watching, made again\n"
    if plan.fast:
        text += "\nA smoke run: no stage ran long enough to learn, and the figures say nothing.\n"
    for title, command, body in items:
        text += f"\n## {title}\n\n{body}\n`python -m tasks {command}`\n"
    write_atomic(plan.out / "paper.md", text)
    body = str(mistune.html(text)).replace(" %", "\u00a0%")  # no line begins with it
    body = re.sub("(?<=<code>)[^<]+", lambda command: options(command[0]), body)
    for path in sorted((plan.out / "figures").glob("*.svg")):  # the page needs no other file
        body = body.replace(f"figures/{path.name}", data_uri("image/svg+xml", path.read_bytes()))
    title, path = "Learning by Watching, made again", plan.out / "paper.html"
    page = HTML.format(title=title, css=PAGE_CSS, links=links(path), body=body)
    write_atomic(path, page)
    return path


def shown(plan: Plan, name: str, figure: Figure, alt: str) -> str:
    """Write a figure as PNG and SVG; what shows it in Markdown."""
    figure.savefig(plan.out / "figures" / f"{name}.png", dpi=130)
    figure.savefig(plan.out / "figures" / f"{name}.svg", metadata={"Date": None})
    return f"![{alt}](figures/{name}.svg)\n"


def robot_of(task: str) -> np.ndarray:
    """The robot expert's film of the same task: for a look, not for learning."""
    env = tasks.bare(task)
    frames, *_ = record_expert(env, seed=0)
    env.close()
    return frames


def method(plan: Plan) -> str:
    """Figure 2 from frames of push."""
    perception, demo, robot = translations.munit(plan.runs), demo_of("push"), robot_of("push")
    i, j = len(demo) // 2, len(robot) // 2
    z = perception.detect(robot[j : j + 1])[0]
    figure = diagram.method(demo[i], perception.translated[i], perception.z_E[i], robot[j], z)
    return shown(plan, "method", figure, "Human video to keypoints to reward and action")


def overview(plan: Plan) -> str:
    """A frame of each task, human above robot."""
    pairs = {}
    for task in tasks.TASKS:
        films = demo_of(task), robot_of(task)
        human, robot = (film[round(0.55 * len(film))] for film in films)
        pairs[task] = human, robot
    return shown(plan, "tasks", figures.overview(pairs), "The five tasks, human above robot")


def table_one() -> str:
    """Frames of both domains, ours / the paper's."""
    rows = [["Source (human)"], ["Target (robot)"]]
    for task in tasks.TASKS:
        random = video.read(tasks.VIDEOS / task / "random.mp4", whole=True)[0]
        ours = len(demo_of(task)) + len(random), tasks.module(task).RECIPE.robot_frames
        for row, count, papers in zip(rows, ours, TABLE_I[task], strict=True):
            row.append(f"{count:,} / {papers:,}")
    return markdown(["domain", *tasks.TASKS], rows)


def over_steps(plan: Plan) -> str:
    """Curves of all methods."""
    logs: dict[str, dict[str, list]] = {task: {} for task in tasks.TASKS}
    for task in tasks.TASKS:
        for change in ("", *RIVALS):
            paths = [folder(plan.runs, task, s, change) for s in plan.seeds_of(change)]
            logs[task][METHODS[change][0]] = [read_json(path / "policy_log.json") for path in paths]
    return shown(plan, "steps", figures.over_steps(logs), "Success over environment steps")


def measured(plan: Plan, change: str, jitters: Sequence[float]) -> list[dict]:
    """The controls of all tasks, of LbW's first seed, and beside the recipe the rivals'."""

    def note_of(task):
        path = plan.out / (change or "controls") / f"{task}.json"
        if not path.exists():
            make_folder(path.parent)
            rivals = (
                {} if change else {METHODS[c][0]: folder(plan.runs, task, 0, c) for c in RIVALS}
            )
            run = folder(plan.runs, task, 0, change)
            note = controls.measure(task, run, plan.controls, 0, rivals, jitters, plan.fast)
            write_atomic(path, json.dumps(note, indent=1) + "\n")
        return read_json(path)

    return [note_of(task) for task in tasks.TASKS]


def needs_eyes(plan: Plan) -> str:
    """The controls over start jitter, and where they leave something to see."""
    notes = measured(plan, "", controls.JITTERS[: 1 if plan.fast else None])
    found = {note["task"]: note["success"] for note in notes}
    figure = figures.over_jitter(found, notes[0]["episodes"])
    text = shown(plan, "controls", figure, "Success of the controls over start jitter")
    tables = "\n".join(controls.table(note) for note in notes)
    return f"{text}\n{EYES}\n{controls.eyes_pay(notes)}\n{tables}"


def needs_eyes_wide(plan: Plan) -> str:
    """The controls of what was trained with starts moved by 2 cm, on such starts."""
    notes = measured(plan, "wide", (WIDE,))
    return f"{controls.side_by_side(notes, WIDE)}\n{controls.eyes_pay(notes)}"


def trained_wide(runs: dict[tuple[str, str], list]) -> str:
    """LbW with starts moved by 2 cm in training and test."""
    some = {task: runs[task, "wide"] for task in tasks.TASKS}
    rows = [[t, percent(r), each(r), f"{r[0]['steps']:,}"] for t, r in some.items()]
    return markdown(["task", "success (95 % interval)", "by seed", "environment steps"], rows)


def translated(plan: Plan) -> str:
    """Figure 5: push's video as each method translates it, and the keypoints found on that."""
    figure = translations.strips(plan.runs, plan.cycles)
    return shown(plan, "push", figure, "Push: human, CycleGAN, MUNIT, keypoints")


def perception(plan: Plan) -> str:
    """R² of tip and object on push's translated frames, by translation."""
    path = plan.out / "perception.json"
    if not path.exists():
        found = translations.scores(plan.runs, plan.cycles)
        write_atomic(path, json.dumps(found, indent=1) + "\n")
    rows = [
        [f"{name}, {where}", *("-" if s["r2"] is None else f"{s['r2']:.3f}" for s in cells)]
        for name, found in read_json(path).items()
        for where in ("translated", "transfer")
        for cells in [[found[where][n] for n in NAMES]]
    ]
    return markdown(["frames", *(name.replace("_", " ") for name in NAMES)], rows)


def long_runs(runs: dict[tuple[str, str], list]) -> str:
    """The rivals' rates with the usual steps and three times as many."""
    rows = [
        [METHODS[rival][0], task, percent(runs[task, rival]), percent(runs[task, f"{rival}-long"])]
        for rival in RIVALS
        for task in LONG
    ]
    return markdown(["method", "task", "usual steps", "three times the steps"], rows)


def over_videos(runs: dict[tuple[str, str], list]) -> str:
    """Push's rate by the number of human videos."""
    numbers = next(iter(VIDEOS.values()))
    rows = [
        [name, *(percent(runs["push", change]) for change in changes.values())]
        for name, changes in VIDEOS.items()
    ]
    return markdown(["human videos", *map(str, numbers)], rows)
