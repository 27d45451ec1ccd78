"""Item statistics: how hard each exercise of a class was, whether it tells good submissions from
poor ones, who failed it, and which hints fired how often.

They come from the records of the grading alone, so they say nothing of a student that is not in
class.csv and the feedback pages. Of a submission in which no exercise was tried they say nothing.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from html import escape

import numpy as np

from lbw_minimal.training import quantity
from tests.grade.exercise import everything
from tests.grade.sheets import sheet
from tests.grade.webpage import table, webpage, words

SURE = 1.96  # standard errors to either side of a 95 % interval


@dataclass
class Item:
    """An exercise in a class. right: submissions that earned all its points; failed: the others,
    by name; mean: of the shares of its points. rest: the correlation of its points with those of
    all other exercises, -1 to 1, and low and high its 95 % interval; None where there is none.
    hints, checks: how many submissions got each hint and failed each check."""

    id: str
    title: str
    right: int
    open: int
    mean: float
    rest: float | None = None
    low: float | None = None
    high: float | None = None
    failed: list[str] = field(default_factory=list)
    hints: Counter = field(default_factory=Counter)
    checks: Counter = field(default_factory=Counter)
    unexplained: int = 0  # wrong answers that got no hint

    @property
    def answers(self) -> int:
        return self.right + len(self.failed)

    @property
    def share(self) -> float:
        """Of the submissions that got it right, 0 to 1: the easier, the higher."""
        return self.right / self.answers


def tried(grades: list[dict]) -> list[dict]:
    """The records of submissions in which some exercise was worked on, and graded."""
    return [g for g in grades if "failed" not in g and not all(e["open"] for e in g["exercises"])]


def statistics(grades: list[dict], ids: list[str]) -> list[Item]:
    """Those of the exercises `ids`; none where nobody tried any."""
    counted = tried(grades)
    by_id = [{e["id"]: e for e in g["exercises"]} for g in counted]
    if not counted:
        return []
    points = np.array([[some[id]["points"] for id in ids] for some in by_id], float)  # (n, items)
    totals = points.sum(axis=1)
    items = []
    for k, id in enumerate(ids):
        answers = [some[id] for some in by_id]
        item = _item(id, answers, [g["submission"] for g in counted])
        item.rest, item.low, item.high = correlation(points[:, k], totals - points[:, k])
        items.append(item)
    return items


def _item(id: str, answers: list[dict], names: list[str]) -> Item:
    known = {mistake.hint for mistake in everything()[id].mistakes}
    item = Item(
        id,
        answers[0]["title"],
        right=sum(e["points"] == e["most"] for e in answers),
        open=sum(e["open"] for e in answers),
        mean=sum(e["points"] / e["most"] for e in answers) / len(answers),
    )
    for e, name in zip(answers, names, strict=True):
        if e["points"] == e["most"]:
            continue
        item.failed.append(name)
        if e["open"]:
            continue
        said = {o["message"] for o in e["outcomes"]} & known
        item.hints.update(said)
        item.unexplained += not said
        item.checks.update({o["label"] for o in e["outcomes"] if o["points"] < o["most"]})
    return item


def correlation(a: np.ndarray, b: np.ndarray) -> tuple[float | None, float | None, float | None]:
    """Pearson's r of (n,) and (n,), and its 95 % interval by Fisher's transformation. None where
    one of them never varies, and for the interval of fewer than four."""
    if len(a) < 3 or np.ptp(a) == 0 or np.ptp(b) == 0:
        return None, None, None
    r = float(np.clip(np.corrcoef(a, b)[0, 1], -1, 1))
    if len(a) < 4 or abs(r) == 1:
        return r, None, None
    half = SURE / math.sqrt(len(a) - 3)
    return r, math.tanh(math.atanh(r) - half), math.tanh(math.atanh(r) + half)


def items_csv(items: list[Item]) -> str:
    """A row an exercise."""
    head = ["exercise", "title", "submissions", "right", "not done", "share right",
            "share of points", "item-rest correlation", "from", "to", "wrong without a hint",
            "not right"]  # fmt: skip
    rows = []
    for i in items:
        numbers = [
            x if x is None else round(x, 2) for x in (i.share, i.mean, i.rest, i.low, i.high)
        ]
        who = "; ".join(i.failed)
        rows.append([i.id, i.title, i.answers, i.right, i.open, *numbers, i.unexplained, who])
    return sheet(head, rows)


def hints_csv(items: list[Item]) -> str:
    """A row for each hint there is, also for those that never fired."""
    rows = []
    for i in items:
        there = dict.fromkeys(mistake.hint for mistake in everything()[i.id].mistakes)
        rows += [[i.id, i.hints[h], h] for h in sorted(there, key=lambda h: -i.hints[h])]
    return sheet(["exercise", "submissions", "hint"], rows)


EXPLAINED = """
<p>Right is the share of submissions that earned all points of an exercise. Item-rest is the
correlation of its points with those of all other exercises, and behind it its 95&nbsp;% interval.
Near 0, good submissions fail it as often as poor ones do, and its text or its checks deserve a
look; below 0, all the more. Where nearly all are right, or nearly none, it says little. A dash: all
earned the same points, or there are fewer than three.</p>"""


def items_page(items: list[Item], left_out: int) -> str:
    """The statistics as a page. left_out: submissions in which nothing was tried, or that could
    not be graded."""
    n = items[0].answers if items else 0
    parts = ["<h1>Item statistics</h1>", f"<p>{quantity(n, 'submission')}", "</p>", EXPLAINED]
    if left_out:
        parts[1] += f"; {left_out} more, in which no exercise was tried, are left out"
    rows = [[f'<a href="#e{i.id}">{i.id}</a> {escape(i.title)}', _share(i), str(i.open), _rest(i)]
            for i in items]  # fmt: skip
    parts.append(table("The exercises", ["exercise", "right", "not done", "item-rest"], rows))
    parts += [_details(i) for i in items]
    return webpage("Item statistics", "".join(parts))


def _share(i: Item) -> str:
    """Said by number and, to the eye, by a bar."""
    bar = f'<span class="bar" aria-hidden="true" style="width: {i.share:.0%}"></span>'
    return f"{i.share:.0%} ({i.right}&nbsp;of&nbsp;{i.answers}){bar}"


def _rest(i: Item) -> str:
    if i.rest is None:
        return "-"
    return f"{i.rest:.2f}" + ("" if i.low is None else f" ({i.low:.2f} to {i.high:.2f})")


def _details(i: Item) -> str:
    hints = [f"<li>{times} × {words(hint)}</li>" for hint, times in i.hints.most_common()]
    if i.unexplained:
        hints.append(f"<li>{i.unexplained} × wrong, and no hint</li>")
    checks = [f"<li>{times} × {words(label)}</li>" for label, times in i.checks.most_common()]
    who = ", ".join(map(escape, i.failed)) or "nobody"
    return (
        f'<h2 id="e{i.id}">{i.id} {escape(i.title)}</h2>'
        + (
            f"<p>Hints that fired</p><ul>{''.join(hints)}</ul>"
            if hints
            else "<p>No wrong answer</p>"
        )
        + (f"<p>Checks that failed</p><ul>{''.join(checks)}</ul>" if checks else "")
        + f"<details><summary>Not right: {len(i.failed)}</summary><p>{who}</p></details>"
    )
