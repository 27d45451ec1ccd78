"""The tables: figures worked out by hand, finished runs left alone, failed ones named."""

import json
import shutil
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from digests import options

from lbw_minimal.report import wilson
from lbw_minimal.reward import MENDS
from lbw_minimal.training import InputError
from tasks import TASKS, WEIGHTS
from tasks.commands import ablation, batch, table
from tasks.commands.recipe import fields_of

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "solutions" / "results"


def finish(path, wins, episodes=10, **more):
    """The metrics of a finished run in the folder `path`."""
    path.mkdir(parents=True)
    rows = [{"success": i < wins, "success_at_end": i < wins - 1} for i in range(episodes)]
    scores = {n: {"r2": 0.99, "px": 1.0} for n in ("tip_x", "tip_y", "object_x")}
    scores["object_y"] = {"r2": None, "px": 0.1}
    metrics = {
        "episodes": rows, "success": {}, "stages": {"translation": 300, "policy": 60},
        "memory_mb": 800, "settings": {"recipe": {"policy_steps": 10_000}},
        "perception": {"robot": scores, "translated": scores},
    }  # fmt: skip
    (path / "metrics.json").write_text(json.dumps(metrics | more))


@pytest.fixture
def runs(tmp_path, monkeypatch):
    monkeypatch.setattr("tasks.TASKS", ("push", "slide"))
    for task, wins in (("push", (10, 10, 9)), ("slide", (8, 7, 9))):
        for seed, n in enumerate(wins):
            finish(batch.folder(tmp_path, task, seed), n)
            for change in ("literal", *MENDS):
                finish(batch.folder(tmp_path, task, seed, change), 0)
    return tmp_path


def test_row_has_the_rate_of_all_seeds_and_its_interval(runs):
    text = table.table(runs, jobs=1)
    # 29 of 30: Wilson 83.3 to 99.4 %; 24 of 30: 62.7 to 90.5 %; 0 of 30: 0 to 11.4 %
    assert (
        "| push | 100 % | 97 % (83-99) | 10/10, 10/10, 9/10 | 0 % (0-11) | 0/10, 0/10, 0/10 |"
        in text
    )
    assert "| slide | 80 % | 80 % (63-90) | 8/10, 7/10, 9/10 |" in text
    assert "| 6 min | 10,000 |" in text
    assert "| push | 0 | 0.990 / 0.990 / 0.990 / - | 0.990 / 0.990 / 0.990 / - |" in text
    assert (runs / "table.md").read_text() == text
    rows = json.loads((runs / "table.json").read_text())
    assert len(rows) == 12 and rows[0]["wins"] == 10 and rows[0]["wins_at_end"] == 9


def test_the_rivals_stand_above_lbw_as_in_the_paper(runs):
    for task in ("push", "slide"):
        for seed in range(2):
            finish(batch.folder(runs, task, seed, "classifier"), 3 * seed)
            finish(batch.folder(runs, task, seed, "avid"), 1)
    *_, two, where, differs, single = table.table(runs, jobs=1, rivals=True).split("\n\n")
    assert where == "Where the methods' order is not the paper's:"
    assert "- push: Classifier reward is below LbW, in the paper equal" in differs.splitlines()
    assert len(single.splitlines()) == 2 + 3 * 2
    assert "| Classifier reward | slide | 0/10, 3/10 | 10,000 | 0.2 h |" in single
    head, _, classifier, avid, lbw = two.splitlines()
    assert head == "| method | expert videos | push | slide | time |"
    # 3 of 20: Wilson 5.2 to 36.0 %; 2 of 20: 2.8 to 30.1 %
    rate = "15 % (5-36)"
    assert classifier.startswith(
        f"| Classifier reward | 35 robot videos | {rate} / 100 % | {rate} / 30 % |"
    )
    assert avid == (
        "| AVID-m | 15 human videos | 10 % (3-30) / 60 % | 10 % (3-30) / 0 % | 0.4 h in 4 runs |"
    )
    assert lbw.startswith("| LbW | 1 human video | 97 % (83-99) / 100 % | 80 % (63-90) / 80 % |")


