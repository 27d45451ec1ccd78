"""What the results' page says of object tracks, against the runs that are there."""

import json
from pathlib import Path

import pytest

from tasks.commands import batch, table

RESULTS = Path(__file__).parents[1] / "solutions" / "results"


def read(path):
    return json.loads(path.read_text())


def tracks_rows(task):
    """A task's lines in the tables of object tracks: by seed, and over start jitter; LbW beside."""
    ours, lbw = (
        [batch.read(RESULTS / "paper" / "runs", task, seed, change) for seed in range(3)]
        for change in ("tracks", "")
    )
    sides = [f(some) for some in (ours, lbw) for f in (table.percent, table.each, steps_of)]
    yield [task, *sides]
    seen = read(RESULTS / "paper" / "controls" / f"{task}.json")["success"]
    for jitter, wins in read(RESULTS / "tracks" / "jitter.json")[task].items():
        rows = [{"wins": n, "episodes": 100} for n in wins]
        beside = table.percent([{"wins": seen[jitter]["the policy"], "episodes": 100}])
        each = ", ".join(map(str, wins))
        yield [task, f"{1000 * float(jitter):g} mm", table.percent(rows), each, beside]


def steps_of(rows):
    return f"{rows[0]['steps']:,}"


@pytest.mark.parametrize("task", ["push", "slide", "coffee", "drawer"])
def test_object_tracks_are_as_good_as_their_tables_say(task):
    readme = (RESULTS / "README.md").read_text()
    lesson = (RESULTS.parents[1] / "notebooks" / "13_after_the_paper.ipynb").read_text()
    for row in tracks_rows(task):
        assert f"| {' | '.join(row)} |" in readme and f"| {' | '.join(row)} |" in lesson
    moved = read(RESULTS / "tracks" / "jitter.json")[task]
    runs = [batch.read(RESULTS / "paper" / "runs", task, seed, "tracks") for seed in range(3)]
    assert moved["0.005"] == [run["wins"] for run in runs]


def test_forms_of_the_tracks_reward_are_as_good_as_their_table_says():
    """Runs of the forms before, seed by seed, and of the present one; a run from a real clip."""
    readme = (RESULTS / "README.md").read_text()
    now = RESULTS / "paper" / "runs"

    def won(path):
        episodes = read(path / "metrics.json")["episodes"]
        return f"{sum(e['success'] for e in episodes)}/{len(episodes)}"

    def cells(task, folder, end=""):
        return ", ".join(won(folder / f"{task}-{seed}{end}") for seed in range(3))

    tracks = RESULTS / "tracks"
    side = [cells(task, tracks / "side") for task in ("push", "slide", "coffee", "drawer")]
    alike = [cells(task, now, "-tracks") for task in ("push", "slide")]  # of both later forms
    half, hand = ([cells(task, *of) for task in ("coffee", "drawer")]
                  for of in ((tracks / "half",), (now, "-tracks")))  # fmt: skip
    same = 2 * ["the same place"]
    for name, row in (
        ("to the object's side", side),
        ("half an object behind it", alike + half),
        ("half an object, at most a hand", same + hand),
    ):
        assert f"| {name} | {' | '.join(row)} |" in readme
    assert won(tracks / "own-push") == "100/100"


@pytest.mark.parametrize("task", ["push", "slide", "coffee", "drawer"])
def test_runs_took_the_time_that_their_table_says(task):
    """Mean seconds on the server, where coffee's and drawer's tracks are of the form before."""
    now = RESULTS / "paper" / "runs"
    tracks = (RESULTS / "tracks" / "half", "") if task in ("coffee", "drawer") else (now, "-tracks")
    cells = []
    for folder, end in (tracks, (now, "")):
        runs = [read(folder / f"{task}-{seed}{end}" / "metrics.json") for seed in range(3)]
        policy = sum(run["stages"].pop("policy") for run in runs) / 3
        rest = sum(sum(run["stages"].values()) for run in runs) / 3
        steps = f"{runs[0]['settings']['recipe']['policy_steps']:,}"
        cells += [f"{rest:.0f}", f"{policy:.0f}" + f" ({steps})" * (task == "slide")]
    row = f"| {task} | {' | '.join(cells)} |".replace("(10,000)", "(10,000 steps)")
    assert row in (RESULTS / "README.md").read_text()
