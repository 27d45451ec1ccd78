"""What each notebook promises: its place, folded hints, reasons, answers that wait for a guess."""

import ast
import functools
import re
from pathlib import Path

import nbformat
import pytest

from solutions.__main__ import GLOSSARY, MATH, NOTEBOOKS, glossary, page, sources
from tests.grade.exercise import everything

ALL = everything()
SOURCES = sources()
HINTS, GUESSED = ("A nudge", "A bigger hint"), "Compare with your prediction"
FOLD = re.compile(r"<details>\n<summary>([^<\n]+)</summary>\n\n(.+?)\n\n</details>", re.DOTALL)
HEAD = r"\*\*Exercise {}\.\*\* \*Difficulty ([1-3]) of 3, about (\d+) minutes\.\* \S"
LINK = re.compile(r"\]\(([^)\s]+)\)")
by_name = pytest.mark.parametrize("path", SOURCES, ids=lambda p: p.stem)


def of(exercise):
    """The solved notebook of an exercise."""
    return SOURCES[int(exercise.id.split(".")[0])]


@functools.cache
def cells(path):
    return nbformat.read(path, 4).cells


def texts(path):
    return [c.source for c in cells(path) if c.cell_type == "markdown"]


def task(exercise, path):
    """The text above an exercise's cell, and that cell."""
    ids = [c.metadata.get("nbgrader", {}).get("grade_id") for c in cells(path)]
    i = ids.index(exercise.grade_id)
    return cells(path)[i - 1].source, cells(path)[i].source


def hints(text):
    """The two hints at the end of an exercise's text; none where they are not as they should be."""
    found = FOLD.findall(text)[-2:]
    ends = re.search(r"(?:\n\n<details>(?:(?!<details>).)*</details>){2}\Z", text, re.DOTALL)
    return [said for _, said in found] if ends and tuple(n for n, _ in found) == HINTS else []


def bare(text):
    """Without what makes no difference to a reader: spaces, quotes, and how code is marked."""
    return re.sub(r"[\s`'\"]", "", text)


def code(source):
    """The lines of some code, and the expressions in it that say more than a name or a number."""
    kept = {line.partition("#")[0].removesuffix(":") for line in source.splitlines()}
    telling = ast.BinOp | ast.Compare | ast.Call | ast.Subscript | ast.Assign | ast.AugAssign
    kept |= {ast.unparse(n) for n in ast.walk(ast.parse(source)) if isinstance(n, telling)}
    return {c for c in map(bare, kept) if len(c) >= 6 and re.search(r"[-+*/@<>=\[]|\(.", c)}


@functools.cache
def secrets(exercise):
    """Code of the answer and of the grader's reference that the student has not been given."""
    _, cell = task(exercise, of(exercise))
    marks = r"### BEGIN SOLUTION\n.*?### END SOLUTION"
    given = code(re.sub(marks, "pass", cell, flags=re.DOTALL))
    named = bare(exercise.source.partition("\n")[0])
    return {c for c in code(cell) | code(exercise.source) if c not in given and c not in named}


def given_away(hint, exercise):
    """Code of the answer that a hint holds."""
    said = bare(hint)
    return {c for c in secrets(exercise) if c in said}


@pytest.mark.parametrize("exercise", ALL.values(), ids=list(ALL))
def test_an_exercise_says_how_difficult_it_is_and_how_long_it_takes(exercise):
    text, _ = task(exercise, of(exercise))
    assert len(re.findall(HEAD.format(re.escape(exercise.id)), text)) == 1


@by_name
def test_the_exercises_take_no_longer_than_the_sitting(path):
    whole = int(re.search(r"[Aa]bout (\d+) minutes", texts(path)[0])[1])
    minutes = [int(m) for _, m in re.findall(HEAD.format(r"\d+\.\d+"), "\n".join(texts(path)))]
    assert len(minutes) == sum(of(e) == path for e in ALL.values())
    assert 0 < sum(minutes) <= whole


@pytest.mark.parametrize("folder", ["solutions", "notebooks"])
def test_two_folded_hints_stand_right_above_where_the_answer_goes(folder):
    for exercise in ALL.values():
        path = of(exercise) if folder == "solutions" else NOTEBOOKS / of(exercise).name
        said = hints(task(exercise, path)[0])
        assert len(said) == 2 and 30 <= len(said[0]) < len(said[1]), exercise.id


