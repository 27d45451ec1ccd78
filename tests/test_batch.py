"""Runs on a cluster, without one: what goes out with a job, what comes back, what is printed."""

import json
import shlex

import pytest

from lbw_minimal.training import InputError
from tasks.commands import ablation, batch, table


@pytest.fixture
def cluster(monkeypatch):
    """A cluster that keeps what it is given, and answers what a test has put into `answers`."""

    class Cluster:
        def __init__(self):
            self.work, self.answers = [], {}
            self.python, self.pack = batch.cluster.python, batch.cluster.pack

        def spread(self, function, jobs):
            assert function is self.python
            for name, arguments, memory in jobs:
                self.work.append((name, *arguments, memory))
                yield name, self.answers.get(name, (0, "", {}))

    fake = Cluster()
    monkeypatch.setattr(batch, "cluster", fake)
    return fake


def test_a_job_goes_out_with_its_own_folder_and_the_weights_of_the_run_it_rests_on(
    cluster, tmp_path
):
    base, own = tmp_path / "push-1", tmp_path / "push-1-literal"
    for path in (base, own):
        path.mkdir()
        for name in ("keypoints.safetensors", "settings.json", "policy.checkpoint"):
            (path / name).write_bytes(f"{path.name}'s".encode())
    batch.run_on_cluster(tmp_path, [("push", 1, "literal")], 10)
    (name, line, folders, result, memory) = cluster.work[0]
    assert name == ("push", 1, "literal") and memory == 1_500_000_000
    assert folders == {
        "runs/push-1": {"keypoints.safetensors": b"push-1's"},
        "runs/push-1-literal": {
            n: b"push-1-literal's"
            for n in ("keypoints.safetensors", "settings.json", "policy.checkpoint")
        },
    }
    assert result == "runs/push-1-literal"
    # In the words of that machine's folder, and going on where it was.
    assert shlex.join(line) == (
        "-m tasks push --seed 1 --threads 1 --out runs/push-1-literal --episodes 10 "
        "--weights runs/push-1 --reward literal --resume"
    )


def test_a_job_that_stands_alone_takes_nothing_else_with_it(cluster, tmp_path):
    batch.run_on_cluster(tmp_path, [("reach", 0, "avid")], 10)
    (_, line, folders, *_, memory) = cluster.work[0]
    assert folders == {"runs/reach-0-avid": {}} and memory == 4_000_000_000
    assert "--resume" not in line and "--weights" not in line
    assert [batch.memory(c) for c in ("", "wide", "classifier-long", "avid-5")] == [
        1_500_000_000, 1_500_000_000, 4_000_000_000, 4_000_000_000,
    ]  # fmt: skip


def test_what_comes_back_is_written_and_a_checkpoint_is_gone(cluster, tmp_path, capsys):
    own = tmp_path / "push-0"
    own.mkdir()
    (own / "policy.checkpoint").write_bytes(b"old")
    files = {"metrics.json": b"{}", "policy.safetensors": b"weights"}
    cluster.answers["push", 0, ""] = 0, "learnt\n", files
    batch.run_on_cluster(tmp_path, [("push", 0, "")], 10)
    assert {p.name: p.read_bytes() for p in own.iterdir()} == files
    assert (tmp_path / "push-0.log").read_text() == "learnt\n"
    assert capsys.readouterr().out == "finished push-0\n"
    batch.run_on_cluster(tmp_path, [("push", 0, "")], 10)
    assert (tmp_path / "push-0.log").read_text() == "learnt\nlearnt\n"


def test_the_metrics_which_say_that_a_run_has_ended_are_written_last(
    cluster, tmp_path, monkeypatch
):
    written = []
    monkeypatch.setattr(batch, "write_atomic", lambda path, _: written.append(path.name))
    cluster.answers["push", 0, ""] = 0, "", dict.fromkeys(("a", "metrics.json", "z"), b"")
    batch.run_on_cluster(tmp_path, [("push", 0, "")], 10)
    assert written == ["a", "z", "metrics.json"]


