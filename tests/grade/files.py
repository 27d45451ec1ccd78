"""The files of a submission: found, read once, and told apart by their names and dates.

Whatever lies there costs at most the submission it belongs to: no link is followed, nothing waits
(a pipe), and what cannot be read has a reason in its place.
"""

from __future__ import annotations

import functools
import itertools
import json
import os
import re
import stat
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

MOST = 20 << 20  # bytes of a notebook; those of the course have 0.1 MB
TOGETHER = 100 << 20  # bytes of a submission's notebooks
MANY = 50  # notebooks of one submission that are read
LOOKED_AT = 20_000  # files of one submission, in all its folders
RELEASED = Path(__file__).resolve().parents[2] / "notebooks"
NOTEBOOK = re.compile(r"\.ipynb(\.(txt|json))?$", re.IGNORECASE)  # some browsers add an ending
LIBRARIES = {"site-packages", "node_modules", "__pycache__", "__MACOSX"}
KIT = {"lbw_minimal", "notebooks"}  # the folders by which the kit is known
# What people and programs add to the name of a later version, before it (Colab) and behind it.
COPY = r"(?:(?:copy of|kopie von|copie de|copia de)[\s_]+)*"
LATER = r"(?:[\s_.()-]|v?\d{1,3}(?!\d)|copy|kopie|final|last|new|neu|corrected|fixed|resubmission)*"
UNPRINTABLE = re.compile(
    "[\x00-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
)


def printable(text: str) -> str:
    """Text that is safe to print and to write: control characters, lone surrogates, and marks that
    turn the direction of writing, as escapes; line breaks and tabs stay."""

    def escape(match):
        code = ord(match[0])
        if 0xDC80 <= code <= 0xDCFF:  # a byte of a name that is no UTF-8
            return f"\\x{code - 0xDC00:02x}"
        return f"\\x{code:02x}" if code < 256 else f"\\u{code:04x}"

    return UNPRINTABLE.sub(lambda m: m[0] if m[0] in "\n\t" else escape(m), text)


@dataclass(frozen=True)
class File:
    """A notebook that was handed in. name: as in its folder. why: it was not read, else ""."""

    name: str
    data: bytes = b""
    why: str = ""
    changed: float = 0.0  # when, in s of the file system's clock

    @property
    def text(self) -> str:
        """UTF-8, -16 or -32, as JSON may be."""
        return self.data.decode(json.detect_encoding(self.data), errors="replace")


def read_all(found: list[tuple[Path, str]]) -> tuple[list[File], list[str]]:
    """The notebooks at (path, name), those named as in the course first; and what was left out."""
    found = sorted(found, key=lambda pair: (not released(pair[1]), pair[1].count("/"), pair[1]))
    files, size = [], 0
    for path, name in found[:MANY]:
        files.append(_read(path, printable(name), TOGETHER - size))
        size += len(files[-1].data)
    left_out = f"{len(found)} notebooks, of which {MANY} were read"
    return files, [left_out] if len(found) > MANY else []


def notebooks(top: Path, called: str) -> tuple[list[tuple[Path, str]], list[str]]:
    """(path, name within `top`) of the notebooks there, and what could not be looked at.

    called: the name of `top` itself, if it is a file. Links are not followed. Folders of libraries
    and the kit's own are left out, as are hidden ones.
    """
    if top.is_symlink() or not top.is_dir():
        return ([(top, called)] if NOTEBOOK.search(called) else []), []
    found, notes, waiting, seen = [], [], [(top, "")], 0
    while waiting:
        folder, within = waiting.pop()
        try:
            with os.scandir(folder) as entries:
                inside = list(itertools.islice(entries, LOOKED_AT))
        except OSError as e:
            notes.append(f"{printable(within) or 'its folder'}: cannot be read ({e.strerror})")
            continue
        seen += len(inside)
        if seen >= LOOKED_AT:
            notes.append(f"more than {LOOKED_AT} files: not all of them were looked at")
            break
        names = {entry.name for entry in inside}
        if "pyvenv.cfg" in names or "conda-meta" in names:
            continue
        ours = {"lbw_minimal", "runs", "solutions", "tasks", "tests"} if names >= KIT else set()
        for entry in sorted(inside, key=lambda e: e.name):
            name = f"{within}{entry.name}"
            if entry.name.startswith(".") or entry.name in LIBRARIES | ours:
                continue
            if entry.is_dir(follow_symlinks=False):
                waiting.append((Path(entry.path), f"{name}/"))
            elif NOTEBOOK.search(entry.name):
                found.append((Path(entry.path), name))
    return found, notes


