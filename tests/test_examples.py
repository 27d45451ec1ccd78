"""What a wrong answer is told beside a hint: the line that raised, and a call that fails."""

import subprocess
import sys
from types import SimpleNamespace

import nbformat
import numpy as np
import pytest
import torch
from nbclient import NotebookClient

from tests.grade import example
from tests.grade.__main__ import grade, grade_one
from tests.grade.cell.answer import PREAMBLE
from tests.grade.cell.wire import Other, Raised, decode, encode
from tests.grade.conftest import _exercise, pytest_collection_modifyitems, pytest_configure
from tests.grade.exercise import Check, everything, find
from tests.grade.files import File
from tests.grade.judge import TRY, judge
from tests.grade.submission import RELEASED, Answer
from tests.kept import Kept
from tests.test_grading_files import notebook

E61 = find("6.1")
RAISES = "def r1(z, z_E):\n    # nothing\n    return 1 / 0\n"


@pytest.fixture(scope="module")
def box():
    with Kept() as sandbox:
        yield sandbox


def said(box, source, helpers=(), exercise=E61):
    return " ".join(grade_one(exercise, Answer(source, list(helpers), ""), box).lines())


# The line


def test_the_line_that_raised_is_named(box):
    words = "it raises ZeroDivisionError: division by zero (line 3: return 1 / 0)"
    assert words in said(box, RAISES)


def test_what_a_library_raised_has_the_students_line(box):
    words = said(box, "def r1(z, z_E):\n    return np.linalg.norm(z, axis=7)")
    assert "AxisError" in words and "(line 2: return np.linalg.norm(z, axis=7))" in words


def test_the_innermost_line_of_the_cell_is_named(box):
    words = said(box, "def r1(z, z_E):\n    return inner(z)\n\ndef inner(z):\n    return z.nothing")
    assert "(line 5: return z.nothing)" in words


def test_a_line_of_another_cell_is_named_by_the_one_that_led_there(box):
    words = said(
        box, "def r1(z, z_E):\n    return helper(z)", [("def helper(z):\n    0 / 0", False)]
    )
    assert "ZeroDivisionError" in words and "(line 2: return helper(z))" in words


def test_a_cell_that_does_not_run_names_its_line(box):
    words = said(box, "x = 1\nraise ValueError('no')\n")
    assert "the cell does not run: ValueError: no (line 2: raise ValueError('no'))" in words


def test_where_a_gradient_ends_is_said(box):
    words = said(box, "def adain(h, mean, std):\n    return h.numpy()", exercise=find("4.1"))
    assert "the gradient ends there" in words and "(line 2: return h.numpy())" in words


def test_check_in_a_notebook_names_the_line_of_its_cell():
    sources = ["import numpy as np\nfrom tests.grade import check", RAISES, "check('6.1')"]
    cells = [nbformat.v4.new_code_cell(source) for source in sources]
    book = nbformat.v4.new_notebook(cells=cells)
    where = {"metadata": {"path": str(RELEASED.parent)}}
    NotebookClient(book, timeout=120, resources=where).execute()
    printed = book.cells[-1].outputs[0].text
    assert "(line 3: return 1 / 0)" in printed and TRY in printed


def test_a_line_passes_between_processes_and_is_not_too_long():
    raised = decode(encode(Raised("KeyError", "x", "line 1: " + "y" * 500)))
    assert (raised, raised.text) == ("KeyError", "x") and len(raised.line) == 200
    assert Raised("KeyError").in_full() == "KeyError"


# The input to paste


@pytest.mark.parametrize(
    "value",
    [
        1, -2.5, True, None, "a 'b'", [1, (2,), ()], {"x": [0.5]}, float("inf"), np.float32(0.5),
        np.int64(3), np.array([[0.25, -1e-9]]), np.arange(40).reshape(2, 20),
        np.array([0.1, 3], np.float32), np.array([1], np.uint8), np.array([True, False]),
        np.array(0.5), torch.tensor([[0.1, 2.0]]), torch.tensor([1, 2]), torch.tensor(0.5),
        torch.tensor([0.1], dtype=torch.float64), torch.tensor([0.1], requires_grad=True),
    ],
)  # fmt: skip
def test_what_is_written_is_the_value_again(value):
    again = eval(example.written(value), {"np": np, "torch": torch})
    assert encode(again) == encode(value.item() if isinstance(value, np.generic) else value)
    assert getattr(again, "requires_grad", False) == getattr(value, "requires_grad", False)