def test_a_job_that_fails_is_named_when_the_others_have_ended(cluster, tmp_path, capsys):
    cluster.answers["push", 0, ""] = 3, "it broke\n", {"metrics.json": b"half"}
    cluster.answers["push", 1, ""] = OSError("lost too often")
    jobs = [("push", seed, "") for seed in range(3)]
    with pytest.raises(InputError, match=r"push-0: the run ended with code 3; see \S*push-0.log"):
        batch.run_on_cluster(tmp_path, jobs, 10)
    assert not (tmp_path / "push-0").exists()  # half a run is none
    assert (tmp_path / "push-0.log").read_text() == "it broke\n"
    assert capsys.readouterr().out == "finished push-2\n"
    with pytest.raises(InputError, match="push-1: lost too often"):
        batch.run_on_cluster(tmp_path, jobs[1:], 10)


def test_runs_that_others_rest_on_have_ended_before_those_go_out(cluster, tmp_path):
    batch.run_missing(tmp_path, [("push", 0, "literal"), ("push", 0, "")], 1, 10, ray=True)
    assert [name[2] for name, *_ in cluster.work] == ["", "literal"]
    for name in ("push-0", "push-0-literal"):
        metrics = json.dumps({"episodes": [{}] * 10})
        (tmp_path / name / "metrics.json").write_text(metrics)
    batch.run_missing(tmp_path, [("push", 0, "literal"), ("push", 0, "")], 1, 10, ray=True)
    assert len(cluster.work) == 2  # what is finished is not repeated


def test_what_is_missing_is_printed_in_its_order_and_the_order_said(tmp_path, capsys):
    table.main(["--print", "--seeds", "1", "--episodes", "3", "--out", str(tmp_path)])
    out, said = capsys.readouterr()
    lines = out.splitlines()
    assert len(lines) == 10 and lines[0] == (
        f"python -m tasks reach --seed 0 --threads 1 --out {tmp_path / 'reach-0'} --episodes 3 "
        "--from-scratch"
    )
    assert all("--from-scratch" in line for line in lines[:5])
    assert all("--reward literal" in line for line in lines[5:])
    assert said.startswith("The first 5 may run side by side; the other 5 learn on")
    batch.print_missing(tmp_path, [("push", 0, "")], 3)
    assert capsys.readouterr().err == ""  # nothing to say of one kind alone


def test_object_tracks_are_run_where_something_is_to_be_moved(tmp_path, capsys):
    table.main(["--print", "--tracks", "--seeds", "1", "--out", str(tmp_path)])
    lines = [line for line in capsys.readouterr().out.splitlines() if "--method" in line]
    assert [line.split()[3] for line in lines] == ["push", "slide", "coffee", "drawer"]
    assert lines[0].endswith(f"--out {tmp_path / 'push-0-tracks'} --episodes 10 --method tracks")


def test_the_ablation_prints_what_it_lacks(tmp_path, capsys):
    ablation.main(["--print", "--seeds", "1", "--out", str(tmp_path)])
    lines = capsys.readouterr().out.splitlines()
    # Two tasks; all mends, each of four left out, none of them.
    assert len(lines) == 2 * 6 and sum("--without timed" in line for line in lines) == 2
    assert {line.split()[3] for line in lines} == {"push", "slide"}


def test_where_all_methods_stand_as_in_the_paper_a_sentence_says_so():
    rates = {  # reach, push, slide, coffee, drawer, in per cent: the paper's, sharper
        "classifier": (99, 99, 30, 50, 70), "avid": (99, 60, 0, 30, 40), "": (99, 99, 80, 80, 90),
    }  # fmt: skip
    runs = {
        (task, change): [{"wins": 10 * n, "episodes": 1000}]
        for change, some in rates.items()
        for task, n in zip(table.tasks.TASKS, some, strict=True)
    }
    assert table.order(runs) == "The methods stand in the paper's order on every task.\n"


def test_every_run_is_asked_for_as_it_was(tmp_path, monkeypatch, golden):
    """The arguments of each change, of a smoke run, and of one that goes on; and its memory."""
    monkeypatch.chdir(tmp_path)
    out, lines = batch.Path("out"), {}
    for change in (*batch.ALONE, *batch.LATER):
        words = batch.command(out, "push", 2, change, 7)
        lines[change] = f"{batch.memory(change) / 1e9} {shlex.join(words)}"
        assert batch.rests_on(change) in batch.ALONE
    (out / "push-2").mkdir(parents=True)
    (out / "push-2" / "settings.json").write_text("{}")
    golden(
        {
            "lines": lines,
            "on": shlex.join(batch.command(out, "push", 2, "", 7)),
            "anew": shlex.join(batch.command(out, "push", 1, "literal", 7, fast=True)),
            "alone": list(batch.ALONE),
            "rests": [batch.rests_on(change) for change in (*batch.ALONE, *batch.LATER)],
        }
    )