def test_object_tracks_stand_below_lbw_and_beside_no_figure_of_the_papers(runs):
    for seed in range(3):
        finish(batch.folder(runs, "push", seed, "tracks"), 4 * seed)
        finish(batch.folder(runs, "slide", seed, "tracks"), 5)
    *_, two, single = table.table(runs, jobs=1, tracks=True).split("\n\n")
    _, _, lbw, tracks = two.splitlines()
    assert lbw.startswith("| LbW | 1 human video | 97 % (83-99) / 100 % |")
    # 12 of 30: Wilson 24.6 to 57.7 %; 15 of 30: 33.2 to 66.8 %
    rates = "40 % (25-58) | 50 % (33-67)"
    assert tracks == f"| Object tracks | 1 human video | {rates} | 0.6 h in 6 runs |"
    assert "| Object tracks | push | 0/10, 4/10, 8/10 | 10,000 | 0.3 h |" in single


def test_a_rival_is_run_alone_with_perception_of_its_own(tmp_path, monkeypatch):
    started = []

    def run(line, **_):
        started.append(" ".join(line[3:]))
        return type("Done", (), {"returncode": 0})

    monkeypatch.setattr("subprocess.run", run)
    batch.run_missing(tmp_path, [("push", 1, "avid")], jobs=1, episodes=10)
    (line,) = started
    assert line.endswith("--method avid") and "--weights" not in line
    assert f"--out {tmp_path / 'push-1-avid'}" in line
    batch.run_missing(tmp_path, [("push", 0, "avid-5"), ("push", 0, "avid")], 1, episodes=10)
    _, first, then = started  # the translation of the one serves the other
    assert f"--out {tmp_path / 'push-0-avid'} " in first
    assert then.endswith(f"--weights {tmp_path / 'push-0-avid'} --method avid --videos 5")


def test_ablation_has_a_row_a_mend_and_a_picture(runs):
    text = ablation.ablation(runs, jobs=1)
    assert len(text.splitlines()) == 2 + 2 + len(MENDS)
    assert "| without timed | 0 % (0-11) | 0/10, 0/10, 0/10 |" in text
    assert (runs / "ablation.png").stat().st_size > 5000
    assert (runs / "ablation.md").read_text(encoding="utf-8") == text


def test_bars_and_their_whiskers_are_rates_and_intervals():
    """9 of 10: Wilson's 59.6 to 98.2 %. Push above slide, both in their own colour."""
    rows = {"all": [[{"wins": 9, "episodes": 10}], [{"wins": 0, "episodes": 10}]]}
    (axis,) = ablation.bars(rows).axes
    push, slide = axis.patches
    assert (push.get_width(), slide.get_width()) == pytest.approx((90, 0))
    assert push.get_y() < slide.get_y() and axis.get_ylim()[0] > axis.get_ylim()[1]
    low, high = np.sort(axis.collections[0].get_segments()[0][:, 0])
    assert (low, high) == pytest.approx((59.6, 98.2), abs=0.1)
    assert ablation.ABLATED == ("push", "slide")
    assert [container.get_label() for container in axis.containers[::2]] == ["push", "slide"]


def test_r_squared_is_of_tip_and_then_object_first_across_then_down():
    scores = {"tip_x": 0.1, "tip_y": 0.2, "object_x": 0.3, "object_y": None}
    row = {"perception": {"robot": {name: {"r2": r2} for name, r2 in scores.items()}}}
    assert table.r_squared(row, "robot") == "0.100 / 0.200 / 0.300 / -"


def test_time_is_of_all_stages_in_hours_and_a_tasks_in_minutes_on_average():
    rows = [{"stages": {"a": 1800, "b": 1800}, "wins": 1, "episodes": 1, "steps": 1},
            {"stages": {"a": 7200}, "wins": 1, "episodes": 1, "steps": 1}]  # fmt: skip
    assert table.hours(rows) == "3.0 h"
    assert table.success("push", rows, rows)[-2] == "90 min"