@pytest.mark.parametrize(
    "value",
    [print, np.array([np.nan]), np.zeros((0, 2)), np.zeros(501), [Other("set")[:0].upper],
     np.array([1j])],
)  # fmt: skip
def test_what_cannot_be_pasted_is_not_written(value):
    with pytest.raises(example.Unprintable):
        example.written(value)


def test_numbers_are_rounded_and_all_else_is_not():
    args = (0.123, 7, "x", np.array([1.234, -0.000123]), np.arange(2), torch.tensor([9.99]), [True])
    got = example.rounded(args)
    assert got[:3] == (0.12, 7, "x") and got[3].tolist() == [1.2, -0.00012]
    assert got[4].tolist() == [0, 1] and got[5].tolist() == [10] and got[6] == [True]
    assert example.size(args) == 1 + 1 + 1 + 2 + 2 + 1 + 1


def test_numbers_that_rise_rise_still_when_they_are_rounded():
    """Times do: pasted with two of them equal, a right answer would divide by 0."""
    few = example.rounded(np.array([1.5, 3.1011, 3.1022, 3.1988]))
    assert few.tolist() == [1.5, 3.101, 3.102, 3.199]
    assert example.rounded(np.array([3.1011, 3.1022, 1.5])).tolist() == [3.1, 3.1, 1.5]


def failed(exercise, source):
    """The example of an answer that runs in this process."""
    run = exercise.run(source)
    return judge(exercise, lambda args: (run(args), False)).example


def valued(exercise, source, call):
    """What a pasted call evaluates to, as numbers, or what it raises."""
    space = {"__name__": "__main__"}
    for part in (PREAMBLE, exercise.given, source):
        exec(part, space)
    try:
        return decode(encode(eval(call, space)))
    except Exception as e:
        return type(e).__name__


# Exercises whose input is a class, a function, a network, or longer than anybody pastes.
NOTHING = {"1.5", "2.3", "2.5", "3.2", "4.3", "5.3", "5.4", "5.5", "8.2", "8.3",
           "9.1", "9.3", "9.4", "11.1", "11.3", "11.4", "13.1"}  # fmt: skip


@pytest.mark.parametrize("exercise", everything().values(), ids=list(everything()))
def test_what_is_pasted_fails(exercise):
    """The wrong answer and the reference differ there, but where the gradient alone is wrong."""
    for mistake in exercise.mistakes[:2]:
        source = exercise.wrong(mistake)
        text = failed(exercise, source)
        if not text:
            continue
        call, _, _ = text.rpartition("\n# ")
        assert call.startswith(f"{exercise.name}(") and len(call) <= example.LONGEST
        ours, theirs = (valued(exercise, s, call) for s in (exercise.source, source))
        assert encode(ours) != encode(theirs) or "requires_grad" in call
    assert example.pasted(exercise) == (exercise.id not in NOTHING)


def test_the_smallest_of_the_inputs_that_fail_is_shown():
    """It fails from eleven episodes on, and with one of six it does not."""
    exercise = find("0.1")
    many = (
        "    if len(distances) < 11:\n        return (distances < threshold).mean()\n    return 2.0"
    )
    text = failed(exercise, f"def success_rate(distances, threshold):\n{many}")
    call = text.partition("\n#")[0]
    shown = eval(call, {"np": np, "success_rate": lambda distances, threshold: distances})
    drawn = [
        len(check.inputs(np.random.default_rng(i))[0])
        for check in exercise.checks
        for i in range(example.DRAWS)
    ]
    assert len(shown) == min(n for n in drawn if n >= 11)


