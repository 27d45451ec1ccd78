"""What pages and notebooks tell a reader to type is understood: commands, options, targets."""

import re

import nbformat
import pytest

from solutions.__main__ import ROOT
from tasks import TASKS, commands
from tests.grade import arguments

STANDS_FOR = {  # what a reader fills in
    "TASK": "push", "mytask": "push", "domino": "push", "METHOD": "avid", "SEED": "0", "N": "3",
}  # fmt: skip
PARSERS = {parser.command: parser for parser in commands.parsers()}
PHONY = re.search(r"^\.PHONY:((?:.*\\\n)*.*)", (ROOT / "Makefile").read_text(), re.MULTILINE)[1]
TARGETS = set(PHONY.replace("\\", " ").split())


def pages():
    """Name and text of every page, and of the notebooks from which students' are made."""
    ours = ("lbw_minimal", "notebooks", "solutions", "tasks", "tests")
    found = [*ROOT.glob("*.md"), *(p for folder in ours for p in (ROOT / folder).rglob("*.md"))]
    for path in [*found, *(ROOT / "solutions").glob("*.ipynb")]:
        name = path.relative_to(ROOT).as_posix()
        if path.suffix == ".md":
            yield name, path.read_text(encoding="utf-8")
        else:
            cells = nbformat.read(path, 4).cells
            yield name, "\n\n".join(c.source for c in cells if c.cell_type == "markdown")


def lines(text):
    """What a page has to type: the lines of its indented blocks, and what is between backticks."""
    blocks = [line.partition(" #")[0] for line in re.findall(r"^ {4}(\S.*)", text, re.MULTILINE)]
    inline = re.findall(r"`([^`]+)`", re.sub(r"^ {4}.*", "", text, flags=re.MULTILINE))
    return [" ".join(line.partition("|")[0].lstrip("!").split()) for line in blocks + inline]


def misread(line):
    """Why a line is not understood; "" if it is, if it only names a command, or is another's."""
    words = [STANDS_FOR.get(word, word) for word in line.split()]
    try:
        if words[:1] == ["make"]:
            unknown = {word for word in words[1:] if "=" not in word} - TARGETS
            return f"{line}: make has no {', '.join(unknown)}" if unknown else ""
        if words[:1] == ["lbw"]:
            words = ["python", "-m", "tasks", *words[1:]]
        module, rest = words[2:3], words[3:]
        if words[:2] != ["python", "-m"] or not rest:
            return ""
        if module == ["tasks"] and (rest[0] not in PARSERS or rest[1:]):
            PARSERS["TASK" if rest[0] in TASKS else rest[0]].read(rest[1:])
        if module == ["tests.grade"]:
            arguments.read(rest)
    except SystemExit as end:  # 0: what asks for help gets it
        return f"{line}: ends with {end.code}" if end.code else ""
    except Exception as error:
        return f"{line}: {error}"
    return ""


def unknown(line):
    """The options of a line that no parser of the kit has."""
    return [word for word in re.findall(r"(?<!\S)--[\w-]+", line) if f'"{word}"' not in CODE]


PAGES = dict(pages())
CODE = "".join(p.read_text() for part in ("tasks", "tests") for p in (ROOT / part).rglob("*.py"))


@pytest.mark.parametrize("name", PAGES)
def test_what_a_page_tells_to_type_is_understood(name):
    assert not [why for line in lines(PAGES[name]) if (why := misread(line))]


@pytest.mark.parametrize("name", PAGES)
def test_an_option_that_a_page_names_alone_is_one(name):
    alone = [line for line in lines(PAGES[name]) if line.startswith("--")]
    assert not [option for line in alone for option in unknown(line)]


def test_an_option_that_is_none_is_found():
    asked = "--jobs 2 --job 2"
    assert unknown(asked) == [asked.split()[2]]


@pytest.mark.parametrize(
    ("page", "wrong"),
    [
        ("    python -m tasks push --seed 1    # again\n", False),
        ("    python -m tasks push --sed 1\n", True),
        ("see `python -m tasks\npush --without time`", True),
        ("`lbw pull`", True),
        ("`python -m tasks prepare` says", False),
        ("`python -m tasks prepare push`", True),
        ("    python -m tests.grade FOLDER --rays\n", True),
        ("    make push LOCK=\n", False),
        ("`make pull`", True),
    ],
)
def test_a_line_that_is_not_understood_is_found(page, wrong):
    assert any(map(misread, lines(page))) == wrong