def test_what_is_finished_has_as_many_episodes_as_asked_and_interrupted_runs_go_on(tmp_path):
    finish(tmp_path / "push-0", 3, episodes=10)
    assert batch.finished(tmp_path / "push-0", 10) and not batch.finished(tmp_path / "push-0", 100)
    assert not batch.finished(tmp_path / "push-9", 10)
    assert "--resume" not in batch.command(tmp_path, "push", 0, "", 10)
    (tmp_path / "push-0" / "settings.json").write_text("{}")
    assert "--resume" in batch.command(tmp_path, "push", 0, "", 100)
    row = batch.read(tmp_path, "push", 0)
    assert (row["wins"], row["wins_at_end"], row["episodes"], row["steps"]) == (3, 2, 10, 10_000)


def test_runs_of_the_page_differ_from_the_recipe_by_what_their_names_say():
    """Three times push's 3,000 steps; starts moved by 2 cm; other numbers of videos."""
    steps = ["--set", "policy_steps=9000"]
    assert batch.ALONE["classifier-long"][-2:] == batch.LATER["avid-long"][1][-2:] == steps
    assert batch.LATER["wide"] == ("", ["--jitter", "0.02"])
    assert batch.ALONE["avid-motion"][-1] == "motion=1"
    assert [batch.LATER[f"avid-{n}"][1][-1] for n in (1, 5)] == ["1", "5"]
    assert [batch.ALONE[f"videos-{n}"][-1] for n in (5, 15)] == ["5", "15"]


def test_table_two_is_the_papers():
    """Classifier-reward, AVID-m and LbW; reach, push, slide, coffee and drawer."""
    rates = [[table.TABLE_II[c][t] for t in TASKS] for c in ("classifier", "avid", "")]
    assert rates == [[100, 100, 30, 50, 70], [100, 60, 0, 40, 50], [100, 100, 80, 70, 80]]


def test_finished_runs_are_not_repeated_and_others_go_on(tmp_path, monkeypatch):
    finish(tmp_path / "push-0", 10)
    (tmp_path / "push-1").mkdir()
    (tmp_path / "push-1" / "settings.json").write_text("{}")
    started = []

    def run(line, **_):
        started.append(line[3:])
        return type("Done", (), {"returncode": 0})

    monkeypatch.setattr("subprocess.run", run)
    batch.run_missing(tmp_path, [("push", 0, "literal"), ("push", 1, "")], jobs=1, episodes=10)
    first, second = (" ".join(line).replace(f"{tmp_path}/", "") for line in started)
    both = "--threads 1 --out {} --episodes 10"
    assert first == f"push --seed 1 {both.format('push-1')} --from-scratch --resume"
    literal = f"push --seed 0 {both.format('push-0-literal')} --weights push-0 --reward literal"
    assert second == literal


def test_a_run_that_fails_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("subprocess.run", lambda *a, **k: type("Done", (), {"returncode": 2}))
    with pytest.raises(InputError, match=r"push-0.*code 2"):
        batch.run_missing(tmp_path, [("push", 0, "")], jobs=1, episodes=10)


def read(path):
    return json.loads(path.read_text())


RUNS, POLICIES = (sorted((RESULTS / name).glob("*/metrics.json")) for name in ("runs", "policies"))
AGAIN, HUNDRED, LIMITS = (
    sorted((RESULTS / name).glob("*.json")) for name in ("again", "hundred", "limits")
)


@pytest.mark.parametrize("path", POLICIES, ids=lambda p: p.parent.name)
def test_shipped_policy_is_of_the_present_recipe(path):
    metrics = read(path)
    settings = metrics["settings"]
    recipe = import_module(f"tasks.{settings['task']}").RECIPE
    assert settings["recipe"] == fields_of(recipe, "lbw")
    assert path.parent.name == f"{settings['task']}-{settings['seed']}"
    assert settings["reward"] == "mended" and not settings["without"] and not settings["set"]
    assert len(metrics["episodes"]) == 100


@pytest.mark.parametrize("task", TASKS)
def test_shipped_policy_comes_from_the_run_in_its_note(task):
    note = read(WEIGHTS / task / "policy.json")
    assert note == read(RESULTS / "policies" / f"{task}-0" / "metrics.json")
    assert {"command", "settings", "machine"} <= set(note)
    assert {"command", "machine"} <= set(read(WEIGHTS / task / "perception.json"))


