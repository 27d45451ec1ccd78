"""The walls around a student's code, tried from inside.

An answer asks the kernel for what no answer needs; what it gets comes back as its value.
"""

import json
import os
import platform
import time
from pathlib import Path

import pytest

from tests.grade import sandbox
from tests.grade.__main__ import grade_one, main
from tests.grade.cell.walls import THREADS
from tests.grade.exercise import Exercise, find
from tests.grade.sandbox import Sandbox
from tests.grade.submission import Answer

E61 = find("6.1")
# What each asks for; it has to fail. `call` is libc's syscall, numbers are those of x86_64.
ASKS = {
    "fcntl F_SETOWN": "fcntl.fcntl(CHANNEL, fcntl.F_SETOWN, 1)",
    "fcntl F_SETSIG": "fcntl.fcntl(CHANNEL, 10, 9)",
    "fcntl F_SETFL O_ASYNC": "fcntl.fcntl(CHANNEL, fcntl.F_SETFL, 0o20000)",
    "fcntl F_SETLEASE": "fcntl.fcntl(CHANNEL, fcntl.F_SETLEASE, 0)",
    "fcntl F_SETPIPE_SZ": "fcntl.fcntl(CHANNEL, 1031, 1 << 20)",
    "ioctl FIOASYNC": "fcntl.ioctl(CHANNEL, 0x5452, b'\\1\\0\\0\\0')",
    "ioctl TIOCSTI": "fcntl.ioctl(CHANNEL, 0x5412, b'x')",
    "utime": "os.utime(LIBRARY)",
    "utime of its own temporary folder": "os.utime('/tmp')",
    "setxattr": "os.setxattr(LIBRARY, 'user.x', b'1')",
    "chmod": "os.chmod(LIBRARY, 0o777)",
    "chown": "os.chown(LIBRARY, 0, 0)",
    "lchown": "os.lchown(LIBRARY, 0, 0)",
    "chroot": "os.chroot('/tmp')",
    "chdir": "os.chdir('/tmp')",
    "umask": "call(95, 0)",
    "sethostname": "call(170, b'student', 7)",
    "mkfifo": "os.mkfifo('/tmp/pipe')",
    "mknod": "os.mknod('/tmp/node')",
    "truncate": "os.truncate(LIBRARY, 0)",
    "a file to write": "open('/tmp/x', 'w')",
    "a file to append to": "open(LIBRARY, 'a')",
    "a nameless file": "os.open('/tmp', os.O_TMPFILE | os.O_RDWR)",
    "a file in memory": "os.memfd_create('x')",
    "POSIX shared memory": "open('/dev/shm/x', 'wb')",
    "SysV shared memory": "call(29, 77, 4096, 0o1777)",
    "a SysV semaphore": "call(64, 77, 1, 0o1777)",
    "a SysV queue": "call(68, 77, 0o1777)",
    "a POSIX queue": "call(240, b'/x', 0o102, 0o666, None)",
    "a key": "call(248, b'user', b'x', b'y', 1, -3)",
    "locked memory": "call(151, 1)",
    "sched_setscheduler": "os.sched_setscheduler(PARENT, os.SCHED_BATCH, os.sched_param(0))",
    "sched_setaffinity": "os.sched_setaffinity(PARENT, {0})",
    "sched_setattr": "call(314, PARENT, bytes([48]) + bytes(47), 0)",
    "setpriority": "os.setpriority(os.PRIO_PROCESS, PARENT, 19)",
    "ioprio_set": "call(251, 1, PARENT, 0)",
    "a limit of another": "resource.prlimit(PARENT, resource.RLIMIT_CPU, (1, 1))",
    "the limits of another": "resource.prlimit(PARENT, resource.RLIMIT_CPU)",
    "a limit of its own": "resource.setrlimit(resource.RLIMIT_CPU, (1, 1))",
    "a limit at an address whose low half is 0": "call(302, 0, 0, 1 << 32, None)",
    "another group": "os.setgid(65534)",
    "another user": "os.setuid(65534)",
    "a session": "os.setsid()",
    "a group of processes": "os.setpgid(0, 0)",
    "its parent's death told": "prctl(1, 0, 0, 0, 0)",
    "new privileges": "prctl(38, 0, 0, 0, 0)",
    "a subreaper": "prctl(36, 1, 0, 0, 0)",
    "fork": "os.fork()",
    "vfork": "call(58)",
    "clone, a process": "call(56, 17, None, None, None, None)",
    "clone, a thread in a new namespace": "call(56, 0x3d0f00 | 0x10000000, None, None, None, None)",
    "clone3": "call(435, bytes(88), 88)",
    "a program": "os.execv(sys.executable, ['python'])",
    "a program from a file": "call(322, 0, b'', None, None, 0x1000)",
    "unshare": "call(272, 0x10000000)",
    "setns": "call(308, 0, 0)",
    "mount": "call(165, b'none', b'/tmp', b'tmpfs', 0, None)",
    "ptrace": "call(101, 16, PARENT, 0, 0)",
    "another's memory": "call(310, PARENT, None, 0, None, 0, 0)",
    "another's files": "call(438, call(434, PARENT, 0), 0, 0)",
    "a pidfd": "call(434, PARENT, 0)",
    "kill the parent": "os.kill(PARENT, 0)",
    "kill all": "os.kill(-1, 0)",
    "kill the group": "os.kill(0, 0)",
    "tgkill": "call(234, PARENT, PARENT, 0)",
    "tkill": "call(200, PARENT, 0)",
    "a queued signal": "call(129, PARENT, 9, bytes(128))",
    "a socket": "socket.socket()",
    "a pair of sockets": "socket.socketpair()",
    "a file sent to the judge": "socket.send_fds(socket.socket(fileno=CHANNEL), [b'x'], [0])",
    "io_uring": "call(425, 1, bytes(120))",
    "bpf": "call(321, 0, None, 0)",
    "userfaultfd": "call(323, 0)",
    "perf_event_open": "call(298, bytes(128), 0, -1, -1, 0)",
    "inotify": "call(294, 0)",
    "open_by_handle_at": "call(304, 0, bytes(64), 0)",
    "the system's log": "call(103, 10, None, 0)",
    "reboot": "call(169, 0, 0, 0, None)",
    "the clock": "call(227, 0, bytes(16))",
    "the 32-bit table": "call(0x40000000 + 39)",
    "a file of the kit": "open(KIT).read(1)",
    "a folder of the kit": "os.listdir(os.path.dirname(KIT))",
    "the parent's environment": "open(f'/proc/{PARENT}/environ').read(1)",
}
TRY = """
import ctypes, fcntl, resource, socket, sys, os
libc = ctypes.CDLL(None, use_errno=True)

def is_open(fd):
    try:
        return bool(os.fstat(fd))
    except OSError:
        return False

CHANNEL = max(filter(is_open, range(64)))
PARENT, LIBRARY = os.getppid(), os.__file__

def checked(result):
    if result < 0:
        raise OSError(ctypes.get_errno(), "refused")
    return result

def call(number, *args):
    longs = (ctypes.c_long(a) if isinstance(a, int) else a for a in args)
    return checked(libc.syscall(ctypes.c_long(number), *longs))

def prctl(*args):
    return checked(libc.prctl(*args))

def look(asks, kit):
    got = []
    for name, ask in asks.items():
        try:
            eval(ask, globals() | {"KIT": kit})
        except OSError:
            continue
        except Exception as e:
            if "not allowed to raise maximum limit" in str(e):
                continue
            name += f" ({type(e).__name__}: {e})"
        got.append(name)
    return got
"""
MANY_THREADS = """
import threading, time
threading.stack_size(1 << 15)

def look():
    try:
        for _ in range(1200):
            threading.Thread(target=time.sleep, args=(60,), daemon=True).start()
    except RuntimeError:
        pass
    return threading.active_count()
"""
STATUS = """
def look():
    lines = (line.split(":") for line in open("/proc/self/status"))
    return {name: value.strip() for name, value in lines}
"""
STAYS = """
import os, signal, threading
os._exit = os.kill = lambda *_: None
for number in (1, 2, 3, 13, 14, 15):
    signal.signal(number, signal.SIG_IGN)
threading.Thread(target=signal.pause).start()

def look():
    return os.getpid()
"""


