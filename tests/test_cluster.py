"""Many machines: the same results as one, whatever dies on the way. The jobs take a second each.

What needs Ray is skipped where requirements-cluster.txt is not installed.
"""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

import tests.grade.cluster
from lbw_minimal import cluster
from lbw_minimal.training import InputError
from tasks.__main__ import main
from tasks.commands import batch, table
from tests.grade import arguments, sandbox
from tests.grade.__main__ import main as grade
from tests.grade.cluster import grade_here
from tests.grade.files import File

ROOT = Path(__file__).resolve().parents[1]
SOLVED = json.loads((ROOT / "solutions" / "06_reward.ipynb").read_text())
BARREN = cluster.LEAN / "rfc3987_syntax" / "__init__.py"
# A run, on a cluster of a second. It notes who runs it, goes on where another stopped, and its wins
# depend on the perception it was given.
TOY = """
import json, os, sys, time
from pathlib import Path
STARTS = Path("NOTE")
value = lambda name: sys.argv[sys.argv.index(name) + 1]
task, seed, out = sys.argv[1], int(value("--seed")), Path(value("--out"))
with STARTS.open("a") as f:
    print(out.name, os.environ.get("RAY_RAYLET_PID"), os.getppid(), os.getpid(), file=f)
resumed = int((out / "policy.checkpoint").read_text()) if "--resume" in sys.argv else 0
if "RAY_RAYLET_PID" in os.environ:
    time.sleep(1)
seen = 0
if "--weights" in sys.argv:
    seen = 1 + int((Path(value("--weights")) / "translation.safetensors").read_text())
wins = (len(task) + 3 * seed + 2 * seen) % 11 + resumed
out.mkdir(parents=True, exist_ok=True)
(out / "translation.safetensors").write_text(str(seed + 1))
(out / "policy.checkpoint").unlink(missing_ok=True)
rows = [{"success": i < wins, "success_at_end": i < wins} for i in range(int(value("--episodes")))]
place = {n: {"r2": 0.99 - seed / 100} for n in ("tip_x", "tip_y", "object_x", "object_y")}
(out / "metrics.json").write_text(json.dumps({
    "episodes": rows, "stages": {"policy": 60}, "memory_mb": 800,
    "settings": {"recipe": {"policy_steps": 10_000}},
    "perception": {"robot": place, "translated": place},
}))
print("done")
"""


@pytest.fixture
def starts(tmp_path, monkeypatch):
    """Toy runs of two tasks; the file where each notes that it started."""
    (tmp_path / "toy.py").write_text(TOY.replace("NOTE", str(tmp_path / "starts")))
    monkeypatch.setattr(batch, "RUN", (str(tmp_path / "toy.py"),))
    monkeypatch.setattr("tasks.TASKS", ("push", "slide"))
    return tmp_path / "starts"


@pytest.fixture
def nodes(monkeypatch):
    """A Ray cluster: a head that runs nothing, two nodes of one core in processes of their own."""
    ray = pytest.importorskip("ray", reason="needs Ray: make cluster")
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    with ExitStack() as folders:
        with cluster.on_path(cluster.LEAN):
            here = Cluster(initialize_head=True, head_node_args={"num_cpus": 0})
            size = {"memory": 4 << 30, "object_store_memory": 100 << 20}
            for _ in range(2):
                # As on two machines: a node unpacks the kit over what it finds, and would take it
                # from under the other's jobs. Not in tmp_path: sockets' paths have to be short.
                own = folders.enter_context(TemporaryDirectory(ignore_cleanup_errors=True))
                here.add_node(num_cpus=1, temp_dir=own, **size)
        monkeypatch.setenv("RAY_ADDRESS", here.address)
        yield ray
        ray.shutdown()
        here.shutdown()


def names(out):
    return sorted(path.parent.name for path in out.glob("*/metrics.json"))


def one_by_one(out):
    """The table without a cluster."""
    return table.table(out, jobs=2), (out / "table.json").read_text()


# Where there is no Ray


def test_without_ray_a_sentence_says_how_to_get_it(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "ray", None)
    assert main(["table", "--ray", "--out", str(tmp_path / "table")]) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: --ray: ") and "pip install -r requirements-cluster.txt" in said
    hand_in(tmp_path / "class", ann=SOLVED)
    assert grade([str(tmp_path / "class"), "--out", str(tmp_path / "out"), "--ray"]) == 2
    assert "pip install -r requirements-cluster.txt" in capsys.readouterr().err


