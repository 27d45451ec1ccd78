"""The paper's page: which runs it asks for, its tables by hand, and that it stands alone."""

import json
import re

import numpy as np
import pytest
from matplotlib.figure import Figure

import tasks
from tasks.commands import controls, figures, paper, table
from tasks.commands.batch import folder, read


def plan(out, **more):
    return paper.Plan(**{"out": out, "jobs": 1, "episodes": 10, "seeds": 3, "fast": False} | more)


def rows(*wins):
    return [{"wins": n, "episodes": 10} for n in wins]


def test_the_runs_are_those_of_the_tables_and_each_is_asked_for_once(tmp_path):
    wanted = paper.wanted(plan(tmp_path))
    assert len(wanted) == len(set(wanted))
    count = {change: sum(c == change for *_, c in wanted) for *_, change in wanted}
    assert count == {
        "": 15, "wide": 15, "classifier": 10, "avid": 10, "classifier-long": 2, "avid-long": 2,
        "avid-motion": 1, "videos-5": 1, "videos-15": 1, "avid-1": 1, "avid-5": 1,
        "tracks": 12,  # reach has no object
    }  # fmt: skip
    smoke = paper.wanted(plan(tmp_path, seeds=1, fast=True))
    assert len(smoke) == 15 and {s for _, s, _ in smoke} == {0}
    assert folder(tmp_path, *wanted[0]) == tmp_path / "reach-0"


@pytest.fixture(scope="module")
def table_one():
    """It reads all demonstrations and all random videos."""
    return paper.table_one()


def test_table_one_counts_the_frames_that_are_there(table_one):
    head, _, human, robot = table_one.splitlines()
    assert head == "| domain | reach | push | slide | coffee | drawer |"
    # Of the human all five are the paper's, of the robot 1,220 and 4,007.
    for count in ("1,056", "398", "650", "658", "986"):
        assert f"| {count} / {count} |" in human
    assert "| 1,220 / 1,220 |" in robot and "| 4,007 / 4,007 |" in robot


def test_tables_of_steps_and_videos_by_hand():
    runs = {("reach", "avid"): rows(3), ("reach", "avid-long"): rows(10)}
    runs |= {("push", "avid"): rows(0), ("push", "avid-long"): rows(5)}
    runs |= {(t, c.replace("avid", "classifier")): r for (t, c), r in runs.items()}
    lines = paper.long_runs(runs).splitlines()
    assert lines[-2] == "| AVID-m | reach | 30 % (11-60) | 100 % (72-100) |"
    runs |= {("push", c): rows(10) for c in ("", "videos-5", "videos-15", "avid-1", "avid-5")}
    lines = paper.over_videos(runs).splitlines()
    assert lines[0] == "| human videos | 1 | 5 | 15 |"
    assert lines[-1] == "| AVID-m | 100 % (72-100) | 100 % (72-100) | 0 % (0-28) |"
    runs |= {(t, "wide"): [row | {"steps": 3000} for row in rows(9, 10)] for t in tasks.TASKS}
    lines = paper.trained_wide(runs).splitlines()
    assert lines[3] == "| push | 95 % (76-99) | 9/10, 10/10 | 3,000 |"


def test_controls_are_of_the_first_seeds_runs_and_the_recipes_have_the_rivals_beside(
    tmp_path, monkeypatch
):
    asked = []

    def measure(task, run, episodes, seed, beside, jitters, brief):
        asked.append((task, run.name, episodes, seed, beside, tuple(jitters), brief))
        return {"task": task}

    monkeypatch.setattr(controls, "measure", measure)
    some = plan(tmp_path)
    assert [note["task"] for note in paper.measured(some, "", (0.1,))] == list(tasks.TASKS)
    beside = {
        "Classifier reward": some.runs / "push-0-classifier", "AVID-m": some.runs / "push-0-avid",
    }  # fmt: skip
    assert asked[1] == ("push", "push-0", 100, 0, beside, (0.1,), False)
    paper.measured(some, "wide", (0.02,))
    assert asked[6] == ("push", "push-0-wide", 100, 0, {}, (0.02,), False)
    paper.measured(some, "wide", (0.02,))  # what is written is not measured again
    assert len(asked) == 10 and (tmp_path / "wide" / "push.json").exists()
    smoke = plan(tmp_path / "smoke", fast=True, episodes=2, seeds=1)
    paper.measured(smoke, "", (0.1,))
    assert asked[10][2] == 2 and asked[10][6]


def test_each_kind_of_run_has_its_seeds(tmp_path):
    three, one = plan(tmp_path), plan(tmp_path, seeds=1)
    of = {
        c: len(three.seeds_of(c)) for c in ("", "wide", "classifier", "avid", "avid-5", "avid-long")
    }
    assert of == {"": 3, "wide": 3, "classifier": 2, "avid": 2, "avid-5": 1, "avid-long": 1}
    assert {len(one.seeds_of(c)) for c in of} == {1}