def ask(box, source, *args):
    box.close()
    assert box.open(Exercise("0.0", "", "look", "", "", "probe = look"), source, []) is None
    return box.call(args)[0]


@pytest.fixture(scope="module")
def box():
    with Sandbox() as box:
        box.start()
        yield box


@pytest.mark.skipif(platform.machine() != "x86_64", reason="needs x86-64, whose calls these are")
def test_what_no_answer_needs_is_refused(box):
    assert ask(box, TRY, ASKS, str(Path(__file__))) == []


def test_threads_are_counted(box):
    assert ask(box, MANY_THREADS) == THREADS


def test_no_capability_and_no_new_privilege_is_left(monkeypatch):
    command = sandbox.command
    monkeypatch.setattr(sandbox, "command", lambda fd: [*command(fd), "/proc"])
    with Sandbox() as box:
        status = ask(box, STATUS)
    rights = [int(status[name], 16) for name in ("CapEff", "CapPrm", "CapInh", "CapAmb")]
    assert (rights, status["NoNewPrivs"], status["Seccomp"]) == ([0] * 4, "1", "2")


def under(pid):
    """The processes that a process has started, and theirs; inside bubblewrap they have others."""
    try:
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        children = {int(c) for task in tasks for c in (task / "children").read_text().split()}
    except OSError:  # it has ended meanwhile
        return set()
    return children.union(*map(under, children))


def test_a_process_ends_with_its_exercise_and_its_worker_stays(box):
    box.close()  # of the test before
    worker, before = box.process.pid, under(box.process.pid)
    ask(box, STAYS)
    students = under(worker) - before
    began = time.monotonic()
    box.close()
    assert time.monotonic() - began < sandbox.LEAVING
    assert students and not any(Path(f"/proc/{pid}").exists() for pid in students)
    assert box.process.pid == worker and under(worker) == before