def test_where_ray_does_not_start_its_words_are_said(monkeypatch):
    ray = pytest.importorskip("ray", reason="needs Ray: make cluster")

    def init(address, **_):
        raise ConnectionError if address == "auto" else Exception("timed out during startup")

    monkeypatch.setattr(ray, "init", init)
    with pytest.raises(InputError, match="--ray: Ray does not start here: timed out during start"):
        cluster.connect()


@pytest.mark.parametrize("command", ["table", "ablation"])
def test_jobs_and_ray_do_not_go_together(command, capsys):
    assert main([command, "--ray", "--jobs", "2"]) == 2
    assert "not allowed with" in capsys.readouterr().err


def test_print_names_the_missing_runs_and_perception_comes_first(starts, tmp_path, capsys):
    out = tmp_path / "table"
    one_by_one(out)
    (out / "push-1" / "metrics.json").unlink()  # interrupted
    (out / "push-1" / "settings.json").write_text("{}")
    for name in ("push-1-literal", "slide-2-literal"):
        (out / name / "metrics.json").unlink()
    capsys.readouterr()
    assert main(["table", "--print", "--out", str(out)]) == 0
    said = capsys.readouterr()
    first, *then = said.out.splitlines()
    assert first.endswith(f"--seed 1 --threads 1 --out {out}/push-1 --episodes 10 "
                          "--from-scratch --resume")  # fmt: skip
    assert [line.split(f"--out {out}/")[1] for line in then] == [
        f"{task}-{seed}-literal --episodes 10 --weights {out}/{task}-{seed} --reward literal"
        for task, seed in (("push", 1), ("slide", 2))
    ]
    assert "first 1 may run" in said.err
    assert len(starts.read_text().splitlines()) == 12  # it ran nothing


