"""Which submissions of a class are alike, beyond what short answers are by necessity.

An answer is a set of pieces, the subtrees of its normalised syntax tree (`trees`). A piece weighs
log2(n / k) where k of n answers have it: one that half of the class wrote weighs one bit, one that
two of 500 wrote eight. The kit's own pieces weigh nothing, nor do those of more than COMMON
answers. What two answers share is the weight of the pieces they share. It changes no points: the
page shows the answers side by side, and with each number what arises in this class by chance.
"""

from __future__ import annotations

import functools
import heapq
import math
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from html import escape
from itertools import combinations

from lbw_minimal.training import quantity
from tests.grade.exercise import Exercise, everything
from tests.grade.files import printable
from tests.grade.sheets import sheet
from tests.grade.trees import ours, pieces
from tests.grade.webpage import table, webpage

COMMON = 25  # answers; a piece that more of them have is nobody's. It keeps the pairs linear.
LISTED = 200  # pairs in the table
SHOWN = 20  # pairs on the page
EACH = 5  # exercises of a pair there, and pairs of an exercise
FEW = 10  # submissions; of fewer, nothing can be said of chance
LONGEST = 4_000  # characters of an answer on the page


@dataclass
class Pair:
    """Two submissions, by number, and the bits that they share in each exercise."""

    a: int
    b: int
    bits: dict[str, float] = field(default_factory=dict)

    @property
    def total(self) -> float:
        return sum(self.bits.values())


@dataclass
class Class:
    """What the answers of a class share. sources, trees, whole: exercise, submission: the answer,
    its pieces, and what they weigh. chance: of two answers to an exercise drawn at random, the
    probability that they are the same. pairs: those that share a bit, the most alike first."""

    names: list[str]
    sources: dict[str, dict[int, str]]
    trees: dict[str, dict[int, frozenset[str]]] = field(default_factory=dict)
    whole: dict[str, dict[int, float]] = field(default_factory=dict)
    chance: dict[str, float] = field(default_factory=dict)
    pairs: list[Pair] = field(default_factory=list)


def answers(grades: list[dict]) -> dict[str, dict[int, str]]:
    """The answers that were worked on: exercise, number of the submission, text. grades: records of
    submissions, with the same exercises in all."""
    found: dict[str, dict[int, str]] = {}
    for number, record in enumerate(grades):
        for e in record["exercises"]:
            texts = found.setdefault(e["id"], {})
            if e["source"]:
                texts[number] = e["source"]
    return found


def read(record: dict) -> None:
    """Take a submission's answers apart, so that `compare` finds it done."""
    for e in record["exercises"]:
        _pieces(e["source"])


@functools.cache
def _pieces(text: str) -> frozenset[str]:
    return frozenset(pieces(text))


def compare(names: list[str], sources: dict[str, dict[int, str]]) -> Class:
    """What all pairs share, in time that grows as the class does."""
    class_ = Class(names, sources)
    pairs: dict[tuple[int, int], Pair] = {}
    for id, texts in sources.items():
        _compare_one(class_, everything()[id], texts, pairs)
    shared = [pair for pair in pairs.values() if pair.total >= 1]
    class_.pairs = sorted(shared, key=lambda p: (-p.total, p.a, p.b))
    return class_


def _compare_one(class_: Class, exercise: Exercise, texts: dict[int, str], pairs: dict) -> None:
    """One exercise: adds to the pairs, and to what is known of the class."""
    id, kit = exercise.id, ours(exercise)
    trees = {number: _pieces(text) for number, text in texts.items()}
    trees = {number: some for number, some in trees.items() if some}
    n, holders = len(trees), defaultdict(list)
    for number, some in trees.items():
        for piece in sorted(some - kit):  # in order, or sums would differ from run to run
            holders[piece].append(number)
    weight = {piece: math.log2(n / len(who)) for piece, who in holders.items()}
    times = Counter(trees.values()).values()
    class_.trees[id] = trees
    class_.whole[id] = {
        number: sum(weight[p] for p in sorted(some - kit)) for number, some in trees.items()
    }
    class_.chance[id] = sum(k * (k - 1) for k in times) / (n * (n - 1)) if n > 1 else 0.0
    for piece, who in holders.items():
        if len(who) <= COMMON:
            for a, b in combinations(who, 2):
                pair = pairs.setdefault((a, b), Pair(a, b))
                pair.bits[id] = pair.bits.get(id, 0.0) + weight[piece]


def same(class_: Class, pair: Pair) -> tuple[list[str], list[str]]:
    """(exercises that both answered with the same tree, exercises that both answered)."""
    both = [id for id, some in class_.trees.items() if pair.a in some and pair.b in some]
    return [id for id in both if class_.trees[id][pair.a] == class_.trees[id][pair.b]], both


def expected(class_: Class, pair: Pair) -> tuple[float, float]:
    """(how many answers of a pair would be the same by chance; how many pairs of the class would
    have as many of the same as this one). Each answer is drawn from the class's, by itself."""
    found, both = same(class_, pair)
    odds = [1.0]  # odds[k]: of k answers the same
    for p in (class_.chance[id] for id in both):
        odds = [(1 - p) * x + p * y for x, y in zip([*odds, 0.0], [0.0, *odds], strict=True)]
    n = len(class_.names)
    mean = sum(class_.chance[id] for id in both)
    return mean, n * (n - 1) / 2 * sum(odds[len(found) :])