def test_a_worker_takes_what_it_has_forked_along(box):
    ask(box, STAYS)
    forked = under(box.process.pid)
    assert forked
    box.kill()
    deadline = time.monotonic() + 10
    while any(Path(f"/proc/{pid}").exists() for pid in forked) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(Path(f"/proc/{pid}").exists() for pid in forked)


# What the judge takes


def sends(body):
    """An answer to 6.1 that writes `body`, an expression, to the judge itself."""
    return (
        "import sys, struct\ndef r1(z, z_E):\n    f = sys._getframe()\n"
        "    while 'channel' not in f.f_locals:\n        f = f.f_back\n"
        f"    body = {body}\n    data = struct.pack('<Q', len(body)) + body\n"
        "    f.f_locals['channel'].sendall(struct.pack('<Q', len(data)) + data)\n"
    )


@pytest.mark.parametrize(
    "body",
    [
        "b'{\"list\": [' + b'{\"list\": []},' * 500_000 + b'{\"list\": []}]}'",
        "b'{\"list\": [' * 300_000",
        "b'[' * 5_000_000",
        'b\'{"dict": [[{"list": []}, {"v": true}]]}\'',
        'b\'{"array": "f8", "kind": false, "shape": [\' + b\'9\' * 4000 + b\']}\'',
    ],
    ids=["long", "nested", "brackets", "no key", "no shape"],
)
def test_an_answer_that_is_no_value_costs_the_judge_no_time(box, body):
    began = time.process_time()
    result = grade_one(E61, Answer(sends(body), [], ""), box)
    assert result.points == 0 and "something else than an answer" in " ".join(result.lines())
    assert time.process_time() - began < 2


def test_a_value_that_is_too_long_is_called_so(box):
    long = Answer("def r1(z, z_E):\n    return np.zeros(1 << 20)", [], "")
    said = " ".join(grade_one(E61, long, box).lines())
    assert "a value above 4 MB" in said


def test_an_exercise_has_a_limit_for_all_its_calls(box, monkeypatch):
    monkeypatch.setattr(sandbox, "EXERCISE", 2)
    slow = E61.source.replace("    dist", "    time.sleep(0.7)\n    dist", 1)
    slow = Answer(f"import time\n{slow}", [], "")
    box.start()
    began = time.monotonic()
    said = " ".join(grade_one(E61, slow, box).lines())
    assert "more than 2 s together" in said and time.monotonic() - began < 20


def test_what_an_answer_leaves_in_cycles_is_freed(box):
    box.allow(sandbox.EXERCISE)
    assert ask(box, "import gc\ndef look():\n    return gc.isenabled()") is True


# bubblewrap


@pytest.fixture
def bwrap(tmp_path, monkeypatch):
    """Puts a `bwrap` of our own in the place of the system's."""

    def put(script):
        path = tmp_path / "bin" / "bwrap"
        path.parent.mkdir()
        path.write_text(f"#!/bin/sh\n{script}\n")
        path.chmod(0o755)
        monkeypatch.setenv("PATH", f"{path.parent}:{os.environ['PATH']}")

    return put


REFUSED = "echo 'bwrap: setting up uid map: Permission denied' >&2; exit 1"


@pytest.mark.parametrize(
    ("script", "words"),
    [(REFUSED, "setting up uid map: Permission denied"), ("exit 1", "without a word"),
     ("exec sleep 60", "timed out")],
)  # fmt: skip
def test_bubblewrap_that_is_refused_is_left_out_in_its_own_words(bwrap, monkeypatch, script, words):
    monkeypatch.setattr(sandbox, "TRYING", 0.5)
    bwrap(script)
    assert "does not start" in sandbox.warning() and words in sandbox.warning()
    assert sandbox.command(3)[0] != "bwrap" and "bwrap" not in sandbox.command(3)[0]


def test_refused_bubblewrap_stops_the_class_only_if_it_is_required(bwrap, tmp_path, capsys):
    bwrap(REFUSED)
    folder = tmp_path / "class"
    (folder / "ann").mkdir(parents=True)
    cell = {"cell_type": "code", "metadata": {}, "source": f"# Exercise 6.1\n{E61.source}"}
    (folder / "ann" / "06_reward.ipynb").write_text(json.dumps({"cells": [cell]}))
    line = [str(folder), "--out", str(tmp_path / "out"), "--notebooks", "6"]
    assert main([*line, "--require-bubblewrap"]) == 2
    assert "Permission denied" in capsys.readouterr().err
    assert main(line) == 0
    said = capsys.readouterr()
    assert "Permission denied" in said.err and f"ann: {E61.points:g} of" in said.out


def test_root_is_warned(monkeypatch):
    for user, warned in ((0, True), (1000, False)):
        monkeypatch.setattr(os, "geteuid", lambda user=user: user)
        assert ("as root" in sandbox.warning()) == warned