def test_a_line_of_print_is_a_command_of_the_kit(tmp_path, capsys):
    assert main(["ablation", "--print", "--seeds", "1", "--out", str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 12
    assert all(line.startswith("python -m tasks ") for line in lines)
    assert [line for line in lines if "--from-scratch" in line] == lines[:2]


# What Ray's processes load


def test_what_starts_ray_and_what_a_cluster_calls_to_run_a_command_does_without_torch():
    code = "import sys, tests.grade.arguments; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0


def test_ray_starts_while_the_rest_is_done_and_may_fail_until_it_is_needed(monkeypatch):
    begun, started = threading.Event(), []

    def connect(kit):
        started.append((kit, begun.wait(30), threading.current_thread()))
        raise InputError("--ray: no")

    monkeypatch.setattr(cluster, "connect", connect)
    monkeypatch.setattr(cluster, "_ray", lambda: None)
    cluster.ahead(cluster.CODE, begun.set)
    assert started == [(cluster.CODE, True, threading.main_thread())]


def test_an_interrupt_while_ray_starts_ends_without_a_traceback(monkeypatch, capsys):
    def connect(kit):
        raise KeyboardInterrupt

    monkeypatch.setattr(cluster, "connect", connect)
    monkeypatch.setattr(cluster, "_ray", lambda: None)
    with pytest.raises(SystemExit) as end:
        cluster.ahead(cluster.CODE, lambda: None)
    assert (end.value.code, capsys.readouterr().err) == (130, "interrupted\n")


@pytest.mark.parametrize(("more", "begun"), [(["--ray"], True), ([], False)])
def test_ray_is_started_if_it_is_asked_for_and_there_is_a_class(more, begun, tmp_path, monkeypatch):
    started = []
    monkeypatch.setattr(cluster, "ahead", lambda kit, rest: started.append(kit))
    monkeypatch.setattr(sys, "argv", ["grade", str(tmp_path / "nothing"), *more])
    arguments.start_ray()
    assert not started
    monkeypatch.setattr(sys, "argv", ["grade", str(tmp_path), *more])
    arguments.start_ray()
    assert bool(started) is begun


@pytest.fixture
def look():
    """For a node: where the kit is, whence the library is taken that slows Ray's processes down,
    and whether its grammar has been built."""

    def found():
        import importlib.util
        import sys

        from lbw_minimal import cluster

        library = importlib.util.find_spec("rfc3987_syntax")
        return cluster.ROOT, Path(library.origin), "lark" in sys.modules

    return found


def test_a_local_cluster_finds_the_kit_where_it_is_and_builds_no_grammar(look, monkeypatch):
    pytest.importorskip("ray", reason="needs Ray: make cluster")
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setenv("PYTHONPATH", "elsewhere")
    try:
        ((_, found),) = cluster.spread(look, [(0, (), 1 << 20)])
    finally:
        cluster.leave()
    assert found == (ROOT, BARREN, False)
    assert os.environ["PYTHONPATH"] == "elsewhere" and str(cluster.LEAN) not in sys.path


def test_a_cluster_that_runs_gets_the_kit_and_builds_no_grammar(nodes, look):
    ((_, (place, library, grammar)),) = cluster.spread(look, [(0, (), 1 << 20)])
    assert place != ROOT and library != BARREN and not grammar
    assert library.read_text() == BARREN.read_text()


# Runs


def test_table_of_a_cluster_that_loses_a_node_and_a_worker_is_that_of_one_machine(
    nodes, starts, tmp_path
):
    wanted = one_by_one(tmp_path / "alone")
    starts.unlink()
    out, killed, kept = tmp_path / "table", [], {}

    def kill():
        """A worker when the second run has begun; a node and its worker when the fifth has."""
        for begun, which in ((2, [2]), (5, [1, 2])):
            while not starts.exists() or starts.read_text().count("\n") < begun:
                time.sleep(0.05)
            run = starts.read_text().splitlines()[begun - 1].split()
            kept.update({p: p.stat().st_mtime_ns for p in out.glob("*/metrics.json")})
            for i in which:
                os.kill(int(run[i]), signal.SIGKILL)
            killed.append(run)

    thread = threading.Thread(target=kill, daemon=True)
    thread.start()
    text = table.table(out, jobs=1, ray=True)
    thread.join(1)
    assert (text, (out / "table.json").read_text()) == wanted
    begun = [line.split() for line in starts.read_text().splitlines()]
    assert len(killed) == 2 and len(begun) > 12
    assert all([run[0] for run in begun].count(name) > 1 for name, *_ in killed)
    assert kept and all(path.stat().st_mtime_ns == time for path, time in kept.items())
    assert all((out / f"{name}.log").read_text() == "done\n" for name in names(out))
    assert not [run for run in killed if Path(f"/proc/{run[3]}").exists()]  # no orphans
    until = time.monotonic() + 60  # by when the head notices
    while (alive := sum(node["Alive"] for node in nodes.nodes())) > 2:
        assert time.monotonic() < until
        time.sleep(0.2)
    assert alive == 2  # the head, and one


def test_restart_repeats_nothing_finished_and_takes_the_checkpoint_along(
    nodes, starts, tmp_path, monkeypatch
):
    out, spread = tmp_path / "table", cluster.spread

    def interrupted(*args):
        for i, pair in enumerate(spread(*args)):
            if i == 2:
                raise KeyboardInterrupt
            yield pair

    monkeypatch.setattr(cluster, "spread", interrupted)
    with pytest.raises(KeyboardInterrupt):
        table.table(out, jobs=1, ray=True)
    nodes.shutdown()
    done = names(out)
    assert len(done) == 2
    (out / "slide-2").mkdir()
    (out / "slide-2" / "settings.json").write_text("{}")
    (out / "slide-2" / "policy.checkpoint").write_text("2")
    starts.unlink()
    monkeypatch.setattr(cluster, "spread", spread)
    table.table(out, jobs=1, ray=True)
    begun = [line.split()[0] for line in starts.read_text().splitlines()]
    assert len(names(out)) == 12 and sorted([*begun, *done]) == names(out)
    assert batch.read(out, "slide", 2)["wins"] == (5 + 6) % 11 + 2
    assert not list(out.glob("*/*.checkpoint"))
    monkeypatch.setattr(cluster, "spread", lambda *_: pytest.fail("a run is repeated"))
    table.table(out, jobs=1, ray=True)


def test_a_run_that_fails_is_named_when_the_others_have_ended(nodes, starts, tmp_path):
    toy = tmp_path / "toy.py"
    fails = "seen = 0\nif (task, seed) == ('push', 1): sys.exit('no room')"
    toy.write_text(toy.read_text().replace("seen = 0", fails))
    with pytest.raises(InputError, match=r"push-1: the run ended with code 1; see .*push-1.log"):
        table.table(tmp_path, jobs=1, ray=True)
    assert len(names(tmp_path)) == 5
    assert (tmp_path / "push-1.log").read_text() == "no room\n"


# Nodes that refuse


def test_what_a_node_refuses_another_does_and_it_is_said(nodes, capsys):
    cluster.connect()
    able = [n["NodeID"] for n in nodes.nodes() if n["Resources"].get("CPU")]

    def fussy(bad, i):
        import time

        import ray

        from lbw_minimal.cluster import Refused

        time.sleep(0.2)
        if ray.get_runtime_context().get_node_id() in bad:
            raise Refused("not here")
        if i == 3:
            raise ValueError("three")
        return i * i

    jobs = [(i, (able[:1], i), 1 << 20) for i in range(8)]
    found = dict(cluster.spread(fussy, jobs))
    failed = found.pop(3)
    assert found == {i: i * i for i in range(8) if i != 3}
    assert isinstance(failed, ValueError) and str(failed) == "three"
    assert capsys.readouterr().err.count("not here") == 1
    with pytest.raises(InputError, match=r"no node takes these jobs.*not here.*not here"):
        list(cluster.spread(fussy, [(i, (able, i), 1 << 20) for i in range(4)]))


def test_a_sandbox_that_does_not_hold_is_found(monkeypatch):
    def failing():
        with sandbox.Sandbox() as box:
            return sandbox.failing(box)

    command = sandbox.command
    monkeypatch.setattr("shutil.which", lambda name: None)  # Landlock alone, or nothing
    assert bool(failing()) != sandbox.has_landlock()
    monkeypatch.setattr(sandbox, "command", lambda fd: [*command(fd), "/"])
    assert "could read its files" in failing()
    monkeypatch.setattr(sandbox, "command", lambda fd: ["false"])
    assert "does not start" in failing()


def test_a_node_without_a_sandbox_does_not_grade(monkeypatch):
    monkeypatch.setattr(tests.grade.cluster, "_failing", lambda: "its sandbox does not start")
    with pytest.raises(cluster.Refused, match="its sandbox does not start"):
        grade_here([], [], "", ["6.1"], 2, False)


def test_a_node_keeps_its_sandbox_and_gets_a_new_one_after_a_failure(monkeypatch):
    box = sandbox.Sandbox()
    monkeypatch.setattr(tests.grade.cluster, "_box", lambda: box)
    solved = [File("06_reward.ipynb", json.dumps(SOLVED).encode())]
    with box:
        _, (first,), _ = grade_here(solved, [], "", ["6.1"], 2, False)
        worker = box.process
        _, (again,), _ = grade_here(solved, [], "", ["6.1"], 2, False)
        assert first == again and first.points == first.most
        assert box.process is worker and worker.poll() is None
        with pytest.raises(KeyError):
            grade_here(solved, [], "", ["no such exercise"], 2, False)
        assert worker.poll() is not None and box.process is None


# Grading


def hand_in(folder, **books):
    for name, book in books.items():
        (folder / name).mkdir(parents=True)
        text = book if isinstance(book, str) else json.dumps(book)
        (folder / name / "06_reward.ipynb").write_text(text)


def answered(source):
    """Notebook 6, solved but for 6.1."""
    book = json.loads(json.dumps(SOLVED))
    for cell in book["cells"]:
        if cell["metadata"].get("nbgrader", {}).get("grade_id") == "ex-6-1":
            cell["source"] = source
    return book


def test_grades_of_a_cluster_are_those_of_one_machine(nodes, tmp_path, monkeypatch):
    peek = f"x = open({str(ROOT / 'tests' / 'test_cluster.py')!r}).read()\ndef r1(z, z_E):\n    x"
    crash = "import os\ndef r1(z, z_E):\n    os._exit(0)"
    folder = tmp_path / "class"
    hand_in(folder, ann=SOLVED, bob=answered(peek), cy=answered(crash), dee="{")
    (folder / "eve.ipynb").write_text(json.dumps(answered("def r1(z, z_E):\n    return 1.0")))
    (folder / "fay.zip").write_bytes(b"PK")
    every = [str(folder), "--notebooks", "6", "--seed", "3", "--gradescope", "--out"]
    assert grade([*every, str(tmp_path / "alone")]) == 0
    assert grade([*every, str(tmp_path / "there"), "--ray"]) == 0
    alone, there = (
        {p.relative_to(out): p.read_bytes() for p in sorted(out.rglob("*")) if p.is_file()}
        for out in (tmp_path / "alone", tmp_path / "there")
    )
    assert len(alone) == 3 + 5 + 6 * 3 and alone == there  # of the class, its reports, and each
    assert not nodes.is_initialized()  # it has left
    monkeypatch.setattr(cluster, "spread", lambda *_: pytest.fail("it is graded again"))
    assert grade([*every, str(tmp_path / "there"), "--ray"]) == 0
    hand_in(folder, gus=SOLVED)
    sent = []
    monkeypatch.setattr(tests.grade.cluster, "spread", lambda jobs: sent.extend(jobs) or [])
    with pytest.raises(KeyError):  # nothing came back
        grade([*every, str(tmp_path / "there"), "--ray"])
    assert [entry.name for entry, _ in sent] == ["gus"]
