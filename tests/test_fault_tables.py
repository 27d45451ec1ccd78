"""What the results' page says of faults, and of policies from strangers' clips, by its files."""

import json
from pathlib import Path

import pytest

from lbw_minimal.report import wilson

RESULTS = Path(__file__).parents[1] / "solutions" / "results"
PAGE = (RESULTS / "README.md").read_text(encoding="utf-8").replace("**", "")
KINDS = ("core and rivals", "world and tasks", "clips", "commands")  # the tables' columns


def read(name):
    return json.loads((RESULTS / name).read_text(encoding="utf-8"))


def kind(file):
    """The column in which a file's faults are counted."""
    folders = ("lbw_minimal/clips/", "lbw_minimal/", "tasks/commands/", "tasks/")
    columns = ("clips", "core and rivals", "commands", "world and tasks")
    return next(c for c, folder in zip(columns, folders, strict=True) if file.startswith(folder))


def noticed(faults):
    """Of all and of each kind, how many were noticed, and of how many."""
    for some in (faults, *([f for f in faults if kind(f["file"]) == k] for k in KINDS)):
        yield sum(f["noticed"] for f in some), len(some)


def changes_nothing(fault):
    judged = fault.get("judged", "")
    return not fault["noticed"] and judged.startswith(("equivalent", "changes nothing"))


@pytest.mark.parametrize(
    "name", ["mutants", "mutants_again", "mutants_500", "mutants_200", "mutants_seed4"]
)
def test_drawn_faults_were_noticed_as_often_as_their_table_says(name):
    drawn = read(f"{name}.json")
    telling = [fault for fault in drawn if not changes_nothing(fault)]
    for faults in (drawn, telling):
        cells = []
        for k, n in noticed(faults):
            low, high = (round(100 * bound) for bound in wilson(k, n))
            cells.append(f"{k} of {n} ({low}-{high})")
        assert f"| {' | '.join(cells)} |" in PAGE
    assert f"| without {len(drawn) - len(telling)} that change nothing | " in PAGE


def test_listed_faults_were_noticed_as_often_as_their_tables_say():
    faults = read("faults.json")
    sets = {of: [f for f in faults if f["set"] == of] for of in {f["set"] for f in faults}}
    for of, row in {
        "first": "the first 48, before", "fresh": "65 others, after", "third": "80 others, before",
        "second, before": "the first 26, before", "second, after": "70 others, after",
        "fourth": "91 of the core", "fifth": "120 others, with golden figures",
        "sixth": "80 of an outsider",
    }.items():  # fmt: skip
        cells = PAGE.split(f"\n| {row} | ")[1].split("\n")[0].split(" | ")
        (k, n), *of_kinds = noticed(sets.pop(of))
        assert cells[0].split(" (")[0] in (f"{k}", f"{k} of {n}") and f"{n}" in row
        assert [f"{a} of {b}" for a, b in of_kinds][: len(cells) - 2] == [
            cell.removesuffix(" |") for cell in cells[2:]
        ]
    assert not sets


def test_policies_from_strangers_clips_succeed_as_often_as_the_page_says():
    runs = read("own_arm/strangers.json")
    now = [r for r in runs if r["clips"] == 120]
    assert len(now) == 20 and sum(r["success"] >= 45 for r in now) == 19
    assert sum(r["success"] == 50 for r in now) == 18
    assert [r["success"] for r in now if r["task"] == "slide"] == [47, 41, 50]
    before = [r for r in runs if r["clips"] == 42 and "--set" not in r["command"]]
    assert len(before) == 20 and min(r["success"] for r in before) == 49
    assert sum(r["made"] == "painted" for r in before) == 9
    assert sum(r["task"] == "slide" for r in before) == 4
    earlier = [r for r in runs if r["clips"] == 32]
    assert len(earlier) == 11 and all(r["success"] == 50 for r in earlier)
    said = " ".join(PAGE.split())
    assert all(f"[{n} runs]" in said for n in ("19 of 20", "20 of 20", "11 of 11"))
