"""A place for a student's code: a process that cannot read, write, send or stay.

Two walls: bubblewrap (`bwrap`), where it is installed and may start, shows it the Python
installation and nothing else of the disk, no other process, no network. Inside, the process gives
up files, calls and resources itself (Landlock, seccomp, limits, see `cell/walls.py`). `warning`
says what is missing on this machine.
"""

from __future__ import annotations

import functools
import math
import os
import platform
import select
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.grade.cell import wire
from tests.grade.cell.walls import has_landlock
from tests.grade.exercise import Exercise

CELL = Path(__file__).resolve().parent / "cell"
SYSTEM = ("/usr", "/lib", "/lib64", "/bin", "/etc/ld.so.cache", "/etc/alternatives")
DEVICES = ("/dev/null", "/dev/zero", "/dev/random", "/dev/urandom")
# bytes: pieces below the first are kept when they are free, up to the second together. A world of
# PyBullet takes and gives back 30 MB.
PIECE, KEPT = 32 << 20, 256 << 20
ENVIRONMENT = {
    "OMP_NUM_THREADS": "1",
    # hugetlb: memory of the kind that forks cheaply
    "GLIBC_TUNABLES": f"glibc.malloc.hugetlb=1:glibc.malloc.mmap_threshold={PIECE}:"
    f"glibc.malloc.trim_threshold={KEPT}",
}
MEMORY = 2 << 30  # bytes a student's code may take
CPU = 10  # s of processor time for one exercise
WALL = 15  # s for one call, asleep or not
EXERCISE = 40  # s for all calls of one exercise; those of a right answer take less than one
SUBMISSION = 240  # s for all exercises of a submission
ENDED = (
    f"the process ended: an exit, a crash, or more than {CPU} s of processor time "
    "(an endless loop?)"
)
NO_ANSWER = "it sent something else than an answer"
START = 120  # s for the libraries to load on a busy machine
LEAVING = 10  # s for a process to be ended
TRYING = 30  # s for bubblewrap to start Python


ELSEWHERE = (
    "grading a class runs strangers' code and needs Linux on x86-64 for its sandbox: "
    "use WSL2 on Windows, or the kit's container"
)


class Lost(Exception):
    """The student's process is gone, or had to go; the message says why, to the student."""


def holds() -> bool:
    """Whether this system can confine a process: the filter of calls knows x86-64's alone."""
    return sys.platform == "linux" and platform.machine() == "x86_64"


def warning() -> str:
    """What the sandbox lacks on this machine, in sentences to the lecturer; empty if nothing."""
    said = []
    if lacks := bubblewrap()[1]:
        files = "the kernel alone (Landlock) keeps this machine's files from submissions"
        if not has_landlock():
            files = "the code of submissions can READ THE FILES of this machine, solutions included"
        said.append(f"{lacks}: {files}")
    if os.geteuid() == 0:
        said.append("you grade as root, to whom a hole in the sandbox gives the whole machine")
    return ". ".join(said)


def bubblewrap() -> tuple[str, str]:
    """(where it is, "") if it starts here; else ("", why not, a sentence to the lecturer)."""
    path = shutil.which("bwrap")
    if not path:
        return "", "bubblewrap is not installed (Debian: apt install bubblewrap)"
    said = _try(path)
    return ("", f"bubblewrap is installed, but does not start ({said})") if said else (path, "")