def quantile(class_: Class, share: float) -> float:
    """Bits that this share of all pairs stays below, with those that share nothing."""
    n = len(class_.names)
    above = int((1 - share) * n * (n - 1) / 2)
    return class_.pairs[above].total if above < len(class_.pairs) else 0.0


def alike_csv(class_: Class) -> str:
    """The pairs that share most."""
    head = ["first", "second", "bits", "same answers", "of", "same by chance", "pairs by chance",
            "bits of each exercise"]  # fmt: skip
    rows = []
    for p in class_.pairs[:LISTED]:
        (found, both), (mean, pairs) = same(class_, p), expected(class_, p)
        said = "; ".join(f"{id}: {p.bits[id]:.0f}" for id in _telling(p))
        numbers = [round(p.total), len(found), len(both), round(mean, 1), float(f"{pairs:.2g}")]
        rows.append([class_.names[p.a], class_.names[p.b], *numbers, said])
    return sheet(head, rows)


def _telling(pair: Pair) -> list[str]:
    """The exercises that share a bit or more, the most first."""
    return sorted((id for id in pair.bits if pair.bits[id] >= 1), key=lambda id: -pair.bits[id])


EXPLAINED = """
<p>This page accuses nobody and has changed no points: look at the answers, and ask.</p>
<p>Compared are syntax trees without names, numbers and formatting. What is the kit's own, the
reference's, or that of more than {common} answers counts for nothing. What {k} of n answers have
weighs log<sub>2</sub>(n / k) bits: what everybody writes weighs little, and an odd turn that two
share weighs much. Pieces within pieces count, too, so bits rank pairs and are no probability.</p>
<p>Short answers are the same by necessity, and right ones more than wrong ones. So the number of
same answers stands beside two others: how many two students would have if each had drawn their
answers at random from the class's, and how many pairs of this class would then have as many as
these two. Friends who learn together have more, and so have two good students.</p>"""


def alike_page(class_: Class, wrong: list[set[str]]) -> str:
    """The report as a page. wrong: of each submission, the exercises without all points."""
    n = len(class_.names)
    head = "<h1>Alike answers</h1>" + EXPLAINED.format(common=COMMON, k="k")
    if n < FEW:
        head += f"<p>Of {quantity(n, 'submission')} nothing can be said about chance.</p>"
    middle, high = quantile(class_, 0.5), quantile(class_, 0.99)
    head += (
        f"<p>Half of the {n * (n - 1) // 2} pairs of this class share {middle:.0f} bits or less, "
        f"and one in a hundred shares more than {high:.0f}.</p>"
    )
    rows = []
    for i, p in enumerate(class_.pairs[:SHOWN]):
        (found, both), (mean, pairs) = same(class_, p), expected(class_, p)
        link = f'<a href="#p{i}">{_names(class_, p)}</a>'
        times = f"{len(found)} of {len(both)}; by chance {mean:.1f}"
        rows.append([link, f"{p.total:.0f}", times, _few(pairs)])
    columns = ["pair", "bits", "same answers", "such pairs by chance"]
    most = table("The pairs that share most", columns, rows)
    parts = [head, most if rows else "<p>No pair shares anything that counts.</p>"]
    parts += [_beside(class_, i, p, wrong) for i, p in enumerate(class_.pairs[:SHOWN])]
    parts.append("<h2>By exercise</h2>")
    parts += [_exercise(class_, id) for id in class_.trees]
    return webpage("Alike answers", "".join(parts))


def _few(pairs: float) -> str:
    """A number of pairs that may be far below one."""
    if pairs < 0.001:
        return "under 0.001"
    return f"{pairs:.0f}" if pairs >= 9.5 else f"{pairs:.1g}"


def _names(class_: Class, pair: Pair) -> str:
    return f"{escape(class_.names[pair.a])}, {escape(class_.names[pair.b])}"


def _beside(class_: Class, i: int, pair: Pair, wrong: list[set[str]]) -> str:
    """A pair's most telling answers side by side, folded."""
    found, _ = same(class_, pair)
    parts = [f'<h2 id="p{i}">{_names(class_, pair)}</h2>']
    if failed := [id for id in found if id in wrong[pair.a] & wrong[pair.b]]:
        parts.append(f"<p>The same, and not right: {', '.join(failed)}</p>")
    for id in _telling(pair)[:EACH]:
        least = min(class_.whole[id][pair.a], class_.whole[id][pair.b])
        is_same = "the same; " if id in found else ""
        texts = (printable(class_.sources[id][k][:LONGEST]) for k in (pair.a, pair.b))
        both = "".join(f"<pre>{escape(text)}</pre>" for text in texts)
        said = f"{id}: {is_same}{pair.bits[id]:.0f} of {least:.0f} bits"
        parts.append(f'<details><summary>{said}</summary><div class="pair">{both}</div></details>')
    return "".join(parts)


def _exercise(class_: Class, id: str) -> str:
    """The pairs that share most in one exercise."""
    best = heapq.nlargest(EACH, class_.pairs, key=lambda p: p.bits.get(id, 0.0))
    rows = [f"<li>{_names(class_, p)}: {quantity(round(p.bits[id]), 'bit')}</li>"
            for p in best if p.bits.get(id, 0.0) >= 1]  # fmt: skip
    n, chance = len(class_.trees[id]), class_.chance[id]
    said = f"{id} {escape(everything()[id].title)}"
    return (
        f"<h3>{said}</h3><p>{n} answers; of a hundred pairs {100 * chance:.0f} are the same.</p>"
        f"<ul>{''.join(rows)}</ul>"
    )