def test_no_hint_holds_a_line_of_the_answer():
    for exercise in ALL.values():
        said = " ".join(hints(task(exercise, of(exercise))[0]))
        assert not given_away(said, exercise), exercise.id


def test_a_hint_that_holds_a_line_of_the_answer_is_noticed():
    """Its longest, with spaces that nobody sees and a sentence around it."""
    for exercise in ALL.values():
        telling = [s for s in exercise.source.splitlines()[1:] if re.search(r"[-+*/@<>=(\[]", s)]
        line = max(telling, key=len).strip().replace(" ", "  ")
        hint = f"Look at the shapes, then write `{line}`, and that is it."
        assert given_away(hint, exercise), exercise.id


def test_a_hint_that_says_it_in_words_may_stay():
    assert given_away("What you want is radius/mu.", ALL["8.1"])
    assert not given_away("Divide the radius by the friction.", ALL["8.1"])


@pytest.mark.parametrize(
    "spoil",
    [
        lambda text: text.replace("<summary>A nudge", "<summary>A hint"),
        lambda text: text.replace("<details>", "<details open>"),
        lambda text: text + "\n\nAnd one thing more.",
        lambda text: text[: text.rindex("<details>")].rstrip(),
        lambda text: text.replace("</summary>\n\n", "</summary>\n"),
    ],
    ids=["another name", "unfolded", "not last", "one alone", "no blank line"],
)
def test_hints_that_are_not_as_they_should_be_are_noticed(spoil):
    text, _ = task(ALL["6.1"], of(ALL["6.1"]))
    assert len(hints(text)) == 2 and not hints(spoil(text))


@by_name
def test_whatever_folds_is_whole_folded_and_has_one_of_three_names(path):
    """A blank line behind the summary, or what follows would not be read as Markdown."""
    for text in texts(path):
        folds = FOLD.findall(text)
        assert len(folds) == text.count("<details") == text.count("</details>")
        assert text.count("<summary") == text.count("</summary>") == len(folds)
        assert {name for name, _ in folds} <= {*HINTS, GUESSED}


def order(path):
    """The requests to predict, P, and the answers to them, A, as they come."""
    found = re.findall(rf"\*\*Predict|<summary>{GUESSED}", "\n\n".join(texts(path)))
    return "".join("P" if word.startswith("**") else "A" for word in found)


@by_name
def test_what_is_to_be_predicted_is_answered_and_folded_away(path):
    """Between a request and the next, and after the last."""
    asked = order(path)
    assert not re.search(r"PP|P$", asked), asked
    assert asked.count("P") >= 1


@by_name
def test_a_notebook_says_where_it_stands_and_links_to_its_neighbours(path):
    second = texts(path)[0].split("\n\n")[1]
    assert second.startswith("**Where you are.**")
    i = SOURCES.index(path)
    links = LINK.findall(second)
    for near in (*SOURCES[max(0, i - 1) : i], *SOURCES[i + 1 : i + 2]):
        assert near.name in links


@by_name
def test_a_reason_stands_before_each_sections_first_equation(path):
    """What it is for, or what goes wrong without it."""
    for section in re.split(r"(?m)^## ", "\n\n".join(texts(path)))[1:]:
        shown = re.sub(r"(?s)<details>.*?</details>|`[^`]*`", "", section)
        before, equation, _ = shown.partition("$$")
        assert not equation or "**Why.** " in before, section.splitlines()[0]


@pytest.mark.parametrize("folder", ["solutions", "notebooks"])
@by_name
def test_the_links_of_a_notebook_lead_somewhere(path, folder):
    folder = path.parent if folder == "solutions" else NOTEBOOKS
    for target in LINK.findall(re.sub(r"`[^`]*`|\$[^$\n]*\$", "", "\n".join(texts(path)))):
        if not target.startswith("https://"):
            assert (folder / target.partition("#")[0]).is_file(), target