@pytest.fixture(scope="module")
def page(tmp_path_factory, table_one):
    """The page of a smoke run, of which only what takes no training is real."""
    tmp_path = tmp_path_factory.mktemp("paper")
    figure = Figure()
    figure.subplots().plot([0, 1])
    asked = plan(tmp_path, seeds=1, fast=True, episodes=2)
    (tmp_path / "figures").mkdir()
    row = {"wins": 1, "episodes": 2, "stages": {"policy": 60}, "steps": 1000}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paper, "read", lambda *_: row)
        patch.setattr(paper, "table_one", lambda: table_one)
        for name in ("method", "over_steps", "needs_eyes", "translated", "perception"):
            shown = paper.shown(asked, name, figure, name)
            patch.setattr(paper, name, lambda *_, shown=shown: shown)
        return paper.write(asked)


def test_the_page_needs_no_other_file_and_names_a_command_for_each_item(page):
    html, text = page.read_text(), page.with_suffix(".md").read_text()
    assert 'src="figures/' not in html and "http" not in re.sub(r"http://www.w3.org\S*", "", html)
    assert html.count("<img") == text.count("![") == 6
    for part in text.split("\n## ")[1:]:
        assert "`python -m tasks " in part.splitlines()[-1]
    assert "Table II" in text and "<table>" in html and "smoke run" in text


def test_figures_of_the_page_are_png_and_svg(page):
    names = {path.name for path in (page.parent / "figures").iterdir()}
    assert {"tasks.png", "tasks.svg"} <= names
    assert {name.partition(".")[2] for name in names} == {"png", "svg"}


def test_the_overview_shows_both_arms_of_every_task():
    frame = np.full((84, 84, 3), 90, np.uint8)
    figure = figures.overview({task: (frame, frame // 2) for task in tasks.TASKS})
    shown = [axis.images[0].get_array() for axis in figure.axes]
    assert len(shown) == 10
    assert [int(image[0, 0, 0]) for image in shown] == 5 * [90] + 5 * [45]


def test_curves_are_means_of_the_last_episodes():
    log = [{"step": 10 * (i + 1), "success": i >= 2} for i in range(4)]
    axis = figures.over_steps({"push": {"LbW": [log]}}, last=2).axes[0]
    np.testing.assert_allclose(axis.lines[0].get_ydata(), [0, 0, 0.5, 1])
    axis = figures.over_steps({"push": {"LbW": [log, log[:1]]}}, last=8).axes[0]
    np.testing.assert_allclose(axis.lines[0].get_xydata(), [[20, 0], [30, 1 / 3], [40, 0.5]])
    np.testing.assert_allclose(axis.lines[1].get_xydata(), [[10, 0]])


def test_controls_are_drawn_as_shares_with_their_interval():
    figure = figures.over_jitter({"push": {"0.005": {"idle": 0}, "0.02": {"idle": 5}}}, 10)
    (axis,) = figure.axes
    np.testing.assert_allclose(axis.lines[0].get_xydata(), [[5, 0], [20, 0.5]])
    low, high = np.sort(axis.collections[0].get_paths()[0].vertices[:, 1])[[0, -1]]
    assert low == pytest.approx(0) and high == pytest.approx(0.763, abs=0.001)  # Wilson, 5 of 10


def test_the_order_of_methods_is_held_against_the_papers():
    """The paper: reach equal; push AVID-m last; slide LbW first, AVID-m last; so coffee, drawer."""
    rates = {"reach": (10, 0, 10), "push": (9, 0, 9), "slide": (2, 0, 9), "coffee": (0, 0, 0)}
    rates["drawer"] = (0, 10, 10)
    runs = {
        (task, change): [{"wins": 10 * n, "episodes": 100}]
        for task, some in rates.items()
        for n, change in zip(some, ("classifier", "avid", ""), strict=True)
    }
    lines = table.order(runs).splitlines()
    assert "- reach: Classifier reward is above AVID-m, in the paper equal" in lines
    assert "- reach: AVID-m is below LbW, in the paper equal" in lines
    assert not [line for line in lines if "push" in line or "slide" in line]
    assert "- coffee: AVID-m is not to be told from LbW, in the paper below it" in lines
    assert "- drawer: Classifier reward is below AVID-m, in the paper above it" in lines
    assert sum(line.startswith("-") for line in lines) == 2 + 3 + 2


def test_the_shipped_page_is_that_of_the_shipped_runs():
    results = tasks.ROOT / "solutions" / "results" / "paper"
    asked, runs = plan(results, episodes=100), {}
    for task, seed, change in paper.wanted(asked):
        runs.setdefault((task, change), []).append(read(asked.runs, task, seed, change))
    page = (results / "paper.md").read_text(encoding="utf-8")
    for made in (table.table_two, table.order, table.every_run):
        assert made(runs) in page
    for made in (paper.trained_wide, paper.long_runs, paper.over_videos):
        assert made(runs) in page
    assert all(row["episodes"] == 100 for some in runs.values() for row in some)
    notes = [json.loads((results / "controls" / f"{t}.json").read_text()) for t in tasks.TASKS]
    assert all(note["episodes"] == 100 and controls.table(note) in page for note in notes)
    assert controls.eyes_pay(notes) in page
    assert paper.needs_eyes_wide(asked) in page
    assert paper.perception(asked) in page
    for name in re.findall(r"\(figures/(\S+)\)", page):
        assert (results / "figures" / name).exists()
    readme = (tasks.ROOT / "README.md").read_text(encoding="utf-8")
    assert table.table_two(runs) in readme and controls.eyes_pay(notes) in readme