@functools.cache
def _try(path: str) -> str:
    """Start Python inside bubblewrap: its last words, empty if it started.

    Ubuntu's AppArmor and Docker's seccomp refuse it the namespaces it needs.
    """
    python = [sys.executable, "-I", "-S", "-c", ""]
    try:
        done = subprocess.run(
            [*_inside(path), *python], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE, timeout=TRYING,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as e:
        return str(e)
    return _last_words(done.stderr) or "without a word" if done.returncode else ""


def _last_words(said: bytes) -> str:
    """The last line of what a program said."""
    return (said.decode(errors="replace").strip().splitlines() or [""])[-1][:200]


def failing(box: Sandbox) -> str:
    """What is wrong with a sandbox of this machine, found by trying it; empty if it holds.

    The code of a submission has to start there and must not read this file.
    """
    look = f"def look():\n    return open({str(Path(__file__).resolve())!r}).read(1)"
    try:
        box.open(Exercise("0.0", "", "look", "", "", "probe = look"), look, [])
        got = box.call(())[0]
    except (RuntimeError, Lost, OSError) as e:
        return f"its sandbox does not start: {e}"
    finally:
        box.close()
    if type(got) is wire.Raised:
        return ""
    return "the code of submissions could read its files: install bubblewrap there"


def _readable() -> list[str]:
    """Where Python is, and the code that runs in the sandbox."""
    homes = {Path(p).resolve() for p in (sys.prefix, sys.base_prefix)} | {Path(sys.prefix), CELL}
    return sorted(map(str, homes))


def _inside(bwrap: str) -> list[str]:
    """How to start a program inside bubblewrap."""
    binds = [x for path in SYSTEM for x in ("--ro-bind-try", path, path)]
    binds += [x for path in _readable() for x in ("--ro-bind", path, path)]
    variables = [x for pair in ENVIRONMENT.items() for x in ("--setenv", *pair)]
    return [
        bwrap, "--unshare-all", "--die-with-parent", "--new-session", "--clearenv",
        "--cap-drop", "ALL", "--size", str(8 << 20), "--tmpfs", "/tmp", *binds,
        "--proc", "/proc", "--dev", "/dev", *variables, "--chdir", "/tmp",
    ]  # fmt: skip


def command(fd: int) -> list[str]:
    """How to start the worker: inside bubblewrap where that starts."""
    bwrap, _ = bubblewrap()
    python = [sys.executable, "-I", "-B", str(CELL / "worker.py"), str(fd)]
    return [*(_inside(bwrap) if bwrap else []), *python, *SYSTEM, *DEVICES, *_readable()]


class Sandbox:
    """One worker process: `open` an exercise, `call` it, `close` it. When lost it starts again.

    An exercise's process has a channel of its own. The worker ends it, and says so on `control`,
    where no student's code can speak. One worker does for many submissions: their code runs in
    processes that are forked from it, never in itself.
    """

    def __init__(self):
        self.process = self.control = self.channel = None
        self.until, self.allowed = math.inf, ""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.kill()

    def start(self) -> None:
        """Start the worker, if there is none. Raises RuntimeError."""
        if self.process:
            return
        self.control, theirs = socket.socketpair()
        env = ENVIRONMENT | {"PATH": os.environ.get("PATH", "")}
        with theirs, tempfile.TemporaryFile() as said:
            self.process = subprocess.Popen(
                command(theirs.fileno()), pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL, stderr=said, start_new_session=True, env=env,
            )  # fmt: skip
            theirs.close()
            try:
                _receive(self.control, START)
            except Lost as e:
                self.kill()
                words = _last_words(os.pread(said.fileno(), 1 << 16, 0))
                raise RuntimeError(f"the grading process does not start ({words or e})") from None

    def kill(self) -> None:
        """End the worker, and with it what it has forked."""
        self._hang_up()
        if self.process:
            self.process.kill()
            self.process.wait()
            self.control.close()
            self.process = self.control = None

    def allow(self, seconds: float) -> None:
        """From now on all calls together may take `seconds`, until this is said again."""
        self.until = time.monotonic() + seconds
        self.allowed = f"its calls took more than {seconds:.0f} s together"

    def open(
        self, exercise: Exercise, source: str, helpers: list, below: list = (), **how: bool
    ) -> wire.Raised | None:
        """Define `source`, an answer, after what it needs; what it raised, or None. Raises Lost.

        helpers, below: see `Answer`. how: over and definitions_only, see `define`.
        """
        self.start()
        job = wire.encode(_job(exercise, source, helpers, below, how))
        try:
            self.control.settimeout(WALL)
            wire.send(self.control, job)
            _, (fd,), _, _ = socket.recv_fds(self.control, 1, 1)
        except (OSError, ValueError):
            self.kill()
            raise RuntimeError("the grading process is gone") from None
        self.channel = socket.socket(fileno=fd)
        if (confined := self._answer()) != "confined":  # said before the student's first line
            raise RuntimeError(str(confined))
        return self._defined()

    def reopen(
        self, exercise: Exercise, source: str, helpers: list, below: list = (), **how: bool
    ) -> wire.Raised | None:
        """As `open`, in the process that is there: for another answer of the same student."""
        job = wire.encode(_job(exercise, source, helpers, below, how))
        try:
            self.channel.settimeout(self._seconds())
            wire.send(self.channel, b"")
            wire.send(self.channel, job)
        except OSError:
            raise self._lost(ENDED) from None
        return self._defined()

    def _defined(self) -> wire.Raised | None:
        failed = self._answer()
        if failed is not None and type(failed) is not wire.Raised:
            raise self._lost(NO_ANSWER)
        return failed

    def call(self, args: tuple):
        """(what the probe returned or raised, the kind of what it changed of its arguments or "").

        Raises Lost.
        """
        try:
            self.channel.settimeout(self._seconds())
            wire.send(self.channel, wire.encode(args))
        except OSError:
            raise self._lost(ENDED) from None
        answer = self._answer()
        if type(answer) is not list or len(answer) != 2:
            raise self._lost(NO_ANSWER)
        return answer[0], answer[1] if isinstance(answer[1], str) else ""

    def close(self) -> None:
        """Leave the exercise; its process is ended."""
        if self.channel:
            self._hang_up()
            try:
                self.control.settimeout(LEAVING)
                wire.send(self.control, b"")
                _receive(self.control, LEAVING)
            except (OSError, Lost):
                self.kill()

    def _hang_up(self) -> None:
        if self.channel:
            self.channel.close()
            self.channel = None

    def _lost(self, why: str) -> Lost:
        self.close()
        return Lost(why)

    def _seconds(self) -> float:
        """What is left for a call. Raises Lost."""
        left = self.until - time.monotonic()
        if left <= 0:
            raise self._lost(self.allowed)
        return min(WALL, left)

    def _answer(self):
        try:
            return wire.decode(_receive(self.channel, self._seconds(), wire.ANSWER))
        except wire.Garbage:
            raise self._lost(NO_ANSWER) from None
        except Lost as e:
            slow = time.monotonic() >= self.until
            raise self._lost(self.allowed if slow else str(e)) from None


def _job(exercise: Exercise, source: str, helpers: list, below: list, how: dict) -> dict:
    job = {"source": source, "helpers": list(helpers), "below": list(below)}
    return (
        job
        | exercise.job
        | {"memory": MEMORY, "cpu": CPU, "over": False, "definitions_only": False}
        | how
    )


def _receive(channel: socket.socket, seconds: float, most: int = wire.MOST) -> bytes:
    """One message of at most `most` bytes within the time. Raises Lost."""
    deadline, data, want = time.monotonic() + seconds, bytearray(), 8
    while len(data) < want:
        left = deadline - time.monotonic()
        if left <= 0 or not select.select([channel], [], [], left)[0]:
            raise Lost(f"no answer within {seconds:g} s: does a loop never end?")
        try:
            part = channel.recv(min(want - len(data), 1 << 20))
        except OSError:
            part = b""
        if not part:
            raise Lost(ENDED)
        data += part
        if want == 8 and len(data) == 8:
            want += struct.unpack("<Q", data)[0]
            if want > most + 8:
                raise Lost(f"{NO_ANSWER}, or one above {most >> 20} MB")
    return bytes(data[8:])
