"""An answer leaves its arguments as they are: their numbers, gradients and modes."""

import copy

import numpy as np
import pytest
import torch

from tests.grade.__main__ import grade_one
from tests.grade.cell.answer import PREAMBLE, state
from tests.grade.exercise import everything, find
from tests.grade.judge import CHANGES, judge
from tests.grade.notebook import here
from tests.grade.submission import Answer
from tests.kept import Kept
from tests.test_answers import FUNCTIONS, parameters

pytestmark = pytest.mark.usefixtures("workers_wait")

ALL = everything()
FREE = {("2.3", "target")}  # the text asks for it to be changed
PLAIN = {
    "3.2",
    "7.1",
    "7.2",
    "8.1",
    "9.1",
    "9.4",
    "10.1",
    "10.2",
}  # numbers alone, which nobody can change


def change_numbers(x):
    """Whether there was anything to change."""
    if isinstance(x, torch.nn.Module):
        x = next(x.parameters())
    if isinstance(x, torch.Tensor):
        x = x.detach().numpy()
    if isinstance(x, np.ndarray):
        x[...] = ~x if x.dtype == bool else x + 1
    elif isinstance(x, list):
        x.append(0)
    elif isinstance(x, dict) and x:
        x.popitem()
    return isinstance(x, np.ndarray | list | dict)


def change_graph(x):
    if isinstance(x, dict):
        return any([change_graph(part) for part in x.values()])
    if isinstance(x, torch.nn.Module):
        return bool(x.requires_grad_(False))
    if isinstance(x, torch.Tensor) and x.is_leaf and x.is_floating_point():
        return bool(x.requires_grad_(not x.requires_grad).is_leaf)
    return False


def judged(exercise, source, **names):
    """The result of an answer that runs in this process."""
    space = {"__name__": "__main__", **names}
    exec(PREAMBLE + exercise.given + "\n" + source, space)
    return judge(exercise, here(exercise, space, True))


@pytest.mark.parametrize("id", [id for id in FUNCTIONS if id not in PLAIN])
def test_an_argument_that_is_changed_costs_points_in_every_exercise(id):
    """Each of them, after the right answer has been found."""
    exercise, spoiled = ALL[id], 0
    names = parameters(exercise)
    for name in (n for n in names if (id, n) not in FREE):
        for change, kind in ((change_numbers, "values"), (change_graph, "graph")):
            done = []
            source = (
                exercise.source.replace(f"def {exercise.name}(", "def _answer(", 1)
                + f"\ndef {exercise.name}({', '.join(names)}):\n"
                f"    value = _answer({', '.join(names)})\n"
                f"    change({name})\n    return value"
            )
            result = judged(exercise, source, change=lambda x, c=change, d=done: d.append(c(x)))
            if any(done):
                spoiled += 1
                assert result.points < result.most, name
                assert CHANGES[kind] in {o.message for o in result.outcomes}, result.lines()
    assert spoiled


FOLLOW = find("2.3").source
LOSS = find("2.5").source
CHANGED = {
    "freezes it": ("2.3", FOLLOW, "    online.requires_grad_(False)\n", "graph"),
    "clears its gradients": ("2.3", FOLLOW, "    online.zero_grad()\n", "grad"),
    "adds to its gradients": (
        "2.3", FOLLOW, "    sum(p.sum() for p in online.parameters()).backward()\n", "grad",
    ),
    "changes its mode": ("2.3", FOLLOW, "    online.eval()\n", "mode"),
    "detaches alpha": ("2.5", LOSS, "    log_alpha.detach_()\n", "graph"),
    "writes into alpha": ("2.5", LOSS, "    log_alpha.data.exp_()\n", "values"),
    "detaches a critic's value": ("2.2", find("2.2").source, "    q1.detach_()\n", "graph"),
    "detaches the source": ("5.3", find("5.3").source, "    phi_x.detach_()\n", "graph"),
    "detaches one loss of many": (
        "4.4", find("4.4").source, "    L['gan_x'].detach_()\n", "graph",
    ),
}  # fmt: skip


@pytest.mark.parametrize("how", CHANGED)
def test_what_was_changed_is_said_in_the_notebook_and_by_the_grader(how):
    id, source, line, kind = CHANGED[how]
    head, body = source.split("\n", 1)
    source = f"{head}\n{line}{body}"
    there = judged(ALL[id], source)
    with Kept() as box:
        graded = grade_one(ALL[id], Answer(source, [], ""), box, 0)
    for result in (there, graded):
        assert result.points < result.most
        assert CHANGES[kind] in {o.message for o in result.outcomes}, result.lines()


def test_what_has_no_effect_is_no_change():
    """The network trains already, and the copy is what is to be changed."""
    line = "    online.train()\n    target.requires_grad_(False)\n    target.eval()\n"
    head, body = FOLLOW.split("\n", 1)
    result = judged(ALL["2.3"], f"{head}\n{line}{body}")
    assert result.points == result.most, result.lines()


def test_an_answer_that_calls_itself_may_change_what_is_its_own():
    source = (
        "def success_rate(distances, threshold, own=False):\n"
        "    if not own:\n        return success_rate(distances.copy(), threshold, True)\n"
        "    distances -= threshold\n    return (distances < 0).mean()"
    )
    with Kept() as box:
        result = grade_one(find("0.1"), Answer(source, [], ""), box, 0)
    assert result.points == result.most, result.lines()


def test_an_input_that_is_written_into_is_not_taken_for_a_lost_gradient():
    wrong = ALL["4.1"].source.replace("    mu =", "    std.clamp_(min=0)\n    mu =")
    result = judged(ALL["4.1"], wrong)
    assert {o.message for o in result.outcomes if o.message} == {CHANGES["values"]}


def test_a_state_holds_what_can_be_changed_and_nothing_else():
    net = torch.nn.Sequential(torch.nn.Linear(2, 1), torch.nn.BatchNorm1d(1))
    before = state(net)
    assert state(copy.deepcopy(net)) == before
    net[1].eval()
    assert [kind for kind, was in before.items() if state(net)[kind] != was] == ["mode"]
    net[1].train()
    net[1].running_mean += 1
    assert [kind for kind, was in before.items() if state(net)[kind] != was] == ["values"]