def policy_row(task):
    """A task's line in the README: three trainings on the shipped perception."""
    runs = [batch.read(RESULTS / "policies", task, seed) for seed in range(3)]
    row = [task, f"{table.PAPER[task]} %", table.percent(runs), table.each(runs)]
    return [*row, f"{runs[0]['steps']:,}"]


def test_policies_are_as_good_as_the_readme_says():
    assert len(POLICIES) == 3 * len(TASKS)
    head = ["task", "paper", "success (95 % interval)", "by seed", "policy steps"]
    text = table.markdown(head, [policy_row(task) for task in TASKS])
    assert text in (ROOT / "README.md").read_text()


@pytest.mark.parametrize("path", RUNS, ids=lambda p: p.parent.name)
def test_shipped_run_is_in_the_folder_of_its_settings(path):
    settings = read(path)["settings"]
    change = settings["without"] or settings["reward"].replace("mended", "")
    assert batch.folder(RESULTS / "runs", settings["task"], settings["seed"], change) == path.parent


def test_shipped_tables_are_those_of_the_shipped_runs(tmp_path, monkeypatch):
    out = shutil.copytree(RESULTS / "runs", tmp_path / "table")
    monkeypatch.setattr("subprocess.run", lambda *_, **__: pytest.fail("a run is missing"))
    readme = (RESULTS / "README.md").read_text()
    for name, make in (("table", table.table), ("ablation", ablation.ablation)):
        assert make(out, jobs=1) == (RESULTS / f"{name}.md").read_text()
        assert (out / f"{name}.json").read_text() == (RESULTS / f"{name}.json").read_text()
        for part in (RESULTS / f"{name}.md").read_text().split("\n\n"):
            assert part.strip() in readme


def test_policies_on_arms_with_limits_are_as_good_as_the_readme_says():
    wins = {p.stem: sum(e["success"] for e in read(p)["episodes"]) for p in LIMITS}
    assert all(len(read(path)["episodes"]) == 100 for path in LIMITS)
    slide, again = wins.pop("slide"), wins.pop("slide-again-0")
    readme = " ".join((RESULTS / "README.md").read_text().split())
    assert wins == dict.fromkeys(("coffee", "drawer", "push", "reach"), 100)
    assert f"slide's in {slide} (" in readme and f"succeeds in {again} (" in readme


def test_repeated_runs_are_as_good_as_the_readme_says():
    again, hundred = (
        {path.stem: [e["success"] for e in read(path)["episodes"]] for path in paths}
        for paths in (AGAIN, HUNDRED)
    )
    assert len(again) == 7 and all(len(won) == sum(won) == 10 for won in again.values())
    assert len(hundred) == 12 and all(len(won) == 100 for won in hundred.values())
    slide = ["slide", *(f"slide-again-{seed}" for seed in range(3))]
    assert [sum(hundred.pop(name)) for name in slide] == [97, 96, 96, 100]
    assert all(all(won) for won in hundred.values())


def test_runs_with_moved_starts_are_as_good_as_their_table_says():
    runs = [read(RESULTS / "jitter" / f"{task}-0" / "metrics.json") for task in TASKS]
    assert all(run["settings"]["jitter"] == 0.02 for run in runs)
    lines = []
    for task, run in zip(TASKS, runs, strict=True):
        wins, n = sum(e["success"] for e in run["episodes"]), len(run["episodes"])
        low, high = (round(100 * bound) for bound in wilson(wins, n))
        lines.append([task, f"{wins}/{n}", f"{low}-{high} %"])
    text = table.markdown(["task", "success", "95 % interval"], lines)
    assert text in (RESULTS / "README.md").read_text()


