"""Who handed in what: a class's folder taken as submissions, and which notebooks count."""

from __future__ import annotations

import contextlib
import os
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from tests.grade.cell.answer import STUB
from tests.grade.exercise import everything
from tests.grade.files import (
    KIT,
    NOTEBOOK,
    RELEASED,
    File,
    marks,
    notebooks,
    printable,
    read_all,
    released,
)  # fmt: skip
from tests.grade.submission import Unreadable, parse

SYSTEM = re.compile(r"__MACOSX|desktop\.ini|thumbs\.db|\$RECYCLE\.BIN|~\$.*", re.IGNORECASE)
# One student's files in a flat download: Canvas writes name_[LATE_]user_submission_file, Moodle
# name_participant_assignsubmission_file_file, for folders, too.
CANVAS = re.compile(r"(?P<who>[^_]+)(_LATE)?_(?P<id>\d+)_\d+_(?P<file>.+)", re.DOTALL)
MOODLE = re.compile(r"(?P<who>.+_\d+)_assignsubmission_[a-z]+_?(?P<file>.*)", re.DOTALL)


@dataclass(frozen=True)
class Submission:
    """name: as the file system has it, see `printable`. paths: of a folder, or of one student's
    files, each with what it was called before a download put the student's name in front."""

    name: str
    paths: tuple[tuple[Path, str], ...]

    @classmethod
    def of(cls, path: Path) -> Submission:
        """A folder or a notebook."""
        path = path.resolve() if path.is_symlink() or not path.name else path
        return cls(path.name, ((path, path.name),))

    def files(self) -> tuple[list[File], list[str]]:
        """Its notebooks, and what else there is to say."""
        found, notes = [], []
        for path, name in self.paths:
            some, said = notebooks(path, name)
            found += some
            notes += said
        files, left_out = read_all(found)
        return files, notes + left_out


def submissions(folder: Path, out: Path, one: bool = False) -> list[Submission]:
    """The submissions in a class's folder, or the one that it is, see `is_one`, or has to be.
    Raises ValueError where there are none."""
    called = printable(str(folder))
    if not folder.exists():
        raise ValueError(f"{called}: no such folder")
    if not folder.is_dir() and not NOTEBOOK.search(folder.name):
        raise ValueError(f"{called}: neither a folder nor a notebook; unpack an archive first")
    if one or not folder.is_dir() or is_one(folder.resolve()):
        return [Submission.of(folder)]
    students: dict[str, list] = {}
    for path in sorted(folder.iterdir(), key=lambda p: os.fsencode(p.name)):
        if os.path.realpath(path) != os.path.realpath(out) and not _is_systems(path):
            student, name = _student(path)
            students.setdefault(student, []).append((path, name))
    if not students:
        raise ValueError(f"{called}: no submissions in it")
    return [Submission(student, tuple(paths)) for student, paths in students.items()]


def is_one(folder: Path) -> bool:
    """Whether a folder is one student's: a copy of the kit, or notebooks with names of the course
    and others beside them that do not answer the same. A folder of folders is a class."""
    if all((folder / name).is_dir() for name in KIT):
        return True
    found, notes = notebooks(folder, "")
    if notes or any("/" in name for _, name in found):
        return False
    files, _ = read_all(found)
    course = {released(f.name) for f in files if (RELEASED / f.name).is_file()}
    numbers = {number(f) for f in files if released(f.name) in course}
    return bool(course) and not any(
        number(f) in numbers for f in files if released(f.name) not in course
    )


def _student(path: Path) -> tuple[str, str]:
    """Whose an entry of the class folder is, and what it was called before."""
    if found := MOODLE.fullmatch(path.name):
        return found["who"], found["file"] or path.name
    if (found := CANVAS.fullmatch(path.name)) and not path.is_dir():
        return f"{found['who']}_{found['id']}", found["file"]
    return path.name, path.name


def _is_systems(path: Path) -> bool:
    """Whether an entry of the class folder is the system's, such as .DS_Store, not a student's."""
    if SYSTEM.fullmatch(path.name) or path.name.startswith("._"):
        return True
    return path.name.startswith(".") and not notebooks(path, path.name)[0]


def number(file: File) -> str:
    """Which notebook of the course a file is: by its name, the marks of its cells, or what they
    define; "" if none."""
    if name := released(file.name):
        return str(int(name[:2]))
    votes = Counter(id.split(".")[0] for id in sorted(marks(file) & set(everything())))
    if votes:
        return votes.most_common(1)[0][0]
    with contextlib.suppress(Unreadable):
        return parse(file).number
    return ""


def wanted(numbers: str | None, entries: list[Submission]) -> tuple[list[str], str]:
    """The exercises of notebooks by their numbers, "5" or "5,6", else of those that most of the
    class handed in; and a sentence on that choice. Raises ValueError where there are none."""
    known = sorted({id.split(".")[0] for id in everything()}, key=int)
    given, said = (numbers.split(","), "") if numbers else _what_most_handed_in(entries)
    given = [n.strip().lstrip("0") or "0" for n in given if n.strip()]
    if strange := [n for n in given if n not in known]:
        raise ValueError(f"no notebook {', '.join(strange)}: there are {', '.join(known)}")
    if not given:
        raise ValueError(
            "nobody handed in a notebook of the course; --notebooks says which to expect"
        )
    return [id for id in everything() if id.split(".")[0] in given], said


def _what_most_handed_in(entries: list[Submission]) -> tuple[list[str], str]:
    """The numbers of notebooks that half of the class worked on or more, else those that most did;
    and a sentence on it. A notebook as it was handed out counts where nobody worked on any."""
    each = []
    for entry in entries:
        with contextlib.suppress(Exception):  # grading it meets it again, and says so
            each.append(_numbers(entry.files()[0]))
    worked = [some for some, _ in each]
    sets = worked if any(worked) else [there for _, there in each]
    votes = Counter(n for numbers in sets for n in numbers)
    people = sum(map(bool, sets))
    enough = min(people / 2, max(votes.values(), default=0))
    taken = sorted((n for n in votes if votes[n] >= enough), key=int)
    said = f"graded are the notebooks that were handed in: {', '.join(taken)}"
    if rare := sorted(set(votes) - set(taken), key=int):
        few = ", ".join(f"{n} (by {votes[n]} of {people})" for n in rare)
        said += f"; not {few}: --notebooks {','.join([*taken, *rare])} would"
    return taken, said


def _numbers(files: Iterable[File]) -> tuple[set[str], set[str]]:
    """Which notebooks of the course a student has worked on, and which are there.

    Beside notebooks with names of the course, another counts if half of the exercises are in it: a
    stray cell makes no notebook.
    """
    files = [file for file in files if not file.why]
    named = any(released(file.name) for file in files)
    worked, there = set(), set()
    for file in files:
        n, ids = number(file), marks(file)
        all_ids = [id for id in everything() if id.split(".")[0] == n]
        if not n or (
            named and not released(file.name) and 2 * len(ids & {*all_ids}) < len(all_ids)
        ):
            continue
        there.add(n)
        if file.text.count(STUB.split('"')[0]) < max(1, len(ids)):
            worked.add(n)
    return worked, there