def test_what_is_missing_is_found_once_and_in_two_rounds(tmp_path):
    """Finished is what has just as many episodes; what a run rests on is missing, too."""
    for name, episodes in (
        ("push-0", 3),
        ("push-0-literal", 2),
        ("reach-1-avid", 3),
        ("slide-0-tracks", 4),
    ):
        (tmp_path / name).mkdir()
        metrics = {"episodes": [{}] * episodes, "stages": {}}
        (tmp_path / name / "metrics.json").write_text(json.dumps(metrics))
    (tmp_path / "push-1").mkdir()
    (tmp_path / "push-1" / "metrics.json").write_text('{"stages": {}}')
    wanted = [
        ("push", 0, ""), ("push", 0, "literal"), ("push", 1, "wide"), ("push", 1, "timed"),
        ("reach", 1, "avid-long"), ("reach", 0, "avid-5"), ("slide", 0, "tracks"),
    ]  # fmt: skip
    assert batch.missing(tmp_path, wanted, 3) == (
        [("push", 1, ""), ("reach", 0, "avid"), ("slide", 0, "tracks")],
        [wanted[1], wanted[2], wanted[3], wanted[4], wanted[5]],
    )
    assert not batch.finished(tmp_path / "nowhere", 0)


def test_runs_are_started_logged_and_named_when_they_fail(tmp_path, monkeypatch, capsys):
    """First those that stand alone, all of them before the others."""
    started, out = [], tmp_path / "deep" / "out"

    def run(line, stdout, stderr):
        assert stdout is stderr and stdout.encoding == "utf-8"
        stdout.write("ü\n")
        started.append((line[0], line[1:3], line[3], line[-1], stdout.name))
        return type("Done", (), {"returncode": 4 * (line[3] == "slide")})

    pools = []
    pool = batch.ThreadPoolExecutor
    monkeypatch.setattr(batch, "ThreadPoolExecutor", lambda n: pools.append(n) or pool(1))
    monkeypatch.setattr(batch.subprocess, "run", run)
    monkeypatch.setattr(batch.sys, "executable", "py")
    batch.run_missing(out, [("push", 0, "literal")], 1, 5, fast=True)
    batch.run_missing(out, [("push", 0, "")], 1, 5)
    assert started == [
        ("py", ["-m", "tasks"], "push", "--fast", str(out / "push-0.log")),
        ("py", ["-m", "tasks"], "push", "--fast", str(out / "push-0-literal.log")),
        ("py", ["-m", "tasks"], "push", "--from-scratch", str(out / "push-0.log")),
    ]
    assert (out / "push-0.log").read_text(encoding="utf-8") == "ü\nü\n"
    assert capsys.readouterr().out.splitlines()[0] == (
        f"running push-0; {out / 'push-0'}.log tells how far it is"
    )
    with pytest.raises(InputError) as told:
        batch.run_missing(out, [("slide", 3, "avid")], 7, 5)
    assert pools == [1, 1, 1, 1, 7]
    path = out / "slide-3-avid"
    assert str(told.value) == f"{path}: the run ended with code 4; see {path}.log."


def test_a_finished_run_is_read_as_a_row(tmp_path):
    episodes = [{"success": s, "success_at_end": e} for s, e in ((1, 1), (1, 0), (0, 0))]
    metrics = {
        "episodes": episodes, "stages": {"policy": 5}, "settings": {"recipe": {"policy_steps": 9}},
    }  # fmt: skip
    row = {"task": "push", "seed": 4, "wins": 2, "wins_at_end": 1, "episodes": 3,
           "stages": {"policy": 5}, "steps": 9}  # fmt: skip
    for change, more in (("", {}), ("avid", {"memory_mb": 7, "perception": {"robot": 1}})):
        path = batch.folder(tmp_path, "push", 4, change)
        path.mkdir()
        (path / "metrics.json").write_text(json.dumps(metrics | more))
        none = {"memory_mb": None, "perception": None}
        named = {"change": change or "mended"}
        assert batch.read(tmp_path, "push", 4, change) == row | named | none | more