def some_runs():
    """Runs of two tasks by every method, in numbers that differ everywhere."""
    n, runs = 0, {}
    for task in ("push", "slide"):
        for change, seeds in (
            ("", 3),
            ("literal", 3),
            ("classifier", 2),
            ("avid", 2),
            ("tracks", 3),
        ):
            rows = []
            for seed in range(seeds):
                n += 1
                scores = {
                    name: {"r2": None if name == "object_y" else 0.9 - 0.01 * n - 0.05 * k}
                    for k, name in enumerate(("tip_x", "tip_y", "object_x", "object_y"))
                }
                other = {k: {"r2": v["r2"] and v["r2"] / 2} for k, v in scores.items()}
                rows.append({
                    "task": task, "seed": seed, "change": change, "wins": (7 * n) % 11,
                    "episodes": 10 + n % 3, "stages": {"a": 100.0 * n, "b": 7.0 * n * n},
                    "steps": 1000 * n, "perception": {"robot": scores, "translated": other},
                })  # fmt: skip
            runs[task, change] = rows
    return runs


def test_tables_of_some_runs_read_as_they_did(tmp_path, monkeypatch, golden):
    """All tables of the page, the file of rows, and which runs are asked for in which order."""
    runs, asked, read = some_runs(), [], []
    monkeypatch.setattr("tasks.TASKS", ("push", "slide"))
    monkeypatch.setattr(table, "run_missing", lambda *how: asked.append(how))
    monkeypatch.setattr(
        table, "read", lambda out, t, s, c: read.append((out, t, s, c)) or runs[t, c][s]
    )
    figures = {}
    for kind, how in {"plain": {}, "tracks": {"tracks": True}, "all": {
        "tracks": True, "rivals": True, "ray": True,
    }}.items():  # fmt: skip
        text = table.table(tmp_path, 4, 11, 3 if kind != "tracks" else 1, **how)
        assert (tmp_path / "table.md").read_text() == text
        figures[kind] = text.splitlines()[9 if kind == "tracks" else 0 :]
    plain = figures.pop("plain")
    assert figures["all"][: len(plain)] == plain
    assert [how[0] for how in asked] == [tmp_path] * 3
    assert [how[2:] for how in asked] == [(4, 11, False), (4, 11, False), (4, 11, True)]
    rows = json.loads((tmp_path / "table.json").read_text())
    figures["rows"] = [f"{r['task']} {r['change']} {r['seed']}" for r in rows]
    assert asked[2][1] == table.wanted(table.counts(3, True, True))
    order = [" ".join(map(str, job)) for job in asked[2][1]]
    figures["wanted"] = order[::4]
    assert (tmp_path / "table.json").read_text().endswith("}\n]\n") and read[0][0] == tmp_path
    golden(figures)


def test_the_paper_and_the_arguments_are_what_they_were(golden):
    golden(
        {
            "table": list(options(table.parser())),
            "ablation": [p.description for p in map(table.parser, ("table", "ablation"))],
            "count": len(list(options(table.parser("ablation")))),
            "paper": {k: str(v) for k, v in table.TABLE_II.items()},
            "methods": {k: str(v) for k, v in table.METHODS.items()},
            "head": table.HEAD,
            "seeds": [table.SEEDS, table.RIVAL_SEEDS],
            "counts": [str(table.counts(5, *on)) for on in ((0, 0), (1, 0), (0, 1), (1, 1))],
            "one": str(table.counts(1, True, True)),
        }
    )


def test_rates_and_times_by_hand():
    """7 of 8 and 1 of 12, 90 minutes and 18, of a task that is not the paper's."""
    rows = [{"wins": 7, "episodes": 8, "stages": {"a": 5400}, "steps": 1234},
            {"wins": 1, "episodes": 12, "stages": {"a": 900, "b": 180}, "steps": 9}]  # fmt: skip
    assert table.rate(rows) == (0.4, *wilson(8, 20))
    assert table.percent(rows) == "40 % (22-61)"
    assert table.each(rows) == "7/8, 1/12" and table.hours(rows) == "1.8 h"
    assert table.success("domino", rows, rows[:1]) == [
        "domino", "-", "40 % (22-61)", "7/8, 1/12", "88 % (53-98)", "7/8", "54 min", "1,234",
    ]  # fmt: skip
    assert table.markdown(["a", "b"], [["1", "2"]]) == "| a | b |\n| --- | --- |\n| 1 | 2 |\n"
