"""A place for a student's code: a process that cannot read, write, send or stay.

Two walls: bubblewrap (`bwrap`), where it is installed, shows it the Python installation and nothing
else of the disk, no other process, no network. Inside, the process gives up files, calls and
resources itself (Landlock, seccomp, limits, see `cell/worker.py`). `warning` says what is missing
on this machine.
"""

from __future__ import annotations

import contextlib
import functools
import os
import select
import shutil
import signal
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

from tests.grade.cell import wire
from tests.grade.cell.worker import has_landlock
from tests.grade.exercise import Exercise

CELL = Path(__file__).resolve().parent / "cell"
SYSTEM = ("/usr", "/lib", "/lib64", "/bin", "/etc/ld.so.cache", "/etc/alternatives")
DEVICES = ("/dev/null", "/dev/zero", "/dev/random", "/dev/urandom")
MEMORY = 2 << 30  # bytes a student's code may take
CPU = 10  # s of processor time for one exercise
WALL = 15  # s for one call, asleep or not
ENDED = (
    f"the process ended: an exit, a crash, or more than {CPU} s of processor time "
    "(an endless loop?)"
)
START = 120  # s for the libraries to load on a busy machine
LEAVING = 5  # s for a process that has lost its channel to end


class Lost(Exception):
    """The student's process is gone, or had to go; the message says why, to the student."""


def warning() -> str:
    """What the sandbox lacks on this machine, one sentence to the lecturer; empty if nothing."""
    if shutil.which("bwrap"):
        return ""
    files = "the kernel alone (Landlock) keeps this machine's files from the code of submissions"
    if not has_landlock():
        files = "the code of submissions can READ THE FILES of this machine, solutions included"
    return (
        f"bubblewrap is not installed: {files}. "
        "Install it before you grade (Debian: apt install bubblewrap)"
    )


@functools.cache
def failing() -> str:
    """What is wrong with the sandbox of this machine, found by trying it; empty if it holds.

    The code of a submission has to start there and must not read this file.
    """
    look = f"def look():\n    return open({str(Path(__file__).resolve())!r}).read(1)"
    try:
        with Sandbox() as box:
            box.open(Exercise("0.0", "", "look", "", "", "probe = look"), look, [])
            got = box.call(())[0]
    except (RuntimeError, Lost, OSError) as e:
        return f"its sandbox does not start: {e}"
    if type(got) is wire.Raised:
        return ""
    return "the code of submissions could read its files: install bubblewrap there"


def command(fd: int) -> list[str]:
    """How to start the worker: inside bubblewrap where there is one."""
    homes = {Path(p).resolve() for p in (sys.prefix, sys.base_prefix)} | {Path(sys.prefix), CELL}
    homes = sorted(map(str, homes))
    readable = [*SYSTEM, *DEVICES, *homes]
    python = [sys.executable, "-I", "-B", str(CELL / "worker.py"), str(fd), *readable]
    bwrap = shutil.which("bwrap")
    if not bwrap:
        return python
    binds = [x for path in SYSTEM for x in ("--ro-bind-try", path, path)]
    binds += [x for path in homes for x in ("--ro-bind", path, path)]
    return [
        bwrap, "--unshare-all", "--die-with-parent", "--new-session", "--clearenv",
        "--cap-drop", "ALL", "--size", str(8 << 20), "--tmpfs", "/tmp", *binds,
        "--proc", "/proc", "--dev", "/dev", "--setenv", "OMP_NUM_THREADS", "1",
        "--chdir", "/tmp", *python,
    ]  # fmt: skip


