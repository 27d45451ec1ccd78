"""What leads from each of the kit's pages to the others."""

from __future__ import annotations

import hashlib
import json
import os
from html import escape
from itertools import chain, count
from pathlib import Path
from urllib.parse import quote

import tasks

RUNS = Path("runs")  # where the commands write if they are not told otherwise
FILM = "reenactment.mp4"  # what `prepare` makes of a clip
NOTE = "prepare.json"  # the clip's name, its mark, its task, its corrections and the command
MARKED = 1 << 20  # bytes: two clips of one size that begin alike are one
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
    """Where a run of the task `name` writes by default: each clip has a folder of its own.

    Of two clips of one name the second has the next folder, with a -2 behind it.
    """
    if not clip:
        return runs / name
    first = runs / f"{name}-{clip.stem}"
    numbered = (first.with_name(f"{first.name}-{i}") for i in count(2))
    return next(path for path in chain([first], numbered) if _may_have(clip, path))


def _may_have(clip: Path, path: Path) -> bool:
    """Whether no other clip's note lies in a folder."""
    there = noted(path)
    return "mark" not in there or there["mark"] == mark(clip)


def mark(clip: Path) -> str:
    """What tells a clip from another of its name; a film that was made of one has that one's."""
    if clip.name == FILM and "mark" in (note := noted(clip.parent)):
        return note["mark"]
    with open(clip, "rb") as file:
        digest = hashlib.sha256(file.read(MARKED)).hexdigest()
    return f"{clip.stat().st_size}-{digest[:16]}"


def note_of(file: Path, task: str, command: str) -> dict[str, str]:
    """What stays known of a clip: its name and mark, the task, its "corrections", none as yet, and
    the "command" that prepares it."""
    return {"clip": file.name, "mark": mark(file), "task": task, "corrections": "",
            "command": command}  # fmt: skip


def noted(path: Path) -> dict[str, str]:
    """The note in a folder; nothing where there is none."""
    try:
        return json.loads((path / NOTE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


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
    own = noted(here.parent).get("mark")
    for clip in sorted(runs.glob("*/prepare.html")):  # which a run on a clip has in its folder
        run, which = clip.parent.name, "a clip"
        if own:
            which = "this clip" if noted(clip.parent).get("mark") == own else "another clip"
        reports.setdefault(f"{run}/report.html", (f"a run on {which}: {run}", ""))
    for file, (name, command) in (PAGES | reports).items():
        there = runs / file
        if there in (here, here.with_name("report.html")):  # that is named already
            continue
        if there.exists() and here.is_relative_to(runs):
            way = Path(os.path.relpath(there, here.parent)).as_posix()
            items.append(f'<a href="{quote(way)}">{escape(name)}</a>')
        elif command:
            items.append(f"<span>{name}: <code>{command}</code></span>")
    return f'<nav aria-label="The kit\'s other pages">{"".join(items)}</nav>\n'