def _read(path: Path, name: str, room: int) -> File:
    """A file with what is in it, or why not."""
    careful = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOFOLLOW", 0)  # a pipe would wait
    try:
        if path.is_symlink():
            return File(name, why="not a plain file but a link")
        with open(os.open(path, os.O_RDONLY | careful), "rb") as f:
            about = os.fstat(f.fileno())
            if not stat.S_ISREG(about.st_mode):
                return File(name, why="not a plain file")
            if about.st_size > MOST:
                size = f"{about.st_size >> 20} MB"
                why = f"{size}: a notebook of this course has less than {MOST >> 20}"
                return File(name, why=why)
            if about.st_size > room:
                return File(name, why=f"more than {TOGETHER >> 20} MB with the other notebooks")
            return File(name, f.read(MOST), changed=about.st_mtime)
    except OSError as e:
        return File(name, why=f"cannot be read ({e.strerror})")


# What a notebook is called, and what it is about, without reading it as one


def released(name: str) -> str:
    """The name in the course ("06_reward") of a notebook or a later version of it, "" if none."""
    stem = NOTEBOOK.sub("", name.rpartition("/")[2])
    match = re.match(rf"{COPY}({'|'.join(_released())}){LATER}$", stem, re.IGNORECASE)
    return match[1].lower() if match else ""


@functools.cache
def _released() -> list[str]:
    return sorted(path.stem for path in RELEASED.glob("*.ipynb"))


def version(name: str) -> tuple[bool, int]:
    """How late a version a name says it is, to be compared: "06_reward (2)" is later than
    "06_reward", and "06_reward_final" later than both."""
    stem, rest = released(name), NOTEBOOK.sub("", name.rpartition("/")[2])
    copy, _, rest = rest.lower().partition(stem) if stem else ("", "", rest.lower())
    numbers = re.findall(r"\d+", rest) if stem else []
    return bool(re.search("final|last", rest)), int(numbers[-1]) if numbers else int(bool(copy))


def executed(file: File) -> str:
    """When a notebook's cells last ran, as Jupyter and VS Code note it; "" if they do not."""
    times = re.findall(r'"(?:iopub|shell)\.[\w.]+": *"(\d{4}-\d\d-\d\dT[\d:.]+)', file.text)
    return max(times, default="")


def marks(file: File) -> set[str]:
    """The ids of the exercises that a notebook's cells are marked for, by grade id or title."""
    found = re.findall(r'"ex-(\d{1,3})-(\d{1,3})"|# ?Exercise (\d{1,3})\.(\d{1,3})\b', file.text)
    return {f"{a or c}.{b or d}" for a, b, c, d in found}


def in_order(files: Iterable[File]) -> list[File]:
    """Files by how much they count where several answer the same exercise, the most at the end.

    Those that have a name of the course; of these the latest, by when their cells ran, if all of
    them say it, by what their name says, and by when they were written.
    """
    files = list(files)
    ran = {file.name: executed(file) for file in files}
    silent = {released(file.name) for file in files if not ran[file.name]}

    def late(file):
        stem = released(file.name)
        when = "" if stem in silent else ran[file.name]
        return bool(stem), when, version(file.name), file.changed, file.name

    return sorted(files, key=late)
