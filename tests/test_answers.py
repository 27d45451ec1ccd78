"""Right answers in odd places and forms, wrong ones that look right: notebook and grader agree."""

import builtins
import inspect
import json
from pathlib import Path

import numpy as np
import pytest

from tests.grade import check
from tests.grade.__main__ import grade_one, noted_seed
from tests.grade.cell.answer import STUB, learn, statements
from tests.grade.cell.wire import Other, decode, encode
from tests.grade.exercise import Exercise, everything, find
from tests.grade.judge import judge, questions
from tests.grade.notebook import StillOpen, here
from tests.grade.submission import Answer, answer, read
from tests.kept import Kept

ALL = everything()
SOLVED = json.loads(
    (Path(__file__).parent.parent / "solutions" / "06_reward.ipynb").read_text(encoding="utf-8")
)
R1, R2 = find("6.1").source, find("6.2").source
R3 = find("6.3").source
WRONG = R1.replace("z_E[:-1]", "z_E")
SEED = 7


@pytest.fixture(scope="module")
def box():
    with Kept() as sandbox:
        yield sandbox


def graded(box, tmp_path, id, *cells, name="a.ipynb"):
    """The result of an exercise in a notebook of these cells: sources, or whole cells."""
    whole = [
        c if isinstance(c, dict) else {"cell_type": "code", "metadata": {}, "source": c}
        for c in cells
    ]
    (tmp_path / name).write_text(json.dumps({"cells": whole}))
    return grade_one(find(id), answer(find(id), [read(tmp_path / name)]), box, SEED)


def marked(id, source):
    note = {"nbgrader": {"grade_id": find(id).grade_id}}
    return {"cell_type": "code", "metadata": note, "source": source}


# Right answers, wherever their parts stand


def using(name):
    """6.1 with a helper by that name in the place of the root."""
    return R1.replace("np.sqrt", name)


