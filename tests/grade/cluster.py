"""Grading on many machines, by `tasks/commands/cluster.py`: notebooks go out, results return."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import torch

from tasks.commands import cluster
from tests.grade import sandbox
from tests.grade.judge import Result
from tests.grade.submission import MOST

MEMORY = 1 << 30  # bytes a submission is given: the judge and the sandbox
Packed = list[tuple[str, int, bytes]]  # name, size and bytes; none of what is too large to be read


def spread(jobs: list[tuple[Path, tuple]]) -> Iterator[tuple]:
    """`grade_here` on a cluster, see `spread` there. Nothing to do needs no cluster."""
    return cluster.spread(grade_here, [(*job, MEMORY) for job in jobs]) if jobs else iter(())


def pack(notebooks: list[Path], entry: Path) -> Packed:
    """The notebooks of a submission. Raises OSError."""
    root = entry if entry.is_dir() else entry.parent
    sizes = [(path, path.stat().st_size) for path in notebooks]
    return [
        (str(path.relative_to(root)), size, path.read_bytes() if size <= MOST else b"")
        for path, size in sizes
    ]


def unpack(packed: Packed, folder: Path) -> None:
    """Write the notebooks of a submission; one that is too large has its size, and is empty."""
    for name, size, data in packed:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        os.truncate(path, size)


def grade_here(
    packed: Packed, digest: str, ids: list[str], seed: int
) -> tuple[str, list[Result], list[str]]:
    """On a node: the digest, and what `grade` finds. Raises Refused where the sandbox fails."""
    from tests.grade.__main__ import grade

    if why := sandbox.failing():
        raise cluster.Refused(f"it does not grade, {why}")
    torch.set_num_threads(1)
    with TemporaryDirectory() as folder:
        unpack(packed, Path(folder))
        return digest, *grade(Path(folder), ids, seed)
