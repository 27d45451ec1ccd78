"""What leads from each of the kit's pages to the others."""

from __future__ import annotations

import os
from html import escape
from pathlib import Path

import tasks

RUNS = Path("runs")  # where the commands write if they are not told otherwise
PAGES = {  # in RUNS, what each is called, and the command that makes it
    "gallery/index.html": ("all tasks", "python -m tasks gallery"),
    "book/index.html": ("the course", "python -m solutions book"),
    "paper/paper.html": ("the paper, made again", "python -m tasks paper"),
}
# In a run's folder, who leads where. A clip's page is written before the report, and promises it.
BESIDE = {
    "report.html": ("prepare.html", "prepare.html", "the clip of this run"),
    "prepare.html": ("settings.json", "report.html", "the run on this clip"),
}


def folder(name: str, clip: Path | None, runs: Path = RUNS) -> Path:
    """Where a run of the task `name` writes by default: each clip has a folder of its own."""
    return runs / (f"{name}-{clip.stem}" if clip else name)


def links(page: Path, runs: Path = RUNS) -> str:
    """A list of the kit's other pages, for a page that is written to the path `page`.

    Where both lie in the folder `runs` a link leads there, relative, so that the folder can be
    moved. What is not there yet, or lies elsewhere, is named with its command. The report of a run
    and the page of its clip lead to each other.
    """
    here, runs, items = page.resolve(), runs.resolve(), []
    needs, file, name = BESIDE.get(page.name, ("", "", ""))
    if needs and page.with_name(needs).exists():
        items.append(f'<a href="{file}">{name}</a>')
    reports = {f"{task}/report.html": (f"a run of {task}", "") for task in tasks.TASKS}
    for clip in sorted(runs.glob("*/prepare.html")):  # which a run on a clip has in its folder
        run = clip.parent.name
        reports.setdefault(f"{run}/report.html", (f"a run on a clip: {run}", ""))
    for file, (name, command) in (PAGES | reports).items():
        there = runs / file
        if there == here:
            continue
        if there.exists() and here.is_relative_to(runs):
            way = Path(os.path.relpath(there, here.parent)).as_posix()
            items.append(f'<a href="{escape(way)}">{escape(name)}</a>')
        elif command:
            items.append(f"<span>{name}: <code>{command}</code></span>")
    return f'<nav aria-label="The kit\'s other pages">{"".join(items)}</nav>\n'