class Sandbox:
    """One worker process: `open` an exercise, `call` it, `close` it. When lost it starts again.

    An exercise's process has a channel of its own. That it has ended says the worker, on
    `control`, where no student's code can speak.
    """

    def __init__(self):
        self.process = self.control = self.channel = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.kill()

    def start(self) -> None:
        self.control, theirs = socket.socketpair()
        env = {"OMP_NUM_THREADS": "1", "PATH": os.environ.get("PATH", "")}
        self.process = subprocess.Popen(
            command(theirs.fileno()), pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True, env=env,
        )  # fmt: skip
        theirs.close()
        try:
            if self._receive(self.control, START) != b"ready":
                raise Lost("the grading process spoke before its turn")
        except Lost as e:
            raise RuntimeError("the grading process does not start") from e

    def kill(self) -> None:
        """End the worker and all it has started."""
        self._hang_up()
        if self.process:
            for pid in _descendants(self.process.pid):
                _kill(pid)
            self.process.kill()
            self.process.wait()
            self.control.close()
            self.process = self.control = None

    def open(
        self, exercise: Exercise, source: str, helpers: list, below: list = (), **how: bool
    ) -> wire.Raised | None:
        """Define `source`, an answer, after what it needs; what it raised, or None. Raises Lost.

        helpers, below: see `Answer`. how: over and definitions_only, see `define`.
        """
        if not self.process:
            self.start()
        job = {"source": source, "helpers": list(helpers), "below": list(below)}
        job |= {"name": exercise.name, "given": exercise.given, "probe": exercise.probe}
        job |= {"memory": MEMORY, "cpu": CPU, "over": False, "definitions_only": False} | how
        try:
            wire.send(self.control, wire.encode(job))
            _, (fd,), _, _ = socket.recv_fds(self.control, 1, 1)
        except (OSError, ValueError):
            raise self._lost(ENDED) from None
        self.channel = socket.socket(fileno=fd)
        failed = self._answer()
        if type(failed) is str:  # before the student's first line
            raise RuntimeError(failed)
        return failed

    def call(self, args: tuple):
        """(what the probe returned or raised, whether it changed its arguments). Raises Lost."""
        try:
            self.channel.settimeout(WALL)
            wire.send(self.channel, wire.encode(args))
        except OSError:
            raise self._lost(ENDED) from None
        answer = self._answer()
        if type(answer) is not list or len(answer) != 2:
            raise self._lost("it sent something else than an answer")
        return answer[0], answer[1] is True

    def close(self) -> None:
        """Leave the exercise; its process ends."""
        if self.channel:
            self._hang_up()
            try:
                self._receive(self.control, LEAVING)
            except Lost:
                self.kill()

    def _hang_up(self) -> None:
        if self.channel:
            self.channel.close()
            self.channel = None

    def _lost(self, why: str) -> Lost:
        self.kill()
        return Lost(why)

    def _answer(self):
        try:
            return wire.decode(self._receive(self.channel, WALL))
        except wire.Garbage:
            raise self._lost("it sent something else than an answer") from None

    def _receive(self, channel, seconds: float) -> bytes:
        """One message within the time."""
        deadline, data, want = time.monotonic() + seconds, bytearray(), 8
        while len(data) < want:
            left = deadline - time.monotonic()
            if left <= 0 or not select.select([channel], [], [], left)[0]:
                raise self._lost(f"no answer within {seconds:g} s: does a loop never end?")
            try:
                part = channel.recv(min(want - len(data), 1 << 20))
            except OSError:
                part = b""
            if not part:
                raise self._lost(ENDED)
            data += part
            if want == 8 and len(data) == 8:
                want += struct.unpack("<Q", data)[0]
                if want > wire.MOST + 8:
                    raise self._lost("it sent something else than an answer, or one above 64 MB")
        return bytes(data[8:])


def _descendants(pid: int) -> list[int]:
    """Processes below `pid`, where no bubblewrap ends them together."""
    parents = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                after_the_name = (entry / "stat").read_text().rsplit(")", 1)[1]
                parents[int(entry.name)] = int(after_the_name.split()[1])
            except (OSError, IndexError, ValueError):
                continue
    found = [pid]
    for p in found:
        found += [child for child, parent in parents.items() if parent == p]
    return found[1:]


def _kill(pid: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)