def test_smaller_inputs_than_those_that_were_asked_are_tried_first():
    check = find("0.1").checks[1]
    sizes = [example.size(args) for _, args in example.candidates([(check, (np.zeros(40), 0.5))])]
    assert sizes[0] < sizes[-1] == 41 and sizes == sorted(sizes)


def test_how_large_the_inputs_are_that_are_drawn_is_worked_out_once():
    rngs = []
    check = Check("", lambda rng: rngs.append(rng) or (np.zeros(3),), 1, 0.0, 0.0, 1, None)
    both = [example.candidates([(check, (np.zeros(40),))]) for _ in range(2)]
    assert len(rngs) == example.DRAWS + 2 * example.TRIES
    assert [[example.size(args) for _, args in one] for one in both] == [[3] * 6 + [40] * 2] * 2


def test_what_a_check_asks_by_several_calls_is_not_shown_by_one():
    assert example.tried(find("10.1"), (3, 7))[1] == "wilson(3, 7)"
    assert example.tried(find("10.1"), ([0, 5], [5, 5]))[1] == ""


def test_where_only_all_digits_fail_they_are_shown():
    exercise = find("7.1")
    source = exercise.source.replace("return", "if v != round(v, 2): v = 2 * v\n    return", 1)
    text = failed(exercise, source)
    speed = float(text.partition("(")[2].partition(",")[0])
    assert speed != round(speed, 2)


def test_a_right_answer_and_an_open_one_have_no_example(box):
    assert TRY not in said(box, E61.source)
    assert failed(E61, "def r1(z, z_E):\n    raise NotImplementedError('your lines here')") == ""


def test_the_grader_shows_it_too_and_not_the_inputs_it_asked():
    book = File("06_reward.ipynb", notebook(E61.source.replace("[:-1]", "")).encode())
    texts = [grade([book], ["6.1"], seed)[0][0].example for seed in (2, 3)]
    assert texts[0].startswith("r1(np.array(") and texts[0] == texts[1]


# In the terminal


@pytest.mark.parametrize(
    ("keyword", "left"),
    [("0.1", {"0.1", None}), ("10.1", {"10.1", None}), ("0.1 or 6.1", {"0.1", "6.1", None}),
     ("", {"0.1", "6.1", "10.1", None}), ("not 0.1", {"0.1", "6.1", "10.1", None}),
     ("exercise and v0.1", {"0.1", "6.1", "10.1", None})],
)  # fmt: skip
def test_an_exercise_is_asked_for_by_its_whole_number(keyword, left):
    """Behind pytest's own choice, which takes 0.1 for a part of 10.1."""
    items = [SimpleNamespace(callspec=SimpleNamespace(params={"exercise": find(id)}))
             for id in ("0.1", "6.1", "10.1")]  # fmt: skip
    items.append(SimpleNamespace(name="test_of_something_else"))
    gone = []
    hook = SimpleNamespace(pytest_deselected=lambda items: gone.extend(items))
    config = SimpleNamespace(option=SimpleNamespace(keyword=keyword), hook=hook)
    pytest_collection_modifyitems(config, items)
    assert {_exercise(item) for item in items} == left and len(items) + len(gone) == 4


@pytest.mark.parametrize(
    ("args", "listed"),
    [(["tests/grade"], True), (["tests/grade/test_notebooks.py::test_exercise[0.1]"], True),
     (["tests"], False), (["tests/grade", "tests/test_sac.py"], False)],
)  # fmt: skip
def test_what_is_open_is_listed_where_exercises_alone_are_asked_for(args, listed, monkeypatch):
    monkeypatch.chdir(RELEASED.parent)
    option = SimpleNamespace(fold_skipped=True, reportchars="fE")
    pytest_configure(SimpleNamespace(args=args, option=option))
    assert (not option.fold_skipped) == listed == ("s" in option.reportchars)


def test_the_terminal_says_what_is_open():
    line = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests/grade"]
    done = subprocess.run([*line, "-k", "0.1"], cwd=RELEASED.parent, capture_output=True, text=True)
    assert (
        "test_exercise[0.1] - Skipped: needs an answer: the exercise is still open" in done.stdout
    )
    assert "10.1" not in done.stdout
