"""Grading on many machines, by `lbw_minimal/cluster.py`: notebooks go out, results return."""

from __future__ import annotations

import atexit
import functools
from collections.abc import Iterator
from pathlib import Path

from lbw_minimal import cluster
from tests.grade import sandbox
from tests.grade.files import File
from tests.grade.judge import Result, settle

MEMORY = 1 << 30  # bytes a submission is given: the judge and the sandbox


def spread(jobs: list[tuple[Path, tuple]]) -> Iterator[tuple]:
    """`grade_here` on a cluster, see `spread` there. Nothing to do needs no cluster."""
    work = [(*job, MEMORY) for job in jobs]
    return cluster.spread(grade_here, work, cluster.CODE) if jobs else iter(())


def grade_here(
    files: list[File], notes: list[str], digest: str, ids: list[str], seed: int, strict: bool
) -> tuple[str, list[Result], list[str]]:
    """On a node: the digest, and what `grade` finds. strict: only inside bubblewrap. Raises Refused
    where the sandbox fails."""
    from tests.grade.__main__ import grade

    if why := (strict and sandbox.bubblewrap()[1]) or _failing():
        raise cluster.Refused(f"it does not grade, {why}")
    settle()
    try:
        results, more = grade(files, ids, seed, _box())
    except BaseException:  # the next submission gets a new one
        _box().kill()
        raise
    return digest, results, notes + more


@functools.cache
def _failing() -> str:
    """What is wrong with it, tried once."""
    return sandbox.failing(_box())


@functools.cache
def _box() -> sandbox.Sandbox:
    """The sandbox of this process, for all that it grades: to start one takes seconds."""
    box = sandbox.Sandbox()
    atexit.register(box.kill)
    return box
