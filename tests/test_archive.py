"""What students get: all that its files link to is in it, and it says what it lacks."""

import re
import subprocess
import sys
from pathlib import PurePosixPath
from zipfile import ZipFile

import nbformat
import pytest

from solutions.__main__ import ARCHIVE, GLOSSARY, LECTURER, ROOT, archive, main, sources

MADE = {"tasks/domino.py", "solutions/weights/mytask"}  # by the reader
OURS = ("lbw_minimal", "notebooks", "solutions", "tasks", "tests")
LINK = re.compile(r"\]\(([^)\s]+)\)|(?:href|src)=[\"']([^\"']+)")


@pytest.fixture(scope="module")
def kit(tmp_path_factory):
    """The folder of an unpacked archive."""
    folder = tmp_path_factory.mktemp("student")
    archive(folder / "lbw.zip")
    with ZipFile(folder / "lbw.zip") as packed:
        packed.extractall(folder)
    return folder / "lbw"


def texts(kit):
    """Name and text of every page and notebook that people read."""
    for path in sorted(kit.rglob("*")):
        name = path.relative_to(kit).as_posix()
        if path.suffix == ".md":
            yield name, path.read_text(encoding="utf-8")
        elif path.suffix == ".ipynb":
            cells = nbformat.read(path, 4).cells
            yield name, "\n\n".join(c.source for c in cells if c.cell_type == "markdown")


def anchors(text):
    """What the headings of a page are called in links to them."""
    for title in re.findall(r"^#+ (.*)$", text, re.MULTILINE):
        yield re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def test_what_the_notebooks_are_made_of_and_the_exam_are_left_out_and_nothing_else(kit):
    said = subprocess.check_output(["git", "ls-files"], cwd=ROOT, text=True).splitlines()
    ours = {name for name in said if (ROOT / name).exists()}
    packed = {p.relative_to(kit).as_posix() for p in kit.rglob("*") if p.is_file()}
    assert ours - packed == {
        p.relative_to(ROOT).as_posix() for p in (*sources(), GLOSSARY, LECTURER)
    }
    assert packed <= ours
    assert not [path for path in kit.rglob("*.md") if "For an exam" in path.read_text("utf-8")]


def test_every_link_leads_to_something_in_it(kit):
    pages, lost = dict(texts(kit)), []
    for name, text in pages.items():
        prose = re.sub(r"`+[^`]*`+|\$[^$\n]*\$", "", text)
        for target in (a or b for a, b in LINK.findall(prose)):
            if re.match(r"[a-z]+:", target):
                continue
            file, _, anchor = target.partition("#")
            path = (kit / name).parent / file if file else kit / name
            there = path.exists() and path.resolve().is_relative_to(kit.resolve())
            page = pages.get(path.resolve().relative_to(kit.resolve()).as_posix(), "")
            if not there or (anchor and anchor not in anchors(page)):
                lost.append((name, target))
    assert len(pages) > 15 and not lost


def test_every_file_that_is_named_is_in_it(kit):
    lost = []
    for name, text in texts(kit):
        for code in re.findall(r"`([^`\n]+)`", text):
            for word in re.findall(r"(?<![\w./-])[a-z][\w./-]*/[\w./-]*", code):
                path = PurePosixPath(word)
                if path.parts[0] in OURS and word not in MADE and not re.search("[A-Z]{2}", word):
                    found = (kit / word).exists() or (kit / name).parent.joinpath(word).exists()
                    lost += [] if found else [(name, word)]
    assert not lost


def test_it_says_what_the_variable_in_its_notebooks_does(kit):
    """LBW_FAST, wherever a student begins to read."""
    pages = dict(texts(kit))
    for name in ("README.md", "notebooks/00_start.ipynb"):
        assert re.search(r"LBW_FAST=1[^.]*(shorten|short)", pages[name]), name


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("book", "no solved notebooks"),
        ("release", "no solved notebooks"),
        ("archive", "git does not know"),
    ],
)
def test_what_takes_the_whole_kit_says_what_is_missing(kit, command, said, monkeypatch, capsys):
    names = {"ROOT": "", "HERE": "solutions", "NOTEBOOKS": "notebooks", "BOOK": "runs/book"}
    for name, folder in names.items():
        monkeypatch.setattr(f"solutions.__main__.{name}", kit / folder)
    monkeypatch.setattr("sys.argv", ["solutions", command])
    before = sorted(kit.rglob("*"))
    assert main() == 2
    out, err = capsys.readouterr()
    assert out == "" and err.startswith("error: ") and said in err and err.count("\n") == 1
    assert sorted(kit.rglob("*")) == before


def test_a_number_that_no_notebook_has_is_named(capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["solutions", "book", "99"])
    assert main() == 2
    assert "no notebook 99" in capsys.readouterr().err


@pytest.mark.slow
def test_its_tests_can_be_collected(kit):
    line = [sys.executable, "-B", "-m", "pytest", "-q", "--collect-only", "-p", "no:cacheprovider"]
    done = subprocess.run(line, cwd=kit, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout[-2000:]
    assert "tests/test_notebooks.py::" not in done.stdout


def test_the_archive_is_where_the_lecturer_is_told_that_it_is():
    text = (ROOT / "solutions" / "README.md").read_text(encoding="utf-8")
    assert "python -m solutions archive" in text and f"`{ARCHIVE.relative_to(ROOT)}`" in text
