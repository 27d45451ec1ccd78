"""Runs of many tasks and seeds: which are missing, how each is started, what came of it.

A run is a task, a seed and a change of the recipe, and has a folder of its own. What is finished is
not repeated, what was interrupted goes on.
"""

from __future__ import annotations

import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from lbw_minimal import cluster
from lbw_minimal.reward import MENDS
from lbw_minimal.training import InputError, read_json, write_atomic
from tasks.commands import make_folder

# Arguments of a run by its change; "" is the recipe. These train all of their networks ...
ALONE = {
    "": ["--from-scratch"],
    "classifier": ["--method", "classifier"],
    "avid": ["--method", "avid"],
    "avid-motion": ["--method", "avid", "--set", "motion=1"],
    "tracks": ["--method", "tracks"],  # which has no networks but the policy's
    # Three times the steps that reach and push have.
    "classifier-long": ["--method", "classifier", "--set", "policy_steps=9000"],
    # Other numbers of human videos than 1.
    "videos-5": ["--from-scratch", "--videos", "5"],
    "videos-15": ["--from-scratch", "--videos", "15"],
}
# ... and these learn on the perception, or the translation, of a run named here.
LATER = {
    "literal": ("", ["--reward", "literal"]),
    **{mend: ("", ["--without", mend]) for mend in MENDS},
    "wide": ("", ["--jitter", "0.02"]),
    "avid-long": ("avid", ["--method", "avid", "--set", "policy_steps=9000"]),
    # Other numbers of human videos than 15: the translation sees one of them in any case.
    "avid-1": ("avid", ["--method", "avid", "--videos", "1"]),
    "avid-5": ("avid", ["--method", "avid", "--videos", "5"]),
}
RUN = ("-m", "tasks")  # Python's arguments, before those of `command`
Job = tuple[str, int, str]  # task, seed, change
Row = dict[str, Any]  # a finished run, see `read`


def folder(out: Path, task: str, seed: int, change: str = "") -> Path:
    """The folder of a run; change: of `ALONE` or `LATER`."""
    return out / (f"{task}-{seed}-{change}" if change else f"{task}-{seed}")


def finished(path: Path, episodes: int) -> bool:
    """Whether a run has ended with that many test episodes."""
    note = path / "metrics.json"
    return note.exists() and len(read_json(note).get("episodes", ())) == episodes


def rests_on(change: str) -> str:
    """The change whose run has to be there first: its own if it stands alone."""
    return change if change in ALONE else LATER[change][0]


def command(
    out: Path, task: str, seed: int, change: str, episodes: int, fast: bool = False
) -> list[str]:
    """The arguments of one run; fast: as a smoke run."""
    path = folder(out, task, seed, change)
    args = [task, "--seed", str(seed), "--threads", "1", "--out", str(path)]
    args += ["--episodes", str(episodes)]
    if change in ALONE:
        args += ALONE[change]
    else:
        args += ["--weights", str(folder(out, task, seed, rests_on(change))), *LATER[change][1]]
    args += ["--fast"] * fast
    return args + ["--resume"] * (path / "settings.json").exists()


def memory(change: str) -> int:
    """Bytes a run is given on a cluster: LbW's largest took 1.4e9, a rival's stays under 4e9."""
    return 4_000_000_000 if change.startswith(("avid", "classifier")) else 1_500_000_000


def missing(out: Path, wanted: list[Job], episodes: int) -> tuple[list[Job], list[Job]]:
    """The runs that are not finished: those that stand alone, then those that need one of them."""
    alone = [(task, seed, rests_on(change)) for task, seed, change in wanted]
    both = list(dict.fromkeys(alone)), [job for job in wanted if job[2] not in ALONE]
    first, then = ([j for j in some if not finished(folder(out, *j), episodes)] for some in both)
    return first, then


def print_missing(out: Path, wanted: list[Job], episodes: int) -> None:
    """Print a command a line for each run that is missing, and the order to stderr."""
    first, then = missing(out, wanted, episodes)
    for job in first + then:
        print(shlex.join(["python", *RUN, *command(out, *job, episodes)]))
    if first and then:
        print(
            f"The first {len(first)} may run side by side; the other {len(then)} learn on networks "
            "of those, and may run side by side when they have ended.",
            file=sys.stderr,
        )


def run_missing(
    out: Path,
    wanted: list[Job],
    jobs: int,
    episodes: int,
    ray: bool = False,
    fast: bool = False,
) -> None:
    """Run what is not finished, `jobs` at a time or on a Ray cluster, in the order it takes.

    fast: smoke runs, on this machine. A finished run with another number of test episodes is
    tested again, not trained. Raises InputError if a run fails.
    """

    def run(job):
        path = folder(out, *job)
        print(f"running {path.name}; {path}.log tells how far it is", flush=True)
        with (out / f"{path.name}.log").open("a", encoding="utf-8") as log:
            line = [sys.executable, *RUN, *command(out, *job, episodes, fast)]
            code = subprocess.run(line, stdout=log, stderr=log).returncode
        if code:
            raise InputError(f"{path}: the run ended with code {code}; see {log.name}.")

    make_folder(out)
    for some in missing(out, wanted, episodes):
        if ray and some:
            run_on_cluster(out, some, episodes)
            continue
        with ThreadPoolExecutor(jobs) as pool:
            list(pool.map(run, some))


def run_on_cluster(out: Path, jobs: list[Job], episodes: int) -> None:
    """Run jobs on a Ray cluster, each in a folder of its own there. Raises InputError if one fails.

    A job goes out with the files of its folder, an interrupted training's checkpoint among them,
    and its folder is written when it has ended: a job whose node is lost starts again from what
    went out.
    """

    def packed(job):
        path, base = folder(out, *job), folder(out, *job[:2], rests_on(job[2]))
        there = {str(p): f"runs/{p.name}" for p in (path, base)}
        line = [*RUN, *(there.get(word, word) for word in command(out, *job, episodes))]
        files = {there[str(base)]: cluster.pack(base, "*.safetensors")} if base != path else {}
        return line, files | {there[str(path)]: cluster.pack(path)}, there[str(path)]

    failed = []
    work = [(job, packed(job), memory(job[2])) for job in jobs]
    for job, result in cluster.spread(cluster.python, work):
        path = folder(out, *job)
        if isinstance(result, Exception):
            failed.append(f"{path}: {result}")
            continue
        code, text, files = result
        log = out / f"{path.name}.log"
        with log.open("a", encoding="utf-8") as f:
            f.write(text)
        if code:
            failed.append(f"{path}: the run ended with code {code}; see {log}.")
            continue
        make_folder(path)
        for old in path.glob("*.checkpoint"):
            old.unlink()
        for name in sorted(files, key=lambda name: name == "metrics.json"):  # it says: finished
            write_atomic(path / name, files[name])
        print(f"finished {path.name}", flush=True)
    if failed:
        raise InputError(failed[0])


def read(out: Path, task: str, seed: int, change: str = "") -> Row:
    """One finished run as a row: its wins, seconds a stage, steps, and R^2 of perception."""
    metrics = read_json(folder(out, task, seed, change) / "metrics.json")
    return {
        "task": task,
        "seed": seed,
        "change": change or "mended",
        "wins": sum(e["success"] for e in metrics["episodes"]),
        "wins_at_end": sum(e["success_at_end"] for e in metrics["episodes"]),
        "episodes": len(metrics["episodes"]),
        "stages": metrics["stages"],
        "steps": metrics["settings"]["recipe"]["policy_steps"],
        "memory_mb": metrics.get("memory_mb"),
        "perception": metrics.get("perception"),
    }