@by_name
def test_in_the_book_folds_hold_their_text_and_links_lead_to_pages(path):
    notebook = nbformat.read(path, 4)
    notebook.cells = [c for c in notebook.cells if c.cell_type == "markdown"]
    expected = [MATH.sub("", said) for c in notebook.cells for _, said in FOLD.findall(c.source)]
    html = page(notebook, path)
    folds = re.findall(r"<details>\s*<summary>.*?</summary>(.*?)</details>", html, re.DOTALL)
    assert len(folds) == len(expected) > 0
    for fold, source in zip(folds, expected, strict=True):
        words = re.findall(r"[A-Za-z]{4,}", source)
        assert words[0] in fold and words[-1] in fold and "**" not in fold
    pages = set(re.findall(r'href="(\d\d_\w+\.\w+)"', html))
    assert {Path(name).stem for name in pages} <= {p.stem for p in SOURCES}
    assert {Path(name).suffix for name in pages} == {".html"}


TERM = re.compile(r"\[([^\]]+)\]\(GLOSSARY\.md#([^)]+)\)")
# What no term is linked in: code, equations, headings, tables, other links, what is folded, and
# the first lines of a notebook.
ELSEWHERE = re.compile(
    r"(?s)`+[^`]*`+|\$\$.*?\$\$|\$[^$\n]+\$|(?m:^(?:#|\||    ).*$)|<details>.*?</details>"
    r"|\*\*(?:Where you are|The question)\.\*\*.*?\n\n|\[[^\]]*\]\((?!GLOSSARY)[^)]*\)"
    r"|\*\*Exercise[^*]*\*\*|## What to read next.*"
)


def terms():
    """Term -> its text, as the glossary has them."""
    parts = re.split(r"(?m)^## (.*)$", GLOSSARY.read_text(encoding="utf-8"))
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def too_late(prose):
    """Terms that stand in a text before the place where they lead to the glossary."""
    for found in TERM.finditer(prose):
        before = TERM.sub("", prose[: found.start()])
        if re.search(rf"(?<![\w-]){re.escape(found[1])}(?![\w-])", before):
            yield found[1]


def test_the_glossary_is_in_order_and_its_terms_have_one_name_everywhere():
    """GitHub, JupyterLab and the book agree on small letters and spaces, and on nothing else."""
    assert [*terms()] == sorted(terms()) and len(terms()) > 30
    assert all(re.fullmatch("[a-z]+([ -][a-z]+)*", name) for name in terms())
    html = glossary()
    assert all(f'id="{name.replace(" ", "-")}"' in html for name in terms())


@pytest.mark.parametrize("term", terms())
def test_a_term_is_explained_in_a_sentence_or_two_and_says_where_it_is_at_home(term):
    said = terms()[term]
    explained, _, home = said.partition("[")
    assert len(re.findall(r"[.:;](?:\s|$)", explained)) <= 4 and len(explained.split()) < 50
    assert "ipynb" in home or "of the paper" in said
    assert any(id == term.replace(" ", "-") for p in SOURCES for _, id in TERM.findall(all_of(p)))


def all_of(path):
    return "\n\n".join(texts(path))


@by_name
def test_a_term_leads_to_the_glossary_once_and_where_it_is_used_first(path):
    names = {name.replace(" ", "-") for name in terms()}
    linked = [id for _, id in TERM.findall(all_of(path))]
    assert set(linked) <= names and len(linked) == len(set(linked)) > 2
    assert not [*too_late(ELSEWHERE.sub(" ", all_of(path)))]


def test_a_term_that_is_linked_too_late_is_noticed():
    prose = "A policy acts. The [policy](GLOSSARY.md#policy) is a density."
    assert [*too_late(prose)] == ["policy"]
    assert not [*too_late("Polices act. The [policy](GLOSSARY.md#policy) is a density. A policy.")]


@by_name
def test_a_preprint_that_is_named_can_be_clicked(path):
    assert not re.search(r"(?<!\[)(?i:arxiv) \d{4}\.", all_of(path))
    for number, target in re.findall(r"\[arXiv ([\d.]+)\]\((.*?)\)", all_of(path)):
        assert target == f"https://arxiv.org/abs/{number}"


@pytest.mark.parametrize(
    ("number", "section"), [(4, "III-A"), (5, "III-B"), (6, "IV-C")], ids=["4", "5", "6"]
)
def test_the_papers_equations_lead_to_the_paper(number, section):
    link = f"[the paper, section {section}](https://arxiv.org/abs/2101.07241)"
    assert link in all_of(SOURCES[number])