RIGHT = {
    "partial": ("from functools import partial\nroot = partial(lambda k, x: x**k, 0.5)", "root"),
    "a constant by a function of math": (
        "from math import sqrt\nTWO = sqrt(4)", "TWO / 2 * np.sqrt",
    ),
    "a constant by numpy": ("import numpy\nTWO = numpy.sqrt(4)", "TWO / 2 * np.sqrt"),
    "if and else": ("if torch.cuda.is_available():\n    k = 1\nelse:\n    k = 1.0", "k * np.sqrt"),
    "an import that may fail": (
        "try:\n    from cupy import sqrt as root\nexcept ImportError:\n    root = np.sqrt", "root",
    ),
    "a namedtuple": (
        "from collections import namedtuple\nT = namedtuple('T', 'root')\nt = T(np.sqrt)", "t.root",
    ),
    "a dataclass": (
        "from dataclasses import dataclass\n@dataclass\nclass T:\n    k: float = 1.0\nt = T()",
        "t.k * np.sqrt",
    ),
    "a table filled in a loop": (
        "F = {}\nfor f in (np.sqrt,):\n    F[f.__name__] = f", "F['sqrt']",
    ),
    "a patched module": ("np.wurzel = np.sqrt", "np.wurzel"),
    "beside a plot": (
        "import matplotlib.pyplot as plt\nfig, axes = plt.subplots(1, 2)\n"
        "axes[0].plot([0, 1])\nplt.show()\nroot = np.sqrt", "root",
    ),
    "beside a line that fails": ("import tasks\ntasks.play()\nroot = np.sqrt", "root"),
    "behind an await at the top": (
        "import asyncio\nroot = np.sqrt\nawait asyncio.sleep(0)\none = await asyncio.sleep(0, 1)",
        "one * root",
    ),
    "beside one that trains": (
        "root = np.sqrt\nfor i in range(10**12):\n    x = i * i", "root",
    ),
    "beside one that catches all": (
        "root = np.sqrt\nwhile True:\n    try:\n        x = 1\n    except BaseException:\n"
        "        pass", "root",
    ),
    "beside one that ends the kernel": (
        "import os\nroot = np.sqrt\nif root:\n    os._exit(0)", "root",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", RIGHT)
def test_what_stands_in_another_cell_is_there(box, tmp_path, kind):
    other, root = RIGHT[kind]
    result = graded(box, tmp_path, "6.1", other, marked("6.1", using(root)), 'check("6.1")')
    assert result.points == result.most, result.lines()


@pytest.mark.parametrize("kind", ["partial", "if and else", "a patched module"])
def test_so_is_what_stands_below(box, tmp_path, kind):
    other, root = RIGHT[kind]
    result = graded(box, tmp_path, "6.1", marked("6.1", using(root)), 'check("6.1")', other)
    assert result.points == result.most, result.lines()


STUB_2 = f"def r2(z, z_next, z_E):\n    {STUB}"
PLACES = {
    "cells merged": [marked("6.1", f"{R1}\n# Exercise 6.2\n{R2}")],
    "both in one, the other's stub left": [marked("6.1", f"{R1}\n{R2}"), marked("6.2", STUB_2)],
    "the other's stub above": [marked("6.2", STUB_2), marked("6.1", f"{R2}\n{R1}")],
    "wrong in the marked cell, right below": [
        marked("6.1", WRONG), f"# second try\n{R1}\n{R2}", 'check("6.1")',
    ],
    "right below the check": [marked("6.1", WRONG), 'check("6.1")', f"{R1}\n{R2}"],
    "right in the marked cell, another use of the name at the end": [
        marked("6.1", R1), 'check("6.1")', R2,
        "r1 = r2 = r1(np.zeros((1, 2)), np.zeros((2, 1, 2)))",
        R2,
    ],
    "a damaged cell": [{"cell_type": "code"}, marked("6.1", f"{R1}\n{R2}"), {}, None],
    "no metadata": [{"cell_type": "code", "source": [f"# Exercise 6.1\n{R1}\n{R2}"]}],
}  # fmt: skip


@pytest.mark.parametrize("kind", PLACES)
def test_an_answer_counts_wherever_it_stands(box, tmp_path, kind):
    cells = [c if c is not None else {"cell_type": 3} for c in PLACES[kind]]
    for id in ("6.1", "6.2"):
        result = graded(box, tmp_path, id, *cells)
        assert result.points == result.most, (id, result.lines())


def test_what_a_cell_took_too_long_to_define_is_said(box, tmp_path):
    slow = "k = [0 for _ in iter(int, 1)]"
    result = graded(box, tmp_path, "6.1", slow, marked("6.1", using("k * np.sqrt")))
    assert result.points == 0
    assert "'k' is not defined" in result.lines()[0] and "ran for more than" in result.lines()[0]


def test_a_wrong_answer_costs_no_other_exercise(box, tmp_path):
    result = graded(box, tmp_path, "6.3", marked("6.1", WRONG), R2, marked("6.3", R3))
    assert result.points == result.most, result.lines()


def test_ones_own_form_of_what_is_given_may_be_used(box, tmp_path):
    own = R1.replace("(z, z_E)", "(z, z_E, sign)").replace("-distances", "sign * distances")
    third = R3.replace("r1(z[t], z_E)", "r1(z[t], z_E, -1)")
    result = graded(box, tmp_path, "6.3", own, R2, marked("6.3", third))
    assert result.points == result.most, result.lines()


def test_a_stub_alone_is_open(box, tmp_path):
    assert graded(box, tmp_path, "6.2", marked("6.2", STUB_2)).open


# Right answers in other forms, the same in the notebook, in the sandbox and by themselves


WILSON = ALL["10.1"].source
FORMS = {
    "10.1 namedtuple": WILSON.replace("return max", "return T(max").replace("+ half)", "+ half))")
    + "\nfrom collections import namedtuple\nT = namedtuple('T', 'low high')",
    "10.1 list": WILSON.replace("return max", "return list((max").replace("+ half)", "+ half)))"),
    "10.1 array": WILSON.replace("return max", "return np.array((max").replace(
        "+ half)", "+ half)))"
    ),
    "10.1 tensor": WILSON.replace("return max", "return torch.tensor((max").replace(
        "+ half)", "+ half)), dtype=torch.float64)"
    ),
    "10.4 np.str_": ALL["10.4"].source.replace('return "fair"', 'return np.str_("fair")'),
    "3.4 list": ALL["3.4"].source.replace("return ", "return list(") + ")",
    "3.4 matrix": ALL["3.4"].source.replace("return ", "return np.asmatrix(") + ").A1",
    "0.1 fraction": "from fractions import Fraction\ndef success_rate(distances, threshold):\n"
    "    return Fraction(int((distances < threshold).sum()), len(distances))",
    "0.1 list of one": ALL["0.1"].source.replace("return ", "return [") + "]",
    "0.1 longdouble": ALL["0.1"].source.replace("return ", "return np.longdouble(") + ")",
    "0.1 own kind of float": "class Rate(float):\n    pass\n"
    + ALL["0.1"].source.replace("return ", "return Rate(") + ")",
    "0.1 complex": ALL["0.1"].source.replace("return ", "return complex(") + ")",
    "3.4 longdoubles": ALL["3.4"].source.replace("return ", "return np.longdouble(") + ")",
    "3.4 array of the standard library": "from array import array\n"
    + ALL["3.4"].source.replace("return ", "return array('d', ") + ")",
    "9.4 float": ALL["9.4"].source.replace("return sum", "return 1.0 * sum"),
    "9.4 numpy": ALL["9.4"].source.replace("return sum", "return np.int32(sum") + ")",
    "8.2 nested lists": ALL["8.2"].source.replace("return ", "return (") + ").tolist()",
    "4.1 with F": "def adain(h, mean, std):\n    B, C, H, W = h.shape\n"
    "    flat = h.reshape(1, B * C, H, W)\n"
    "    args = None, None, std.reshape(-1), mean.reshape(-1)\n"
    "    return F.batch_norm(flat, *args, training=True).reshape(h.shape)",
    "2.3 lerp": "def follow(target, online, tau):\n"
    "    for slow, fast in zip(target.parameters(), online.parameters()):\n"
    "        slow.data.lerp_(fast.data, tau)",
    "1.2 pinv": "task_inertia = lambda J, M: np.linalg.pinv(J @ np.linalg.solve(M, J.T))",
    "11.2 deque": "from collections import deque\n"
    + ALL["11.2"].source.replace("stack(shown), pool", "stack(shown), deque(pool)"),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_the_numbers_count_not_the_form(box, tmp_path, form, capsys):
    id = form.split()[0]
    result = graded(box, tmp_path, id, marked(id, FORMS[form]))
    assert result.points == result.most, result.lines()
    space = {}
    exec("import numpy as np, torch, math\nfrom tests.grade import check\n" + FORMS[form], space)
    exec(f'points = check("{id}")', space)
    assert space["points"] == result.most, capsys.readouterr().out


PACKAGE = "from lbw_minimal import munit_networks as munit\n"
REFUSED = {
    "a function of it": PACKAGE + "def adain(h, mean, std):\n    return munit.adain(h, mean, std)",
    "imported when called": "def adain(h, mean, std):\n    "
    + PACKAGE + "    return munit.adain(h, mean, std)",
    "by another name": "from lbw_minimal.munit_networks import adain as own\n"
    "def adain(h, mean, std):\n    return own(h, mean, std)",
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_the_package_answers_neither_here_nor_there(box, tmp_path, kind, capsys):
    result = graded(box, tmp_path, "4.1", marked("4.1", REFUSED[kind]))
    space = {}
    exec("from tests.grade import check\n" + REFUSED[kind], space)
    exec('points = check("4.1")', space)
    assert result.points == space["points"] == 0
    assert "your own lines" in result.lines()[0] and "your own lines" in capsys.readouterr().out
    assert "lbw_minimal" in __import__("sys").modules  # it is back


def test_a_check_leaves_the_notebook_as_it_was(capsys):
    space = {"check": check, "r1": None}
    exec(f"import numpy as np\n{WRONG}\n{R2}\n{R3}", space)
    before = dict(space)
    exec('check("6.3")', space)
    assert space == before and "3 of 3" in capsys.readouterr().out


def test_a_cell_of_the_course_is_compiled_once_for_all_processes():
    learn(source := "import math\nx = math.pi\ndef f():\n    return x\nprint(f())")
    found = statements(source)
    assert found is statements(source)
    assert ["code" in vars(s) for s in found] == [True, True, True, False]  # it is not run


def test_a_check_asks_anew_what_is_right(monkeypatch, capsys):
    """A cell may have changed what the reference is made with, such as torch's default type."""
    ran, run = [], Exercise.run
    monkeypatch.setattr(
        Exercise, "run", lambda self, source: ran.append(source) or run(self, source)
    )
    for _ in range(2):
        exec(f"import numpy as np\n{find('6.1').source}\ncheck('6.1')", {"check": check})
    assert ran == 2 * [find("6.1").source]


@pytest.mark.parametrize("id", ALL)
def test_mistakes_cost_the_same_in_the_notebook(id):
    """The same checks, whoever calls; one mistake of each exercise."""
    exercise = ALL[id]
    source = exercise.wrong(exercise.mistakes[0])
    exec(
        f"import numpy as np, torch\n{exercise.given}\n{source}", space := {"__name__": "__main__"}
    )
    alone = exercise.run(source)
    there = judge(exercise, here(exercise, space, True), SEED)
    assert there.lines() == judge(exercise, lambda args: (alone(args), False), SEED).lines()


def test_the_packages_own_is_no_answer():
    exec("from lbw_minimal.munit_networks import adain", space := {})
    with pytest.raises(StillOpen, match="the package's own"):
        exec("from tests.grade import check\ncheck('4.1')", space)


def test_what_is_no_value_arrives_by_its_name():
    for value in (object(), {1}, (x for x in "ab"), np.array([object()]), print):
        assert type(decode(encode(value))) is Other


# Wrong answers


def test_an_answer_that_outlives_its_end_and_counts_calls_gains_nothing(box):
    """It forges what the worker used to say at the end of an exercise, and stays."""
    exercise = find("10.4")
    said = [
        str(exercise.run(exercise.source)(c.inputs(np.random.default_rng([SEED, i]))))
        for i, c in enumerate(exercise.checks)
    ]
    source = (
        "import sys, wire\nf = sys._getframe()\n"
        "while f and 'channel' not in f.f_locals:\n    f = f.f_back\n"
        "wire.send(f.f_locals['channel'], wire.encode('left'))\n"
        "wire.receive = lambda channel, old=wire.receive: old(channel) or old(channel)\n"
        f"said, n = {said!r}, 0\n"
        "def verdict(idle, random, expert):\n    global n\n    n += 1\n"
        "    return said[(n - 1) // 3 % len(said)]"
    )
    result = grade_one(exercise, Answer(source, [], ""), box, SEED)
    assert result.points == 0
    assert grade_one(exercise, Answer(exercise.source, [], ""), box, SEED).points == result.most


def test_the_order_of_the_questions_hangs_on_the_seed():
    exercise = find("10.4")

    def asked(seed):
        run, heard = exercise.run(exercise.source), []
        judge(exercise, lambda args: (heard.append(str(run(args))) or run(args), False), seed)
        return heard[: sum(c.trials for c in exercise.checks)]

    orders = {tuple(asked(seed)) for seed in range(4)}
    assert len(orders) == 4 and asked(1) == asked(1)


def test_a_class_has_a_seed_of_its_own_which_is_noted(tmp_path):
    for name in "ab":
        (tmp_path / name).mkdir()
    seeds = [noted_seed(tmp_path / name, None) for name in "ab"]
    assert seeds[0] != seeds[1]
    assert (
        noted_seed(tmp_path / "a", None) == seeds[0] == int((tmp_path / "a/seed.txt").read_text())
    )
    assert noted_seed(tmp_path / "a", 5) == noted_seed(tmp_path / "a", None) == 5


def test_a_path_trembling_on_the_spot_is_rest():
    walk = (
        "def trim(z, least):\n    kept, way = [0], 0.0\n    for i in range(1, len(z) - 1):\n"
        "        way += np.linalg.norm(z[i] - z[i - 1])\n"
        "        if way >= least:\n            kept.append(i)\n            way = 0.0\n"
        "    return z[kept + [len(z) - 1]]"
    )
    run = find("6.4").run(walk)
    result = judge(find("6.4"), lambda args: (run(args), False), SEED)
    assert result.points < result.most and "trembles" in " ".join(result.lines())


# Every argument counts


def parameters(exercise):
    space = {}
    exec(
        f"import numpy as np, torch\nfrom torch import nn\n{exercise.given}\n{exercise.source}",
        space,
    )
    return list(inspect.signature(space[exercise.name]).parameters)


FUNCTIONS = [id for id in ALL if ALL[id].source.startswith("def ")]
# What an answer need not read: a time limit that is no end, and tensors of which shapes are taken.
UNREAD = {("2.2", "truncated")}


ARGUMENTS = [
    (id, name) for id in FUNCTIONS for name in parameters(ALL[id]) if (id, name) not in UNREAD
]


@pytest.mark.parametrize("id, name", ARGUMENTS, ids=map("-".join, ARGUMENTS))
def test_an_argument_cannot_be_hard_coded(id, name):
    """An answer that takes the first value it is given for all values loses points."""
    exercise = ALL[id]
    inner = exercise.source.replace(f"def {exercise.name}(", "def _answer(", 1)
    names = parameters(exercise)
    source = (
        f"{inner}\nimport copy\nkept = []\ndef {exercise.name}({', '.join(names)}):\n"
        f"    kept or kept.append({name} if callable({name}) else copy.deepcopy({name}))\n"
        f"    {name} = kept[0]\n    return _answer({', '.join(names)})"
    )
    run = exercise.run(source)
    result = judge(exercise, lambda args: (run(args), False), SEED)
    assert result.points < result.most


# Sizes that an exercise states: (exercise, argument, axis from the end).
STATED = {
    *((id, "z", -1) for id in ("0.2", "5.2", "5.5", "6.1", "6.2", "6.3", "6.4")),
    *((id, "z_E", -1) for id in ("6.1", "6.2", "6.3", "6.5")),
    ("6.2", "z_next", -1), ("6.5", "z_next", -1), ("9.2", "recent", -1), ("9.2", "target", -1),
    ("9.2", "recent", -3), ("8.4", "z_a", -1), ("8.4", "z_b", -1), ("5.5", "z", -3),
    ("5.5", "truth", -1), ("3.1", "start", -1), ("3.1", "end", -1), ("3.4", "wanted", -1),
    ("3.4", "goal", -1), ("8.2", "video", -1), ("8.3", "video", -1),
    *(("1.3", name, axis) for name in ("J", "M", "h", "e", "v") for axis in (-1, -2)),
    *(("4.3", name, -3) for name in "xy"), ("5.3", "h_x", -3), ("5.3", "h_y", -3),
    *(("5.4", name, -3) for name in ("y_hat", "y", "median")), ("5.4", "median", -4),
    ("9.3", "demo", -1), ("9.3", "robot", -1), ("12.2", "tip", -1),
    *(("12.3", name, -1) for name in ("start", "end", "scene_start", "scene_end")),
    *(("12.4", name, -1) for name in ("path", "start", "end")),
    *(("13.1", name, -1) for name in ("points", "there", "back")), ("13.2", "paths", -1),
    *(("13.3", name, -1) for name in ("p_0", "to", "d")),
    *(("13.4", name, -1) for name in ("d", "d_next", "g_next", "d_E", "lam")),
}  # fmt: skip


# Exercises with pictures: which argument they are, and the axes of height and width.
PICTURES = {
    "4.1": (0, 2, 3), "4.3": (0, 2, 3), "5.1": (0, 2, 3), "5.3": (0, 2, 3), "5.4": (0, 2, 3),
    "8.2": (0, 1, 2), "8.3": (0, 1, 2), "11.1": (1, 2, 3), "11.3": (1, 2, 3), "11.4": (4, 2, 3),
    "13.1": (1, 0, 1),
}  # fmt: skip


# Sizes that cannot be 1, or where nothing is left to do: pictures' heights and widths, and how long
# a video, a track or a take is.
MORE_THAN_ONE = {
    ("3.3", "x", -1), ("4.1", "h", -1), ("4.1", "h", -2), ("5.1", "logits", -1),
    ("5.1", "logits", -2), *((id, "z_E", -3) for id in ("6.1", "6.2", "6.3")), ("6.3", "z", -3),
    ("6.4", "z", -3), ("7.3", "x", -1), ("7.4", "x", -1), ("12.1", "times", -1),
    *((id, "video", axis) for id in ("8.2", "8.3") for axis in (-2, -3, -4)), ("8.3", "mask", -1),
    ("8.3", "mask", -2), ("12.1", "path", -2), ("12.2", "times", -1), ("12.2", "tip", -2),
    ("12.4", "path", -2), ("13.2", "paths", -3), ("13.4", "d_E", -2),
    *(("13.1", name, axis) for name in ("there", "back") for axis in (-2, -3)),
    *(("11.3", name, axis) for name in ("goals", "others") for axis in (-1, -2)),
    ("11.3", "share", -1), ("11.3", "partner", -1), ("11.4", "x", -1), ("11.4", "x", -2),
    *(("4.3", name, axis) for name in "xy" for axis in (-1, -2)),
    *(("5.3", n, axis) for n in ("phi_x", "phi_y", "h_x", "h_y") for axis in (-1, -2)),
    *(("5.4", name, axis) for name in ("y_hat", "y", "median") for axis in (-1, -2)),
}  # fmt: skip


@pytest.mark.parametrize("id", PICTURES)
def test_pictures_are_higher_than_wide_and_wider_than_high(id):
    """Or height and width could be exchanged."""
    which, down, across = PICTURES[id]
    shapes = [question.args[which].shape for question in questions(ALL[id], 0)]
    assert any(s[down] > s[across] for s in shapes) and any(s[down] < s[across] for s in shapes)


@pytest.mark.parametrize("id", FUNCTIONS)
def test_every_size_and_every_whole_number_varies_and_is_odd_and_even_and_sizes_are_one(id):
    exercise, seen = ALL[id], {}
    names = parameters(exercise)
    inner = exercise.source.replace(f"def {exercise.name}(", "def _answer(", 1)
    source = (
        f"{inner}\ndef {exercise.name}({', '.join(names)}):\n    import builtins\n"
        f"    builtins.seen_by_test(dict(zip({names}, ({', '.join(names)},))))\n"
        f"    return _answer({', '.join(names)})"
    )

    def note(args):
        for name, value in args.items():
            shape = getattr(value, "shape", None)
            if shape is not None and len(shape):
                for axis, size in enumerate(reversed(shape), 1):
                    seen.setdefault((id, name, -axis), set()).add(int(size))
            elif isinstance(value, list):
                seen.setdefault((id, name, "its length"), set()).add(len(value))
            elif isinstance(value, int):
                seen.setdefault((id, name, "its value"), set()).add(value)
            elif isinstance(value, float):
                seen.setdefault((id, name, "a float"), set()).add(value)

    builtins.seen_by_test = note
    try:
        run = exercise.run(source)
        for seed in (0, SEED, 1234):
            judge(exercise, lambda args: (run(args), False), seed)
    finally:
        del builtins.seen_by_test
    for what, values in seen.items():
        if what not in STATED:
            assert len(values) > 1, (what, values)
            if what[2] != "a float":
                assert {v % 2 for v in values} == {0, 1}, (what, values)
            if isinstance(what[2], int) and what not in MORE_THAN_ONE:
                assert 1 in values, (what, values)
